//! Jumps of a pose: swapped markers, an estimator that starts anew. No vehicle moves so. The samples about a jump are
//! left out, so that every reader of the channel meets a gap there.

use crate::flight::{Channel, Flight, median};
use crate::quantity::Quantity;

/// Samples that are left out on each side of a jump: together more than the [`crate::clean::GAP_PERIODS`] of a gap.
const REACH: usize = 3;
/// A step is a jump if it differs from its neighbours' by more than this many times the usual difference: noise
/// does not.
const UNUSUAL: f64 = 12.0;

/// The least jump, and the greatest acceleration of a vehicle that still flies: limits of the difference
/// between two steps.
struct Limits {
    least: f64,
    acceleration: f64,
}

/// In m and m/s^2: five times the weight.
const POSITION: Limits = Limits { least: 0.05, acceleration: 50.0 };
/// A quaternion moves by half of the angle: 10 degrees and 500 rad/s^2, several times what the rotors of a quadrotor of
/// 30 g can do.
const ATTITUDE: Limits = Limits { least: 0.0873, acceleration: 250.0 };

/// Note on jumps, after the channel's name.
const NOTE: &str = "jumps faster than a vehicle can move";

/// Leaves out the samples about jumps of position and attitude, and notes them in the flight's notes.
pub fn leave_out_jumps(flight: &mut Flight) {
    let notes = &mut flight.notes;
    flight.position =
        without_jumps(Quantity::Position, std::mem::take(&mut flight.position), &POSITION, notes);
    if !flight.assumed.iter().any(|assumed| assumed.starts_with("attitude")) {
        let attitude = std::mem::take(&mut flight.attitude);
        flight.attitude = without_jumps(Quantity::Attitude, attitude, &ATTITUDE, notes);
    }
}

/// Note of `flight` on jumps of its position, without the channel's name.
#[must_use]
pub fn position_jumps(flight: &Flight) -> Option<&str> {
    let of = |note: &'_ String| note.starts_with(&format!("{}: {NOTE}", Quantity::Position));
    flight.notes.iter().find(|note| of(note))?.split_once(": ").map(|(_, found)| found)
}

fn without_jumps<const N: usize>(
    quantity: Quantity,
    channel: Channel<N>,
    limits: &Limits,
    notes: &mut Vec<String>,
) -> Channel<N> {
    let steps = excesses(&channel);
    let usual = median(steps.iter().map(|step| step.excess)).unwrap_or(0.0);
    let is_jump = |step: &&Step| {
        let possible = limits.least + limits.acceleration * step.span_s * step.span_s;
        step.excess > possible.max(UNUSUAL * usual)
    };
    let jumps: Vec<&Step> = steps.iter().filter(is_jump).collect();
    let (Some(first), Some(greatest)) =
        (jumps.first(), jumps.iter().max_by(|a, b| a.excess.total_cmp(&b.excess)))
    else {
        return channel;
    };
    notes.push(format!(
        "{quantity}: {NOTE}, first at {:.3} s, most at {:.3} s; the samples around them are left out",
        channel.time_s[first.from], channel.time_s[greatest.from],
    ));
    let mut is_kept = vec![true; channel.time_s.len()];
    for jump in jumps {
        let last = (jump.from + REACH).min(is_kept.len() - 1);
        is_kept[(jump.from + 1).saturating_sub(REACH)..=last].fill(false);
    }
    channel.kept(|index| is_kept[index])
}

/// From one sample to the next.
struct Step {
    from: usize,
    span_s: f64,
    /// Difference from the mean of the steps before and behind, by speed or by way: the smaller of the two.
    excess: f64,
}

/// The steps that have a neighbour to both sides. The smaller of two excesses counts, by speed and by way: stamps that
/// jitter make odd speeds, samples that are missing odd ways.
fn excesses<const N: usize>(channel: &Channel<N>) -> Vec<Step> {
    let span_s = |at: usize| channel.time_s[at + 1] - channel.time_s[at];
    let way = |at: usize, axis: usize| channel.values[at + 1][axis] - channel.values[at][axis];
    let speed = |at: usize, axis: usize| way(at, axis) / span_s(at);
    let length =
        |of_axis: &dyn Fn(usize) -> f64| (0..N).map(|axis| of_axis(axis).powi(2)).sum::<f64>().sqrt();
    let step = |at: usize| {
        let odd_way = |axis: usize| way(at, axis) - 0.5 * (way(at - 1, axis) + way(at + 1, axis));
        let odd_speed = |axis: usize| speed(at, axis) - 0.5 * (speed(at - 1, axis) + speed(at + 1, axis));
        let excess = length(&odd_way).min(length(&odd_speed) * span_s(at));
        Step { from: at, span_s: span_s(at - 1).max(span_s(at)).max(span_s(at + 1)), excess }
    };
    (1..channel.time_s.len().saturating_sub(2)).map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flight at 100 Hz with 0.5 mm of noise that accelerates by up to 15 m/s^2, and steps aside by `jump_m` at 3 s.
    fn course(jump_m: f64) -> Channel<3> {
        let time_s: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.01).collect();
        let position = |(k, t): (usize, &f64)| {
            let noise = 0.5e-3 * (((k * 7919) % 1009) as f64 / 504.5 - 1.0);
            [0.6 * libm::sin(5.0 * t) + noise + if *t > 3.005 { jump_m } else { 0.0 }, 0.0, 1.0]
        };
        Channel { values: time_s.iter().enumerate().map(position).collect(), time_s }
    }

    #[test]
    fn the_samples_about_a_jump_are_left_out_and_said() {
        let mut notes = Vec::new();
        let cleaned = without_jumps(Quantity::Position, course(0.2), &POSITION, &mut notes);
        assert_eq!(cleaned.time_s.len(), 600 - 2 * REACH - 2, "the steps beside it are odd as well");
        assert!(
            cleaned.time_s.windows(2).any(|pair| pair[0] < 3.0 && pair[1] > 3.01 && pair[1] - pair[0] > 0.05)
        );
        assert!(notes[0].starts_with("position: jumps") && notes[0].contains("most at 3.000 s"), "{notes:?}");
    }

    #[test]
    fn violent_flight_is_no_jump() {
        let mut notes = Vec::new();
        let course = course(0.0);
        assert_eq!(without_jumps(Quantity::Position, course.clone(), &POSITION, &mut notes), course);
        let few = Channel { time_s: vec![0.0, 0.1], values: vec![[0.0; 3], [9.0; 3]] };
        assert_eq!(without_jumps(Quantity::Position, few.clone(), &POSITION, &mut notes), few);
        assert!(notes.is_empty());
    }

    #[test]
    fn stamps_that_jitter_and_samples_that_are_missing_are_no_jumps() {
        let mut late = course(0.0);
        (0..600).step_by(30).for_each(|at| late.time_s[at] += 0.0095);
        let mut notes = Vec::new();
        assert_eq!(without_jumps(Quantity::Position, late.clone(), &POSITION, &mut notes), late, "{notes:?}");
        let kept = |at: &usize| at % 20 > 2;
        let whole = course(0.0);
        let holey = Channel {
            time_s: (0..600).filter(kept).map(|at| whole.time_s[at]).collect(),
            values: (0..600).filter(kept).map(|at| whole.values[at]).collect(),
        };
        assert_eq!(
            without_jumps(Quantity::Position, holey.clone(), &POSITION, &mut notes),
            holey,
            "{notes:?}"
        );
    }

    #[test]
    fn a_channel_of_single_wild_samples_keeps_the_rest() {
        let mut wild = course(0.0);
        wild.values[100][1] = 5.0;
        let cleaned = without_jumps(Quantity::Position, wild, &POSITION, &mut Vec::new());
        assert!(cleaned.values.iter().all(|value| value[1] == 0.0));
        assert!(cleaned.time_s.len() > 585, "{}", cleaned.time_s.len());
    }
}
