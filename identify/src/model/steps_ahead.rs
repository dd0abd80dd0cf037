//! Multi-step prediction: at every sample of a flight the model is set to the measured state. It flies over
//! the next samples, driven by the measured rotor speeds. Benchmarks of models of vehicles are stated in
//! these errors (k-step-ahead predictions: Ljung, System Identification, 2nd ed., section 3.2).
//!
//! Other than the windows that an identification judges by, these overlap, and their errors are means of norms.

use crate::model::predict::{ROTOR_TICK_S, body, rotors_at, rotors_between, state};
use flights::state::StateQuantity;
use flights::{Channel, Flight, Played};
use plant::{Airframe, Backend, FreeFlight, NewtonEuler, PerRotor, RigidBody, RotorState};
use rayon::prelude::*;
use vehicles::ROTORS_MAX;

/// Rotors that follow commands are simulated in steps of this length, in s.
const MOTOR_STEP_S: f64 = 0.001;
/// Samples whose predictions are one job of a thread.
const JOB: usize = 256;

/// Speeds of the rotors between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Between {
    /// On straight lines from one sample to the next.
    Lines,
    /// As at the last sample, so that nothing is used that was measured later.
    Held,
}

/// Errors of one flight, as means over all windows: the lengths of the differences, of the attitude the angle.
#[derive(Debug, Clone, PartialEq)]
pub struct StepsAhead {
    /// Number of windows, one for each sample with enough others behind it.
    pub windows: usize,
    /// Windows that do not count: they touch a gap of a channel, or rotor speeds are not known.
    pub left_out: usize,
    /// Time between two samples, in s.
    pub period_s: f64,
    /// Errors of the model after 1, 2, … samples, in the order and units of [`StateQuantity::ALL`].
    pub model: Vec<[f64; 4]>,
    /// Errors of persistence: velocity, attitude and rates stay.
    pub persistence: Vec<[f64; 4]>,
}

/// Errors of `airframe` up to `steps` periods ahead of every sample of `flight`: samples of the attitude, made even in time where some are missing.
///
/// A flight without rotor speeds is flown with those that follow from its commands by the airframe.
///
/// # Errors
/// A sentence that says what the flight lacks.
///
/// ```no_run
/// use flights::FlightSet;
/// use identify::steps_ahead::{Between, errors};
/// use plant::Airframe;
/// use vehicles::Vehicle;
///
/// let set = FlightSet::load("flights/nanodrone.toml".as_ref())?;
/// let airframe = Airframe::from_files(Vehicle::load(&set.vehicle)?, &[])?;
/// for flight in &set.flights {
///     let ahead = errors(flight, &airframe, 50, Between::Held)?;
///     println!("{}: {} m after {} s", flight.name, ahead.model[49][0], 50.0 * ahead.period_s);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn errors(
    flight: &Flight,
    airframe: &Airframe,
    steps: usize,
    between: Between,
) -> Result<StepsAhead, String> {
    let played = Played::of(flight).map_err(|cause| cause.to_string())?;
    let rotors = rotor_speeds(flight, airframe, &played)?;
    let times_s = &even_times_s(flight, &played)?;
    if times_s.len() <= steps {
        return Err(format!("it has {} samples, at least {} are needed", times_s.len(), steps + 1));
    }
    let mut hint = 0;
    let bodies: Vec<RigidBody> = times_s.iter().map(|time_s| body(&played.at(*time_s, &mut hint))).collect();
    let starts: Vec<usize> = (0..times_s.len() - steps).collect();
    let (counted, left_out): (Vec<usize>, Vec<usize>) =
        starts.into_iter().partition(|at| played.counts(times_s[*at], times_s[at + steps]));
    if counted.is_empty() {
        return Err("none of its windows counts: each touches a gap, or a stretch with unknown rotor speeds"
            .to_owned());
    }
    let of_job = |starts: &[usize]| {
        let mut sums = Sums::new(steps);
        let memory = airframe.initial_state(0, "predict", ROTOR_TICK_S);
        let mut plant = FreeFlight::new(NewtonEuler::flying(airframe.clone(), 1), bodies[starts[0]], memory);
        starts.iter().for_each(|at| {
            sums.add(&mut plant, &Window { times_s, bodies: &bodies, rotors: &rotors, at: *at, between })
        });
        sums
    };
    let sums = counted.par_chunks(JOB).map(of_job).collect::<Vec<_>>();
    // In the order of the samples, so that the sum has the same bytes on any number of threads.
    let total = sums.into_iter().fold(Sums::new(steps), Sums::joined);
    let mean =
        |sums: Vec<[f64; 4]>| sums.iter().map(|sum| sum.map(|sum| sum / counted.len() as f64)).collect();
    Ok(StepsAhead {
        windows: counted.len(),
        left_out: left_out.len(),
        period_s: times_s[1] - times_s[0],
        model: mean(total.model),
        persistence: mean(total.persistence),
    })
}

/// Times a period of the attitude apart, from the first of the flight to its last.
fn even_times_s(flight: &Flight, played: &Played) -> Result<Vec<f64>, String> {
    let period_s = flight.attitude.period_s().ok_or("it has less than two samples of the attitude")?;
    let (start_s, end_s) = played.span_s();
    let count = ((end_s - start_s) / period_s + 1e-6) as usize + 1;
    Ok((0..count).map(|at| (start_s + at as f64 * period_s).min(end_s)).collect())
}

/// One window, which begins at the sample `at`.
struct Window<'a> {
    times_s: &'a [f64],
    bodies: &'a [RigidBody],
    rotors: &'a Channel<ROTORS_MAX>,
    at: usize,
    between: Between,
}

/// Sums of errors by the number of samples ahead.
struct Sums {
    model: Vec<[f64; 4]>,
    persistence: Vec<[f64; 4]>,
}

impl Sums {
    fn new(steps: usize) -> Self {
        Self { model: vec![[0.0; 4]; steps], persistence: vec![[0.0; 4]; steps] }
    }

    fn joined(mut self, other: Self) -> Self {
        let add = |sums: &mut [[f64; 4]], others: &[[f64; 4]]| {
            sums.iter_mut().flatten().zip(others.iter().flatten()).for_each(|(sum, other)| *sum += other);
        };
        add(&mut self.model, &other.model);
        add(&mut self.persistence, &other.persistence);
        self
    }

    /// The window flown, and its errors added.
    fn add(&mut self, plant: &mut FreeFlight, window: &Window) {
        let count = plant.state().rotors.len();
        let begin = &window.bodies[window.at];
        plant.set_body(begin);
        let mut hint = window
            .rotors
            .time_s
            .partition_point(|time_s| *time_s <= window.times_s[window.at])
            .saturating_sub(1);
        for step in 0..self.model.len() {
            let (from_s, to_s) = (window.times_s[window.at + step], window.times_s[window.at + step + 1]);
            let parts = ((to_s - from_s) / ROTOR_TICK_S).ceil().max(1.0);
            let part_s = (to_s - from_s) / parts;
            for part in 0..parts as usize {
                let at_s = from_s + part as f64 * part_s;
                let rotors = match window.between {
                    Between::Lines => rotors_between(window.rotors, at_s, at_s + part_s, &mut hint),
                    Between::Held => rotors_at(window.rotors, from_s, &mut hint).map(
                        |RotorState { speed_rad_s, .. }| RotorState { speed_rad_s, acceleration_rad_s2: 0.0 },
                    ),
                };
                plant.step_with_rotors(&PerRotor::from_fn(count, |rotor| rotors[rotor]), part_s);
            }
            let measured = state(&window.bodies[window.at + step + 1]);
            let ahead_s = to_s - window.times_s[window.at];
            let persistent =
                RigidBody { position_W_m: begin.position_W_m + ahead_s * begin.velocity_W_m_s, ..*begin };
            let sum = |sums: &mut [f64; 4], body: &RigidBody| {
                let body = state(body);
                StateQuantity::ALL
                    .into_iter()
                    .zip(sums)
                    .for_each(|(quantity, sum)| *sum += body.error(&measured, quantity));
            };
            sum(&mut self.model[step], &plant.state().body);
            sum(&mut self.persistence[step], &persistent);
        }
    }
}

/// The measured rotor speeds of `flight`, or those that follow from its commands: by the command map, the motors, the delays and the battery of
/// `airframe`. The rotors have settled at the first command.
pub(crate) fn rotor_speeds(
    flight: &Flight,
    airframe: &Airframe,
    played: &Played,
) -> Result<Channel<ROTORS_MAX>, String> {
    if !flight.rotor_speed.is_empty() {
        return Ok(flight.rotor_speed.clone());
    }
    if flight.command.is_empty() {
        return Err("it has neither rotor speeds nor commands".to_owned());
    }
    let count = airframe.vehicle().rotors.len();
    let (start_s, end_s) = played.span_s();
    let (mut hint, mut speeds) = (0, Channel::default());
    let begin = played.at(start_s, &mut hint);
    let memory = airframe.initial_state(0, "predict", MOTOR_STEP_S);
    let mut plant = FreeFlight::new(NewtonEuler::flying(airframe.clone(), 1), body(&begin), memory);
    plant.settle_rotors(&begin.command[..count]);
    for tick in 0..=((end_s - start_s) / MOTOR_STEP_S) as usize {
        let time_s = start_s + tick as f64 * MOTOR_STEP_S;
        let row = played.at(time_s, &mut hint);
        let mut now = [0.0; ROTORS_MAX];
        now.iter_mut()
            .zip(plant.state().rotors.iter())
            .for_each(|(now, rotor): (_, &RotorState)| *now = rotor.speed_rad_s);
        speeds.time_s.push(time_s);
        speeds.values.push(now);
        plant.set_body(&body(&row));
        plant.set_measured_voltage(row.battery_v);
        plant.step(&row.command[..count], MOTOR_STEP_S, &[]);
    }
    Ok(speeds)
}
