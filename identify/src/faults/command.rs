//! Motor commands: frozen, swapped, scaled.
//!
//! The angular accelerations show the order of the rotors, at any size of thrust and inertia and at any delay. The carried
//! weight shows the scale, relative to the other flights: an error of the vehicle file is the same in all flights.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use super::evidence::Evidence;
use super::fault::{Fault, Part};
use super::frozen::{Stretch, longest};
use crate::prepared::Equation;
use crate::statistics::{deviation, mean};
use nalgebra::Vector3;

/// Shortest stretch of equal commands that counts as frozen; whole numbers of a coarse range repeat for less.
const FROZEN_S: f64 = 1.0;
/// Longest delay of the commands that is tried.
const LATE_S: f64 = 0.2;
/// Least gain of another order of the rotors: share of the squared angular accelerations, summed over the axes.
const MORE: f64 = 0.5;
/// Largest factor on the carried weight that a payload or a weak battery explains.
const CARRIED: f64 = 2.0;
const ORDER: &str =
    "check the order of the columns of `command` for this flight: that of the vehicle file's rotors";
const LOGGER: &str = "look at the log about that time, and cut the stretch off with `from_s` and `to_s`";
const UNIT: &str = "check unit and columns of `command` for this flight";

/// The fault of each flight's commands.
pub fn find(flights: &[Evidence]) -> Vec<Option<Fault>> {
    let carried: Vec<Option<f64>> = flights.iter().map(carried).collect();
    let of = |at: usize| {
        let evidence = &flights[at];
        carried[at]?;
        frozen(evidence).or_else(|| swapped(evidence)).or_else(|| scaled(evidence, at, &carried))
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
    let map = evidence.model.vehicle.command;
    // At its limits a command may stay.
    let at_limit = |value: f64| value <= map.min || value >= map.max;
    let stretch = |rotor: usize| longest(flight, &flight.flight.command, rotor, FROZEN_S, at_limit);
    let stretches: Vec<(usize, Stretch)> =
        (0..4).filter_map(|rotor| Some((rotor, stretch(rotor)?))).collect();
    let (rotor, longest) = *stretches.first()?;
    // All commands may stand still on a stand; then the vehicle does not go on as before.
    if stretches.len() == 4 && !goes_on(evidence, &longest) {
        return None;
    }
    let channel = if stretches.len() == 4 { "command".to_owned() } else { format!("command.{}", rotor + 1) };
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
    evidence.flight.moves_freely() || (spread(false) > 0.0 && spread(true) > 0.5 * spread(false))
}

/// All orders of four rotors.
fn orders() -> impl Iterator<Item = [usize; 4]> {
    let all = (0..256_usize).map(|code| [code / 64, code / 16 % 4, code / 4 % 4, code % 4]);
    all.filter(|order| (0..4).all(|rotor| order.contains(&rotor)))
}

fn swapped(evidence: &Evidence) -> Option<Fault> {
    const AS_DECLARED: [usize; 4] = [0, 1, 2, 3];
    let products = products(evidence)?;
    let effect = effects_of_squares(evidence);
    let score = |order: &[usize; 4]| {
        let of = |products: &Products| products.explained(&effect, order);
        products.iter().map(of).fold(0.0, f64::max)
    };
    let declared = score(&AS_DECLARED);
    let (order, best) = orders().map(|order| (order, score(&order))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    if best < declared + MORE {
        return None;
    }
    let names: Vec<String> = order.iter().map(|rotor| (rotor + 1).to_string()).collect();
    let moved: Vec<String> =
        (0..4).filter(|rotor| order[*rotor] != *rotor).map(|rotor| (rotor + 1).to_string()).collect();
    let expected = format!(
        "commands in the order of the vehicle file's rotors, by which the vehicle turns ({:.0} % of its angular \
         accelerations explained)",
        100.0 * declared / 3.0
    );
    let found = format!("those of the order {} ({:.0} %)", names.join(", "), 100.0 * best / 3.0);
    Some(fault(evidence, format!("command.{}", moved.join("+")), "swapped", expected, found, ORDER))
}

/// Angular acceleration per squared speed, one vector for each rotor.
fn effects_of_squares(evidence: &Evidence) -> [Vector3<f64>; 4] {
    let vehicle = &evidence.model.vehicle;
    let inverse = vehicle.inertia_kg_m2.try_inverse().unwrap_or_else(nalgebra::Matrix3::identity);
    std::array::from_fn(|at| {
        let rotor = &vehicle.rotors[at];
        let thrust = vehicle.thrust_coefficient * Vector3::z();
        let drag = rotor.spin * rotor.torque_scale * vehicle.torque_coefficient * Vector3::z();
        inverse * (rotor.position_m.cross(&thrust) - drag)
    })
}

/// Sums of products of angular accelerations and squared speeds, without their means.
struct Products {
    turning: [f64; 3],
    both: [[f64; 4]; 3],
    squares: [[f64; 4]; 4],
}

impl Products {
    /// Share of the angular accelerations that the commands in `order` explain, summed over the axes: 3 at most.
    fn explained(&self, effect: &[Vector3<f64>; 4], order: &[usize; 4]) -> f64 {
        let of_axis = |axis: usize| {
            let by = |rotor: usize| effect[rotor][axis];
            let both: f64 = (0..4).map(|rotor| by(rotor) * self.both[axis][order[rotor]]).sum();
            let size: f64 = (0..16)
                .map(|pair| (pair / 4, pair % 4))
                .map(|(a, b)| by(a) * by(b) * self.squares[order[a]][order[b]])
                .sum();
            let whole = size * self.turning[axis];
            // The opposite direction explains nothing.
            if both > 0.0 && whole > 0.0 { both * both / whole } else { 0.0 }
        };
        (0..3).map(of_axis).sum()
    }
}

/// Angular accelerations and squared speeds at a knot.
type Row = ([f64; 3], [f64; 4]);

/// Products for every delay of the commands.
fn products(evidence: &Evidence) -> Option<Vec<Products>> {
    let turning = evidence.measured(Equation::AngularAcceleration)?;
    if evidence.flight.is_assumed() {
        return None;
    }
    let late_max = (LATE_S / evidence.flight.layout.clock.step_s).round() as usize;
    Some((0..=late_max).map(|late| products_at(evidence, &turning, late)).collect())
}

fn products_at(evidence: &Evidence, turning: &[Vec<f64>], late: usize) -> Products {
    let knots = evidence.flight.layout.knots.iter().enumerate();
    let rows: Vec<Row> = knots
        .filter_map(|(at, knot)| {
            let turned = std::array::from_fn(|axis| turning[axis][at]);
            Some((turned, evidence.commanded_squares(*knot, late)?))
        })
        .collect();
    let count = rows.len().max(1) as f64;
    let middle = |of: &dyn Fn(&Row) -> f64| rows.iter().map(of).sum::<f64>() / count;
    let turned: [f64; 3] = std::array::from_fn(|axis| middle(&|row| row.0[axis]));
    let speeds: [f64; 4] = std::array::from_fn(|rotor| middle(&|row| row.1[rotor]));
    let mut sums = Products { turning: [0.0; 3], both: [[0.0; 4]; 3], squares: [[0.0; 4]; 4] };
    for (turning, squares) in &rows {
        let a: [f64; 3] = std::array::from_fn(|axis| turning[axis] - turned[axis]);
        let s: [f64; 4] = std::array::from_fn(|rotor| squares[rotor] - speeds[rotor]);
        for (axis, turned) in a.iter().enumerate() {
            sums.turning[axis] += turned * turned;
            (0..4).for_each(|rotor| sums.both[axis][rotor] += turned * s[rotor]);
        }
        (0..4).for_each(|i| (0..4).for_each(|j| sums.squares[i][j] += s[i] * s[j]));
    }
    sums
}

/// Share of the weight that the commands carry in the mean; `None` without commands.
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
        let expected = format!("commands that carry {usual:.2} of the weight, as in the other flights");
        fault(evidence, "command".to_owned(), "scaled", expected, format!("{here:.2} of it"), UNIT)
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn four_rotors_have_24_orders() {
        assert_eq!(super::orders().count(), 24);
    }
}
