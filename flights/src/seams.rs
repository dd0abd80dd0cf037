//! Seams of a log in several files: the times between its parts. Where samples are missing there, it is a gap for every
//! channel, however short.

use std::collections::BTreeMap;

use vehicles::gaps::{GAP_PERIODS, held_period_s};

use crate::flight::{AnyChannel, period_s};
use crate::quantity::Quantity;

/// Periods of the fastest channel beyond which samples are missing at a seam.
const MISSING_PERIODS: f64 = 2.0;
/// Shortest gap that every reader of a channel finds, in seconds.
const LEAST_GAP_S: f64 = 0.05;

/// For each seam of a log, the time of the last sample before it and of the first behind it.
pub type SeamList = Vec<(f64, f64)>;

/// Seams of the logs that channels were read from, on the log's clock.
#[derive(Debug, Default)]
pub struct Seams {
    /// By channel; of those whose log has several files.
    pub of_channel: BTreeMap<Quantity, SeamList>,
}

impl Seams {
    /// Seams of the log that has all these channels, at which samples are missing: those longer than two periods of the
    /// fastest channel of `times`, and all where there are no such times.
    pub fn breaks(&self, channels: &[Quantity], times: &[(Quantity, &[f64])]) -> SeamList {
        let mut whole = SeamList::new();
        for seams in channels.iter().filter_map(|channel| self.of_channel.get(channel)) {
            whole.resize(seams.len().max(whole.len()), (f64::NEG_INFINITY, f64::INFINITY));
            for (whole, seam) in whole.iter_mut().zip(seams) {
                *whole = (whole.0.max(seam.0), whole.1.min(seam.1));
            }
        }
        if whole.is_empty() {
            return whole;
        }
        let of_log = times.iter().filter(|(channel, _)| channels.contains(channel));
        let periods = of_log.filter_map(|(_, time_s)| held_period_s(time_s));
        let fastest_s = periods.min_by(f64::total_cmp).unwrap_or(0.0);
        whole.retain(|(from_s, to_s)| to_s - from_s > MISSING_PERIODS * fastest_s);
        whole
    }
}

/// Leaves out the samples nearest to each of `breaks`, until every reader of the channel takes the step over
/// it for a gap. Returns their number.
pub fn widen(channel: &mut dyn AnyChannel, breaks: &[(f64, f64)]) -> usize {
    let times = channel.time_s().clone();
    let usual_s = [period_s(&times), held_period_s(&times)].into_iter().flatten().fold(0.0, f64::max);
    // A hundredth of a period above the limit, as times are rounded.
    let least_s = ((GAP_PERIODS + 0.01) * usual_s).max(1.01 * LEAST_GAP_S);
    let is_beside = |time_s: f64| {
        breaks.iter().any(|(from_s, to_s)| {
            let reach_s = 0.5 * (least_s - (to_s - from_s)).max(0.0);
            from_s - reach_s < time_s && time_s < to_s + reach_s
        })
    };
    let is_kept: Vec<bool> = times.iter().map(|time_s| !is_beside(*time_s)).collect();
    channel.keep(&|index| is_kept[index]);
    times.len() - channel.time_s().len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clean::gaps;
    use crate::flight::Channel;

    fn channel(times: &[f64]) -> Channel<1> {
        Channel { time_s: times.to_vec(), values: vec![[0.0]; times.len()] }
    }

    #[test]
    fn a_break_becomes_a_gap_of_any_channel() {
        let fast: Vec<f64> =
            (0..200).map(|k| 0.01 * f64::from(k) + if k < 100 { 0.0 } else { 0.02 }).collect();
        let slow: Vec<f64> = (0..40).map(|k| 0.05 * f64::from(k)).collect();
        for times in [fast, slow] {
            let mut whole = channel(&times);
            assert!(gaps(&whole.time_s).is_empty());
            assert!((1..=6).contains(&widen(&mut whole, &[(0.99, 1.02)])));
            let found = gaps(&whole.time_s);
            assert!(found.len() == 1 && found[0].0 <= 0.99 && found[0].1 >= 1.02, "{found:?}");
            assert_eq!(vehicles::gaps::of_held(&whole.time_s).len(), 1);
        }
        let mut long = channel(&[0.0, 0.01, 0.02, 5.0, 5.01]);
        assert_eq!(widen(&mut long, &[(0.02, 5.0)]), 0);
    }

    #[test]
    fn seams_of_a_log_are_those_of_all_its_channels() {
        let (p, v) = (Quantity::Position, Quantity::Velocity);
        let infinite = (f64::NEG_INFINITY, f64::INFINITY);
        let of_channel = BTreeMap::from([
            (p, vec![(1.0, 2.0), (5.0, 5.02)]),
            (v, vec![(1.5, 1.9), (5.005, 5.015)]),
            (Quantity::Attitude, vec![infinite, (0.0, 9.0)]),
        ]);
        let seams = Seams { of_channel };
        let times: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
        assert_eq!(seams.breaks(&[p, v], &[(p, &times), (v, &times)]), [(1.5, 1.9)]);
        assert_eq!(seams.breaks(&[p, v], &[]), [(1.5, 1.9), (5.005, 5.015)]);
        assert_eq!(seams.breaks(&[Quantity::Command], &[(p, &times)]), []);
    }
}
