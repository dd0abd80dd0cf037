//! A flight as a player plays it: the measured states tick by tick, and the windows that count.
//!
//! The bus and `identify` take both from here. Otherwise they would differ wherever a derivative is noisy or one-sided.

use crate::canonical::{HALF_WINDOW, Row, rows, text, turning};
use crate::clean;
use crate::error::FlightsError;
use crate::flight::{Channel, Flight};
use crate::known::{KnownRotors, SETTLE_S};

/// Slack that puts a tick on its own row: times are sums of decimal fractions.
const SLACK_S: f64 = 1e-9;

/// A flight as a player plays it.
///
/// ```
/// use flights::{Channel, Flight, Played, Role};
///
/// let mut flight = Flight::new("climb", "log.csv", Role::Test);
/// let time_s: Vec<f64> = (0..200).map(|k| f64::from(k) * 0.01).collect();
/// flight.attitude = Channel { values: vec![[1.0, 0.0, 0.0, 0.0]; 200], time_s: time_s.clone() };
/// flight.command = Channel { values: vec![[40.0; 12]; 200], time_s: time_s.clone() };
/// flight.position = Channel { values: time_s.iter().map(|t| [0.0, 0.0, *t]).collect(), time_s };
/// let played = Played::of(&flight)?;
/// assert!((played.at(1.005, &mut 0).velocity_m_s[2] - 1.0).abs() < 1e-9);
/// // The velocity at the last three samples is derived from one side.
/// assert!(played.counts(1.0, 1.96) && !played.counts(1.0, 1.97));
/// # Ok::<(), flights::FlightsError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Played {
    rows: Vec<Row>,
    /// Number of rotors of the vehicle.
    rotors: usize,
    /// Bounds of the windows that count.
    counted_s: (f64, f64),
    /// Stretches within which windows count.
    known: KnownRotors,
    /// Gaps, which no window that counts touches, by their begin; each with the latest end so far.
    gaps: Vec<(f64, f64)>,
}

impl Played {
    /// The flight with a row at every sample of the attitude and at every command.
    ///
    /// # Errors
    /// If the flight has neither attitude nor angular velocity.
    pub fn of(flight: &Flight) -> Result<Self, FlightsError> {
        let (_, rows) = rows(&with_rows_at_commands(flight))?;
        let (counted_s, known) = (counted_s(flight, rows[0].time_s), KnownRotors::of(flight));
        Ok(Self { counted_s, known, gaps: gaps(flight), rows, rotors: flight.rotors })
    }

    /// The rows as a CSV file, as [`crate::csv`] writes it.
    #[must_use]
    pub fn csv(&self) -> String {
        text(&self.rows, self.rotors)
    }

    /// The times of the first and the last row.
    #[must_use]
    pub fn span_s(&self) -> (f64, f64) {
        (self.rows[0].time_s, self.rows[self.rows.len() - 1].time_s)
    }

    /// The flight at `time_s`: commands as last set, measurements interpolated. `hint` is an index near the row, kept by
    /// the caller between calls at growing times.
    #[must_use]
    pub fn at(&self, time_s: f64, hint: &mut usize) -> Row {
        while *hint + 1 < self.rows.len() && self.rows[*hint + 1].time_s <= time_s + SLACK_S {
            *hint += 1;
        }
        let before = &self.rows[*hint];
        let Some(after) = self.rows.get(*hint + 1) else { return *before };
        let part = ((time_s - before.time_s) / (after.time_s - before.time_s)).clamp(0.0, 1.0);
        Row {
            time_s,
            command: before.command,
            position_m: mixed(&before.position_m, &after.position_m, part),
            velocity_m_s: mixed(&before.velocity_m_s, &after.velocity_m_s, part),
            attitude: between(&before.attitude, &after.attitude, part),
            angular_velocity_rad_s: mixed(
                &before.angular_velocity_rad_s,
                &after.angular_velocity_rad_s,
                part,
            ),
            battery_v: before.battery_v.zip(after.battery_v).map(|(from, to)| from + (to - from) * part),
        }
    }

    /// True if the window from `from_s` to `to_s` counts. A window does not count if the rotors are not known
    /// in it or it touches a gap of a measured channel. It does not count either if it ends at the last
    /// samples of the log, where a derivative is one-sided.
    #[must_use]
    pub fn counts(&self, from_s: f64, to_s: f64) -> bool {
        let (first_s, last_s) = self.counted_s;
        // Of the gaps that begin before the window's end, the one that ends last.
        let begun = self.gaps.partition_point(|gap| gap.0 < to_s - SLACK_S);
        let touches = begun.checked_sub(1).is_some_and(|last| from_s < self.gaps[last].1 - SLACK_S);
        let is_inside = from_s >= first_s - SLACK_S && to_s <= last_s + SLACK_S;
        is_inside && !touches && self.known.hold(from_s, to_s)
    }
}

/// Times of each measured channel of the state, and the number of samples to both sides that a derivative uses.
fn reaches(flight: &Flight) -> Vec<(&[f64], usize)> {
    let of = |is_derived: bool| if is_derived { HALF_WINDOW } else { 0 };
    let mut reaches = vec![
        (&flight.position.time_s[..], of(flight.velocity.is_empty())),
        (&flight.velocity.time_s, 0),
        (&flight.angular_velocity.time_s, 0),
    ];
    if flight.assumed.is_empty() {
        reaches.push((&flight.attitude.time_s, of(flight.angular_velocity.is_empty())));
    }
    reaches.retain(|(time_s, _)| !time_s.is_empty());
    reaches
}

/// Bounds of the windows that count, in a flight whose first row is at `start_s`.
fn counted_s(flight: &Flight, start_s: f64) -> (f64, f64) {
    // A replay begins with rotors that follow the first command.
    let (mut first_s, mut last_s) = (start_s + SETTLE_S, f64::INFINITY);
    for (time_s, reach) in reaches(flight) {
        let end = (time_s.len() - 1).saturating_sub(reach);
        first_s = first_s.max(time_s[reach.min(time_s.len() - 1)]);
        last_s = last_s.min(time_s[end]);
    }
    (first_s, last_s)
}

/// Gaps of all measured channels of the state, extended by the reach of derivatives, in seconds of the flight.
fn gaps(flight: &Flight) -> Vec<(f64, f64)> {
    let mut gaps: Vec<(f64, f64)> =
        reaches(flight).into_iter().flat_map(|(time_s, reach)| channel_gaps(time_s, reach)).collect();
    gaps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut last_s = f64::NEG_INFINITY;
    for gap in &mut gaps {
        last_s = last_s.max(gap.1);
        gap.1 = last_s;
    }
    gaps
}

fn channel_gaps(time_s: &[f64], reach: usize) -> Vec<(f64, f64)> {
    let last = time_s.len() - 1;
    let about = |(from_s, to_s): (f64, f64)| {
        let (from, to) = (time_s.partition_point(|t| *t < from_s), time_s.partition_point(|t| *t < to_s));
        (time_s[from.saturating_sub(reach)], time_s[(to + reach).min(last)])
    };
    clean::gaps(time_s).into_iter().map(about).collect()
}

/// Times that differ by less share a row, in seconds.
const SAME_S: f64 = 1e-7;

/// `flight` with the attitude interpolated at the times of the commands too, between its samples.
fn with_rows_at_commands(flight: &Flight) -> Flight {
    let mut whole = flight.clone();
    if flight.angular_velocity.is_empty() {
        // From measurements alone, before there are others between them.
        whole.angular_velocity = turning(&flight.attitude);
    }
    whole.attitude = merged(&flight.attitude, &flight.command.time_s);
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

/// The quaternion at `part` of the shorter way between two, normalised.
fn between(from: &[f64; 4], to: &[f64; 4], part: f64) -> [f64; 4] {
    let dot: f64 = from.iter().zip(to).map(|(a, b)| a * b).sum();
    let mixed = mixed(from, &if dot < 0.0 { to.map(|x| -x) } else { *to }, part);
    let norm = mixed.iter().map(|number| number * number).sum::<f64>().sqrt();
    mixed.map(|number| number / norm)
}

fn mixed<const N: usize>(from: &[f64; N], to: &[f64; N], part: f64) -> [f64; N] {
    std::array::from_fn(|index| from[index] + (to[index] - from[index]) * part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vehicles::ROTORS_MAX;

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

    #[test]
    fn windows_at_gaps_and_ends_do_not_count() {
        let mut flight = Flight::new("gap", "log.csv", crate::Role::Test);
        let time_s: Vec<f64> = (0..300).map(|k| f64::from(k) * 0.01).collect();
        let kept: Vec<f64> = time_s.iter().copied().filter(|t| !(1.4..1.6).contains(t)).collect();
        flight.position = Channel { values: vec![[0.0; 3]; kept.len()], time_s: kept };
        flight.command = Channel { values: vec![[40.0; ROTORS_MAX]; 300], time_s: time_s.clone() };
        flight.attitude = Channel { values: vec![[1.0, 0.0, 0.0, 0.0]; 300], time_s };
        let played = Played::of(&flight).unwrap();
        for (from_s, to_s, counts) in [
            (0.4, 0.9, false),
            (0.5, 1.0, true),
            (1.0, 1.36, true),
            (1.0, 1.37, false),
            (1.62, 2.0, false),
            (1.63, 2.0, true),
            (2.0, 2.96, true),
            (2.0, 2.97, false),
        ] {
            assert_eq!(played.counts(from_s, to_s), counts, "{from_s} to {to_s}");
        }
        // Measured, a velocity is as good at the last sample as at any other.
        flight.velocity = Channel { values: vec![[0.0; 3]; 300], time_s: flight.attitude.time_s.clone() };
        flight.angular_velocity = flight.velocity.clone();
        assert!(Played::of(&flight).unwrap().counts(2.0, 2.99));
    }

    #[test]
    fn windows_in_a_gap_of_the_commands_do_not_count() {
        let mut flight = Flight::new("gap", "log.csv", crate::Role::Test);
        let time_s: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.01).collect();
        flight.attitude = Channel { values: vec![[1.0, 0.0, 0.0, 0.0]; 600], time_s: time_s.clone() };
        flight.angular_velocity = Channel { values: vec![[0.0; 3]; 600], time_s: time_s.clone() };
        let given: Vec<f64> = time_s.into_iter().filter(|t| (1.0..2.0).contains(t) || *t > 4.0).collect();
        flight.command = Channel { values: vec![[40.0; ROTORS_MAX]; given.len()], time_s: given };
        let played = Played::of(&flight).unwrap();
        for (from_s, to_s, counts) in [
            (0.5, 0.9, false),
            (1.4, 1.8, false),
            (1.5, 1.9, true),
            (1.9, 2.1, false),
            (2.5, 3.0, false),
            (4.1, 4.6, false),
            (4.6, 5.0, true),
        ] {
            assert_eq!(played.counts(from_s, to_s), counts, "{from_s} to {to_s}");
        }
        assert_eq!(played.span_s().0, 1.0, "nothing is played before the first command");
    }
}
