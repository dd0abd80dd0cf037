//! The time that a flight's samples lie in. Whatever is computed on a grid in time costs as much as that time is long,
//! so that it has to be bounded by the samples there are: a stamp in the wrong unit must not ask for a year.

use crate::flight::{Channel, Flight};
use crate::quantity::Quantity;

/// The slowest logs have a sample a second; with gaps half of that many are left.
pub const SPACING_MAX_S: f64 = 2.0;
/// So long a flight may be with any number of samples.
const SHORT_S: f64 = 10.0;

/// Samples that are too far apart for a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Sparse {
    /// How many the channel with the most has.
    pub samples: usize,
    /// The time in which those of all channels lie.
    pub span_s: f64,
    /// The longest time without any, of one channel: where it begins and ends.
    pub gap_s: (f64, f64),
    /// The channel.
    pub channel: Quantity,
    /// How far they may be apart on average.
    pub spacing_max_s: f64,
}

impl Sparse {
    /// All this in words; `place` says where a time of the flight is in its log.
    pub fn words(&self, place: impl Fn(f64) -> String) -> String {
        let Self { samples, span_s, gap_s: (from_s, to_s), channel, spacing_max_s } = self;
        format!(
            "its {samples} samples lie over {span_s} s, expected at least one in {spacing_max_s} s; the longest time without \
             any, of `{channel}`, is {} s: from {} to {}; correct the unit of time or the stamps there, or cut out the part \
             that is used by `from_s` and `to_s`",
            to_s - from_s,
            place(*from_s),
            place(*to_s),
        )
    }
}

impl Flight {
    /// Holds the time that the flight lasts against the number of its samples, `spacing_max_s` apart on average: what is
    /// computed on a grid in time must cost no more than the samples allow for. Flights that were read from files have
    /// passed with 2 s.
    ///
    /// # Errors
    /// If the samples are further apart, in words.
    pub fn check_span(&self, spacing_max_s: f64) -> Result<(), String> {
        let place = |time_s: f64| format!("{time_s} s");
        sparse(self, spacing_max_s).map_or(Ok(()), |sparse| Err(sparse.words(place)))
    }
}

/// What is wrong with the times of a flight, if its samples are more than `spacing_max_s` apart on average.
pub fn sparse(flight: &Flight, spacing_max_s: f64) -> Option<Sparse> {
    let channels = [
        outline(Quantity::Command, &flight.command),
        outline(Quantity::RotorSpeed, &flight.rotor_speed),
        outline(Quantity::Position, &flight.position),
        outline(Quantity::Velocity, &flight.velocity),
        outline(Quantity::Attitude, &flight.attitude),
        outline(Quantity::AngularVelocity, &flight.angular_velocity),
        outline(Quantity::SpecificForce, &flight.specific_force),
        outline(Quantity::BatteryVoltage, &flight.battery_voltage),
    ];
    let known = || channels.iter().flatten();
    let samples = known().map(|own| own.samples).max()?;
    let first_s = known().map(|own| own.first_s).fold(f64::INFINITY, f64::min);
    let last_s = known().map(|own| own.last_s).fold(f64::NEG_INFINITY, f64::max);
    let length = |own: &&Outline| own.gap_s.1 - own.gap_s.0;
    // Of equals the first, as in the file.
    let longest = known().rev().max_by(|a, b| length(a).total_cmp(&length(b)))?;
    let span_s = last_s - first_s;
    #[allow(clippy::cast_precision_loss, reason = "a count of samples")]
    let is_sparse = span_s > SHORT_S + spacing_max_s * samples as f64;
    let (gap_s, channel) = (longest.gap_s, longest.channel);
    is_sparse.then_some(Sparse { samples, span_s, gap_s, channel, spacing_max_s })
}

/// What counts of a channel here.
struct Outline {
    channel: Quantity,
    samples: usize,
    first_s: f64,
    last_s: f64,
    gap_s: (f64, f64),
}

fn outline<const N: usize>(quantity: Quantity, channel: &Channel<N>) -> Option<Outline> {
    let (first_s, last_s) = channel.span_s()?;
    let steps = channel.time_s.windows(2).map(|pair| (pair[0], pair[1]));
    let gap_s = steps.rev().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0))).unwrap_or((first_s, last_s));
    Some(Outline { channel: quantity, samples: channel.time_s.len(), first_s, last_s, gap_s })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(times: impl Iterator<Item = f64>) -> Channel<3> {
        let time_s: Vec<f64> = times.collect();
        Channel { values: vec![[0.0; 3]; time_s.len()], time_s }
    }

    fn flight(position: Channel<3>) -> Flight {
        Flight {
            name: "f".to_owned(),
            file: "log".into(),
            role: crate::Role::Fit,
            command: Channel::default(),
            rotor_speed: Channel::default(),
            position,
            velocity: Channel::default(),
            attitude: Channel::default(),
            angular_velocity: Channel::default(),
            specific_force: Channel::default(),
            battery_voltage: Channel::default(),
            assumed: Vec::new(),
            notes: Vec::new(),
        }
    }

    #[test]
    fn slow_logs_and_short_gaps_pass_and_years_do_not() {
        let slow = channel((0..1000).map(f64::from));
        assert_eq!(sparse(&flight(slow), SPACING_MAX_S), None);
        let paused = channel((0..1000).map(|k| 0.01 * f64::from(k) + if k > 500 { 900.0 } else { 0.0 }));
        assert_eq!(sparse(&flight(paused), SPACING_MAX_S), None);
        let wild = channel((0..1000).map(|k| if k == 0 { 0.0 } else { 1e16 + 2.0 * f64::from(k) }));
        let found = sparse(&flight(wild), SPACING_MAX_S).unwrap();
        assert_eq!(
            (found.channel, found.samples, found.gap_s),
            (Quantity::Position, 1000, (0.0, 1e16 + 2.0))
        );
        assert_eq!(sparse(&flight(Channel::default()), SPACING_MAX_S), None);
    }
}
