//! Arms of a vehicle: where its rotors are.

use nalgebra::Vector3;
use vehicles::{Rotor, Vehicle};

/// The mean of the rotors' places, from the centre of mass.
pub(crate) fn amid_rotors_B_m(vehicle: &Vehicle) -> Vector3<f64> {
    vehicle.rotors.iter().map(|rotor| rotor.position_m).sum::<Vector3<f64>>() / vehicle.rotors.len() as f64
}

/// Length of the longest arm, m: from the middle of the rotors.
pub(crate) fn longest_arm_m(vehicle: &Vehicle) -> f64 {
    let middle_B_m = amid_rotors_B_m(vehicle);
    vehicle.rotors.iter().map(|rotor| (rotor.position_m - middle_B_m).norm()).fold(0.0, f64::max)
}

/// Number of the first rotor with the longest arm.
pub(crate) fn longest_arm(vehicle: &Vehicle) -> usize {
    let middle_B_m = amid_rotors_B_m(vehicle);
    let longest_m = longest_arm_m(vehicle);
    let is_longest = |rotor: &Rotor| (rotor.position_m - middle_B_m).norm() >= longest_m;
    vehicle.rotors.iter().position(is_longest).unwrap_or_default()
}
