//! A measured signal beside the one that follows from other channels.

use crate::numbers::statistics::mean;

/// Averaging time of the signals: removes the noise of derivatives and keeps the motion of a vehicle.
const SMOOTH_S: f64 = 0.2;
/// Largest delay between two channels.
const LATE_S: f64 = 0.2;
/// Least correlation of signals that are compared.
const ALIKE: f64 = 0.7;
/// Least excess of the correlation with the opposite over that with the expected signal, at any delay, of a mirrored axis.
const SURELY: f64 = 0.05;
/// Correlation, at any delay, below which signals have nothing to do with each other.
const UNRELATED: f64 = 0.4;
/// Least number of values.
const LEAST: usize = 40;

/// True for a factor nearer to one half or to two than to one, which no tolerance of a sensor, battery or payload explains.
pub fn is_off_scale(factor: f64) -> bool {
    !(std::f64::consts::FRAC_1_SQRT_2..=std::f64::consts::SQRT_2).contains(&factor)
}

/// A measured and an expected signal, value by value.
#[derive(Debug, Default)]
pub struct Twin {
    measured: Vec<f64>,
    expected: Vec<f64>,
    late_max: usize,
}

impl Twin {
    /// Signals with values `step_s` apart, without their means.
    pub fn of(measured: &[f64], expected: &[f64], step_s: f64) -> Self {
        let reach = (0.5 * SMOOTH_S / step_s).round() as usize;
        let of = |values: &[f64]| centred(smoothed(values, reach));
        Self { measured: of(measured), expected: of(expected), late_max: (LATE_S / step_s).ceil() as usize }
    }

    /// Correlation of the measured signal with the expected one that is `late` values later.
    fn correlation(&self, late: isize) -> f64 {
        let (skip_a, skip_b) = (late.max(0).unsigned_abs(), late.min(0).unsigned_abs());
        let pairs = || self.measured.iter().skip(skip_a).zip(self.expected.iter().skip(skip_b));
        let sum = |of: &dyn Fn(f64, f64) -> f64| pairs().map(|(a, b)| of(*a, *b)).sum::<f64>();
        let sizes = sum(&|a, _| a * a) * sum(&|_, b| b * b);
        if sizes > 0.0 { sum(&|a, b| a * b) / sizes.sqrt() } else { 0.0 }
    }

    /// Least and greatest correlation at any delay.
    fn extremes(&self) -> (f64, f64) {
        if self.measured.len() < LEAST + self.late_max {
            return (0.0, 0.0);
        }
        let reach = self.late_max.cast_signed();
        let all = (-reach..=reach).map(|late| self.correlation(late));
        all.fold((0.0, 0.0), |(low, high), one| (f64::min(low, one), f64::max(high, one)))
    }

    /// Correlation with the opposite of the expected signal, if the measured one follows that.
    pub fn mirrored(&self) -> Option<f64> {
        let (low, high) = self.extremes();
        (low < -ALIKE && -low > high + SURELY).then_some(low)
    }

    /// True if the measured signal follows the expected one.
    pub fn follows(&self) -> bool {
        let (low, high) = self.extremes();
        high > ALIKE && high > SURELY - low
    }

    /// True if both signals are larger than `least` (root mean square).
    pub fn moves(&self, least: f64) -> bool {
        let is_larger = |values: &[f64]| power(values) > least * least * values.len() as f64;
        self.measured.len() >= LEAST + self.late_max && is_larger(&self.measured) && is_larger(&self.expected)
    }

    /// Largest correlation, of either sign and at any delay, if the two signals have nothing to do with each other.
    pub fn unrelated(&self) -> Option<f64> {
        let (low, high) = self.extremes();
        let largest = high.max(-low);
        // Too few values have a correlation of zero.
        (largest > 0.0 && largest < UNRELATED).then_some(largest)
    }

    /// Ratio of the sizes of measured and expected signal, if one follows the other.
    pub fn scale(&self) -> Option<f64> {
        self.follows().then(|| (power(&self.measured) / power(&self.expected)).sqrt())
    }
}

fn power(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

fn smoothed(values: &[f64], reach: usize) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    (0..values.len()).map(|at| mean(&values[at.saturating_sub(reach)..=(at + reach).min(last)])).collect()
}

fn centred(mut values: Vec<f64>) -> Vec<f64> {
    let middle = mean(&values);
    values.iter_mut().for_each(|value| *value -= middle);
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.02;

    fn course(phase: f64) -> Vec<f64> {
        (0..400)
            .map(|k| f64::from(k) * STEP_S)
            .map(|t| libm::sin(4.0 * (t - phase)) + 0.5 * libm::sin(7.3 * (t - phase)))
            .collect()
    }

    #[test]
    fn an_axis_is_mirrored_and_one_that_is_late_is_not() {
        let opposite: Vec<f64> = course(0.02).iter().map(|value| -value).collect();
        assert!(Twin::of(&opposite, &course(0.0), STEP_S).mirrored().is_some());
        // Late by half of a period: the opposite at first sight.
        let late = Twin::of(&course(0.18), &course(0.0), STEP_S);
        assert!(late.mirrored().is_none() && late.follows());
    }

    #[test]
    fn a_signal_of_other_frequencies_is_unrelated_and_a_late_one_is_not() {
        let other: Vec<f64> = (0..400).map(|k| libm::cos(11.0 * f64::from(k) * STEP_S)).collect();
        let twin = Twin::of(&other, &course(0.0), STEP_S);
        assert!(twin.moves(0.1) && !twin.moves(2.0) && twin.unrelated().is_some());
        assert!(Twin::of(&course(0.1), &course(0.0), STEP_S).unrelated().is_none());
        assert!(!Twin::of(&other[..20], &course(0.0)[..20], STEP_S).moves(0.1), "a few values say nothing");
    }

    #[test]
    fn half_of_the_expected_is_off_scale() {
        let half: Vec<f64> = course(0.0).iter().map(|value| 0.5 * value).collect();
        let scale = Twin::of(&half, &course(0.0), STEP_S).scale().unwrap();
        assert!((scale - 0.5).abs() < 1e-12 && is_off_scale(scale) && !is_off_scale(0.8));
        assert!(Twin::of(&half[..20], &course(0.0)[..20], STEP_S).scale().is_none());
    }
}
