//! Simulated flights in this process, as a logger without noise keeps them.

use anyhow::{Context, Result};
use bus::messages::{MotorCommand, PlantState};
use hummingbus::bus;
use hummingbus::flights::state::{length, tilt_deg};
use hummingbus::flights::{Channel, Flight, Role};
use hummingbus::inputs::InputFiles;
use identify::LogRates;
use identify::proposal::Limits;
use runtime::event::StopToken;
use runtime::manifest::Manifest;

/// Flies `manifest` to its end; `None` if the vehicle got out of control or the flight was stopped.
///
/// # Errors
/// If the manifest cannot be flown.
pub fn fly(
    manifest: &Manifest,
    files: InputFiles,
    rates: &LogRates,
    stop: &StopToken,
) -> Result<Option<(Flight, Limits)>> {
    let mut simulation = runtime::simulate_reading(manifest, files)?;
    let state = simulation.topic::<PlantState>("/plant/state")?;
    let command = simulation.topic::<MotorCommand>("/controller/command")?;
    let run = &manifest.content.run;
    let tick_s = 1.0 / f64::from(*run.rate_hz.get_ref());
    let ticks = (*run.duration_s.get_ref() / tick_s).round() as u32;
    let mut log = Log { flight: Flight::new("simulated", "", Role::Fit), reached: NOWHERE };
    log.flight.rotors = rates.rotors;
    for tick in 0..ticks {
        if tick % LOOK_TICKS == 0 && stop.count() > 0 {
            return Ok(None);
        }
        // A vehicle that tumbles soon has a motion that is no number.
        if simulation.step().is_err() {
            return Ok(None);
        }
        let state = simulation.newest(state).context("the plant sent no state")?;
        let command = simulation.newest(command).context("the controller sent no command")?;
        log.add(f64::from(tick) * tick_s, state, command);
        let position_m: [f64; 3] = state.position.into();
        let is_finite = position_m.iter().all(|value| value.is_finite());
        if !is_finite || log.reached.tilt_max_deg > OUT_OF_CONTROL_DEG {
            return Ok(None);
        }
    }
    Ok(Some((rates.logged(log.flight, tick_s), log.reached)))
}

/// Ticks between two looks at the stop token.
const LOOK_TICKS: u32 = 100;
/// No manoeuvre asks for such a tilt.
const OUT_OF_CONTROL_DEG: f64 = 100.0;
const NOWHERE: Limits =
    Limits { room_m: [[f64::INFINITY, f64::NEG_INFINITY]; 3], speed_max_m_s: 0.0, tilt_max_deg: 0.0 };

/// A flight, and the limits that it reached.
struct Log {
    flight: Flight,
    reached: Limits,
}

impl Log {
    fn add(&mut self, time_s: f64, state: &PlantState, command: &MotorCommand) {
        let rotors = |values: &[f64]| std::array::from_fn(|rotor| values.get(rotor).copied().unwrap_or(0.0));
        let [position, velocity]: [[f64; 3]; 2] = [state.position.into(), state.velocity.into()];
        let flight = &mut self.flight;
        push(&mut flight.command, time_s, rotors(&command.command));
        push(&mut flight.rotor_speed, time_s, rotors(&state.rotor_speed));
        push(&mut flight.position, time_s, position);
        push(&mut flight.velocity, time_s, velocity);
        push(&mut flight.angular_velocity, time_s, state.angular_velocity.into());
        push(&mut flight.specific_force, time_s, state.specific_force.into());
        let q = state.attitude;
        let tilted = [q.x, q.y, q.z, q.w];
        let q = [q.w, q.x, q.y, q.z];
        let last = flight.attitude.values.last().copied().unwrap_or(q);
        let is_turned = q.iter().zip(&last).map(|(a, b)| a * b).sum::<f64>() < 0.0;
        push(&mut flight.attitude, time_s, if is_turned { q.map(|part| -part) } else { q });
        reach(&mut self.reached, position, velocity, tilt_deg(&tilted));
    }
}

fn push<const N: usize>(channel: &mut Channel<N>, time_s: f64, value: [f64; N]) {
    channel.time_s.push(time_s);
    channel.values.push(value);
}

/// Widens `reached` by a state.
pub fn reach(reached: &mut Limits, position_m: [f64; 3], velocity_m_s: [f64; 3], tilt_deg: f64) {
    for (range, at) in reached.room_m.iter_mut().zip(position_m) {
        *range = [range[0].min(at), range[1].max(at)];
    }
    reached.speed_max_m_s = reached.speed_max_m_s.max(length(&velocity_m_s));
    reached.tilt_max_deg = reached.tilt_max_deg.max(tilt_deg);
}
