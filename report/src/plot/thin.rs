//! Long curves as few points, made while a recording is read: memory does not grow with its length.

/// A time in seconds and a value.
pub type Sample = (f64, f64);

/// The first, the lowest, the highest and the last sample of a stretch, and one that is NaN, where the line breaks
/// off. They are in the order of time, and some of them may be the same.
type Bin = [Sample; 5];

/// A curve that keeps the extremes, ends and gaps of each of its bins. Drawn over no more pixels than it has bins, it is
/// the same line as the whole curve.
#[derive(Clone, Debug)]
pub struct Curve {
    bins: Vec<Bin>,
    bins_max: usize,
    /// Samples of a full bin: a power of two.
    bin_samples: u64,
    /// Samples that were pushed.
    pub samples: u64,
}

impl Curve {
    /// A curve of up to `bins_max` bins, and so five times as many points.
    pub fn new(bins_max: usize) -> Self {
        Self { bins: Vec::new(), bins_max: bins_max.max(2), bin_samples: 1, samples: 0 }
    }

    /// Adds a sample at time `time_s`, later than those before.
    pub fn push(&mut self, time_s: f64, value: f64) {
        if self.bins.len() == self.bins_max && self.samples.is_multiple_of(self.bin_samples) {
            self.bins = self.bins.chunks(2).map(|pair| bin(pair.as_flattened())).collect();
            self.bin_samples *= 2;
        }
        let sample = (time_s, value);
        match self.bins.last_mut() {
            Some(last) if !self.samples.is_multiple_of(self.bin_samples) => {
                let [a, b, c, d, e] = *last;
                *last = bin(&[a, b, c, d, e, sample]);
            }
            _ => self.bins.push([sample; 5]),
        }
        self.samples += 1;
    }

    /// The points in the order of time.
    pub fn points(&self) -> Vec<Sample> {
        let mut points = self.bins.as_flattened().to_vec();
        points.dedup_by_key(|(time_s, _)| *time_s);
        points
    }
}

/// A curve over time, or against another field.
#[derive(Clone, Debug)]
pub enum Line {
    /// Over time: it never turns back, so its bins keep all peaks.
    OverTime(Curve),
    /// Against a field that may go back and forth: evenly spaced samples.
    Against(Trail),
}

impl Line {
    /// Adds a sample.
    pub fn push(&mut self, x: f64, y: f64) {
        match self {
            Self::OverTime(curve) => curve.push(x, y),
            Self::Against(trail) => trail.push([x, y, 0.0]),
        }
    }

    /// The points in the order of time.
    pub fn points(&self) -> Vec<Sample> {
        match self {
            Self::OverTime(curve) => curve.points(),
            Self::Against(trail) => trail.points().into_iter().map(|[x, y, _]| (x, y)).collect(),
        }
    }

    /// Samples that were pushed.
    pub fn samples(&self) -> u64 {
        match self {
            Self::OverTime(curve) => curve.samples,
            Self::Against(trail) => trail.samples,
        }
    }
}

/// The bin of samples that follow each other.
fn bin(samples: &[Sample]) -> Bin {
    let first = samples[0];
    let extreme = |is_beyond: fn(f64, f64) -> bool| {
        let numbers = samples.iter().filter(|sample| !sample.1.is_nan());
        numbers.copied().reduce(|best, other| if is_beyond(other.1, best.1) { other } else { best })
    };
    let gap = samples.iter().find(|sample| sample.1.is_nan()).copied();
    let last = samples.last().copied();
    let kept = [Some(first), extreme(|a, b| a < b), extreme(|a, b| a > b), gap, last];
    let mut bin = kept.map(|sample| sample.unwrap_or(first));
    bin.sort_by(|a, b| a.0.total_cmp(&b.0));
    bin
}

/// A path by positions in metres and, where the topic has them, attitudes: quaternions as x, y, z, w.
pub type Poses = Trail<7>;

/// A path of `N` numbers a point, three of them in space, that keeps every n-th point, and the last.
#[derive(Clone, Debug)]
pub struct Trail<const N: usize = 3> {
    points: Vec<[f64; N]>,
    last: Option<[f64; N]>,
    points_max: usize,
    every: u64,
    /// Samples that were pushed.
    pub samples: u64,
    /// The free body that it is of, if it is of one.
    body: Option<String>,
}

impl<const N: usize> Trail<N> {
    /// A path of up to `points_max` points.
    pub fn new(points_max: usize) -> Self {
        let points_max = points_max.max(2);
        Self { points: Vec::new(), last: None, points_max, every: 1, samples: 0, body: None }
    }

    /// This path for a free body of this name.
    pub fn of_body(self, name: String) -> Self {
        Self { body: Some(name), ..self }
    }

    /// The free body that it is of, if it is of one.
    pub fn body(&self) -> Option<&str> {
        self.body.as_deref()
    }

    /// Adds a point.
    pub fn push(&mut self, point: [f64; N]) {
        let is_full = self.points.len() + 1 >= self.points_max;
        if is_full && self.samples.is_multiple_of(self.every) {
            self.points = self.points.iter().step_by(2).copied().collect();
            self.every *= 2;
        }
        if self.samples.is_multiple_of(self.every) {
            self.points.push(point);
        }
        self.last = Some(point);
        self.samples += 1;
    }

    /// The points in the order of time.
    pub fn points(&self) -> Vec<[f64; N]> {
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
        assert_eq!(curve.samples, values.len() as u64);
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

    /// A bin of 8 samples, with any others in it.
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
