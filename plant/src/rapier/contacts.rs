//! What the vehicle touches: when a contact begins and ends, how fast it was met, whether that was a crash.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in, N the newton")]

use crate::backend::ContactReport;
use crate::state::RigidBody;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A contact lasts until there is this much air between: a foot that trembles on the floor touches it once.
/// Tuned, no source.
const LIFT_M: f64 = 1e-3;

/// Something near one of the vehicle's colliders after a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sighting {
    /// What it is, as `bus::messages::Contact` numbers it.
    pub object: u32,
    /// Where the two are nearest to each other.
    pub point_W_m: Vector3<f64>,
    /// The contact's normal, which points from the object to the vehicle.
    pub towards_vehicle_W: Vector3<f64>,
    /// How far they are apart; negative where they overlap.
    pub gap_m: f64,
    /// What they pushed each other with over the step.
    pub impulse_N_s: f64,
    /// The object's velocity.
    pub velocity_W_m_s: Vector3<f64>,
}

/// A contact that lasts.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Touch {
    object: u32,
    impact_speed_m_s: f64,
    /// Whether the last step still saw it.
    seen: bool,
}

/// The contacts from tick to tick, the longest-lasting first.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Contacts {
    touches: Vec<Touch>,
    began: u32,
    crashed: bool,
    /// What the contacts pushed with along their normals since the tick began.
    normal_impulse_W_N_s: Vector3<f64>,
}

impl Contacts {
    /// No contact so far, among at most `objects` things.
    pub(super) fn new(objects: usize) -> Self {
        let normal_impulse_W_N_s = Vector3::zeros();
        Self { touches: Vec::with_capacity(objects), began: 0, crashed: false, normal_impulse_W_N_s }
    }

    /// A tick begins.
    pub(super) fn begin_tick(&mut self) {
        self.normal_impulse_W_N_s = Vector3::zeros();
    }

    /// What the contacts pushed with along their normals since the tick began.
    pub(super) fn normal_impulse_W_N_s(&self) -> Vector3<f64> {
        self.normal_impulse_W_N_s
    }

    /// Starts anew with the vehicle at rest on `object`, or free. What it stands on at first did not begin.
    pub(super) fn place(&mut self, object: Option<u32>) {
        self.touches.clear();
        self.touches.extend(object.map(|object| Touch { object, impact_speed_m_s: 0.0, seen: true }));
    }

    /// Takes in what a step found, with the vehicle's motion just before it.
    pub(super) fn note(
        &mut self,
        before: &RigidBody,
        sightings: impl Iterator<Item = Sighting>,
        crash_speed_m_s: f64,
    ) {
        self.touches.iter_mut().for_each(|touch| touch.seen = false);
        for sighting in sightings {
            self.normal_impulse_W_N_s += sighting.towards_vehicle_W * sighting.impulse_N_s;
            let touching = self.touches.iter_mut().find(|touch| touch.object == sighting.object);
            match touching {
                Some(touch) => touch.seen |= sighting.gap_m < LIFT_M || sighting.impulse_N_s > 0.0,
                None if sighting.impulse_N_s > 0.0 => {
                    self.begin(approach_m_s(before, &sighting), &sighting, crash_speed_m_s)
                }
                None => {}
            }
        }
        self.touches.retain(|touch| touch.seen);
    }

    fn begin(&mut self, impact_speed_m_s: f64, sighting: &Sighting, crash_speed_m_s: f64) {
        self.began += 1;
        self.crashed |= impact_speed_m_s > crash_speed_m_s;
        self.touches.push(Touch { object: sighting.object, impact_speed_m_s, seen: true });
    }

    /// The report on a tick over which the contacts pushed with `force_W_N`.
    pub(super) fn report(&self, force_W_N: &Vector3<f64>) -> ContactReport {
        let first = self.touches.first();
        ContactReport {
            force_W_N: first.map_or(Vector3::zeros(), |_| *force_W_N),
            impact_speed_m_s: first.map_or(0.0, |touch| touch.impact_speed_m_s),
            #[allow(clippy::cast_possible_truncation, reason = "far fewer things than 2^32")]
            count: self.touches.len() as u32,
            object: first.map_or(0, |touch| touch.object),
            began: self.began,
            crashed: self.crashed,
        }
    }
}

/// How fast the vehicle's point came nearer to the object.
fn approach_m_s(before: &RigidBody, sighting: &Sighting) -> f64 {
    let angular_velocity_W_rad_s = before.attitude_WB * before.angular_velocity_B_rad_s;
    let arm_W_m = sighting.point_W_m - before.position_W_m;
    let velocity_W_m_s = before.velocity_W_m_s + angular_velocity_W_rad_s.cross(&arm_W_m);
    (sighting.velocity_W_m_s - velocity_W_m_s).dot(&sighting.towards_vehicle_W).max(0.0)
}
