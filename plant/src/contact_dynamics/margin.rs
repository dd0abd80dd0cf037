//! The distance within which a step searches for contacts: the way that any point may move, and a little more.
//!
//! A step with nothing nearer than that is one of free flight.

use super::multibody::Multibody;
use super::world::World;
use crate::backend::Neighbour;
use crate::state::RigidBody;

/// Distance within which contacts are searched, beyond the way of a step: a contact lasts until there is a millimetre
/// of air. Tuned, no source.
const MARGIN_M: f64 = 2e-3;

/// Greatest distance within which contacts are searched, however fast the vehicle is: a vehicle that moves this
/// far in a step flies through things. Tuned, no source.
const MARGIN_MAX_M: f64 = 2.0;

/// True if nothing holds the vehicle, no body moves, and nothing is near on the way to `free`.
pub(super) fn is_clear(
    system: &Multibody,
    world: &World,
    free: &RigidBody,
    span_s: f64,
    others: &[Neighbour],
) -> bool {
    let margin_m = MARGIN_M + way_m(system, world, free, span_s);
    let is_alone = system.rig.is_none() && system.free_bodies.is_empty();
    is_alone && world.is_clear(&system.state.body.position_W_m, others, span_s, margin_m)
}

/// Returns the margin of a step of `span_s`, at whose end the vehicle and the free bodies are `vehicle` and `bodies`.
pub(super) fn of_step(
    system: &Multibody,
    world: &World,
    (vehicle, bodies): (&RigidBody, &[RigidBody]),
    span_s: f64,
    others: &[Neighbour],
) -> f64 {
    let fastest_other_m_s = others.iter().map(|other| other.velocity_W_m_s.norm()).fold(0.0, f64::max);
    let way_m = way_m(system, world, vehicle, span_s) + span_s * fastest_other_m_s;
    // Two that fly at each other.
    let bodies_m = bodies_way_m(system, world, bodies, span_s);
    let way_m = (way_m + bodies_m).max(2.0 * bodies_m);
    (MARGIN_M + way_m).min(MARGIN_MAX_M)
}

/// Returns the longest way of any point of the vehicle over a step, with half of it to spare.
fn way_m(system: &Multibody, world: &World, free: &RigidBody, span_s: f64) -> f64 {
    let reach_m = world.reach_m();
    1.5 * span_s * fastest_m_s(&system.state.body, reach_m).max(fastest_m_s(free, reach_m))
}

/// The same of the free bodies.
fn bodies_way_m(system: &Multibody, world: &World, free: &[RigidBody], span_s: f64) -> f64 {
    let reaches_m = world.body_reaches_m();
    let both = system.free_bodies.states.iter().zip(free).zip(reaches_m);
    let fastest = |((now, then), reach_m): ((&RigidBody, &RigidBody), f64)| {
        fastest_m_s(now, reach_m).max(fastest_m_s(then, reach_m))
    };
    1.5 * span_s * both.map(fastest).fold(0.0, f64::max)
}

/// Returns the greatest speed of any point of a body that reaches this far.
fn fastest_m_s(body: &RigidBody, reach_m: f64) -> f64 {
    body.velocity_W_m_s.norm() + body.angular_velocity_B_rad_s.norm() * reach_m
}
