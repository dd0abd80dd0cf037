//! The kinetic energy of the vehicle and the free bodies, and what impulses add to it.
//!
//! Contacts make none: what an impact by Newton's law would make is taken away here.

use super::free_bodies::VEHICLE;
use super::multibody::Multibody;
use super::scratch::{Scratch, Twists};
use super::solver::{Body, part};
use super::unsolved::Found;
use nalgebra::Vector3;

/// The kinetic energy of the vehicle and the free bodies; the mixed one of two where they differ.
pub(super) fn kinetic_J(system: &Multibody, one: &[Body], other: &[Body]) -> f64 {
    let (vehicle, body) = (system.model.vehicle(), &system.state.body);
    let bodies_J = system.free_bodies.energy_J(one, other);
    let (one, other) = (&one[VEHICLE].twist, &other[VEHICLE].twist);
    let [[v, w], [other_v, other_w]] = [part(one), part(other)];
    let in_body = |spin_W_rad_s: &Vector3<f64>| body.attitude_WB.inverse_transform_vector(spin_W_rad_s);
    let spin_J = 0.5 * in_body(&w).dot(&(vehicle.inertia_kg_m2 * in_body(&other_w)));
    let slider_J = system.mounted(body).map_or(0.0, |mounted| mounted.slider_energy_J(one, other));
    0.5 * vehicle.mass_kg * v.dot(&other_v) + spin_J + slider_J + bodies_J
}

/// Returns the energy that impulses added to `start_J`, beyond what was asked for. Other vehicles that push do work:
/// among them it is 0.
pub(super) fn gain_J(system: &Multibody, scratch: &Scratch, start_J: f64) -> f64 {
    if scratch.touching.is_among_others() {
        return 0.0;
    }
    let end_J = kinetic_J(system, &scratch.twists.then, &scratch.twists.then);
    end_J - start_J - scratch.touching.lent_J()
}

/// Leaves the twists after an impact between those of an inelastic one, which never makes energy, and those found:
/// Newton's law makes some where friction and an arm couple (Kane and Levinson, Dynamics, 1985). Others that push do
/// work on the vehicle, and are left out of this. Where no impulses make the bodies leave as asked, the impact is
/// inelastic. Returns `found` with the greatest error of a rate that is left.
pub(super) fn lose_gain(system: &Multibody, scratch: &mut Scratch, found: Found, start_J: f64) -> Found {
    let makes_none = kinetic_J(system, &scratch.twists.then, &scratch.twists.then) <= start_J;
    if scratch.touching.is_among_others() || (found.is_met() && makes_none) {
        return found;
    }
    let dull_off_m_s = find_inelastic(scratch);
    if !found.is_met() {
        return Found { off_m_s: dull_off_m_s, ..found };
    }
    mix(system, &mut scratch.twists, start_J);
    Found { off_m_s: found.off_m_s.max(dull_off_m_s), ..found }
}

/// Finds the impulses of an inelastic impact. The twists that were found before are kept in `before`; returns by how
/// much a rate is off at most.
fn find_inelastic(scratch: &mut Scratch) -> f64 {
    for constraint in &mut scratch.touching.constraints {
        constraint.bound_m_s = constraint.bound_m_s.min(0.0);
    }
    scratch.touching.forget();
    scratch.twists.before.clone_from(&scratch.twists.then);
    scratch.twists.then.clone_from(&scratch.twists.now);
    scratch.find_impulses()
}

/// Moves the twists of the inelastic impact, `then`, towards those in `before`, as far as the energy stays below
/// `start_J`.
fn mix(system: &Multibody, twists: &mut Twists, start_J: f64) {
    let (more, dull) = (&mut twists.before, &mut twists.then);
    for (more, dull) in more.iter_mut().zip(&*dull) {
        more.twist -= dull.twist;
    }
    // The largest part s of the way to what was found at which the energy is that of before: a s^2 + 2 b s + c = 0.
    let (a, b) = (kinetic_J(system, more, more), kinetic_J(system, dull, more));
    let c = kinetic_J(system, dull, dull) - start_J;
    let part = if a > 0.0 { (((b * b - a * c).max(0.0).sqrt() - b) / a).clamp(0.0, 1.0) } else { 0.0 };
    for (dull, more) in dull.iter_mut().zip(&*more) {
        dull.twist += more.twist * part;
    }
}
