//! The error for a sensor parameter outside its range, and the checks that raise it.

/// A parameter whose value no sensor can have.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("parameter `{key}` must be {expected}, found {}", .found.map_or("nothing".to_owned(), |value| value.to_string()))]
pub struct ParameterError {
    /// The key as it is written in the manifest.
    pub key: &'static str,
    /// The values that are allowed.
    pub expected: &'static str,
    /// The value that was given; none where it is missing.
    pub found: Option<f64>,
}

/// Passes `value` if it is finite and not negative.
pub(crate) fn not_negative(key: &'static str, value: f64) -> Result<(), ParameterError> {
    check(key, value, value.is_finite() && value >= 0.0, "a finite number, zero or more")
}

/// Passes `value` if it is finite and greater than zero.
pub(crate) fn positive(key: &'static str, value: f64) -> Result<(), ParameterError> {
    check(key, value, value.is_finite() && value > 0.0, "a finite number greater than zero")
}

/// Passes `value` if it is finite.
pub(crate) fn finite(key: &'static str, value: f64) -> Result<(), ParameterError> {
    check(key, value, value.is_finite(), "a finite number")
}

/// Passes `values` if all are finite.
pub(crate) fn all_finite(key: &'static str, values: &[f64]) -> Result<(), ParameterError> {
    values.iter().try_for_each(|value| finite(key, *value))
}

/// Passes `values` if all are finite and none is negative.
pub(crate) fn all_not_negative(key: &'static str, values: &[f64]) -> Result<(), ParameterError> {
    values.iter().try_for_each(|value| not_negative(key, *value))
}

/// Passes `found` if it is `good`.
pub(crate) fn check(
    key: &'static str,
    found: f64,
    good: bool,
    expected: &'static str,
) -> Result<(), ParameterError> {
    if good { Ok(()) } else { Err(ParameterError { key, expected, found: Some(found) }) }
}
