//! Accelerations that a model predicts at every sample of a flight: its side of the equations of motion, without any window.
//!
//! Benchmarks of force and torque are stated in them. What they are compared with, and how it is filtered, is the benchmark's.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::model::physics::air;
use crate::model::predict::{body, rotors_at};
use crate::model::steps_ahead::rotor_speeds;
use flights::{Flight, Played};
use plant::{Airframe, NewtonEuler, PerRotor, State};

/// Accelerations at the samples of a flight's attitude.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Accelerations {
    /// Times of the samples, in s.
    pub time_s: Vec<f64>,
    /// Specific force along the axes of the body, in m/s².
    pub specific_force_B_m_s2: Vec<[f64; 3]>,
    /// Angular acceleration about the axes of the body, in rad/s².
    pub angular_acceleration_B_rad_s2: Vec<[f64; 3]>,
}

/// Accelerations of `airframe` at the measured states and rotor speeds of `flight`, with the effects that it has.
///
/// A flight without rotor speeds has those that follow from its commands by the airframe, as in [`crate::steps_ahead::errors`].
///
/// # Errors
/// A sentence that says what the flight lacks.
///
/// ```no_run
/// use flights::FlightSet;
/// use identify::accelerations::accelerations;
/// use plant::Airframe;
/// use vehicles::Vehicle;
///
/// let set = FlightSet::load("flights/neurobem.toml".as_ref())?;
/// let airframe = Airframe::from_files(Vehicle::load(&set.vehicle)?, &[])?;
/// let predicted = accelerations(&set.flights[0], &airframe)?;
/// println!("{:?} m/s^2 at {} s", predicted.specific_force_B_m_s2[0], predicted.time_s[0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn accelerations(flight: &Flight, airframe: &Airframe) -> Result<Accelerations, String> {
    let played = Played::of(flight).map_err(|cause| cause.to_string())?;
    let speeds = rotor_speeds(flight, airframe, &played)?;
    let period_s = flight.attitude.period_s().ok_or("it has less than two samples of the attitude")?;
    let actuation = air(airframe, period_s);
    let (model, count) = (NewtonEuler::flying(airframe.clone(), 1), airframe.vehicle().rotors.len());
    let (mut hint, mut speed_hint, mut predicted) = (0, 0, Accelerations::default());
    let (start_s, end_s) = played.span_s();
    let samples = flight.attitude.time_s.iter().filter(|time_s| (start_s..=end_s).contains(*time_s));
    for time_s in samples {
        let body = body(&played.at(*time_s, &mut hint));
        let rotors = rotors_at(&speeds, *time_s, &mut speed_hint);
        let rotors = PerRotor::from_fn(count, |rotor| rotors[rotor]);
        let motion = model.accelerations_under(&actuation, &State { body, rotors });
        predicted.time_s.push(*time_s);
        predicted.specific_force_B_m_s2.push(motion.specific_force_B_m_s2.into());
        predicted.angular_acceleration_B_rad_s2.push(motion.angular_acceleration_B_rad_s2.into());
    }
    Ok(predicted)
}
