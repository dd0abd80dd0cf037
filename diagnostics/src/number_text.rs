//! Advice on numbers that are written as texts, such as `"8 s"`.

use crate::unit::{
    ACCELERATION, ANGLE, ANGULAR_ACCELERATION, ANGULAR_VELOCITY, Dimension, FREQUENCY, JERK, LENGTH, MASS,
    TIME, VELOCITY, VOLTAGE,
};

/// Units at the end of keys, their dimensions, and their names in texts; a longer end comes before its own end.
const ENDS: [(&str, Dimension, &str); 18] = [
    ("rad_s2", ANGULAR_ACCELERATION, "rad/s^2"),
    ("rad_s", ANGULAR_VELOCITY, "rad/s"),
    ("deg_s", ANGULAR_VELOCITY, "deg/s"),
    ("m_s3", JERK, "m/s^3"),
    ("m_s2", ACCELERATION, "m/s^2"),
    ("m_s", VELOCITY, "m/s"),
    ("deg", ANGLE, "deg"),
    ("rad", ANGLE, "rad"),
    ("hz", FREQUENCY, "Hz"),
    ("kg", MASS, "kg"),
    ("mm", LENGTH, "mm"),
    ("ms", TIME, "ms"),
    ("us", TIME, "us"),
    ("ns", TIME, "ns"),
    ("v", VOLTAGE, "V"),
    ("m", LENGTH, "m"),
    ("g", MASS, "g"),
    ("s", TIME, "s"),
];
/// Words before a unit that make another unit of it, as in `noise_density_m_s2_sqrt_hz` and `wind_rad_s_per_m`.
const JOINING: [&str; 10] = ["sqrt", "per", "1", "n", "m", "rad", "deg", "kg", "s", "s2"];

/// Bytes of the longest text that is read: the time grows with the square of its length.
const TEXT_MAX: usize = 100;
/// Whole numbers from here on are not all floats.
const WHOLE_MAX: f64 = 9.0e15;

/// The number at the start of `text`, and the rest of the text without blanks around it; `None` if the text starts
/// otherwise, or is longer than any number with a unit.
///
/// ```
/// assert_eq!(diagnostics::leading_number("-8.5 s"), Some((-8.5, "s")));
/// assert_eq!(diagnostics::leading_number("fast"), None);
/// ```
#[must_use]
pub fn leading_number(text: &str) -> Option<(f64, &str)> {
    let text = Some(text.trim()).filter(|text| text.len() <= TEXT_MAX)?;
    let is_part = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let most = text.bytes().take_while(is_part).count();
    // An `e` may begin the unit; no text without a digit is a number.
    let parsed =
        (1..=most).rev().find_map(|end| Some((text[..end].parse::<f64>().ok()?, text[end..].trim())));
    parsed.filter(|(number, _)| number.is_finite())
}

/// Advice on a value of the dotted `key`, which has to be a number as `expected` says, and is a text as `found` says; `None`
/// if no number is expected, or the text does not begin with one.
pub fn advice(key: &str, expected: &str, found: &str) -> Option<String> {
    let is_whole = expected.starts_with("a whole number");
    if !is_whole && !["a number", "a finite number"].iter().any(|start| expected.starts_with(start)) {
        return None;
    }
    let text = found.strip_prefix("the text \"")?.strip_suffix('"')?;
    let (number, rest) = leading_number(text)?;
    let name = key.rsplit('.').find(|part| part.parse::<usize>().is_err()).unwrap_or_default();
    let unit = unit_of(name);
    let written = value(number, rest, unit.as_ref()).and_then(|value| literal(value, is_whole));
    // An element of a list stands without its key.
    let is_element = !key.ends_with(name) || name.is_empty();
    let line = written.map(|value| if is_element { value } else { format!("{name} = {value}") });
    Some(match (unit, line) {
        (Some(_), Some(line)) => format!("the unit is in the key's name: write `{line}`"),
        (Some((_, unit)), None) => {
            format!(
                "the unit is in the key's name: write the number alone, in {unit} and without quotation marks"
            )
        }
        (None, Some(line)) => format!("a number has no quotation marks: write `{line}`"),
        (None, None) => "write the number alone, without quotation marks and unit".to_owned(),
    })
}

/// The unit at the end of a key's `name`; `None` if the name ends without one, or with one that is not known here.
fn unit_of(name: &str) -> Option<(Dimension, &'static str)> {
    ENDS.into_iter().find_map(|(end, dimension, unit)| {
        let before = name.strip_suffix(end)?.strip_suffix('_')?;
        let last = before.rsplit('_').next().unwrap_or_default();
        (!JOINING.contains(&last)).then_some((dimension, unit))
    })
}

/// The number in the unit of the key, where the unit `rest` behind it is known.
fn value(number: f64, rest: &str, unit: Option<&(Dimension, &str)>) -> Option<f64> {
    let Some((dimension, unit)) = unit else { return rest.is_empty().then_some(number) };
    if rest.is_empty() || rest.eq_ignore_ascii_case(unit) {
        return Some(number);
    }
    let converted = number * dimension.factor(rest)? / dimension.factor(unit)?;
    // The last digits are those of the factors.
    format!("{converted:.11e}").parse().ok()
}

/// The number as a file has it; `None` for a fraction or a number out of range where only whole numbers are.
fn literal(value: f64, is_whole: bool) -> Option<String> {
    let fits = value.fract() == 0.0 && value.abs() < WHOLE_MAX;
    if is_whole { fits.then(|| value.to_string()) } else { Some(format!("{value:?}")) }
}

#[cfg(test)]
mod tests {
    use super::{ENDS, advice, leading_number};

    fn told(key: &str, text: &str) -> String {
        advice(key, "a number", &format!("the text {text:?}")).unwrap_or_default()
    }

    #[test]
    fn a_number_with_the_unit_of_its_key_gives_the_line_to_paste() {
        for (key, text, line) in [
            ("run.duration_s", "8 s", "duration_s = 8.0"),
            ("run.duration_s", "8s", "duration_s = 8.0"),
            ("run.duration_s", "8", "duration_s = 8.0"),
            ("run.duration_s", "300 ms", "duration_s = 0.3"),
            ("run.rate_hz", "1 kHz", "rate_hz = 1000.0"),
            ("run.rate_hz", "500 hz", "rate_hz = 500.0"),
            ("mass_kg", "480 g", "mass_kg = 0.48"),
            ("wall.speed_m_s", "-2.5e-1 m/s", "speed_m_s = -0.25"),
            ("start_m.2", "1.5 m", "1.5"),
        ] {
            assert_eq!(
                told(key, text),
                format!("the unit is in the key's name: write `{line}`"),
                "{key} {text}"
            );
        }
    }

    #[test]
    fn a_number_in_another_unit_gives_no_line() {
        let of_s = "the unit is in the key's name: write the number alone, in s and without quotation marks";
        for text in ["8 m", "8,5 s", "8 to 10 s", "10:30"] {
            assert_eq!(told("duration_s", text), of_s, "{text}");
        }
        assert_eq!(told("gain", "2 N"), "write the number alone, without quotation marks and unit");
        let density = "accelerometer_noise_density_m_s2_sqrt_hz";
        assert_eq!(told(density, "2 Hz"), "write the number alone, without quotation marks and unit");
        assert_eq!(told(density, "2"), format!("a number has no quotation marks: write `{density} = 2.0`"));
    }

    #[test]
    fn a_whole_number_has_no_fraction() {
        let told =
            |text: &str| advice("run.seed", "a whole number, at least 0", &format!("the text {text:?}"));
        assert_eq!(told("7").as_deref(), Some("a number has no quotation marks: write `seed = 7`"));
        for text in ["7.5", "1e20"] {
            assert_eq!(
                told(text).as_deref(),
                Some("write the number alone, without quotation marks and unit"),
                "{text}"
            );
        }
    }

    #[test]
    fn other_values_have_no_such_advice() {
        assert_eq!(told("duration_s", "long") + &told("duration_s", "") + &told("duration_s", "inf"), "");
        assert_eq!(advice("kind", "a text", "the text \"8 s\""), None);
        assert_eq!(advice("duration_s", "a number", "true"), None);
        assert_eq!(leading_number("1e999"), None);
        assert_eq!(leading_number("é8"), None);
        assert_eq!(leading_number(&("1".repeat(1 << 20) + &"e".repeat(1 << 20))), None, "in no time");
    }

    #[test]
    fn every_end_of_a_key_has_a_unit_of_its_dimension() {
        for (end, dimension, unit) in ENDS {
            assert!(dimension.factor(unit).is_some(), "{end}");
        }
    }
}
