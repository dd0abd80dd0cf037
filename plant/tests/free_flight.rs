//! The equations of motion against closed forms and conserved quantities.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use std::f64::consts::PI;

use common::{
    HUMMINGBIRD, TICK_S, airless, crazyflie, fly, free_body, hovering, hummingbird, hummingbird_with,
    momentum_W,
};
use nalgebra::{UnitQuaternion, Vector3};
use plant::{Airframe, Backend, FreeFlight, NewtonEuler, PerRotor, RigidBody, RotorState, State};
use vehicles::Vehicle;

#[test]
fn without_thrust_it_falls_as_galileo_says() {
    let model = NewtonEuler::new(free_body(), 1);
    let mut state = model.start(RigidBody::level_at(Vector3::zeros()), 1.0);
    state.body.velocity_W_m_s = Vector3::new(1.0, -2.0, 3.0);
    fly(&model, &mut state, &[1.0; 4], 5_000);
    let expected_W_m = Vector3::new(5.0, -10.0, 15.0 - 0.5 * 9.81 * 25.0);
    assert!((state.body.position_W_m - expected_W_m).norm() < 1e-9);
    assert!((state.body.velocity_W_m_s - Vector3::new(1.0, -2.0, 3.0 - 9.81 * 5.0)).norm() < 1e-9);
}

#[test]
fn falling_feels_no_force_and_hovering_feels_g() {
    let model = NewtonEuler::new(free_body(), 1);
    let state = model.start(RigidBody::level_at(Vector3::zeros()), 100.0);
    assert_eq!(model.accelerations(&state).specific_force_B_m_s2, Vector3::zeros());
    let (model, mut state, _) = hovering(hummingbird());
    // Tilted, the rotors still push along z of the body.
    state.body.attitude_WB = UnitQuaternion::from_euler_angles(0.4, -0.3, 2.0);
    let motion = model.accelerations(&state);
    assert!((motion.specific_force_B_m_s2 - Vector3::new(0.0, 0.0, 9.81)).norm() < 1e-12);
    assert_eq!(motion.angular_acceleration_B_rad_s2.norm(), 0.0);
}

#[test]
fn the_hummingbird_hovers_at_3930_rpm_and_stays_put() {
    let (model, mut state, command) = hovering(hummingbird());
    let hover_rpm = state.rotors[0].speed_rad_s * 30.0 / PI;
    assert!((hover_rpm - 3930.0).abs() < 1.0, "{hover_rpm} rpm");
    fly(&model, &mut state, &[command; 4], 10_000);
    assert!((state.body.position_W_m - Vector3::z()).norm() < 1e-9);
    assert!(state.body.attitude_WB.angle() < 1e-9);
}

#[test]
fn the_crazyflie_stays_put_too() {
    let (model, mut state, command) = hovering(crazyflie());
    fly(&model, &mut state, &[command; 4], 10_000);
    assert!((state.body.position_W_m - Vector3::z()).norm() < 1e-9);
}

#[test]
fn tumbling_keeps_energy_and_angular_momentum() {
    let vehicle = free_body();
    let energy_J = |state: &State| {
        let w = state.body.angular_velocity_B_rad_s;
        0.5 * w.dot(&(vehicle.inertia_kg_m2 * w))
    };
    let model = NewtonEuler::new(vehicle.clone(), 1);
    let mut state = model.start(RigidBody::level_at(Vector3::zeros()), 1.0);
    // Mostly about the middle axis, where a rigid body tumbles.
    state.body.angular_velocity_B_rad_s = Vector3::new(0.2, 4.0, 0.1);
    let (energy_start_J, momentum_start_W) = (energy_J(&state), momentum_W(&vehicle, &state));
    let mut flipped = false;
    for _ in 0..10_000 {
        model.step(&mut state, &[1.0; 4], TICK_S);
        flipped |= state.body.angular_velocity_B_rad_s.y < -3.0;
        assert!((energy_J(&state) / energy_start_J - 1.0).abs() < 1e-9);
        let drift = (momentum_W(&vehicle, &state) - momentum_start_W).norm() / momentum_start_W.norm();
        assert!(drift < 1e-9, "momentum drifted by {drift:e}");
    }
    assert!(flipped, "it has to tumble, or the test shows nothing");
}

#[test]
fn body_and_spinning_rotors_together_keep_their_angular_momentum() {
    let vehicle = airless();
    let model = NewtonEuler::new(vehicle.clone(), 1);
    let mut state = model.start(RigidBody::level_at(Vector3::zeros()), 60.0);
    state.body.angular_velocity_B_rad_s = Vector3::new(1.0, -2.0, 0.5);
    let start_W = momentum_W(&vehicle, &state);
    // Rotors speed up and down unequally: gyroscopic torque and spin-up reaction both act.
    for commands in [[150.0, 20.0, 80.0, 5.0], [1.0, 200.0, 90.0, 60.0]] {
        fly(&model, &mut state, &commands, 1_000);
        let drift = (momentum_W(&vehicle, &state) - start_W).norm() / start_W.norm();
        assert!(drift < 1e-8, "momentum drifted by {drift:e}");
    }
    assert!((state.body.angular_velocity_B_rad_s.z - 0.5).abs() > 0.1, "the rotors have to turn the body");
}

#[test]
fn a_spinning_rotor_makes_the_body_precess_the_right_way() {
    // All four rotors counter-clockwise, so that h = 4 J_r w along +z, and no air.
    let vehicle = hummingbird_with(&[
        ("value = 7.6184e-8", "value = 0"),
        ("value = 2.6839e-9", "value = 0"),
        ("value = \"clockwise\"", "value = \"counter-clockwise\""),
    ]);
    let model = NewtonEuler::new(vehicle.clone(), 1);
    let mut state = model.start(RigidBody::level_at(Vector3::zeros()), 100.0);
    let momentum = 4.0 * vehicle.rotor_inertia_kg_m2 * state.rotors[0].speed_rad_s;
    let rate_rad_s = momentum / vehicle.inertia_kg_m2[(0, 0)];
    state.body.angular_velocity_B_rad_s.x = 0.3;
    fly(&model, &mut state, &[100.0; 4], 100);
    // Euler with h z: p' = -(h/Jx) q, q' = (h/Jx) p, so (p, q) turns counter-clockwise.
    let angle = rate_rad_s * 0.1;
    let expected_B = Vector3::new(0.3 * libm::cos(angle), 0.3 * libm::sin(angle), 0.0);
    assert!((state.body.angular_velocity_B_rad_s - expected_B).norm() < 1e-9);
    assert!(expected_B.y > 0.0 && angle < PI);
}

#[test]
fn the_quaternion_keeps_its_length() {
    let (model, mut state, command) = hovering(hummingbird());
    for tick in 0..10_000 {
        let swing = 5.0 * libm::sin(tick as f64 * 0.01);
        model.step(&mut state, &[command + swing, command, command - swing, command + 1.0], TICK_S);
        assert!((state.body.attitude_WB.norm() - 1.0).abs() < 1e-14);
    }
}

/// A lively half second: tilted, turning, rotors far from their targets.
fn lively(vehicle: &Vehicle, substeps: u32) -> State {
    let model = NewtonEuler::new(vehicle.clone(), substeps);
    let mut state = model.start(RigidBody::level_at(Vector3::zeros()), 80.0);
    state.body.angular_velocity_B_rad_s = Vector3::new(2.0, -3.0, 1.0);
    for _ in 0..10 {
        model.step(&mut state, &[90.0, 60.0, 70.0, 95.0], 0.05);
    }
    state
}

fn distance(a: &State, b: &State) -> f64 {
    let position = (a.body.position_W_m - b.body.position_W_m).norm();
    let attitude = (a.body.attitude_WB.coords - b.body.attitude_WB.coords).norm();
    let rate = (a.body.angular_velocity_B_rad_s - b.body.angular_velocity_B_rad_s).norm();
    position + attitude + rate + (a.rotors[1].speed_rad_s - b.rotors[1].speed_rad_s).abs() * 1e-3
}

#[test]
fn halving_the_step_divides_the_error_by_sixteen() {
    let vehicle = hummingbird();
    let exact = lively(&vehicle, 256);
    let errors = [4, 8, 16].map(|substeps| distance(&lively(&vehicle, substeps), &exact));
    for pair in errors.windows(2) {
        let order = libm::log2(pair[0] / pair[1]);
        assert!((3.8..4.3).contains(&order), "order {order} from errors {errors:?}");
    }
}

#[test]
fn no_substeps_counts_as_one() {
    let text = Vehicle::parse(HUMMINGBIRD, "").unwrap();
    assert_eq!(lively(&text, 0), lively(&text, 1));
}

#[test]
fn commands_that_are_not_numbers_leave_the_state_finite() {
    let (model, mut state, _) = hovering(hummingbird());
    fly(&model, &mut state, &[f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e300], 100);
    assert!(state.body.position_W_m.iter().all(|x| x.is_finite()));
    assert!(state.rotors.iter().all(|rotor| rotor.speed_rad_s.is_finite()));
}

#[test]
fn turned_rotors_go_on_with_their_accelerations_whatever_their_motors_are() {
    for vehicle in [hummingbird(), crazyflie()] {
        let airframe = Airframe::new(vehicle);
        let memory = airframe.initial_state(0, "plant", 0.01);
        let model = NewtonEuler::flying(airframe, 1);
        let mut flight = FreeFlight::new(model, RigidBody::level_at(Vector3::z()), memory);
        let rotor = |acceleration_rad_s2| RotorState { speed_rad_s: 400.0, acceleration_rad_s2 };
        flight.step_with_rotors(&PerRotor::from([900.0, -900.0, 0.0, 50.0].map(rotor)), 0.01);
        for (rotor, expected) in flight.state().rotors.iter().zip([409.0, 391.0, 400.0, 400.5]) {
            assert!((rotor.speed_rad_s - expected).abs() < 1e-9, "{rotor:?} for {expected}");
        }
    }
}

/// A vehicle whose rotors are turned as those of a commanded one moves as that one: thrust, torque and the reaction of rotors
/// that spin up.
#[test]
fn turned_rotors_move_it_as_commanded_ones_do() {
    for vehicle in [hummingbird(), crazyflie()] {
        let hover = vehicle.hover_command();
        let airframe = Airframe::new(vehicle);
        let flight = || {
            let memory = airframe.initial_state(0, "plant", TICK_S);
            FreeFlight::new(
                NewtonEuler::flying(airframe.clone(), 1),
                RigidBody::level_at(Vector3::z()),
                memory,
            )
        };
        let (mut commanded, mut turned) = (flight(), flight());
        commanded.settle_rotors(&[hover; 4]);
        for tick in 0..1000 {
            // Roll, pitch and yaw one after the other, each to both sides.
            let (axis, side) = (tick / 200 % 3, if tick % 200 < 100 { 0.03 } else { -0.03 });
            let signs = [[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0], [1.0, -1.0, 1.0, -1.0]][axis];
            let rotors = commanded.state().rotors;
            turned.step_with_rotors(&rotors, TICK_S);
            commanded.step(&signs.map(|sign| hover * (1.0 + side * sign)), TICK_S, &[]);
        }
        let [one, other] = [&commanded, &turned].map(|flight| flight.state().body);
        assert!(one.attitude_WB.angle() > 0.05, "it has turned: {one:?}");
        assert!(one.attitude_WB.angle_to(&other.attitude_WB) < 2e-3, "{one:?}\n{other:?}");
        assert!((one.velocity_W_m_s - other.velocity_W_m_s).norm() < 5e-3, "{one:?}\n{other:?}");
        let spin = one.angular_velocity_B_rad_s - other.angular_velocity_B_rad_s;
        assert!(spin.norm() < 1e-2 * (0.1 + one.angular_velocity_B_rad_s.norm()), "{one:?}\n{other:?}");
    }
}
