//! Numbers in texts for people.

/// Four digits.
pub fn rounded(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = 3 - libm::log10(value.abs()).floor() as i32;
    if (0..9).contains(&digits) {
        format!("{value:.*}", digits as usize)
    } else if (-3..0).contains(&digits) {
        format!("{value:.0}")
    } else {
        format!("{value:.3e}")
    }
}
