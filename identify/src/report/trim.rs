//! Trim: the constant torque and force that a vehicle flies against, and whether they are the same in all flights.
//!
//! A propeller that was changed or a battery that was moved shows as a constant acceleration. The commands of one flight
//! contain it and those of another do not. No property of the vehicle explains both. A fit takes trims for random effects
//! (`whitening`); here they are measured, for the report.

use crate::data::prepared::{BOX_STEPS, Equation, Prepared};
use crate::data::rows::column;
use crate::model::problem::Problem;
use crate::numbers::statistics::{deviation, mean};
use serde::Serialize;

/// Trims differ beyond so many standard deviations.
const SURE: f64 = 6.0;
/// And by at least this part of the residual's own spread.
const LARGE: f64 = 0.3;

/// The trim of one flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trim {
    /// The flight.
    pub flight: String,
    /// Mean angular acceleration about x, y and z of the body beyond the model's, in rad/s^2.
    pub angular_acceleration_rad_s2: [f64; 3],
    /// Its standard deviation.
    pub deviation_rad_s2: [f64; 3],
}

/// The trims of all flights under `values`, where they differ; empty where the flights agree.
pub fn differing(problem: &Problem, values: &[f64]) -> Vec<Trim> {
    if problem.flights().any(Prepared::is_assumed) {
        return Vec::new();
    }
    let found: Vec<(Trim, f64)> =
        problem.flights().filter_map(|flight| of_flight(problem, flight, values)).collect();
    let differ = (0..3).any(|axis| {
        let mean = found.iter().map(|(trim, _)| trim.angular_acceleration_rad_s2[axis]).sum::<f64>()
            / found.len() as f64;
        found.iter().any(|(trim, spread)| {
            let away = (trim.angular_acceleration_rad_s2[axis] - mean).abs();
            away > SURE * trim.deviation_rad_s2[axis] && away > LARGE * spread
        })
    });
    if differ { found.into_iter().map(|(trim, _)| trim).collect() } else { Vec::new() }
}

/// The trim of a flight and the spread of its angular acceleration.
fn of_flight(problem: &Problem, flight: &Prepared, values: &[f64]) -> Option<(Trim, f64)> {
    flight.offset_of(Equation::AngularAcceleration)?;
    let residual = problem.model.residual_under(flight, values);
    let knot_s = BOX_STEPS as f64 * flight.layout.clock.step_s;
    let per_block = ((problem.block_s / knot_s).ceil() as usize).max(1);
    let (mut means, mut deviations, mut spread) = ([0.0; 3], [0.0; 3], 0.0_f64);
    for axis in 0..3 {
        let rows = column(flight, &residual, Equation::AngularAcceleration, axis);
        // From fewer blocks no deviation can be told.
        if rows.len() < 5 * per_block {
            return None;
        }
        means[axis] = mean(&rows);
        let squares = rows.chunks(per_block).map(|block| (mean(block) - means[axis]).powi(2));
        let count = squares.len() as f64;
        deviations[axis] = (squares.sum::<f64>() / (count * (count - 1.0).max(1.0))).sqrt();
        spread = spread.max(deviation(&rows));
    }
    let trim = Trim {
        flight: flight.flight.name.clone(),
        angular_acceleration_rad_s2: means,
        deviation_rad_s2: deviations,
    };
    Some((trim, spread))
}
