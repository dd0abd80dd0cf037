//! Impossible trims: constant torques beyond those of the rotors while they carry the weight.
//!
//! In flight, the rotors balance a constant torque. Their thrusts lie between those of the least and the greatest speed;
//! in the mean they carry the weight, without another torque. The vehicle file alone gives the largest torque about one
//! axis under these conditions.

use super::fault::{Fault, axis_name};
use crate::fit::Problem;
use crate::prepared::{Equation, Prepared};
use crate::rows::column;
use crate::statistics::mean;
use nalgebra::{Matrix4, Vector4};
use vehicles::Vehicle;

const ADVICE: &str =
    "check if the vehicle was held, if rotors or payload changed, and if `command` or `rotor_speed` is wrong";

/// Greatest constant angular accelerations about x, y and z that the rotors of `vehicle` balance at hover, in rad/s^2;
/// `None` if the rotors cannot hover.
pub fn greatest_rad_s2(vehicle: &Vehicle) -> Option<[f64; 3]> {
    let lever = vehicle.torque_coefficient / vehicle.thrust_coefficient;
    let [a, b, c, d] = &vehicle.rotors[..] else { return None };
    let columns = [a, b, c, d].map(|rotor| {
        let at = rotor.position_m;
        Vector4::new(1.0, at.y, -at.x, -rotor.spin * rotor.torque_scale * lever)
    });
    let thrusts_of = Matrix4::from_columns(&columns).try_inverse()?;
    let hover = thrusts_of * Vector4::new(vehicle.mass_kg * vehicle.gravity_m_s2, 0.0, 0.0, 0.0);
    let thrust = |speed: f64| vehicle.thrust_coefficient * speed * speed;
    let least_rad_s = if vehicle.command.zero_is_off { 0.0 } else { vehicle.command.speed_at_min_rad_s };
    let (least, most) = (thrust(least_rad_s), thrust(vehicle.command.speed_at_max_rad_s));
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
        reach(1.0).max(reach(-1.0)) / vehicle.inertia_kg_m2[(axis, axis)]
    }))
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
}
