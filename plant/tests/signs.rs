//! A positive command gives a positive angle, and a symmetric flight stays symmetric.
//!
//! In a body frame with x forward, y left and z up: positive roll (about x) raises the left side, positive pitch
//! (about y) lowers the nose, positive yaw (about z) turns counter-clockwise seen from above.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use common::{crazyflie, fly, hovering, hummingbird, spinless};
use nalgebra::{UnitQuaternion, Vector3};
use plant::State;
use vehicles::Vehicle;

/// Roll, pitch and yaw after 0.2 s with `change` (in parts of the hover command) added to the hover commands.
fn angles_after(vehicle: Vehicle, change: [f64; 4]) -> [f64; 3] {
    let (model, mut state, hover) = hovering(vehicle);
    let commands = change.map(|part| hover * (1.0 + 0.02 * part));
    fly(&model, &mut state, &commands, 200);
    let (roll, pitch, yaw) = state.body.attitude_WB.euler_angles();
    [roll, pitch, yaw]
}

/// The angle of `axis` is clearly positive and outweighs the other two.
fn assert_turns(vehicle: &Vehicle, change: [f64; 4], axis: usize) {
    let angles = angles_after(vehicle.clone(), change);
    let others = angles.iter().enumerate().filter(|(i, _)| *i != axis);
    let largest_other = others.map(|(_, angle)| angle.abs()).fold(0.0, f64::max);
    assert!(angles[axis] > 1e-3 && angles[axis] > 5.0 * largest_other, "{}: {angles:?}", vehicle.name);
}

#[test]
fn more_thrust_on_the_left_rolls_positive() {
    // Hummingbird: front, right, rear, left. Crazyflie: front right, rear right, rear left, front left.
    assert_turns(&hummingbird(), [0.0, -1.0, 0.0, 1.0], 0);
    assert_turns(&crazyflie(), [-1.0, -1.0, 1.0, 1.0], 0);
}

#[test]
fn more_thrust_at_the_rear_pitches_positive_nose_down() {
    assert_turns(&hummingbird(), [-1.0, 0.0, 1.0, 0.0], 1);
    assert_turns(&crazyflie(), [-1.0, 1.0, 1.0, -1.0], 1);
}

#[test]
fn faster_clockwise_rotors_yaw_positive_counter_clockwise() {
    assert_turns(&hummingbird(), [1.0, -1.0, 1.0, -1.0], 2);
    assert_turns(&crazyflie(), [-1.0, 1.0, -1.0, 1.0], 2);
}

#[test]
fn positive_pitch_flies_forward_and_positive_roll_flies_right() {
    for (angles, towards_W) in [((0.0, 0.1, 0.0), Vector3::x()), ((0.1, 0.0, 0.0), -Vector3::y())] {
        let (model, mut state, hover) = hovering(hummingbird());
        state.body.attitude_WB = UnitQuaternion::from_euler_angles(angles.0, angles.1, angles.2);
        fly(&model, &mut state, &[hover; 4], 500);
        assert!(state.body.velocity_W_m_s.dot(&towards_W) > 0.4);
    }
}

#[test]
fn more_command_on_all_rotors_climbs() {
    let (model, mut state, hover) = hovering(hummingbird());
    fly(&model, &mut state, &[hover + 2.0; 4], 500);
    assert!(state.body.velocity_W_m_s.z > 0.1 && state.body.attitude_WB.angle() < 1e-9);
}

fn flown(vehicle: Vehicle, change: [f64; 4]) -> State {
    let (model, mut state, hover) = hovering(vehicle);
    fly(&model, &mut state, &change.map(|count| hover + count), 1_000);
    state
}

#[test]
fn mirrored_commands_fly_the_mirrored_path() {
    // Left and right swapped: y, roll and yaw change sign, if no torque depends on a sense of rotation.
    let one = flown(spinless(), [0.4, -0.3, -0.2, 0.5]).body;
    let other = flown(spinless(), [0.4, 0.5, -0.2, -0.3]).body;
    let mirror = |v: Vector3<f64>| Vector3::new(v.x, -v.y, v.z);
    assert!((mirror(one.position_W_m) - other.position_W_m).norm() < 1e-9);
    // An angular velocity is an axial vector: the mirror turns its x and z around.
    assert!((-mirror(one.angular_velocity_B_rad_s) - other.angular_velocity_B_rad_s).norm() < 1e-9);
}

#[test]
fn commands_turned_by_half_a_turn_fly_the_turned_path() {
    // Each rotor takes over from the opposite one, which turns alike: this holds for the whole model.
    for (vehicle, scale) in [(hummingbird(), 1.0), (crazyflie(), 300.0)] {
        let one = flown(vehicle.clone(), [0.4, -0.3, -0.2, 0.5].map(|count| count * scale)).body;
        let other = flown(vehicle, [-0.2, 0.5, 0.4, -0.3].map(|count| count * scale)).body;
        let turn = |v: Vector3<f64>| Vector3::new(-v.x, -v.y, v.z);
        assert!((turn(one.position_W_m) - other.position_W_m).norm() < 1e-9);
        assert!((turn(one.angular_velocity_B_rad_s) - other.angular_velocity_B_rad_s).norm() < 1e-9);
    }
}
