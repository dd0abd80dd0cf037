//! Winds of the fit flights in the report, and what the vehicle file has of them.

use crate::fit::Problem;
use crate::fit_result::FitResult;
use crate::flight_wind::FLIGHT_WIND;
use crate::judgement::reached_bound;
use crate::parameter::Parameters;
use crate::prepared::Prepared;
use crate::report::{Estimate, FlightWind};
use crate::select::Selection;

/// The winds of the fit flights; empty where they have no winds of their own.
pub fn winds(problem: &Problem, selection: &Selection) -> Vec<FlightWind> {
    if !is_accepted(selection) {
        return Vec::new();
    }
    let of_flight = |flight: &Prepared| {
        let number = flight.number?;
        let [x, y, z] = [0, 1, 2].map(|axis| estimate(problem, selection.flown(), number, axis));
        Some(FlightWind { flight: flight.flight.name.clone(), x, y, z })
    };
    problem.estimation.iter().filter_map(of_flight).collect()
}

/// The values of the new vehicle file. It has the declared wind where flights have winds of their own: these are no property of the vehicle.
pub fn values_of_file(parameters: &Parameters, selection: &Selection) -> Vec<f64> {
    let mut values = selection.flown().values.clone();
    if is_accepted(selection) {
        parameters.wind().into_iter().for_each(|at| values[at] = parameters.all[at].baseline);
    }
    values
}

fn is_accepted(selection: &Selection) -> bool {
    selection.accepted.iter().any(|candidate| *candidate.kind == FLIGHT_WIND)
}

/// The wind of the fit flight of this number along an axis, with its 95 % interval.
fn estimate(problem: &Problem, fitted: &FitResult, number: usize, axis: usize) -> Estimate {
    let parameters = &problem.model.parameters;
    let wind = parameters.wind()[axis];
    let part = |at: usize| {
        let (moved, factor) = parameters.acting(at, Some(number))?;
        (moved == wind).then_some((at, factor))
    };
    let parts: Vec<(usize, f64)> = (0..parameters.all.len()).filter_map(part).collect();
    let value: f64 = parts.iter().map(|(at, factor)| factor * fitted.values[*at]).sum();
    let half = fitted.t_quantile(0.975) * fitted.standard_error_of(&parts).unwrap_or(f64::INFINITY);
    let (entry, unit) = (&parameters.all[wind], parameters.all[wind].spec().unit());
    let (least, most) = (entry.spec().min, entry.max);
    let (low, high) = ((value - half).max(least), (value + half).min(most));
    let at_bound = parts.iter().any(|(at, _)| reached_bound(problem, fitted, *at).is_some());
    let determined = low > least || high < most;
    Estimate { value, unit, low, high, at_bound, determined, by_equations: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candidate::wind_of_each_flight;
    use crate::wind_start::tests::{flights, problem};

    /// The error of a flight's wind is that of the sum of the mean and its deviation.
    #[test]
    #[allow(clippy::disallowed_types, reason = "not in a component: the covariance of a report's fit")]
    fn the_wind_of_a_flight_has_the_error_of_its_parts_together() {
        let flights = flights();
        let problem = problem(&flights);
        let parameters = &problem.model.parameters;
        let free = wind_of_each_flight(parameters).expect("three flights").free;
        let mut values = parameters.baseline();
        (values[free[0]], values[free[3]], values[free[6]]) = (5.0, 1.0, 2.0);
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
}
