//! The impact of all contacts that touch, by Newton's law of restitution.
//!
//! It takes no time: velocities change, poses do not.

use super::energy::{kinetic_J, lose_gain};
use super::free_bodies::VEHICLE;
use super::free_step::Free;
use super::integration::{take_over, take_over_bodies};
use super::islands::FOUND_M_S;
use super::multibody::Multibody;
use super::record::Record;
use super::scratch::Scratch;
use super::solver::{Body, Unilateral};
use super::touching::TOUCH_M;
use nalgebra::Vector6;

/// Has all meet that touch: the restitution's part of the rate of approach is left, as far as that makes no energy
/// (Moreau). Nothing bounces at less than `slow_m_s`. Returns whether the impulses were found.
pub(super) fn meet(
    system: &mut Multibody,
    record: &mut Record,
    scratch: &mut Scratch,
    slow_m_s: f64,
) -> bool {
    set_bounds(&mut scratch.touching.constraints, &scratch.twists.now, slow_m_s);
    scratch.twists.then.clone_from(&scratch.twists.now);
    let places = (&system.state.body, &system.free_bodies.states[..]);
    scratch.ties.lay(&system.free_bodies.joints, places, &scratch.twists.now);
    let start_J = kinetic_J(system, &scratch.twists.now, &scratch.twists.now);
    let found = scratch.solve();
    record.note(system, scratch);
    let found = lose_gain(system, scratch, found, start_J);
    record.judge(system, scratch, found, start_J);
    leave(system, scratch);
    found.off_m_s <= FOUND_M_S
}

/// Sets the rates at which the contacts part.
fn set_bounds(constraints: &mut [Unilateral], now: &[Body], slow_m_s: f64) {
    for constraint in constraints {
        let rate_m_s = constraint.normal.rate(now);
        constraint.bound_m_s = match constraint.gap_m <= TOUCH_M {
            false => f64::NEG_INFINITY,
            true if rate_m_s.abs() > slow_m_s => -constraint.restitution * rate_m_s,
            true => 0.0,
        };
    }
}

/// Has all move as the impact left them, where they are.
fn leave(system: &mut Multibody, scratch: &mut Scratch) {
    let after = scratch.twists.then[VEHICLE].twist;
    scratch.work.free.clone_from(&system.free_bodies.states);
    if after != scratch.twists.now[VEHICLE].twist {
        let start = Free { state: system.state, held: Vector6::zeros() };
        take_over(system, &start, &after, 0.0);
    }
    take_over_bodies(system, &scratch.work.free, &scratch.twists.then, 0.0);
}
