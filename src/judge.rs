//! The judgement of a run: its pass conditions and comparisons, evaluated on the recording.

use crate::manifest::{Comparison, Content, PassCondition, Statistic};
use anyhow::{Result, bail};
use recorder::reader::Recording;
use recorder::series::Series;
use serde::Serialize;

/// A pass condition and how it came out.
#[derive(Debug, Serialize)]
pub struct Verdict {
    /// What the condition means.
    pub name: String,
    /// The values compared with the limits: one, or the smallest and the largest.
    pub values: Vec<f64>,
    /// Their unit.
    pub unit: String,
    /// Lower limit.
    pub min: Option<f64>,
    /// Upper limit.
    pub max: Option<f64>,
    /// Whether it held.
    pub passed: bool,
}

/// RMS errors of a simulated state at the ends of windows.
#[derive(Debug, Serialize)]
pub struct WindowErrors {
    /// Topic of the simulated state.
    pub simulated: String,
    /// Length of the windows.
    pub window_s: f64,
    /// Windows compared.
    pub windows: usize,
    /// RMS length of the position error.
    pub position_rms_m: f64,
    /// RMS length of the velocity error.
    pub velocity_rms_m_s: f64,
    /// RMS angle of the attitude error.
    pub attitude_rms_deg: f64,
    /// Whether all limits held.
    pub passed: bool,
}

/// Units that stand for the same quantity: name, quantity, factor to the quantity's SI unit.
const UNITS: [(&str, &str, f64); 14] = [
    ("m", "length", 1.0),
    ("cm", "length", 0.01),
    ("mm", "length", 0.001),
    ("rad", "angle", 1.0),
    ("deg", "angle", std::f64::consts::PI / 180.0),
    ("rad/s", "angular rate", 1.0),
    ("deg/s", "angular rate", std::f64::consts::PI / 180.0),
    ("rpm", "angular rate", std::f64::consts::PI / 30.0),
    ("m/s", "velocity", 1.0),
    ("m/s^2", "acceleration", 1.0),
    ("s", "time", 1.0),
    ("ns", "time", 1e-9),
    ("1", "number", 1.0),
    ("count", "count", 1.0),
];

/// The factor that turns a number in `from` into one in `to`.
///
/// # Errors
/// If the units are not of one quantity.
pub fn conversion(from: &str, to: &str) -> Result<f64, String> {
    if from == to {
        return Ok(1.0);
    }
    let find = |unit: &str| UNITS.iter().find(|(name, ..)| *name == unit);
    match (find(from), find(to)) {
        (Some((_, quantity, a)), Some((_, other, b))) if quantity == other => Ok(a / b),
        (Some((_, quantity, _)), _) => {
            let fitting = UNITS.iter().filter(|(_, other, _)| other == quantity).map(|(name, ..)| *name);
            Err(format!(
                "`{to}` is not a unit of {quantity}; expected {}",
                fitting.collect::<Vec<_>>().join(" or ")
            ))
        }
        (None, _) => Err(format!("the field's unit is `{from}`, which cannot be converted to `{to}`")),
    }
}

/// Evaluates the pass conditions of `content` on `recording`.
///
/// # Errors
/// If a topic or field is not in the recording, or a unit does not fit.
pub fn verdicts(content: &Content, recording: &Recording) -> Result<Vec<Verdict>> {
    let conditions: Vec<&PassCondition> = content.pass.iter().map(toml::Spanned::get_ref).collect();
    let fields: Vec<_> = conditions.iter().map(|pass| (pass.topic.as_str(), pass.field.as_str())).collect();
    if fields.is_empty() {
        return Ok(Vec::new());
    }
    let series = recording.series(&fields)?;
    conditions.iter().zip(&series).map(|(pass, series)| verdict(pass, series)).collect()
}

fn verdict(pass: &PassCondition, series: &Series) -> Result<Verdict> {
    let factor = match conversion(&series.unit, &pass.unit) {
        Ok(factor) => factor,
        Err(error) => bail!("pass condition `{}`: {error}", pass.name),
    };
    let samples = span(series, pass.from_s, pass.to_s).map(|value| value * factor);
    let values = statistic(pass.statistic, samples);
    let is_above = |value: &f64| pass.min.is_none_or(|min| *value >= min);
    let is_below = |value: &f64| pass.max.is_none_or(|max| *value <= max);
    // A span without samples fails: what was never measured did not pass.
    let passed = !values.is_empty() && values.iter().all(|value| is_above(value) && is_below(value));
    Ok(Verdict {
        name: pass.name.clone(),
        values,
        unit: pass.unit.clone(),
        min: pass.min,
        max: pass.max,
        passed,
    })
}

fn span(series: &Series, from_s: f64, to_s: Option<f64>) -> impl Iterator<Item = f64> {
    let samples = series.time_ns.iter().zip(&series.value);
    samples
        .filter(move |(time_ns, _)| {
            // Half a nanosecond of slack: limits in seconds are not exact in binary.
            let time_s = **time_ns as f64 * 1e-9;
            time_s >= from_s - 5e-10 && to_s.is_none_or(|to_s| time_s <= to_s + 5e-10)
        })
        .map(|(_, value)| *value)
}

fn statistic(statistic: Statistic, samples: impl Iterator<Item = f64>) -> Vec<f64> {
    let samples: Vec<f64> = samples.collect();
    if samples.is_empty() {
        return Vec::new();
    }
    let count = samples.len() as f64;
    // NaN must fail a condition, so it wins over every number here, unlike with f64::min.
    let extreme = |pick: fn(f64, f64) -> f64| {
        samples.iter().copied().reduce(|a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { pick(a, b) })
    };
    let (smallest, largest) = (extreme(f64::min), extreme(f64::max));
    match statistic {
        Statistic::Every => smallest.into_iter().chain(largest).collect(),
        Statistic::Min => smallest.into_iter().collect(),
        Statistic::Max => largest.into_iter().collect(),
        Statistic::Mean => vec![samples.iter().sum::<f64>() / count],
        Statistic::Rms => vec![(samples.iter().map(|x| x * x).sum::<f64>() / count).sqrt()],
        Statistic::Last => samples.last().copied().into_iter().collect(),
    }
}

const STATE_FIELDS: [&str; 10] = [
    "position.x",
    "position.y",
    "position.z",
    "velocity.x",
    "velocity.y",
    "velocity.z",
    "attitude.x",
    "attitude.y",
    "attitude.z",
    "attitude.w",
];

/// Evaluates the comparisons of `content` on `recording`.
///
/// # Errors
/// If a topic is not in the recording or holds no state.
pub fn window_errors(content: &Content, recording: &Recording) -> Result<Vec<WindowErrors>> {
    content.compare.iter().map(|compare| compare_states(compare.get_ref(), recording)).collect()
}

fn compare_states(compare: &Comparison, recording: &Recording) -> Result<WindowErrors> {
    let fields = |topic| STATE_FIELDS.map(|field| (topic, field));
    let simulated = recording.series(&fields(compare.simulated.as_str()))?;
    let measured = recording.series(&fields(compare.measured.as_str()))?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive time of a run")]
    let window_ns = (compare.window_s * 1e9).round() as u64;
    let is_end = |time_ns: u64| time_ns > 0 && window_ns > 0 && time_ns.is_multiple_of(window_ns);
    let (mut sums, mut windows) = ([0.0; 3], 0);
    for (index, &time_ns) in simulated[0].time_ns.iter().enumerate().filter(|(_, time_ns)| is_end(**time_ns))
    {
        let Ok(other) = measured[0].time_ns.binary_search(&time_ns) else { continue };
        let error = |field: usize| simulated[field].value[index] - measured[field].value[other];
        sums[0] += (0..3).map(|field| error(field).powi(2)).sum::<f64>();
        sums[1] += (3..6).map(|field| error(field).powi(2)).sum::<f64>();
        let dot: f64 = (6..10).map(|f| simulated[f].value[index] * measured[f].value[other]).sum();
        // `clamp` keeps NaN, where `min` would make it a perfect match.
        sums[2] += (2.0 * dot.abs().clamp(0.0, 1.0).acos()).to_degrees().powi(2);
        windows += 1;
    }
    if windows == 0 {
        bail!(
            "{} and {} have no common sample at the end of a window of {} s",
            compare.simulated,
            compare.measured,
            compare.window_s
        );
    }
    let [position_rms_m, velocity_rms_m_s, attitude_rms_deg] = sums.map(|sum| (sum / windows as f64).sqrt());
    let holds = |value: f64, max: Option<f64>| max.is_none_or(|max| value <= max);
    let passed = holds(position_rms_m, compare.max_position_m)
        && holds(velocity_rms_m_s, compare.max_velocity_m_s)
        && holds(attitude_rms_deg, compare.max_attitude_deg);
    Ok(WindowErrors {
        simulated: compare.simulated.clone(),
        window_s: compare.window_s,
        windows,
        position_rms_m,
        velocity_rms_m_s,
        attitude_rms_deg,
        passed,
    })
}

#[cfg(test)]
mod tests {
    use super::{conversion, statistic};
    use crate::manifest::Statistic;

    #[test]
    fn units_of_one_quantity_convert() {
        assert!((conversion("rad", "deg").unwrap() - 180.0 / std::f64::consts::PI).abs() < 1e-12);
        assert!(conversion("m", "deg").unwrap_err().contains("expected m or cm or mm"));
        assert_eq!(conversion("foo", "foo"), Ok(1.0));
    }

    #[test]
    fn a_nan_among_the_samples_is_not_hidden() {
        assert!(statistic(Statistic::Max, [1.0, f64::NAN, 2.0].into_iter())[0].is_nan());
        assert_eq!(statistic(Statistic::Every, [3.0, 1.0].into_iter()), [1.0, 3.0]);
        assert!(statistic(Statistic::Every, std::iter::empty()).is_empty());
    }
}
