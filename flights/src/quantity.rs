//! The quantities that a log can hold, and the units each may be declared in.

use std::f64::consts::PI;
use std::fmt;

use serde::Deserialize;

/// Standard gravity in m/s^2: what an accelerometer's `g` means.
pub const STANDARD_GRAVITY: f64 = 9.80665;

/// A quantity, under the name it has in a flights file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Time; of CSV files only, any origin.
    Time,
    /// Motor commands in the order of the vehicle file's rotors.
    Command,
    /// Rotor speeds in the same order.
    RotorSpeed,
    /// Position in the world.
    Position,
    /// Velocity in the world.
    Velocity,
    /// Attitude, body to world.
    Attitude,
    /// Angular velocity in the body.
    AngularVelocity,
    /// Specific force in the body.
    SpecificForce,
    /// Voltage of the battery.
    BatteryVoltage,
}

/// A unit with its factor to SI.
pub type Unit = (&'static str, f64);

/// The unit of commands that are a share of the vehicle's range of commands.
pub const FRACTION: &str = "fraction";
/// The same in percent.
pub const PERCENT: &str = "%";

impl Quantity {
    /// All that are samples over time, in the order of [`crate::Flight`].
    pub const CHANNELS: [Self; 8] = [
        Self::Command,
        Self::RotorSpeed,
        Self::Position,
        Self::Velocity,
        Self::Attitude,
        Self::AngularVelocity,
        Self::SpecificForce,
        Self::BatteryVoltage,
    ];

    /// The name in a flights file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Command => "command",
            Self::RotorSpeed => "rotor_speed",
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Attitude => "attitude",
            Self::AngularVelocity => "angular_velocity",
            Self::SpecificForce => "specific_force",
            Self::BatteryVoltage => "battery_voltage",
        }
    }

    /// How many numbers a sample has.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::Time | Self::BatteryVoltage => 1,
            Self::Position | Self::Velocity | Self::AngularVelocity | Self::SpecificForce => 3,
            Self::Command | Self::RotorSpeed | Self::Attitude => 4,
        }
    }

    /// The units it may be declared in. Those of commands that are a share of the range have the factor to a
    /// fraction.
    #[must_use]
    pub fn units(self) -> &'static [Unit] {
        match self {
            Self::Time => &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)],
            Self::Command => &[("count", 1.0), (FRACTION, 1.0), (PERCENT, 0.01)],
            Self::RotorSpeed => &[("rad/s", 1.0), ("rpm", PI / 30.0), ("Hz", 2.0 * PI)],
            Self::Position => &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3)],
            Self::Velocity => &[("m/s", 1.0), ("cm/s", 1e-2), ("mm/s", 1e-3)],
            Self::Attitude => &[("1", 1.0)],
            Self::AngularVelocity => &[("rad/s", 1.0), ("deg/s", PI / 180.0), ("mrad/s", 1e-3)],
            Self::SpecificForce => {
                &[("m/s^2", 1.0), ("g", STANDARD_GRAVITY), ("mg", 1e-3 * STANDARD_GRAVITY)]
            }
            Self::BatteryVoltage => &[("V", 1.0), ("mV", 1e-3)],
        }
    }

    /// The factor of `unit` to SI, if the quantity can have that unit.
    #[must_use]
    pub fn factor(self, unit: &str) -> Option<f64> {
        self.units().iter().find(|(name, _)| *name == unit).map(|(_, factor)| *factor)
    }

    /// The units it may be declared in, for messages.
    #[must_use]
    pub fn unit_names(self) -> String {
        names(self.units())
    }
}

/// The units of Euler angles.
pub const ANGLES: &[Unit] = &[("deg", PI / 180.0), ("rad", 1.0)];

/// The names of `units`, for messages.
pub fn names(units: &[Unit]) -> String {
    units.iter().map(|(name, _)| format!("\"{name}\"")).collect::<Vec<_>>().join(" or ")
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
