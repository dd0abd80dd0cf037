//! Spikes of rotor speeds: a telemetry frame that was read wrong gives a number that no rotor reaches, for a sample or two.

use crate::flight::{Channel, median};
use std::cmp::Ordering;

/// Samples that the median about a sample is taken of: that of a spike of up to three is one of its neighbours'.
const ABOUT: usize = 7;
/// A spike differs from that median by this part of the channel's usual greatest speed.
const PART: f64 = 0.5;
/// Slower logs may hold such changes of a rotor's speed: three samples of 0.02 s are a time constant of a motor.
const PERIOD_MAX_S: f64 = 0.02;
/// No rotor turns at so many times the usual greatest speed: its thrust would be nine times as large.
const IMPOSSIBLE: f64 = 3.0;
/// The usual greatest speed is larger than this part of all speeds.
const USUAL: f64 = 0.99;

/// The usual greatest number of a channel; `None` where it has none.
pub fn usual_greatest(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = numbers.collect();
    let at = ((sorted.len().checked_sub(1)?) as f64 * USUAL) as usize;
    Some(*sorted.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Marks the samples in which no rotor has a spike.
pub fn without<const N: usize>(channel: &Channel<N>) -> Vec<bool> {
    let all = || channel.values.iter().flatten().copied().filter(|speed| *speed != 0.0);
    let Some(greatest) = usual_greatest(all()) else { return vec![true; channel.values.len()] };
    let is_fast =
        channel.period_s().is_some_and(|period_s| period_s.total_cmp(&PERIOD_MAX_S) != Ordering::Greater);
    let is_spike = |at: usize, rotor: usize| {
        let speed = channel.values[at][rotor];
        let from = at.saturating_sub(ABOUT / 2).min(channel.values.len().saturating_sub(ABOUT));
        let about = || channel.values[from..].iter().take(ABOUT).map(|speeds| speeds[rotor]);
        // Most samples are near all about them, and need no median.
        let differs = || {
            about().any(|other| (speed - other).abs() > PART * greatest)
                && median(about()).is_some_and(|usual| (speed - usual).abs() > PART * greatest)
        };
        speed.abs() > IMPOSSIBLE * greatest || is_fast && differs()
    };
    (0..channel.values.len()).map(|at| !(0..N).any(|rotor| is_spike(at, rotor))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rotors that swing about 1000 and 1100 rad/s, sampled every `period_s`.
    fn swinging(period_s: f64) -> Channel<2> {
        let time_s: Vec<f64> = (0..400).map(|at| f64::from(at) * period_s).collect();
        let speeds = |t: &f64| [1000.0 + 200.0 * libm::sin(9.0 * t), 1100.0 + 150.0 * libm::cos(7.0 * t)];
        Channel { values: time_s.iter().map(speeds).collect(), time_s }
    }

    fn left_out(channel: &Channel<2>) -> Vec<usize> {
        without(channel).iter().enumerate().filter(|(_, kept)| !**kept).map(|(at, _)| at).collect()
    }

    #[test]
    fn frames_that_were_read_wrong_are_spikes() {
        let mut channel = swinging(0.01);
        channel.values[0][1] = 60_000.0;
        channel.values[50][0] = 60_000.0;
        channel.values[90][1] = 0.0;
        channel.values[91][1] = 0.0;
        channel.values[399][0] = 2_400.0;
        assert_eq!(left_out(&channel), [0, 50, 90, 91, 399]);
    }

    #[test]
    fn motors_that_start_and_stop_have_no_spikes() {
        let mut channel = swinging(0.01);
        channel.values[..100].fill([0.0; 2]);
        channel.values[300..].fill([0.0; 2]);
        assert_eq!(left_out(&channel), [0; 0]);
    }

    #[test]
    fn a_slow_log_may_hold_pulses_but_no_impossible_speed() {
        let mut channel = swinging(0.1);
        channel.values[50] = [0.0; 2];
        channel.values[60][1] = 6_000.0;
        assert_eq!(left_out(&channel), [60]);
    }

    #[test]
    fn a_channel_without_samples_has_no_spikes() {
        assert!(without(&Channel::<4>::default()).is_empty());
        assert_eq!(without(&Channel { time_s: vec![0.0; 3], values: vec![[0.0; 2]; 3] }), [true; 3]);
    }
}
