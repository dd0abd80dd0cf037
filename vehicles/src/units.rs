//! The units a vehicle file may use, per dimension, with the factor that takes each to SI.

#![cfg_attr(test, allow(non_snake_case, reason = "units stand last in names: thrust_N"))]

use std::f64::consts::PI;

/// One radian per second in revolutions per minute, inverted: rpm times this is rad/s.
const RPM: f64 = PI / 30.0;

/// A physical dimension and the units accepted for it.
#[derive(Debug, Clone, Copy)]
pub struct Dimension {
    /// Name for messages.
    pub name: &'static str,
    /// Unit as written in files, and the factor to SI. The first is the SI unit itself.
    pub units: &'static [(&'static str, f64)],
}

impl Dimension {
    /// The factor that takes `unit` to SI, if this dimension has it.
    pub fn factor(&self, unit: &str) -> Option<f64> {
        self.units.iter().find(|(name, _)| *name == unit).map(|(_, factor)| *factor)
    }

    /// "a unit of mass: kg, g", for messages.
    pub fn describe(&self) -> String {
        let names: Vec<_> = self.units.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        format!("a unit of {}: {}", self.name, names.join(", "))
    }
}

/// Masses.
pub const MASS: Dimension = Dimension { name: "mass", units: &[("kg", 1.0), ("g", 1e-3)] };

/// Lengths.
pub const LENGTH: Dimension = Dimension { name: "length", units: &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3)] };

/// Times.
pub const TIME: Dimension = Dimension { name: "time", units: &[("s", 1.0), ("ms", 1e-3)] };

/// Accelerations.
pub const ACCELERATION: Dimension = Dimension { name: "acceleration", units: &[("m/s^2", 1.0)] };

/// Angles.
pub const ANGLE: Dimension = Dimension { name: "angle", units: &[("rad", 1.0), ("deg", PI / 180.0)] };

/// Moments of inertia.
pub const INERTIA: Dimension =
    Dimension { name: "moment of inertia", units: &[("kg*m^2", 1.0), ("g*m^2", 1e-3), ("g*mm^2", 1e-9)] };

/// Rotation speeds.
pub const SPEED: Dimension =
    Dimension { name: "rotation speed", units: &[("rad/s", 1.0), ("rpm", RPM), ("deg/s", PI / 180.0)] };

/// Angular accelerations.
pub const ANGULAR_ACCELERATION: Dimension =
    Dimension { name: "angular acceleration", units: &[("rad/s^2", 1.0), ("deg/s^2", PI / 180.0)] };

/// Gains from a quantity to its rate of change.
pub const PER_SECOND: Dimension = Dimension { name: "gain per time", units: &[("1/s", 1.0)] };

/// Gains from a quantity to its second rate of change.
pub const PER_SECOND_2: Dimension = Dimension { name: "gain per time squared", units: &[("1/s^2", 1.0)] };

/// Gains from a quantity to its third rate of change.
pub const PER_SECOND_3: Dimension = Dimension { name: "gain per time cubed", units: &[("1/s^3", 1.0)] };

/// Thrust coefficients.
pub const THRUST_COEFFICIENT: Dimension = Dimension {
    name: "thrust per rotation speed squared",
    units: &[("N/(rad/s)^2", 1.0), ("N/rpm^2", 1.0 / (RPM * RPM))],
};

/// Torque coefficients.
pub const TORQUE_COEFFICIENT: Dimension = Dimension {
    name: "torque per rotation speed squared",
    units: &[("N*m/(rad/s)^2", 1.0), ("N*m/rpm^2", 1.0 / (RPM * RPM))],
};

/// Pure numbers.
pub const PURE_NUMBER: Dimension = Dimension { name: "a pure number", units: &[("1", 1.0)] };

/// Parts of a whole, and relative deviations.
pub const RATIO: Dimension = Dimension { name: "a ratio", units: &[("1", 1.0), ("%", 1e-2)] };

/// Velocities.
pub const VELOCITY: Dimension =
    Dimension { name: "velocity", units: &[("m/s", 1.0), ("knot", 1852.0 / 3600.0)] };

/// Torques.
pub const TORQUE: Dimension = Dimension { name: "torque", units: &[("N*m", 1.0), ("N*mm", 1e-3)] };

/// Torques against a rotation.
pub const ROTARY_DAMPING: Dimension =
    Dimension { name: "torque per rotation speed", units: &[("N*m*s/rad", 1.0)] };

/// Torques against a deflection.
pub const ROTARY_STIFFNESS: Dimension = Dimension { name: "torque per angle", units: &[("N*m/rad", 1.0)] };

/// Masses times their distances from a point.
pub const STATIC_MOMENT: Dimension =
    Dimension { name: "static moment", units: &[("kg*m", 1.0), ("g*m", 1e-3)] };

/// Forces linear in a rotor's speed and in that of the air.
pub const ROTOR_DRAG: Dimension = Dimension {
    name: "force per rotation speed and velocity",
    units: &[("N*s^2/(m*rad)", 1.0), ("kg/rad", 1.0)],
};

/// Forces quadratic in the speed of the air.
pub const DYNAMIC_DRAG: Dimension =
    Dimension { name: "force per velocity squared", units: &[("N*s^2/m^2", 1.0), ("kg/m", 1.0)] };

/// Angles linear in the speed of the air.
pub const TILT: Dimension =
    Dimension { name: "angle per velocity", units: &[("rad*s/m", 1.0), ("deg*s/m", PI / 180.0)] };

/// Voltages.
pub const VOLTAGE: Dimension = Dimension { name: "voltage", units: &[("V", 1.0), ("mV", 1e-3)] };

/// Electrical resistances.
pub const RESISTANCE: Dimension =
    Dimension { name: "electrical resistance", units: &[("ohm", 1.0), ("mohm", 1e-3)] };

/// Electrical charges.
pub const CHARGE: Dimension =
    Dimension { name: "electrical charge", units: &[("C", 1.0), ("A*h", 3600.0), ("mA*h", 3.6)] };

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
    fn a_unit_of_another_dimension_is_not_accepted() {
        assert_eq!(MASS.factor("m"), None);
        assert!(MASS.describe().contains("\"kg\", \"g\""));
    }
}
