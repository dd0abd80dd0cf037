//! Overlaps that the order of a step left: the vehicle and the bodies are moved out of them.
//!
//! No velocity is changed by that.

use super::body::shift;
use super::free_bodies::{FIRST_BODY, VEHICLE};
use super::multibody::Multibody;
use super::scratch::Scratch;
use nalgebra::Vector6;

/// Speed at which a vehicle that was put inside an object comes out of it; it takes none of that speed along.
/// Tuned, no source.
const PUSH_OUT_M_S: f64 = 1.0;

/// Errors of a pose that are left as they are.
const EXACT_M: f64 = 1e-12;

/// Moves the vehicle and the bodies out of overlaps, after a step of `span_s`.
pub(super) fn push_out(system: &mut Multibody, scratch: &mut Scratch, span_s: f64) {
    if !ask_for_shifts(scratch, span_s) {
        return;
    }
    scratch.twists.then.iter_mut().for_each(|body| body.twist = Vector6::zeros());
    scratch.solve();
    let shifts = &scratch.twists.then;
    shift(&mut system.state.body, &shifts[VEHICLE].twist);
    for (state, by) in system.free_bodies.states.iter_mut().zip(&shifts[FIRST_BODY..]) {
        if by.twist != Vector6::zeros() {
            shift(state, &by.twist);
        }
    }
}

/// Has the constraints ask for a shift over the step in place of a rate. Returns true if any overlaps.
fn ask_for_shifts(scratch: &mut Scratch, span_s: f64) -> bool {
    let (now, then) = (&scratch.twists.now, &scratch.twists.then);
    let mut is_exact = true;
    let constraints = scratch.touching.constraints.iter_mut();
    for constraint in constraints.filter(|constraint| constraint.bound_m_s.is_finite()) {
        let rates_m_s = constraint.normal.rate(now) + constraint.normal.rate(then);
        let gap_m = constraint.gap_m + rates_m_s / 2.0 * span_s;
        is_exact &= gap_m > -EXACT_M;
        constraint.bound_m_s = (-gap_m).min(PUSH_OUT_M_S * span_s);
        (constraint.impulse_N_s, constraint.friction) = (0.0, None);
    }
    !is_exact
}
