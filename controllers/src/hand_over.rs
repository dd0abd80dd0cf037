//! How `lqr` and `geometric` take over without a jump: a wrench beside the law's own that fades.
//!
//! Neither has an integrator in every component of the wrench, so what the predecessor asked for is met by an offset:
//! what it asked for last less what the law asks for now. It fades with [`OFFSET_FADES_S`] while the law settles.
#![allow(non_snake_case, reason = "_N names the newton")]

use crate::allocation::Wrench;
use crate::controller::{Controller, ControllerState, Told};
use crate::disturbance;
use crate::motor_lag::Made;
use nalgebra::Vector3;

/// Time constant of the fading, s. Tuned, no source: slow against the motors, fast against the position.
const OFFSET_FADES_S: f64 = 0.2;

/// The laws whose memory holds the wrench that the rotors are foreseen to make.
const FORESEEING_LAWS: [u32; 2] = [6, 7];

/// `asked` and the offset; lets it fade by one period.
pub fn with_offset(memory: &mut ControllerState, asked: &Wrench, period_s: f64) -> Wrench {
    let offset_B_N_m = Vector3::from(memory.torque_offset);
    let wrench = Wrench {
        thrust_N: asked.thrust_N + memory.thrust_offset,
        torque_B_N_m: asked.torque_B_N_m + offset_B_N_m,
    };
    let kept = (-period_s / OFFSET_FADES_S).exp();
    memory.thrust_offset *= kept;
    memory.torque_offset = (offset_B_N_m * kept).into();
    wrench
}

/// The memory with which `law`, one that foresees, asks for `wrench`. What the rotors make is another such law's
/// knowledge, or else taken to be `wrench` itself.
pub fn tracking<C: Controller>(
    law: &C,
    memory: &ControllerState,
    wrench: &Wrench,
    told: &Told<'_>,
) -> ControllerState {
    let mut taken = ControllerState {
        law: C::LAW,
        thrust: wrench.thrust_N,
        torque: wrench.torque_B_N_m.into(),
        thrust_offset: 0.0,
        torque_offset: [0.0; 3],
        ..*memory
    };
    if !FORESEEING_LAWS.contains(&memory.law) {
        Made::settled(*wrench).store(&mut taken);
        disturbance::begin(&mut taken, &told.motion);
    }
    let own = law.step(&mut taken.clone(), told).wrench;
    taken.thrust_offset = wrench.thrust_N - own.thrust_N;
    taken.torque_offset = (wrench.torque_B_N_m - own.torque_B_N_m).into();
    taken
}
