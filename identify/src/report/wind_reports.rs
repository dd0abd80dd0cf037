//! Winds of the fit flights in the report, and what the vehicle file has of them.

use crate::data::prepared::Prepared;
use crate::model::flight_wind::FLIGHT_WIND;
use crate::model::parameter::Parameters;
use crate::model::problem::Problem;
use crate::report::results::{Estimate, FlightWind};
use crate::search::fit_result::FitResult;
use crate::search::judgement::reached_bound;
use crate::search::select::Selection;

/// The winds of the fit flights; empty where they have no winds of their own.
pub fn winds(problem: &Problem, selection: &Selection) -> Vec<FlightWind> {
    if !is_accepted(selection) {
        return Vec::new();
    }
    let of_flight = |flight: &Prepared| {
        let number = flight.number?;
        let [x, y] = [0, 1].map(|axis| estimate(problem, selection.flown(), number, axis));
        Some(FlightWind { flight: flight.flight.name.clone(), x, y })
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
pub fn estimate(problem: &Problem, fitted: &FitResult, number: usize, axis: usize) -> Estimate {
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
