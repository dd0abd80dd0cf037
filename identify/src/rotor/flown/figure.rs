//! A figure from flights: an estimate with its interval, or the reason why the flights do not determine it.

use serde::Serialize;

use crate::numbers::digits::{quantity, rounded};
use crate::numbers::statistics::Estimate;

/// A figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// Unit.
    pub unit: &'static str,
    /// Estimate with its 95 % interval.
    pub estimate: Option<Estimate>,
    /// Reason why the flights do not determine it; then an estimate is no more than the one at which the fit ended.
    pub not_determined: Option<String>,
}

impl Figure {
    /// A figure that can be anywhere in `range` before the flights are seen.
    pub fn within(unit: &'static str, estimate: Estimate, range: (f64, f64)) -> Self {
        let is_known = estimate.sigma.is_finite() && estimate.value.is_finite();
        let is_whole = estimate.low <= range.0 && estimate.high >= range.1;
        let (least, most) = (rounded(range.0), quantity(range.1, unit));
        let reason = (!is_known || is_whole)
            .then(|| format!("the interval is the whole range from {least} to {most}"));
        Self { unit, estimate: is_known.then_some(estimate), not_determined: reason }
    }

    /// A figure that no flight has the channels for.
    pub fn missing(unit: &'static str, reason: impl Into<String>) -> Self {
        Self { unit, estimate: None, not_determined: Some(reason.into()) }
    }

    /// The figure, not determined for `reason`; an earlier reason stays.
    pub fn doubted(mut self, reason: Option<String>) -> Self {
        self.not_determined = self.not_determined.or(reason);
        self
    }

    /// The estimate, if the flights determine it.
    #[must_use]
    pub fn determined(&self) -> Option<&Estimate> {
        self.estimate.as_ref().filter(|_| self.not_determined.is_none())
    }
}

/// Errors on one held-out flight, as root mean squares.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldOut {
    /// The flight.
    pub flight: String,
    /// The quantity that is predicted.
    pub quantity: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Error with the declared vehicle file.
    pub declared: f64,
    /// Error with the values that were fitted.
    pub fitted: f64,
}

/// Root of the mean square; NaN of nothing.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}
