//! Forces and torques of the spinning rotors on the body: thrust, drag torque, spin-up reaction, gyroscopic torque.
//!
//! Signs. A rotor of spin s (+1 counter-clockwise from the tip of its axis a) and speed w turns at s w about a. The
//! air's drag on it, c_Q w^2 against the rotation, reaches the body as -s c_Q w^2 about a (the yaw row of thesis
//! eq. 3.10 has the opposite sign for the rotation of section 2.1). The rotors' angular momentum relative to
//! the body is h = sum s J_r w a. Euler's equation for body and rotors together gives the body two more
//! torques: -h' (spin-up reaction, which the thesis leaves out) and -w_B x h; with axes along z, h (-q, p,
//! 0), which is thesis eq. 3.11.

use nalgebra::Vector3;
use std::ops::AddAssign;
use vehicles::{Rotor, Vehicle};

use crate::state::{PerRotor, RotorRates, RotorState};

/// A force and a torque about the centre of mass, both written in the body frame.
///
/// ```
/// use nalgebra::Vector3;
/// use plant::Wrench;
///
/// let on_the_left = Wrench::at(&Vector3::new(0.0, 0.2, 0.0), Vector3::new(0.0, 0.0, 5.0));
/// assert_eq!(on_the_left.torque_B_N_m, Vector3::new(1.0, 0.0, 0.0), "it rolls positive");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wrench {
    /// Force.
    pub force_B_N: Vector3<f64>,
    /// Torque about the centre of mass.
    pub torque_B_N_m: Vector3<f64>,
}

impl Wrench {
    /// A force that acts at `position_m`, seen from the centre of mass.
    #[must_use]
    pub fn at(position_m: &Vector3<f64>, force_B_N: Vector3<f64>) -> Self {
        Self { force_B_N, torque_B_N_m: position_m.cross(&force_B_N) }
    }
}

impl AddAssign for Wrench {
    fn add_assign(&mut self, other: Self) {
        self.force_B_N += other.force_B_N;
        self.torque_B_N_m += other.torque_B_N_m;
    }
}

/// Thrust c_T w |w| along the rotor's axis, in N (thesis eq. 3.1). A rotor that runs backwards, as an underdamped
/// motor may for a moment after being switched off, pulls down.
pub fn thrust_N(vehicle: &Vehicle, speed_rad_s: f64) -> f64 {
    vehicle.thrust_coefficient * speed_rad_s * speed_rad_s.abs()
}

/// Drag torque c_Q w |w| that the air puts on `rotor` against its own sense, in N*m (thesis eq. 3.2).
pub(crate) fn drag_torque_N_m(vehicle: &Vehicle, rotor: &Rotor, speed_rad_s: f64) -> f64 {
    vehicle.torque_coefficient * speed_rad_s * speed_rad_s.abs() * rotor.torque_scale
}

/// The wrench of all rotors with these thrusts on a body that turns with `angular_velocity_B_rad_s`. Rotors are summed in the
/// order of the motor commands; the order is part of the result, as float addition is not associative.
pub(crate) fn wrench(
    vehicle: &Vehicle,
    thrusts_N: &PerRotor<f64>,
    rotors: &PerRotor<RotorState>,
    rates: &PerRotor<RotorRates>,
    angular_velocity_B_rad_s: &Vector3<f64>,
) -> Wrench {
    let (mut sum, mut momentum_B_N_m_s) = (Wrench::default(), Vector3::zeros());
    for (((place, thrust_N), rotor), rate) in vehicle.rotors.iter().zip(thrusts_N).zip(rotors).zip(rates) {
        // r x (0, 0, T): thrust on the left (+y) rolls positive, thrust in front pitches nose up (negative).
        sum += Wrench::at(&place.position_m, place.axis * *thrust_N);
        // The motor pushes against the air's drag and the rotor's own inertia.
        let reaction_N_m = drag_torque_N_m(vehicle, place, rotor.speed_rad_s)
            + vehicle.rotor_inertia_kg_m2 * rate.acceleration_rad_s2;
        sum.torque_B_N_m -= place.axis * (place.spin * reaction_N_m);
        momentum_B_N_m_s += place.axis * (place.spin * vehicle.rotor_inertia_kg_m2 * rotor.speed_rad_s);
    }
    // -w x h, thesis eq. 3.11.
    sum.torque_B_N_m -= angular_velocity_B_rad_s.cross(&momentum_B_N_m_s);
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    /// Forces and torques are vectors: a vehicle whose rotors are all turned about body y has the turned wrench of the whole.
    #[test]
    fn the_wrench_of_turned_rotors_is_the_turned_wrench() {
        let upright = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let turn = Rotation3::from_euler_angles(0.1, 0.4, -0.2);
        let mut turned = upright.clone();
        for rotor in &mut turned.rotors {
            (rotor.position_m, rotor.axis) = (turn * rotor.position_m, turn * rotor.axis);
        }
        let thrusts_N = PerRotor::from([1.0, 1.2, 0.9, 1.4]);
        let rotors = PerRotor::from([400.0, 420.0, 380.0, 450.0]).map(RotorState::steady);
        let rate = |acceleration_rad_s2| RotorRates { acceleration_rad_s2, jerk_rad_s3: 0.0 };
        let rates = PerRotor::from([10.0, -20.0, 30.0, 5.0]).map(rate);
        let angular_velocity_B_rad_s = Vector3::new(0.3, -0.5, 0.7);
        let expected = wrench(&upright, &thrusts_N, &rotors, &rates, &angular_velocity_B_rad_s);
        let found = wrench(&turned, &thrusts_N, &rotors, &rates, &(turn * angular_velocity_B_rad_s));
        assert!((found.force_B_N - turn * expected.force_B_N).norm() < 1e-12, "{found:?}");
        assert!((found.torque_B_N_m - turn * expected.torque_B_N_m).norm() < 1e-12, "{found:?}");
        assert!(expected.force_B_N.xy() == nalgebra::Vector2::zeros() && expected.torque_B_N_m.norm() > 0.01);
    }
}
