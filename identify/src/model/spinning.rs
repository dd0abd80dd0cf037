//! Rotors that follow from the commands: motors simulated in fine steps along a flight.

use crate::data::prepared::{Held, Prepared};
use flights::MeasuredVoltage;
use nalgebra::Vector3;
use plant::{Airframe, AirframeState, PerRotor, RigidBody, RotorState, State};

/// The motors are simulated in steps of at most this length.
const MOTOR_STEP_S: f64 = 0.001;

/// Length of a step, in s, in which a battery is discharged between pieces of a flight; tuned, no source.
const LEFT_OUT_S: f64 = 0.02;

/// The rotors on the grid of `flight`, whose pose is `pose_s` late: averaged over one step about each instant.
pub fn spun(airframe: &Airframe, flight: &Prepared, pose_s: f64) -> Vec<PerRotor<RotorState>> {
    let clock = &flight.layout.clock;
    let parts = (clock.step_s / MOTOR_STEP_S - 1e-9).ceil().max(1.0) as usize;
    let begin_s = |piece_s: f64| piece_s - clock.step_s / 2.0 - pose_s;
    let mut spinning = Spinning::new(airframe, flight, begin_s(clock.at(0)), clock.step_s / parts as f64);
    let mut out = Vec::with_capacity(clock.count);
    for index in 0..clock.count {
        let (first, piece_s) = clock.piece(index);
        if index == first && index > 0 {
            spinning.leave_out(begin_s(piece_s));
        }
        out.push(spinning.mean_over(parts));
    }
    out
}

/// Motors under way.
struct Spinning<'s> {
    airframe: &'s Airframe,
    commands: Held<'s>,
    /// The measured voltage that the motors follow.
    voltage: Option<&'s MeasuredVoltage>,
    is_slow: bool,
    memory: AirframeState,
    state: State,
    step_s: f64,
    /// Begin of a piece of the flight, and the number of steps since.
    piece_s: f64,
    steps: usize,
}

impl<'s> Spinning<'s> {
    /// Motors that have settled at `start_s`.
    fn new(airframe: &'s Airframe, flight: &'s Prepared, start_s: f64, step_s: f64) -> Self {
        let rotors = PerRotor::filled(airframe.vehicle().rotors.len(), RotorState::default());
        let memory = airframe.initial_state(0, "identify", step_s);
        let state = State { body: RigidBody::level_at(Vector3::zeros()), rotors };
        let mut spinning = Self {
            airframe,
            commands: Held::new(&flight.flight.command),
            voltage: flight.voltage.as_deref().filter(|_| airframe.battery(&memory, &state).is_some()),
            is_slow: flight.slow_period_s.is_some(),
            memory,
            state,
            step_s,
            piece_s: start_s,
            steps: 0,
        };
        spinning.settle(start_s);
        spinning
    }

    fn settle(&mut self, at_s: f64) {
        let (commands, vehicle) = (self.commands.at(at_s), self.airframe.vehicle());
        let steady = |rotor| RotorState::steady(vehicle.commanded_speed_rad_s(rotor, commands[rotor]));
        self.state.rotors = PerRotor::from_fn(self.state.rotors.len(), steady);
    }

    /// Goes on with the piece that begins at `to_s`. A battery's charge depends on all that was flown before: it is discharged by motors that follow at
    /// once, in longer steps. A measured voltage needs no charge.
    fn leave_out(&mut self, to_s: f64) {
        if self.voltage.is_none() && self.airframe.battery(&self.memory, &self.state).is_some() {
            let from_s = self.piece_s + self.steps as f64 * self.step_s;
            let steps = ((to_s - from_s) / LEFT_OUT_S).ceil().max(1.0) as usize;
            let step_s = (to_s - from_s) / steps as f64;
            for step in 0..steps {
                self.settle(from_s + step as f64 * step_s);
                let commands = self.commands.at(from_s + step as f64 * step_s);
                let command = &commands[..self.state.rotors.len()];
                self.airframe.begin_tick(&mut self.memory, &self.state, command, step_s);
            }
        }
        self.settle(to_s);
        (self.piece_s, self.steps) = (to_s, 0);
    }

    /// The mean over `parts` steps.
    fn mean_over(&mut self, parts: usize) -> PerRotor<RotorState> {
        let mut sum = PerRotor::filled(self.state.rotors.len(), RotorState::default());
        let half = 0.5 / parts as f64;
        for _ in 0..parts {
            let before = self.state.rotors;
            self.step();
            for (sum, (before, after)) in sum.iter_mut().zip(before.iter().zip(&self.state.rotors)) {
                sum.speed_rad_s += half * (before.speed_rad_s + after.speed_rad_s);
                sum.acceleration_rad_s2 += half * (before.acceleration_rad_s2 + after.acceleration_rad_s2);
            }
        }
        sum
    }

    /// One step. Its time is counted from the piece's begin, not summed up: over half an hour a sum drifts past a sample, and the command would be
    /// a tick late.
    fn step(&mut self) {
        let at_s = |steps: usize| self.piece_s + steps as f64 * self.step_s;
        let (from_s, to_s) = (at_s(self.steps), at_s(self.steps + 1));
        self.steps += 1;
        let command = if self.is_slow {
            // Between two slow samples of the commands there were others; held, each would act half a period late.
            self.commands.between(f64::midpoint(from_s, to_s))
        } else {
            // Where the grid does not lie on the commands' own, a step sees two of them.
            self.commands.mean(from_s, to_s)
        };
        let command = &command[..self.state.rotors.len()];
        let voltage = self.voltage.map(|voltage| voltage.at(f64::midpoint(from_s, to_s)));
        self.memory.measured_voltage_V = voltage;
        let actuation = self.airframe.begin_tick(&mut self.memory, &self.state, command, self.step_s);
        self.state.rotors = self.airframe.spun(actuation, &self.state.rotors, self.step_s);
    }
}
