//! Estimates at the limit of their meaning: an interval that ends at a limit gives a bound, and not a value.
//!
//! Rotors have angular momentum: a `gyroscopic-torque` of -1 says that another torque cancels theirs. A wind of 24 m/s that may as well be 6 or
//! 30 m/s is no measurement of a wind. Such an effect stays in the fit, since predictions may need it, and gets no name.

use crate::model::problem::Problem;
use crate::numbers::digits::{quantity, rounded};
use crate::search::candidate::Candidate;
use crate::search::fit_result::FitResult;
use std::collections::BTreeMap;

/// The `accepted` effects of which every parameter that differs from its baseline touches a limit, each with the reason.
pub fn at_limits(
    problem: &Problem,
    accepted: &[Candidate],
    fitted: &FitResult,
) -> BTreeMap<&'static str, String> {
    let mut parameters: BTreeMap<&'static str, Vec<usize>> = BTreeMap::new();
    for candidate in accepted {
        let of_all = candidate.free.iter().filter(|at| problem.model.parameters.all[**at].flight.is_none());
        parameters.entry(candidate.kind.name).or_default().extend(of_all);
    }
    let found = |(name, free): (&'static str, Vec<usize>)| {
        let mut shown = free.into_iter().filter(|at| is_shown(problem, fitted, *at)).peekable();
        let first = *shown.peek()?;
        let reason = reason(problem, fitted, first)?;
        shown.all(|at| limit_touched(problem, fitted, at).is_some()).then_some((name, reason))
    };
    parameters.into_iter().filter_map(found).collect()
}

/// The limit that an estimate or an end of its 95 % interval touches; `None` where the interval holds the baseline, too: then the parameter
/// shows nothing by itself.
pub fn limit_touched(problem: &Problem, fitted: &FitResult, at: usize) -> Option<f64> {
    let (entry, value) = (&problem.model.parameters.all[at], fitted.values[at]);
    let limit = entry.limit_ahead(value).filter(|_| is_shown(problem, fitted, at))?;
    ((limit - value).abs() <= half_width(fitted, at) + entry.reach()).then_some(limit)
}

/// True if the 95 % interval of a parameter does not hold its baseline.
fn is_shown(problem: &Problem, fitted: &FitResult, at: usize) -> bool {
    (fitted.values[at] - problem.model.parameters.all[at].baseline).abs() > half_width(fitted, at)
}

/// Half of the 95 % interval; infinite where the parameter was held.
fn half_width(fitted: &FitResult, at: usize) -> f64 {
    fitted.t_quantile(0.975) * fitted.standard_error(at).unwrap_or(f64::INFINITY)
}

/// The reason why a parameter is no finding, as a sentence.
fn reason(problem: &Problem, fitted: &FitResult, at: usize) -> Option<String> {
    let limit = limit_touched(problem, fitted, at)?;
    let (entry, value, half) = (&problem.model.parameters.all[at], fitted.values[at], half_width(fitted, at));
    let spec = entry.spec();
    let [low, high] = [value - half, value + half].map(|end| rounded(entry.bounded(end)));
    let [value, limit] = [value, limit].map(|value| quantity(value, spec.unit()));
    Some(format!(
        "{} = {value} (95 %: {low} ... {high}) touches its limit of {limit}: the flights bound it, and give no value",
        spec.name
    ))
}

#[allow(clippy::disallowed_types, reason = "not in a component: the covariance of a report's fit")]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::parameter::Parameters;
    use crate::model::physics::Model;
    use crate::model::whitening::Noises;
    use crate::test_flights::{candidate, hummingbird};
    use nalgebra::{DMatrix, DVector};
    use plant::effects::Effect;

    /// The finding of [`at_limits`] where the parameters of `effect` are estimated as `estimates`, each with its standard error.
    fn finding<const N: usize>(
        declared: &[Effect],
        effect: &str,
        estimates: [[f64; 2]; N],
    ) -> BTreeMap<&'static str, String> {
        let vehicle = hummingbird();
        let problem = Problem {
            model: Model { parameters: Parameters::of(&vehicle, declared), vehicle },
            estimation: Vec::new(),
            validation: Vec::new(),
            test: Vec::new(),
            noises: Noises::new(),
            block_s: 1.0,
            shared_late_s: 0.0,
        };
        let candidate = candidate(&problem, effect);
        assert_eq!(candidate.free.len(), N, "parameters of {effect}");
        let mut values = problem.model.parameters.baseline();
        candidate.free.iter().zip(estimates).for_each(|(at, [value, _])| values[*at] = value);
        let variances = estimates.map(|[_, error]| error * error);
        let fitted = FitResult {
            unbounded: candidate.free.iter().map(|at| values[*at]).collect(),
            values,
            free: candidate.free.clone(),
            covariance: DMatrix::from_diagonal(&DVector::from_column_slice(&variances)),
            validation_costs: Vec::new(),
            estimation_costs: vec![1.0; 50],
        };
        at_limits(&problem, &[candidate], &fitted)
    }

    #[test]
    fn rotors_without_angular_momentum_are_no_finding() {
        let rotors = |value: f64, error: f64| finding(&[], "gyroscopic-torque", [[value, error]]);
        let reason = &rotors(-1.0, 0.02)["gyroscopic-torque"];
        let expected = "scale_error = -1.000 (95 %: -1.000 ... -0.9598) touches its limit of -1.000";
        assert!(reason.starts_with(expected), "{reason}");
        assert!(!rotors(-0.999, 1e-4).is_empty(), "within a hundredth of a plausible change");
        assert!(!rotors(-0.9, 0.06).is_empty(), "an end of the interval");
        assert!(rotors(-0.7, 0.06).is_empty(), "the limit is far from the interval");
        assert!(rotors(-0.9, 0.6).is_empty(), "the interval holds the declared value");
        assert!(!rotors(3.5, 0.3).is_empty(), "the upper limit");
    }

    #[test]
    fn a_wind_that_may_be_any_is_no_finding_and_one_unknown_part_of_a_wind_does_not_matter() {
        let wind = |x: [f64; 2], z: [f64; 2]| finding(&[], "wind", [x, [0.0, 0.5], z]);
        assert!(wind([24.0, 9.0], [0.0, 0.5])["wind"].starts_with("x = 24.00 m/s"));
        assert!(wind([3.0, 0.5], [0.0, 20.0]).is_empty(), "z shows nothing");
        assert!(wind([3.0, 0.5], [25.0, 5.0]).is_empty(), "x is a finding");
    }

    /// No drag and a rotor without thrust are states of a vehicle, and not limits of a meaning.
    #[test]
    fn the_absence_of_a_declared_effect_and_a_whole_share_are_findings() {
        let drag = plant::effects::find("rotor-drag").expect("an effect").with(|_| 8e-5);
        assert!(finding(&[drag], "rotor-drag", [[0.0, 1e-6]]).is_empty());
        let sound = [0.0, 0.01];
        assert!(finding(&[], "weak-rotor", [[1.0, 0.01], sound, sound, sound]).is_empty());
    }
}
