//! Flights for unit tests: a Hummingbird whose rotors turn at hover, and that moves as the test says; and simulated ones.

#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]
use crate::model::problem::Problem;
use crate::search::candidate::Candidate;
use crate::simulated::{Plan, fly, vehicle_file};
use flights::{Channel, Flight, FlightSet, Role};
use nalgebra::UnitQuaternion;
use plant::effects::Effect;
use vehicles::{ROTORS_MAX, Vehicle};

/// The Hummingbird.
pub fn hummingbird() -> Vehicle {
    Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap()
}

/// A Hummingbird whose rotors have hardly any inertia. Less thrust and less inertia about x and y equal more mass there.
pub fn with_light_rotors() -> Vehicle {
    Vehicle { rotor_inertia_kg_m2: 1e-9, ..hummingbird() }
}

/// A flight of `vehicle` to fit on and one to test on, simulated with `truth` beyond it.
pub fn simulated(vehicle: &Vehicle, truth: &[Effect]) -> FlightSet {
    let flown = |(seed, role): (u64, Role)| {
        let mut plan = Plan { duration_s: 8.0, ..Plan::of(truth.to_vec(), seed) };
        plan.sensors.pose_ticks = 10;
        fly(vehicle, &plan, role)
    };
    FlightSet {
        vehicle: vehicle_file("hummingbird.toml"),
        flights: [(4_500, Role::Fit), (4_501, Role::Test)].map(flown).into(),
        next_flight: Default::default(),
        files: Default::default(),
    }
}

/// The candidate of a whole effect.
pub fn candidate(problem: &Problem, effect: &str) -> Candidate {
    let free = problem.model.parameters.of_name(effect);
    Candidate { kind: problem.model.parameters.all[free[0]].kind, free }
}

/// A flight of `duration_s`, logged every `period_s`: position in W (m) and Euler angles (rad) by time. Velocity and rates are
/// differences of those, so that a log of them is consistent.
pub fn flown(
    [duration_s, period_s]: [f64; 2],
    position_m: impl Fn(f64) -> [f64; 3],
    angles_rad: impl Fn(f64) -> [f64; 3],
) -> Flight {
    const STEP_S: f64 = 1e-4;
    let vehicle = hummingbird();
    let count = (duration_s / period_s).round() as usize;
    let time_s: Vec<f64> = (0..=count).map(|at| at as f64 * period_s).collect();
    let mut speeds = [0.0; ROTORS_MAX];
    speeds[..4].fill(vehicle.commanded_speed_rad_s(0, vehicle.hover_command()));
    let attitude_at = |time_s: f64| {
        let [roll, pitch, yaw] = angles_rad(time_s);
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    };
    let velocity = |time_s: f64| {
        let (ahead, behind) = (position_m(time_s + STEP_S), position_m(time_s - STEP_S));
        std::array::from_fn(|axis| (ahead[axis] - behind[axis]) / (2.0 * STEP_S))
    };
    let rates = |time_s: f64| {
        let turn_B = attitude_at(time_s - STEP_S).inverse() * attitude_at(time_s + STEP_S);
        (turn_B.scaled_axis() / (2.0 * STEP_S)).into()
    };
    let attitude = |time_s: f64| {
        let attitude_WB = attitude_at(time_s);
        [attitude_WB.w, attitude_WB.i, attitude_WB.j, attitude_WB.k]
    };
    Flight {
        name: "made".to_owned(),
        file: "made.csv".into(),
        other_files: Vec::new(),
        role: Role::Fit,
        rotors: 4,
        command: Channel::default(),
        commands_on_change: false,
        command_breaks_s: Vec::new(),
        rotor_speed: channel(&time_s, |_| speeds),
        position: channel(&time_s, &position_m),
        velocity: channel(&time_s, velocity),
        attitude: channel(&time_s, attitude),
        angular_velocity: channel(&time_s, rates),
        specific_force: Channel::default(),
        battery_voltage: Channel::default(),
        on_rig: None,
        without_torques: false,
        assumed: Vec::new(),
        notes: Vec::new(),
    }
}

fn channel<const N: usize>(time_s: &[f64], value: impl Fn(f64) -> [f64; N]) -> Channel<N> {
    Channel { time_s: time_s.to_vec(), values: time_s.iter().copied().map(value).collect() }
}
