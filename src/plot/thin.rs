//! Long curves as few points, made while a recording is read: memory does not grow with its length.

/// A curve that keeps, of each of its bins, the first, the lowest, the highest and the last sample. Drawn over no
/// more pixels than it has bins, it is the same line as the whole curve, extremes included.
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
    last: Sample,
}

impl Curve {
    /// A curve of up to `bins_max` bins, and so four times as many points.
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
        Self { first: sample, lowest: sample, highest: sample, last: sample }
    }

    /// One bin for one or two that follow each other.
    fn merged(bins: &[Self]) -> Self {
        let (first, last) = (bins[0], bins[bins.len() - 1]);
        Self {
            first: first.first,
            lowest: if last.lowest.1 < first.lowest.1 { last.lowest } else { first.lowest },
            highest: if last.highest.1 > first.highest.1 { last.highest } else { first.highest },
            last: last.last,
        }
    }

    fn points(&self) -> [Sample; 4] {
        let (a, b) = (self.lowest, self.highest);
        let [a, b] = if a.0 <= b.0 { [a, b] } else { [b, a] };
        [self.first, a, b, self.last]
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

    #[test]
    fn a_short_curve_loses_nothing() {
        let values: Vec<f64> = (0..15).map(|index| f64::from(index * 7 % 15)).collect();
        assert_eq!(thinned(&values, 8).len(), 15);
    }
}
