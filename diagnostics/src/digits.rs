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

/// Returns `value` with nine digits behind the point at most, as short as it can be written: of a time in s these are whole
/// nanoseconds, and the time of a tick has no more.
///
/// ```
/// use diagnostics::nine_decimals;
/// assert_eq!([nine_decimals(3.0 * 0.1), nine_decimals(8.0), nine_decimals(36_000.7)], ["0.3", "8", "36000.7"]);
/// assert_eq!([nine_decimals(2e-9), nine_decimals(-0.1 - 0.2)], ["0.000000002", "-0.3"]);
/// assert_eq!(nine_decimals(1.7e9 + 0.25), "1700000000.25", "of larger numbers all digits are shown");
/// assert_eq!(nine_decimals(-1e-12), "0");
/// ```
#[must_use]
pub fn nine_decimals(value: f64) -> String {
    /// Whole numbers above it are not all numbers of their own.
    const WHOLE_MAX: f64 = 9.0e15;
    let billionths = (value * 1e9).round();
    // A whole number by a power of ten is rounded once, and so has the shortest text. A sum with zero is never -0.
    let rounded = if billionths.abs() < WHOLE_MAX { billionths / 1e9 + 0.0 } else { value };
    rounded.to_string()
}
