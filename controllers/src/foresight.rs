//! State of `lqr` and `geometric`, and its start: the wrench that the rotors are foreseen to make, and the
//! observer of disturbances.
//!
//! A predecessor may be a broken law. So only values of its state are used that this vehicle could have: no NaN, no
//! infinity, and no wrench that its rotors cannot make.

use crate::airframe::ControlledVehicle;
use crate::allocation::{Allocation, RotorWrench, THRUST_RESERVE};
use crate::control::{Integrals, MotionEstimate, within};
use crate::disturbance::{Observer, ObserverState};
use crate::law::Predecessor;
use crate::motor_lag::{Made, MotorLag};
use nalgebra::{Matrix3, Vector3};

/// Greatest difference between the foreseen velocity and the estimated one, m/s. Tuned, no source: so far off is an
/// observer of 5 rad/s against a disturbance that exceeds its limit by gravity.
const VELOCITY_MISSED_MAX_M_S: f64 = 1.0;

/// State of a law that foresees.
#[derive(Debug, Clone, Copy, PartialEq, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ForesightState")]
pub struct ForesightState {
    /// Thrust that the rotors are foreseen to make.
    #[field(unit = "N", frame = "body")]
    pub thrust_made: f64,
    /// Its rate of change.
    #[field(unit = "N/s", frame = "body")]
    pub thrust_made_rate: f64,
    /// Torque that they are foreseen to make.
    #[field(unit = "N*m", frame = "body")]
    pub torque_made: [f64; 3],
    /// Its rate of change.
    #[field(unit = "N*m/s", frame = "body")]
    pub torque_made_rate: [f64; 3],
    /// The observer of disturbances.
    pub observer: ObserverState,
}

impl ForesightState {
    fn new(made: &Made, observer: ObserverState) -> Self {
        let mut state = Self { observer, ..Self::default() };
        state.set_made(made);
        state
    }

    fn made(&self) -> Made {
        let wrench = |thrust_N, torque: [f64; 3]| RotorWrench { thrust_N, torque_B_N_m: torque.into() };
        Made {
            wrench: wrench(self.thrust_made, self.torque_made),
            rate: wrench(self.thrust_made_rate, self.torque_made_rate),
        }
    }

    fn set_made(&mut self, made: &Made) {
        self.thrust_made = made.wrench.thrust_N;
        self.torque_made = made.wrench.torque_B_N_m.into();
        self.thrust_made_rate = made.rate.thrust_N;
        self.torque_made_rate = made.rate.torque_B_N_m.into();
    }

    /// Returns the lift of the observer, as an integrator of another law would have it.
    pub(crate) fn integrals(&self) -> Integrals {
        Integrals { lift: self.observer.answer[2], turn: [0.0; 3] }
    }
}

/// A law that asked for more than a hundred times the rotors' wrench had lost its way: tuned, no source.
const PART_MADE_MIN: f64 = 0.01;

/// Model for the foresight of a vehicle at one period.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Foresight {
    /// Wrenches that the rotors can make.
    allocation: Allocation,
    /// Lag with which they make them.
    pub lag: MotorLag,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Moments and products of inertia in body axes, kg·m².
    pub inertia_B_kg_m2: Matrix3<f64>,
    /// Gravity, m/s².
    pub gravity_m_s2: f64,
    /// Time between two steps, s.
    pub period_s: f64,
    /// The most that the law's observer believes along an axis, m/s².
    disturbance_max_m_s2: f64,
}

impl Foresight {
    /// Creates the foresight of `craft` for a law that is stepped every `period_s` with `observer`.
    #[must_use]
    pub fn new(craft: &ControlledVehicle, observer: &Observer, period_s: f64) -> Self {
        Self {
            allocation: craft.allocation,
            lag: MotorLag::new(craft.vehicle.motor, period_s),
            mass_kg: craft.vehicle.mass_kg,
            inertia_B_kg_m2: craft.vehicle.inertia_kg_m2,
            gravity_m_s2: craft.vehicle.gravity_m_s2,
            period_s,
            disturbance_max_m_s2: observer.acceleration_max_m_s2,
        }
    }

    /// Returns the rotors' wrench now, one period after `last` was asked for: they followed it as far as the
    /// allocation allows.
    pub fn advance(&self, state: &mut ForesightState, last: &RotorWrench) -> Made {
        let made = self.lag.advance(&state.made(), &self.allocation.allocate(last).wrench);
        state.set_made(&made);
        made
    }

    /// `thrust_N` within limits that leave room for roll and pitch.
    #[must_use]
    pub fn limited_N(&self, thrust_N: f64) -> f64 {
        let (min_N, max_N) = self.allocation.thrust_range_N(THRUST_RESERVE);
        thrust_N.clamp(min_N, max_N)
    }

    /// Returns the state before the first tick, where the rotors carry the weight, or after another law. If
    /// that law did not foresee, the rotors are assumed to make the wrench that it asked for.
    #[must_use]
    pub fn start(
        &self,
        from: Option<&Predecessor<'_, ForesightState>>,
        motion: &MotionEstimate,
    ) -> ForesightState {
        let at_rest = ObserverState::at(motion);
        match from {
            None => ForesightState::new(&Made::settled(self.hover()), at_rest),
            Some(Predecessor { state: Some(before), .. }) => self.after_foresight(before, motion),
            Some(other) => {
                // What the integrators of a law that does not foresee lift, the observer does from now on, and it alone:
                // left beside it, they would be counted twice by the next law.
                let before = other.integrals.unwrap_or_default();
                let lift_m_s2 = within(before.lift, self.disturbance_max_m_s2);
                let observer = ObserverState { answer: [0.0, 0.0, lift_m_s2], ..at_rest };
                ForesightState::new(&Made::settled(self.possible(&other.wrench)), observer)
            }
        }
    }

    /// Returns the wrench that the rotors were asked for last, by assumption, if another law asked for `before`.
    #[must_use]
    pub fn last_wrench(&self, before: Option<&RotorWrench>) -> RotorWrench {
        before.map_or_else(|| self.hover(), |before| self.possible(before))
    }

    fn after_foresight(&self, before: &ForesightState, motion: &MotionEstimate) -> ForesightState {
        let measured_W_m_s = motion.velocity_W_m_s;
        let missed_W_m_s = Vector3::from(before.observer.velocity_foreseen) - measured_W_m_s;
        let foreseen_W_m_s = measured_W_m_s + missed_W_m_s.map(|v| within(v, VELOCITY_MISSED_MAX_M_S));
        let observer = ObserverState {
            answer: before.observer.answer.map(|a| within(a, self.disturbance_max_m_s2)),
            velocity_foreseen: foreseen_W_m_s.into(),
        };
        ForesightState::new(&self.possible_change(&before.made()), observer)
    }

    fn hover(&self) -> RotorWrench {
        RotorWrench { thrust_N: (self.mass_kg * self.gravity_m_s2), ..RotorWrench::default() }
    }

    /// The part of `wrench` that the rotors can make; hover, if it is NaN or far beyond their limits.
    fn possible(&self, wrench: &RotorWrench) -> RotorWrench {
        let allocated = self.allocation.allocate(wrench);
        let made = allocated.wrench;
        let is_finite = made.thrust_N.is_finite() && made.torque_B_N_m.iter().all(|part| part.is_finite());
        let (_, most_N) = self.allocation.thrust_range_N(0.0);
        let is_far = allocated.thrust_error_N.abs() > most_N
            || allocated.roll_pitch_part.min(allocated.yaw_part) < PART_MADE_MIN;
        if is_finite && !is_far { made } else { self.hover() }
    }

    /// The same of a wrench that changes. If a demand rises evenly, the wrench lags behind it by the delay of
    /// the lag. So the rotors have to be able to make the wrench that is this much ahead.
    fn possible_change(&self, made: &Made) -> Made {
        let (now, delay_s) = (self.possible(&made.wrench), self.lag.delay_s());
        let ahead = self.possible(&RotorWrench {
            thrust_N: now.thrust_N + made.rate.thrust_N * delay_s,
            torque_B_N_m: now.torque_B_N_m + made.rate.torque_B_N_m * delay_s,
        });
        let rate = RotorWrench {
            thrust_N: (ahead.thrust_N - now.thrust_N) / delay_s,
            torque_B_N_m: (ahead.torque_B_N_m - now.torque_B_N_m) / delay_s,
        };
        Made { wrench: now, rate }
    }
}
