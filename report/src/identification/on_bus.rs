//! Flights on the bus with the declared and the new vehicle of an identification.

use crate::validate::Validation;
use diagnostics::Error;
use flights::{Flight, FlightSet};
use identify::Equation;
use identify::SensorErrors;
use identify::report::{FlightReport, Report};
use identify::run::Outcome;
use serde_json::{Value, json};
use std::path::Path;

/// A shorter flight holds none of the windows of a replay.
const LEAST_REPLAY_S: f64 = 2.0;

/// Flies the measured commands with the declared and the new vehicle on the bus, and compares the errors with the
/// predictions of the report; `None` if no flight can be replayed. The flights have the host of `how`.
///
/// # Errors
/// As [`Validation::errors`].
pub fn fly_again(
    set: &FlightSet,
    vehicle: &Path,
    outcome: &Outcome,
    how: &Validation<'_>,
    tell: &mut dyn FnMut(&str),
) -> Result<Option<Value>, Error> {
    let set = outcome.believed.as_ref().unwrap_or(set);
    let aligned = corrected(set, outcome, &SensorErrors::default());
    let corrected = corrected(set, outcome, &outcome.sensor_errors);
    if aligned.flights.is_empty() {
        return Ok(None);
    }
    let before = how.errors(&[&set.vehicle], &aligned, tell)?;
    let after = how.errors(&[vehicle], &corrected, tell)?;
    let mut flights = json!({});
    let mut furthest: Option<(f64, String)> = None;
    for (before, after) in before.flights.iter().zip(&after.flights) {
        let horizons = before.horizons.iter().zip(&after.horizons);
        let channels = horizons.flat_map(|(old, new)| {
            old.channels.iter().zip(&new.channels).map(|(old_channel, new)| (old.horizon(), old_channel, new))
        });
        for (horizon, old, new) in channels {
            let (old_rms, new_rms, channel) = (old.rms[0], new.rms[0], old.quantity.name());
            flights[&before.name][&horizon][channel] =
                json!({ "before": old_rms, "after": new_rms, "unit": old.quantity.unit() });
            let predicted = predicted(&outcome.report, &before.name, &horizon, channel);
            let away = predicted
                .map(|(before, after)| (old_rms / before - 1.0).abs().max((new_rms / after - 1.0).abs()))
                .map(|away| (away, format!("{channel} after {horizon} s of {}", before.name)));
            let all = furthest.into_iter().chain(away).filter(|found| found.0.is_finite());
            furthest = all.max_by(|a, b| a.0.total_cmp(&b.0));
        }
    }
    let (away, at) = furthest.unzip();
    Ok(Some(json!({ "flights": flights, "furthest_from_prediction": away, "furthest_at": at })))
}

/// The report's own errors before and after.
fn predicted(report: &Report, flight: &str, horizon: &str, channel: &str) -> Option<(f64, f64)> {
    let channels = report.held_out.get(flight).or_else(|| report.fitted.get(flight))?;
    let change = channels.get(horizon)?.get(channel)?;
    Some((change.before, change.after))
}

/// The flights that can be replayed, without `errors` of their sensors and without the offsets that the alignment
/// removed.
fn corrected(set: &FlightSet, outcome: &Outcome, errors: &SensorErrors) -> FlightSet {
    let flight = |flight: &Flight| {
        errors.taken_off(flight, &outcome.late.get(&flight.name).copied().unwrap_or_default())
    };
    let can_fly = |flight: &&Flight| {
        // Where torques are not compared, predictions take the measured attitude, which a replay does not.
        let was_used = |report: &FlightReport| {
            let has_torques = report.equations.contains(&Equation::AngularAcceleration.name());
            report.name == flight.name && report.compared_s > LEAST_REPLAY_S && has_torques
        };
        // A vehicle file has one wind at most.
        outcome.report.winds.is_empty()
            && !flight.command.is_empty()
            && !flight.attitude.is_empty()
            && outcome.report.flights.iter().any(was_used)
    };
    let flights = set.flights.iter().filter(can_fly).map(flight).collect();
    FlightSet {
        vehicle: set.vehicle.clone(),
        flights,
        next_flight: set.next_flight,
        files: set.files.clone(),
    }
}
