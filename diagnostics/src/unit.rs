//! Every unit that a file, a log or a message may use, per dimension, with the factor that takes each to SI.

#![cfg_attr(test, allow(non_snake_case, reason = "units stand last in names: thrust_N"))]

use std::f64::consts::PI;

/// One radian per second in revolutions per minute, inverted: rpm times this is rad/s.
const RPM: f64 = PI / 30.0;

/// Standard gravity (CGPM 1901), by which data sheets convert g to m/s^2, and scales a gram-force to newtons.
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;

/// The text of `unit` behind a number: a space and the unit; empty for the unit 1.
///
/// ```
/// use diagnostics::unit::behind_number;
/// assert_eq!(format!("2{}, 3{}", behind_number("m"), behind_number("1")), "2 m, 3");
/// ```
#[must_use]
pub fn behind_number(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" {unit}") }
}

/// A physical dimension and the units accepted for it.
///
/// ```
/// use diagnostics::unit::MASS;
///
/// assert_eq!(MASS.factor("g"), Some(1e-3));
/// assert_eq!(MASS.factor("m"), None);
/// assert_eq!(MASS.describe(), "a unit of mass: \"kg\", \"g\"");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dimension {
    /// Name for messages.
    name: &'static str,
    /// Unit as written in files, and the factor to SI. The first is the SI unit itself.
    pub units: &'static [(&'static str, f64)],
}

impl Dimension {
    /// The dimension called `name`, whose first unit is that of the SI.
    pub const fn of(name: &'static str, units: &'static [(&'static str, f64)]) -> Self {
        Self { name, units }
    }

    /// The factor that takes `unit` to SI, if this dimension has it.
    #[must_use]
    pub fn factor(&self, unit: &str) -> Option<f64> {
        self.units.iter().find(|(name, _)| *name == unit).map(|(_, factor)| *factor)
    }

    /// The unit in the SI.
    #[must_use]
    pub fn si(&self) -> &'static str {
        self.units[0].0
    }

    /// "a unit of mass: kg, g", for messages.
    #[must_use]
    pub fn describe(&self) -> String {
        format!("a unit of {}: {}", self.name, self.names(", "))
    }

    /// The units in quotation marks with `between` them, for messages.
    #[must_use]
    pub fn names(&self, between: &str) -> String {
        let names: Vec<_> = self.units.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        names.join(between)
    }
}

/// Masses.
pub const MASS: Dimension = Dimension::of("mass", &[("kg", 1.0), ("g", 1e-3)]);

/// Lengths.
pub const LENGTH: Dimension = Dimension::of("length", &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3)]);

/// Times.
pub const TIME: Dimension = Dimension::of("time", &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)]);

/// Accelerations.
pub const ACCELERATION: Dimension = Dimension::of(
    "acceleration",
    &[("m/s^2", 1.0), ("g", STANDARD_GRAVITY_M_S2), ("mg", 1e-3 * STANDARD_GRAVITY_M_S2)],
);

/// Rates of change of accelerations.
pub const JERK: Dimension = Dimension::of("jerk", &[("m/s^3", 1.0)]);

/// Angles.
pub const ANGLE: Dimension = Dimension::of("angle", &[("rad", 1.0), ("deg", PI / 180.0)]);

/// Moments of inertia.
pub const INERTIA: Dimension =
    Dimension::of("moment of inertia", &[("kg*m^2", 1.0), ("g*m^2", 1e-3), ("g*mm^2", 1e-9)]);

/// Rotation speeds.
pub const SPEED: Dimension =
    Dimension::of("rotation speed", &[("rad/s", 1.0), ("rpm", RPM), ("deg/s", PI / 180.0)]);

/// Rotation speeds as logs of rotors have them.
pub const ROTOR_SPEED: Dimension =
    Dimension::of("rotor speed", &[("rad/s", 1.0), ("rpm", RPM), ("Hz", 2.0 * PI)]);

/// Rotation speeds as logs of gyroscopes have them.
pub const ANGULAR_VELOCITY: Dimension =
    Dimension::of("angular velocity", &[("rad/s", 1.0), ("deg/s", PI / 180.0), ("mrad/s", 1e-3)]);

/// Angular accelerations.
pub const ANGULAR_ACCELERATION: Dimension =
    Dimension::of("angular acceleration", &[("rad/s^2", 1.0), ("deg/s^2", PI / 180.0)]);

/// Frequencies.
pub const FREQUENCY: Dimension = Dimension::of("frequency", &[("Hz", 1.0), ("kHz", 1e3)]);

/// Gains from a quantity to its rate of change.
pub const PER_SECOND: Dimension = Dimension::of("gain per time", &[("1/s", 1.0)]);

/// Gains from a quantity to its second rate of change.
pub const PER_SECOND_2: Dimension = Dimension::of("gain per time squared", &[("1/s^2", 1.0)]);

/// Gains from a quantity to its third rate of change.
pub const PER_SECOND_3: Dimension = Dimension::of("gain per time cubed", &[("1/s^3", 1.0)]);

/// Thrust coefficients.
pub const THRUST_COEFFICIENT: Dimension = Dimension::of(
    "thrust per rotation speed squared",
    &[("N/(rad/s)^2", 1.0), ("N/rpm^2", 1.0 / (RPM * RPM))],
);

/// Torque coefficients.
pub const TORQUE_COEFFICIENT: Dimension = Dimension::of(
    "torque per rotation speed squared",
    &[("N*m/(rad/s)^2", 1.0), ("N*m/rpm^2", 1.0 / (RPM * RPM))],
);

/// Pure numbers.
pub const PURE_NUMBER: Dimension = Dimension::of("a pure number", &[("1", 1.0)]);

/// Parts of a whole, and relative deviations.
pub const RATIO: Dimension = Dimension::of("a ratio", &[("1", 1.0), ("%", 1e-2)]);

/// Velocities.
pub const VELOCITY: Dimension = Dimension::of("velocity", &[("m/s", 1.0), ("cm/s", 1e-2), ("mm/s", 1e-3)]);

/// Velocities of the air, which weather services give in knots. No log of a vehicle is in them: there they would only be
/// one more unit that a wrong scale could be taken for.
pub const WIND_VELOCITY: Dimension = Dimension::of("velocity", &[("m/s", 1.0), ("knot", 1852.0 / 3600.0)]);

/// Forces; the gram-force by standard gravity.
pub const FORCE: Dimension =
    Dimension::of("force", &[("N", 1.0), ("gf", 9.806_65e-3), ("kgf", STANDARD_GRAVITY_M_S2)]);

/// Forces against a motion.
pub const LINEAR_DAMPING: Dimension = Dimension::of("force per speed", &[("N*s/m", 1.0)]);

/// Torques.
pub const TORQUE: Dimension = Dimension::of("torque", &[("N*m", 1.0), ("N*mm", 1e-3)]);

/// Torques against a rotation.
pub const ROTARY_DAMPING: Dimension =
    Dimension::of("torque per rotation speed", &[("N*m*s/rad", 1.0), ("N*m*s", 1.0)]);

/// Torques linear in a velocity.
pub const VELOCITY_TORQUE: Dimension =
    Dimension::of("torque per velocity", &[("N*m*s/m", 1.0), ("N*s", 1.0)]);

/// Forces against a way.
pub const LINEAR_STIFFNESS: Dimension = Dimension::of("force per length", &[("N/m", 1.0), ("N/mm", 1e3)]);

/// Torques against a deflection.
pub const ROTARY_STIFFNESS: Dimension = Dimension::of("torque per angle", &[("N*m/rad", 1.0)]);

/// Masses times their distances from a point.
pub const STATIC_MOMENT: Dimension = Dimension::of("static moment", &[("kg*m", 1.0), ("g*m", 1e-3)]);

/// Forces linear in a rotor's speed and in that of the air.
pub const ROTOR_DRAG: Dimension =
    Dimension::of("force per rotation speed and velocity", &[("N*s^2/(m*rad)", 1.0), ("kg/rad", 1.0)]);

/// Forces quadratic in the speed of the air.
pub const DYNAMIC_DRAG: Dimension =
    Dimension::of("force per velocity squared", &[("N*s^2/m^2", 1.0), ("kg/m", 1.0)]);

/// Angles linear in the speed of the air.
pub const TILT: Dimension = Dimension::of("angle per velocity", &[("rad*s/m", 1.0), ("deg*s/m", PI / 180.0)]);

/// Voltages.
pub const VOLTAGE: Dimension = Dimension::of("voltage", &[("V", 1.0), ("mV", 1e-3)]);

/// Electrical resistances.
pub const RESISTANCE: Dimension = Dimension::of("electrical resistance", &[("ohm", 1.0), ("mohm", 1e-3)]);

/// Electrical charges.
pub const CHARGE: Dimension =
    Dimension::of("electrical charge", &[("C", 1.0), ("A*h", 3600.0), ("mA*h", 3.6)]);

/// Electrical currents.
pub const CURRENT: Dimension = Dimension::of("current", &[("A", 1.0), ("mA", 1e-3)]);

/// Magnetic flux densities.
pub const FLUX_DENSITY: Dimension = Dimension::of("magnetic flux density", &[("T", 1.0)]);

/// Pressures.
pub const PRESSURE: Dimension = Dimension::of("pressure", &[("Pa", 1.0), ("hPa", 100.0)]);

/// Raw commands.
pub const COUNT: Dimension = Dimension::of("count", &[("count", 1.0)]);

/// Raw commands, or shares of their range.
pub const COMMAND: Dimension = Dimension::of("command", &[("count", 1.0), ("fraction", 1.0), ("%", 1e-2)]);

/// The dimensions of the fields of messages: a field of any of these can be judged and drawn in its other units.
const OF_MESSAGES: [&[Dimension]; 2] = [
    &[LENGTH, ANGLE, SPEED, VELOCITY, ACCELERATION, JERK, FORCE, TORQUE],
    &[TIME, VOLTAGE, CURRENT, FLUX_DENSITY, PRESSURE, PURE_NUMBER, COUNT],
];

/// Reason why a number cannot be converted from one unit to another.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConversionError {
    /// The units are of two dimensions.
    #[error("`{to}` is not a unit of {}; expected {}", .dimension.name, .dimension.names(" or "))]
    OtherDimension {
        /// The unit that was asked for.
        to: String,
        /// The dimension of the number.
        dimension: Dimension,
    },
    /// The number's own unit is in no table.
    #[error("the field's unit is `{from}`, which cannot be converted to `{to}`")]
    UnknownUnit {
        /// The number's unit.
        from: String,
        /// The unit that was asked for.
        to: String,
    },
}

/// The factor that turns a number in `from` into one in `to`.
///
/// # Errors
/// The units are not of one dimension.
///
/// ```
/// assert_eq!(diagnostics::convert("m", "cm"), Ok(100.0));
/// assert!(diagnostics::convert("m", "deg").unwrap_err().to_string().contains("not a unit of length"));
/// ```
pub fn convert(from: &str, to: &str) -> Result<f64, ConversionError> {
    if from == to {
        return Ok(1.0);
    }
    let known = OF_MESSAGES.into_iter().flatten().find_map(|of| Some((*of, of.factor(from)?)));
    let unknown = || ConversionError::UnknownUnit { from: from.to_owned(), to: to.to_owned() };
    let (dimension, factor) = known.ok_or_else(unknown)?;
    let other = || ConversionError::OtherDimension { to: to.to_owned(), dimension };
    Ok(factor / dimension.factor(to).ok_or_else(other)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coefficient_in_rpm_gives_the_same_thrust_in_rad_s() {
        let factor = THRUST_COEFFICIENT.factor("N/rpm^2").unwrap();
        let speed_rpm = 3930.0;
        let thrust_N = 7.6184e-8 * speed_rpm * speed_rpm;
        let speed_rad_s = speed_rpm * SPEED.factor("rpm").unwrap();
        let same_N = 7.6184e-8 * factor * speed_rad_s * speed_rad_s;
        assert!((thrust_N - same_N).abs() < 1e-14);
    }

    #[test]
    fn a_number_is_converted_within_its_dimension_alone() {
        assert!((convert("rad", "deg").unwrap() - 180.0 / PI).abs() < 1e-12);
        let error = convert("m", "deg").unwrap_err();
        assert!(error.to_string().contains("expected \"m\" or \"cm\" or \"mm\""), "{error}");
        assert_eq!(convert("foo", "foo"), Ok(1.0));
        assert!(convert("foo", "m").is_err());
    }

    #[test]
    fn a_unit_of_another_dimension_is_not_accepted() {
        assert_eq!(MASS.factor("m"), None);
        assert!(MASS.describe().contains("\"kg\", \"g\""));
    }
}
