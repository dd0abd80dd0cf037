//! Rotors and motors from flights that log rotor speeds, with their commands where these are logged too.
//!
//! | room | what it holds |
//! |---|---|
//! | `course` | one rotor of one flight: its commands and speeds |
//! | `voltage` | the battery's voltage over a flight |
//! | `motor` | the motor that follows the commands best |
//! | `drive` | command map, lag and delay with their intervals |
//! | `equations` | forces and torques of a flight as linear equations |
//! | `forces` | thrust and torque coefficients with their intervals |
//! | `blocks`, `least_squares` | blocks of time, and least squares over them |
//! | `figure` | a figure, or why it is not determined |
//! | `speed_noise` | the noise of speeds, and what it takes from a coefficient |

mod blocks;
mod course;
mod drive;
mod equations;
mod figure;
mod forces;
mod least_squares;
mod motor;
mod speed_noise;
mod voltage;

use flights::{Channel, Flight, FlightSet};
use serde::Serialize;
use vehicles::Vehicle;

pub use drive::{FlownMotor, LagFigures, MotorFigures, RotorMotor};
pub use figure::{Figure, HeldOut};
pub use forces::{FlownCoefficient, FlownCoefficients};

use super::error::RotorError;

/// Results of flights.
#[derive(Debug, Clone, Serialize)]
pub struct Flown {
    /// Flights with their roles.
    pub flights: Vec<(String, &'static str)>,
    /// Command map and motor; absent where the flights do not log commands with rotor speeds.
    pub motor: Option<FlownMotor>,
    /// Thrust and torque; absent where no motion can be compared.
    pub coefficients: Option<FlownCoefficients>,
    /// Faults of the data, and what is left out.
    pub findings: Vec<String>,
}

/// Notes of the reader on rotor speeds and commands.
fn notes(flight: &Flight) -> impl Iterator<Item = String> {
    let is_of_rotors = |note: &&String| note.starts_with("rotor_speed") || note.starts_with("command");
    flight.notes.iter().filter(is_of_rotors).map(|note| format!("flight `{}`: {note}", flight.name))
}

/// Fits rotors and motors to the flights of `set`, which fly `vehicle`.
///
/// # Errors
/// If no flight to fit on has rotor speeds with commands or motion.
pub fn fitted(set: &FlightSet, vehicle: &Vehicle) -> Result<Flown, RotorError> {
    let flights = &set.flights;
    let mut findings: Vec<String> = flights.iter().flat_map(notes).collect();
    let all: Vec<&Flight> = flights.iter().collect();
    let motor = drive::fitted(&all, vehicle);
    let without_commands: Vec<Flight> =
        flights.iter().filter(|flight| !flight.rotor_speed.is_empty()).map(measured).collect();
    let coefficients = forces::fitted(&without_commands, vehicle);
    if let (Err(motor), Err(forces)) = (&motor, &coefficients) {
        let advice = "declare `rotor_speed` in `channels`, with `command` or the motion of the vehicle";
        return Err(RotorError::too_little(
            "flights",
            "rotor speeds with commands or motion",
            format!("{motor}; {forces}"),
            advice,
        ));
    }
    findings.extend(motor.as_ref().err().cloned());
    findings.extend(coefficients.as_ref().err().cloned());
    if !vehicle.effects.is_empty() {
        let names: Vec<&str> = vehicle.effects.iter().map(|effect| effect.name.as_str()).collect();
        findings.push(format!(
            "the vehicle file declares {}, which these fits do not know: the figures are those of a vehicle without effects",
            names.join(", ")
        ));
    }
    let named = |flight: &Flight| (flight.name.clone(), flight.role.name());
    Ok(Flown {
        flights: flights.iter().map(named).collect(),
        motor: motor.ok(),
        coefficients: coefficients.ok(),
        findings,
    })
}

/// A flight whose rotors turn as they were measured, whatever was commanded.
fn measured(flight: &Flight) -> Flight {
    Flight {
        command: Channel::default(),
        commands_on_change: false,
        command_breaks_s: Vec::new(),
        ..flight.clone()
    }
}
