//! Several winds, found at once: one wind for each flight beside all effects by which a wind acts.
//!
//! A search that takes one effect after the other does not find them. Each drag is seen only beside the winds, and the winds only beside the drags; what a
//! single one of them leaves counts as noise. So where constant forces across the thrust differ between flights by more than trims can, all of them are
//! fitted together. Those that explain nothing are given up again (backward elimination: Draper and Smith, Applied Regression Analysis, 3rd ed., chapter 15).

use crate::data::prepared::Equation;
use crate::data::rows::column;
use crate::model::flight_wind::{FLIGHT_WIND, is_drag};
use crate::model::problem::Problem;
use crate::search::candidate::{Candidate, free_parameters};
use crate::search::fit_result::FitResult;
use crate::search::judgement::{FALSE_RATE, p_value};
use crate::search::weigh::MOST_TRIM_M_S2;
use crate::search::wind_start::start_beside;
use plant::effects::Action;

/// Least part of the squared error with one wind for all flights that several winds have to explain. Most of that error is noise within each flight; tuned,
/// no source.
const LEAST_GAIN: f64 = 0.02;

/// The winds of the flights beside the effects by which they act, and the fit of all. `None` if one wind explains the flights nearly as well, or if
/// winds of flights are not among the `candidates`. The noise of `problem` is then that of the trial.
pub fn several_winds(
    problem: &mut Problem,
    declared: &FitResult,
    candidates: &[Candidate],
) -> Option<(Vec<Candidate>, FitResult)> {
    let winds = candidates.iter().find(|candidate| *candidate.kind == FLIGHT_WIND)?;
    if greatest_spread_m_s2(problem, &declared.values) < MOST_TRIM_M_S2 {
        return None;
    }
    let mut all: Vec<Candidate> = candidates.iter().filter(|candidate| acts(candidate)).cloned().collect();
    problem.weigh(declared, &all);
    let start = start_beside(problem, declared, &all)?;
    let one = free_parameters(&all);
    all.push(winds.clone());
    let free = free_parameters(&all);
    let mut several = problem.fitted(&start, &free);
    problem.weigh(&several, &all);
    several = problem.fitted(&several.values, &free);
    let level = winds.free.iter().filter(|at| problem.model.parameters.all[**at].flight.is_none());
    let shared: Vec<usize> = one.into_iter().chain(level.copied()).collect();
    let mut values = several.values.clone();
    let deviations = problem.model.parameters.of_name(FLIGHT_WIND.name);
    deviations.into_iter().for_each(|at| values[at] = 0.0);
    let one = problem.fitted(&values, &shared);
    problem.allow_trims_of(&one, &all);
    let [one, several] = [one, several].map(|fit| problem.fitted(&fit.values, &fit.free));
    is_gain(&one.validation_costs, &several.validation_costs).then_some((all, several))
}

/// True if `several` winds explain more than `one`, by the squared errors of the blocks of the validation data: by at least [`LEAST_GAIN`] of
/// them, and by more than chance.
fn is_gain(one: &[f64], several: &[f64]) -> bool {
    let [of_one, of_several] = [one, several].map(|costs| costs.iter().sum::<f64>());
    of_several < (1.0 - LEAST_GAIN) * of_one && p_value(one, several) < FALSE_RATE
}

/// True for effects by which a wind acts, and for one number of the thrust of all rotors, which the lift of a wind changes.
fn acts(candidate: &Candidate) -> bool {
    let kind = candidate.kind;
    let is_vehicle = kind.actions.iter().any(|action| matches!(action, Action::Vehicle(_)));
    let is_thrust = is_vehicle && kind.needs.is_empty() && kind.is_linear && candidate.free.len() == 1;
    is_drag(kind) || is_thrust
}

/// The greatest standard deviation between flights of the mean force along x or y that the model lacks, in m/s^2.
fn greatest_spread_m_s2(problem: &Problem, values: &[f64]) -> f64 {
    let of = |equation: Equation, axis: usize| {
        let mean = |flight| {
            let rows = column(flight, &problem.model.residual_under(flight, values), equation, axis);
            (!rows.is_empty()).then(|| rows.iter().sum::<f64>() / rows.len() as f64)
        };
        let means: Vec<f64> = problem.estimation.iter().filter_map(mean).collect();
        deviation(&means)
    };
    let equations = [Equation::SpecificForce, Equation::Acceleration];
    equations.into_iter().flat_map(|equation| [0, 1].map(|axis| of(equation, axis))).fold(0.0, f64::max)
}

/// The standard deviation of a sample; 0 of less than two.
fn deviation(of: &[f64]) -> f64 {
    let mean = of.iter().sum::<f64>() / of.len().max(1) as f64;
    let squares: f64 = of.iter().map(|one| (one - mean) * (one - mean)).sum();
    (squares / (of.len().max(2) - 1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::prepared::{Prepared, Propulsion};
    use crate::model::parameter::Parameters;
    use crate::model::physics::Model;
    use crate::model::whitening::Noises;
    use crate::search::candidate::candidates;
    use crate::test_flights::{flown, hummingbird};
    use flights::Flight;

    /// A level flight whose rotors turn at hover, so that the model lacks this constant acceleration. It sways beside that, as all others do.
    fn accelerated(along_m_s2: [f64; 3]) -> Flight {
        let sway_m = |t: f64| [0.2 * libm::sin(1.3 * t), 0.1 * libm::cos(1.9 * t), 2.0];
        let position = |t: f64| std::array::from_fn(|axis| sway_m(t)[axis] + along_m_s2[axis] * t * t / 2.0);
        flown([12.0, 0.01], position, |_| [0.0; 3])
    }

    /// Fit flights of a Hummingbird, of which each can show a wind of its own.
    fn problem(flights: &[Flight]) -> Problem<'_> {
        let vehicle = hummingbird();
        let propulsion = Propulsion::of(&vehicle);
        let prepared = |flight| Prepared::new(flight, None, &propulsion).expect("a usable flight");
        let problem = Problem {
            model: Model { parameters: Parameters::of(&vehicle, &[]), vehicle },
            estimation: flights.iter().map(prepared).collect(),
            validation: Vec::new(),
            test: Vec::new(),
            noises: Noises::new(),
            block_s: 1.0,
            shared_late_s: 0.0,
        };
        problem.numbered()
    }

    /// All candidates that the flights can show.
    fn all_of(problem: &Problem) -> Vec<Candidate> {
        let flights: Vec<&Prepared> = problem.flights().collect();
        candidates(&problem.model.parameters, &flights).0
    }

    /// The spread of flights with these constant accelerations.
    fn spread_m_s2(along_m_s2: &[[f64; 3]]) -> f64 {
        let flights: Vec<Flight> = along_m_s2.iter().map(|along| accelerated(*along)).collect();
        let problem = problem(&flights);
        greatest_spread_m_s2(&problem, &problem.model.parameters.baseline())
    }

    #[test]
    fn drags_lifts_and_one_thrust_scale_are_taken() {
        let flights = [accelerated([0.0; 3]), accelerated([1.0, 0.0, 0.0])];
        let problem = problem(&flights);
        let all = all_of(&problem);
        let is_there = |name: &str| all.iter().any(|candidate| candidate.kind.name == name);
        let others = [
            "blade-flapping",
            "mass-error",
            "weak-rotor",
            "sensor-bias",
            "sensor-delay",
            "wind",
            "flight-wind",
        ];
        assert!(others.into_iter().all(is_there), "each is a candidate: {all:?}");
        let mut names: Vec<&str> =
            all.iter().filter(|candidate| acts(candidate)).map(|candidate| candidate.kind.name).collect();
        names.sort_unstable();
        assert_eq!(names, ["parasitic-drag", "rotor-drag", "thrust-scale", "translational-lift"]);
    }

    #[test]
    fn several_winds_need_two_percent_of_the_squared_error() {
        let is_gain_to = |cost: f64| is_gain(&[100.0; 20], &[cost; 20]);
        assert!(is_gain_to(97.0));
        assert!(!is_gain_to(98.5), "beyond chance, but 1.5 %");
        assert!(!is_gain_to(100.0) && !is_gain_to(110.0));
    }

    /// One of twenty blocks has all of the gain, 12 % of the squared error. Six blocks that agree may do so by chance, with 1/64.
    #[test]
    fn several_winds_need_a_gain_beyond_chance() {
        let (mut one, mut several) = ([100.0; 20], [101.0; 20]);
        (one[7], several[7]) = (400.0, 100.0);
        assert!(!is_gain(&one, &several));
        assert!(!is_gain(&[100.0; 6], &[50.0; 6]));
        assert!(is_gain(&[100.0; 7], &[50.0; 7]));
    }

    #[test]
    fn the_deviation_is_that_of_a_sample() {
        assert_eq!([deviation(&[]), deviation(&[3.0]), deviation(&[2.0, 2.0])], [0.0; 3]);
        assert!((deviation(&[1.0, 3.0]) - 2.0_f64.sqrt()).abs() < 1e-12);
        assert!((deviation(&[1.0, 2.0, 3.0]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_spread_is_that_of_the_level_force_that_differs_most() {
        let near = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 0.01, "{found}, expected {expected}");
        };
        near(spread_m_s2(&[[0.0, 0.2, 0.0], [1.0, 0.1, 0.0], [2.0, 0.0, 0.0]]), 1.0);
        near(spread_m_s2(&[[0.1, 0.0, 0.0], [0.0, -2.0, 0.0]]), 2.0_f64.sqrt());
        near(spread_m_s2(&[[1.0, 2.0, 0.0], [1.0, 2.0, 3.0]]), 0.0);
        near(spread_m_s2(&[[1.0, 2.0, 0.0]]), 0.0);
    }

    /// One constant force of all flights may be one wind. Without the winds among the candidates there is nothing to search.
    #[test]
    fn flights_of_equal_mean_forces_have_no_several_winds() {
        let flights = [(); 3].map(|()| accelerated([1.0, -0.5, 0.0]));
        let mut problem = problem(&flights);
        let all = all_of(&problem);
        assert!(all.iter().any(|candidate| *candidate.kind == FLIGHT_WIND), "{all:?}");
        let declared = problem.fitted(&problem.model.parameters.baseline(), &[]);
        assert!(several_winds(&mut problem, &declared, &all).is_none());
        let others: Vec<Candidate> =
            all.into_iter().filter(|candidate| *candidate.kind != FLIGHT_WIND).collect();
        assert!(several_winds(&mut problem, &declared, &others).is_none());
    }
}
