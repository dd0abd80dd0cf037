//! Offsets between the clocks of a flight: lateness of attitude and position against the inertial unit, by the
//! sensors alone, and of rotor speeds that drive the model.
//!
//! The attitude's rate of change and the gyroscope's reading are the same quantity. So are the position's
//! second derivative and the accelerometer's reading, rotated by the attitude, less gravity. No model is needed
//! to see by how much one lags. The lateness that the attitudes of all flights share is left to the candidate
//! `sensor-delay`. A flight's own lateness beyond that is removed, and so is that of position and velocity
//! beyond it. Rotor speeds are the one channel whose lateness takes a model (`rotor_clock`); the clock of the inertial unit stays.

use crate::data::clock::Lateness;
use crate::data::parts;
use crate::data::prepared::{Equation, Prepared, Translation};
use crate::model::noise_model::NoiseModel;
use crate::model::problem::Problem;
use crate::model::sensor_effects::POSE_DELAY;
use crate::model::whitening::{ComponentNoise, Noises};
use crate::numbers::normal::Block;
use crate::numbers::offset::{Found, LATE_MAX_S, descended};
use crate::search::rotor_clock::of_rotor_speed;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// Bias of an offset due to the samples' positions on the grid, as a part of the period of the shifted channel
/// (docs/validation.md). It comes from the noise that interpolation leaves; blocks of time do not show it.
const BETWEEN_SAMPLES: f64 = 0.1;

/// Lateness of a channel against the inertial unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Offset {
    /// The offset in s; positive where the channel is late.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// The part of it that was removed before the fit.
    pub taken_off: f64,
}

impl Offset {
    fn of(found: Found, taken_off: f64) -> Self {
        let half = libm::hypot(1.96 * found.deviation_s, found.between_s);
        Self { value: found.late_s, low: found.late_s - half, high: found.late_s + half, taken_off }
    }
}

/// Offsets by channel; `None` where the flight lacks the channels that it takes, or has too little of them. That of rotor speeds is `None`
/// where commands are logged.
pub type Offsets = BTreeMap<&'static str, Option<Offset>>;

/// The attitude's offset from the gyroscope.
fn of_attitude(problem: &Problem, flight: &Prepared) -> Option<Found> {
    flight.offset_of(Equation::Gyroscope)?;
    let parameter =
        problem.model.parameters.all.iter().position(|parameter| *parameter.kind == POSE_DELAY)?;
    let mut values = problem.model.parameters.baseline();
    let between_s = BETWEEN_SAMPLES * flight.flight.attitude.period_s().unwrap_or(0.0);
    descended(0.0, LATE_MAX_S, between_s, |late_s| {
        values[parameter] = late_s;
        problem.blocks_of(flight, &values, &[parameter])
    })
}

/// Returns the offset of position or velocity from the accelerometer, whose readings are rotated by an attitude
/// that is `attitude_s` late. The inertial side is shifted, not the position: a position's second derivative is
/// mostly noise, and that of a shifted position would depend on how its samples lie on the grid.
fn of_translation(
    problem: &Problem,
    flight: &Prepared,
    translation: Translation,
    attitude_s: f64,
) -> Option<Found> {
    const ASIDE_S: f64 = 1e-3;
    let gravity_m_s2 = problem.model.vehicle.gravity_m_s2;
    let rows = flight.translation_rows(translation)?;
    flight.offset_of(Equation::SpecificForce)?;
    let periods = [flight.flight.attitude.period_s(), flight.flight.specific_force.period_s()];
    let between_s = BETWEEN_SAMPLES * periods.into_iter().flatten().fold(0.0, f64::max);
    let blocks = problem.block_knots(flight);
    descended(0.0, LATE_MAX_S, between_s, |late_s| {
        let inertial = |aside_s: f64| {
            let moved_s = -late_s - aside_s;
            flight.inertial_rows(translation, attitude_s + moved_s, moved_s, gravity_m_s2)
        };
        let [now, ahead, behind] = [0.0, ASIDE_S, -ASIDE_S].map(inertial);
        let of_knots = |(first, end): &(usize, usize)| {
            let mut block = Block::zero(4);
            for at in 3 * first..3 * end {
                // Beside the offset a constant on each axis, for what the accelerometer's bias makes of it.
                let mut row = [(behind[at] - ahead[at]) / (2.0 * ASIDE_S), 0.0, 0.0, 0.0];
                row[1 + at % 3] = 1.0;
                block.add(rows[at] - now[at], &row, 1.0);
            }
            block.complete();
            block
        };
        blocks.iter().map(of_knots).collect()
    })
}

/// Noises under which only gyroscope and attitude count.
fn kinematic_noises() -> Noises {
    (0..3)
        .map(|axis| ((Equation::Gyroscope.name(), axis), ComponentNoise::of(NoiseModel::white(1.0))))
        .collect()
}

/// Offsets found for one flight.
struct Clocks {
    attitude: Option<Found>,
    position: Option<Found>,
    velocity: Option<Found>,
    rotor_speed: Option<Found>,
}

impl Clocks {
    fn of(problem: &Problem, flight: &Prepared) -> Self {
        let attitude = of_attitude(problem, flight);
        // Without a gyroscope nobody knows which of the two is late.
        let of = |translation| of_translation(problem, flight, translation, attitude?.late_s);
        let (position, velocity) = (of(Translation::Position), of(Translation::Velocity));
        Self { attitude, position, velocity, rotor_speed: of_rotor_speed(problem, flight) }
    }

    /// Returns the lateness to remove, where `shared` is the attitudes' lateness that all flights share.
    fn taken_off(&self, shared: &Found, least_s: f64) -> Lateness {
        let shift = self.attitude.filter(|shift| shift.is_beyond(shared, least_s));
        let attitude_s = shift.map_or(0.0, |shift| shift.late_s - shared.late_s);
        let of = |translation: Option<Found>| {
            let apart = translation
                .filter(|shift| self.attitude.is_some_and(|other| shift.is_beyond(&other, least_s)));
            apart.map_or(attitude_s, |shift| shift.late_s - shared.late_s)
        };
        let (position_s, velocity_s) = (of(self.position), of(self.velocity));
        // No effect stands for a lateness of theirs that flights share.
        let on_time = Found { late_s: 0.0, deviation_s: 0.0, between_s: 0.0 };
        let rotors = self.rotor_speed.filter(|shift| shift.is_beyond(&on_time, least_s));
        let rotor_speed_s = rotors.map_or(0.0, |shift| shift.late_s);
        Lateness { attitude_s, position_s, velocity_s, rotor_speed_s }
    }
}

/// The problem without the lateness of its clocks, and the offsets that were found for each of its flights.
///
/// Removes from each flight the lateness of its attitude beyond the mean of the estimation data. Position and
/// velocity move with the attitude; if they differ from it, their own lateness beyond that mean is removed.
/// Only offsets that are certain are removed.
pub fn align(problem: Problem<'_>) -> (Problem<'_>, Vec<(String, Offsets)>) {
    let noises = problem.noises;
    let kinematic = Problem { noises: kinematic_noises(), ..problem };
    let flights: Vec<&Prepared> = kinematic.flights().collect();
    let of_flight = |flight: &&Prepared| {
        let part = parts::of_flight(flight);
        Clocks::of(&kinematic, part.as_ref().unwrap_or(flight))
    };
    let clocks: Vec<Clocks> = flights.par_iter().map(of_flight).collect();
    let of_fit: Vec<Found> =
        clocks[..kinematic.estimation.len()].iter().filter_map(|shift| shift.attitude).collect();
    let shared = Found::mean(&of_fit);
    let mut problem = Problem { noises, shared_late_s: shared.late_s, ..kinematic };
    let least_s = problem.least_delay_s() / 2.0;
    let mut offsets = Vec::new();
    for (flight, shift) in problem.flights_mut().zip(clocks) {
        let late = shift.taken_off(&shared, least_s);
        flight.set_late(late);
        let offset = |found: Option<Found>, taken_off_s| found.map(|found| Offset::of(found, taken_off_s));
        let of_flight = [
            ("attitude", offset(shift.attitude, late.attitude_s)),
            ("position", offset(shift.position, late.position_s)),
            ("velocity", offset(shift.velocity, late.velocity_s)),
            ("rotor_speed", offset(shift.rotor_speed, late.rotor_speed_s)),
        ];
        offsets.push((flight.flight.name.clone(), Offsets::from(of_flight)));
    }
    (problem, offsets)
}
