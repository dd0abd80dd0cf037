//! The interval of any estimate, by leaving out one block after the other.

use super::quantile::{normal_quantile, student_quantile};

/// An estimate with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// The estimate from all blocks.
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Estimate {
    /// The estimate with a further error that no block shows. It has the standard deviation `sigma` and is
    /// independent of the errors in the interval of `level`: half widths add as squares do.
    pub(crate) fn with_error(self, sigma: f64, level: f64) -> Self {
        let more = sigma * normal_quantile(0.5 + 0.5 * level);
        let wider = |width: f64| (width * width + more * more).sqrt();
        if sigma > 0.0 {
            let Self { value, low, high, .. } = self;
            let sigma = (self.sigma * self.sigma + sigma * sigma).sqrt();
            Self { value, sigma, low: value - wider(value - low), high: value + wider(high - value) }
        } else {
            self
        }
    }
}

/// The interval of `value` from the estimates that each leave out one of G blocks.
///
/// sigma^2 = (G - 1) / G sum_g (value_g - value)^2, the interval by Student's t with G - 1 degrees of freedom: the
/// delete-a-block jackknife (Künsch 1989). Samples within a block may be correlated as they like; for least
/// squares it is the cluster-robust covariance CV3. Among its kind, CV3 stays honest with few blocks of
/// unequal weight (MacKinnon, Nielsen and Webb, "Cluster-robust inference: a guide to empirical practice", J.
/// Econometrics 2023). Infinite with fewer than two blocks.
///
/// ```
/// use identify::statistics::jackknife;
///
/// // The mean of 1, 2 and 6, and those without one of them.
/// let mean = jackknife(3.0, &[4.0, 3.5, 1.5], 0.95);
/// assert!((mean.sigma - (7.0_f64 / 3.0).sqrt()).abs() < 1e-12);
/// assert!(mean.low < 0.0 && mean.high > 6.0);
/// ```
#[must_use]
pub fn jackknife(value: f64, without_one: &[f64], level: f64) -> Estimate {
    let blocks = without_one.len() as f64;
    if without_one.len() < 2 {
        return Estimate { value, sigma: f64::INFINITY, low: f64::NEG_INFINITY, high: f64::INFINITY };
    }
    let squares: f64 = without_one.iter().map(|other| (other - value).powi(2)).sum();
    let sigma = ((blocks - 1.0) / blocks * squares).sqrt();
    let half_width = sigma * student_quantile(0.5 + 0.5 * level, blocks - 1.0);
    Estimate { value, sigma, low: value - half_width, high: value + half_width }
}
