//! What `lqr` and `geometric` remember beside their laws, and how it begins: the wrench that the rotors are foreseen
//! to make, and the velocity against which disturbances show.
#![allow(non_snake_case, reason = "a trailing _N or _m names a unit")]

use crate::allocation::Wrench;
use crate::controller::{Controller, ControllerState, Told};
use crate::disturbance;
use crate::motor_lag::Made;

/// The laws that foresee: each understands what the other remembers of this.
const FORESEEING_LAWS: [u32; 2] = [6, 7];

/// The memory before the first tick: the rotors carry the weight.
#[must_use]
pub fn fresh(weight_N: f64, told: &Told<'_>) -> ControllerState {
    let weight = Wrench { thrust_N: weight_N, ..Wrench::default() };
    beginning(&ControllerState::default(), &weight, told)
}

/// The memory of `C` after another law asked for `wrench`, which the rotors are taken to make where that law did not
/// foresee.
#[must_use]
pub fn tracking<C: Controller>(
    memory: &ControllerState,
    wrench: &Wrench,
    told: &Told<'_>,
) -> ControllerState {
    if FORESEEING_LAWS.contains(&memory.law) {
        return ControllerState { law: C::LAW, ..*memory };
    }
    ControllerState { law: C::LAW, ..beginning(memory, wrench, told) }
}

fn beginning(memory: &ControllerState, wrench: &Wrench, told: &Told<'_>) -> ControllerState {
    let (thrust, torque) = (wrench.thrust_N, wrench.torque_B_N_m.into());
    let mut begun = ControllerState { thrust, torque, ..*memory };
    Made::settled(*wrench).store(&mut begun);
    disturbance::begin(&mut begun, &told.motion);
    begun
}
