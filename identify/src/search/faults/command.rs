//! Motor commands: frozen, swapped, scaled.
//!
//! The carried weight shows the scale, relative to the other flights: an error of the vehicle file is the same in all flights.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use super::evidence::Evidence;
use super::frozen::{Stretch, longest};
use super::order::{Drive, swapped};
use crate::data::fault::{Fault, Part};
use crate::data::prepared::Equation;
use crate::numbers::statistics::{deviation, mean};

/// Shortest stretch of equal commands that counts as frozen; whole numbers of a coarse range repeat for less.
const FROZEN_S: f64 = 1.0;
/// Largest factor on the carried weight that a payload or a weak battery explains.
const CARRIED: f64 = 2.0;
const LOGGER: &str = "look at the log about that time, and cut the stretch off with `from_s` and `to_s`";
const UNIT: &str = "check unit and columns of `command` for this flight";

/// The fault of each flight's commands.
pub fn find(flights: &[Evidence]) -> Vec<Option<Fault>> {
    let carried: Vec<Option<f64>> = flights.iter().map(carried).collect();
    let ordered = swapped(flights, Drive::Command);
    let of = |at: usize| {
        let evidence = &flights[at];
        carried[at]?;
        frozen(evidence).or_else(|| ordered[at].clone()).or_else(|| scaled(evidence, at, &carried))
    };
    (0..flights.len()).map(of).collect()
}

fn fault(
    evidence: &Evidence,
    channel: String,
    kind: &'static str,
    expected: String,
    found: String,
    advice: &'static str,
) -> Fault {
    let (flight, consequence) = (evidence.flight.flight.name.clone(), Part::Command.consequence());
    Fault { flight, channel, kind, expected, found, consequence, advice }
}

fn frozen(evidence: &Evidence) -> Option<Fault> {
    let flight = evidence.flight;
    let (map, rotors) = (evidence.model.vehicle.command, flight.flight.rotors);
    // At its limits a command may stay.
    let at_limit = |value: f64| value <= map.min || value >= map.max;
    let stretch = |rotor: usize| longest(flight, &flight.flight.command, rotor, FROZEN_S, at_limit);
    let stretches: Vec<(usize, Stretch)> =
        (0..rotors).filter_map(|rotor| Some((rotor, stretch(rotor)?))).collect();
    let (rotor, longest) = *stretches.first()?;
    // All commands may stand still on a stand; then the vehicle does not go on as before.
    if stretches.len() == rotors && !goes_on(evidence, &longest) {
        return None;
    }
    let channel =
        if stretches.len() == rotors { "command".to_owned() } else { format!("command.{}", rotor + 1) };
    let expected = "a number that changes while the vehicle is controlled".to_owned();
    Some(fault(evidence, channel, "frozen", expected, longest.found(), LOGGER))
}

/// True if the vehicle flies freely, or turns about as much within the stretch as outside it.
fn goes_on(evidence: &Evidence, stretch: &Stretch) -> bool {
    let Some(turning) = evidence.measured(Equation::AngularAcceleration) else { return false };
    let layout = &evidence.flight.layout;
    let is_inside = |knot: usize| (stretch.from_s..=stretch.to_s).contains(&layout.clock.at(knot));
    let spread = |inside: bool| {
        let of_axis = |axis: &Vec<f64>| {
            let of: Vec<f64> = (0..axis.len())
                .filter(|at| is_inside(layout.knots[*at]) == inside)
                .map(|at| axis[at])
                .collect();
            if of.len() < 2 { 0.0 } else { deviation(&of) }
        };
        turning.iter().map(of_axis).fold(0.0, f64::max)
    };
    evidence.flight.moves_freely || (spread(false) > 0.0 && spread(true) > 0.5 * spread(false))
}

/// Mean thrust of the commands over the weight; `None` without commands.
fn carried(evidence: &Evidence) -> Option<f64> {
    if evidence.flight.flight.command.is_empty() {
        return None;
    }
    let thrusts: Vec<f64> =
        evidence.flight.layout.knots.iter().map(|knot| evidence.thrust_m_s2(*knot)).collect();
    let gravity = evidence.model.vehicle.gravity_m_s2;
    (gravity > 0.0).then(|| mean(&thrusts) / gravity)
}

fn scaled(evidence: &Evidence, at: usize, carried: &[Option<f64>]) -> Option<Fault> {
    let here = carried[at]?;
    let mut others: Vec<f64> =
        (0..carried.len()).filter(|other| *other != at).filter_map(|other| carried[other]).collect();
    others.sort_by(f64::total_cmp);
    let usual = *others.get(others.len() / 2)?;
    let ratio = here / usual;
    // Of two flights the one that is further from the vehicle file is wrong.
    let is_further = libm::log(here).abs() > libm::log(usual).abs();
    let is_off = !(1.0 / CARRIED..=CARRIED).contains(&ratio) && is_further;
    is_off.then(|| {
        let expected =
            format!("commands with a thrust of {usual:.2} times the weight, as in the other flights");
        fault(evidence, "command".to_owned(), "scaled", expected, format!("{here:.2} times the weight"), UNIT)
    })
}
