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

/// Length, in m, up to which lengths are printed in mm.
const MM_TO_M: f64 = 0.1;
/// Length, in m, from which on a row of lengths is printed in m.
const MM_BESIDE_M: f64 = 10.0;

/// Values for people who fly, and their unit: short lengths in mm, powers of ten and of units with raised digits.
///
/// All values have one unit, so that they can be compared.
pub fn printed<const N: usize>(values: [f64; N], unit: &str) -> ([String; N], String) {
    let is_short = values.iter().any(|value| *value != 0.0 && value.abs() <= MM_TO_M);
    let is_in_mm = unit == "m" && is_short && values.iter().all(|value| value.abs() < MM_BESIDE_M);
    let (factor, unit) = if is_in_mm { (1e3, "mm") } else { (1.0, unit) };
    (values.map(|value| with_signs(factor * value)), unit_with_signs(&behind_number(unit)))
}

/// One value with its unit, as [`printed`].
pub fn printed_quantity(value: f64, unit: &str) -> String {
    let ([value], unit) = printed([value], unit);
    value + &unit
}

/// Four digits, with a minus sign and raised digits: `−1.414·10⁻⁶`.
fn with_signs(value: f64) -> String {
    let is_small = value != 0.0 && value.abs() < 1e-4;
    let text = if is_small { format!("{value:.3e}") } else { rounded(value) };
    let text = match text.split_once('e') {
        Some((digits, power)) => format!("{digits}·10{}", power.chars().map(raised).collect::<String>()),
        None => text,
    };
    text.replace('-', "−")
}

/// A unit with raised digits: `N·s²/m`.
fn unit_with_signs(unit: &str) -> String {
    let mut is_raised = false;
    let signs = unit.chars().filter_map(|sign| {
        is_raised = sign == '^' || is_raised && (sign == '-' || sign.is_ascii_digit());
        match sign {
            '^' => None,
            '*' => Some('·'),
            _ if is_raised => Some(raised(sign)),
            _ => Some(sign),
        }
    });
    signs.collect()
}

fn raised(sign: char) -> char {
    let digit = sign.to_digit(10).and_then(|digit| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize));
    digit.unwrap_or(if sign == '-' { '⁻' } else { sign })
}

/// Value with four significant digits where these move it by a tenth of its `standard_error` at most, else with six.
pub fn to_known_digits(value: f64, standard_error: f64) -> f64 {
    let four = format!("{value:.3e}").parse().unwrap_or(value);
    if (four - value).abs() <= 0.1 * standard_error { four } else { to_six_digits(value) }
}

/// Value with six significant digits: no estimate is known better.
pub fn to_six_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::{printed, printed_quantity, quantity, to_known_digits, to_six_digits};

    #[test]
    fn people_read_short_lengths_in_millimetres_and_powers_with_raised_digits() {
        let joined = |values: [f64; 3], unit: &str| {
            let (values, unit) = printed(values, unit);
            values.join(" ") + &unit
        };
        assert_eq!(joined([0.005_995, 0.005_985, 0.006_005], "m"), "5.995 5.985 6.005 mm");
        assert_eq!(joined([0.0, -0.1, 0.1], "m"), "0 −100.0 100.0 mm");
        assert_eq!(joined([0.016_58, 0.1465, 2.039], "m"), "16.58 146.5 2039 mm");
        assert_eq!(joined([0.016_58, 0.1465, 20.0], "m"), "0.01658 0.1465 20.00 m");
        assert_eq!(joined([0.0, 0.2, 0.3], "m"), "0 0.2000 0.3000 m");
        let texts = [(-1.4137e-6, "N*s^2/(m*rad)"), (13.7, "m/s^2"), (0.25, "1"), (3.1e-5, "s^-1")];
        let texts = texts.map(|(value, unit)| printed_quantity(value, unit));
        assert_eq!(texts, ["−1.414·10⁻⁶ N·s²/(m·rad)", "13.70 m/s²", "0.2500", "3.100·10⁻⁵ s⁻¹"]);
    }

    #[test]
    fn a_number_of_a_file_has_the_digits_that_are_known() {
        let known = |standard_error| to_known_digits(0.005_995_057_451, standard_error);
        assert_eq!([known(1e-6), known(1e-7), known(f64::NAN)], [0.005_995, 0.005_995_06, 0.005_995_06]);
    }

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
