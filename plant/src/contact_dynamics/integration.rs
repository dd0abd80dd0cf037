//! The end of a step with impulses: they change the velocities of the free step.
//!
//! The poses change by half of that change times the step, as under a constant force.

use super::body::{set_twist, shift, twist};
use super::free_bodies::{FIRST_BODY, Work};
use super::free_step::Free;
use super::multibody::{Changed, Multibody};
use super::solver::{Body, part};
use crate::state::{RigidBody, State};
use nalgebra::Vector6;

/// Ends a step of `span_s` with the vehicle's twist `after`, which impulses changed from that of `free`.
pub(super) fn take_over(system: &mut Multibody, free: &Free, after: &Vector6<f64>, span_s: f64) {
    let mut body = free.state.body;
    let change = after - twist(&body);
    shift(&mut body, &(change * (span_s / 2.0)));
    set_twist(&mut body, after);
    system.state = State { body, rotors: free.state.rotors };
    add(&mut system.changed, &(change + free.held));
}

/// The same of the free bodies, at `free` without impulses, which left them with the twists of `then`.
pub(super) fn take_over_bodies(system: &mut Multibody, free: &[RigidBody], then: &[Body], span_s: f64) {
    let ends = free.iter().zip(&then[FIRST_BODY..]);
    for (state, (free, after)) in system.free_bodies.states.iter_mut().zip(ends) {
        let change = after.twist - twist(free);
        *state = *free;
        // What nothing pushed keeps its bits.
        if change != Vector6::zeros() {
            shift(state, &(change * (span_s / 2.0)));
            set_twist(state, &after.twist);
        }
    }
}

/// Removes the errors that a step left in the rig and in the joints.
pub(super) fn project(system: &mut Multibody, work: &mut Work) {
    let mut body = system.state.body;
    system.project(&mut body);
    let before = twist(&body);
    system.free_bodies.project_rigid(&system.model, &mut body, work);
    add(&mut system.changed, &(twist(&body) - before));
    system.state.body = body;
}

/// Adds a change of the vehicle's twist to those of the tick.
fn add(changed: &mut Changed, change: &Vector6<f64>) {
    let [velocity_W_m_s, spin_W_rad_s] = part(change);
    changed.velocity_W_m_s += velocity_W_m_s;
    changed.spin_W_rad_s += spin_W_rad_s;
}
