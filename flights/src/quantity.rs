//! The quantities that a log can hold, and the units each may be declared in.

use std::fmt;

use diagnostics::unit::{
    ACCELERATION, ANGULAR_VELOCITY, COMMAND, Dimension, LENGTH, PURE_NUMBER, ROTOR_SPEED, TIME, VELOCITY,
    VOLTAGE,
};
use serde::Deserialize;

/// A quantity, under the name it has in a flights file.
///
/// ```
/// use flights::Quantity;
///
/// let rates = Quantity::AngularVelocity;
/// assert_eq!((rates.name(), rates.size(), rates.dimension().factor("rad/s")), ("angular_velocity", Some(3), Some(1.0)));
/// ```
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

/// The unit of commands that are a share of the vehicle's range of commands.
pub const FRACTION: &str = "fraction";
/// The same in percent.
pub const PERCENT: &str = "%";

impl Quantity {
    /// Quantities that are samples over time, in the order of [`crate::Flight`].
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
        self.facts().0
    }

    /// Count of numbers in a sample; `None` for those that have one for each rotor.
    #[must_use]
    pub fn size(self) -> Option<usize> {
        self.facts().1
    }

    /// The dimension whose units it may be declared in. Of commands that are a share of the range, the factor is that
    /// to a fraction.
    #[must_use]
    pub fn dimension(self) -> Dimension {
        self.facts().2
    }

    fn facts(self) -> (&'static str, Option<usize>, Dimension) {
        match self {
            Self::Time => ("time", Some(1), TIME),
            Self::Command => ("command", None, COMMAND),
            Self::RotorSpeed => ("rotor_speed", None, ROTOR_SPEED),
            Self::Position => ("position", Some(3), LENGTH),
            Self::Velocity => ("velocity", Some(3), VELOCITY),
            Self::Attitude => ("attitude", Some(4), PURE_NUMBER),
            Self::AngularVelocity => ("angular_velocity", Some(3), ANGULAR_VELOCITY),
            Self::SpecificForce => ("specific_force", Some(3), ACCELERATION),
            Self::BatteryVoltage => ("battery_voltage", Some(1), VOLTAGE),
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
