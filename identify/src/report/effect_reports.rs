//! Reports of effects: each candidate as it was judged last, and the accepted ones beside each other.

use crate::model::parameter::Parameter;
use crate::model::problem::Problem;
use crate::report::results::{BeforeAfter, EffectReport, Estimate};
use crate::search::at_limit::limit_touched;
use crate::search::candidate::{Candidate, FAST_COMMANDS, Unidentifiable, free_parameters};
use crate::search::confounded::Rival;
use crate::search::fit_result::FitResult;
use crate::search::judgement::{Way, reached_bound};
use crate::search::logging;
use crate::search::select::Selection;
use plant::effects::EffectKind;
use std::collections::BTreeMap;

/// Predictions ask for another value than the equations beyond so many standard errors of these: far beyond chance, and beyond what
/// intervals that are somewhat short make; tuned, no source.
const FAR: f64 = 8.0;
/// And by more than this part of the greater one: a value that is known to a tenth of a percent may move by a whole one; tuned, no source.
const FAR_PART: f64 = 0.25;

/// The experiment for two effects of which no better one is known.
const OTHER_FLIGHTS: &str =
    "fly manoeuvres in which the two differ: other speeds, rates, heights or loads than in these flights";

/// Names of the accepted effects, without those that the logging of the commands explains.
pub fn accepted(problem: &Problem, selection: &Selection) -> Vec<&'static str> {
    let mut names = Vec::new();
    for candidate in named(problem, selection) {
        if !names.contains(&candidate.kind.name) {
            names.push(candidate.kind.name);
        }
    }
    names
}

/// Accepted candidates that stand for effects.
fn named<'s>(problem: &Problem, selection: &'s Selection) -> impl Iterator<Item = &'s Candidate> {
    let is_logging =
        |candidate: &&Candidate| logging::explained_lead_s(problem, candidate, &selection.after).is_some();
    let named: Vec<&Candidate> =
        selection.accepted.iter().filter(|candidate| !is_logging(candidate)).collect();
    named.into_iter()
}

/// The candidates as the last round that judged them left them.
pub fn judged(problem: &Problem, selection: &Selection) -> BTreeMap<&'static str, EffectReport> {
    let mut effects: BTreeMap<&'static str, EffectReport> = BTreeMap::new();
    for round in &selection.rounds {
        let mut of_round: BTreeMap<&'static str, EffectReport> = BTreeMap::new();
        for judged in &round.judged {
            let after = judged.fitted.validation_cost();
            let before = after / (1.0 - judged.gain).max(1e-12);
            let report = EffectReport {
                accepted: false,
                linearised: judged.way != Way::Full,
                parameters: estimates(problem, &judged.fitted, &judged.candidate.free),
                held_out: BeforeAfter { before: size(problem, before), after: size(problem, after) },
                chance: judged.p_value,
                worth: Vec::new(),
                confused_with: Vec::new(),
                experiment: None,
            };
            // Of the parts of an effect the one that gains most.
            let name = judged.candidate.kind.name;
            if of_round.get(name).is_none_or(|other| report.held_out.after < other.held_out.after) {
                of_round.insert(name, report);
            }
        }
        effects.extend(of_round);
    }
    effects
}

/// Adds the accepted effects to `effects`.
pub fn add_accepted(
    problem: &Problem,
    selection: &Selection,
    rivals: &[Vec<Rival>],
    effects: &mut BTreeMap<&'static str, EffectReport>,
) {
    for name in accepted(problem, selection) {
        let indices: Vec<usize> =
            (0..selection.accepted.len()).filter(|at| selection.accepted[*at].kind.name == name).collect();
        let others: Vec<Candidate> =
            selection.accepted.iter().filter(|candidate| candidate.kind.name != name).cloned().collect();
        let mut start = selection.after.values.clone();
        let mut parameters = BTreeMap::new();
        for at in &indices {
            let candidate = &selection.accepted[*at];
            let found = estimates(problem, selection.flown(), &candidate.free);
            let by_equations = |(name, estimate): (&'static str, Estimate)| {
                let at =
                    candidate.free.iter().find(|at| problem.model.parameters.all[**at].spec().name == name);
                let other = at.and_then(|at| far_by_equations(selection, *at));
                (name, Estimate { by_equations: other, ..estimate })
            };
            parameters.extend(found.into_iter().map(by_equations));
            candidate.free.iter().for_each(|at| start[*at] = problem.model.parameters.all[*at].baseline);
        }
        let without = problem.fitted(&start, &free_parameters(&others));
        let mut alike: Vec<&'static EffectKind> =
            indices.iter().flat_map(|at| &rivals[*at]).map(|rival| rival.candidate.kind).collect();
        alike.sort_by_key(|kind| kind.name);
        alike.dedup_by_key(|kind| kind.name);
        let experiment = alike.first().map(|other| {
            let kind = selection.accepted[indices[0]].kind;
            kind.experiment_against(other).unwrap_or(OTHER_FLIGHTS).to_owned()
        });
        let report = EffectReport {
            accepted: true,
            linearised: false,
            parameters,
            held_out: BeforeAfter {
                before: size(problem, without.validation_cost()),
                after: size(problem, selection.after.validation_cost()),
            },
            chance: selection.p_value(name),
            worth: selection.worths.get(name).cloned().unwrap_or_default(),
            confused_with: alike.iter().map(|kind| kind.name).collect(),
            experiment,
        };
        effects.insert(name, report);
    }
}

/// The value of a parameter by the equations, where the refined one is farther than [`FAR`] of its standard errors and [`FAR_PART`] of its size.
fn far_by_equations(selection: &Selection, parameter: usize) -> Option<f64> {
    let value = selection.after.values[parameter];
    let away = (selection.flown().values[parameter] - value).abs();
    let error = selection.after.standard_error(parameter).filter(|error| *error > 0.0)?;
    let size = selection.flown().values[parameter].abs().max(value.abs());
    (away > FAR * error && away > FAR_PART * size).then_some(value)
}

/// Effects of slowly logged commands, with intervals that cover all values that they may have.
/// Adds to `effects` those that slow commands hide.
pub fn add_undetermined(
    problem: &Problem,
    selection: &Selection,
    unidentifiable: &[Unidentifiable],
    effects: &mut BTreeMap<&'static str, EffectReport>,
) {
    let residual = size(problem, selection.after.validation_cost());
    for missing in unidentifiable.iter().filter(|missing| missing.needs == FAST_COMMANDS) {
        let of_effect = problem.model.parameters.all.iter().filter(|entry| entry.kind.name == missing.effect);
        let open = |entry: &Parameter| {
            let (spec, value) = (entry.spec(), entry.baseline);
            let (unit, low, high) = (spec.unit(), spec.min, entry.max);
            (
                spec.name,
                Estimate { value, unit, low, high, at_bound: false, determined: false, by_equations: None },
            )
        };
        let report = EffectReport {
            accepted: false,
            linearised: false,
            parameters: of_effect.map(open).collect(),
            held_out: BeforeAfter { before: residual, after: residual },
            chance: 1.0,
            worth: Vec::new(),
            confused_with: Vec::new(),
            experiment: None,
        };
        effects.entry(missing.effect).or_insert(report);
    }
}

/// The weighted root mean square of a sum of squares of the validation data.
fn size(problem: &Problem, cost: f64) -> f64 {
    (cost / problem.validation_rows() as f64).sqrt()
}

/// The estimates of these parameters, with 95 % intervals. Those of single flights are in [`crate::report::Report::winds`].
#[must_use]
pub fn estimates(problem: &Problem, fitted: &FitResult, free: &[usize]) -> BTreeMap<&'static str, Estimate> {
    let quantile = fitted.t_quantile(0.975);
    let one = |at: &usize| {
        let entry = &problem.model.parameters.all[*at];
        let (value, half) =
            (fitted.values[*at], quantile * fitted.standard_error(*at).unwrap_or(f64::INFINITY));
        // Commands that were logged slowly make it come out too small, which no block of time shows.
        let bias = logging::bias(problem, entry);
        let (low, high) = ((value - half).max(entry.spec().min), (value + half + bias).min(entry.max));
        let at_bound =
            reached_bound(problem, fitted, *at).or_else(|| limit_touched(problem, fitted, *at)).is_some();
        let determined = low > entry.spec().min || high < entry.max;
        let unit = entry.spec().unit();
        (entry.spec().name, Estimate { value, unit, low, high, at_bound, determined, by_equations: None })
    };
    let of_all = free.iter().filter(|at| problem.model.parameters.all[**at].flight.is_none());
    of_all.map(one).collect()
}

#[cfg(test)]
#[allow(clippy::disallowed_types, reason = "not in a component: the covariance of a report's fit")]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn the_value_of_the_equations_is_told_where_predictions_ask_for_another() {
        let fit = |value: f64| FitResult {
            values: vec![value],
            free: vec![0],
            unbounded: vec![value],
            covariance: DMatrix::from_element(1, 1, 0.01),
            validation_costs: Vec::new(),
            estimation_costs: Vec::new(),
        };
        let selection = |refined: Option<f64>| Selection {
            accepted: Vec::new(),
            before: fit(0.0),
            after: fit(1.0),
            refined: refined.map(fit),
            rounds: Vec::new(),
            withdrawn: Vec::new(),
            worths: BTreeMap::new(),
            without_worth: BTreeMap::new(),
            asked: Vec::new(),
            is_stopped: false,
        };
        assert_eq!(far_by_equations(&selection(Some(1.9)), 0), Some(1.0));
        assert_eq!(far_by_equations(&selection(Some(0.3)), 0), None, "seven standard errors");
        assert_eq!(far_by_equations(&selection(None), 0), None);
        let mut sure = selection(Some(1.1));
        sure.after.covariance[(0, 0)] = 1e-6;
        assert_eq!(far_by_equations(&sure, 0), None, "a hundred standard errors, and a tenth of the value");
    }
}
