//! Clocks of a flight against each other: how late the pose is against the gyroscope, by the sensors alone.
//!
//! The attitude's rate of change and the gyroscope's reading are the same quantity, so no model is needed to see by
//! how much one lags. What all flights share is left to the candidate `sensor-delay`; what a single flight has beyond
//! that is taken off its pose before anything else, and reported.

use crate::fit::{Bench, Weights};
use crate::normal;
use crate::parameter::{Owner, SensorParameter};
use crate::prepared::{Equation, Prepared};
use serde::Serialize;

/// Gauss-Newton steps.
const STEPS: usize = 40;
/// From fewer blocks no deviation can be told.
const LEAST_BLOCKS: usize = 5;
/// An offset is real beyond so many standard deviations.
const SURE: f64 = 4.0;

/// How the samples lie on the grid decides how much noise their interpolation leaves, which pulls at the offset by up to
/// this part of the pose's period (docs/validation.md), beyond what blocks of time can show.
const BETWEEN_SAMPLES: f64 = 0.1;

/// Lateness of the pose against the inertial unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Offset {
    /// The offset in s; positive where the pose is late.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// The part of it that this flight has beyond what the fit flights share, taken off before the fit.
    pub taken_off: f64,
}

/// The offset of one flight with its standard deviation; `None` without both gyroscope and attitude.
#[must_use]
pub fn offset(bench: &Bench, flight: &Prepared) -> Option<(f64, f64)> {
    flight.offset_of(Equation::Gyroscope)?;
    let is_pose = |owner: &Owner| matches!(owner, Owner::Sensor(SensorParameter::PoseDelay));
    let parameter = bench.model.parameters.all.iter().position(|own| is_pose(&own.owner))?;
    let mut values = bench.model.parameters.declared();
    for _ in 0..STEPS {
        let blocks = bench.blocks_of(flight, &values, &[parameter]);
        let total = normal::sum(&blocks);
        if total.gram[(0, 0)] <= 0.0 || blocks.len() < LEAST_BLOCKS {
            return None;
        }
        let step = -total.gradient[0] / total.gram[(0, 0)];
        let deviation = normal::covariance(&blocks)[(0, 0)].max(0.0).sqrt();
        // A line through a course is good for a fraction of its quickest turn.
        values[parameter] += step.clamp(-0.02, 0.02);
        if step.abs() < 1e-5_f64.max(0.02 * deviation) {
            return Some((values[parameter], deviation));
        }
    }
    None
}

fn pose_period_s(flight: &Prepared) -> f64 {
    flight.flight.attitude.period_s().unwrap_or(0.0)
}

/// Weights under which only gyroscope and attitude count.
#[must_use]
pub fn kinematic_weights() -> Weights {
    (0..3).map(|axis| ((Equation::Gyroscope.name(), axis), 1.0)).collect()
}

/// Takes off each flight's pose what it is late beyond the mean of the fit flights, where that is sure, and says what
/// was found for each flight of `fit` and then of `test`.
pub fn align(bench: &mut Bench) -> Vec<(String, Option<Offset>)> {
    let weights = std::mem::replace(&mut bench.weights, kinematic_weights());
    let found: Vec<Option<(f64, f64)>> =
        bench.fit.iter().chain(&bench.test).map(|flight| offset(bench, flight)).collect();
    bench.weights = weights;
    let of_fit: Vec<(f64, f64)> = found[..bench.fit.len()].iter().flatten().copied().collect();
    let shared = of_fit.iter().map(|(value, _)| value).sum::<f64>() / (of_fit.len() as f64).max(1.0);
    let least_s = bench.least_delay_s() / 2.0;
    let mut offsets = Vec::new();
    for (flight, found) in bench.fit.iter_mut().chain(&mut bench.test).zip(found) {
        let offset = found.map(|(value, deviation)| {
            let own = value - shared;
            let is_sure = own.abs() > SURE * deviation && own.abs() > least_s;
            flight.pose_offset_s = if is_sure { own } else { 0.0 };
            let half = (1.96 * deviation).hypot(BETWEEN_SAMPLES * pose_period_s(flight));
            Offset { value, low: value - half, high: value + half, taken_off: flight.pose_offset_s }
        });
        offsets.push((flight.flight.name.clone(), offset));
    }
    offsets
}
