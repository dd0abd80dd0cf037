//! The rows that the player reads: at every sample of the attitude, and at every command, so that each acts when it did.

use flights::{Channel, Flight};

/// Times that differ by less are the same row, in seconds.
const SAME_S: f64 = 1e-7;

/// `flight` with the attitude interpolated at the times of the commands as well, where it was measured around them.
/// One whose rates have to be derived from the attitude stays as it is: they come from measurements alone.
pub fn with_rows_at_commands(flight: &Flight) -> Flight {
    let mut whole = flight.clone();
    if !flight.angular_velocity.is_empty() {
        whole.attitude = merged(&flight.attitude, &flight.command.time_s);
    }
    whole
}

/// `attitude` with samples at `times` between its own.
fn merged(attitude: &Channel<4>, times: &[f64]) -> Channel<4> {
    let mut merged = Channel::default();
    let mut times = times.iter().copied().peekable();
    let samples = attitude.time_s.iter().zip(&attitude.values);
    for ((from_s, from), (to_s, to)) in samples.clone().zip(samples.clone().skip(1)) {
        merged.time_s.push(*from_s);
        merged.values.push(*from);
        while times.next_if(|time_s| *time_s <= from_s + SAME_S).is_some() {}
        while let Some(time_s) = times.next_if(|time_s| *time_s < to_s - SAME_S) {
            merged.time_s.push(time_s);
            merged.values.push(between(from, to, (time_s - from_s) / (to_s - from_s)));
        }
    }
    if let Some((last_s, last)) = samples.clone().next_back() {
        merged.time_s.push(*last_s);
        merged.values.push(*last);
    }
    merged
}

/// The quaternion at `part` of the way between two without a jump of sign, normalised.
fn between(from: &[f64; 4], to: &[f64; 4], part: f64) -> [f64; 4] {
    let mixed: [f64; 4] = std::array::from_fn(|index| from[index] + (to[index] - from[index]) * part);
    let norm = mixed.iter().map(|number| number * number).sum::<f64>().sqrt();
    mixed.map(|number| number / norm)
}

/// The times of the first and the last row of a flight's `csv`; `None` where it has no rows.
pub fn span_s(csv: &str) -> Option<(f64, f64)> {
    let time_s = |line: &str| line.split(',').next()?.parse::<f64>().ok();
    let mut rows = csv.lines().skip(1).filter_map(time_s);
    let first_s = rows.next()?;
    Some((first_s, rows.last().unwrap_or(first_s)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_a_row_at_every_command_between_attitudes() {
        let half = 0.5_f64.sqrt();
        let attitude = Channel {
            time_s: vec![0.0, 0.01, 0.02],
            values: vec![[1.0, 0.0, 0.0, 0.0], [half, 0.0, 0.0, half], [half, 0.0, 0.0, half]],
        };
        let merged = merged(&attitude, &[-0.001, 0.0, 0.004, 0.005, 0.01, 0.0199, 0.02, 0.03]);
        assert_eq!(merged.time_s, [0.0, 0.004, 0.005, 0.01, 0.0199, 0.02]);
        let middle = merged.values[2];
        // Half way to a turn by 90 degrees.
        assert!((middle[3] - libm::sin(std::f64::consts::PI / 8.0)).abs() < 1e-12, "{middle:?}");
    }

    #[test]
    fn nothing_is_merged_into_nothing() {
        assert_eq!(merged(&Channel::default(), &[1.0, 2.0]), Channel::default());
    }
}
