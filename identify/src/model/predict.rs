//! Prediction over horizons: the model, set to the measured state at the start of each window, flown on the measured
//! commands to its end. The same windows as those of the plant node with an input `measured`. A flight without commands is
//! flown with its measured rotor speeds.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::data::measured::{Measured, SLACK_S};
use crate::model::forecast::{AddedAcceleration, Forecast};
use flights::state::{StateQuantity, VehicleState, WindowEndErrors};
use flights::{Channel, Flight, Row};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use plant::{Airframe, Backend, FreeFlight, NewtonEuler, PerRotor, RigidBody, RotorState};
use std::collections::BTreeMap;
use vehicles::ROTORS_MAX;

/// Length of a tick where rotors follow commands: that of the bus.
const TICK_S: f64 = 0.001;
/// Length of a tick where rotor speeds are measured, so that no motor is simulated; tuned, no source.
pub(crate) const ROTOR_TICK_S: f64 = 0.0025;
/// The same for logs with a period of at least this: a step of fourth order is stable up to a damping of 550 1/s, and a vehicle that turns by 10 rad/s
/// is followed to 1e-9.
const LONG_ROTOR_TICK_S: f64 = 0.005;
/// Part by which the period of such a log may be shorter.
const PERIOD_SLACK: f64 = 0.02;

/// Root mean squares at the ends of windows, by channel.
pub type Errors = BTreeMap<&'static str, f64>;

/// The end of a window that counts: the states that are compared there.
#[derive(Debug, Clone, Copy)]
pub struct WindowEnd {
    /// Begin of the window, in s.
    pub from_s: f64,
    /// The state as the model predicts it.
    pub simulated: RigidBody,
    /// Persistence: velocity, attitude and rates as they were measured at the begin; the position moves on at that velocity.
    pub persistent: RigidBody,
    /// The state as it was measured.
    pub measured: RigidBody,
}

impl Measured {
    /// Errors of `airframe` at the ends of windows of `horizon_s`.
    pub fn predicted(&self, flight: &Flight, airframe: Airframe, horizon_s: f64) -> Errors {
        errors(flight, &self.ends(airframe, horizon_s, |_| Forecast::none()), |end| end.simulated)
    }

    /// The predicted ends of the windows of `horizon_s` that count, one window after the other. `airframe`
    /// predicts them under a `push` over each window, by the window's begin.
    pub fn ends(&self, airframe: Airframe, horizon_s: f64, push: impl Fn(f64) -> Forecast) -> Vec<WindowEnd> {
        self.ends_within(airframe, &[horizon_s], push).remove(0)
    }

    /// The same for several horizons, in rising order: one window of the longest after the other, of which each shorter horizon is a part.
    pub fn ends_within(
        &self,
        airframe: Airframe,
        horizons_s: &[f64],
        push: impl Fn(f64) -> Forecast,
    ) -> Vec<Vec<WindowEnd>> {
        let tick_s = self.rotor_speed.as_ref().map_or(TICK_S, rotor_tick_s);
        let windows: Vec<usize> =
            horizons_s.iter().map(|horizon_s| (horizon_s / tick_s).round() as usize).collect();
        debug_assert!(
            horizons_s.iter().zip(&windows).all(|(horizon_s, ticks)| {
                *ticks > 0 && (*ticks as f64 * tick_s - horizon_s).abs() < SLACK_S
            }),
            "horizons are whole numbers of ticks of {tick_s} s: {horizons_s:?}"
        );
        let memory = airframe.initial_state(0, "predict", tick_s);
        let (start_s, end_s) = self.played.span_s();
        let at_s = |tick: usize| start_s + tick as f64 * tick_s;
        let mut hint = 0;
        let mut before = self.played.at(start_s, &mut hint);
        let count = airframe.vehicle().rotors.len();
        let mut begin = body(&before);
        let mut plant = FreeFlight::new(NewtonEuler::flying(airframe, 1), begin, memory);
        plant.settle_rotors(&before.command[..count]);
        let (mut ends, mut pushing) = (vec![Vec::new(); windows.len()], push(start_s));
        let (mut begin_tick, mut tick, mut speed_hint) = (0, 0, 0);
        let last_tick = ((end_s - start_s + SLACK_S) / tick_s) as usize;
        while tick < last_tick {
            tick += 1;
            // A push acts over the tick: half of it before, half behind.
            let over_tick = (!pushing.is_none()).then(|| pushing.at(at_s(tick) - 0.5 * tick_s));
            let kick = |plant: &mut FreeFlight| {
                if let Some(push) = over_tick {
                    let body = pushed(&plant.state().body, push, 0.5 * tick_s);
                    plant.set_body(&body);
                }
            };
            kick(&mut plant);
            plant.set_measured_voltage(before.battery_v);
            match &self.rotor_speed {
                None => plant.step(&before.command[..count], tick_s, &[]),
                Some(speeds) => {
                    let rotors = rotors_between(speeds, at_s(tick - 1), at_s(tick), &mut speed_hint);
                    plant.step_with_rotors(&PerRotor::from_fn(count, |rotor| rotors[rotor]), tick_s);
                }
            }
            kick(&mut plant);
            before = self.played.at(at_s(tick), &mut hint);
            if self.turns_as_measured {
                let RigidBody { attitude_WB, angular_velocity_B_rad_s, .. } = body(&before);
                plant.set_body(&RigidBody { attitude_WB, angular_velocity_B_rad_s, ..plant.state().body });
            }
            let Some(at) = windows.iter().position(|window| *window == tick - begin_tick) else { continue };
            let (from_s, measured) = (at_s(begin_tick), body(&before));
            if self.is_chosen(from_s, at_s(tick)) && self.played.counts(from_s, at_s(tick)) {
                let position_W_m = begin.position_W_m + horizons_s[at] * begin.velocity_W_m_s;
                ends[at].push(WindowEnd {
                    from_s,
                    simulated: plant.state().body,
                    persistent: RigidBody { position_W_m, ..begin },
                    measured,
                });
            }
            if at + 1 == windows.len() {
                // A battery's charge depends on all that was flown before; a measured voltage does not need it.
                if plant.battery().is_none() || before.battery_v.is_some() {
                    let next_s = self.next_window_s(at_s(tick), at_s(tick) - from_s);
                    let next = ((next_s - start_s - SLACK_S) / tick_s).ceil() as usize;
                    if next > last_tick {
                        break;
                    }
                    if next > tick {
                        tick = next;
                        before = self.played.at(at_s(tick), &mut hint);
                        plant.settle_rotors(&before.command[..count]);
                    }
                }
                (begin, begin_tick, pushing) = (body(&before), tick, push(at_s(tick)));
                plant.set_body(&begin);
            }
        }
        ends
    }
}

/// Length of a tick in which rotors turn at measured `speeds`.
fn rotor_tick_s(speeds: &Channel<ROTORS_MAX>) -> f64 {
    let period_s = (1.0 + PERIOD_SLACK) * speeds.period_s().unwrap_or_default();
    if period_s >= LONG_ROTOR_TICK_S { LONG_ROTOR_TICK_S } else { ROTOR_TICK_S }
}

/// The rotors at `time_s`, on straight lines between the samples of their speeds. `hint` is an index near, kept between calls
/// at growing times.
pub(crate) fn rotors_at(
    speeds: &Channel<ROTORS_MAX>,
    time_s: f64,
    hint: &mut usize,
) -> [RotorState; ROTORS_MAX] {
    let (times_s, last) = (&speeds.time_s, speeds.time_s.len() - 1);
    while *hint < last && times_s[*hint + 1] <= time_s + SLACK_S {
        *hint += 1;
    }
    let (before, next) = (*hint, (*hint + 1).min(last));
    let (since_s, span_s) = (time_s - times_s[before], times_s[next] - times_s[before]);
    // Before the first sample and behind the last one the rotors keep their speeds.
    let is_between = span_s > 0.0 && (0.0..=span_s).contains(&since_s);
    std::array::from_fn(|rotor| {
        let (from, to) = (speeds.values[before][rotor], speeds.values[next][rotor]);
        let slope = if is_between { (to - from) / span_s } else { 0.0 };
        RotorState {
            speed_rad_s: if is_between { from + slope * since_s } else { from },
            acceleration_rad_s2: slope,
        }
    })
}

/// The rotors at `from_s`, accelerating to their speeds at `to_s`, between which there may be several samples.
pub(crate) fn rotors_between(
    speeds: &Channel<ROTORS_MAX>,
    from_s: f64,
    to_s: f64,
    hint: &mut usize,
) -> [RotorState; ROTORS_MAX] {
    let (from, to) = (rotors_at(speeds, from_s, hint), rotors_at(speeds, to_s, &mut hint.clone()));
    std::array::from_fn(|rotor| {
        let grown_rad_s = to[rotor].speed_rad_s - from[rotor].speed_rad_s;
        RotorState { acceleration_rad_s2: grown_rad_s / (to_s - from_s), ..from[rotor] }
    })
}

/// Errors of a state `of` each end, for the quantities that `flight` has a measurement of; none without ends.
pub fn errors(flight: &Flight, ends: &[WindowEnd], of: impl Fn(&WindowEnd) -> RigidBody) -> Errors {
    let mut sums = WindowEndErrors::default();
    ends.iter().for_each(|end| sums.add(&state(&of(end)), &state(&end.measured)));
    if ends.is_empty() {
        return Errors::new();
    }
    let measured = StateQuantity::ALL.into_iter().filter(|quantity| quantity.is_measured(flight));
    measured.map(|quantity| (quantity.name(), sums.rms(quantity))).collect()
}

/// Errors of a state at the end of a window by axis, in the order of [`StateQuantity::ALL`]: position in m and velocity in m/s along the axes of
/// the world, attitude in deg and rates in rad/s about those of the body.
pub fn components(end: &WindowEnd, state: &RigidBody) -> [[f64; 3]; 4] {
    let turn_B = (end.measured.attitude_WB.inverse() * state.attitude_WB).scaled_axis();
    let away = [
        state.position_W_m - end.measured.position_W_m,
        state.velocity_W_m_s - end.measured.velocity_W_m_s,
        turn_B.map(f64::to_degrees),
        state.angular_velocity_B_rad_s - end.measured.angular_velocity_B_rad_s,
    ];
    away.map(Into::into)
}

/// The body after a push over `span_s`.
fn pushed(body: &RigidBody, push: AddedAcceleration, span_s: f64) -> RigidBody {
    let [x, y, z, forward, left, up] = push.map(|acceleration| acceleration * span_s);
    RigidBody {
        velocity_W_m_s: body.velocity_W_m_s + Vector3::new(forward, left, up),
        angular_velocity_B_rad_s: body.angular_velocity_B_rad_s + Vector3::new(x, y, z),
        ..*body
    }
}

pub(crate) fn state(body: &RigidBody) -> VehicleState {
    VehicleState {
        position_W_m: body.position_W_m.into(),
        velocity_W_m_s: body.velocity_W_m_s.into(),
        attitude_WB: body.attitude_WB.coords.into(),
        angular_velocity_B_rad_s: body.angular_velocity_B_rad_s.into(),
    }
}

pub(crate) fn body(row: &Row) -> RigidBody {
    let [x, y, z, w] = row.attitude;
    RigidBody {
        position_W_m: row.position_m.into(),
        velocity_W_m_s: row.velocity_m_s.into(),
        attitude_WB: UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)),
        angular_velocity_B_rad_s: row.angular_velocity_rad_s.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_flights::{flown, hummingbird};

    /// A constant push along x moves a vehicle that hovers by a t^2 / 2, whatever the length of a tick is.
    #[test]
    fn a_push_acts_over_the_whole_of_each_tick() {
        for (period_s, tick_s) in
            [(0.01, LONG_ROTOR_TICK_S), (0.00495, LONG_ROTOR_TICK_S), (0.002, ROTOR_TICK_S)]
        {
            let flight = flown([2.0, period_s], |_| [0.0, 0.0, 2.0], |_| [0.0; 3]);
            assert_eq!(rotor_tick_s(&flight.rotor_speed), tick_s);
            let push = |_| Forecast::constant([0.0, 0.0, 0.0, 0.4, 0.0, 0.0]);
            let horizons_s = [0.05, 0.1, 0.5];
            let measured = Measured::of(&flight).unwrap();
            let ends = measured.ends_within(Airframe::new(hummingbird()), &horizons_s, push);
            for (ends, horizon_s) in ends.iter().zip(horizons_s) {
                assert!(!ends.is_empty(), "no window of {horizon_s} s at {period_s} s");
                let expected = Vector3::new(0.2 * horizon_s * horizon_s, 0.0, 2.0);
                let found = ends[0].simulated.position_W_m;
                assert!((found - expected).norm() < 1e-9, "{period_s} s, after {horizon_s} s: {found}");
            }
        }
    }

    /// Windows in pieces of a flight are those of the whole flight that lie in them.
    #[test]
    fn windows_in_pieces_are_those_of_the_whole_flight() {
        let moves = |t: f64| [2.0 * libm::sin(1.3 * t), libm::cos(0.9 * t), 2.0];
        let flight = flown([30.0, 0.01], moves, |t| [0.2 * libm::sin(t), 0.0, 0.1 * t]);
        let ends = |measured: Measured| {
            measured.ends_within(Airframe::new(hummingbird()), &[0.1, 0.5], |_| Forecast::none())
        };
        let whole = ends(Measured::of(&flight).unwrap());
        let pieces_s = vec![(3.0, 8.0), (20.0, 26.25)];
        let within = ends(Measured::of(&flight).unwrap().within(pieces_s.clone(), 0.5));
        for (whole, within) in whole.iter().zip(&within) {
            let chosen: Vec<&WindowEnd> = whole
                .iter()
                .filter(|end| {
                    pieces_s.iter().any(|piece| (piece.0 + 0.5..=piece.1 - 0.5).contains(&end.from_s))
                })
                .collect();
            assert_eq!(within.len(), chosen.len());
            assert!(within.len() > 15, "{}", within.len());
            for (found, expected) in within.iter().zip(chosen) {
                assert!((found.from_s - expected.from_s).abs() < 1e-9);
                let apart = (found.simulated.velocity_W_m_s - expected.simulated.velocity_W_m_s).norm();
                assert!(apart < 1e-9, "{} s: {apart}", found.from_s);
            }
        }
    }
}
