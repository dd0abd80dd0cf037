//! Tables of prediction errors: every flight at every horizon, by the declared vehicle, by the new one and by persistence.

use crate::clock::Lateness;
use crate::fit::Problem;
use crate::predict::{Errors, Measured, errors};
use crate::sensing::SensorErrors;
use crate::trim::OwnTrim;
use flights::state::StateQuantity;
use flights::{FlightSet, Role};
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
    let mut predictions = Vec::new();
    for flight in &set.flights {
        let prepared = problem.flights().find(|prepared| prepared.flight.name == flight.name);
        let late = prepared.map_or(Lateness::default(), |prepared| prepared.late);
        let aligned = SensorErrors::default().taken_off(flight, &late);
        let corrected = sensor_errors.taken_off(flight, &late);
        let (Some(before), Some(after)) = (Measured::of(&aligned), Measured::of(&corrected)) else {
            continue;
        };
        let airframe = |values: &[f64]| {
            let model = &problem.model;
            prepared.map_or_else(|| model.airframe(values), |flight| model.airframe_of(flight, values))
        };
        let seen = prepared.map_or(OwnTrim::default(), |prepared| OwnTrim::of(problem, prepared, values));
        for horizon_s in HORIZONS_S {
            let old = before.ends(airframe(&declared), horizon_s, |_| [0.0; 6]);
            let new = after.ends(airframe(values), horizon_s, |_| [0.0; 6]);
            let trimmed = after.ends(airframe(values), horizon_s, |from_s| seen.at(from_s));
            let errors = [
                errors(&aligned, &old, |end| end.simulated),
                errors(&corrected, &new, |end| end.simulated),
                errors(&corrected, &new, |end| end.persistent),
                errors(&corrected, &trimmed, |end| end.simulated),
            ];
            let channels = changes(&errors);
            predictions.push(Prediction {
                flight: flight.name.clone(),
                role: flight.role,
                horizon_s,
                channels,
            });
        }
    }
    predictions
}

/// Errors by channel: of the declared vehicle, the new one, persistence, and the new one with the flight's own trim.
fn changes(errors: &[Errors; 4]) -> BTreeMap<&'static str, Change> {
    let one = |quantity: StateQuantity| {
        let (channel, unit) = (quantity.name(), quantity.unit());
        let [before, after, persistence, own_trim] =
            errors.each_ref().map(|errors| errors.get(channel).copied());
        let (before, after) = (before?, after?);
        let (persistence, own_trim) = (persistence?, own_trim?);
        Some((channel, Change { before, after, persistence, own_trim, unit }))
    };
    StateQuantity::ALL.into_iter().filter_map(one).collect()
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
