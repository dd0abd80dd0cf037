//! Impossible trims: constant torques beyond those of the rotors while they carry the weight.
//!
//! In flight, the rotors balance a constant torque. Their thrusts lie between those of the least and the greatest speed;
//! in the mean they carry the weight, without another torque. The vehicle file alone gives the largest torque about one
//! axis under these conditions.

use crate::data::fault::{Fault, axis_name};
use crate::data::prepared::{Equation, Prepared};
use crate::data::rows::column;
use crate::model::problem::Problem;
use crate::numbers::statistics::mean;
use nalgebra::{Matrix4, Vector4};
use vehicles::{Rotor, Vehicle};

const ADVICE: &str =
    "check if the vehicle was held, if rotors or payload changed, and if `command` or `rotor_speed` is wrong";

/// Greatest constant angular accelerations about x, y and z that the rotors of `vehicle` balance at hover, in rad/s^2;
/// `None` if the rotors cannot hover. With other numbers of rotors than four they are an upper bound: those under which the
/// rotors carry the weight, whatever torque they make about the other axes.
pub fn greatest_rad_s2(vehicle: &Vehicle) -> Option<[f64; 3]> {
    let lever = vehicle.torque_coefficient / vehicle.thrust_coefficient;
    let of_thrust = |rotor: &Rotor| {
        let (at, axis) = (rotor.position_m, rotor.axis);
        let torque = at.cross(&axis) - axis * (rotor.spin * rotor.torque_scale * lever);
        Vector4::new(axis.z, torque.x, torque.y, torque.z)
    };
    let columns: Vec<Vector4<f64>> = vehicle.working_rotors().map(of_thrust).collect();
    let thrust = |speed: f64| vehicle.thrust_coefficient * speed * speed;
    let least_rad_s = if vehicle.command.zero_is_off { 0.0 } else { vehicle.command.speed_at_min_rad_s };
    let limits = [thrust(least_rad_s), thrust(vehicle.command.speed_at_max_rad_s)];
    let weight = vehicle.mass_kg * vehicle.gravity_m_s2;
    let torques = match &columns[..] {
        [a, b, c, d] => of_four(&Matrix4::from_columns(&[*a, *b, *c, *d]), weight, limits)?,
        columns => carrying(columns, weight, limits)?,
    };
    Some(std::array::from_fn(|axis| torques[axis] / vehicle.inertia_kg_m2[(axis, axis)]))
}

/// Greatest torques of four rotors, N*m, without any about the other axes.
fn of_four(columns: &Matrix4<f64>, weight: f64, [least, most]: [f64; 2]) -> Option<[f64; 3]> {
    let thrusts_of = columns.try_inverse()?;
    let hover = thrusts_of * Vector4::new(weight, 0.0, 0.0, 0.0);
    if hover.iter().any(|thrust| !(least..=most).contains(thrust)) {
        return None;
    }
    Some(std::array::from_fn(|axis| {
        let way = thrusts_of.column(axis + 1);
        // Both ways about the axis; the further one.
        let reach = |sign: f64| {
            let rooms = hover.iter().zip(way.iter()).map(|(thrust, way)| {
                let way = sign * way;
                if way > 0.0 { (most - thrust) / way } else { (thrust - least) / -way }
            });
            rooms.filter(|room| !room.is_nan()).fold(f64::INFINITY, f64::min)
        };
        reach(1.0).max(reach(-1.0))
    }))
}

/// Greatest torques of any rotors that carry `weight`, N*m: the rotors that turn most for what they lift go first.
fn carrying(columns: &[Vector4<f64>], weight: f64, [least, most]: [f64; 2]) -> Option<[f64; 3]> {
    let lifted: f64 = columns.iter().map(|column| column[0]).sum();
    if !(least * lifted..=most * lifted).contains(&weight) {
        return None;
    }
    let reach = |axis: usize, sign: f64| {
        let mut turns: Vec<_> =
            columns.iter().map(|column| (sign * column[axis + 1] / column[0], column[0])).collect();
        turns.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (mut left, mut torque) = (weight - least * lifted, 0.0);
        for (turn, up) in turns {
            let more = left.min((most - least) * up);
            left -= more;
            torque += turn * (least * up + more);
        }
        torque
    };
    Some(std::array::from_fn(|axis| reach(axis, 1.0).max(reach(axis, -1.0))))
}

/// Impossible trims of all flights, each on its worst axis.
pub fn find(problem: &Problem) -> Vec<Fault> {
    let Some(greatest) = greatest_rad_s2(&problem.model.vehicle) else { return Vec::new() };
    problem.flights().filter_map(|flight| of_flight(problem, flight, &greatest)).collect()
}

fn of_flight(problem: &Problem, flight: &Prepared, greatest: &[f64; 3]) -> Option<Fault> {
    flight.offset_of(Equation::AngularAcceleration)?;
    let residual = problem.model.residual_under(flight, &problem.model.parameters.baseline());
    let trim = |axis: usize| mean(&column(flight, &residual, Equation::AngularAcceleration, axis));
    let share = |axis: usize| (trim(axis) / greatest[axis]).abs();
    let worst = (0..3).max_by(|a, b| share(*a).total_cmp(&share(*b)))?;
    (share(worst) > 1.0).then(|| Fault {
        flight: flight.flight.name.clone(),
        channel: format!("trim.{}", axis_name(worst)),
        kind: "impossible-trim",
        expected: format!(
            "at most {:.1} rad/s^2, which the rotors balance while they carry the weight",
            greatest[worst]
        ),
        found: format!("{:.1} rad/s^2", trim(worst)),
        consequence: "this flight is not used",
        advice: ADVICE,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a rotor at the end of each axis, one of a pair turns slowest while the other carries both shares.
    #[test]
    fn the_hummingbird_holds_what_its_pairs_of_rotors_can() {
        let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let [x, y, z] = greatest_rad_s2(&vehicle).unwrap();
        let thrust = |speed: f64| vehicle.thrust_coefficient * speed * speed;
        let of_one = vehicle.mass_kg * vehicle.gravity_m_s2 / 4.0;
        let room = of_one - thrust(vehicle.command.speed_at_min_rad_s);
        assert!((x - 2.0 * room * 0.17 / vehicle.inertia_kg_m2[(0, 0)]).abs() < 1e-9 * x, "{x}");
        assert!((65.0..67.0).contains(&x) && (18.5..19.5).contains(&z), "{x} {z}");
        assert!((x - y).abs() < 1e-9 * x && z < x, "{x} {y} {z}");
    }

    /// No torque about another axis is a condition more: the bound is not below what four rotors balance with it.
    #[test]
    fn the_bound_of_other_numbers_is_above_what_four_rotors_balance() {
        let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let exact = greatest_rad_s2(&vehicle).unwrap();
        // Two more rotors that do nothing.
        let idle = vehicle.rotors[0].clone();
        let more = Vehicle {
            rotors: [vehicle.rotors.clone(), vec![Rotor { has_failed: true, ..idle }; 2]].concat(),
            ..vehicle.clone()
        };
        assert_eq!(greatest_rad_s2(&more), Some(exact));
        let eight = Vehicle {
            rotors: [vehicle.rotors.clone(), vehicle.rotors.clone()].concat(),
            mass_kg: 2.0 * vehicle.mass_kg,
            ..vehicle
        };
        let bound = greatest_rad_s2(&eight).unwrap();
        for axis in 0..3 {
            assert!(bound[axis] >= 2.0 * exact[axis] * (1.0 - 1e-9), "{bound:?} {exact:?}");
        }
    }
}
