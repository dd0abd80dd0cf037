//! Numbers in texts for people.

use diagnostics::unit::behind_number;

/// Four digits and the unit.
pub fn quantity(value: f64, unit: &str) -> String {
    format!("{}{}", rounded(value), behind_number(unit))
}

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

/// Value with six significant digits: no estimate is known better.
///
/// Files have these; intervals in texts have four.
pub fn to_six_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::{quantity, to_six_digits};

    #[test]
    fn a_number_of_a_file_has_six_digits() {
        let values = [0.005_995_057_451_690_751_5, -1.0, 7.618_4e-8, 43_988.456, 0.0];
        assert_eq!(values.map(to_six_digits), [0.005_995_06, -1.0, 7.618_4e-8, 43_988.5, 0.0]);
    }

    #[test]
    fn numbers_of_ordinary_size_are_plain_and_the_unit_1_is_left_out() {
        let texts =
            [(2.339, "m/s"), (-0.7993, "1"), (9.0, "1"), (0.0, "m"), (43_988.4, "rpm"), (5.7e-8, "N")];
        let texts = texts.map(|(value, unit)| quantity(value, unit));
        assert_eq!(texts, ["2.339 m/s", "-0.7993", "9.000", "0 m", "43988 rpm", "5.700e-8 N"]);
    }
}
