//! Agreement of two measurements of the same vector in any units: one logged, one derived from another channel.

use nalgebra::Vector3;

use crate::flight::Channel;
use crate::frame::rotation;

/// Fewer pairs say nothing.
const PAIRS_MIN: usize = 20;

/// Pairs of a logged and a derived vector.
#[derive(Debug, Clone, Default)]
pub struct Pairs {
    /// As logged.
    pub logged: Vec<Vector3<f64>>,
    /// As derived.
    pub derived: Vec<Vector3<f64>>,
}

impl Pairs {
    /// The angular velocity against the attitude's change over windows of `window_s`.
    pub fn rates(attitude: &Channel<4>, angular_velocity: &Channel<3>, window_s: f64) -> Self {
        let q = |index: usize| rotation(attitude.values[index]);
        let change = |from: usize, to: usize| Some((q(from).inverse() * q(to)).scaled_axis());
        Self::over_windows(&attitude.time_s, angular_velocity, window_s, change)
    }

    /// The velocity against the position's change over windows of `window_s`.
    pub fn velocities(position: &Channel<3>, velocity: &Channel<3>, window_s: f64) -> Self {
        let p = |index: usize| Vector3::from(position.values[index]);
        Self::over_windows(&position.time_s, velocity, window_s, |from, to| Some(p(to) - p(from)))
    }

    /// The vehicle's leaning, as an acceleration in the horizontal plane under `gravity_m_s2`, against the position's
    /// over windows of `window_s`.
    pub fn leaning(attitude: &Channel<4>, position: &Channel<3>, gravity_m_s2: f64, window_s: f64) -> Self {
        let leaning = Self::leaning_of(attitude, gravity_m_s2);
        Self::over_windows(&position.time_s, &leaning, window_s, |from, to| {
            velocity_change(position, from, to).map(|change| Vector3::new(change.x, change.y, 0.0))
        })
    }

    /// The horizontal acceleration of a vehicle that carries its weight as it leans, in the world.
    pub fn leaning_of(attitude: &Channel<4>, gravity_m_s2: f64) -> Channel<3> {
        let lean = |wxyz: &[f64; 4]| {
            let up = rotation(*wxyz) * Vector3::z();
            // Beyond 60 degrees the vehicle does not hold its height by leaning.
            let part = gravity_m_s2 / up.z.max(0.5);
            [part * up.x, part * up.y, 0.0]
        };
        let values = attitude.values.iter().map(lean).collect();
        Channel { time_s: attitude.time_s.clone(), values }
    }

    /// An acceleration in the world against the velocity's change over windows of `window_s`, or against the position's
    /// where there is no velocity.
    pub fn accelerations(
        acceleration: &Channel<3>,
        velocity: &Channel<3>,
        position: &Channel<3>,
        window_s: f64,
    ) -> Self {
        if velocity.is_empty() {
            let change = |from: usize, to: usize| velocity_change(position, from, to);
            return Self::over_windows(&position.time_s, acceleration, window_s, change);
        }
        let v = |index: usize| Vector3::from(velocity.values[index]);
        Self::over_windows(&velocity.time_s, acceleration, window_s, |from, to| Some(v(to) - v(from)))
    }

    /// A logged quantity against the size of the mean of `vector` over windows of `window_s`.
    pub fn sizes(logged: &Channel<3>, vector: &Channel<3>, window_s: f64) -> Self {
        let time_s = &vector.time_s;
        let size = |from: usize, to: usize| {
            let sum: Vector3<f64> = vector.values[from..to].iter().map(|value| Vector3::from(*value)).sum();
            // Windows divide by their length.
            Some(Vector3::x() * (sum.norm() / (to - from) as f64 * (time_s[to] - time_s[from])))
        };
        Self::over_windows(time_s, logged, window_s, size)
    }

    fn over_windows(
        time_s: &[f64],
        logged: &Channel<3>,
        window_s: f64,
        change: impl Fn(usize, usize) -> Option<Vector3<f64>>,
    ) -> Self {
        let mut pairs = Self::default();
        let mut from = 0;
        while from < time_s.len() {
            // Beside times beyond 1e15 s a window has no length: each is a sample further all the same.
            let to = time_s.partition_point(|time| *time < time_s[from] + window_s).max(from + 1);
            let Some(length_s) = time_s.get(to).map(|end_s| end_s - time_s[from]) else { break };
            // A longer window spans a gap.
            let mean = mean(logged, time_s[from], time_s[to]).filter(|_| length_s < 2.0 * window_s);
            if let Some((mean, change)) = mean.zip(change(from, to)) {
                pairs.logged.push(mean);
                pairs.derived.push(change / length_s);
            }
            from = to;
        }
        pairs
    }

    /// The same pairs, the logged vector turned by `turn`.
    pub fn turned(&self, turn: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        Self { logged: self.logged.iter().map(turn).collect(), derived: self.derived.clone() }
    }

    /// Keeps the pairs whose logged vector `is_kept`.
    pub fn retain_logged(&mut self, is_kept: impl Fn(&Vector3<f64>) -> bool) {
        let kept: Vec<bool> = self.logged.iter().map(is_kept).collect();
        for vectors in [&mut self.logged, &mut self.derived] {
            let mut kept = kept.iter();
            vectors.retain(|_| kept.next().is_some_and(|is_kept| *is_kept));
        }
    }

    /// The horizontal parts.
    pub fn level(self) -> Self {
        let level =
            |vectors: Vec<Vector3<f64>>| vectors.into_iter().map(|v| Vector3::new(v.x, v.y, 0.0)).collect();
        Self { logged: level(self.logged), derived: level(self.derived) }
    }

    /// The same pairs, without the mean of each of the two vectors.
    pub fn without_means(self) -> Self {
        let centred = |vectors: Vec<Vector3<f64>>| {
            let mean = vectors.iter().sum::<Vector3<f64>>() / vectors.len().max(1) as f64;
            vectors.into_iter().map(|vector| vector - mean).collect()
        };
        Self { logged: centred(self.logged), derived: centred(self.derived) }
    }

    /// The root mean square of the logged vector.
    pub fn size_logged(&self) -> f64 {
        let squares = self.logged.iter().map(Vector3::norm_squared).sum::<f64>();
        (squares / self.logged.len().max(1) as f64).sqrt()
    }

    /// True if there are enough pairs to say something.
    pub fn is_enough(&self) -> bool {
        self.derived.len() >= PAIRS_MIN
    }

    /// The root mean square of the difference between the two.
    pub fn residual(&self) -> f64 {
        let squares = self.logged.iter().zip(&self.derived).map(|(a, b)| (a - b).norm_squared());
        (squares.sum::<f64>() / self.derived.len() as f64).sqrt()
    }

    /// Returns the agreement of the pairs; `None` if there are few, or the derived vector is mostly below `quiet`.
    pub fn agreement(&self, quiet: f64) -> Option<Agreement> {
        let dot =
            |a: &[Vector3<f64>], b: &[Vector3<f64>]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
        let logged = dot(&self.logged, &self.logged);
        let derived = dot(&self.derived, &self.derived);
        let both = dot(&self.logged, &self.derived);
        let count = self.derived.len() as f64;
        let says_something =
            self.derived.len() >= PAIRS_MIN && (derived / count).sqrt() > quiet && logged > 0.0;
        // The ratio of the sizes: a regression's slope would fall with every lateness between the channels.
        says_something.then(|| Agreement {
            slope: (logged / derived).sqrt().copysign(both),
            correlation: both / (logged * derived).sqrt(),
        })
    }

    /// The signs of the axes' correlations: 0 for an axis that shows none.
    pub fn signs(&self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let sum = |f: &dyn Fn(f64, f64) -> f64| {
                self.logged.iter().zip(&self.derived).map(|(a, b)| f(a[axis], b[axis])).sum::<f64>()
            };
            let (both, logged, derived) = (sum(&|a, b| a * b), sum(&|a, _| a * a), sum(&|_, b| b * b));
            let correlation = both / (logged * derived).sqrt();
            if correlation.abs() > 0.5 { correlation.signum() } else { 0.0 }
        })
    }
}

/// Agreement of a logged vector with a derived one.
#[derive(Debug, Clone, Copy)]
pub struct Agreement {
    /// Size of the logged over that of the derived vector, with the sign of their correlation.
    pub slope: f64,
    /// From -1 to 1.
    pub correlation: f64,
}

/// Change of the velocity from the middle of the first to that of the second half of a window, twice: as over the
/// whole window.
fn velocity_change(position: &Channel<3>, from: usize, to: usize) -> Option<Vector3<f64>> {
    let (time_s, p) = (&position.time_s, |index: usize| Vector3::from(position.values[index]));
    let velocity = |from: usize, to: usize| (p(to) - p(from)) / (time_s[to] - time_s[from]);
    let middle_s = (time_s[from] + time_s[to]) / 2.0;
    let middle = time_s.partition_point(|time| *time < middle_s);
    (from < middle && middle < to).then(|| 2.0 * (velocity(middle, to) - velocity(from, middle)))
}

/// The mean of the samples after `from_s` up to `to_s`.
fn mean(channel: &Channel<3>, from_s: f64, to_s: f64) -> Option<Vector3<f64>> {
    let index = |time_s: f64| channel.time_s.partition_point(|sample_s| *sample_s <= time_s);
    let samples = channel.values.get(index(from_s)..index(to_s)).filter(|samples| !samples.is_empty())?;
    let count = samples.len() as f64;
    Some(samples.iter().map(|sample| Vector3::from(*sample)).sum::<Vector3<f64>>() / count)
}
