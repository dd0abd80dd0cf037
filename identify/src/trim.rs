//! Trim: the constant torque that a vehicle flies against, and whether it is the same in all flights.
//!
//! A propeller that was changed or a battery that was strapped on differently shows as a constant angular acceleration
//! that the commands of one flight contain and those of another do not. No property of the vehicle explains both, and
//! a fit that has to would bend whatever it can. So flights whose trims differ are compared without the mean of their
//! angular accelerations, and the trims are reported for each.

use crate::candidate::Candidate;
use crate::fit::Bench;
use crate::prepared::{Equation, Prepared};
use crate::whiteness::column;
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

/// Takes the mean of the angular acceleration's rows off them.
pub fn take_off(flight: &Prepared, rows: &mut [f64]) {
    let Some(offset) = flight.offset_of(Equation::AngularAcceleration) else { return };
    let width = flight.width();
    for axis in 0..3 {
        let own = || (offset + axis..rows.len()).step_by(width);
        let mean = own().map(|at| rows[at]).sum::<f64>() / own().count().max(1) as f64;
        for at in (offset + axis..rows.len()).step_by(width) {
            rows[at] -= mean;
        }
    }
}

/// Puts the mean of each block, given by its first and last knot, in place of the angular acceleration's rows.
pub fn keep_means(flight: &Prepared, rows: &mut [f64], blocks: &[(usize, usize)]) {
    let Some(offset) = flight.offset_of(Equation::AngularAcceleration) else { return };
    let width = flight.width();
    for (first, last) in blocks {
        for axis in 0..3 {
            let own = || (first * width + offset + axis..last * width).step_by(width);
            let mean = own().map(|at| rows[at]).sum::<f64>() / own().count().max(1) as f64;
            own().for_each(|at| rows[at] = mean);
        }
    }
}

/// The trims of all flights where they differ, after what a shift of the centre of mass that all share explains; then
/// the bench compares without them. Empty where the flights agree.
pub fn compare(bench: &mut Bench, open: &[Candidate]) -> Vec<Trim> {
    if bench.fit.iter().chain(&bench.test).any(Prepared::is_assumed) {
        // Their means are all there is.
        return Vec::new();
    }
    let declared = bench.model.parameters.declared();
    bench.weigh(&bench.fitted(&declared, &[]), open);
    let mut shared = bench.fitted(&declared, &[]);
    for effect in ["com-offset", "weak-rotor"] {
        let own = open.iter().filter(|candidate| candidate.effect == effect);
        let which: Vec<usize> = own.flat_map(|candidate| candidate.which.clone()).collect();
        if !which.is_empty() {
            let fitted = bench.fitted(&declared, &which);
            if fitted.test_sum() < shared.test_sum() {
                shared = fitted;
            }
        }
    }
    let flights = bench.fit.iter().chain(&bench.test);
    let found: Vec<(Trim, f64)> =
        flights.filter_map(|flight| of_flight(bench, flight, &shared.values)).collect();
    let differ = (0..3).any(|axis| {
        let mean = found.iter().map(|(own, _)| own.angular_acceleration_rad_s2[axis]).sum::<f64>()
            / found.len() as f64;
        found.iter().any(|(own, spread)| {
            let away = (own.angular_acceleration_rad_s2[axis] - mean).abs();
            away > SURE * own.deviation_rad_s2[axis] && away > LARGE * spread
        })
    });
    bench.has_own_trims = differ;
    if differ { found.into_iter().map(|(own, _)| own).collect() } else { Vec::new() }
}

/// The trim of a flight and the spread of its angular acceleration.
fn of_flight(bench: &Bench, flight: &Prepared, values: &[f64]) -> Option<(Trim, f64)> {
    flight.offset_of(Equation::AngularAcceleration)?;
    let residual = bench.model.residual_under(flight, values);
    let per_block = ((bench.block_s / (flight.layout.box_steps as f64 * flight.layout.clock.step_s)).ceil()
        as usize)
        .max(1);
    let (mut means, mut deviations, mut spread) = ([0.0; 3], [0.0; 3], 0.0_f64);
    for axis in 0..3 {
        let rows = column(flight, &residual, Equation::AngularAcceleration, axis);
        // From fewer blocks no deviation can be told.
        if rows.len() < 5 * per_block {
            return None;
        }
        let mean = rows.iter().sum::<f64>() / rows.len() as f64;
        let blocks: Vec<f64> =
            rows.chunks(per_block).map(|own| own.iter().sum::<f64>() / own.len() as f64 - mean).collect();
        let count = blocks.len() as f64;
        means[axis] = mean;
        deviations[axis] =
            (blocks.iter().map(|own| own * own).sum::<f64>() / (count * (count - 1.0).max(1.0))).sqrt();
        spread =
            spread.max((rows.iter().map(|own| (own - mean).powi(2)).sum::<f64>() / rows.len() as f64).sqrt());
    }
    let trim = Trim {
        flight: flight.flight.name.clone(),
        angular_acceleration_rad_s2: means,
        deviation_rad_s2: deviations,
    };
    Some((trim, spread))
}
