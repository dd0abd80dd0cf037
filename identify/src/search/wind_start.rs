//! Winds of the fit flights at which a fit of one wind for each flight starts.
//!
//! A wind acts by drag alone, and their product has no slope where both are zero. So a fit starts at the winds that the mean forces of each flight ask for
//! under the drags that are known.

use crate::data::prepared::{Equation, Prepared};
use crate::data::rows::column;
use crate::model::flight_wind::{FLIGHT_WIND, is_drag};
use crate::model::parameter::Parameters;
use crate::model::problem::Problem;
use crate::search::candidate::{Candidate, has};
use crate::search::fit_result::FitResult;
use rayon::prelude::*;

/// A flight has a wind of its own from so many blocks of time on: its two numbers are known by these alone; tuned, no source.
const LEAST_BLOCKS: usize = 10;
/// Steps to the winds that mean forces ask for: the drag changes with the wind.
const START_STEPS: usize = 3;
/// One of these steps goes no further along an axis, in m/s; tuned, no source.
const STEP_MAX_M_S: f64 = 10.0;
/// A direction with less than about this part of the slope of the other has its step shortened.
const RIDGE: f64 = 0.01;
/// Mean square of a force's slope by the wind, in 1/s^2, below which nothing feels the air.
const LEAST_SLOPE: f64 = 1e-6;

impl Problem<'_> {
    /// The problem with numbers for the fit flights that can show a wind of their own, and with the parameters of these winds. Nothing changes
    /// where there are less than two such flights, or flights that effects are chosen on: no fit knows the winds of these.
    pub fn numbered(mut self) -> Self {
        let shows: Vec<bool> = self.estimation.iter().map(|flight| self.shows_wind(flight)).collect();
        let count = shows.iter().filter(|shows| **shows).count();
        if count < 2 || !self.validation.is_empty() {
            return self;
        }
        let shown = self.estimation.iter_mut().zip(shows).filter(|(_, shows)| *shows);
        shown.enumerate().for_each(|(number, (flight, _))| flight.number = Some(number));
        self.model.parameters.add_winds(&self.model.vehicle, count);
        self
    }

    fn shows_wind(&self, flight: &Prepared) -> bool {
        let is_measured = FLIGHT_WIND.needs.iter().all(|need| has(flight, *need));
        is_measured && !flight.is_assumed() && self.block_knots(flight).len() >= LEAST_BLOCKS
    }
}

/// The deviations of the winds of the fit flights from their mean, by flight, in m/s; none where no flight has a number.
pub fn deviations_m_s(parameters: &Parameters, values: &[f64]) -> Vec<[f64; 2]> {
    let mut deviations: Vec<[f64; 2]> = Vec::new();
    for (entry, value) in parameters.all.iter().zip(values) {
        let Some(flight) = entry.flight else { continue };
        deviations.resize(deviations.len().max(flight + 1), [0.0; 2]);
        deviations[flight][entry.index] = *value;
        deviations[0][entry.index] -= value;
    }
    deviations
}

/// The greatest deviation of a flight's wind from the mean along an axis, in m/s.
pub fn greatest_m_s(parameters: &Parameters, values: &[f64]) -> f64 {
    deviations_m_s(parameters, values).as_flattened().iter().map(|along| along.abs()).fold(0.0, f64::max)
}

/// The start of a fit of one wind for each flight, and its cost: that of `base` where nothing feels the air.
pub fn start(problem: &Problem, base: &FitResult) -> (Vec<f64>, f64) {
    let least = base.estimation_cost();
    let winds = by_forces(problem, &base.values).or_else(|| by_forces(problem, &with_drags(problem, base)));
    let Some(values) = winds else { return (base.values.clone(), least) };
    let cost = problem.costs(&problem.estimation, &values).iter().sum::<f64>();
    (values, cost.min(least))
}

/// The values of `base` with plausible `drags`, and with the winds that the forces of each flight ask for beside these drags. `None` if nothing feels
/// the air.
pub fn start_beside(problem: &Problem, base: &FitResult, drags: &[Candidate]) -> Option<Vec<f64>> {
    let mut values = base.values.clone();
    let of_drags = drags.iter().filter(|candidate| is_drag(candidate.kind));
    for at in of_drags.flat_map(|candidate| &candidate.free) {
        let entry = &problem.model.parameters.all[*at];
        values[*at] = entry.bounded(entry.baseline + entry.scale);
    }
    by_forces(problem, &values)
}

/// The values of `base` with each drag that was fitted to nothing at a plausible value. In the mean of several winds a drag may seem to be none.
fn with_drags(problem: &Problem, base: &FitResult) -> Vec<f64> {
    let mut values = base.values.clone();
    for at in &base.free {
        let entry = &problem.model.parameters.all[*at];
        if is_drag(entry.kind) && values[*at] <= entry.spec().min {
            values[*at] = entry.bounded(entry.baseline + entry.scale);
        }
    }
    values
}

/// The values with the level winds that the forces of each flight ask for; `None` where nothing feels the air.
fn by_forces(problem: &Problem, values: &[f64]) -> Option<Vec<f64>> {
    let parameters = &problem.model.parameters;
    let mut start = values.to_vec();
    let deviations = parameters.of_name(FLIGHT_WIND.name);
    deviations.iter().for_each(|at| start[*at] = 0.0);
    // All winds are level then, also where one wind for all was not.
    parameters.wind().into_iter().for_each(|at| start[at] = parameters.all[at].baseline);
    let level = parameters.level_wind();
    let of_flight = |flight: &Prepared| -> Option<[f64; 2]> {
        let mut values = start.clone();
        for _ in 0..START_STEPS {
            let step = step(problem, flight, &values, level)?;
            for (at, step) in level.into_iter().zip(step) {
                values[at] = parameters.all[at].bounded(values[at] + step);
            }
        }
        Some(level.map(|at| values[at]))
    };
    let numbered: Vec<&Prepared> =
        problem.estimation.iter().filter(|flight| flight.number.is_some()).collect();
    let winds: Vec<[f64; 2]> =
        numbered.into_par_iter().map(of_flight).collect::<Vec<_>>().into_iter().collect::<Option<_>>()?;
    let mean = |axis: usize| winds.iter().map(|wind| wind[axis]).sum::<f64>() / winds.len() as f64;
    let means = [mean(0), mean(1)];
    for at in deviations {
        let entry = &parameters.all[at];
        let wind = entry.flight.and_then(|flight| winds.get(flight));
        if let (Some(wind), Some(mean)) = (wind, means.get(entry.index)) {
            start[at] = entry.bounded(wind[entry.index] - mean);
        }
    }
    level.into_iter().zip(means).for_each(|(at, mean)| start[at] = mean);
    Some(start)
}

/// The step of the level wind that takes most of the forces away which the model lacks in `flight`; `None` where nothing feels the air.
fn step(problem: &Problem, flight: &Prepared, values: &[f64], level: [usize; 2]) -> Option<[f64; 2]> {
    let (residual, columns) = problem.linearised(flight, values, &level);
    // Along x alone, along both, along y alone.
    let (mut gram, mut gradient, mut rows) = ([0.0; 3], [0.0; 2], 0.0);
    for equation in [Equation::SpecificForce, Equation::Acceleration] {
        for axis in 0..3 {
            let left = column(flight, &residual, equation, axis);
            let [x, y] = [0, 1].map(|of: usize| column(flight, &columns[of], equation, axis));
            for ((left, x), y) in left.iter().zip(&x).zip(&y) {
                gram = [gram[0] + x * x, gram[1] + x * y, gram[2] + y * y];
                gradient = [gradient[0] + x * left, gradient[1] + y * left];
                rows += 1.0;
            }
        }
    }
    let slope = gram[0] + gram[2];
    if slope.is_nan() || slope <= LEAST_SLOPE * rows {
        return None;
    }
    let [x, both, y] = [gram[0] + RIDGE * slope, gram[1], gram[2] + RIDGE * slope];
    let size = x * y - both * both;
    let step = [both * gradient[1] - y * gradient[0], both * gradient[0] - x * gradient[1]];
    Some(step.map(|step| (step / size).clamp(-STEP_MAX_M_S, STEP_MAX_M_S)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::prepared::Propulsion;
    use crate::model::physics::Model;
    use crate::model::whitening::Noises;
    use crate::report::wind_reports::estimate;
    use crate::search::candidate::wind_of_each_flight;
    use crate::test_flights::{flown, hummingbird};
    use flights::Flight;

    fn flight(phase: f64) -> Flight {
        flown(
            [12.0, 0.01],
            |t| [2.0 * libm::sin(1.3 * t + phase), 1.5 * libm::cos(0.9 * t), 2.0],
            |t| [0.3 * libm::sin(2.1 * t), 0.2 * libm::cos(1.7 * t + phase), 0.1 * t],
        )
    }

    /// Three fit flights and one for test, with rotor drag.
    fn problem(flights: &[Flight]) -> Problem<'_> {
        let vehicle = hummingbird();
        let propulsion = Propulsion::of(&vehicle);
        let mut prepared: Vec<Prepared> = flights
            .iter()
            .map(|flight| Prepared::new(flight, None, &propulsion).expect("a usable flight"))
            .collect();
        let test = prepared.split_off(3);
        let drag = plant::effects::find("rotor-drag").expect("an effect").nominal();
        let problem = Problem {
            model: Model { parameters: Parameters::of(&vehicle, &[drag]), vehicle },
            estimation: prepared,
            validation: Vec::new(),
            test,
            noises: Noises::new(),
            block_s: 1.0,
            shared_late_s: 0.0,
        };
        problem.numbered()
    }

    fn flights() -> Vec<Flight> {
        [0.0, 0.5, 1.0, 1.5].into_iter().map(flight).collect()
    }

    #[test]
    fn deviations_of_the_winds_sum_to_zero_and_a_test_flight_has_the_mean() {
        let flights = flights();
        let problem = problem(&flights);
        let parameters = &problem.model.parameters;
        let mut values = parameters.baseline();
        values[parameters.wind()[0]] = 4.0;
        let deviations = parameters.of_name("flight-wind");
        assert_eq!(deviations.len(), 2 * 2);
        values[deviations[0]] = 1.0;
        values[deviations[2]] = 2.0;
        let wind = |flight: &Prepared| {
            let effects = parameters.effects_of(flight.number, &values);
            effects.iter().find(|effect| effect.kind.name == "wind").map(|effect| effect.values[0])
        };
        let found: Vec<_> = problem.flights().map(wind).collect();
        assert_eq!(found, [Some(1.0), Some(5.0), Some(6.0), Some(4.0)]);
    }

    /// They are taken from those by the common wind, without a simulation of their own.
    #[test]
    fn derivatives_by_the_wind_of_a_flight_are_those_of_the_whole_model() {
        let flights = flights();
        let problem = problem(&flights);
        let (model, mut values) = (&problem.model, problem.model.parameters.baseline());
        let deviations = model.parameters.of_name("flight-wind");
        let free = [model.parameters.wind(), deviations.clone()].concat();
        values[deviations[0]] = 2.0;
        let norm = |rows: &[f64]| rows.iter().map(|row| row * row).sum::<f64>().sqrt();
        for flight in problem.flights() {
            let (residual, columns) = model.linearised(flight, &values, &free);
            for (at, column) in free.iter().zip(&columns) {
                let mut moved = values.clone();
                moved[*at] += 0.01;
                let moved = model.residual_under(flight, &moved);
                let apart: Vec<f64> = moved
                    .iter()
                    .zip(&residual)
                    .zip(column)
                    .map(|((a, b), slope)| (a - b) / 0.01 - slope)
                    .collect();
                assert!(
                    norm(&apart) < 1e-6 * (1.0 + norm(column)),
                    "{at}: {} of {}",
                    norm(&apart),
                    norm(column)
                );
            }
            let shown = columns.iter().filter(|column| norm(column) > 0.0).count();
            let expected = match flight.number {
                None => 3,
                Some(0) => 7,
                Some(_) => 5,
            };
            assert!(shown <= expected && shown + 3 >= expected, "{shown}, expected {expected}");
        }
    }

    /// The error of a flight's wind is that of the sum of the mean and its deviation.
    #[test]
    #[allow(clippy::disallowed_types, reason = "not in a component: the covariance of a report's fit")]
    fn the_wind_of_a_flight_has_the_error_of_its_parts_together() {
        let flights = flights();
        let problem = problem(&flights);
        let parameters = &problem.model.parameters;
        let free = wind_of_each_flight(parameters).expect("three flights").free;
        let mut values = parameters.baseline();
        (values[free[0]], values[free[2]], values[free[4]]) = (5.0, 1.0, 2.0);
        let count = free.len();
        let fitted = FitResult {
            values,
            unbounded: vec![0.0; count],
            covariance: nalgebra::DMatrix::identity(count, count) * 0.04,
            validation_costs: Vec::new(),
            estimation_costs: vec![1.0; 1000],
            free,
        };
        let wind = |number| estimate(&problem, &fitted, number, 0);
        assert_eq!([wind(0).value, wind(1).value, wind(2).value], [2.0, 6.0, 7.0]);
        // Of the first flight three numbers, of the others two.
        let ratio = (wind(0).high - wind(0).low) / (wind(1).high - wind(1).low);
        assert!((ratio - 1.5_f64.sqrt()).abs() < 1e-9, "{ratio}");
        assert!((wind(1).high - 6.0 - 1.96 * 0.2 * 2_f64.sqrt()).abs() < 2e-3, "{:?}", wind(1));
    }

    /// The first flight has what the others have not, with the opposite sign.
    #[test]
    fn the_greatest_deviation_is_that_of_any_flight() {
        let flights = flights();
        let problem = problem(&flights);
        let parameters = &problem.model.parameters;
        let mut values = parameters.baseline();
        let deviations = parameters.of_name("flight-wind");
        (values[deviations[1]], values[deviations[3]]) = (0.5, 0.75);
        assert!((greatest_m_s(parameters, &values) - 1.25).abs() < 1e-12);
    }

    /// Rotor drag is linear in the wind, so that each flight has less force left under the wind of the start than without wind.
    #[test]
    fn a_start_has_the_winds_that_forces_ask_for() {
        let flights = flights();
        let problem = problem(&flights);
        let still = problem.model.parameters.baseline();
        let start = by_forces(&problem, &still).expect("a drag is declared");
        assert!(greatest_m_s(&problem.model.parameters, &start) > 0.0);
        let left = |flight: &Prepared, values: &[f64]| {
            let residual = problem.model.residual_under(flight, values);
            let rows = (0..3).flat_map(|axis| column(flight, &residual, Equation::Acceleration, axis));
            rows.map(|row| row * row).sum::<f64>()
        };
        for flight in &problem.estimation {
            let [before, after] = [&still, &start].map(|values| left(flight, values));
            assert!(after < before, "{after}, expected less than {before}");
        }
    }

    #[test]
    fn without_drag_no_wind_is_asked_for() {
        let flights = flights();
        let mut problem = problem(&flights);
        problem.model.parameters = Parameters::of(&hummingbird(), &[]);
        assert_eq!(by_forces(&problem, &problem.model.parameters.baseline()), None);
    }

    #[test]
    fn with_winds_of_flights_each_fold_has_a_part_of_every_flight() {
        let flights = flights();
        let problem = problem(&flights);
        let counts: Vec<usize> =
            problem.estimation.iter().map(|flight| problem.block_knots(flight).len()).collect();
        let blocks: usize = counts.iter().sum();
        let folds = problem.folds(blocks, &problem.model.parameters.of_name("flight-wind"));
        let mut places = folds.concat();
        places.sort_unstable();
        assert_eq!(places, (0..blocks).collect::<Vec<_>>());
        let ends = [counts[0], counts[0] + counts[1], blocks];
        for fold in folds {
            let flight_of = |at: &usize| ends.iter().position(|end| at < end);
            assert!((0..3).all(|flight| fold.iter().any(|at| flight_of(at) == Some(flight))), "{fold:?}");
        }
        let first = problem.folds(blocks, &[]).swap_remove(0);
        assert_eq!(first, (0..first.len()).collect::<Vec<_>>(), "one stretch of time");
    }

    /// Too short a flight has the mean wind, and flights that effects are chosen on would have to be fitted.
    #[test]
    fn only_flights_that_can_show_a_wind_have_one() {
        let flights = flights();
        let mut problem = problem(&flights);
        let numbers = |problem: &Problem| problem.flights().map(|flight| flight.number).collect::<Vec<_>>();
        assert_eq!(numbers(&problem), [Some(0), Some(1), Some(2), None]);
        problem.block_s = 5.0;
        problem.estimation.iter_mut().for_each(|flight| flight.number = None);
        let mut problem = problem.numbered();
        assert_eq!(numbers(&problem), [None; 4], "three blocks a flight");
        problem.block_s = 1.0;
        problem.validation = problem.estimation.split_off(2);
        assert_eq!(numbers(&problem.numbered()), [None; 4], "a flight to choose on");
    }
}
