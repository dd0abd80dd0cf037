//! The impulses of the last step, with which the search of the next one starts.
//!
//! They are part of the state of a flight: where the search starts decides the last digits of what it finds.

use super::touching::{self, Touching};
use super::world::Near;
use crate::saved::{Bounded, saved_fields};
use nalgebra::Vector3;

/// Stops of a rig at most: two along each axis, and that of its tilt.
const RIG_STOPS: usize = 7;
/// Stops of a joint at most: its two ends.
const JOINT_STOPS: usize = 2;

/// The impulses of the last step.
#[derive(Debug, Clone)]
pub(super) struct Held {
    contacts: Bounded<HeldContact>,
    stops_N_s: Bounded<f64>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct HeldContact {
    object: u32,
    /// The number of the body that touches it.
    body: u32,
    part: u32,
    impulse_N_s: f64,
    slip_W_N_s: Vector3<f64>,
}

saved_fields!(HeldContact { object, body, part, impulse_N_s, slip_W_N_s });
saved_fields!(Held { contacts, stops_N_s });

impl Held {
    /// No impulses so far, of a vehicle among `bodies` free bodies and `joints`.
    pub(super) fn new(bodies: usize, joints: usize) -> Self {
        let stops = RIG_STOPS + JOINT_STOPS * joints;
        Self { contacts: Bounded::new(touching::room(bodies)), stops_N_s: Bounded::new(stops) }
    }

    pub(super) fn clear(&mut self) {
        self.contacts.clear();
        self.stops_N_s.clear();
    }

    /// Gives the impulses to the constraints that are asked. The points of each part take them in their order.
    pub(super) fn start(&self, touching: &mut Touching) {
        let Touching { near, constraints, .. } = touching;
        let (contacts, stops) = constraints.split_at_mut(near.len());
        for (number, constraint) in contacts.iter_mut().enumerate() {
            let held = self.contact(near, number).filter(|_| constraint.bound_m_s.is_finite());
            let Some(held) = held else { continue };
            constraint.impulse_N_s = held.impulse_N_s;
            if let Some(friction) = &mut constraint.friction {
                friction.warm_start(&held.slip_W_N_s);
            }
        }
        for (constraint, held_N_s) in stops.iter_mut().zip(self.stops_N_s.as_slice()) {
            if constraint.bound_m_s.is_finite() {
                constraint.impulse_N_s = *held_N_s;
            }
        }
    }

    /// The contact of the last step at the point `near[number]`.
    fn contact(&self, near: &[Near], number: usize) -> Option<&HeldContact> {
        // Points of one part follow each other, and there are few: a wrong guess costs iterations only.
        let key = |near: &Near| (near.object, near.bodies[1] as u32, near.part);
        let this = key(&near[number]);
        let place = near[..number].iter().rev().take_while(|other| key(other) == this).count();
        let is_this = |held: &&HeldContact| (held.object, held.body, held.part) == this;
        self.contacts.as_slice().iter().filter(is_this).nth(place)
    }

    /// Keeps the impulses of a step, if they were found.
    pub(super) fn keep(&mut self, touching: &Touching, is_found: bool) {
        self.clear();
        if !is_found {
            return;
        }
        let (contacts, stops) = touching.constraints.split_at(touching.near.len());
        self.contacts.extend(touching.near.iter().zip(contacts).map(|(near, contact)| HeldContact {
            object: near.object,
            body: near.bodies[1] as u32,
            part: near.part,
            impulse_N_s: contact.impulse_N_s,
            slip_W_N_s: contact.friction.map_or(Vector3::zeros(), |friction| friction.impulse_W_N_s()),
        }));
        self.stops_N_s.extend(stops.iter().map(|stop| stop.impulse_N_s));
    }
}
