//! The constraints of a step: one for each contact that is near, and one for each stop.
//!
//! Their bounds are set later, by `impact` and `lasting`.

use super::free_bodies::{FIRST_BODY, VEHICLE};
use super::free_step::Free;
use super::margin;
use super::multibody::Multibody;
use super::scratch::Scratch;
use super::solver::{Body, Friction, Row, Unilateral};
use super::world::{Near, World};
use crate::backend::Neighbour;
use nalgebra::Vector3;

/// Finds the contacts that are near, and makes a constraint of each point and each stop. The step of `span_s` would end
/// as `free` without them.
pub(super) fn find(
    system: &Multibody,
    world: &mut World,
    scratch: &mut Scratch,
    free: &Free,
    span_s: f64,
    others: &[Neighbour],
) {
    let Scratch { touching, ties, twists, work, .. } = scratch;
    let margin_m = margin::of_step(system, world, (&free.state.body, &work.free), span_s, others);
    let (vehicle, states) = (&system.state.body, &system.free_bodies.states);
    world.find_near(vehicle, others, margin_m, &mut touching.near);
    world.find_near_bodies(vehicle, states, margin_m, &mut touching.near);
    system.bodies(vehicle, states, others, &mut twists.now);
    system.bodies(&free.state.body, &work.free, others, &mut twists.then);
    touching.constraints.clear();
    touching.constraints.extend(touching.near.iter().map(|near| contact(system, &twists.now, near)));
    if let Some(mounted) = system.mounted(vehicle) {
        mounted.stops(&twists.now, VEHICLE, vehicle, &mut touching.constraints);
    }
    ties.add_stops(&system.free_bodies.joints, (vehicle, states), &twists.now, touching);
}

/// The contact at the point `near`, between two of `bodies`.
fn contact(system: &Multibody, bodies: &[Body], near: &Near) -> Unilateral {
    let (pair, arms_W_m) = (near.bodies, near.bodies.map(|body| arm_W_m(system, body, near)));
    let normal_W = near.normal_W;
    let normal = Row::at(bodies, pair, arms_W_m, &normal_W);
    Unilateral {
        friction: Some(Friction::new(bodies, pair, arms_W_m, (&normal, &normal_W), near.friction)),
        normal,
        gap_m: near.gap_m,
        restitution: near.restitution,
        bound_m_s: f64::NEG_INFINITY,
        impulse_N_s: 0.0,
    }
}

/// The vector from the centre of mass of a body to the point `near`.
fn arm_W_m(system: &Multibody, body: usize, near: &Near) -> Vector3<f64> {
    match body {
        VEHICLE => near.point_W_m - system.state.body.position_W_m,
        _ => match system.free_bodies.states.get(body.wrapping_sub(FIRST_BODY)) {
            Some(state) => near.point_W_m - state.position_W_m,
            // The world stands still, and other vehicles do not turn.
            None => Vector3::zeros(),
        },
    }
}
