//! Actuation of an airframe over a tick, and its battery.

use crate::saved::saved_fields;
use crate::state::PerRotor;
use nalgebra::Vector3;

/// Actuation of an airframe over one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuation {
    /// Rotor speeds that the motors are asked for.
    pub targets_rad_s: PerRotor<f64>,
    /// Velocity of the air.
    pub air_velocity_W_m_s: Vector3<f64>,
    /// Relative deviation of the thrust of each rotor.
    pub thrust_deviation: PerRotor<f64>,
}

impl Actuation {
    /// Motors of `rotors` rotors that are asked for no speed, in still air.
    #[must_use]
    pub fn none(rotors: usize) -> Self {
        Self::of(PerRotor::filled(rotors, 0.0))
    }

    /// Motors that are asked for these speeds, in still air.
    pub(crate) fn of(targets_rad_s: PerRotor<f64>) -> Self {
        let thrust_deviation = targets_rad_s.map(|_| 0.0);
        Self { targets_rad_s, air_velocity_W_m_s: Vector3::zeros(), thrust_deviation }
    }

    /// Becomes that of motors that are asked for these speeds, in still air.
    pub(crate) fn ask(&mut self, targets_rad_s: impl IntoIterator<Item = f64>) {
        self.targets_rad_s.assign(targets_rad_s);
        self.thrust_deviation.assign(std::iter::repeat_n(0.0, self.targets_rad_s.len()));
        self.air_velocity_W_m_s = Vector3::zeros();
    }
}

saved_fields!(Actuation { targets_rad_s, air_velocity_W_m_s, thrust_deviation });

/// The battery at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Battery {
    /// Voltage at the terminals.
    pub voltage_V: f64,
    /// Current drawn.
    pub current_A: f64,
    /// Share of the capacity that is left, 0 to 1.
    pub charge: f64,
}
