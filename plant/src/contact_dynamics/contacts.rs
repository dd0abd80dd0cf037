//! Contacts of the vehicle: their beginning and end, the speed of their impact, and whether that was a crash.

use super::world::Near;
use crate::backend::ContactReport;
use crate::saved::{Bounded, saved_fields};
use crate::state::RigidBody;
use nalgebra::Vector3;

/// A contact lasts until there is this much air between: a foot that trembles on the floor touches it once.
/// Tuned, no source.
const LIFT_M: f64 = 1e-3;

/// Something near one of the vehicle's colliders, and the impulse between the two.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sighting {
    pub near: Near,
    /// Impulse between the two along the normal.
    pub impulse_N_s: f64,
    /// The object's velocity.
    pub velocity_W_m_s: Vector3<f64>,
}

impl Sighting {
    fn pushes(&self) -> bool {
        self.impulse_N_s > 0.0
    }
}

/// A contact that lasts.
#[derive(Debug, Clone, Copy, Default)]
struct Touch {
    object: u32,
    /// The vehicle's colliders that it touches, a bit for each.
    parts: u32,
    /// Those of them that the last step still saw.
    parts_seen: u32,
    /// True if the last step still saw it.
    seen: bool,
    /// True if some part of it was met since the tick began: so a contact that ends within its tick is reported.
    met: bool,
}

saved_fields!(Touch { object, parts, parts_seen, seen, met });

impl Touch {
    fn see(&mut self, sighting: &Sighting) {
        let is_near = sighting.near.gap_m < LIFT_M || sighting.pushes();
        self.seen |= is_near;
        if sighting.pushes() || (is_near && self.parts & sighting.near.part != 0) {
            self.parts_seen |= sighting.near.part;
        }
    }
}

/// The contacts from tick to tick, the longest-lasting first.
#[derive(Debug, Clone)]
pub(super) struct Contacts {
    touches: Bounded<Touch>,
    began: u32,
    crashed: bool,
    /// An impact that is faster is a crash.
    crash_speed_m_s: f64,
    /// The speed of approach of the newest impact; 0 where nothing is touched.
    impact_speed_m_s: f64,
    /// True if that impact was in this tick.
    is_impact_new: bool,
    /// Sum of the contacts' impulses along their normals since the tick began.
    pub(super) normal_impulse_W_N_s: Vector3<f64>,
}

saved_fields!(Contacts { touches, began, crashed, impact_speed_m_s, is_impact_new, normal_impulse_W_N_s });

impl Contacts {
    /// No contact so far, among at most `objects` things. An impact faster than `crash_speed_m_s` is a crash.
    pub(super) fn new(objects: usize, crash_speed_m_s: f64) -> Self {
        Self {
            touches: Bounded::new(objects),
            began: 0,
            crashed: false,
            crash_speed_m_s,
            impact_speed_m_s: 0.0,
            is_impact_new: false,
            normal_impulse_W_N_s: Vector3::zeros(),
        }
    }

    /// A tick begins.
    pub(super) fn begin_tick(&mut self) {
        self.normal_impulse_W_N_s = Vector3::zeros();
        self.is_impact_new = false;
        self.touches.retain(|touch| touch.seen);
        self.touches.iter_mut().for_each(|touch| touch.met = false);
        self.forget_impact();
    }

    fn forget_impact(&mut self) {
        if self.touches.as_slice().is_empty() {
            self.impact_speed_m_s = 0.0;
        }
    }

    /// Starts anew with `parts` of the vehicle at rest on `object`, or free. The contact at the start does not
    /// count as begun.
    pub(super) fn place(&mut self, object: Option<u32>, parts: u32) {
        self.touches.clear();
        self.touches.extend(object.into_iter().map(|object| Touch {
            object,
            parts,
            parts_seen: parts,
            seen: true,
            met: false,
        }));
        self.impact_speed_m_s = 0.0;
    }

    /// Takes in the contacts that a step found, with the vehicle's motion just before it.
    pub(super) fn note(&mut self, before: &RigidBody, sightings: impl Iterator<Item = Sighting>) {
        self.touches.iter_mut().for_each(|touch| (touch.seen, touch.parts_seen) = (false, 0));
        for sighting in sightings {
            self.normal_impulse_W_N_s += sighting.near.normal_W * sighting.impulse_N_s;
            if sighting.pushes() {
                let speed_m_s = approach_m_s(before, &sighting);
                // A part that already touches may be slammed down as well.
                self.crashed |= speed_m_s > self.crash_speed_m_s;
                self.meet(&sighting, speed_m_s);
            }
            let touching = self.touches.iter_mut().find(|touch| touch.object == sighting.near.object);
            if let Some(touch) = touching {
                touch.see(&sighting);
            }
        }
        self.touches.iter_mut().for_each(|touch| touch.parts = touch.parts_seen);
        self.touches.retain(|touch| touch.seen || touch.met);
        self.forget_impact();
    }

    /// Notes the contact that pushes a part of the vehicle, unless that part touched it before.
    fn meet(&mut self, sighting: &Sighting, speed_m_s: f64) {
        let touching = self.touches.as_slice().iter().find(|touch| touch.object == sighting.near.object);
        if touching.is_some_and(|touch| touch.parts & sighting.near.part != 0) {
            return;
        }
        if touching.is_none() {
            self.began += 1;
            let object = sighting.near.object;
            self.touches.push(Touch { object, parts: 0, parts_seen: 0, seen: true, met: true });
        }
        let fastest_m_s = if self.is_impact_new { self.impact_speed_m_s } else { 0.0 };
        (self.impact_speed_m_s, self.is_impact_new) = (speed_m_s.max(fastest_m_s), true);
    }

    /// The report on a tick over which the contacts pushed with `force_W_N`.
    pub(super) fn report(&self, force_W_N: &Vector3<f64>) -> ContactReport {
        let first = self.touches.as_slice().first();
        ContactReport {
            force_W_N: first.map_or(Vector3::zeros(), |_| *force_W_N),
            impact_speed_m_s: self.impact_speed_m_s,
            count: self.touches.as_slice().len() as u32,
            object: first.map_or(0, |touch| touch.object),
            began: self.began,
            crashed: self.crashed,
        }
    }
}

/// Returns the speed at which the vehicle's point approached the object.
fn approach_m_s(before: &RigidBody, sighting: &Sighting) -> f64 {
    let angular_velocity_W_rad_s = before.attitude_WB * before.angular_velocity_B_rad_s;
    let arm_W_m = sighting.near.point_W_m - before.position_W_m;
    let velocity_W_m_s = before.velocity_W_m_s + angular_velocity_W_rad_s.cross(&arm_W_m);
    (sighting.velocity_W_m_s - velocity_W_m_s).dot(&sighting.near.normal_W).max(0.0)
}
