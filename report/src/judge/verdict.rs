//! Verdicts: figures against their limits, and their lines of the summary.

use super::figures::{Found, WindowFigures};
use anyhow::{Result, bail};
use runtime::manifest::{Comparison, PassCondition};
use serde::Serialize;
use std::fmt;

/// A pass condition and how it came out, or a measure, which has no limits; its text is a line of the summary.
///
/// ```
/// use report::judge::Verdict;
/// let (name, unit) = ("altitude".to_owned(), "m".to_owned());
/// let values = vec![1.49, 1.51];
/// let (min, max) = (Some(1.4), Some(1.6));
/// let verdict = Verdict { name, values, unit, min, max, passed: true, ..Verdict::default() };
/// assert_eq!(verdict.to_string(), "  ok     altitude: 1.4900 … 1.5100 m (1.4 … 1.6)");
/// ```
#[derive(Debug, Default, Serialize)]
pub struct Verdict {
    /// Meaning of the condition.
    pub name: String,
    /// The values compared with the limits: one, or the smallest and the largest.
    pub values: Vec<f64>,
    /// Their unit.
    pub unit: String,
    /// Lower limit.
    pub min: Option<f64>,
    /// Upper limit.
    pub max: Option<f64>,
    /// True if it held.
    pub passed: bool,
    /// Reason why there are no values, if it is more than a lack of samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// Simulation time of the first sample by which it failed; of the last sample of its span for a mean, an RMS and the like.
    /// `None` if there is no sample.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failed_at_s: Option<f64>,
    /// True if no sample alone made it fail, so that `failed_at_s` is the time of the last one.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub failed_at_end: bool,
    /// The tick at that time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failed_at_tick: Option<u32>,
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
///     max_position_m: Some(0.01),
///     max_velocity_m_s: None,
///     max_attitude_deg: Some(3.0),
///     passed: false,
/// };
/// let text = "position 0.0120 m (at most 0.01), velocity 0.1000 m/s, attitude 2.500 deg (at most 3)";
/// assert_eq!(errors.to_string(), format!("  FAILED /plant/state after 0.5 s (RMS over 8 windows): {text}"));
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
    /// Upper limit of the position error.
    pub max_position_m: Option<f64>,
    /// Upper limit of the velocity error.
    pub max_velocity_m_s: Option<f64>,
    /// Upper limit of the attitude error.
    pub max_attitude_deg: Option<f64>,
    /// True if all limits held.
    pub passed: bool,
}

impl Verdict {
    /// The verdict on `pass`, of whose samples this was found.
    pub(crate) fn of(pass: &PassCondition, found: &Found) -> Self {
        let PassCondition { name, unit, min, max, .. } = pass;
        let Found { values, why, lost_s, last_s } = found.clone();
        // A span without samples fails: samples that were never there did not pass.
        let passed = !values.is_empty() && values.iter().all(|value| within(*value, *min, *max));
        let failed_at_s = lost_s.or(last_s).filter(|_| !passed);
        let failed_at_end = failed_at_s.is_some() && lost_s.is_none();
        Self {
            name: name.clone(),
            values,
            unit: unit.clone(),
            min: *min,
            max: *max,
            passed,
            why,
            failed_at_s,
            failed_at_end,
            failed_at_tick: None,
        }
    }

    /// The same verdict, with the tick of its failure in a run with ticks of `tick_s`.
    pub(crate) fn in_ticks_of(self, tick_s: f64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a tick of the run")]
        let failed_at_tick = self.failed_at_s.map(|at_s| (at_s / tick_s).round() as u32);
        Self { failed_at_tick, ..self }
    }
}

impl WindowErrors {
    /// The errors of `compare`, at the ends of whose windows this was found.
    ///
    /// # Errors
    /// If both states have no sample at the end of a window.
    pub(crate) fn of(compare: &Comparison, found: &WindowFigures) -> Result<Self> {
        let Comparison { simulated, measured, window_s, .. } = compare;
        let Comparison { max_position_m, max_velocity_m_s, max_attitude_deg, .. } = *compare;
        let WindowFigures { windows, position_rms_m, velocity_rms_m_s, attitude_rms_deg } = *found;
        if windows == 0 {
            bail!("{simulated} and {measured} have no common sample at the end of a window of {window_s} s");
        }
        let passed = within(position_rms_m, None, max_position_m)
            && within(velocity_rms_m_s, None, max_velocity_m_s)
            && within(attitude_rms_deg, None, max_attitude_deg);
        Ok(Self {
            simulated: simulated.clone(),
            window_s: *window_s,
            windows: windows as usize,
            position_rms_m,
            velocity_rms_m_s,
            attitude_rms_deg,
            max_position_m,
            max_velocity_m_s,
            max_attitude_deg,
            passed,
        })
    }

    /// Upper limits of position, velocity and attitude.
    fn limits(&self) -> [Option<f64>; 3] {
        [self.max_position_m, self.max_velocity_m_s, self.max_attitude_deg]
    }

    /// True if a limit judges these errors.
    pub(crate) fn has_limits(&self) -> bool {
        self.limits().iter().any(Option::is_some)
    }
}

/// True if `value` is a number between the limits that there are.
pub(crate) fn within(value: f64, min: Option<f64>, max: Option<f64>) -> bool {
    !value.is_nan() && min.is_none_or(|min| value >= min) && max.is_none_or(|max| value <= max)
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
        let tick = self.failed_at_tick.map_or(String::new(), |tick| format!(", tick {tick}"));
        let at = if self.failed_at_end { "at the end of its span," } else { "first at" };
        let at = self.failed_at_s.map_or(String::new(), |at_s| format!(", {at} {at_s:.3} s{tick}"));
        write!(f, "  {mark} {}: {values}{unit} ({limit}){at}", self.name)
    }
}

/// Four digits behind the point, or four that are not zero; whole numbers without any.
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
        let limits = self.limits();
        let mark = match (self.has_limits(), self.passed) {
            (_, false) => "FAILED",
            (true, true) => "ok    ",
            (false, true) => "value ",
        };
        let [position, velocity, attitude] =
            limits.map(|limit| limit.map_or(String::new(), |limit| format!(" (at most {limit})")));
        write!(
            f,
            "  {mark} {simulated} after {window_s} s (RMS over {windows} windows): position {position_rms_m:.4} m{position}, \
             velocity {velocity_rms_m_s:.4} m/s{velocity}, attitude {attitude_rms_deg:.3} deg{attitude}"
        )
    }
}
