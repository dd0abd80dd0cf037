//! Judgement of a candidate: its fit beside what was accepted before, and whether that is an effect.

use crate::model::flight_wind::FLIGHT_WIND;
use crate::model::problem::Problem;
use crate::model::sensor_effects::{IMU_DELAY, POSE_DELAY};
use crate::numbers::digits::quantity;
use crate::numbers::statistics::{chance_of_no_gain, fisher_tail};
use crate::search::candidate::{Candidate, free_parameters, has_third_clock};
use crate::search::fit_result::FitResult;
use crate::search::logging;
use crate::search::wind_start;

/// A smaller part of the squared error does not matter, however certain it is: the comparison's own error at its
/// joints is of the order of a tenth of it.
const LEAST_GAIN: f64 = 0.002;
/// Chance of a false acceptance in a round.
pub const FALSE_RATE: f64 = 0.01;
/// A smaller part of a plausible value is not worth naming.
const LEAST_PART: f64 = 0.01;
/// Winds of flights that differ from their mean by less are one wind: trims pass for as much; tuned, no source.
const LEAST_WIND_M_S: f64 = 0.3;
/// A bound that is passed by a smaller part of a plausible change is not passed: what the model lacks elsewhere moves estimates by as much.
const BEYOND_PART: f64 = 0.1;
/// Two candidates whose difference is within this one-sided level cannot be told apart.
const CONFOUNDED_LEVEL: f64 = 0.05;
/// Level at which an effect is kept without a fit, where the equations promise a loss without it.
const CLEARLY_WORSE: f64 = 0.001;

/// The way to a candidate's fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// A step by the linearised equations.
    Promise,
    /// Steps with the derivatives of another point.
    Near,
    /// A fit in full.
    Full,
}

/// A candidate that was fitted and judged.
#[derive(Debug, Clone)]
pub struct Judged {
    /// The candidate.
    pub candidate: Candidate,
    /// The fit of it and of what was accepted before.
    pub fitted: FitResult,
    /// Gain on the validation data as a part of their squared error.
    pub gain: f64,
    /// Chance of as much without the effect.
    pub p_value: f64,
    /// True if it was accepted.
    pub is_accepted: bool,
    /// True if it would be, but for the logging of the commands, which explains it.
    pub is_logging: bool,
    /// The way to `fitted`.
    pub way: Way,
}

/// The fit of `accepted` but that at `at`, from `base` on.
pub fn without(problem: &Problem, base: &FitResult, accepted: &[Candidate], at: usize) -> FitResult {
    let mut others = accepted.to_vec();
    let dropped = others.remove(at);
    let mut start = base.values.clone();
    dropped.free.iter().for_each(|at| start[*at] = problem.model.parameters.all[*at].baseline);
    problem.fitted(&start, &free_parameters(&others))
}

/// A candidate with its fit, judged at `level`.
pub fn judged(
    problem: &Problem,
    base: &FitResult,
    candidate: &Candidate,
    fitted: FitResult,
    level: f64,
) -> Judged {
    let gain = base.validation_cost() - fitted.validation_cost();
    let p_value = p_value(&base.validation_costs, &fitted.validation_costs);
    let joint_p_value = joint_p_value(problem, &fitted, candidate);
    let is_real = p_value < level
        && joint_p_value < level
        && gain > LEAST_GAIN * base.validation_cost()
        && is_seen(problem, candidate, &fitted)
        && !is_delay_of_commands(problem, candidate, &fitted)
        && !is_beyond_bounds(problem, candidate, &fitted)
        && !drives_to_bound(problem, base, candidate, &fitted);
    let is_logging =
        is_real && logging::explained_lag_s(problem, candidate.kind, &candidate.free, &fitted).is_some();
    let (candidate, gain) = (candidate.clone(), gain / base.validation_cost());
    Judged {
        candidate,
        fitted,
        gain,
        p_value,
        is_accepted: is_real && !is_logging,
        is_logging,
        way: Way::Full,
    }
}

/// True if one of its parameters is too large to be an artefact of the grid: a delay of more than half a step,
/// or another parameter of more than [`LEAST_PART`] of a plausible change.
fn is_seen(problem: &Problem, candidate: &Candidate, fitted: &FitResult) -> bool {
    if *candidate.kind == FLIGHT_WIND {
        return wind_start::greatest_m_s(&problem.model.parameters, &fitted.values) > LEAST_WIND_M_S;
    }
    candidate.free.iter().any(|at| {
        let entry = &problem.model.parameters.all[*at];
        let least = if entry.kind.is_delay { problem.least_delay_s() } else { LEAST_PART * entry.scale };
        (fitted.values[*at] - entry.baseline).abs() > least
    })
}

/// True if the inertial unit is late and no third clock exists. Only the sum of both delays shows then, and `command-delay` is its name.
/// Commands have no negative delay, so an early inertial unit keeps its name.
fn is_delay_of_commands(problem: &Problem, candidate: &Candidate, fitted: &FitResult) -> bool {
    let is_late = || candidate.free.iter().any(|at| fitted.values[*at] > 0.0);
    *candidate.kind == IMU_DELAY && is_late() && !problem.flights().any(has_third_clock)
}

/// True if every parameter that moved stopped at a bound: the flights ask for more than the effect can be, so another
/// effect is at work.
#[allow(clippy::float_cmp, reason = "a value that did not move is the baseline")]
fn is_beyond_bounds(problem: &Problem, candidate: &Candidate, fitted: &FitResult) -> bool {
    candidate.free.iter().all(|at| {
        let baseline = problem.model.parameters.all[*at].baseline;
        fitted.values[*at] == baseline || is_stopped(problem, fitted, *at)
    })
}

/// True if a parameter stopped at a bound other than its baseline, and the equations ask for more by more than chance. One that is in truth what its bound is (rotors
/// without any angular momentum) is as often beyond it as within.
fn is_stopped(problem: &Problem, fitted: &FitResult, at: usize) -> bool {
    let (entry, value) = (&problem.model.parameters.all[at], fitted.values[at]);
    let beyond = fitted.unbounded(at).map_or(f64::INFINITY, |asked| (asked - value).abs());
    let by_chance = fitted.t_quantile(0.975) * fitted.standard_error(at).unwrap_or(0.0);
    entry.stops_at(value) && beyond > by_chance.max(BEYOND_PART * entry.scale)
}

/// True if a parameter of an effect that was accepted before stops at a bound only beside this one. Then the
/// two are nearly the same together (mass, thrust and inertia all greater by one part). An effect that is
/// neither of them drives both.
fn drives_to_bound(problem: &Problem, base: &FitResult, candidate: &Candidate, fitted: &FitResult) -> bool {
    let others = fitted.free.iter().filter(|at| !candidate.free.contains(at));
    others.into_iter().any(|at| is_stopped(problem, fitted, *at) && !is_stopped(problem, base, *at))
}

/// The bound at which an estimate is no finding: a limit of what is plausible, or one that the truth may be and that the equations ask to pass by more
/// than chance.
pub fn reached_bound(problem: &Problem, fitted: &FitResult, at: usize) -> Option<f64> {
    let (entry, value) = (&problem.model.parameters.all[at], fitted.values[at]);
    entry.reached(value).or_else(|| is_stopped(problem, fitted, at).then_some(value))
}

/// The first parameter that reached a bound, of those that the flights determine, as a sentence.
pub fn at_bound(problem: &Problem, candidate: &Candidate, fitted: &FitResult) -> Option<String> {
    candidate.free.iter().find_map(|at| {
        let spec = problem.model.parameters.all[*at].spec();
        let bound = reached_bound(problem, fitted, *at).filter(|_| is_determined(problem, fitted, *at))?;
        Some(format!("{} reached its bound of {}: no name is given", spec.name, quantity(bound, spec.unit())))
    })
}

/// True if the interval of a parameter does not cover all values that it may have.
fn is_determined(problem: &Problem, fitted: &FitResult, at: usize) -> bool {
    let (entry, value) = (&problem.model.parameters.all[at], fitted.values[at]);
    let half = fitted.t_quantile(0.975) * fitted.standard_error(at).unwrap_or(f64::INFINITY);
    value - half > entry.spec().min || value + half < entry.max
}

/// The fit with parameters held at their baselines. A parameter is held if it reached a limit of what is
/// plausible, and its effect has another parameter. The flights have to be explained as well without it.
pub fn held_at_limits(problem: &Problem, mut fitted: FitResult) -> FitResult {
    let all = &problem.model.parameters.all;
    let is_reached = |at: &usize| all[*at].reached(fitted.values[*at]).is_some();
    let reached: Vec<usize> = fitted.free.iter().copied().filter(is_reached).collect();
    for at in reached {
        let others: Vec<usize> = fitted.free.iter().copied().filter(|other| *other != at).collect();
        if !others.iter().any(|other| all[*other].kind == all[at].kind) {
            continue;
        }
        let mut start = fitted.values.clone();
        start[at] = all[at].baseline;
        let held = problem.fitted(&start, &others);
        if !is_worse(&held, &fitted) {
            fitted = held;
        }
    }
    fitted
}

/// The candidate's parameters fitted together with the accepted ones, from the best of its starts.
pub fn fitted(
    problem: &Problem,
    base: &FitResult,
    accepted: &[Candidate],
    candidate: &Candidate,
) -> FitResult {
    let all = [candidate.beside(accepted), candidate.free.clone()].concat();
    problem.fitted(&start(problem, base, candidate).0, &all)
}

/// The same from the values that a promise led to, if they are better than all other starts.
pub fn fitted_from(
    problem: &Problem,
    base: &FitResult,
    accepted: &[Candidate],
    candidate: &Candidate,
    promised: &[f64],
) -> FitResult {
    let all = [candidate.beside(accepted), candidate.free.clone()].concat();
    problem.fitted(&start_from(problem, base, candidate, promised), &all)
}

/// The values that a promise led to, if they are better than all other starts.
pub fn start_from(problem: &Problem, base: &FitResult, candidate: &Candidate, promised: &[f64]) -> Vec<f64> {
    let (start, least) = start(problem, base, candidate);
    let cost = problem.costs(&problem.estimation, promised).iter().sum::<f64>();
    if cost < least { promised.to_vec() } else { start }
}

/// The best start of a candidate's fit, and its cost: that of `base` for one that starts at the baseline.
pub fn start(problem: &Problem, base: &FitResult, candidate: &Candidate) -> (Vec<f64>, f64) {
    if *candidate.kind == FLIGHT_WIND {
        return wind_start::start(problem, base);
    }
    let mut start = base.values.clone();
    let mut least = base.estimation_cost();
    let by_clocks: &[f64] = &[problem.shared_late_s];
    let more = (*candidate.kind == POSE_DELAY).then_some(by_clocks);
    for values in candidate.kind.guesses.iter().copied().chain(more) {
        let mut tried = base.values.clone();
        for at in &candidate.free {
            let guess = values.get(problem.model.parameters.all[*at].guess());
            tried[*at] = guess.copied().unwrap_or(tried[*at]);
        }
        let cost = problem.costs(&problem.estimation, &tried).iter().sum::<f64>();
        // The parts of a product have no slope at zero, so some other start is taken in any case.
        if cost < least || (start == base.values && candidate.free.len() > 1) {
            (start, least) = (tried, cost.min(least));
        }
    }
    (start, least)
}

/// Chance that the candidate's parameters are as far from their baselines together if they are there in truth: Wald's test
/// with the jackknife's covariance. Of two that act as a product alone neither is sure by itself. Of the winds of flights the deviations from
/// their mean count.
pub fn joint_p_value(problem: &Problem, fitted: &FitResult, candidate: &Candidate) -> f64 {
    let is_known =
        |at: &usize| fitted.standard_error(*at).is_some_and(|error| error > 0.0 && error.is_finite());
    let all = &problem.model.parameters.all;
    let of_kind = candidate.free.iter().copied().filter(|at| all[*at].kind == candidate.kind);
    let known: Vec<usize> = of_kind.filter(is_known).collect();
    let away: Vec<f64> = known.iter().map(|at| fitted.values[*at] - all[*at].baseline).collect();
    let (blocks, count) = (fitted.estimation_costs.len() as f64, known.len() as f64);
    let wald = fitted.wald(&known, &away);
    if *candidate.kind == FLIGHT_WIND {
        // The covariance of many numbers is itself uncertain: Hotelling's distribution.
        let left = blocks - count;
        return if left < 1.0 {
            1.0
        } else {
            fisher_tail(wald * left / (count * (blocks - 1.0)), count, left)
        };
    }
    fisher_tail(wald / count, count, blocks - 1.0)
}

/// Chance that the mean gain of the blocks from `before` to `after` is not above zero.
pub fn p_value(before: &[f64], after: &[f64]) -> f64 {
    let gains: Vec<f64> = before.iter().zip(after).map(|(before, after)| before - after).collect();
    chance_of_no_gain(&gains)
}

/// True if such costs on the validation data are worse than those of `other` so surely that a fit in full is spared.
pub fn is_clearly_worse(costs: &[f64], other: &FitResult) -> bool {
    p_value(costs, &other.validation_costs) < CLEARLY_WORSE
}

/// True if `fitted` is worse on the validation data than `other`, beyond chance.
pub fn is_worse(fitted: &FitResult, other: &FitResult) -> bool {
    p_value(&fitted.validation_costs, &other.validation_costs) < CONFOUNDED_LEVEL
}

#[allow(clippy::disallowed_types, reason = "not in a component: the covariance of a report's fit")]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::prepared::{Prepared, Propulsion};
    use crate::model::parameter::Parameters;
    use crate::model::physics::Model;
    use crate::model::whitening::Noises;
    use crate::test_flights::{flown, hummingbird};
    use nalgebra::DMatrix;

    fn problem(estimation: Vec<Prepared<'_>>) -> Problem<'_> {
        let vehicle = hummingbird();
        Problem {
            model: Model { parameters: Parameters::of(&vehicle, &[]), vehicle },
            estimation,
            validation: Vec::new(),
            test: Vec::new(),
            noises: Noises::new(),
            block_s: 1.0,
            shared_late_s: 0.0,
        }
    }

    fn place(problem: &Problem, effect: &str, name: &str) -> usize {
        let all = &problem.model.parameters.all;
        let is_wanted = |at: &usize| all[*at].kind.name == effect && all[*at].spec().name == name;
        (0..all.len()).find(is_wanted).expect("a parameter of this name")
    }

    /// The finding of [`at_bound`] where the parameter `name` of `effect` is estimated as `value`, the equations ask for `asked`, and the standard
    /// error is `error`.
    fn finding(effect: &str, name: &str, [value, asked, error]: [f64; 3]) -> Option<String> {
        let problem = problem(Vec::new());
        let all = &problem.model.parameters.all;
        let at = place(&problem, effect, name);
        let mut values = problem.model.parameters.baseline();
        values[at] = value;
        let fitted = FitResult {
            values,
            free: vec![at],
            unbounded: vec![asked],
            covariance: DMatrix::from_element(1, 1, error * error),
            validation_costs: Vec::new(),
            estimation_costs: vec![1.0; 50],
        };
        at_bound(&problem, &Candidate { kind: all[at].kind, free: vec![at] }, &fitted)
    }

    /// The equations may ask for more or not: a limit of what is plausible is no estimate.
    #[test]
    fn an_estimate_at_a_plausible_limit_is_no_finding() {
        let attitude = |of| finding("sensor-bias", "attitude_y", of);
        let expected = "attitude_y reached its bound of -0.05240 rad: no name is given";
        assert_eq!(attitude([-0.0524, -0.0530, 0.003]).as_deref(), Some(expected));
        assert_eq!(attitude([-0.0523, -0.0523, 0.003]).as_deref(), Some(expected), "just before it");
        assert_eq!(attitude([-0.04, -0.04, 0.003]), None);
        assert_eq!(attitude([-0.0524, -0.0530, 0.1]), None, "these flights do not determine it");
        assert!(finding("parasitic-drag", "coefficient_z", [0.1, 0.105, 0.02]).is_some());
    }

    #[test]
    fn an_estimate_at_a_bound_that_the_truth_may_be_is_one_within_chance() {
        let rotors = |asked| finding("gyroscopic-torque", "scale_error", [-1.0, asked, 0.02]);
        assert_eq!(rotors(-1.03), None);
        assert!(rotors(-1.5).is_some_and(|text| text.starts_with("scale_error reached its bound of -1.000")));
    }

    /// Without noises nothing is explained worse.
    #[test]
    fn a_parameter_at_a_limit_is_held_if_its_effect_has_another_one() {
        let flight = flown([8.0, 0.01], |_| [0.0, 0.0, 2.0], |t| [0.01 * libm::sin(3.0 * t), 0.0, 0.0]);
        let prepared =
            Prepared::new(&flight, None, &Propulsion::of(&hummingbird())).expect("a usable flight");
        let problem = problem(vec![prepared]);
        let [xy, z] = ["coefficient_xy", "coefficient_z"].map(|name| place(&problem, "parasitic-drag", name));
        let mass = place(&problem, "mass-error", "error");
        let fit_of = |at_limit: usize, others: &[usize]| {
            let mut values = problem.model.parameters.baseline();
            values[at_limit] = problem.model.parameters.all[at_limit].max;
            let free = [&[at_limit][..], others].concat();
            let unbounded = free.iter().map(|at| values[*at]).collect();
            let covariance = DMatrix::identity(free.len(), free.len());
            FitResult { free, unbounded, covariance, ..problem.fitted(&values, &[]) }
        };
        let held = held_at_limits(&problem, fit_of(z, &[xy, mass]));
        assert!(held.values[z] == 0.0 && held.free == [xy, mass], "{held:?}");
        let alone = held_at_limits(&problem, fit_of(mass, &[xy]));
        assert!(alone.values[mass] > 0.0 && alone.free == [mass, xy], "{alone:?}");
    }
}
