//! A step with contacts that last: impulses hold them over the step.
//!
//! Moreau's time stepping: the impulses keep the gaps from closing beyond zero at the end of the step.

use super::body::twist;
use super::energy::kinetic_J;
use super::free_bodies::VEHICLE;
use super::free_step::Free;
use super::integration::{self, take_over, take_over_bodies};
use super::islands::FOUND_M_S;
use super::multibody::Multibody;
use super::push_out::push_out;
use super::record::Record;
use super::rolling;
use super::scratch::Scratch;
use super::solver::{Body, Unilateral};
use super::touching::TOUCH_M;

/// Gaps that are not closed any further: a body that stands on several points stands on all of them. Tuned, no
/// source.
const LEVEL_M: f64 = 1e-9;

/// Makes a step of `span_s` that ends as `free`, but for the impulses of the constraints. A contact that comes
/// nearer at a rate below `ahead_m_s` and does not touch yet is not a constraint. Returns whether the
/// vehicle was pushed.
pub(super) fn constrain(
    system: &mut Multibody,
    record: &mut Record,
    scratch: &mut Scratch,
    free: &Free,
    [span_s, ahead_m_s]: [f64; 2],
) -> bool {
    set_bounds(&mut scratch.touching.constraints, &scratch.twists.now, span_s, ahead_m_s);
    record.held.start(&mut scratch.touching);
    resist(system, scratch, free, span_s);
    let places = (&free.state.body, &scratch.work.free[..]);
    scratch.ties.lay(&system.free_bodies.joints, places, &scratch.twists.then);
    scratch.touching.let_ropes_yield(&scratch.work.pulls_N_s, &mut scratch.twists.then);
    let start_J = kinetic_J(system, &scratch.twists.then, &scratch.twists.then);
    let found = scratch.solve();
    record.judge(system, scratch, found, start_J);
    record.note(system, scratch);
    record.held.keep(&scratch.touching, found.off_m_s <= FOUND_M_S);
    end(system, scratch, free, span_s)
}

/// Sets the least rates that the constraints allow at the end of the step.
fn set_bounds(constraints: &mut [Unilateral], now: &[Body], span_s: f64, ahead_m_s: f64) {
    for constraint in constraints {
        let rate_m_s = constraint.normal.rate(now);
        constraint.bound_m_s = match constraint.gap_m > TOUCH_M {
            true if rate_m_s < ahead_m_s => f64::NEG_INFINITY,
            // Over the step the gap changes by the mean of the rates at its ends.
            true => (-2.0 * constraint.gap_m / span_s - rate_m_s).min(0.0),
            false if constraint.gap_m > LEVEL_M => -constraint.gap_m / span_s,
            // The same for all that touch: four feet cannot come down by four different ways.
            false => 0.0,
        };
    }
}

/// Slows the vehicle by the friction of its rig, and its disc by rolling resistance.
fn resist(system: &Multibody, scratch: &mut Scratch, free: &Free, span_s: f64) {
    let then = &mut scratch.twists.then;
    if let Some(mounted) = system.mounted(&free.state.body) {
        let inertia_kg_m2 = system.size.inertia_min_kg_m2;
        let friction = mounted.friction(&twist(&system.state.body), inertia_kg_m2, span_s);
        let vehicle = &mut then[VEHICLE];
        vehicle.twist += vehicle.mobility * friction;
    }
    let touching = &scratch.touching;
    rolling::resist(&touching.near, &touching.constraints, then, system.size.disc_radius_m);
}

/// Ends the step with the twists that the impulses left. Returns whether the vehicle was pushed.
fn end(system: &mut Multibody, scratch: &mut Scratch, free: &Free, span_s: f64) -> bool {
    let is_pushed = scratch.touching.pushes_body(VEHICLE);
    if !scratch.touching.pushes() && !system.is_held() {
        end_freely(system, scratch, free, span_s);
        return false;
    }
    if is_pushed || system.is_held() {
        take_over(system, free, &scratch.twists.then[VEHICLE].twist, span_s);
    } else {
        system.state = free.state;
    }
    take_over_bodies(system, &scratch.work.free, &scratch.twists.then, span_s);
    push_out(system, scratch, span_s);
    integration::project(system, &mut scratch.work);
    is_pushed
}

/// Ends a step in which nothing was pushed.
fn end_freely(system: &mut Multibody, scratch: &mut Scratch, free: &Free, span_s: f64) {
    system.state = free.state;
    system.free_bodies.states.clone_from(&scratch.work.free);
    // What bounces at every step, as a disc that whirls, sinks otherwise.
    if scratch.touching.is_inside() {
        push_out(system, scratch, span_s);
    }
}
