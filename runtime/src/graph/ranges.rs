//! Ranges of numbers by the unit at the end of their keys: a value that no vehicle, sensor or room has is refused
//! before a kind reads it. Kinds and files have narrower bounds where they know more.

use crate::manifest::{Manifest, Process};
use diagnostics::{Diagnostic, ParameterError};
use serde_json::Value;
use toml::Spanned;

/// The most that a number may be, by the unit at the end of its key; the longest end counts.
struct Range {
    end: &'static str,
    unit: &'static str,
    most: f64,
    why: &'static str,
}

const fn range(end: &'static str, unit: &'static str, most: f64, why: &'static str) -> Range {
    Range { end, unit, most, why }
}

/// The ranges are wide by intent, decades beyond what a source states. They keep products of a few numbers within the
/// range of a double, and catch a wrong unit or a slipped digit of the exponent.
const RANGES: [Range; 21] = [
    range("_sqrt_hz", "its unit/sqrt(Hz)", 1e3, "no inertial sensor is that noisy: a phone's has 1e-2"),
    range("_sqrt_s", "its unit/sqrt(s)", 1e5, "a bias that walks like that leaves any range in a second"),
    range("_m_s2", "m/s^2", 1e5, "no vehicle that flies stands 10 000 g"),
    range("_m_s", "m/s", 1e4, "faster than anything that leaves the earth (11 200 m/s) or stays"),
    range("_m", "m", 1e7, "a quarter of the earth's meridian"),
    range("_rad_s2", "rad/s^2", 1e7, "no vehicle that flies turns up so fast"),
    range("_rad_s", "rad/s", 1e5, "a rotor of 1 cm radius would be supersonic at 3.4e4 rad/s"),
    range("_rad", "rad", 1e4, "more than a thousand turns"),
    range("_deg", "deg", 1e6, "more than a thousand turns"),
    range("_1_s3", "1/s^3", 1e9, "the poles of such a loop are beyond 1 kHz"),
    range("_1_s2", "1/s^2", 1e8, "the poles of such a loop are beyond 1 kHz"),
    range("_1_s", "1/s", 1e6, "the fastest run has a million ticks a second"),
    range("_hz", "Hz", 1e6, "the fastest run has a million ticks a second"),
    range("_ms", "ms", 5e12, "longer than the longest run, of 4.29e9 ticks"),
    range("_s", "s", 5e9, "longer than the longest run, of 4.29e9 ticks"),
    range("_Pa", "Pa", 1e7, "a hundred times the air pressure at sea level"),
    range("_T", "T", 1e2, "the strongest continuous magnet makes 45 T"),
    range("_V", "V", 1e4, "no battery that flies has it"),
    range("_A", "A", 1e5, "no battery that flies gives it"),
    range("_Ah", "A*h", 1e5, "no battery that flies has it"),
    range("", "", 1e12, "no number without a unit is that large"),
];

/// A smaller magnitude, other than 0, is an accident: its inverse or its square leaves the range of a double.
const LEAST: f64 = 1e-30;

/// Refuses numbers of the parameters and initial values of process `name` that are out of all range.
///
/// # Errors
/// Their keys, the bounds and why.
pub fn check(manifest: &Manifest, name: &Spanned<String>, process: &Process) -> Result<(), Diagnostic> {
    let refused = |at: &Spanned<String>, reason: ParameterError| {
        let message = format!("process `{}`: {reason}", name.get_ref());
        manifest.problem(&at.span(), message, "look at the unit, with which the key ends")
    };
    let checked = |at, path: &str, key: &str, value| {
        let reasons = within(path, key, value).err().map_or(Vec::new(), ParameterError::into_each);
        reasons.into_iter().map(move |reason| Err::<(), _>(refused(at, reason)))
    };
    let parameters =
        process.parameters.iter().flat_map(|(key, value)| checked(key, key.get_ref(), key.get_ref(), value));
    let initial = process.inputs.iter().filter_map(|(port, input)| Some((port, input.initial.as_ref()?)));
    let initial = initial.flat_map(|(port, initial)| {
        checked(port, &format!("inputs.{}.initial", port.get_ref()), "", initial)
    });
    Diagnostic::gather(parameters.chain(initial)).map(drop)
}

/// `parameters` without those that hold a number out of all range.
pub fn without(parameters: &Value) -> Value {
    let mut rest = parameters.clone();
    if let Value::Object(table) = &mut rest {
        table.retain(|key, value| within(key, key, value).is_ok());
    }
    rest
}

/// Checks `value` at the dotted `path`; `key` is the last key on it that is a name.
fn within(path: &str, key: &str, value: &Value) -> Result<(), ParameterError> {
    match value {
        Value::Object(table) => {
            let each = table.iter().map(|(key, value)| within(&format!("{path}.{key}"), key, value));
            ParameterError::gather(each).map(drop)
        }
        Value::Array(array) => {
            let each = array.iter().enumerate();
            let each = each.map(|(index, value)| within(&format!("{path}.{index}"), key, value));
            // Of a list of numbers, the first counts.
            let is_of_numbers = array.iter().all(Value::is_number);
            if is_of_numbers { each.collect() } else { ParameterError::gather(each).map(drop) }
        }
        Value::Number(number) => number.as_f64().map_or(Ok(()), |number| number_within(path, key, number)),
        Value::Null | Value::Bool(_) | Value::String(_) => Ok(()),
    }
}

fn number_within(path: &str, key: &str, number: f64) -> Result<(), ParameterError> {
    // The last range fits any key.
    let Some(range) = RANGES.iter().find(|range| key.ends_with(range.end)) else { return Ok(()) };
    let Range { unit, most, why, .. } = range;
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    if number.abs() > *most {
        let message = format!("`{path}` is {number:e}{unit}, expected at most {most:e}{unit} in size: {why}");
        return Err(ParameterError::conflict(path, message));
    }
    if number != 0.0 && number.abs() < LEAST {
        let message = format!("`{path}` is {number:e}{unit}, expected 0 or at least {LEAST:e}{unit} in size");
        return Err(ParameterError::conflict(path, message));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{RANGES, within, without};
    use serde_json::json;

    #[test]
    fn the_longest_end_of_a_key_counts() {
        let refused = |key: &str, number: f64| within(key, key, &json!(number)).unwrap_err().to_string();
        assert!(refused("speed_m_s", 2e4).contains("expected at most 1e4 m/s in size"));
        assert!(refused("width_m", 2e7).contains("1e7 m"));
        assert!(refused("rate_rad_s", 1e6).contains("1e5 rad/s"));
        assert!(refused("count", 1e13).contains("1e12 in size"));
        assert!(refused("time_s", 5e-324).contains("expected 0 or at least 1e-30 s"));
        for (index, range) in RANGES.iter().enumerate() {
            let earlier = RANGES[..index].iter().find(|earlier| range.end.ends_with(earlier.end));
            assert!(earlier.is_none(), "{} is never reached", range.end);
        }
    }

    #[test]
    fn a_number_deep_in_a_table_is_named_by_its_whole_key() {
        let gains = json!({ "roll": { "proportional_1_s2": 16.0, "integral_1_s3": [0.0, -1e300] } });
        let error = within("gains", "gains", &gains).unwrap_err().to_string();
        assert!(
            error.starts_with("`gains.roll.integral_1_s3.1` is -1e300 1/s^3, expected at most 1e9"),
            "{error}"
        );
        assert_eq!(within("gains", "gains", &json!({ "file": "1e300", "on": true })), Ok(()));
        let entries = json!([{ "at_s": 1e30, "to_m": [1e30, 1e30] }, { "at_s": 1e30 }]);
        let errors = within("list", "list", &entries).unwrap_err().into_each();
        assert_eq!(errors.len(), 3, "{errors:?}");
        assert_eq!(without(&json!({ "a_s": 1e30, "b_s": 1.0 })), json!({ "b_s": 1.0 }));
    }
}
