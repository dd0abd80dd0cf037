//! Faults of sensors, motors and their logs, flight by flight and channel by channel: a fault of one flight among several
//! disappears in a mean over all.
//!
//! | room | contents |
//! |---|---|
//! | `evidence`, `twin`, `frozen` | comparison of channels; frozen numbers |
//! | `gyroscope`, `accelerometer`, `position`, `command` | faults of these channels |
//! | `order` | commands and rotor speeds in another order, reversed spins |
//! | `rotor_speed` | rotor speed sensors, and motors that do not follow their commands |
//! | `trim` | trims beyond the torque of the rotors |

mod accelerometer;
mod command;
mod evidence;
mod frozen;
mod gyroscope;
mod order;
mod position;
mod rotor_speed;
mod trim;
mod twin;

use crate::data::fault::{Fault, Part};
use crate::model::problem::Problem;
use evidence::Evidence;
use flights::FlightSet;

/// Returns the faults of the channels of `set`, from which `problem` was made, and the set without the faulty channels;
/// `None` if there are none.
pub fn in_channels(problem: &Problem, set: &FlightSet) -> (Vec<Fault>, Option<FlightSet>) {
    let mut flights: Vec<Evidence> =
        problem.flights().map(|flight| Evidence::of(&problem.model, flight)).collect();
    let mut found: Vec<(Fault, Part)> = Vec::new();
    // In this order: a faulty channel is no evidence against the next one.
    for find in [of_gyroscopes, of_positions, of_accelerometers, of_commands, of_rotor_speeds] {
        let of_flights = find(&flights);
        for (evidence, one) in flights.iter_mut().zip(of_flights) {
            evidence.doubted.extend(one.iter().map(|(_, part)| *part));
            found.extend(one);
        }
    }
    if found.is_empty() {
        return (Vec::new(), None);
    }
    let mut cleaned = set.clone();
    for (fault, part) in &found {
        cleaned
            .flights
            .iter_mut()
            .filter(|flight| flight.name == fault.flight)
            .for_each(|flight| part.leave_out(flight));
    }
    (found.into_iter().map(|(fault, _)| fault).collect(), Some(cleaned))
}

/// Finding of each flight.
type Found = Vec<Option<(Fault, Part)>>;

fn of_gyroscopes(flights: &[Evidence]) -> Found {
    flights.iter().map(|flight| Some((gyroscope::find(flight)?, Part::Gyroscope))).collect()
}

fn of_positions(flights: &[Evidence]) -> Found {
    flights.iter().map(position::find).collect()
}

fn of_accelerometers(flights: &[Evidence]) -> Found {
    let faults = accelerometer::find(flights).into_iter();
    faults.map(|fault| Some((fault?, Part::Accelerometer))).collect()
}

fn of_commands(flights: &[Evidence]) -> Found {
    command::find(flights).into_iter().map(|fault| Some((fault?, Part::Command))).collect()
}

fn of_rotor_speeds(flights: &[Evidence]) -> Found {
    let ordered = order::swapped(flights, order::Drive::RotorSpeed).into_iter();
    let one = |(evidence, ordered): (&Evidence, Option<Fault>)| {
        Some((rotor_speed::among_each_other(evidence.flight).or(ordered)?, Part::RotorSpeed))
    };
    flights.iter().zip(ordered).map(one).collect()
}

/// Returns `problem` without faulty rotor sensors and without flights that have an impossible trim, and the faults of both.
pub fn of_rotors(mut problem: Problem<'_>) -> (Problem<'_>, Vec<Fault>) {
    let mut faults = rotor_speed::find(&mut problem);
    let trims = trim::find(&problem);
    let is_used = |name: &str| !trims.iter().any(|fault| fault.flight == name);
    for flights in [&mut problem.estimation, &mut problem.validation, &mut problem.test] {
        flights.retain(|flight| is_used(&flight.flight.name));
    }
    faults.extend(trims);
    (problem, faults)
}
