//! Statistics of samples that come one after the other.

use runtime::manifest::Statistic;
use serde::{Deserialize, Serialize};

/// Sums and extremes of the samples so far.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Samples {
    count: u64,
    least: f64,
    greatest: f64,
    last: f64,
    sum: f64,
    squares: f64,
}

impl Default for Samples {
    fn default() -> Self {
        let (least, greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        Self { count: 0, least, greatest, last: f64::NAN, sum: 0.0, squares: 0.0 }
    }
}

impl Samples {
    /// Adds a sample.
    pub fn add(&mut self, value: f64) {
        // NaN must fail a condition, so it wins over every number here, unlike with f64::min.
        let extreme = |so_far: f64, pick: fn(f64, f64) -> f64| {
            if so_far.is_nan() || value.is_nan() { f64::NAN } else { pick(so_far, value) }
        };
        self.least = extreme(self.least, f64::min);
        self.greatest = extreme(self.greatest, f64::max);
        (self.count, self.last) = (self.count + 1, value);
        self.sum += value;
        self.squares += value * value;
    }

    /// Values of `statistic`: none without a sample.
    pub fn values(&self, statistic: Statistic) -> Vec<f64> {
        let count = self.count as f64;
        match statistic {
            _ if self.count == 0 => Vec::new(),
            Statistic::Every => vec![self.least, self.greatest],
            Statistic::Min => vec![self.least],
            Statistic::Max => vec![self.greatest],
            Statistic::Mean => vec![self.sum / count],
            Statistic::Rms => vec![(self.squares / count).sqrt()],
            Statistic::Last => vec![self.last],
            Statistic::Span => vec![self.greatest - self.least],
            Statistic::Lag | Statistic::Gain => {
                unreachable!("of a reference, without which the manifest is refused")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Samples;
    use runtime::manifest::Statistic;

    fn statistic(statistic: Statistic, values: &[f64]) -> Vec<f64> {
        let mut samples = Samples::default();
        values.iter().for_each(|value| samples.add(*value));
        samples.values(statistic)
    }

    #[test]
    fn a_nan_among_the_samples_is_not_hidden() {
        assert!(statistic(Statistic::Max, &[1.0, f64::NAN, 2.0])[0].is_nan());
        assert_eq!(statistic(Statistic::Every, &[3.0, 1.0]), [1.0, 3.0]);
        assert!(statistic(Statistic::Every, &[]).is_empty());
        assert_eq!(statistic(Statistic::Span, &[3.0, -1.0, 2.0]), [4.0]);
        assert!(statistic(Statistic::Span, &[1.0, f64::NAN])[0].is_nan());
    }

    #[test]
    fn means_are_of_all_samples() {
        assert_eq!(statistic(Statistic::Mean, &[1.0, 2.0, 6.0]), [3.0]);
        assert_eq!(statistic(Statistic::Rms, &[3.0, -3.0, 3.0]), [3.0]);
        assert_eq!(statistic(Statistic::Last, &[3.0, -1.0]), [-1.0]);
        assert_eq!([Statistic::Min, Statistic::Max].map(|of| statistic(of, &[3.0, -1.0])[0]), [-1.0, 3.0]);
    }
}
