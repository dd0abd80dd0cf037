//! Prediction over horizons: the model, set to the measured state at the start of each window, flown on the measured
//! commands to its end. The same windows as those of the plant node with an input `measured`.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::clock::Clock;
use crate::prepared::{Held, SETTLE_S, attitudes};
use crate::track::{Track, valid_about};
use flights::Flight;
use flights::state::{StateQuantity, VehicleState, WindowEndErrors};
use nalgebra::{UnitQuaternion, Vector3};
use plant::{Airframe, Backend, FreeFlight, NewtonEuler, RigidBody};
use std::collections::BTreeMap;

/// Length of a tick.
const TICK_S: f64 = 0.001;

/// Windows that begin earlier do not count.
const SETTLE_TICKS: usize = (SETTLE_S / TICK_S) as usize;

/// The measured states of a flight, tick by tick.
#[derive(Debug)]
pub struct Measured {
    clock: Clock,
    bodies: Vec<RigidBody>,
    is_valid: Vec<bool>,
}

/// Root mean squares at the ends of windows, by channel.
pub type Errors = BTreeMap<&'static str, f64>;

impl Measured {
    /// The states of `flight`; `None` where it has no commands, or no motion.
    pub fn of(flight: &Flight) -> Option<Self> {
        let (first_s, last_s) = flight.attitude.span_s().or(flight.angular_velocity.span_s())?;
        let (start_s, end_s) = flight.command.span_s()?;
        let clock = Clock::spanning(first_s.max(start_s), last_s.min(end_s) - 0.01, TICK_S);
        let position = Track::sampled(&flight.position, 0.0, &clock);
        let attitude = Track::sampled(&flight.attitude, 0.0, &clock);
        let gyroscope = Track::sampled(&flight.angular_velocity, 0.0, &clock);
        // What was not measured is derived from samples to both sides.
        let (velocity, of_position) = if flight.velocity.is_empty() {
            let reach = reach(flight.position.period_s());
            (position.slope(reach, TICK_S), reach)
        } else {
            (Track::sampled(&flight.velocity, 0.0, &clock).values, 0)
        };
        let quaternions = attitudes(&attitude);
        let (rates, of_attitude) = if flight.angular_velocity.is_empty() {
            let reach = reach(flight.attitude.period_s());
            (turning(&quaternions, reach), reach)
        } else {
            (gyroscope.values.clone(), 0)
        };
        let body = |i: usize| RigidBody {
            position_W_m: position.values[i].into(),
            velocity_W_m_s: velocity[i].into(),
            attitude_WB: quaternions[i],
            angular_velocity_B_rad_s: rates[i].into(),
        };
        let mut is_valid = vec![true; clock.count];
        let mut require = |is_there: bool, valid: &[bool], reach: usize| {
            if is_there {
                is_valid.iter_mut().zip(valid_about(valid, reach)).for_each(|(all, about)| *all &= about);
            }
        };
        require(!flight.position.is_empty(), &position.valid, of_position);
        require(!flight.attitude.is_empty(), &attitude.valid, of_attitude);
        require(!flight.angular_velocity.is_empty(), &gyroscope.valid, 0);
        Some(Self { bodies: (0..clock.count).map(body).collect(), clock, is_valid })
    }

    /// Errors of `airframe` at the ends of windows of `horizon_s`.
    pub fn predicted(&self, flight: &Flight, airframe: Airframe, horizon_s: f64) -> Errors {
        let window = (horizon_s / TICK_S).round() as usize;
        let memory = airframe.initial_state(0, "predict", TICK_S);
        let mut commands = Held::new(&flight.command);
        let first = commands.at(self.clock.start_s);
        let mut plant = FreeFlight::new(NewtonEuler::flying(airframe, 1), self.bodies[0], memory);
        plant.settle_rotors(&first);
        let mut errors = WindowEndErrors::default();
        for tick in 1..self.clock.count {
            plant.step(&commands.at(self.clock.at(tick - 1)), TICK_S, &[]);
            let (body, measured) = (&plant.state().body, &self.bodies[tick]);
            if tick % window == 0 {
                if tick - window >= SETTLE_TICKS
                    && self.is_valid[tick - window..=tick].iter().all(|is_valid| *is_valid)
                {
                    errors.add(&state(body), &state(measured));
                }
                plant.set_body(measured);
            }
        }
        if errors.windows() == 0 {
            return Errors::new();
        }
        let measured = StateQuantity::ALL.into_iter().filter(|quantity| quantity.is_measured(flight));
        measured.map(|quantity| (quantity.name(), errors.rms(quantity))).collect()
    }
}

fn state(body: &RigidBody) -> VehicleState {
    VehicleState {
        position_W_m: body.position_W_m.into(),
        velocity_W_m_s: body.velocity_W_m_s.into(),
        attitude_WB: body.attitude_WB.coords.into(),
        angular_velocity_B_rad_s: body.angular_velocity_B_rad_s.into(),
    }
}

/// A derivative reaches over no more, however far samples are apart: its cost grows with its reach.
const SLOWEST_S: f64 = 0.5;

/// Ticks to both sides of a derivative: three samples.
fn reach(period_s: Option<f64>) -> usize {
    ((3.0 * period_s.unwrap_or(0.0).min(SLOWEST_S) / TICK_S).round() as usize).max(1)
}

fn turning(attitude: &[UnitQuaternion<f64>], reach: usize) -> Vec<[f64; 3]> {
    let last = attitude.len() - 1;
    let rate = |i: usize| -> Vector3<f64> {
        let (before, after) = (i.saturating_sub(reach), (i + reach).min(last));
        let span_s = (after - before).max(1) as f64 * TICK_S;
        (attitude[before].inverse() * attitude[after]).scaled_axis() / span_s
    };
    (0..attitude.len()).map(|i| rate(i).into()).collect()
}
