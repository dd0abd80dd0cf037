//! Tables of prediction errors: every flight at every horizon, by the declared vehicle, by the new one and by persistence.

use crate::data::clock::Lateness;
use crate::data::measured::Measured;
use crate::data::parts;
use crate::data::prepared::Prepared;
use crate::data::sensing::SensorErrors;
use crate::model::disturbance::{DisturbanceModels, Observed, TrimVariances};
use crate::model::forecast::Forecast;
use crate::model::predict::{Errors, WindowEnd, components, errors};
use crate::model::problem::Problem;
use crate::report::past_wind::{Stage, stages};
use flights::state::StateQuantity;
use flights::{Flight, FlightSet, Role};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// Horizons of prediction.
pub const HORIZONS_S: [f64; 3] = [0.1, 0.5, 1.0];

/// Prediction errors by flight, horizon in s and channel.
pub type Changes = BTreeMap<String, BTreeMap<String, BTreeMap<&'static str, Change>>>;

/// A prediction error before and after.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Change {
    /// Root mean square of the declared model.
    pub before: f64,
    /// With the accepted effects.
    pub after: f64,
    /// Without any model: velocity, attitude and rates stay, and the position moves on at the velocity.
    pub persistence: f64,
    /// With the accepted effects, and the flight's own trim as it was seen up to the begin of each window.
    pub own_trim: f64,
    /// With the accepted effects, and the disturbance as it was seen up to the begin of each window, which decays to the trim.
    pub disturbance: f64,
    /// With the accepted effects, in the wind that was seen before each stage of the flight; `None` where the fit flights have one wind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub own_wind: Option<f64>,
    /// With the accepted effects and the measured attitude, so that forces alone make the error; `None` of the channels of rotation.
    pub measured_attitude: Option<f64>,
    /// Root mean square of `after` by axis: of position and velocity those of the world, of attitude and rates those of the body.
    pub by_axis: [f64; 3],
    /// Unit of all.
    pub unit: &'static str,
}

/// The errors of one flight at one horizon.
pub struct Prediction {
    flight: String,
    role: Role,
    horizon_s: f64,
    channels: BTreeMap<&'static str, Change>,
}

/// Errors of every flight of `set` at every horizon under the declared values and under `values`.
pub fn predictions(problem: &Problem, set: &FlightSet, values: &[f64]) -> Vec<Prediction> {
    let declared = problem.model.parameters.baseline();
    let sensor_errors = SensorErrors::of(&problem.model.parameters, values);
    let models = DisturbanceModels::of(problem, values);
    let trims = TrimVariances::of(problem, &models, values);
    let of_flight = |flight: &Flight| {
        let mut predictions = Vec::new();
        let prepared = problem.flights().find(|prepared| prepared.flight.name == flight.name);
        let late = prepared.map_or(Lateness::default(), |prepared| prepared.late);
        // A test flight is judged whole, as on the bus.
        let part = prepared.filter(|_| flight.role != Role::Test).and_then(parts::of_flight);
        let pieces_s = part.as_ref().map_or(Vec::new(), |part| part.layout.clock.pieces_s());
        let settling_s = part.as_ref().map_or(0.0, Prepared::settling_s);
        let cut = part.is_some().then(|| flight.within(&pieces_s));
        let flight = cut.as_ref().unwrap_or(flight);
        let turns_as_measured = prepared.map_or(flight.without_torques, Prepared::turns_as_measured);
        let measured = |flight: &Flight| {
            let measured = Measured::of(flight)?.within(pieces_s.clone(), settling_s);
            Some(if turns_as_measured { measured.turning_as_measured() } else { measured })
        };
        let aligned = SensorErrors::default().taken_off(flight, &late);
        let corrected = sensor_errors.taken_off(flight, &late);
        let (Some(before), Some(after)) = (measured(&aligned), measured(&corrected)) else {
            return predictions;
        };
        let airframe = |values: &[f64]| {
            let model = &problem.model;
            prepared.map_or_else(|| model.airframe(values), |flight| model.airframe_of(flight, values))
        };
        let seen = prepared.map_or(Observed::default(), |prepared| {
            Observed::of(problem, prepared, values).about_own_trims(prepared, &models, &trims)
        });
        let turned = measured(&corrected).map(Measured::turning_as_measured);
        let of_test = prepared.filter(|_| flight.role == Role::Test);
        let stages = of_test.map_or(Vec::new(), |flight| stages(problem, flight, values));
        // Rotors settle before each stage.
        let settling_s = of_test.map_or(0.0, Prepared::settling_s);
        let in_stage = |stage: Stage| {
            let pieces_s = vec![(stage.from_s - settling_s, stage.to_s)];
            Some((measured(&corrected)?.within(pieces_s, settling_s), stage.values))
        };
        let staged: Vec<(Measured, Vec<f64>)> = stages.into_iter().filter_map(in_stage).collect();
        for horizon_s in HORIZONS_S {
            let ends = |push: &dyn Fn(f64) -> Forecast| after.ends(airframe(values), horizon_s, push);
            let old = before.ends(airframe(&declared), horizon_s, |_| Forecast::none());
            let new = ends(&|_| Forecast::none());
            let turned = turned
                .iter()
                .flat_map(|turned| turned.ends(airframe(values), horizon_s, |_| Forecast::none()));
            let in_wind = staged.iter().flat_map(|(measured, values)| {
                measured.ends(airframe(values), horizon_s, |_| Forecast::none())
            });
            let simulated = |ends: &[WindowEnd]| errors(&corrected, ends, |end| end.simulated);
            let errors = [
                errors(&aligned, &old, |end| end.simulated),
                simulated(&new),
                errors(&corrected, &new, |end| end.persistent),
                simulated(&ends(&|from_s| seen.trim(from_s))),
                simulated(&ends(&|from_s| seen.expected(&models, from_s))),
                simulated(&turned.collect::<Vec<_>>()),
                simulated(&in_wind.collect::<Vec<_>>()),
            ];
            let mut channels = changes(&errors, &by_axis(&new));
            if turns_as_measured {
                let turns = StateQuantity::ALL.into_iter().filter(|quantity| quantity.is_turn());
                turns.for_each(|turn| _ = channels.remove(turn.name()));
            }
            predictions.push(Prediction {
                flight: flight.name.clone(),
                role: flight.role,
                horizon_s,
                channels,
            });
        }
        predictions
    };
    set.flights.par_iter().flat_map_iter(of_flight).collect()
}

/// Errors by channel: of the declared vehicle, of the new one, and of persistence. Four more are of the new
/// one: with the flight's own trim, with the disturbance that was seen, with the measured attitude, and in
/// the wind that was seen.
fn changes(errors: &[Errors; 7], by_axis: &[[f64; 3]; 4]) -> BTreeMap<&'static str, Change> {
    let one = |(quantity, by_axis): (StateQuantity, &[f64; 3])| {
        let (channel, unit) = (quantity.name(), quantity.unit());
        let [before, after, persistence, own_trim, disturbance, turned, own_wind] =
            errors.each_ref().map(|errors| errors.get(channel).copied());
        let change = Change {
            before: before?,
            after: after?,
            persistence: persistence?,
            own_trim: own_trim?,
            disturbance: disturbance?,
            own_wind,
            measured_attitude: turned.filter(|_| !quantity.is_turn()),
            by_axis: *by_axis,
            unit,
        };
        Some((channel, change))
    };
    StateQuantity::ALL.into_iter().zip(by_axis).filter_map(one).collect()
}

/// Root mean squares of the errors by quantity and axis.
fn by_axis(ends: &[WindowEnd]) -> [[f64; 3]; 4] {
    let mut squares = [[0.0; 3]; 4];
    for error in ends.iter().map(|end| components(end, &end.simulated)) {
        let add = |(sum, error): (&mut f64, &f64)| *sum += error * error / ends.len() as f64;
        squares.iter_mut().flatten().zip(error.iter().flatten()).for_each(add);
    }
    squares.map(|axes| axes.map(f64::sqrt))
}

/// The errors of the flights of `role`.
pub fn of_role(predictions: &[Prediction], role: Role) -> Changes {
    let mut flights = Changes::new();
    for found in predictions.iter().filter(|found| found.role == role) {
        let horizons = flights.entry(found.flight.clone()).or_default();
        horizons.insert(found.horizon_s.to_string(), found.channels.clone());
    }
    flights
}
