//! The airframe: what the motors, the rotors and the air do to the body. Every backend moves the body by the
//! forces that this room gives.
//!
//! What changes slowly against a tick is settled once, by [`Airframe::begin_tick`], and held over the tick (the
//! [`Drive`]); the rest is a function of the state, evaluated at every stage of an integrator.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use crate::motor;
use crate::rotor::{self, Wrench};
use crate::state::{RotorRates, RotorState, State};
use vehicles::Vehicle;

/// A vehicle as the backends fly it: immutable.
#[derive(Debug, Clone)]
pub struct Airframe {
    vehicle: Vehicle,
}

/// What acts on the airframe over one tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drive {
    /// Rotor speeds that the motors are asked for, in the order of the motor commands.
    pub targets_rad_s: [f64; 4],
}

impl Airframe {
    /// The airframe of `vehicle`.
    #[must_use]
    pub fn new(vehicle: Vehicle) -> Self {
        Self { vehicle }
    }

    /// The vehicle as it flies.
    #[must_use]
    pub fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// What acts over the tick that begins, under raw motor `commands` held over it.
    #[must_use]
    pub fn begin_tick(&self, commands: &[f64; 4]) -> Drive {
        Drive { targets_rad_s: commands.map(|command| self.vehicle.command.speed(command)) }
    }

    /// Rates of change of the rotors.
    pub(crate) fn rotor_rates(&self, drive: &Drive, state: &State) -> [RotorRates; 4] {
        std::array::from_fn(|i| motor::rates(&self.vehicle.motor, &state.rotors[i], drive.targets_rad_s[i]))
    }

    /// All forces but gravity and contacts, and their torques about the centre of mass.
    pub(crate) fn wrench(&self, state: &State, rotors: &[RotorRates; 4]) -> Wrench {
        rotor::wrench(&self.vehicle, &state.rotors, rotors, &state.body.angular_velocity_B_rad_s)
    }

    /// The rotors with accelerations that fit their speeds and targets, as shown at the end of a tick.
    pub(crate) fn settled(&self, drive: &Drive, rotors: &[RotorState; 4]) -> [RotorState; 4] {
        std::array::from_fn(|i| motor::settled(&self.vehicle.motor, &rotors[i], drive.targets_rad_s[i]))
    }
}
