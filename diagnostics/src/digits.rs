//! Numbers with the digits that people read.

/// Returns `value` with five significant digits, as short as it can be written; very small and very large ones have an exponent.
///
/// ```
/// use diagnostics::digits;
/// assert_eq!([digits(11772.0), digits(0.004_708_8), digits(1000.0 / 3.0)], ["11772", "0.0047088", "333.33"]);
/// assert_eq!([digits(0.000_009_999_999_999_999_593), digits(4.3e9)], ["1e-5", "4.3e9"]);
/// ```
#[must_use]
pub fn digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
    let is_plain = rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs());
    if is_plain || !rounded.is_finite() { rounded.to_string() } else { format!("{rounded:e}") }
}
