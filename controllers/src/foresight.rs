//! What `lqr` and `geometric` remember beside their laws, and how it begins: the wrench that the rotors are foreseen
//! to make, the velocity against which disturbances show, and the disturbance.
//!
//! A predecessor that is succeeded may be a broken one, so nothing of its memory is gone on from that this vehicle could
//! not have: neither numbers that are none nor wrenches that its rotors cannot make.
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame a vector is written in, _N or _m names a unit"
)]

use crate::allocation::{Allocation, Wrench};
use crate::controller::{Controller, ControllerState, Told, within};
use crate::disturbance;
use crate::motor_lag::{Made, MotorLag};
use nalgebra::Vector3;

/// The laws that foresee: each understands what the other remembers of this.
const FORESEEING_LAWS: [u32; 2] = [6, 7];

/// How far the velocity that was foreseen may be from the one that is estimated, m/s. Tuned, no source: so far off is an
/// observer of 5 rad/s against a disturbance that exceeds its limit by gravity.
const VELOCITY_MISSED_MAX_M_S: f64 = 1.0;

/// What a memory is held against.
#[derive(Debug, Clone, Copy)]
pub struct Foresight<'a> {
    /// What the rotors can make.
    pub allocation: &'a Allocation,
    /// How fast they can.
    pub lag: &'a MotorLag,
    /// The vehicle's weight, N.
    pub weight_N: f64,
    /// The most that the law's observer believes along an axis, m/s².
    pub disturbance_max_m_s2: f64,
}

impl Foresight<'_> {
    /// The memory before the first tick: the rotors carry the weight.
    #[must_use]
    pub fn fresh(&self, told: &Told<'_>) -> ControllerState {
        begun(&Made::settled(self.hover()), told)
    }

    /// The memory of `C` after another law asked for `wrench`, which the rotors are taken to make where that law did
    /// not foresee.
    #[must_use]
    pub fn tracking<C: Controller>(
        &self,
        memory: &ControllerState,
        wrench: &Wrench,
        told: &Told<'_>,
    ) -> ControllerState {
        let asked = self.possible(wrench);
        let next = if FORESEEING_LAWS.contains(&memory.law) {
            self.gone_on(memory, told)
        } else {
            self.tracked(memory, &asked, told)
        };
        ControllerState { law: C::LAW, thrust: asked.thrust_N, torque: asked.torque_B_N_m.into(), ..next }
    }

    /// After a law that does not foresee. What its integrators lift, the observer does from now on, and it alone: left
    /// beside it, they would be counted twice by the next law.
    fn tracked(&self, memory: &ControllerState, asked: &Wrench, told: &Told<'_>) -> ControllerState {
        let lift_m_s2 = memory.handed_lift_m_s2(self.disturbance_max_m_s2).unwrap_or_default();
        let position_integral = [0.0, 0.0, lift_m_s2];
        ControllerState { position_integral, ..begun(&Made::settled(*asked), told) }
    }

    /// After one that does.
    fn gone_on(&self, memory: &ControllerState, told: &Told<'_>) -> ControllerState {
        let measured_W_m_s = told.motion.velocity_W_m_s;
        let missed_W_m_s = Vector3::from(memory.velocity_foreseen) - measured_W_m_s;
        let foreseen_W_m_s = measured_W_m_s + missed_W_m_s.map(|v| within(v, VELOCITY_MISSED_MAX_M_S));
        ControllerState {
            position_integral: memory.position_integral.map(|a| within(a, self.disturbance_max_m_s2)),
            velocity_foreseen: foreseen_W_m_s.into(),
            ..begun(&self.possible_change(&Made::recall(memory)), told)
        }
    }

    fn hover(&self) -> Wrench {
        Wrench { thrust_N: self.weight_N, ..Wrench::default() }
    }

    /// What of `wrench` the rotors can make; of one that is no number, hovering.
    fn possible(&self, wrench: &Wrench) -> Wrench {
        let wrench = self.allocation.allocate(wrench).wrench;
        let is_finite =
            wrench.thrust_N.is_finite() && wrench.torque_B_N_m.iter().all(|part| part.is_finite());
        if is_finite { wrench } else { self.hover() }
    }

    /// The same of a wrench that changes. A lag that rises evenly is its delay behind what was asked for, so that much
    /// ahead is another wrench that the rotors can make.
    fn possible_change(&self, made: &Made) -> Made {
        let (now, delay_s) = (self.possible(&made.wrench), self.lag.delay_s());
        let ahead = self.possible(&Wrench {
            thrust_N: now.thrust_N + made.rate.thrust_N * delay_s,
            torque_B_N_m: now.torque_B_N_m + made.rate.torque_B_N_m * delay_s,
        });
        let rate = Wrench {
            thrust_N: (ahead.thrust_N - now.thrust_N) / delay_s,
            torque_B_N_m: (ahead.torque_B_N_m - now.torque_B_N_m) / delay_s,
        };
        Made { wrench: now, rate }
    }
}

/// Rotors that make `made`, and an observer that begins at this motion.
fn begun(made: &Made, told: &Told<'_>) -> ControllerState {
    let thrust = made.wrench.thrust_N;
    let mut begun = ControllerState { thrust, torque: made.wrench.torque_B_N_m.into(), ..Default::default() };
    made.store(&mut begun);
    disturbance::begin(&mut begun, &told.motion);
    begun
}
