//! Exchange of two accepted effects for one with fewer parameters that predicts as well.
//!
//! Two effects together can stand for a third: less thrust in hover and a steeper command map for more mass. Where the
//! model lacks something else, the equations may favour the two, which bend where the one cannot. Then the one has been
//! accepted and given up, and nothing brings it back. Of two models that predict as well, the one with fewer parameters
//! is taken (parsimony: Ljung, System Identification, 2nd ed., section 16.8).

use crate::model::problem::Problem;
use crate::search::candidate::{Candidate, free_parameters, with};
use crate::search::fit_result::FitResult;
use crate::search::judgement::fitted;
use rayon::prelude::*;

/// An exchange with so many times the squared error of the equations is not predicted with; tuned, no source.
const MUCH_WORSE: f64 = 1.5;
/// Number of exchanges that are predicted with at most.
const TRIED: usize = 6;

/// One effect for two.
#[derive(Debug, Clone)]
pub struct Exchange {
    /// The effect with fewer parameters.
    pub new: Candidate,
    /// Names of the two that it stands for.
    pub old: [&'static str; 2],
    /// The accepted candidates of these two.
    pub dropped: Vec<Candidate>,
    /// The accepted candidates after it.
    pub accepted: Vec<Candidate>,
    /// Their fit.
    pub fitted: FitResult,
}

impl Exchange {
    /// True if the search goes on without `candidate`. Other parts of the two effects, such as other rotors, stay open.
    pub fn closes(&self, candidate: &Candidate) -> bool {
        self.dropped.contains(candidate)
    }
}

/// The exchanges of two of `accepted` for one of `given_up` that the validation data do not rule out: those that spare
/// most parameters first, of these those that explain most. Candidates of `kept` stay.
pub fn exchanges(
    problem: &Problem,
    (accepted, base): (&[Candidate], &FitResult),
    given_up: &[Candidate],
    kept: &[Candidate],
) -> Vec<Exchange> {
    let pairs = pairs(accepted);
    let new = given_up.iter().filter(|candidate| !candidate.is_in(accepted));
    let all: Vec<(&Candidate, [&'static str; 2])> =
        new.flat_map(|new| pairs.iter().map(move |old| (new, *old))).collect();
    let fit =
        |(new, old): (&Candidate, [&'static str; 2])| exchange(problem, (accepted, base), new, old, kept);
    let mut found: Vec<Exchange> = all.into_par_iter().filter_map(fit).collect();
    found.retain(|exchange| exchange.fitted.validation_cost() < MUCH_WORSE * base.validation_cost());
    let by_cost = |a: &FitResult, b: &FitResult| a.validation_cost().total_cmp(&b.validation_cost());
    found.sort_by(|a, b| {
        let fewest = a.fitted.free.len().cmp(&b.fitted.free.len());
        fewest.then_with(|| by_cost(&a.fitted, &b.fitted))
    });
    found.truncate(TRIED);
    found
}

/// Names of each two of the effects.
fn pairs(accepted: &[Candidate]) -> Vec<[&'static str; 2]> {
    let mut names: Vec<&'static str> = accepted.iter().map(|candidate| candidate.kind.name).collect();
    names.sort_unstable();
    names.dedup();
    let later = |at: usize| names[at + 1..].iter().map(move |other| (at, *other));
    (0..names.len()).flat_map(later).map(|(at, other)| [names[at], other]).collect()
}

/// The exchange of the effects `old` for `new`; `None` if it spares no parameter.
fn exchange(
    problem: &Problem,
    (accepted, base): (&[Candidate], &FitResult),
    new: &Candidate,
    old: [&'static str; 2],
    kept: &[Candidate],
) -> Option<Exchange> {
    // Reports name effects, not their parts: an effect would be named instead of itself.
    if old.contains(&new.kind.name) {
        return None;
    }
    let is_old = |candidate: &Candidate| old.contains(&candidate.kind.name);
    let (dropped, others): (Vec<Candidate>, Vec<Candidate>) = accepted.iter().cloned().partition(is_old);
    let after = with(&others, new);
    let left: Vec<Candidate> = accepted.iter().filter(|one| !after.contains(one)).cloned().collect();
    let is_smaller = free_parameters(&after).len() < free_parameters(accepted).len();
    if !is_smaller || left.iter().any(|candidate| kept.contains(candidate)) {
        return None;
    }
    let mut values = base.values.clone();
    free_parameters(&left).iter().for_each(|at| values[*at] = problem.model.parameters.all[*at].baseline);
    let stay: Vec<Candidate> = after.iter().filter(|one| *one != new).cloned().collect();
    let without = problem.fitted(&values, &free_parameters(&stay));
    let fitted = fitted(problem, &without, &stay, new);
    Some(Exchange { new: new.clone(), old, dropped, accepted: after, fitted })
}

#[allow(clippy::disallowed_types, reason = "not in a component: numbers of a report's test")]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::prepared::{Prepared, Propulsion};
    use crate::model::parameter::Parameters;
    use crate::model::physics::Model;
    use crate::model::whitening::Noises;
    use crate::test_flights::{candidate, flown, hummingbird};
    use flights::Flight;

    /// A vehicle that sinks as one does whose rotors turn at the declared speed of hover, and that has 8 % more mass.
    fn heavy() -> Flight {
        let sinking_m_s2 = 9.81 * (1.0 - 1.0 / 1.08);
        flown(
            [8.0, 0.01],
            |t| [0.05 * libm::sin(7.0 * t), 0.05 * libm::cos(5.0 * t), 400.0 - 0.5 * sinking_m_s2 * t * t],
            |t| [0.01 * libm::sin(3.0 * t), 0.01 * libm::cos(4.0 * t), 0.0],
        )
    }

    fn problem(flight: &Flight) -> Problem<'_> {
        let vehicle = hummingbird();
        let prepared = Prepared::new(flight, None, &Propulsion::of(&vehicle)).expect("a usable flight");
        let mut problem = Problem {
            model: Model { parameters: Parameters::of(&vehicle, &[]), vehicle },
            estimation: vec![prepared],
            validation: Vec::new(),
            test: Vec::new(),
            noises: Noises::new(),
            block_s: 1.0,
            shared_late_s: 0.0,
        };
        let declared = problem.fitted(&problem.model.parameters.baseline(), &[]);
        problem.weigh(&declared, &[candidate(&problem, "mass-error")]);
        problem
    }

    #[test]
    fn a_mass_that_was_given_up_stands_for_thrust_and_inertia() {
        let flight = heavy();
        let problem = problem(&flight);
        let [thrust, inertia, mass] =
            ["thrust-scale", "inertia-error", "mass-error"].map(|effect| candidate(&problem, effect));
        let accepted = [thrust, inertia.clone()];
        let base = problem.fitted(&problem.model.parameters.baseline(), &free_parameters(&accepted));
        let found = exchanges(&problem, (&accepted, &base), std::slice::from_ref(&mass), &[]);
        let names = |exchange: &Exchange| (exchange.new.kind.name, exchange.old, exchange.accepted.len());
        let told: Vec<_> = found.iter().map(names).collect();
        assert_eq!(told, [("mass-error", ["inertia-error", "thrust-scale"], 1)]);
        let error = found[0].fitted.values[mass.free[0]];
        assert!((error - 0.08).abs() < 0.01, "{error}");
        let kept = exchanges(&problem, (&accepted, &base), std::slice::from_ref(&mass), &[inertia]);
        assert!(kept.is_empty(), "predictions asked for the inertia: it stays");
    }

    /// The part of an effect with only its parameter number `at`.
    fn part(whole: &Candidate, at: usize) -> Candidate {
        Candidate { kind: whole.kind, free: vec![whole.free[at]] }
    }

    #[test]
    fn an_exchange_closes_the_accepted_parts_of_an_effect_and_no_others() {
        let flight = heavy();
        let problem = problem(&flight);
        let [thrust, weak, mass] =
            ["thrust-scale", "weak-rotor", "mass-error"].map(|effect| candidate(&problem, effect));
        let accepted = [thrust.clone(), part(&weak, 0)];
        let base = problem.fitted(&problem.model.parameters.baseline(), &free_parameters(&accepted));
        let found = exchanges(&problem, (&accepted, &base), std::slice::from_ref(&mass), &[]);
        assert_eq!(found.len(), 1, "{found:?}");
        let is_closed = |candidate: &Candidate| found[0].closes(candidate);
        assert!(is_closed(&thrust) && is_closed(&part(&weak, 0)));
        assert!(!is_closed(&part(&weak, 1)) && !is_closed(&mass));
    }

    /// Four rotors that are weak alike have less thrust.
    #[test]
    fn an_effect_takes_the_place_of_its_accepted_parts() {
        let flight = heavy();
        let problem = problem(&flight);
        let [thrust, inertia, weak] =
            ["thrust-scale", "inertia-error", "weak-rotor"].map(|effect| candidate(&problem, effect));
        let accepted = [part(&weak, 0), thrust, inertia];
        let base = problem.fitted(&problem.model.parameters.baseline(), &free_parameters(&accepted));
        let found = exchanges(&problem, (&accepted, &base), std::slice::from_ref(&weak), &[]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].accepted, std::slice::from_ref(&weak));
        assert_eq!(found[0].fitted.free, weak.free, "no parameter twice");
    }

    #[test]
    fn an_exchange_spares_parameters_and_explains_nearly_as_much() {
        let flight = heavy();
        let problem = problem(&flight);
        let [thrust, weak, mass, drag] = ["thrust-scale", "weak-rotor", "mass-error", "rotor-drag"]
            .map(|effect| candidate(&problem, effect));
        let of_two = |accepted: [&Candidate; 2], new: &Candidate| {
            let accepted = accepted.map(Clone::clone);
            let base = problem.fitted(&problem.model.parameters.baseline(), &free_parameters(&accepted));
            exchanges(&problem, (&accepted, &base), std::slice::from_ref(new), &[]).len()
        };
        assert_eq!(of_two([&mass, &thrust], &drag), 0, "a drag does not sink");
        assert_eq!(of_two([&drag, &thrust], &weak), 0, "as many parameters, or more");
    }
}
