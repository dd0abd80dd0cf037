//! A histogram of host times, and what is printed of it.

use hdrhistogram::Histogram;
use serde::{Serialize, Serializer};

/// Significant decimal digits that a histogram keeps.
const DIGITS: u8 = 3;

/// Times in nanoseconds.
#[derive(Clone, Debug)]
pub struct Times(Histogram<u64>);

/// The quantiles of some times, in microseconds; all 0 where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantiles {
    /// How many times there are.
    pub count: u64,
    pub p50_us: f64,
    pub p90_us: f64,
    pub p99_us: f64,
    #[serde(rename = "p99.9_us")]
    pub p99_9_us: f64,
    pub max_us: f64,
    pub mean_us: f64,
}

impl Default for Times {
    fn default() -> Self {
        // It grows with what is added: most of a profile's many histograms stay small.
        Self(
            Histogram::new(DIGITS)
                .unwrap_or_else(|error| unreachable!("a constant number of digits: {error}")),
        )
    }
}

impl Times {
    /// Adds a time.
    pub fn add(&mut self, ns: u64) {
        self.0.record(ns).unwrap_or_else(|error| unreachable!("the histogram grows: {error}"));
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The quantiles.
    pub fn quantiles(&self) -> Quantiles {
        let at = |quantile| self.0.value_at_quantile(quantile) as f64 * 1e-3;
        Quantiles {
            count: self.0.len(),
            p50_us: at(0.5),
            p90_us: at(0.9),
            p99_us: at(0.99),
            p99_9_us: at(0.999),
            max_us: self.0.max() as f64 * 1e-3,
            mean_us: self.0.mean() * 1e-3,
        }
    }

    /// Counts per bin, where bin `b` starts at 10^(b / `per_decade`) ns; times below 1 ns are in bin 0.
    pub fn bins(&self, per_decade: f64) -> Vec<(i32, u64)> {
        let mut bins: Vec<(i32, u64)> = Vec::new();
        for value in self.0.iter_recorded() {
            #[allow(clippy::cast_possible_truncation, reason = "at most 12 decades")]
            let bin = ((value.value_iterated_to().max(1) as f64).log10() * per_decade).floor() as i32;
            match bins.last_mut() {
                Some(last) if last.0 == bin => last.1 += value.count_at_value(),
                _ => bins.push((bin, value.count_at_value())),
            }
        }
        bins
    }

    /// What was added, in ascending order; exact below 2 µs.
    #[cfg(test)]
    pub fn values(&self) -> Vec<u64> {
        let times = |value: hdrhistogram::iterators::IterationValue<u64>| {
            let count = usize::try_from(value.count_at_value()).unwrap_or(0);
            std::iter::repeat_n(value.value_iterated_to(), count)
        };
        self.0.iter_recorded().flat_map(times).collect()
    }
}

impl Serialize for Times {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.quantiles().serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use super::Times;

    #[test]
    fn quantiles_and_bins_are_those_of_what_was_added() {
        let mut times = Times::default();
        (1..=1000).for_each(|us| times.add(us * 1000));
        let quantiles = times.quantiles();
        assert_eq!(quantiles.count, 1000);
        // Three digits are kept.
        for (found, expected) in
            [(quantiles.p50_us, 500.0), (quantiles.p99_us, 990.0), (quantiles.max_us, 1000.0)]
        {
            assert!((found / expected - 1.0_f64).abs() < 2e-3, "{found} instead of {expected}");
        }
        let bins = times.bins(1.0);
        assert_eq!(bins.iter().map(|(_, count)| count).sum::<u64>(), 1000);
        // 1 µs … 9 µs are in the fourth decade of nanoseconds.
        assert_eq!(bins[0], (3, 9));
    }
}
