//! Order of the rotors in commands and in rotor speeds, and their senses of rotation.
//!
//! The angular accelerations show both, at any size of thrust and inertia and at any delay: each order, with the spins of the
//! vehicle file or all of them reversed, is a regression of its own. Of up to four rotors all orders are tried; of more, those
//! with two exchanged, and those that begin at another rotor.

use super::evidence::Evidence;
use super::fault::{Fault, Part};
use crate::prepared::{EachRotor, Equation};
use nalgebra::Vector3;
use vehicles::{ROTORS_MAX, Rotor};

/// Longest delay that is tried.
const LATE_S: f64 = 0.2;
/// Least gain of another order of the rotors: share of the squared angular accelerations, summed over the axes.
const MORE: f64 = 0.5;

/// A channel with a number for each rotor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drive {
    /// Motor commands.
    Command,
    /// Measured speeds.
    RotorSpeed,
}

impl Drive {
    fn name(self) -> &'static str {
        if self == Drive::Command { "command" } else { "rotor_speed" }
    }

    fn part(self) -> Part {
        if self == Drive::Command { Part::Command } else { Part::RotorSpeed }
    }

    fn advice(self) -> &'static str {
        match self {
            Drive::Command => {
                "name the columns of `command` in the order of the vehicle file's rotors, and check their `spin`"
            }
            Drive::RotorSpeed => {
                "name the columns of `rotor_speed` in the order of the vehicle file's rotors, and check their `spin`"
            }
        }
    }
}

/// An order of the rotors, with the spins of the vehicle file or all of them reversed.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Arrangement {
    /// For each rotor of the vehicle file, the number of the channel that belongs to it.
    order: Vec<usize>,
    is_reversed: bool,
}

impl Arrangement {
    /// Returns the arrangements of so many rotors that are tried, the declared one first.
    fn all(rotors: usize) -> Vec<Self> {
        let both =
            |order: Vec<usize>| [false, true].map(|is_reversed| Self { order: order.clone(), is_reversed });
        orders(rotors).into_iter().flat_map(both).collect()
    }

    fn text(&self) -> String {
        let names: Vec<String> = self.order.iter().map(|rotor| (rotor + 1).to_string()).collect();
        let names = names.join(", ");
        let spins = if self.is_reversed { " with all spins reversed" } else { "" };
        format!("the order {names} of the logged ones{spins}")
    }
}

/// Fault of a flight whose `drive` explains the angular accelerations in another arrangement of the rotors.
pub fn swapped(evidence: &Evidence, drive: Drive) -> Option<Fault> {
    let products = products(evidence, drive)?;
    let effects = [1.0, -1.0].map(|spin| effects_of_squares(evidence, spin));
    let score = |arrangement: &Arrangement| {
        let effect = &effects[usize::from(arrangement.is_reversed)];
        let of = |products: &Products| products.explained(effect, &arrangement.order);
        products.iter().map(of).fold(0.0, f64::max)
    };
    let rotors = evidence.model.vehicle.rotors.len();
    let scored: Vec<_> = Arrangement::all(rotors).into_iter().map(|one| (score(&one), one)).collect();
    let declared = scored.first()?.0;
    let (best, found) = scored.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    if best < declared + MORE {
        return None;
    }
    let moved: Vec<String> = (0..rotors)
        .filter(|rotor| found.order[*rotor] != *rotor)
        .map(|rotor| (rotor + 1).to_string())
        .collect();
    let (channel, kind) = match &moved[..] {
        [] => (drive.name().to_owned(), "reversed-spins"),
        _ => (format!("{}.{}", drive.name(), moved.join("+")), "swapped"),
    };
    let percent = |score: f64| 100.0 * score / 3.0;
    Some(Fault {
        flight: evidence.flight.flight.name.clone(),
        channel,
        kind,
        expected: format!(
            "the order and the spins of the vehicle file's rotors, which explain {:.0} % of the angular accelerations",
            percent(declared)
        ),
        found: format!("that {} explains {:.0} %", found.text(), percent(best)),
        consequence: drive.part().consequence(),
        advice: drive.advice(),
    })
}

/// Most rotors of which all orders are tried.
const ALL_ORDERS_MAX: usize = 4;

/// The orders that are tried, the declared one first.
fn orders(rotors: usize) -> Vec<Vec<usize>> {
    let declared: Vec<usize> = (0..rotors).collect();
    if rotors <= ALL_ORDERS_MAX {
        let code =
            |code: usize| (0..rotors).rev().map(move |at| code / rotors.pow(at as u32) % rotors).collect();
        let all = (0..rotors.pow(rotors as u32)).map(code);
        return all.filter(|order: &Vec<usize>| declared.iter().all(|rotor| order.contains(rotor))).collect();
    }
    let begun_later = (0..rotors).map(|by| {
        let mut order = declared.clone();
        order.rotate_left(by);
        order
    });
    let exchanged = (0..rotors).flat_map(|b| (0..b).map(move |a| (a, b))).map(|(a, b)| {
        let mut order = declared.clone();
        order.swap(a, b);
        order
    });
    begun_later.chain(exchanged).collect()
}

/// Angular acceleration per squared speed, one vector for each rotor; `spins` of -1 reverses them.
fn effects_of_squares(evidence: &Evidence, spins: f64) -> Vec<Vector3<f64>> {
    let vehicle = &evidence.model.vehicle;
    let inverse = vehicle.inertia_kg_m2.try_inverse().unwrap_or_else(nalgebra::Matrix3::identity);
    let of_rotor = |rotor: &Rotor| {
        let thrust = vehicle.thrust_coefficient * rotor.axis;
        let drag = spins * rotor.spin * rotor.torque_scale * vehicle.torque_coefficient * rotor.axis;
        inverse * (rotor.position_m.cross(&thrust) - drag)
    };
    vehicle.rotors.iter().map(of_rotor).collect()
}

/// Sums of products of angular accelerations and squared speeds, without their means.
struct Products {
    turning: [f64; 3],
    both: [EachRotor; 3],
    squares: [EachRotor; ROTORS_MAX],
}

impl Products {
    /// Share of the angular accelerations that the commands in `order` explain, summed over the axes: 3 at most.
    fn explained(&self, effect: &[Vector3<f64>], order: &[usize]) -> f64 {
        let rotors = || 0..order.len();
        let of_axis = |axis: usize| {
            let by = |rotor: usize| effect[rotor][axis];
            let both: f64 = rotors().map(|rotor| by(rotor) * self.both[axis][order[rotor]]).sum();
            let size: f64 = rotors()
                .flat_map(|a| rotors().map(move |b| (a, b)))
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
type Row = ([f64; 3], EachRotor);

/// Products for every delay of the commands.
fn products(evidence: &Evidence, drive: Drive) -> Option<Vec<Products>> {
    let turning = evidence.measured(Equation::AngularAcceleration)?;
    let flight = evidence.flight.flight;
    let is_absent =
        if drive == Drive::Command { flight.command.is_empty() } else { flight.rotor_speed.is_empty() };
    if is_absent || evidence.flight.is_assumed() {
        return None;
    }
    let late_max = (LATE_S / evidence.flight.layout.clock.step_s).round() as usize;
    Some((0..=late_max).map(|late| products_at(evidence, drive, &turning, late)).collect())
}

fn products_at(evidence: &Evidence, drive: Drive, turning: &[Vec<f64>], late: usize) -> Products {
    let knots = evidence.flight.layout.knots.iter().enumerate();
    let rows: Vec<Row> = knots
        .filter_map(|(at, knot)| {
            let turned = std::array::from_fn(|axis| turning[axis][at]);
            let squares = match drive {
                Drive::Command => evidence.commanded_squares(*knot, late)?,
                Drive::RotorSpeed => evidence.measured_squares(*knot, late)?,
            };
            Some((turned, squares))
        })
        .collect();
    let (count, rotors) = (rows.len().max(1) as f64, evidence.model.vehicle.rotors.len());
    let middle = |of: &dyn Fn(&Row) -> f64| rows.iter().map(of).sum::<f64>() / count;
    let turned: [f64; 3] = std::array::from_fn(|axis| middle(&|row| row.0[axis]));
    let speeds: EachRotor = std::array::from_fn(|rotor| middle(&|row| row.1[rotor]));
    let mut sums = Products {
        turning: [0.0; 3],
        both: [[0.0; ROTORS_MAX]; 3],
        squares: [[0.0; ROTORS_MAX]; ROTORS_MAX],
    };
    for (turning, squares) in &rows {
        let a: [f64; 3] = std::array::from_fn(|axis| turning[axis] - turned[axis]);
        let s: EachRotor = std::array::from_fn(|rotor| squares[rotor] - speeds[rotor]);
        for (axis, turned) in a.iter().enumerate() {
            sums.turning[axis] += turned * turned;
            (0..rotors).for_each(|rotor| sums.both[axis][rotor] += turned * s[rotor]);
        }
        (0..rotors).for_each(|i| (0..rotors).for_each(|j| sums.squares[i][j] += s[i] * s[j]));
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::Arrangement;

    #[test]
    fn orders_are_all_of_four_rotors_and_exchanged_or_begun_later_of_more() {
        for (rotors, count) in [(1, 2), (3, 12), (4, 48), (6, 2 * (6 + 15)), (12, 2 * (12 + 66))] {
            let all = Arrangement::all(rotors);
            assert_eq!(all.len(), count);
            assert_eq!(all[0], Arrangement { order: (0..rotors).collect(), is_reversed: false });
            for one in &all {
                let mut sorted = one.order.clone();
                sorted.sort_unstable();
                assert_eq!(sorted, all[0].order);
            }
        }
    }
}
