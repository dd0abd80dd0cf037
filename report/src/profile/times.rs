//! A histogram of host times, and its printed figures.

use hdrhistogram::Histogram;
use serde::{Serialize, Serializer};

/// Significant decimal digits that a histogram keeps.
const DIGITS: u8 = 3;

/// Times, each a number of units.
#[derive(Clone, Debug)]
pub struct Times {
    histogram: Histogram<u64>,
    unit_ns: u64,
    /// The longest time exactly: the histogram keeps three digits of it.
    max_ns: u64,
}

/// The quantiles of some times, in microseconds; all 0 if there are none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantiles {
    /// Number of times.
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
        Self::in_units(1)
    }
}

impl Times {
    /// Times that are multiples of `unit_ns`; up to two thousand units are kept exactly.
    pub fn in_units(unit_ns: u64) -> Self {
        // It grows with its values: most of a profile's many histograms stay small.
        let histogram = Histogram::new(DIGITS);
        let histogram = histogram.unwrap_or_else(|error| unreachable!("{DIGITS} is a constant: {error}"));
        Self { histogram, unit_ns: unit_ns.max(1), max_ns: 0 }
    }

    /// Adds a time.
    pub fn add(&mut self, ns: u64) {
        let added = self.histogram.record(ns / self.unit_ns);
        added.unwrap_or_else(|error| unreachable!("the histogram grows: {error}"));
        self.max_ns = self.max_ns.max(ns);
    }

    /// True if there are no times.
    pub fn is_empty(&self) -> bool {
        self.histogram.is_empty()
    }

    /// The quantiles.
    pub fn quantiles(&self) -> Quantiles {
        let us = |units: u64| (units * self.unit_ns).min(self.max_ns) as f64 / 1e3;
        let at = |quantile| us(self.histogram.value_at_quantile(quantile));
        Quantiles {
            count: self.histogram.len(),
            p50_us: at(0.5),
            p90_us: at(0.9),
            p99_us: at(0.99),
            p99_9_us: at(0.999),
            max_us: self.max_ns as f64 / 1e3,
            mean_us: self.histogram.mean() * self.unit_ns as f64 / 1e3,
        }
    }

    /// Counts per bin, where bin `b` starts at 10^(b / `per_decade`) ns; times below 1 ns are in bin 0.
    pub fn bins(&self, per_decade: f64) -> Vec<(i32, u64)> {
        let mut bins: Vec<(i32, u64)> = Vec::new();
        for value in self.histogram.iter_recorded() {
            #[allow(clippy::cast_possible_truncation, reason = "at most 12 decades")]
            let bin = (libm::log10((value.value_iterated_to() * self.unit_ns).max(1) as f64) * per_decade)
                .floor() as i32;
            match bins.last_mut() {
                Some(last) if last.0 == bin => last.1 += value.count_at_value(),
                _ => bins.push((bin, value.count_at_value())),
            }
        }
        bins
    }

    /// Values that were added, in ascending order; exact below two thousand units.
    #[cfg(test)]
    pub fn values(&self) -> Vec<u64> {
        let times = |value: hdrhistogram::iterators::IterationValue<u64>| {
            let count = usize::try_from(value.count_at_value()).unwrap_or(0);
            std::iter::repeat_n(value.value_iterated_to() * self.unit_ns, count)
        };
        self.histogram.iter_recorded().flat_map(times).collect()
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
        assert_eq!(quantiles.max_us, 1000.0, "the longest is exact");
        let bins = times.bins(1.0);
        assert_eq!(bins.iter().map(|(_, count)| count).sum::<u64>(), 1000);
        // 1 µs … 9 µs are in the fourth decade of nanoseconds.
        assert_eq!(bins[0], (3, 9));
    }

    #[test]
    fn times_in_units_are_exact() {
        let mut times = Times::in_units(1_000_000);
        [0, 1, 1, 1, 4].iter().for_each(|ticks| times.add(ticks * 1_000_000));
        let quantiles = times.quantiles();
        assert_eq!((quantiles.p50_us, quantiles.p90_us, quantiles.mean_us), (1000.0, 4000.0, 1400.0));
    }
}
