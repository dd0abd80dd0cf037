//! Long curves as few points, made while a recording is read: memory does not grow with its length.

/// A curve that keeps, of each of its bins, the first, the lowest, the highest and the last sample, and one that is no
/// number, where the line breaks off. Drawn over no more pixels than it has bins, it is the same line as the whole
/// curve, extremes and gaps included.
#[derive(Clone, Debug)]
pub struct Curve {
    bins: Vec<Bin>,
    bins_max: usize,
    /// Samples of a full bin: a power of two.
    bin_samples: u64,
    samples: u64,
}

type Sample = (f64, f64);

#[derive(Clone, Copy, Debug)]
struct Bin {
    first: Sample,
    lowest: Sample,
    highest: Sample,
    gap: Option<Sample>,
    last: Sample,
}

impl Curve {
    /// A curve of up to `bins_max` bins, and so five times as many points.
    pub fn new(bins_max: usize) -> Self {
        Self { bins: Vec::new(), bins_max: bins_max.max(2), bin_samples: 1, samples: 0 }
    }

    /// Samples that were pushed.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Adds a sample at time `time_s`, later than those before.
    pub fn push(&mut self, time_s: f64, value: f64) {
        if self.bins.len() == self.bins_max && self.samples.is_multiple_of(self.bin_samples) {
            self.bins = self.bins.chunks(2).map(Bin::merged).collect();
            self.bin_samples *= 2;
        }
        let bin = Bin::of((time_s, value));
        match self.bins.last_mut() {
            Some(last) if !self.samples.is_multiple_of(self.bin_samples) => {
                *last = Bin::merged(&[*last, bin])
            }
            _ => self.bins.push(bin),
        }
        self.samples += 1;
    }

    /// The points in the order of time.
    pub fn points(&self) -> Vec<Sample> {
        let mut points: Vec<Sample> = self.bins.iter().flat_map(Bin::points).collect();
        points.dedup_by_key(|(time_s, _)| *time_s);
        points
    }
}

impl Bin {
    fn of(sample: Sample) -> Self {
        let gap = sample.1.is_nan().then_some(sample);
        Self { first: sample, lowest: sample, highest: sample, gap, last: sample }
    }

    /// One bin for one or two that follow each other. A number is lower and higher than what is none.
    fn merged(bins: &[Self]) -> Self {
        let (first, last) = (bins[0], bins[bins.len() - 1]);
        Self {
            first: first.first,
            lowest: if first.lowest.1.min(last.lowest.1) == first.lowest.1 {
                first.lowest
            } else {
                last.lowest
            },
            highest: if first.highest.1.max(last.highest.1) == first.highest.1 {
                first.highest
            } else {
                last.highest
            },
            gap: first.gap.or(last.gap),
            last: last.last,
        }
    }

    fn points(&self) -> [Sample; 5] {
        let gap = self.gap.unwrap_or(self.first);
        let mut points = [self.first, self.lowest, self.highest, gap, self.last];
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    }
}

/// A path in space that keeps every n-th point, and the last.
#[derive(Clone, Debug)]
pub struct Trail {
    points: Vec<[f64; 3]>,
    last: Option<[f64; 3]>,
    points_max: usize,
    every: u64,
    samples: u64,
}

impl Trail {
    /// A path of up to `points_max` points.
    pub fn new(points_max: usize) -> Self {
        Self { points: Vec::new(), last: None, points_max: points_max.max(2), every: 1, samples: 0 }
    }

    /// Samples that were pushed.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Adds a point.
    pub fn push(&mut self, point: [f64; 3]) {
        if self.samples.is_multiple_of(self.every) {
            if self.points.len() + 1 >= self.points_max {
                self.points = self.points.iter().step_by(2).copied().collect();
                self.every *= 2;
            }
            // Since the step has doubled, this one may be between two.
            if self.samples.is_multiple_of(self.every) {
                self.points.push(point);
            }
        }
        self.last = Some(point);
        self.samples += 1;
    }

    /// The points in the order of time.
    pub fn points(&self) -> Vec<[f64; 3]> {
        let last = self.last.filter(|last| self.points.last() != Some(last));
        self.points.iter().copied().chain(last).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{Curve, Trail};
    use proptest::prelude::*;

    fn thinned(values: &[f64], bins: usize) -> Vec<(f64, f64)> {
        let mut curve = Curve::new(bins);
        values.iter().enumerate().for_each(|(index, value)| curve.push(index as f64, *value));
        assert_eq!(curve.samples(), values.len() as u64);
        curve.points()
    }

    proptest! {
        #[test]
        fn a_thinned_curve_keeps_ends_extremes_and_order(
            values in prop::collection::vec(-1e6..1e6, 1..400usize), bins in 2..40usize,
        ) {
            let points = thinned(&values, bins);
            prop_assert!(points.len() <= 4 * bins);
            prop_assert!(points.windows(2).all(|pair| pair[0].0 < pair[1].0));
            prop_assert!(points.iter().all(|(time, value)| values[*time as usize] == *value));
            prop_assert_eq!(points[0], (0.0, values[0]));
            let last = values.len() - 1;
            prop_assert_eq!(points[points.len() - 1], (last as f64, values[last]));
            let found = points.iter().map(|(_, value)| *value);
            prop_assert_eq!(found.clone().reduce(f64::max), values.iter().copied().reduce(f64::max));
            prop_assert_eq!(found.reduce(f64::min), values.iter().copied().reduce(f64::min));
        }

        #[test]
        fn a_thinned_path_keeps_its_ends_and_even_steps(samples in 1..500usize, points_max in 2..40usize) {
            let mut trail = Trail::new(points_max);
            (0..samples).for_each(|index| trail.push([index as f64, 0.0, 0.0]));
            let x: Vec<f64> = trail.points().iter().map(|point| point[0]).collect();
            prop_assert!(x.len() <= points_max && (samples < 3 || x.len() >= 2));
            prop_assert_eq!((x[0], x[x.len() - 1]), (0.0, (samples - 1) as f64));
            let steps: Vec<f64> = x.windows(2).map(|pair| pair[1] - pair[0]).collect();
            prop_assert!(steps.iter().rev().skip(1).all(|step| *step == steps[0]));
        }
    }

    /// A bin of 8 samples, whatever else is in it.
    fn bin_with_gap(index: usize) -> Vec<(f64, f64)> {
        let mut values = [1.0, 5.0, 2.0, 0.0, 2.0, -4.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
        values[index] = f64::NAN;
        thinned(&values, 2)
    }

    #[test]
    fn what_is_no_number_breaks_the_line_and_hides_no_peak_wherever_in_a_bin_it_is() {
        for index in [0, 3, 7] {
            let points = bin_with_gap(index);
            let gaps: Vec<f64> = points.iter().filter(|(_, value)| value.is_nan()).map(|gap| gap.0).collect();
            assert_eq!(gaps, [index as f64]);
            assert!(points.contains(&(1.0, 5.0)) && points.contains(&(5.0, -4.0)), "{index}: {points:?}");
            assert!(points.windows(2).all(|pair| pair[0].0 < pair[1].0));
        }
        assert!(thinned(&[f64::NAN; 40], 2).iter().all(|(_, value)| value.is_nan()));
    }

    #[test]
    fn a_short_curve_loses_nothing() {
        let values: Vec<f64> = (0..15).map(|index| f64::from(index * 7 % 15)).collect();
        assert_eq!(thinned(&values, 8).len(), 15);
    }
}
