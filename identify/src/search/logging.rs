//! Timing errors that the logging of commands makes.
//!
//! A controller that sends more commands than the log has changes them between two logged ones. Held from sample to sample,
//! the logged commands act late, by half of their period in the mean; the motors then seem faster than they are, and a
//! delay shorter. Blocks of time do not show this.

use crate::model::parameter::Parameter;
use crate::model::problem::Problem;
use crate::model::sensor_effects::{IMU_DELAY, POSE_DELAY};
use crate::search::candidate::Candidate;
use crate::search::fit_result::FitResult;
use flights::Flight;
use plant::effects::EffectKind;
use vehicles::MotorModel;

/// Usual longest time between two commands of each flight with commands.
fn periods_s(problem: &Problem) -> impl Iterator<Item = f64> {
    let flights = problem.flights().map(|flight| &*flight.flight).filter(|flight| !flight.commands_on_change);
    flights.filter_map(Flight::command_period_s)
}

/// The shortest of these periods, which explains a shift in time that all flights share; 0 without commands.
fn period_s(problem: &Problem) -> f64 {
    periods_s(problem).reduce(f64::min).unwrap_or(0.0)
}

/// Time by which the rotor speeds follow slow changes of the commands.
fn lag_s(motor: MotorModel) -> f64 {
    match motor {
        MotorModel::FirstOrder { time_constant_s } => time_constant_s,
        MotorModel::SecondOrder { natural_frequency_rad_s, damping_ratio } => {
            2.0 * damping_ratio / natural_frequency_rad_s
        }
    }
}

/// Lateness of the logged commands that was fitted as a lead of the sensors, in s: the logging explains leads up to a
/// period. `None` if it does not explain `candidate`.
pub fn explained_lead_s(problem: &Problem, candidate: &Candidate, fitted: &FitResult) -> Option<f64> {
    let [parameter] = candidate.free[..] else { return None };
    let lead_s = -fitted.values[parameter];
    let is_sensor = *candidate.kind == POSE_DELAY || *candidate.kind == IMU_DELAY;
    (is_sensor && lead_s > 0.0 && lead_s < period_s(problem)).then_some(lead_s)
}

/// Note on commands whose logging makes them late by `lead_s`.
pub fn note(problem: &Problem, lead_s: f64) -> String {
    format!(
        "command: in the log, commands act {lead_s:.4} s late, which their logging every {:.4} s explains; no effect is named for \
         it, and delays and lags are known up to half of that period; log every command",
        period_s(problem)
    )
}

/// Time by which the motors seem faster, in s, if the logging of the commands explains it: less than one of their periods.
pub fn explained_lag_s(
    problem: &Problem,
    kind: &EffectKind,
    free: &[usize],
    fitted: &FitResult,
) -> Option<f64> {
    if !kind.changes_drive {
        return None;
    }
    let mut without = fitted.values.clone();
    free.iter().for_each(|at| without[*at] = problem.model.parameters.all[*at].baseline);
    let of = |values: &[f64]| lag_s(problem.model.airframe(values).vehicle().motor);
    let faster_s = of(&without) - of(&fitted.values);
    (faster_s > 0.0 && faster_s < period_s(problem)).then_some(faster_s)
}

/// Amount by which the logging of the commands makes the estimate of a parameter too small at most, in its unit.
pub fn bias(problem: &Problem, parameter: &Parameter) -> f64 {
    let half_s = || periods_s(problem).fold(0.0, f64::max) / 2.0;
    match (parameter.kind, parameter.spec().name) {
        (kind, _) if kind.is_delay => half_s(),
        (kind, "slowness") if kind.changes_drive => half_s() / lag_s(problem.model.vehicle.motor),
        _ => 0.0,
    }
}
