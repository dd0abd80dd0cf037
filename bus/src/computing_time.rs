//! Computing time of a node's steps on the processor that it stands for: a time drawn for each tick.

use crate::random::{Stream, normal, uniform};
use serde::{Deserialize, Serialize};

/// Ticks that a step takes at most: with any period the tick behind it can be counted.
const TICKS_MAX: u32 = 1 << 30;

/// The distribution of a step's computing time.
///
/// ```
/// use bus::computing_time::ComputingTime;
/// let mut random = bus::random::stream(1, "controller");
/// assert_eq!(ComputingTime::Constant { us: 1500.0 }.ticks(&mut random, 1_000_000), 2);
/// let measured = ComputingTime::Measured { fraction_us: vec![[0.0, 100.0], [0.5, 200.0], [1.0, 1900.0]] };
/// assert!((1..=2).contains(&measured.ticks(&mut random, 1_000_000)));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ComputingTime {
    /// Always the same.
    Constant {
        /// The time, µs.
        us: f64,
    },
    /// Anything between two times, evenly.
    Uniform {
        /// The shortest, µs.
        min_us: f64,
        /// The longest, µs.
        max_us: f64,
    },
    /// A time whose logarithm is normally distributed.
    Lognormal {
        /// The median, µs.
        median_us: f64,
        /// Standard deviation of the natural logarithm.
        sigma: f64,
    },
    /// A measured distribution: a fraction of the steps took at most so long; between the points on straight lines.
    Measured {
        /// Fraction and time in µs, both ascending, from fraction 0 to fraction 1.
        fraction_us: Vec<[f64; 2]>,
    },
}

impl ComputingTime {
    /// A time, µs.
    pub fn draw_us(&self, random: &mut Stream) -> f64 {
        match self {
            Self::Constant { us } => *us,
            Self::Uniform { min_us, max_us } => min_us + (max_us - min_us) * uniform(random),
            Self::Lognormal { median_us, sigma } => median_us * libm::exp(sigma * normal(random)),
            Self::Measured { fraction_us } => at_fraction(fraction_us, uniform(random)),
        }
    }

    /// A time in ticks of `tick_ns`, rounded up: the results of a step within a tick are there at its end.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "limited before, and never negative"
    )]
    pub fn ticks(&self, random: &mut Stream, tick_ns: u64) -> u32 {
        let ticks = self.draw_us(random) * 1e3 / tick_ns as f64;
        // A time of whole ticks that rounding made longer is not the next one.
        (ticks - 1e-9).ceil().clamp(0.0, f64::from(TICKS_MAX)) as u32
    }
}

/// The time of which `fraction` of all are shorter.
fn at_fraction(points: &[[f64; 2]], fraction: f64) -> f64 {
    let behind = points.partition_point(|[of, _]| *of <= fraction);
    match (points.get(behind.wrapping_sub(1)), points.get(behind)) {
        (Some([from, shorter]), Some([to, longer])) => {
            shorter + (longer - shorter) * (fraction - from) / (to - from)
        }
        (Some([_, us]), None) | (None, Some([_, us])) => *us,
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::{ComputingTime, TICKS_MAX, at_fraction};
    use crate::random::stream;

    /// Draws of `time`, sorted.
    fn drawn_us(time: &ComputingTime) -> Vec<f64> {
        let mut random = stream(3, "test");
        let mut all: Vec<f64> = (0..20_000).map(|_| time.draw_us(&mut random)).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    #[test]
    fn draws_have_the_quantiles_of_their_distribution() {
        // Standard deviations of a quantile of 20 000 draws are below 1.5 % of it here.
        let near =
            |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 0.06, "{found} {expected}");
        let lognormal = drawn_us(&ComputingTime::Lognormal { median_us: 400.0, sigma: 0.5 });
        near(lognormal[10_000], 400.0);
        near(lognormal[19_544], 400.0 * libm::exp(1.0)); // two standard deviations: 97.72 %
        let uniform = drawn_us(&ComputingTime::Uniform { min_us: 100.0, max_us: 300.0 });
        near(uniform[5000], 150.0);
        assert!(uniform[0] >= 100.0 && uniform[19_999] < 300.0);
        let points = vec![[0.0, 10.0], [0.9, 20.0], [1.0, 1000.0]];
        let measured = drawn_us(&ComputingTime::Measured { fraction_us: points });
        near(measured[18_000], 20.0);
        near(measured[19_000], 510.0);
    }

    #[test]
    fn times_become_ticks_rounded_up() {
        let ticks = |us| ComputingTime::Constant { us }.ticks(&mut stream(1, "test"), 1_000_000);
        assert_eq!([0.0, 1.0, 1000.0, 1001.0, 5000.0].map(ticks), [0, 1, 1, 2, 5]);
        assert_eq!(ticks(1e300), TICKS_MAX);
    }

    #[test]
    fn a_fraction_beyond_the_points_has_the_last_time() {
        assert_eq!(at_fraction(&[[0.0, 7.0]], 0.5), 7.0);
        assert_eq!(at_fraction(&[[0.5, 7.0], [1.0, 9.0]], 0.2), 7.0);
        assert_eq!(at_fraction(&[], 0.2), 0.0);
    }
}
