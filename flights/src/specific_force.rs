//! Specific force and its substitutes in logs: accelerations, with or without gravity, along other axes. Angular velocities along other axes.
//!
//! R is the attitude, body to world. g is the gravity in the world, counted upwards. The specific force in
//! the body is f = R^T (a + g) with the acceleration a in the world. If the log holds b along the axes of the
//! body, a = R b.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use vehicles::gaps::GAP_PERIODS;

use crate::clean::say_dropped;
use crate::declaration::Holds;
use crate::error::{LogError, Spot};
use crate::flight::{Channel, period_s};
use crate::quantity::Quantity;

/// Meaning of the vectors in the log, and gravity to convert them.
#[derive(Debug, Clone, Copy)]
pub struct Meaning {
    /// Kind of the vectors.
    pub holds: Holds,
    /// Gravity, in m/s^2.
    pub gravity_m_s2: f64,
}

impl Meaning {
    /// The acceleration in the world that `logged` means.
    pub fn acceleration(self, logged: Vector3<f64>, attitude: &UnitQuaternion<f64>) -> Vector3<f64> {
        let turned = if self.holds.is_in_world() { logged } else { attitude * logged };
        if self.holds.is_without_gravity() { turned } else { turned - self.gravity() }
    }

    /// The specific force in the body that `logged` means.
    pub fn specific_force(self, logged: Vector3<f64>, attitude: &UnitQuaternion<f64>) -> Vector3<f64> {
        attitude.inverse() * (self.acceleration(logged, attitude) + self.gravity())
    }

    /// Returns the vector that is logged for a specific force in the body.
    pub fn logged(self, force: Vector3<f64>, attitude: &UnitQuaternion<f64>) -> Vector3<f64> {
        let turned = attitude * force;
        let without = if self.holds.is_without_gravity() { turned - self.gravity() } else { turned };
        if self.holds.is_in_world() { without } else { attitude.inverse() * without }
    }

    fn gravity(self) -> Vector3<f64> {
        self.gravity_m_s2 * Vector3::z()
    }
}

/// Turns the logged vectors into the specific force in the body; samples without an attitude about are left out.
///
/// # Errors
/// If there is none for any.
pub fn in_body(
    logged: &Channel<3>,
    attitude: &Channel<4>,
    meaning: Meaning,
    notes: &mut Vec<String>,
) -> Result<Channel<3>, LogError> {
    if meaning.holds == Holds::SpecificForce || logged.is_empty() {
        return Ok(logged.clone());
    }
    let turned = with_attitude(logged, attitude, |sample, q| meaning.specific_force(sample, q));
    checked(Quantity::SpecificForce, meaning.holds, logged, attitude, turned, notes)
}

/// Turns logged angular velocities into the body; samples without an attitude about are left out.
///
/// # Errors
/// If there is none for any.
pub fn rates_in_body(
    logged: &Channel<3>,
    attitude: &Channel<4>,
    holds: Holds,
    notes: &mut Vec<String>,
) -> Result<Channel<3>, LogError> {
    if !holds.is_in_world() || logged.is_empty() {
        return Ok(logged.clone());
    }
    let turned = with_attitude(logged, attitude, |rate, q| q.inverse() * rate);
    checked(Quantity::AngularVelocity, holds, logged, attitude, turned, notes)
}

/// Notes what was turned into the body; refuses a channel of which nothing is left.
fn checked(
    quantity: Quantity,
    holds: Holds,
    logged: &Channel<3>,
    attitude: &Channel<4>,
    turned: Channel<3>,
    notes: &mut Vec<String>,
) -> Result<Channel<3>, LogError> {
    if turned.is_empty() {
        let expected = "an attitude at its times, which turns it into the body";
        let found = if attitude.is_empty() { "no channel `attitude`" } else { "none" };
        let advice = "map `attitude`, or remove this channel";
        return Err(LogError::unexpected(Spot::Key("holds"), expected, found, advice));
    }
    notes.push(format!("{quantity}: computed with the attitude from what is declared as {}", holds.name()));
    say_dropped(quantity, logged, &turned, "have no attitude at their times", notes);
    Ok(turned)
}

/// The samples of `channel` that have an attitude about them, changed by it.
pub fn with_attitude(
    channel: &Channel<3>,
    attitude: &Channel<4>,
    change: impl Fn(Vector3<f64>, &UnitQuaternion<f64>) -> Vector3<f64>,
) -> Channel<3> {
    let gap_s = GAP_PERIODS * period_s(&attitude.time_s).unwrap_or(0.0);
    let samples = channel.time_s.iter().zip(&channel.values);
    let changed = samples.filter_map(|(time_s, value)| {
        let q = interpolated(attitude, *time_s, gap_s)?;
        Some((*time_s, <[f64; 3]>::from(change(Vector3::from(*value), &q))))
    });
    let (time_s, values) = changed.unzip();
    Channel { time_s, values }
}

/// The attitude at a time, between samples that are no further apart than `gap_s`.
fn interpolated(attitude: &Channel<4>, time_s: f64, gap_s: f64) -> Option<UnitQuaternion<f64>> {
    let after = attitude.time_s.partition_point(|sample_s| *sample_s < time_s);
    let to_s = *attitude.time_s.get(after)?;
    let q = |index: usize| {
        let [w, x, y, z] = attitude.values[index];
        Quaternion::new(w, x, y, z)
    };
    if to_s == time_s {
        return Some(UnitQuaternion::from_quaternion(q(after)));
    }
    let before = after.checked_sub(1)?;
    let (from_s, length_s) = (attitude.time_s[before], to_s - attitude.time_s[before]);
    // Neighbours have no jump of sign, and are near each other.
    let between = |share: f64| UnitQuaternion::from_quaternion(q(before).lerp(&q(after), share));
    (length_s <= gap_s).then(|| between((time_s - from_s) / length_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_logged_and_what_it_means_are_each_others_inverse() {
        let q = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.1);
        let (acceleration, up) = (Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.0, 0.0, 9.8));
        let force = q.inverse() * (acceleration + up);
        let expected = [force, q.inverse() * acceleration, acceleration, acceleration + up];
        for (holds, expected) in Holds::FORCES.into_iter().zip(expected) {
            let meaning = Meaning { holds, gravity_m_s2: 9.8 };
            let logged = meaning.logged(force, &q);
            assert!((logged - expected).norm() < 1e-12, "{holds:?}");
            assert!((meaning.acceleration(logged, &q) - acceleration).norm() < 1e-12, "{holds:?}");
            assert!((meaning.specific_force(logged, &q) - force).norm() < 1e-12, "{holds:?}");
        }
    }

    #[test]
    fn rates_in_the_world_are_turned_into_the_body() {
        let q = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.1);
        let time_s = vec![0.0, 1.0];
        let attitude = Channel { time_s: time_s.clone(), values: vec![[q.w, q.i, q.j, q.k]; 2] };
        let body = Vector3::new(0.3, -0.1, 0.5);
        let logged = Channel { time_s, values: vec![(q * body).into(); 2] };
        let mut notes = Vec::new();
        let turned = rates_in_body(&logged, &attitude, Holds::World, &mut notes).unwrap();
        assert!(turned.values.iter().all(|rate| (Vector3::from(*rate) - body).norm() < 1e-12), "{turned:?}");
        assert_eq!(notes, ["angular_velocity: computed with the attitude from what is declared as world"]);
        assert_eq!(rates_in_body(&logged, &attitude, Holds::Body, &mut notes).unwrap(), logged);
        assert!(rates_in_body(&logged, &Channel::default(), Holds::World, &mut notes).is_err());
    }

    #[test]
    fn a_sample_in_a_gap_or_outside_has_no_attitude() {
        let mut times: Vec<f64> = (0..10).map(|k| 0.1 * f64::from(k)).collect();
        times.push(2.0);
        let values = times.iter().map(|_| [1.0, 0.0, 0.0, 0.0]).collect();
        let attitude = Channel { time_s: times, values };
        let force =
            Channel { time_s: vec![-0.1, 0.0, 0.05, 1.5, 2.0, 2.1], values: vec![[1.0, 2.0, 3.0]; 6] };
        let kept = with_attitude(&force, &attitude, |sample, _| sample);
        assert_eq!((kept.time_s, kept.values), (vec![0.0, 0.05, 2.0], vec![[1.0, 2.0, 3.0]; 3]));
    }
}
