//! Frozen values: a sensor or a logger that repeats its last sample.

use crate::data::prepared::Prepared;
use flights::Channel;

/// Least number of equal samples: fewer may be equal by chance, or by a coarse unit.
const LEAST_SAMPLES: usize = 20;

/// Least change of a channel, in its smallest steps, besides the stretch: in a coarser one, such as a hover in whole
/// millimetres, equal samples show nothing.
const STEPS: f64 = 10.0;

/// A stretch in which one number of a channel is equal to the last bit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Its begin.
    pub from_s: f64,
    /// Its end.
    pub to_s: f64,
    /// The number.
    pub value: f64,
}

impl Stretch {
    /// Length.
    pub fn length_s(&self) -> f64 {
        self.to_s - self.from_s
    }

    /// The stretch as text.
    pub fn found(&self) -> String {
        let Self { from_s, to_s, value } = self;
        format!("{value:.6} to the last digit from {from_s:.2} s to {to_s:.2} s")
    }
}

/// Longest stretch of at least `least_s` in which component `at` of `channel` does not change while the flight is
/// compared. Stretches of an `is_ordinary` value do not count.
pub fn longest<const N: usize>(
    flight: &Prepared,
    channel: &Channel<N>,
    at: usize,
    least_s: f64,
    is_ordinary: impl Fn(f64) -> bool,
) -> Option<Stretch> {
    let knots = &flight.layout.knots;
    let clock = &flight.layout.clock;
    let (first_s, last_s) = (clock.at(*knots.first()?), clock.at(*knots.last()?));
    let first = channel.time_s.partition_point(|time_s| *time_s < first_s);
    let last = channel.time_s.partition_point(|time_s| *time_s <= last_s);
    let mut begin = first;
    let mut longest: Option<Stretch> = None;
    for end in first..last {
        let (value, before) = (channel.values[end][at], channel.values[begin][at]);
        if value.to_bits() != before.to_bits() {
            begin = end;
        }
        let stretch = Stretch { from_s: channel.time_s[begin], to_s: channel.time_s[end], value };
        let is_long = stretch.length_s() >= least_s && end - begin >= LEAST_SAMPLES;
        if is_long && !is_ordinary(value) && longest.is_none_or(|one| one.length_s() < stretch.length_s()) {
            longest = Some(stretch);
        }
    }
    longest.filter(|stretch| is_fine(&channel.values[first..last], at, stretch, channel.period_s()))
}

/// True if the other numbers change, in the same time, by many of their smallest steps, or if the whole channel is frozen.
fn is_fine<const N: usize>(values: &[[f64; N]], at: usize, stretch: &Stretch, period_s: Option<f64>) -> bool {
    let others: Vec<f64> = values.iter().map(|value| value[at]).collect();
    let count = (stretch.length_s() / period_s.unwrap_or(1.0)) as usize;
    let size = others.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
    // Smaller steps are rounding errors of a unit conversion.
    let steps = others.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 1e-9 * size);
    let Some(least) = steps.reduce(f64::min) else { return true };
    let ways = others.iter().zip(others.iter().skip(count)).map(|(from, to)| (to - from).abs());
    let mut ways: Vec<f64> = ways.collect();
    ways.sort_by(f64::total_cmp);
    // In nine of ten places, as a flight is calmer at times.
    ways.get(ways.len() / 10).is_none_or(|way| *way > STEPS * least)
}
