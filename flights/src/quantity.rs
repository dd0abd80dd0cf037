//! The quantities that a log can hold, and the units each may be declared in.

use std::fmt;

use diagnostics::unit::{
    ACCELERATION, ANGULAR_VELOCITY, COMMAND, Dimension, LENGTH, PURE_NUMBER, ROTOR_SPEED, TIME, VELOCITY,
    VOLTAGE,
};
use serde::Deserialize;

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

    /// The dimension whose units it may be declared in. Of commands that are a share of the range, the factor is that
    /// to a fraction.
    #[must_use]
    pub fn dimension(self) -> Dimension {
        match self {
            Self::Time => TIME,
            Self::Command => COMMAND,
            Self::RotorSpeed => ROTOR_SPEED,
            Self::Position => LENGTH,
            Self::Velocity => VELOCITY,
            Self::Attitude => PURE_NUMBER,
            Self::AngularVelocity => ANGULAR_VELOCITY,
            Self::SpecificForce => ACCELERATION,
            Self::BatteryVoltage => VOLTAGE,
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
