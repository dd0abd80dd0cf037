//! Auto- and cross-correlation, and the bound that white noise keeps.

use super::quantile::normal_quantile;

/// Correlation of `x` with itself `k` samples later, for every lag `k` from 0 to `max_lag`.
///
/// r_k = sum_t (x_t - m)(x_{t+k} - m) / sum_t (x_t - m)^2: the biased estimate of Box, Jenkins, Reinsel and Ljung,
/// "Time Series Analysis" (2015), eq. 2.1.11, as statsmodels' `acf(adjusted=False)`. Lags past the end give 0, a
/// constant `x` gives NaN.
///
/// ```
/// use identify::statistics::autocorrelation;
///
/// assert_eq!(autocorrelation(&[1.0, -1.0, 1.0, -1.0], 2), [1.0, -0.75, 0.5]);
/// ```
#[must_use]
pub fn autocorrelation(x: &[f64], max_lag: usize) -> Vec<f64> {
    cross_correlation(x, x, max_lag)
}

/// Correlation of `x` with `y` of `k` samples before, for every lag `k` from 0 to `max_lag`: large where `y` leads.
/// For lags below 0 swap the two.
///
/// r_k = sum_t (x_{t+k} - mx)(y_t - my) / (n sx sy), with deviations over n: the biased estimate of Box et al.
/// (2015), section 12.1, as statsmodels' `ccf(adjusted=False)`.
///
/// # Panics
///
/// If the two differ in length.
#[must_use]
pub fn cross_correlation(x: &[f64], y: &[f64], max_lag: usize) -> Vec<f64> {
    assert_eq!(x.len(), y.len(), "the two series need the same samples");
    let (x, y) = (centred(x), centred(y));
    let scale = (product(&x, &x) * product(&y, &y)).sqrt();
    (0..=max_lag).map(|lag| product(x.get(lag..).unwrap_or_default(), &y) / scale).collect()
}

/// Returns the bound that the correlations of `n` samples of white noise keep at a share of `level` of all lags:
/// z / sqrt(n) (Bartlett 1946). 1.96 / sqrt(n) at 0.95; MATLAB's `resid` draws the bound of 0.99.
#[must_use]
pub fn white_noise_bound(n: usize, level: f64) -> f64 {
    normal_quantile(0.5 + 0.5 * level) / (n as f64).sqrt()
}

fn centred(x: &[f64]) -> Vec<f64> {
    let mean = mean(x);
    x.iter().map(|value| value - mean).collect()
}

/// The sum of products as far as both have samples.
fn product(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// The standard deviation over all of them; NaN of nothing.
pub(crate) fn deviation(values: &[f64]) -> f64 {
    let centred = centred(values);
    (product(&centred, &centred) / values.len() as f64).sqrt()
}

/// The mean; NaN of nothing.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
