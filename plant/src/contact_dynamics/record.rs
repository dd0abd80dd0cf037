//! The record of a step's impulses: the contacts of the vehicle, the impulses to start from, and a failure.
//!
//! It lasts from step to step; the buffers of `scratch` do not.

use super::contacts::{Contacts, Sighting};
use super::doubts::Doubts;
use super::energy;
use super::free_bodies::{FIRST_BODY, VEHICLE};
use super::multibody::Multibody;
use super::scratch::Scratch;
use super::solver::part;
use super::unsolved::{Found, Outcome, Unsolved};
use super::warm_start::Held;
use nalgebra::Vector3;

/// The results of impulses, from step to step.
pub(super) struct Record {
    pub contacts: Contacts,
    pub held: Held,
    /// The first impulses that were not found.
    pub unsolved: Option<Unsolved>,
    /// Results that were taken although they are off.
    pub doubts: Doubts,
    /// True if the vehicle came near to a free body in this step, on which it may do work.
    pub is_vehicle_near_bodies: bool,
}

impl Record {
    /// Notes a step of `system`, which is still at its start, without any contact.
    pub(super) fn note_none(&mut self, system: &Multibody) {
        self.contacts.note(&system.state.body, std::iter::empty());
        self.held.clear();
    }

    /// Passes the contacts of the vehicle and their impulses to the list of contacts.
    pub(super) fn note(&mut self, system: &Multibody, scratch: &Scratch) {
        let both = scratch.touching.near.iter().zip(&scratch.touching.constraints);
        let sightings = both.filter(|(near, _)| near.bodies[1] == VEHICLE).map(|(near, contact)| {
            let [velocity_W_m_s, spin_W_rad_s] = part(&scratch.twists.now[near.bodies[0]].twist);
            let state = system.free_bodies.states.get(near.bodies[0].wrapping_sub(FIRST_BODY));
            let arm_W_m = state.map_or(Vector3::zeros(), |state| near.point_W_m - state.position_W_m);
            Sighting {
                near: *near,
                impulse_N_s: contact.impulse_N_s,
                velocity_W_m_s: velocity_W_m_s + spin_W_rad_s.cross(&arm_W_m),
            }
        });
        self.contacts.note(&system.state.body, sightings);
    }

    /// Notes impulses that do not satisfy the laws, or that made energy: before them it was `start_J`.
    pub(super) fn judge(&mut self, system: &Multibody, scratch: &Scratch, found: Found, start_J: f64) {
        self.is_vehicle_near_bodies |= scratch.touching.is_vehicle_near_bodies();
        self.doubts.note_impulses(&found);
        let outcome = Outcome { found, start_J, gain_J: energy::gain_J(system, scratch, start_J) };
        let objects = &system.free_bodies.objects;
        let unsolved = || Unsolved::of(&outcome, &scratch.touching, &scratch.twists.then, objects);
        self.unsolved = self.unsolved.or_else(unsolved);
    }
}
