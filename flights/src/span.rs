//! The time that a flight's samples lie in. A computation on a grid in time costs as much as that time is long.
//! So it has to be bounded by the number of samples: a stamp in the wrong unit must not ask for a year.

use std::fmt;

use diagnostics::nine_decimals;

use crate::flight::Flight;
use crate::quantity::Quantity;

/// The slowest logs have a sample a second; with gaps half of that many are left.
pub const SPACING_MAX_S: f64 = 2.0;
/// So long a flight may be with any number of samples.
const SHORT_S: f64 = 10.0;

/// Samples that are too far apart for a flight.
///
/// ```
/// use flights::{Channel, Flight, Role};
///
/// let mut flight = Flight::new("f", "log.csv", Role::Fit);
/// flight.position = Channel { time_s: vec![0.0, 100.0], values: vec![[0.0; 3]; 2] };
/// let sparse = flight.check_span(2.0).unwrap_err();
/// assert_eq!((sparse.samples, sparse.gap[1].time_s), (2, 100.0));
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "its {samples} samples lie over {} s, expected at least one in {spacing_max_s} s; the longest time without \
     any, of `{channel}`, is {} s: from {} to {}; correct the unit of time or the stamps there, or cut out the part \
     that is used by `from_s` and `to_s`",
    nine_decimals(*span_s),
    nine_decimals(*gap_s),
    gap[0],
    gap[1]
)]
pub struct Sparse {
    /// Number of samples of the channel with the most.
    pub samples: usize,
    /// Time in which the samples of all channels lie.
    pub span_s: f64,
    /// The longest time without any, of one channel.
    pub gap_s: f64,
    /// Its beginning and its end.
    pub gap: [Moment; 2],
    /// The channel.
    pub channel: Quantity,
    /// Greatest mean distance of samples that is accepted.
    pub spacing_max_s: f64,
}

/// A time of a flight, and where its log has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// From the flight's start, or from the log's first sample where that is known.
    pub time_s: f64,
    /// True if it is counted from the log's first sample.
    pub is_in_log: bool,
    /// The line of the log.
    pub line: Option<u64>,
}

impl fmt::Display for Moment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}, ")?;
        }
        write!(
            f,
            "{} s{}",
            nine_decimals(self.time_s),
            if self.is_in_log { " from the log's first sample" } else { "" }
        )
    }
}

impl Flight {
    /// Compares the time that the flight lasts with the number of its samples, `spacing_max_s` apart on
    /// average: a computation on a grid in time must cost no more than the samples allow for. Flights that were
    /// read from files have passed with 2 s.
    ///
    /// # Errors
    /// If the samples are further apart.
    pub fn check_span(&self, spacing_max_s: f64) -> Result<(), Sparse> {
        let channels = || self.times().into_iter().filter(|(_, time_s)| !time_s.is_empty());
        let Some(samples) = channels().map(|(_, time_s)| time_s.len()).max() else { return Ok(()) };
        let first_s = channels().map(|(_, time_s)| time_s[0]).fold(f64::INFINITY, f64::min);
        let last_s = channels().map(|(_, time_s)| time_s[time_s.len() - 1]).fold(f64::NEG_INFINITY, f64::max);
        let span_s = last_s - first_s;
        if span_s <= SHORT_S + spacing_max_s * samples as f64 {
            return Ok(());
        }
        let steps = |(channel, time_s): (Quantity, &[f64])| {
            let steps = time_s.windows(2).map(|pair| (channel, pair[0], pair[1])).collect::<Vec<_>>();
            if steps.is_empty() { vec![(channel, time_s[0], time_s[0])] } else { steps }
        };
        let all: Vec<_> = channels().flat_map(steps).collect();
        // Of equals the first, as in the file.
        let longest = all.iter().rev().max_by(|a, b| (a.2 - a.1).total_cmp(&(b.2 - b.1)));
        let Some(&(channel, from_s, to_s)) = longest else { return Ok(()) };
        let gap = [from_s, to_s].map(|time_s| Moment { time_s, is_in_log: false, line: None });
        Err(Sparse { samples, span_s, gap_s: to_s - from_s, gap, channel, spacing_max_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Channel;

    fn channel(times: impl Iterator<Item = f64>) -> Channel<3> {
        let time_s: Vec<f64> = times.collect();
        Channel { values: vec![[0.0; 3]; time_s.len()], time_s }
    }

    fn flight(position: Channel<3>) -> Flight {
        Flight { position, ..Flight::new("f", "log", crate::Role::Fit) }
    }

    #[test]
    fn slow_logs_and_short_gaps_pass_and_years_do_not() {
        let slow = channel((0..1000).map(f64::from));
        assert_eq!(flight(slow).check_span(SPACING_MAX_S), Ok(()));
        let paused = channel((0..1000).map(|k| 0.01 * f64::from(k) + if k > 500 { 900.0 } else { 0.0 }));
        assert_eq!(flight(paused).check_span(SPACING_MAX_S), Ok(()));
        let wild = channel((0..1000).map(|k| if k == 0 { 0.0 } else { 1e16 + 2.0 * f64::from(k) }));
        let found = flight(wild).check_span(SPACING_MAX_S).unwrap_err();
        assert_eq!(
            (found.channel, found.samples, found.gap.map(|moment| moment.time_s)),
            (Quantity::Position, 1000, [0.0, 1e16 + 2.0])
        );
        assert_eq!(flight(Channel::default()).check_span(SPACING_MAX_S), Ok(()));
    }
}
