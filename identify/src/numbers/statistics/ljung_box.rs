//! One test of whiteness over many lags.

use super::correlation::autocorrelation;
use super::quantile::chi_square_tail;

/// Result of the test.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct LjungBox {
    /// Q, large where the samples are correlated.
    pub statistic: f64,
    /// Probability of a Q of this size or more for white noise.
    pub p_value: f64,
}

/// Tests whether `x` is white, by its correlations at the lags 1 to `lags`.
///
/// Q = n (n + 2) sum_k r_k^2 / (n - k), chi-square with `lags` degrees of freedom for white noise: Ljung and Box,
/// "On a measure of lack of fit in time series models", Biometrika 65 (1978). No degrees of freedom are taken off
/// for parameters that were fitted before.
///
/// ```
/// use identify::statistics::ljung_box;
///
/// let swings: Vec<f64> = (0..100).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
/// assert!(ljung_box(&swings, 5).p_value < 1e-6, "by no means white");
/// ```
#[must_use]
pub fn ljung_box(x: &[f64], lags: usize) -> LjungBox {
    let n = x.len() as f64;
    let correlation = autocorrelation(x, lags);
    let terms = correlation.iter().enumerate().skip(1).map(|(lag, r)| r * r / (n - lag as f64));
    let statistic = n * (n + 2.0) * terms.sum::<f64>();
    LjungBox { statistic, p_value: chi_square_tail(statistic, lags as f64) }
}
