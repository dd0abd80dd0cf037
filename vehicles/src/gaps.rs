//! Gaps of logs: steps between samples that are longer than those of the log.

/// Number of periods beyond which a step is a gap.
pub const GAP_PERIODS: f64 = 5.0;

/// Shortest gap of values that hold until the next sample: within a shorter one, motors do not reach another speed.
const LEAST_HELD_S: f64 = 0.05;

/// Share of the steps that are no longer than the usual one: samples that come in bursts have many short steps.
const USUAL: f64 = 0.9;

/// Usual longest step of values that hold until the next sample: nine of ten steps are no longer; `None` with fewer than two
/// samples.
#[must_use]
pub fn held_period_s(time_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get((USUAL * steps.len().saturating_sub(1) as f64) as usize).copied()
}

/// Returns the gaps of values that hold until the next sample, each as the times of the samples before and after it.
///
/// ```
/// // A sample every 10 ms, some of them lost, then none for a second.
/// let mut time_s: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.01).filter(|t| !(0.5..0.54).contains(t)).collect();
/// time_s.extend([2.0, 2.01]);
/// let gaps = vehicles::gaps::of_held(&time_s);
/// assert_eq!((gaps.len(), gaps[0].1), (1, 2.0));
/// ```
#[must_use]
pub fn of_held(time_s: &[f64]) -> Vec<(f64, f64)> {
    let Some(period_s) = held_period_s(time_s) else { return Vec::new() };
    // Times are differences of decimal fractions: a step of exactly five periods is no gap.
    let limit_s = (GAP_PERIODS * period_s).max(LEAST_HELD_S) * (1.0 + 1e-9);
    let steps = time_s.windows(2).map(|pair| (pair[0], pair[1]));
    steps.filter(|(from_s, to_s)| to_s - from_s > limit_s).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bursts_and_short_hiccups_are_no_gaps() {
        // Five messages within a millisecond, every 50 ms.
        let bursts: Vec<f64> =
            (0..500).map(|k| 0.05 * f64::from(k / 5) + 0.0002 * f64::from(k % 5)).collect();
        assert!(of_held(&bursts).is_empty());
        // A kilohertz with a hiccup of 40 ms in each half second.
        let hiccups: Vec<f64> = (0..4000).filter(|k| k % 500 >= 40).map(|k| 1e-3 * f64::from(k)).collect();
        assert!(of_held(&hiccups).is_empty());
    }

    #[test]
    fn drop_outs_are_gaps_at_any_rate_and_however_many() {
        for period_s in [0.001, 0.01, 0.02, 0.05] {
            let all = (0..(30.0 / period_s) as u32).map(|k| period_s * f64::from(k));
            let dropped: Vec<f64> = all.filter(|t| !(0.6..1.0).contains(&(t % 2.0))).collect();
            assert_eq!(of_held(&dropped).len(), 15, "{period_s}");
        }
    }

    #[test]
    fn few_samples_have_no_gap() {
        assert!(of_held(&[]).is_empty() && of_held(&[1.0]).is_empty() && of_held(&[1.0, 9.0]).is_empty());
        assert_eq!(of_held(&[0.0, 0.01, 9.0]), [(0.01, 9.0)]);
    }
}
