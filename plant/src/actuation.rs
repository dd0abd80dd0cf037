//! What acts on an airframe over a tick.

use crate::saved::saved_fields;
use nalgebra::Vector3;

/// What acts on an airframe over one tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Actuation {
    /// Rotor speeds that the motors are asked for, in the order of the motor commands.
    pub targets_rad_s: [f64; 4],
    /// How the air moves.
    pub air_velocity_W_m_s: Vector3<f64>,
    /// By which part of itself the thrust of each rotor is more than it should be.
    pub thrust_deviation: [f64; 4],
}

saved_fields!(Actuation { targets_rad_s, air_velocity_W_m_s, thrust_deviation });

/// The battery at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Battery {
    /// Voltage at the terminals.
    pub voltage_V: f64,
    /// Current drawn.
    pub current_A: f64,
    /// What is left of the capacity, 0 to 1.
    pub charge: f64,
}
