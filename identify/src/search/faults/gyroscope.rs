//! Gyroscopes: frozen, and against the attitude scaled or mirrored on an axis, or without any relation to it.

use super::evidence::Evidence;
use super::frozen::longest;
use super::twin::{Twin, is_off_scale};
use crate::data::fault::{Fault, Part, axis_name};

/// Shortest stretch of equal numbers that counts as frozen.
const FROZEN_S: f64 = 0.5;
/// Least rate, rad/s (root mean square), of an axis that is compared for a relation: slower, noise is compared with noise.
const MOVING_RAD_S: f64 = 0.1;
const ADVICE: &str = "check columns, signs, axes and unit of `angular_velocity` for this flight";

/// Fault of this flight's gyroscope, on the first faulty axis.
pub fn find(evidence: &Evidence) -> Option<Fault> {
    let channel = &evidence.flight.flight.angular_velocity;
    if !evidence.flight.flight.assumed.is_empty() || channel.is_empty() {
        return None;
    }
    let fault = |axis: usize, kind, expected: String, found| Fault {
        flight: evidence.flight.flight.name.clone(),
        channel: format!("angular_velocity.{}", axis_name(axis)),
        kind,
        expected,
        found,
        consequence: Part::Gyroscope.consequence(),
        advice: ADVICE,
    };
    let frozen = |axis: usize| {
        let stretch = longest(evidence.flight, channel, axis, FROZEN_S, |_| false)?;
        Some(fault(axis, "frozen", "a number that changes in flight".into(), stretch.found()))
    };
    if let Some(fault) = (0..3).find_map(frozen) {
        return Some(fault);
    }
    let twins = evidence.gyroscope()?;
    let compared = |axis: usize| {
        if let Some(correlation) = twins[axis].mirrored() {
            let found = format!("its opposite (correlation {correlation:.2})");
            return Some(fault(axis, "mirrored", "the rate at which the attitude turns".into(), found));
        }
        let scale = twins[axis].scale().filter(|scale| is_off_scale(*scale))?;
        let found = format!("{scale:.3} of it");
        Some(fault(axis, "scaled", "the rate at which the attitude turns".into(), found))
    };
    (0..3).find_map(compared).or_else(|| {
        let found = format!(
            "numbers that do not follow it (correlation of at most {:.2} at any delay up to 0.2 s)",
            unrelated(&twins)?
        );
        let expected = "the rate at which the attitude turns".into();
        Some(Fault { channel: "angular_velocity".into(), ..fault(0, "unrelated", expected, found) })
    })
}

/// Largest correlation of a gyroscope that has nothing to do with the attitude about any axis that moves, if at least two do.
fn unrelated(twins: &[Twin; 3]) -> Option<f64> {
    let moving: Vec<&Twin> = twins.iter().filter(|twin| twin.moves(MOVING_RAD_S)).collect();
    let correlations: Option<Vec<f64>> = moving.iter().map(|twin| twin.unrelated()).collect();
    correlations.filter(|all| all.len() >= 2).map(|all| all.into_iter().fold(0.0, f64::max))
}
