//! White noise from its continuous-time density, and a bias that walks at random.
//!
//! The model is that of IEEE Std 952 as the Kalibr toolbox writes it ("IMU Noise Model"): reading =
//! truth + bias + white noise, and the bias is the integral of a second white noise. A density holds
//! at any rate; the size of one sample follows from the density and the time between samples.

use component::random::{self, Stream, normal};
use nalgebra::Vector3;

/// White noise on each of three axes, independent between axes and between samples.
///
/// ```
/// use sensors::noise::WhiteNoise;
///
/// let mut random = component::random::stream(1, "imu");
/// let (quiet, noisy) = (WhiteNoise::new(0.0, 1000.0), WhiteNoise::new(2e-3, 1000.0));
/// assert!(quiet.sample(&mut random).norm() == 0.0 && noisy.sample(&mut random).norm() > 0.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WhiteNoise {
    sigma: f64,
}

impl WhiteNoise {
    /// Noise of `density` (unit/√Hz) sampled `rate_hz` times a second.
    ///
    /// The standard deviation of a sample is density·√rate: an ideal low pass at half the sample rate
    /// on a two-sided spectrum of height density².
    #[must_use]
    pub fn new(density: f64, rate_hz: f64) -> Self {
        Self { sigma: density * rate_hz.sqrt() }
    }

    /// Variance of a sample on each axis.
    pub(crate) fn variance(&self) -> f64 {
        self.sigma * self.sigma
    }

    /// The next sample of the three axes, drawn in the order x, y, z.
    pub fn sample(&self, random: &mut Stream) -> Vector3<f64> {
        self.sigma * standard_normal(random)
    }
}

/// The steps of a bias on three axes that walks at random.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BiasWalk {
    step_sigma: f64,
}

impl BiasWalk {
    /// A walk of `density` (unit/s/√Hz, which is unit/√s) in steps of 1/`rate_hz`.
    ///
    /// The standard deviation of a step is density·√dt, so the variance grows by density² a second
    /// at any rate.
    #[must_use]
    pub fn new(density: f64, rate_hz: f64) -> Self {
        Self { step_sigma: density / rate_hz.sqrt() }
    }

    /// The standard deviation of one step, in the unit of the signal.
    pub(crate) fn step_sigma(&self) -> f64 {
        self.step_sigma
    }

    /// The bias one step after `bias`, drawn in the order x, y, z.
    pub fn step(&self, bias: Vector3<f64>, random: &mut Stream) -> Vector3<f64> {
        bias + self.step_sigma * standard_normal(random)
    }
}

/// Three independent draws from the normal distribution of zero mean and unit variance.
pub(crate) fn standard_normal(random: &mut Stream) -> Vector3<f64> {
    // Bound one by one so that the order of drawing is in the source, not left to the constructor.
    let x = normal(random);
    let y = normal(random);
    let z = normal(random);
    Vector3::new(x, y, z)
}

/// Returns the number of words of 32 bits drawn from a random stream: the low and the high half of the count.
pub(crate) fn drawn_words(random: &Stream) -> [u64; 2] {
    let words = random.get_word_pos();
    [words as u64, (words >> 64) as u64]
}

/// A copy of a node's random stream that continues where it was drawn so far.
pub(crate) fn drawn(random: &Stream, [low, high]: [u64; 2]) -> Stream {
    random::at(random, u128::from(high) << 64 | u128::from(low))
}

/// A node's random stream, taken up where it was drawn so far once something is drawn: that costs as much as dozens of
/// draws, and many a measurement needs none.
#[derive(Debug)]
pub(crate) struct LazyStream<'a> {
    start: &'a Stream,
    words: [u64; 2],
    stream: Option<Stream>,
}

impl<'a> LazyStream<'a> {
    /// The stream that begins as `start`, `words` behind its start.
    pub fn new(start: &'a Stream, words: [u64; 2]) -> Self {
        Self { start, words, stream: None }
    }

    /// The stream.
    pub fn get(&mut self) -> &mut Stream {
        self.stream.get_or_insert_with(|| drawn(self.start, self.words))
    }

    /// Returns the number of words drawn so far.
    pub fn words(&self) -> [u64; 2] {
        self.stream.as_ref().map_or(self.words, drawn_words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::random::stream;

    const SAMPLES: usize = 40_000;

    /// Bounds of the mean of n squares of a unit normal: the chi-square's standard deviation is √(2/n)
    /// of its mean, and six of them are passed by luck once in 10⁹ seeds.
    #[track_caller]
    fn assert_variance(sum_of_squares: f64, count: usize, expected: f64) {
        let ratio = sum_of_squares / count as f64 / expected;
        let bound = 6.0 * (2.0 / count as f64).sqrt();
        assert!((ratio - 1.0).abs() < bound, "variance is {ratio} of the expected one, bound ±{bound}");
    }

    #[test]
    fn the_sample_variance_is_density_squared_times_rate() {
        let (density, rate_hz) = (2.0e-3, 1000.0);
        let noise = WhiteNoise::new(density, rate_hz);
        let mut random = stream(1, "imu");
        let sum: f64 = (0..SAMPLES).map(|_| noise.sample(&mut random).norm_squared()).sum();
        assert_variance(sum, 3 * SAMPLES, density * density * rate_hz);
    }

    #[test]
    fn a_slower_mean_has_the_same_density() {
        // The mean over 1 s of noise of density d has variance d², at any sample rate.
        let density = 0.3;
        for rate in [10_usize, 400] {
            let noise = WhiteNoise::new(density, rate as f64);
            let mut random = stream(2, "imu");
            let mean = |random: &mut Stream| {
                (0..rate).map(|_| noise.sample(random)).sum::<Vector3<f64>>() / rate as f64
            };
            let count = 400;
            let sum: f64 = (0..count).map(|_| mean(&mut random).norm_squared()).sum();
            assert_variance(sum, 3 * count, density * density);
        }
    }

    #[test]
    fn the_walk_gains_the_variance_of_its_density_each_second() {
        let density = 3.0e-3;
        for rate in [10_usize, 400] {
            let walk = BiasWalk::new(density, rate as f64);
            let mut random = stream(3, "imu");
            let mut bias = Vector3::zeros();
            let mut sum = 0.0;
            let seconds = 400;
            for _ in 0..seconds {
                let before = bias;
                (0..rate).for_each(|_| bias = walk.step(bias, &mut random));
                sum += (bias - before).norm_squared();
            }
            assert_variance(sum, 3 * seconds, density * density);
        }
    }

    #[test]
    fn zero_density_adds_exactly_nothing() {
        let mut random = stream(4, "imu");
        assert_eq!(WhiteNoise::new(0.0, 1000.0).sample(&mut random), Vector3::zeros());
        let bias = Vector3::new(0.1, -0.2, 0.3);
        assert_eq!(BiasWalk::new(0.0, 1000.0).step(bias, &mut random), bias);
    }
}
