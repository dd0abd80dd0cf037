//! The motor lag against the closed forms of its step response.

use crate::common;
use common::{TICK_S, crazyflie, hummingbird};
use nalgebra::Vector3;
use plant::{NewtonEuler, RigidBody};
use vehicles::{MotorModel, Vehicle};

/// Steps all motors of `vehicle` from one command to another for two seconds and hands over (time, speed).
fn step_response(vehicle: &Vehicle, from: f64, to: f64) -> Vec<(f64, f64)> {
    let model = NewtonEuler::new(vehicle.clone(), 1);
    let mut state = model.start(RigidBody::level_at(Vector3::zeros()), from);
    let ticks = 1..=2_000;
    ticks
        .map(|tick| {
            model.step(&mut state, &[to; 4], TICK_S);
            (f64::from(tick) * TICK_S, state.rotors[2].speed_rad_s)
        })
        .collect()
}

#[test]
fn the_hummingbirds_motor_steps_like_an_underdamped_second_order_system() {
    let vehicle = hummingbird();
    let MotorModel::SecondOrder { natural_frequency_rad_s: wn, damping_ratio: zeta } = vehicle.motor else {
        panic!("the Hummingbird's motor is of second order")
    };
    let (start, target) = (vehicle.command.speed(50.0), vehicle.command.speed(90.0));
    let root = (1.0 - zeta * zeta).sqrt();
    for (time, speed) in step_response(&vehicle, 50.0, 90.0) {
        let phase = wn * root * time;
        let swing = libm::cos(phase) + zeta / root * libm::sin(phase);
        let exact = target + (start - target) * libm::exp(-zeta * wn * time) * swing;
        assert!((speed - exact).abs() < 1e-6, "{speed} instead of {exact} rad/s at {time} s");
    }
}

#[test]
fn the_crazyflies_motor_steps_like_a_first_order_system() {
    let vehicle = crazyflie();
    let MotorModel::FirstOrder { time_constant_s } = vehicle.motor else {
        panic!("the Crazyflie's motor is of first order")
    };
    let (start, target) = (vehicle.command.speed(20_000.0), vehicle.command.speed(50_000.0));
    for (time, speed) in step_response(&vehicle, 20_000.0, 50_000.0) {
        let exact = target + (start - target) * libm::exp(-time / time_constant_s);
        assert!((speed - exact).abs() < 1e-6, "{speed} instead of {exact} rad/s at {time} s");
    }
}

#[test]
fn a_settled_motor_turns_at_the_commanded_speed() {
    for (vehicle, command) in [(hummingbird(), 77.0), (crazyflie(), 30_000.0)] {
        let (_, speed) = step_response(&vehicle, vehicle.command.min, command)[1_999];
        // Unit gain at rest: the thesis's gain of 3.5 must not appear.
        assert!((speed / vehicle.command.speed(command) - 1.0).abs() < 1e-6);
    }
}

#[test]
fn a_first_order_motor_shows_the_acceleration_it_has() {
    let vehicle = crazyflie();
    let model = NewtonEuler::new(vehicle.clone(), 1);
    let mut state = model.start(RigidBody::level_at(Vector3::zeros()), 20_000.0);
    model.step(&mut state, &[50_000.0; 4], TICK_S);
    let missing = vehicle.command.speed(50_000.0) - state.rotors[0].speed_rad_s;
    assert!((state.rotors[0].acceleration_rad_s2 - missing / 0.072).abs() < 1e-9);
}

#[test]
fn a_motor_switched_off_stops() {
    let (_, speed) = step_response(&crazyflie(), 40_000.0, 0.0)[1_999];
    assert!(speed.abs() < 1e-6, "{speed} rad/s");
}
