//! Helpers that the tests of sensors share.

use crate::sensing::{Sensing, Sensor};
use component::Harness;
use component::context::NodeContext;

/// A tick of 1 ms.
pub(crate) const TICK_NS: u64 = 1_000_000;

/// A sensor whose node computes every `interval_ms`.
pub(crate) fn harness<S: Sensor>(parameters: S::Parameters, interval_ms: u64) -> Harness<Sensing<S>> {
    let context = NodeContext::new(S::INFO.name, &[]).timed(interval_ms * TICK_NS, 1, 1_000_000).seeded(5);
    Harness::in_context(parameters, &context).unwrap()
}

/// Returns the error with which a sensor refuses parameters.
pub(crate) fn refusal<S: Sensor>(parameters: &serde_json::Value) -> String {
    Harness::<Sensing<S>>::from_json(parameters).err().expect("it is refused").to_string()
}

/// Requires that mean and variance of `values` are within six of their standard deviations of those of a normal
/// distribution: passed by luck once in 10⁹ seeds.
#[track_caller]
pub(crate) fn require_normal(values: impl Iterator<Item = f64>, mean: f64, sigma: f64) {
    let errors = values.map(|value| (value - mean) / sigma);
    let (count, sum, squares) =
        errors.fold((0.0, 0.0, 0.0), |(n, sum, squares), e| (n + 1.0, sum + e, squares + e * e));
    let (offset, variance): (f64, f64) = (sum / count, squares / count);
    assert!(offset.abs() < 6.0 / count.sqrt(), "the mean is {offset} standard deviations off");
    assert!(
        (variance - 1.0).abs() < 6.0 * (2.0 / count).sqrt(),
        "the variance is {variance} of the expected"
    );
}
