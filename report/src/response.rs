//! Lag and gain of one sampled signal behind another.
//!
//! The lag is the shift at which the normalized cross-correlation (Pearson's coefficient of the samples that overlap)
//! is largest. The gain is the slope of the line of least squares through field over reference, shifted by that lag.
//! Offsets of either signal change neither. After Ljung, System Identification, 2nd ed. 1999, section 6.1
//! (correlation analysis).

use std::fmt;
use std::ops::Range;

/// Below this correlation the reference explains less than a quarter of the field's variance: that is no response.
/// Own choice.
const LEAST_CORRELATION: f64 = 0.5;

/// Lag and gain of a field behind a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Response {
    /// Samples that the field is behind the reference; negative where it is ahead.
    pub lag_samples: isize,
    /// Slope of the line of least squares of the field over the reference.
    pub gain: f64,
}

/// Reason why there is no lag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoResponse {
    /// Fewer samples than the reach needs: at the greatest shift half of them must overlap.
    TooShort,
    /// The field does not change, or is not finite somewhere.
    ConstantField,
    /// The reference does not change, or is not finite somewhere.
    ConstantReference,
    /// The correlation still rises at the end of the reach.
    AtTheEnd,
    /// They are alike at no shift: [`LEAST_CORRELATION`].
    Unlike,
}

impl Response {
    /// Of `field` to `reference`, sampled at the same times, looked for up to `reach` samples either way.
    pub(crate) fn of(field: &[f64], reference: &[f64], reach: usize) -> Result<Self, NoResponse> {
        if field.len() / 2 < reach.max(1) {
            return Err(NoResponse::TooShort);
        }
        let field = Sums::of(field).ok_or(NoResponse::ConstantField)?;
        let reference = Sums::of(reference).ok_or(NoResponse::ConstantReference)?;
        let reach = reach.cast_signed();
        let mut best = (f64::NEG_INFINITY, Self { lag_samples: 0, gain: 0.0 });
        for lag_samples in -reach..=reach {
            let (correlation, gain) = field.at(&reference, lag_samples);
            if correlation > best.0 {
                best = (correlation, Self { lag_samples, gain });
            }
        }
        match best {
            (correlation, _) if correlation < LEAST_CORRELATION => Err(NoResponse::Unlike),
            (_, response) if response.lag_samples.abs() == reach => Err(NoResponse::AtTheEnd),
            (_, response) => Ok(response),
        }
    }
}

/// A signal about its mean, with the sums of all its beginnings, of values and of squares.
struct Sums {
    value: Vec<f64>,
    sum: Vec<f64>,
    squares: Vec<f64>,
}

impl Sums {
    /// `None` if the signal does not change, or is not finite somewhere.
    fn of(signal: &[f64]) -> Option<Self> {
        let mean = signal.iter().sum::<f64>() / signal.len() as f64;
        if !mean.is_finite() || signal.iter().all(|value| *value == signal[0]) {
            return None;
        }
        let value: Vec<f64> = signal.iter().map(|value| value - mean).collect();
        let running = |power: fn(f64) -> f64| {
            let sums = value.iter().scan(0.0, |sum, value| {
                *sum += power(*value);
                Some(*sum)
            });
            std::iter::once(0.0).chain(sums).collect()
        };
        let (sum, squares) = (running(|value| value), running(|value| value * value));
        Some(Self { value, sum, squares })
    }

    /// Sum and sum of squares over `range`.
    fn over(&self, range: &Range<usize>) -> (f64, f64) {
        (self.sum[range.end] - self.sum[range.start], self.squares[range.end] - self.squares[range.start])
    }

    /// Correlation with `reference`, and slope over it, where this one is taken `lag` samples later.
    fn at(&self, reference: &Self, lag: isize) -> (f64, f64) {
        let count = self.value.len() - lag.unsigned_abs();
        let (late, early) = (lag.max(0).unsigned_abs(), lag.min(0).unsigned_abs());
        let (here, there) = (late..late + count, early..early + count);
        let (sum, squares) = self.over(&here);
        let (reference_sum, reference_squares) = reference.over(&there);
        let product = dot(&self.value[here], &reference.value[there]) - sum * reference_sum / count as f64;
        let spread = squares - sum * sum / count as f64;
        let reference_spread = reference_squares - reference_sum * reference_sum / count as f64;
        if spread <= 0.0 || reference_spread <= 0.0 {
            return (f64::NEG_INFINITY, 0.0);
        }
        (product / (spread * reference_spread).sqrt(), product / reference_spread)
    }
}

/// The scalar product in four sums, added up in a fixed order: a single sum would wait for itself at every sample.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a_fours, b_fours) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a_fours.remainder().iter().zip(b_fours.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_fours.zip(b_fours) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + rest
}

impl fmt::Display for NoResponse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooShort => {
                "the span is shorter than twice `within_s` of the reference: lengthen it, or look less far"
            }
            Self::ConstantField => "the field is constant or no number, so nothing tells how late it is",
            Self::ConstantReference => {
                "the reference is constant or no number, so nothing tells how late the field is"
            }
            Self::AtTheEnd => {
                "the two are most alike at the end of what `within_s` of the reference looks at: look further"
            }
            Self::Unlike => {
                "their correlation is below 0.5 at every lag within `within_s`: they are not alike"
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{NoResponse, Response};

    /// White noise from -1 to 1: a linear congruential generator (Knuth's MMIX).
    fn noise(seed: u64, count: usize) -> Vec<f64> {
        let mut word = seed;
        let mut next = || {
            word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (word >> 11) as f64 / 2.0_f64.powi(52) - 1.0
        };
        (0..count + 20).map(|_| next()).skip(20).collect()
    }

    /// A signal as of a hand: noise behind two lags.
    fn smooth(seed: u64, count: usize) -> Vec<f64> {
        let (mut first, mut second) = (0.0, 0.0);
        let lagged = noise(seed, count).into_iter().map(|value| {
            first += 0.05 * (value - first);
            second += 0.05 * (first - second);
            second
        });
        lagged.collect()
    }

    /// `signal`, `lag` samples later, times `gain`, with an offset, noise of `noise_part` of its greatest value.
    fn follower(signal: &[f64], lag: isize, gain: f64, noise_part: f64, seed: u64) -> Vec<f64> {
        let last = signal.len().cast_signed() - 1;
        let most = signal.iter().fold(0.0, |most, value| f64::max(most, value.abs()));
        let shifted = noise(seed, signal.len()).into_iter().zip(0_isize..).map(|(noise, index)| {
            let source = (index - lag).clamp(0, last).unsigned_abs();
            3.0 + gain * (signal[source] + noise_part * most * noise)
        });
        shifted.collect()
    }

    #[test]
    fn a_known_shift_and_gain_are_found_behind_and_ahead() {
        let reference = smooth(1, 4000);
        for (lag, gain) in [(0, 1.0), (1, 0.2), (150, 0.45), (-87, 2.0), (-399, 1.0), (399, 1.0)] {
            let found = Response::of(&follower(&reference, lag, gain, 0.0, 9), &reference, 400).unwrap();
            assert_eq!(found.lag_samples, lag);
            // Samples that were clamped at either end are left out by the shift.
            assert!((found.gain / gain - 1.0).abs() < 1e-9, "lag {lag}: {found:?}");
        }
    }

    #[test]
    fn noise_of_a_fifth_of_the_signal_moves_the_lag_by_few_samples_whatever_the_seed() {
        for seed in 1..=20 {
            let reference = smooth(seed, 4000);
            for lag in [150, -90] {
                let field = follower(&reference, lag, 0.5, 0.2, 100 + seed);
                let found = Response::of(&field, &reference, 400).unwrap();
                assert!((found.lag_samples - lag).abs() <= 4, "seed {seed}, lag {lag}: {found:?}");
                assert!((found.gain / 0.5 - 1.0).abs() < 0.05, "seed {seed}, lag {lag}: {found:?}");
            }
        }
    }

    #[test]
    fn what_tells_no_lag_says_why() {
        let (signal, still) = (smooth(1, 1000), vec![0.5; 1000]);
        let holed = [&signal[..999], &[f64::NAN]].concat();
        let mirrored: Vec<f64> = (0..1000).map(|index| -f64::from(index)).collect();
        let rising: Vec<f64> = mirrored.iter().map(|value| -value).collect();
        let cases = [
            (&still, &signal, NoResponse::ConstantField),
            (&signal, &still, NoResponse::ConstantReference),
            (&holed, &signal, NoResponse::ConstantField),
            (&follower(&signal, 210, 1.0, 0.0, 1), &signal, NoResponse::AtTheEnd),
            (&mirrored, &rising, NoResponse::Unlike),
            (&noise(1, 1000), &noise(2, 1000), NoResponse::Unlike),
        ];
        for (field, reference, expected) in cases {
            assert_eq!(Response::of(field, reference, 200), Err(expected));
        }
        assert_eq!(Response::of(&signal[..300], &signal[..300], 200), Err(NoResponse::TooShort));
    }
}
