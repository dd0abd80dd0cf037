//! Measured channels on the grid.
//!
//! A channel that was sampled faster than the grid is averaged over one step about each instant, so that nothing
//! folds down; a slower one is interpolated by cubic pieces through its samples. Instants in a gap are marked.

use crate::data::clock::Clock;
use flights::Channel;

/// A gap is a time without samples of more than so many periods.
const GAP_PERIODS: f64 = 3.5;

/// A quantity on the grid.
#[derive(Debug, Clone, Default)]
pub struct Track<const N: usize> {
    /// One value for each instant; a value at an instant that is not valid means nothing.
    pub values: Vec<[f64; N]>,
    /// True for instants with samples about them.
    pub valid: Vec<bool>,
}

impl<const N: usize> Track<N> {
    /// The channel on the grid. A sample stamped t is taken as true at t - `delay_s`.
    pub fn sampled(channel: &Channel<N>, delay_s: f64, clock: &Clock) -> Self {
        let Some(period_s) = channel.period_s() else {
            return Self { values: vec![[0.0; N]; clock.count], valid: vec![false; clock.count] };
        };
        if period_s < 0.75 * clock.step_s {
            averaged(channel, delay_s, clock, period_s)
        } else {
            interpolated(channel, delay_s, clock, period_s)
        }
    }

    /// The mean over `reach` instants to both sides.
    pub fn smoothed(&self, reach: usize) -> Vec<[f64; N]> {
        let count = self.values.len();
        (0..count)
            .map(|i| {
                let (first, last) = (i.saturating_sub(reach), (i + reach).min(count - 1));
                let mut sum = [0.0; N];
                for value in &self.values[first..=last] {
                    sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += value);
                }
                sum.map(|sum| sum / (last - first + 1) as f64)
            })
            .collect()
    }

    /// The rate of change, by a straight line through `reach` instants to both sides; at the ends, that of the
    /// nearest instant that has as many.
    pub fn slope(&self, reach: usize, step_s: f64) -> Vec<[f64; N]> {
        let count = self.values.len();
        if count <= 2 * reach {
            return vec![[0.0; N]; count];
        }
        (0..count).map(|i| self.slope_about(i.clamp(reach, count - 1 - reach), reach, step_s)).collect()
    }

    fn slope_about(&self, middle: usize, reach: usize, step_s: f64) -> [f64; N] {
        let norm: f64 = (1..=reach).map(|k| 2.0 * (k * k) as f64).sum::<f64>() * step_s;
        let rise = |k: usize, axis: usize| self.values[middle + k][axis] - self.values[middle - k][axis];
        std::array::from_fn(|axis| (1..=reach).map(|k| k as f64 * rise(k, axis)).sum::<f64>() / norm)
    }
}

/// Returns for each instant whether all instants within `reach` to both sides are valid, so far as they exist.
pub fn valid_about(valid: &[bool], reach: usize) -> Vec<bool> {
    let mut bad = vec![0_usize];
    for is_valid in valid {
        bad.push(bad[bad.len() - 1] + usize::from(!is_valid));
    }
    let span = |i: usize| (i.saturating_sub(reach), (i + reach + 1).min(valid.len()));
    (0..valid.len()).map(span).map(|(first, end)| bad[end] == bad[first]).collect()
}

/// Mean over one step about each instant of the line through the samples.
fn averaged<const N: usize>(channel: &Channel<N>, delay_s: f64, clock: &Clock, period_s: f64) -> Track<N> {
    let integral = Integral::of(channel);
    let (mut low, mut high) = (0, 0);
    let half_s = clock.step_s / 2.0;
    let mut track = Track::default();
    for index in 0..clock.count {
        let at_s = clock.at(index) + delay_s;
        low = integral.segment(at_s - half_s, low);
        high = integral.segment(at_s + half_s, high);
        let (before, after) = (integral.at(at_s - half_s, low), integral.at(at_s + half_s, high));
        track.values.push(std::array::from_fn(|i| (after[i] - before[i]) / clock.step_s));
        let inside = integral.covers(at_s - half_s) && integral.covers(at_s + half_s);
        let is_close = (low..=high).all(|segment| integral.length_s(segment) <= GAP_PERIODS * period_s);
        track.valid.push(inside && is_close);
    }
    track
}

/// The integral of the line through the samples.
struct Integral<'a, const N: usize> {
    channel: &'a Channel<N>,
    sums: Vec<[f64; N]>,
}

impl<'a, const N: usize> Integral<'a, N> {
    fn of(channel: &'a Channel<N>) -> Self {
        let mut sums = vec![[0.0; N]];
        for (times, values) in channel.time_s.windows(2).zip(channel.values.windows(2)) {
            let before = sums[sums.len() - 1];
            let span_s = times[1] - times[0];
            sums.push(std::array::from_fn(|i| before[i] + span_s * (values[0][i] + values[1][i]) / 2.0));
        }
        Self { channel, sums }
    }

    /// The segment that holds `at_s`, searched upwards from `from`.
    fn segment(&self, at_s: f64, from: usize) -> usize {
        let times = &self.channel.time_s;
        let mut segment = from;
        while segment + 2 < times.len() && times[segment + 1] <= at_s {
            segment += 1;
        }
        segment
    }

    fn length_s(&self, segment: usize) -> f64 {
        self.channel.time_s[segment + 1] - self.channel.time_s[segment]
    }

    fn covers(&self, at_s: f64) -> bool {
        let times = &self.channel.time_s;
        times[0] - 1e-9 <= at_s && at_s <= times[times.len() - 1] + 1e-9
    }

    fn at(&self, at_s: f64, segment: usize) -> [f64; N] {
        let (times, values) = (&self.channel.time_s, &self.channel.values);
        let into_s = at_s - times[segment];
        let slope_s = 1.0 / self.length_s(segment);
        std::array::from_fn(|i| {
            let slope = (values[segment + 1][i] - values[segment][i]) * slope_s;
            self.sums[segment][i] + into_s * (values[segment][i] + slope * into_s / 2.0)
        })
    }
}

/// Cubic pieces whose slope at a sample is that of the parabola through it and its neighbours.
fn interpolated<const N: usize>(
    channel: &Channel<N>,
    delay_s: f64,
    clock: &Clock,
    period_s: f64,
) -> Track<N> {
    let times = &channel.time_s;
    // Several instants lie between two samples.
    let slopes: Vec<[f64; N]> = (0..times.len()).map(|sample| slope_at(channel, sample)).collect();
    let mut segment = 0;
    let mut track = Track { values: Vec::with_capacity(clock.count), valid: Vec::with_capacity(clock.count) };
    for index in 0..clock.count {
        let at_s = clock.at(index) + delay_s;
        while segment + 2 < times.len() && times[segment + 1] <= at_s {
            segment += 1;
        }
        track.values.push(cubic(channel, &slopes, segment, at_s));
        let inside = times[0] - 1e-9 <= at_s && at_s <= times[times.len() - 1] + 1e-9;
        track.valid.push(inside && times[segment + 1] - times[segment] <= GAP_PERIODS * period_s);
    }
    track
}

fn cubic<const N: usize>(channel: &Channel<N>, slopes: &[[f64; N]], segment: usize, at_s: f64) -> [f64; N] {
    let (times, values) = (&channel.time_s, &channel.values);
    let span_s = times[segment + 1] - times[segment];
    // Beyond the samples nothing is valid; a cubic would run away there.
    let part = ((at_s - times[segment]) / span_s).clamp(0.0, 1.0);
    let (part2, part3) = (part * part, part * part * part);
    let shares = [
        2.0 * part3 - 3.0 * part2 + 1.0,
        part3 - 2.0 * part2 + part,
        3.0 * part2 - 2.0 * part3,
        part3 - part2,
    ];
    std::array::from_fn(|i| {
        shares[0] * values[segment][i]
            + shares[1] * span_s * slopes[segment][i]
            + shares[2] * values[segment + 1][i]
            + shares[3] * span_s * slopes[segment + 1][i]
    })
}

fn slope_at<const N: usize>(channel: &Channel<N>, sample: usize) -> [f64; N] {
    let (times, values) = (&channel.time_s, &channel.values);
    let secant = |a: usize, i: usize| (values[a + 1][i] - values[a][i]) / (times[a + 1] - times[a]);
    let last = times.len() - 1;
    std::array::from_fn(|i| {
        if sample == 0 {
            return secant(0, i);
        }
        if sample == last {
            return secant(last - 1, i);
        }
        let (before_s, after_s) = (times[sample] - times[sample - 1], times[sample + 1] - times[sample]);
        (secant(sample - 1, i) * after_s + secant(sample, i) * before_s) / (before_s + after_s)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled_at(step_s: f64, count: usize, value: impl Fn(f64) -> f64) -> Channel<1> {
        let time_s: Vec<f64> = (0..count).map(|k| k as f64 * step_s).collect();
        let values = time_s.iter().map(|t| [value(*t)]).collect();
        Channel { time_s, values }
    }

    #[test]
    fn a_fast_channel_is_averaged_about_each_instant() {
        let channel = sampled_at(0.001, 1001, |t| {
            3.0 * t + (if (t * 1000.0).round() % 2.0 == 0.0 { 1.0 } else { -1.0 })
        });
        let track = Track::sampled(&channel, 0.0, &Clock::spanning(0.1, 0.9, 0.004));
        for (index, value) in track.values.iter().enumerate() {
            assert!((value[0] - 3.0 * (0.1 + 0.004 * index as f64)).abs() < 1e-9, "{value:?}");
        }
        assert!(track.valid.iter().all(|valid| *valid));
    }

    #[test]
    fn a_slow_channel_is_interpolated_and_a_delay_taken_off() {
        let channel = sampled_at(0.01, 201, |t| libm::sin(3.0 * t));
        let clock = Clock::spanning(0.1, 1.8, 0.005);
        let track = Track::sampled(&channel, 0.02, &clock);
        for (index, value) in track.values.iter().enumerate() {
            assert!((value[0] - libm::sin(3.0 * (clock.at(index) + 0.02))).abs() < 1e-5);
        }
    }

    #[test]
    fn instants_in_a_gap_are_marked() {
        let mut channel = sampled_at(0.01, 101, |t| t);
        channel.time_s.drain(50..60);
        channel.values.drain(50..60);
        let clock = Clock::spanning(0.0, 1.0, 0.005);
        let track = Track::sampled(&channel, 0.0, &clock);
        let marked: Vec<f64> = (0..clock.count).filter(|i| !track.valid[*i]).map(|i| clock.at(i)).collect();
        assert!(marked.first().unwrap() >= &0.489 && marked.last().unwrap() <= &0.601, "{marked:?}");
        assert!(marked.len() > 18);
    }

    #[test]
    fn a_slope_is_exact_for_a_line() {
        let channel = sampled_at(0.01, 101, |t| 2.0 * t + 1.0);
        let track = Track::sampled(&channel, 0.0, &Clock::spanning(0.0, 1.0, 0.01));
        assert!(track.slope(3, 0.01).iter().all(|slope| (slope[0] - 2.0).abs() < 1e-9));
    }
}
