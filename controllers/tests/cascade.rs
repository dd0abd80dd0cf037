//! The thesis's first scenario flown by the cascade, and courses flown by the velocity law, in a closed loop.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::flight;
use controllers::cascade::CascadeLaw;
use controllers::cascade_gains::CascadeGains;
use controllers::velocity::{LoopsGains, VelocityLaw, VelocityLoop, VelocitySetPoint};
use flight::{Loop, NOISY, PERIOD_S, Senses, believed, vehicle};
use nalgebra::Vector3;
use vehicles::{MotorModel, Vehicle};

const NO_WALLS: flight::Walls = [f64::INFINITY; 4];

fn cascade() -> CascadeLaw {
    CascadeLaw {
        gains: CascadeGains::default(),
        vehicle: believed().hover_model(),
        period_s: PERIOD_S,
        attitude_every_steps: 1,
    }
}

fn velocity(constant: Option<VelocitySetPoint>) -> VelocityLaw {
    let velocity = VelocityLoop::new(&LoopsGains::default(), believed().hover_model(), PERIOD_S);
    VelocityLaw { velocity, constant }
}

/// Altitude and roll at every tick of 12 s: a step to 1.5 m at 2 s, a roll doublet of ±10 degrees at 6 s.
fn doublet(flown: Vehicle, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let law = cascade();
    let mut flight = Loop::of(flown, Vector3::z(), Senses::new(seed, NO_WALLS, NOISY));
    let (mut altitudes_m, mut rolls_deg) = (Vec::new(), Vec::new());
    for tick in 0..12_000 {
        flight.set_point.altitude_m = if tick < 2000 { 1.0 } else { 1.5 };
        let pulse = match tick {
            6000..7000 => 10.0_f64,
            7000..8000 => -10.0,
            _ => 0.0,
        };
        flight.set_point.roll_rad = pulse.to_radians();
        flight.step(&law);
        altitudes_m.push(flight.position().z);
        rolls_deg.push(flight.state.body.attitude_WB.euler_angles().0.to_degrees());
    }
    (altitudes_m, rolls_deg)
}

/// Eight seconds under `law`.
fn fly(flight: &mut Loop, law: &VelocityLaw) {
    for _ in 0..8000 {
        flight.step(law);
    }
}

/// The scenario's bounds, which are those of `pid`.
#[track_caller]
fn assert_flown(name: &str, (altitudes_m, rolls_deg): &(Vec<f64>, Vec<f64>)) {
    let max = |ticks: std::ops::Range<usize>| rolls_deg[ticks].iter().copied().fold(f64::MIN, f64::max);
    let min = |ticks: std::ops::Range<usize>| rolls_deg[ticks].iter().copied().fold(f64::MAX, f64::min);
    let altitude_error_m =
        altitudes_m[5000..].iter().fold(0.0_f64, |worst, altitude_m| worst.max((altitude_m - 1.5).abs()));
    let (first, second) = (max(6000..7000), min(7000..8000));
    let rest = max(9000..12_000).max(-min(9000..12_000));
    println!(
        "{name}: {first:.2} and {second:.2} deg, {rest:.2} deg after; altitude within {altitude_error_m:.4} m"
    );
    assert!((9.0..12.5).contains(&first) && (-12.5..-9.0).contains(&second), "{name}: {first} {second}");
    assert!(rest < 1.0, "{name}: {rest} deg one second after the doublet");
    assert!(altitude_error_m < 0.03, "{name}: altitude off by {altitude_error_m}");
}

#[test]
fn the_cascade_flies_the_step_and_the_doublet_whatever_the_seed() {
    for seed in 1..=3 {
        assert_flown(&format!("seed {seed}"), &doublet(vehicle(), seed));
    }
}

#[test]
fn the_cascade_flies_vehicles_that_differ_from_their_file() {
    let heavier = Vehicle { mass_kg: 1.05 * vehicle().mass_kg, ..vehicle() };
    let larger = Vehicle { inertia_kg_m2: 1.15 * vehicle().inertia_kg_m2, ..vehicle() };
    let motor = MotorModel::SecondOrder { natural_frequency_rad_s: 0.9 * 15.08, damping_ratio: 0.603 };
    let slower = Vehicle { motor, ..vehicle() };
    for (name, flown) in [("heavier", heavier), ("larger", larger), ("slower", slower)] {
        assert_flown(name, &doublet(flown, 1));
    }
}

#[test]
fn a_constant_velocity_is_reached_along_both_axes_at_any_heading() {
    for yaw_rad in [0.0, 1.0] {
        let held = VelocitySetPoint {
            velocity_m_s: [1.0, -0.5],
            altitude_m: 1.2,
            yaw_rad,
            ..VelocitySetPoint::default()
        };
        for seed in 1..=3 {
            let mut flight = Loop::new(Vector3::z(), Senses::new(seed, NO_WALLS, NOISY));
            fly(&mut flight, &velocity(Some(held)));
            let heading = nalgebra::Rotation2::new(flight.state.body.attitude_WB.euler_angles().2);
            let along_m_s = heading.inverse() * flight.state.body.velocity_W_m_s.xy();
            println!("yaw {yaw_rad}, seed {seed}: {along_m_s:?}, height {}", flight.position().z);
            assert!((along_m_s.x - 1.0).abs() < 0.05 && (along_m_s.y + 0.5).abs() < 0.05);
            assert!((flight.position().z - 1.2).abs() < 0.03);
            assert!((heading.angle() - yaw_rad).abs() < 0.03);
        }
    }
}

#[test]
fn a_references_velocity_is_one_of_the_world_whatever_the_heading() {
    let mut flight = Loop::new(Vector3::z(), Senses::new(1, NO_WALLS, NOISY));
    flight.reference.velocity = [0.0, 0.8, 0.0].into();
    flight.reference.position = [0.0, 0.0, 1.0].into();
    flight.reference.yaw = -0.7;
    fly(&mut flight, &velocity(None));
    let velocity_W_m_s = flight.state.body.velocity_W_m_s;
    assert!(velocity_W_m_s.x.abs() < 0.05 && (velocity_W_m_s.y - 0.8).abs() < 0.05, "{velocity_W_m_s}");
}

#[test]
fn a_flight_is_a_function_of_its_seed() {
    assert_eq!(doublet(vehicle(), 1), doublet(vehicle(), 1));
    assert_ne!(doublet(vehicle(), 1), doublet(vehicle(), 2));
}
