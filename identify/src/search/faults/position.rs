//! Positions: jumps, frozen, mirrored on an axis.

use super::evidence::Evidence;
use super::frozen::longest;
use crate::data::fault::{Fault, Part, axis_name};
use flights::{Flight, Role};

/// Shortest stretch of equal numbers that counts as frozen: motion capture resolves less than a vehicle moves.
const FROZEN_S: f64 = 0.5;
const SIGNS: &str = "check columns, signs and `frame` of `position` for this flight";
const SOURCE: &str = "look at the tracking of this flight, and cut the stretch off with `from_s` and `to_s`";

/// Fault of this flight's position, with the part that is not used.
pub fn find(evidence: &Evidence) -> Option<(Fault, Part)> {
    // A frozen position jumps when it goes on.
    let whole = (0..3)
        .find_map(|axis| frozen(evidence, axis))
        .or_else(|| (0..3).find_map(|axis| mirrored(evidence, axis)));
    let whole = whole.map(|fault| (fault, Part::Translation));
    whole.or_else(|| Some((jumps(evidence)?, Part::Jumps)))
}

fn fault(evidence: &Evidence, channel: String, kind: &'static str, expected: &str, found: String) -> Fault {
    let part = if kind == "jumping" { Part::Jumps } else { Part::Translation };
    Fault {
        flight: evidence.flight.flight.name.clone(),
        channel,
        kind,
        expected: expected.to_owned(),
        found,
        consequence: part.consequence(),
        advice: if kind == "mirrored" { SIGNS } else { SOURCE },
    }
}

/// Jumps in the channel, and those that its reader removed.
fn jumps(evidence: &Evidence) -> Option<Fault> {
    let flight = &*evidence.flight.flight;
    let mut alone = Flight::new("", "", Role::Fit);
    alone.position.clone_from(&flight.position);
    flights::leave_out_jumps(&mut alone);
    let note = flights::position_jumps(&alone).or(flights::position_jumps(flight))?;
    let expected = "steps that continue their neighbours within 5 cm, 50 m/s^2 and twelve times the usual step of the log";
    Some(fault(evidence, "position".to_owned(), "jumping", expected, note.to_owned()))
}

fn frozen(evidence: &Evidence, axis: usize) -> Option<Fault> {
    let flight = &*evidence.flight.flight;
    let stretch = longest(evidence.flight, &flight.position, axis, FROZEN_S, |_| false)?;
    let expected = "a number that changes in flight";
    let channel = format!("position.{}", axis_name(axis));
    Some(fault(evidence, channel, "frozen", expected, stretch.found()))
}

fn mirrored(evidence: &Evidence, axis: usize) -> Option<Fault> {
    let correlation = evidence.translation()?[axis].mirrored()?;
    let expected = "the acceleration by which the vehicle leans and is lifted";
    let found = format!("its opposite (correlation {correlation:.2})");
    let of_velocity = evidence.flight.flight.position.is_empty();
    let channel = if of_velocity { "velocity" } else { "position" };
    Some(fault(evidence, format!("{channel}.{}", axis_name(axis)), "mirrored", expected, found))
}
