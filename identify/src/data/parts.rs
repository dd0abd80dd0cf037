//! Parts of long flights: pieces that are spread evenly over what is compared of a flight.

use crate::data::prepared::Prepared;
use flights::Role;
use std::ops::Range;

/// Length of the part of a flight by which its clocks are aligned, in s. Predictions of a flight that is not
/// for test are made in about as much.
const FLIGHT_S: f64 = 300.0;
/// Length of a piece of a flight, in s: many times as long as manoeuvres and disturbances remember themselves.
const PIECE_S: f64 = 10.0;
/// Nothing is left out where this part of the data or more would stay.
pub const MOST: f64 = 0.7;

/// Pieces of a flight that is long by itself; `None` of one that is not.
pub fn of_flight<'f>(flight: &Prepared<'f>) -> Option<Prepared<'f>> {
    let share = FLIGHT_S / flight.compared_s();
    (share < MOST).then(|| within(flight, share))
}

/// The flight with a `share` of its time.
pub fn within<'f>(flight: &Prepared<'f>, share: f64) -> Prepared<'f> {
    flight.within(&pieces(flight, share))
}

/// A `share` of a flight: pieces in the middle of equal parts of what is compared of it.
fn pieces(flight: &Prepared, share: f64) -> Vec<Range<usize>> {
    let knots = &flight.layout.knots;
    let count = (share * flight.compared_s() / PIECE_S).round().max(1.0) as usize;
    let (before, behind) = flight.margins();
    let bounds = |part: usize| (part * knots.len() / count, (part + 1) * knots.len() / count);
    let piece = |part: usize| {
        let (first, end) = bounds(part);
        let left_out = ((1.0 - share) * (end - first) as f64) as usize;
        let (first, end) = (first + left_out / 2, end - left_out.div_ceil(2));
        let last = end.max(first + 1).min(knots.len()) - 1;
        knots[first].saturating_sub(before)..(knots[last] + behind + 1).min(flight.layout.clock.count)
    };
    let mut pieces: Vec<Range<usize>> = (0..count).map(piece).collect();
    pieces.dedup_by(|next, last| {
        let is_joined = next.start <= last.end;
        last.end = if is_joined { next.end } else { last.end };
        is_joined
    });
    pieces
}

/// Uses of a part of a long flight, as a note for the report; `None` of a flight that stays whole.
pub fn note(flight: &Prepared) -> Option<String> {
    let is_long = FLIGHT_S / flight.compared_s() < MOST;
    let uses = match flight.flight.role {
        Role::Test => "its clocks are aligned",
        Role::Fit | Role::Select => "its clocks are aligned and its prediction errors computed",
    };
    is_long.then(|| format!("{uses} by {FLIGHT_S} s of it, spread evenly"))
}
