//! The judgement of a run: its pass conditions and comparisons, evaluated on the recording.

use crate::response::{NoResponse, Response};
use crate::states::{FIELDS_OF_POSE, tracks};
use anyhow::{Result, anyhow, bail};
use flights::state::StateQuantity;
use recorder::RecordingError;
use recorder::reader::Recording;
use recorder::series::Series;
use runtime::manifest::{Comparison, Content, PassCondition, Reference, Statistic};
use serde::Serialize;
use std::fmt;
use toml::Spanned;

/// A pass condition and how it came out, or a measure, which has no limits; its text is a line of the summary.
///
/// ```
/// use report::judge::Verdict;
/// let (name, unit) = ("altitude".to_owned(), "m".to_owned());
/// let values = vec![1.49, 1.51];
/// let verdict = Verdict { name, values, unit, min: Some(1.4), max: Some(1.6), passed: true, why: None };
/// assert_eq!(verdict.to_string(), "  ok     altitude: 1.4900 … 1.5100 m (1.4 … 1.6)");
/// ```
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
    /// Why there are no values, where more is to say than that there were no samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

/// RMS errors of a simulated state at the ends of windows; its text is a line of the summary.
///
/// ```
/// use report::judge::WindowErrors;
/// let errors = WindowErrors {
///     simulated: "/plant/state".to_owned(),
///     window_s: 0.5,
///     windows: 8,
///     position_rms_m: 0.012,
///     velocity_rms_m_s: 0.1,
///     attitude_rms_deg: 2.5,
///     passed: false,
/// };
/// assert!(errors.to_string().ends_with("position 0.0120 m, velocity 0.1000 m/s, attitude 2.500 deg  FAILED"));
/// ```
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

/// Evaluates `conditions`, the pass conditions or the measures of a manifest, on `recording`.
///
/// # Errors
/// If a topic or field is not in the recording, or a unit does not fit.
pub(crate) fn verdicts(conditions: &[Spanned<PassCondition>], recording: &Recording) -> Result<Vec<Verdict>> {
    let conditions = || conditions.iter().map(Spanned::get_ref);
    let wanted: Vec<_> = conditions().map(|pass| wanted(pass, recording)).collect::<Result<_>>()?;
    let fields: Vec<_> =
        wanted.iter().flatten().map(|(topic, field)| (topic.as_str(), field.as_str())).collect();
    if fields.is_empty() {
        return Ok(Vec::new());
    }
    let series = recording.series(&fields)?;
    let mut rest = &series[..];
    let verdicts = conditions().zip(&wanted).map(|(pass, wanted)| {
        let (series, behind) = rest.split_at(wanted.len());
        rest = behind;
        verdict(pass, series)
    });
    verdicts.collect()
}

/// All series that a condition needs: the judged field's parts, those that are taken off, the reference's, the gate's.
fn wanted(pass: &PassCondition, recording: &Recording) -> Result<Vec<(String, String)>> {
    let parts = |topic: &String, field: &str| {
        let parts = recording.parts(topic, field)?.into_iter();
        Ok::<_, RecordingError>(parts.map(|part| (topic.clone(), part)).collect::<Vec<_>>())
    };
    let mut wanted = parts(&pass.topic, &pass.field)?;
    if let Some(minus) = &pass.minus {
        let other = parts(&minus.topic, &minus.field)?;
        if other.len() != wanted.len() {
            let name = &pass.name;
            bail!("`{name}`: `minus` takes a vector off a number, or a number off a vector");
        }
        wanted.extend(other);
    }
    if let Some(reference) = &pass.reference {
        let other = parts(&reference.topic, &reference.field)?;
        if wanted.len() + other.len() != 2 {
            bail!("`{}`: a lag or a gain is of one number behind another, not of vectors", pass.name);
        }
        wanted.extend(other);
    }
    if let Some(gate) = &pass.gate {
        wanted.push((gate.topic.clone(), gate.field.clone()));
    }
    Ok(wanted)
}

fn verdict(pass: &PassCondition, series: &[Series]) -> Result<Verdict> {
    let found = match &pass.reference {
        Some(reference) => response(pass, reference, &series[0], &series[1])?,
        None => Ok(judged_values(pass, series)?),
    };
    let (values, why) = match found {
        Ok(values) => (values, None),
        Err(why) => (Vec::new(), Some(why.to_string())),
    };
    // A span without samples fails: what was never measured did not pass.
    let passed = !values.is_empty() && values.iter().all(|value| within(*value, pass.min, pass.max));
    let (name, unit) = (pass.name.clone(), pass.unit.clone());
    Ok(Verdict { name, values, unit, min: pass.min, max: pass.max, passed, why })
}

/// From the unit of what `pass` judges, of a field in `field_unit`, to that of its limits.
fn factor(pass: &PassCondition, field_unit: &str) -> Result<f64> {
    diagnostics::convert(pass.statistic.unit(field_unit), &pass.unit)
        .map_err(|error| anyhow!("`{}`: {error}", pass.name))
}

/// Lag or gain of `field` behind `signal`, of which the newest sample counts.
fn response(
    pass: &PassCondition,
    reference: &Reference,
    field: &Series,
    signal: &Series,
) -> Result<Result<Vec<f64>, NoResponse>> {
    if field.unit != signal.unit {
        let (name, Reference { topic, field: path, .. }) = (&pass.name, reference);
        let (unit, other) = (&field.unit, &signal.unit);
        bail!("`{name}`: the field is in `{unit}`, its reference, `{path}` of {topic}, in `{other}`");
    }
    let factor = factor(pass, &field.unit)?;
    let known = span(field, pass.from_s, pass.to_s)
        .filter_map(|(index, time_ns)| Some((field.value[index], held(signal, time_ns)?)));
    let (values, references): (Vec<f64>, Vec<f64>) = known.unzip();
    let Some(step_s) = step_s(field) else { return Ok(Err(NoResponse::TooShort)) };
    let found = Response::of(&values, &references, samples(reference.within_s / step_s));
    let value = |found: Response| match pass.statistic {
        Statistic::Lag => found.lag_samples as f64 * step_s,
        _ => found.gain,
    };
    Ok(found.map(|found| vec![value(found) * factor]))
}

/// Time between two samples.
fn step_s(series: &Series) -> Option<f64> {
    let [first, second, ..] = series.time_ns[..] else { return None };
    Some((second - first) as f64 * 1e-9)
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a number of samples, cut off where absurd"
)]
fn samples(count: f64) -> usize {
    count.round() as usize
}

/// The values that `pass` compares with its limits.
fn judged_values(pass: &PassCondition, series: &[Series]) -> Result<Vec<f64>> {
    let (signals, gates) = series.split_at(series.len() - usize::from(pass.gate.is_some()));
    let gate = pass.gate.as_ref().zip(gates.first());
    let (judged, taken) = signals.split_at(signals.len() / if pass.minus.is_some() { 2 } else { 1 });
    let factor = factor(pass, &judged[0].unit)?;
    let is_open = |time_ns: u64| {
        gate.is_none_or(|(gate, series)| {
            held(series, time_ns).is_some_and(|value| within(value, gate.min, gate.max))
        })
    };
    let samples = span(&judged[0], pass.from_s, pass.to_s)
        .filter(|(_, time_ns)| is_open(*time_ns))
        .filter_map(|(index, time_ns)| difference(judged, taken, index, time_ns))
        .map(|value| value * factor);
    Ok(statistic(pass.statistic, samples))
}

/// Whether `value` is a number between the limits that there are.
fn within(value: f64, min: Option<f64>, max: Option<f64>) -> bool {
    !value.is_nan() && min.is_none_or(|min| value >= min) && max.is_none_or(|max| value <= max)
}

/// The judged value of sample `index`: a number less what is taken off, or the length of such a vector; none before
/// the first sample of what is taken off.
fn difference(judged: &[Series], taken: &[Series], index: usize, time_ns: u64) -> Option<f64> {
    let part = |part: usize| {
        let off = taken.get(part).map_or(Some(0.0), |series| held(series, time_ns))?;
        Some(judged[part].value[index] - off)
    };
    if judged.len() == 1 {
        return part(0);
    }
    let squares = (0..judged.len()).map(|index| part(index).map(|value| value * value));
    squares.sum::<Option<f64>>().map(f64::sqrt)
}

/// The newest value at `time_ns`.
fn held(series: &Series, time_ns: u64) -> Option<f64> {
    let count = series.time_ns.partition_point(|time| *time <= time_ns);
    series.value.get(count.checked_sub(1)?).copied()
}

/// Index and time of the samples within a span.
fn span(series: &Series, from_s: f64, to_s: Option<f64>) -> impl Iterator<Item = (usize, u64)> {
    series.time_ns.iter().copied().enumerate().filter(move |(_, time_ns)| {
        // Half a nanosecond of slack: limits in seconds are not exact in binary.
        let time_s = *time_ns as f64 * 1e-9;
        time_s >= from_s - 5e-10 && to_s.is_none_or(|to_s| time_s <= to_s + 5e-10)
    })
}

fn statistic(statistic: Statistic, samples: impl Iterator<Item = f64>) -> Vec<f64> {
    let samples: Vec<f64> = samples.collect();
    let Some(&last) = samples.last() else { return Vec::new() };
    let mean = |value: fn(&f64) -> f64| samples.iter().map(value).sum::<f64>() / samples.len() as f64;
    // NaN must fail a condition, so it wins over every number here, unlike with f64::min.
    let extreme = |pick: fn(f64, f64) -> f64| {
        samples.iter().fold(last, |a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { pick(a, *b) })
    };
    match statistic {
        Statistic::Every => vec![extreme(f64::min), extreme(f64::max)],
        Statistic::Min => vec![extreme(f64::min)],
        Statistic::Max => vec![extreme(f64::max)],
        Statistic::Mean => vec![mean(|value| *value)],
        Statistic::Rms => vec![mean(|value| value * value).sqrt()],
        Statistic::Last => vec![last],
        Statistic::Span => vec![extreme(f64::max) - extreme(f64::min)],
        Statistic::Lag | Statistic::Gain => {
            unreachable!("of a reference, without which the manifest is refused")
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let values: Vec<String> = self.values.iter().map(|value| shown(*value)).collect();
        let nothing = || self.why.clone().map_or("no samples".to_owned(), |why| format!("no value: {why}"));
        let values = if values.is_empty() { nothing() } else { values.join(" … ") };
        let has_unit = self.unit != "1" && !self.values.is_empty();
        let unit = if has_unit { format!(" {}", self.unit) } else { String::new() };
        let limit = match (self.min, self.max) {
            (Some(min), Some(max)) => format!("{min} … {max}"),
            (Some(min), None) => format!("at least {min}"),
            (None, Some(max)) => format!("at most {max}"),
            (None, None) => return write!(f, "  value  {}: {values}{unit}", self.name),
        };
        let mark = if self.passed { "ok    " } else { "FAILED" };
        write!(f, "  {mark} {}: {values}{unit} ({limit})", self.name)
    }
}

/// Four digits behind the point, or four that are not zero; what is whole without any.
fn shown(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e15 {
        return format!("{value:.0}");
    }
    let zeros = (-libm::log10(value.abs())).ceil().clamp(1.0, 12.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 12")]
    let digits = zeros as usize + 3;
    format!("{value:.digits$}")
}

impl fmt::Display for WindowErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { simulated, window_s, windows, position_rms_m, velocity_rms_m_s, attitude_rms_deg, .. } =
            self;
        let mark = if self.passed { "" } else { "  FAILED" };
        write!(
            f,
            "  {simulated} after {window_s} s (RMS over {windows} windows): position {position_rms_m:.4} m, \
             velocity {velocity_rms_m_s:.4} m/s, attitude {attitude_rms_deg:.3} deg{mark}"
        )
    }
}

/// Evaluates the comparisons of `content` on `recording`.
///
/// # Errors
/// If a topic is not in the recording or holds no state.
pub(crate) fn window_errors(content: &Content, recording: &Recording) -> Result<Vec<WindowErrors>> {
    content.compare.iter().map(|compare| compare_states(compare.get_ref(), recording)).collect()
}

fn compare_states(compare: &Comparison, recording: &Recording) -> Result<WindowErrors> {
    let topics = [compare.simulated.clone(), compare.measured.clone()];
    let tracks = tracks(recording, &topics, FIELDS_OF_POSE)?;
    let [simulated, measured] = &tracks[..] else { unreachable!("a track for each topic") };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive time of a run")]
    let window_ns = (compare.window_s * 1e9).round() as u64;
    let is_end = |time_ns: &&u64| **time_ns > 0 && window_ns > 0 && time_ns.is_multiple_of(window_ns);
    let errors = simulated.errors(measured, simulated.time_ns().iter().filter(is_end).copied());
    if errors.windows() == 0 {
        let Comparison { simulated, measured, window_s, .. } = compare;
        bail!("{simulated} and {measured} have no common sample at the end of a window of {window_s} s");
    }
    let [position_rms_m, velocity_rms_m_s, attitude_rms_deg, _] =
        StateQuantity::ALL.map(|quantity| errors.rms(quantity));
    let passed = within(position_rms_m, None, compare.max_position_m)
        && within(velocity_rms_m_s, None, compare.max_velocity_m_s)
        && within(attitude_rms_deg, None, compare.max_attitude_deg);
    Ok(WindowErrors {
        simulated: compare.simulated.clone(),
        window_s: compare.window_s,
        windows: errors.windows() as usize,
        position_rms_m,
        velocity_rms_m_s,
        attitude_rms_deg,
        passed,
    })
}

#[cfg(test)]
mod tests {
    use super::{statistic, verdict};
    use recorder::series::Series;
    use runtime::manifest::{PassCondition, Statistic};

    /// A series with a sample each second.
    fn series(unit: &str, value: &[f64]) -> Series {
        let time_ns = (0..value.len() as u64).map(|second| second * 1_000_000_000).collect();
        Series { time_ns, value: value.to_vec(), unit: unit.to_owned() }
    }

    fn condition(more: &str) -> PassCondition {
        let text = format!(
            "name = \"c\"\ntopic = \"/a\"\nfield = \"p\"\nunit = \"m\"\nstatistic = \"every\"\nmin = 0.0\n{more}"
        );
        toml::from_str(&text).unwrap()
    }

    #[test]
    fn a_vector_less_another_is_judged_by_its_length() {
        let minus = condition("minus = { topic = \"/b\", field = \"p\" }");
        let axes = [[1.0, 4.0], [0.0, 1.0], [0.0, 0.0], [1.0, 1.0], [0.0, -3.0], [0.0, 0.0]];
        let verdict = verdict(&minus, &axes.map(|values| series("m", &values))).unwrap();
        assert_eq!(verdict.values, [0.0, 5.0]);
    }

    #[test]
    fn only_samples_while_the_gate_is_open_count() {
        let gated = condition("while = { topic = \"/g\", field = \"s\", min = 1, max = 2 }");
        let judged = series("m", &[7.0, 8.0, 9.0, 10.0]);
        // The gate's last sample holds for the judged ones after it.
        let verdict = verdict(&gated, &[judged, series("1", &[0.0, 1.0, 2.0])]).unwrap();
        assert_eq!(verdict.values, [8.0, 10.0]);
        assert!(verdict.passed);
    }

    /// The condition on the lag or gain of `/a` behind `/b`, in `unit`.
    fn response(statistic: &str, unit: &str, more: &str) -> PassCondition {
        let text = format!(
            "name = \"c\"\ntopic = \"/a\"\nfield = \"p\"\nunit = \"{unit}\"\nstatistic = \"{statistic}\"\nmin = -2500.0\n\
             reference = {{ topic = \"/b\", field = \"p\", within_s = 4.0 }}\n{more}"
        );
        toml::from_str(&text).unwrap()
    }

    /// A pulse of 1 among 20 samples, around the sample `at`.
    fn pulse(at: i32) -> Vec<f64> {
        (0..20).map(|index| f64::from(3 - i32::min((index - at).abs(), 3))).collect()
    }

    #[test]
    fn lag_and_gain_are_told_in_the_unit_of_the_limits() {
        let doubled: Vec<f64> = pulse(7).iter().map(|value| value * 2.0).collect();
        for (reference_at, lag_s) in [(5, 2.0), (7, 0.0), (10, -3.0)] {
            let both = [series("m", &doubled), series("m", &pulse(reference_at))];
            assert_eq!(verdict(&response("lag", "s", ""), &both).unwrap().values, [lag_s]);
            let lag = verdict(&response("lag", "ms", ""), &both).unwrap();
            assert_eq!((lag.values[0], lag.passed), (lag_s * 1000.0, lag_s > -2.5));
            assert!((verdict(&response("gain", "1", ""), &both).unwrap().values[0] - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_span_is_that_of_the_field_and_a_slower_reference_is_held() {
        let lag = response("lag", "s", "from_s = 1.0\nto_s = 18.0");
        let slow = pulse(6).into_iter().step_by(2).collect::<Vec<_>>();
        let mut slow = series("m", &slow);
        slow.time_ns.iter_mut().for_each(|time_ns| *time_ns *= 2);
        assert_eq!(verdict(&lag, &[series("m", &pulse(9)), slow]).unwrap().values, [2.0]);
    }

    #[test]
    fn a_lag_that_nothing_tells_fails_and_says_why() {
        let constant = [series("m", &pulse(9)), series("m", &[1.0; 20])];
        let verdict_of = |both: &[Series]| verdict(&response("lag", "s", ""), both);
        let judged = verdict_of(&constant).unwrap();
        assert!(!judged.passed && judged.values.is_empty());
        let text = judged.to_string();
        assert!(text.contains("FAILED c: no value: the reference is constant"), "{text}");
        let other = [series("m", &pulse(9)), series("rad", &pulse(9))];
        let error = verdict_of(&other).unwrap_err().to_string();
        assert!(
            error.contains("`c`") && error.contains("`m`") && error.contains("`p` of /b, in `rad`"),
            "{error}"
        );
    }

    #[test]
    fn a_gate_that_never_opens_fails() {
        let gated = condition("while = { topic = \"/g\", field = \"s\", min = 1 }");
        assert!(!verdict(&gated, &[series("m", &[1.0]), series("1", &[0.0])]).unwrap().passed);
    }

    #[test]
    fn a_nan_among_the_samples_is_not_hidden() {
        assert!(statistic(Statistic::Max, [1.0, f64::NAN, 2.0].into_iter())[0].is_nan());
        assert_eq!(statistic(Statistic::Every, [3.0, 1.0].into_iter()), [1.0, 3.0]);
        assert!(statistic(Statistic::Every, std::iter::empty()).is_empty());
        assert_eq!(statistic(Statistic::Span, [3.0, -1.0, 2.0].into_iter()), [4.0]);
        assert!(statistic(Statistic::Span, [1.0, f64::NAN].into_iter())[0].is_nan());
    }
}
