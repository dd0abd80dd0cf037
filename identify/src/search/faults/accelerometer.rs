//! Accelerometers: frozen, scaled, mirrored on an axis.
//!
//! In flight the mean specific force carries the weight, which shows scale and sign along z. Along x and y a quadrotor
//! measures little but drag. An axis is mirrored there if it follows the opposite of position and attitude while the
//! accelerometer of another flight follows them.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use super::evidence::Evidence;
use super::frozen::longest;
use super::twin::{Twin, is_off_scale};
use crate::data::fault::{Fault, Part, axis_name};
use crate::data::prepared::Equation;
use crate::numbers::statistics::mean;

/// Shortest stretch of equal numbers that counts as frozen.
const FROZEN_S: f64 = 0.5;
const ADVICE: &str = "check columns, signs, axes and unit of `specific_force` for this flight";

/// Comparison of one flight's accelerometer along x and y.
type Sides = Option<[Twin; 2]>;

/// The fault of each flight's accelerometer.
pub fn find(flights: &[Evidence]) -> Vec<Option<Fault>> {
    let sides: Vec<Sides> = flights.iter().map(sides).collect();
    let of = |at: usize| {
        let evidence = &flights[at];
        let channel = &evidence.flight.flight.specific_force;
        if channel.is_empty() {
            return None;
        }
        let frozen = |axis: usize| {
            // A simulated vehicle without drag feels nothing to its sides.
            let is_ideal = |value: f64| axis < 2 && value == 0.0;
            let stretch = longest(evidence.flight, channel, axis, FROZEN_S, is_ideal)?;
            Some(fault(evidence, axis, "frozen", "a number that changes in flight".into(), stretch.found()))
        };
        (0..3).find_map(frozen).or_else(|| weight(evidence)).or_else(|| mirrored(flights, &sides, at))
    };
    (0..flights.len()).map(of).collect()
}

fn fault(evidence: &Evidence, axis: usize, kind: &'static str, expected: String, found: String) -> Fault {
    Fault {
        flight: evidence.flight.flight.name.clone(),
        channel: format!("specific_force.{}", axis_name(axis)),
        kind,
        expected,
        found,
        consequence: Part::Accelerometer.consequence(),
        advice: ADVICE,
    }
}

/// Checks sign and scale by the weight that the specific force carries.
fn weight(evidence: &Evidence) -> Option<Fault> {
    let z = 2;
    let mean_z = mean(&evidence.measured(Equation::SpecificForce)?[z]);
    let gravity = evidence.model.vehicle.gravity_m_s2;
    // Without a position a vehicle that flies upright carries its weight all the same, if nothing holds it.
    let asked = evidence.asked_force_B().map(|asked| mean(&asked[z]));
    let expected = match asked {
        Some(asked) => format!("{asked:.2} m/s^2 in the mean, which position and attitude ask for"),
        None => format!("about {gravity:.2} m/s^2 in the mean, which carries the weight"),
    };
    let scale = mean_z / asked.unwrap_or(gravity);
    if scale < 0.0 {
        let found = format!("{mean_z:.2} m/s^2");
        return Some(fault(evidence, z, "mirrored", expected, found));
    }
    (asked.is_some() && is_off_scale(scale))
        .then(|| fault(evidence, z, "scaled", expected, format!("{mean_z:.2} m/s^2, {scale:.3} of it")))
}

fn sides(evidence: &Evidence) -> Sides {
    let (measured, asked) = (evidence.measured(Equation::SpecificForce)?, evidence.asked_force_B()?);
    Some([0, 1].map(|axis| Twin::of(&measured[axis], &asked[axis], evidence.knot_s())))
}

fn mirrored(flights: &[Evidence], sides: &[Sides], at: usize) -> Option<Fault> {
    let of_axis = |axis: usize| {
        let correlation = sides[at].as_ref()?[axis].mirrored()?;
        let follows = |other: &Sides| other.as_ref().is_some_and(|twins| twins[axis].follows());
        let witness = sides.iter().position(follows)?;
        let other = &flights[witness].flight.flight.name;
        let expected = format!("what position and attitude ask for, as in `{other}`");
        let found = format!("its opposite (correlation {correlation:.2})");
        Some(fault(&flights[at], axis, "mirrored", expected, found))
    };
    [0, 1].into_iter().find_map(of_axis)
}
