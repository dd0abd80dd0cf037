//! The result of one flight.

use crate::declaration::{COLUMNS, Varied};
use diagnostics::{Diagnostic, ParameterError};
use report::judge::{Verdict, WindowErrors};
use report::summary::Summary;
use runtime::manifest::{Content, Statistic};
use serde::{Deserialize, Serialize};

/// The result of one flight.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Number of the flight, from 0.
    pub flight: u64,
    /// Drawn numbers of the plan.
    #[serde(default)]
    pub drawn: Vec<f64>,
    /// True if all conditions held.
    pub passed: bool,
    /// Name of the condition that failed first, or the first in the manifest where none has a time.
    pub failed: Option<String>,
    /// Simulation time of its first sample by which it failed, s; of the last sample of its span for a mean, an RMS and the like.
    pub failed_at_s: Option<f64>,
    /// Reason why the flight has no figures: refused values, a failed step, a worker that died.
    pub error: Option<String>,
    /// Verdicts of the conditions and comparisons of the manifest; empty where the flight was not judged.
    #[serde(default)]
    pub verdicts: Vec<bool>,
    /// Figures by column; none where a condition has no value, or it is not a finite number.
    pub figures: Vec<Option<f64>>,
    /// Host time that the flight took, s.
    pub wall_s: f64,
    /// True if the host ended the flight: another attempt may end otherwise, and is made by the next call.
    #[serde(default)]
    pub is_of_host: bool,
}

/// Refuses two columns with one name: `varied` values, `figures` and verdicts, and the columns of every campaign.
///
/// # Errors
/// The varied value whose name is taken, or the name of two conditions.
pub fn require_different(vary: &[Varied], figures: &[String]) -> Result<(), Diagnostic> {
    let is_taken = |name: &str| COLUMNS.contains(&name) || figures.iter().any(|figure| figure == name);
    if let Some(varied) = vary.iter().find(|varied| is_taken(&varied.name)) {
        let message = format!("`{}` is the name of another column of the results", varied.name);
        return Err(varied.problem(ParameterError::conflict("name", message), "give it another `name`"));
    }
    let twice =
        |(index, name): (usize, &String)| figures[..index].contains(name) || COLUMNS.contains(&name.as_str());
    match figures.iter().enumerate().find(|pair| twice(*pair)) {
        None => Ok(()),
        Some((_, name)) => {
            let message = format!("two columns of the results would be called `{name}`");
            Err(Diagnostic::in_file("the conditions of the manifest", message)
                .help("give each condition another `name`"))
        }
    }
}

/// Number of values of a condition with this statistic.
#[must_use]
pub fn count(statistic: Statistic) -> usize {
    if statistic == Statistic::Every { 2 } else { 1 }
}

/// Names of the figures of the conditions in `content`: the columns of [`Row::figures`].
#[must_use]
pub fn columns(content: &Content) -> Vec<String> {
    figures(content).into_iter().map(|(name, _)| name).collect()
}

/// Units of the figures of the conditions in `content`, by column.
#[must_use]
pub fn units(content: &Content) -> Vec<String> {
    figures(content).into_iter().map(|(_, unit)| unit).collect()
}

/// Names and units of the figures.
fn figures(content: &Content) -> Vec<(String, String)> {
    let conditions = content.pass.iter().chain(&content.measure).flat_map(|condition| {
        let condition = condition.get_ref();
        let names: &[&str] =
            if condition.statistic == Statistic::Every { &[" (min)", " (max)"] } else { &[""] };
        let figure = |ending: &&str| (format!("{}{ending}", condition.name), condition.unit.clone());
        names.iter().map(figure).collect::<Vec<_>>()
    });
    let compare = content.compare.iter().flat_map(|compare| {
        let compare = compare.get_ref();
        [("position_rms_m", "m"), ("velocity_rms_m_s", "m/s"), ("attitude_rms_deg", "deg")].map(
            |(name, unit)| {
                (format!("{} after {} s: {name}", compare.simulated, compare.window_s), unit.to_owned())
            },
        )
    });
    conditions.chain(compare).collect()
}

/// Names of the verdicts of the conditions and comparisons in `content`: the columns of [`Row::verdicts`].
#[must_use]
pub fn verdict_columns(content: &Content) -> Vec<String> {
    let conditions = content.pass.iter().map(|condition| condition.get_ref().name.clone());
    let compare = content.compare.iter().map(|compare| {
        let compare = compare.get_ref();
        format!("{} after {} s", compare.simulated, compare.window_s)
    });
    conditions.chain(compare).map(|name| format!("{name} (passed)")).collect()
}

impl Row {
    /// The row of flight number `flight`, whose run has this `summary`.
    #[must_use]
    pub fn of(flight: u64, summary: &Summary, content: &Content) -> Self {
        let conditions =
            content.pass.iter().chain(&content.measure).zip(summary.pass.iter().chain(&summary.measures));
        let mut figures: Vec<Option<f64>> = Vec::new();
        for (condition, verdict) in conditions {
            let count = count(condition.get_ref().statistic);
            let values = verdict.values.iter().map(|value| Some(*value).filter(|value| value.is_finite()));
            figures.extend(values.chain(std::iter::repeat(None)).take(count));
        }
        for errors in &summary.compare {
            let errors = [errors.position_rms_m, errors.velocity_rms_m_s, errors.attitude_rms_deg];
            figures.extend(errors.map(|error| Some(error).filter(|error| error.is_finite())));
        }
        let (failed, failed_at_s) = first_failure(&summary.pass, &summary.compare);
        let (passed, wall_s) = (summary.passed, summary.host_s);
        let conditions = summary.pass.iter().map(|verdict| verdict.passed);
        let verdicts = conditions.chain(summary.compare.iter().map(|errors| errors.passed)).collect();
        let (drawn, error, is_of_host) = (Vec::new(), None, false);
        Self { flight, drawn, passed, failed, failed_at_s, error, verdicts, figures, wall_s, is_of_host }
    }

    /// The row of a flight that the host ended.
    #[must_use]
    pub fn ended(flight: u64, error: String) -> Self {
        Self { is_of_host: true, ..Self::broken(flight, error) }
    }

    /// The row of a flight that was not flown to its end.
    #[must_use]
    pub fn broken(flight: u64, error: String) -> Self {
        Self { flight, error: Some(error), ..Self::default() }
    }
}

/// The condition that failed first, and when. A condition without samples has no time, and a comparison neither: they come last.
fn first_failure(pass: &[Verdict], compare: &[WindowErrors]) -> (Option<String>, Option<f64>) {
    let failed = pass.iter().filter(|verdict| !verdict.passed);
    let at = |verdict: &&Verdict| verdict.failed_at_s.unwrap_or(f64::INFINITY);
    let Some(first) = failed.min_by(|a, b| at(a).total_cmp(&at(b))) else {
        let compared = compare.iter().find(|errors| !errors.passed);
        return (compared.map(|errors| format!("{} after {} s", errors.simulated, errors.window_s)), None);
    };
    (Some(first.name.clone()), first.failed_at_s)
}

#[cfg(test)]
mod tests {
    use super::first_failure;
    use report::judge::Verdict;

    #[test]
    fn a_mean_fails_at_the_end_of_its_span_and_may_be_the_first() {
        let failed =
            |name: &str, failed_at_s| Verdict { name: name.to_owned(), failed_at_s, ..Verdict::default() };
        // The mean of the climb, to 5 s, and an altitude that is left later.
        let found = first_failure(&[failed("altitude", Some(9.0)), failed("mean", Some(5.0))], &[]);
        assert_eq!(found, (Some("mean".to_owned()), Some(5.0)));
        let found = first_failure(&[failed("without samples", None), failed("mean", Some(5.0))], &[]);
        assert_eq!(found, (Some("mean".to_owned()), Some(5.0)));
    }
}
