//! Step times counted in buckets of a logarithmic scale: percentiles for a few hundred bytes a node.

/// Buckets of a node: up to 1.07 s, in eighths of an octave.
pub const BUCKETS: usize = 192;
/// Width of the narrowest bucket, in nanoseconds.
const UNIT_NS: u64 = 16;
/// Buckets to an octave, as a power of two.
const OCTAVE_BITS: u32 = 3;

/// Histogram of the durations of a node's steps, since its first tick or since an earlier look.
///
/// Counts wrap; the difference of two looks is right as long as fewer than 2³² steps lie between them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StepTimes {
    counts: [u32; BUCKETS],
}

/// The bucket of a step that took `ns`.
pub(crate) fn bucket_of(ns: u64) -> usize {
    let units = ns / UNIT_NS;
    let octave = units.checked_ilog2().unwrap_or(0).saturating_sub(OCTAVE_BITS);
    // In octave 0 the units themselves; from there on the octave and the next three bits.
    let eighths = usize::try_from(units >> octave).unwrap_or(usize::MAX);
    (((octave as usize) << OCTAVE_BITS) + eighths).min(BUCKETS - 1)
}

/// The middle of `bucket` in nanoseconds.
fn middle_ns(bucket: usize) -> f64 {
    let eighths = 1 << OCTAVE_BITS;
    let octave = (bucket / eighths).saturating_sub(1);
    let lower = (bucket - octave * eighths) as f64;
    (lower + 0.5) * 2f64.powi(i32::try_from(octave).unwrap_or(i32::MAX)) * UNIT_NS as f64
}

impl StepTimes {
    pub(crate) fn new(counts: [u32; BUCKETS]) -> Self {
        Self { counts }
    }

    /// The steps since `earlier`.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        let mut counts = self.counts;
        counts.iter_mut().zip(earlier.counts).for_each(|(count, before)| *count = count.wrapping_sub(before));
        Self { counts }
    }

    /// The time in nanoseconds that `share` (0…1) of the steps did not exceed, within 7 % from 128 ns on;
    /// `None` without steps.
    #[must_use]
    pub fn percentile_ns(&self, share: f64) -> Option<f64> {
        let steps: u64 = self.counts.iter().copied().map(u64::from).sum();
        let mut left = share * steps as f64;
        let is_reached = |&count: &u32| {
            left -= f64::from(count);
            count > 0 && left <= 0.0
        };
        self.counts.iter().position(is_reached).map(middle_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::{BUCKETS, StepTimes, bucket_of, middle_ns};

    #[test]
    fn a_bucket_stands_for_its_times_within_seven_percent() {
        for ns in (128..1_000_000).step_by(7).chain([10_000_000, 123_456_789, 1_000_000_000]) {
            let error = (middle_ns(bucket_of(ns)) / ns as f64 - 1.0).abs();
            assert!(error <= 0.07, "{ns} ns: {error}");
        }
    }

    #[test]
    fn buckets_ascend_and_take_every_time() {
        let times = (0..64).flat_map(|bit| [(1 << bit) - 1, 1 << bit, (1 << bit) + (1 << bit) / 2]);
        let buckets: Vec<usize> = times.map(bucket_of).collect();
        assert!(buckets.is_sorted(), "{buckets:?}");
        assert_eq!((buckets[0], bucket_of(u64::MAX)), (0, BUCKETS - 1));
    }

    #[test]
    fn percentiles_are_those_of_the_steps_since_the_earlier_look() {
        let look = |times: &[(u64, u32)]| {
            let mut counts = [0; BUCKETS];
            times.iter().for_each(|&(ns, count)| counts[bucket_of(ns)] += count);
            StepTimes::new(counts)
        };
        let (earlier, later) = (look(&[(50_000, 1000)]), look(&[(50_000, 1000), (1000, 98), (8000, 2)]));
        let recent = later.since(&earlier);
        let near = |share, ns: f64| (recent.percentile_ns(share).unwrap() / ns - 1.0).abs() < 0.07;
        assert!(near(0.5, 1000.0) && near(0.98, 1000.0) && near(0.99, 8000.0) && near(1.0, 8000.0));
        assert_eq!(earlier.since(&earlier).percentile_ns(0.5), None);
    }
}
