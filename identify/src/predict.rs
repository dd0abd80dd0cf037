//! Prediction over horizons: the model, set to the measured state at the start of each window, flown on the measured
//! commands to its end. The same windows as those of the plant node with an input `measured`.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use flights::state::{StateQuantity, VehicleState, WindowEndErrors};
use flights::{Flight, Played, Row};
use nalgebra::{Quaternion, UnitQuaternion};
use plant::{Airframe, Backend, FreeFlight, NewtonEuler, RigidBody};
use std::collections::BTreeMap;

/// Length of a tick.
const TICK_S: f64 = 0.001;
/// Times are sums of decimal fractions: a nanosecond of slack keeps the last moment.
const SLACK_S: f64 = 1e-9;

/// The measured states of a flight, as a player plays them.
#[derive(Debug)]
pub struct Measured {
    played: Played,
}

/// Root mean squares at the ends of windows, by channel.
pub type Errors = BTreeMap<&'static str, f64>;

impl Measured {
    /// The states of `flight`; `None` where it has no commands, or no motion.
    pub fn of(flight: &Flight) -> Option<Self> {
        if flight.command.is_empty() {
            return None;
        }
        Some(Self { played: Played::of(flight).ok()? })
    }

    /// Errors of `airframe` at the ends of windows of `horizon_s`.
    pub fn predicted(&self, flight: &Flight, airframe: Airframe, horizon_s: f64) -> Errors {
        let window = (horizon_s / TICK_S).round() as usize;
        let memory = airframe.initial_state(0, "predict", TICK_S);
        let (start_s, end_s) = self.played.span_s();
        let at_s = |tick: usize| start_s + tick as f64 * TICK_S;
        let mut hint = 0;
        let mut before = self.played.at(start_s, &mut hint);
        let count = airframe.vehicle().rotors.len();
        let mut plant = FreeFlight::new(NewtonEuler::flying(airframe, 1), body(&before), memory);
        plant.settle_rotors(&before.command[..count]);
        let mut errors = WindowEndErrors::default();
        for tick in 1..=((end_s - start_s + SLACK_S) / TICK_S) as usize {
            plant.step(&before.command[..count], TICK_S, &[]);
            before = self.played.at(at_s(tick), &mut hint);
            if tick % window == 0 {
                let measured = body(&before);
                if self.played.counts(at_s(tick - window), at_s(tick)) {
                    errors.add(&state(&plant.state().body), &state(&measured));
                }
                plant.set_body(&measured);
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

fn body(row: &Row) -> RigidBody {
    let [x, y, z, w] = row.attitude;
    RigidBody {
        position_W_m: row.position_m.into(),
        velocity_W_m_s: row.velocity_m_s.into(),
        attitude_WB: UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)),
        angular_velocity_B_rad_s: row.angular_velocity_rad_s.into(),
    }
}
