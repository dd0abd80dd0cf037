//! A step without contacts and stops: free flight, kept on the rig and the joints.
//!
//! The integrator of [`crate::NewtonEuler`] computes it; the velocities across the rig's guides are taken away after it.

use super::body::{set_twist, twist};
use super::drive::Instant;
use super::free_bodies::{Carrier, Work};
use super::multibody::Multibody;
use super::rig;
use crate::actuation::Actuation;
use crate::state::State;
use nalgebra::Vector6;

/// The end of a step without contacts and stops.
pub(super) struct Free {
    pub state: State,
    /// Change of the vehicle's twist by the bearing or joints.
    pub held: Vector6<f64>,
}

impl Free {
    /// Integrates over `span_s` from `time_s` after the start. The free bodies end in `work`.
    pub(super) fn of(
        system: &Multibody,
        work: &mut Work,
        actuation: &Actuation,
        [time_s, span_s]: [f64; 2],
    ) -> Self {
        let unheld = system.model.runge_kutta(&system.state, actuation, span_s);
        let mut state = integrate_tied(system, work, actuation, [time_s, span_s]).unwrap_or(unheld);
        if !system.is_held() {
            return Self { state: unheld, held: Vector6::zeros() };
        }
        if let Some(mounted) = system.mounted(&state.body) {
            let twist = twist(&state.body);
            set_twist(&mut state.body, &(twist + mounted.back(&mounted.mount_W_m_s(&twist))));
        }
        system.project(&mut state.body);
        Self { held: twist(&state.body) - twist(&unheld.body), state }
    }
}

/// Integrates the vehicle with the free bodies, or in its rig; returns `None` if it has neither.
fn integrate_tied(
    system: &Multibody,
    work: &mut Work,
    actuation: &Actuation,
    [time_s, span_s]: [f64; 2],
) -> Option<State> {
    if !system.free_bodies.is_empty() {
        let (model, rig) = (&system.model, system.rig.as_ref());
        let when = Instant { time_s, middle_s: time_s + span_s / 2.0 };
        let carrier = Carrier { model, rig, actuation, when };
        return Some(system.free_bodies.free_step(&carrier, &system.state, span_s, work));
    }
    let rig = system.rig.as_ref()?;
    let hold = |state: &State, rates| rig::hold(rig, &system.model, state, rates);
    Some(system.model.runge_kutta_held(&system.state, actuation, span_s, hold))
}
