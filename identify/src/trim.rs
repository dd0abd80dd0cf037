//! Trim: the constant torque and force that a vehicle flies against, and whether they are the same in all flights.
//!
//! A propeller that was changed or a battery that was strapped on differently shows as a constant acceleration that the
//! commands of one flight contain and those of another do not. No property of the vehicle explains both. A fit takes trims
//! for random effects (`whitening`); here they are measured, for the report and for predictions with a flight's own trim.

use crate::fit::Problem;
use crate::prepared::{BOX_STEPS, Equation, Prepared};
use crate::rows::column;
use crate::statistics::{deviation, mean};
use serde::Serialize;

/// Trims differ beyond so many standard deviations.
const SURE: f64 = 6.0;
/// And by at least this part of the residual's own spread.
const LARGE: f64 = 0.3;
/// A trim counts by the time that it was seen, against this time: about ten times that over which disturbances of flights
/// remember themselves; tuned, no source.
const SETTLED_S: f64 = 2.0;

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

/// The trim of one flight as it was seen up to each moment.
#[derive(Debug, Default)]
pub struct OwnTrim {
    /// Ends of the windows, in s.
    time_s: Vec<f64>,
    /// Angular acceleration in B and acceleration in W beyond the model's, as known then.
    seen: Vec<[f64; 6]>,
}

impl OwnTrim {
    /// The trim of `flight` under `values`: the mean of what the model leaves up to each moment, by the share of the time
    /// that it was seen.
    pub fn of(problem: &Problem, flight: &Prepared, values: &[f64]) -> Self {
        let residual = problem.model.residual_under(flight, values);
        let columns = [Equation::AngularAcceleration, Equation::Acceleration]
            .map(|equation| [0, 1, 2].map(|axis| column(flight, &residual, equation, axis)));
        let (clock, knot_s) = (&flight.layout.clock, BOX_STEPS as f64 * flight.layout.clock.step_s);
        let (mut sum, mut trim) = ([0.0; 6], Self::default());
        for (at, knot) in flight.layout.knots.iter().enumerate() {
            for (sum, column) in sum.iter_mut().zip(columns.iter().flatten()) {
                *sum += column.get(at).copied().unwrap_or(0.0);
            }
            // A window reaches two knots beyond its middle.
            trim.time_s.push(clock.at(*knot) + 2.0 * knot_s);
            let rows = (at + 1) as f64;
            trim.seen.push(sum.map(|sum| sum / (rows + SETTLED_S / knot_s)));
        }
        trim
    }

    /// Angular acceleration in B and acceleration in W that were known at `at_s`.
    pub fn at(&self, at_s: f64) -> [f64; 6] {
        let seen = self.time_s.partition_point(|time_s| *time_s <= at_s);
        seen.checked_sub(1).map_or([0.0; 6], |last| self.seen[last])
    }
}
