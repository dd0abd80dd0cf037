//! The thesis's rigs: the motions that they hold, and those that they leave free.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use crate::skipped::first;
use common::{TICK_S, hummingbird};
use nalgebra::{UnitQuaternion, Vector3};
use plant::{Airframe, Backend, NewtonEuler, Rapier, RigidBody};
use scenes::{Rig, Scene};

const SLIDING: &str = scenes::reference::RIG_SLIDING;
const FIXED: &str = scenes::reference::RIG_FIXED;

fn scene(text: &str) -> Scene {
    Scene::parse(text, "rig.toml").unwrap()
}

fn frictionless(text: &str) -> Scene {
    let mut scene = scene(text);
    let rig = scene.rig.as_mut().unwrap();
    (rig.bearing_friction_N_m, rig.bearing_damping_N_m_s) = (0.0, 0.0);
    (rig.slide_friction_N, rig.slide_damping_N_s_m) = (0.0, 0.0);
    scene
}

/// A vehicle that hangs in the rig, its nose towards `yaw_deg`.
fn hanging(scene: &Scene, yaw_deg: f64) -> Rapier {
    let attitude_WB = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_deg.to_radians());
    let body = RigidBody { attitude_WB, ..RigidBody::level_at(Vector3::zeros()) };
    common::rapier(NewtonEuler::new(hummingbird(), 1), scene, &body, 1.0)
}

/// Returns the place of the bearing's centre, seen from the lower end of its travel.
fn bearing_W_m(plant: &Rapier, rig: &Rig) -> Vector3<f64> {
    let body = plant.state().body;
    body.position_W_m + body.attitude_WB * rig.mount_B_m - rig.bearing_W_m
}

fn tilt_deg(plant: &Rapier) -> f64 {
    (plant.state().body.attitude_WB * Vector3::z()).angle(&Vector3::z()).to_degrees()
}

/// Asserts the rig's promises at a tick: the bearing on its line and within its travel, the tilt within its cone.
#[track_caller]
fn assert_held(plant: &Rapier, rig: &Rig, tick: usize) {
    let bearing_W_m = bearing_W_m(plant, rig);
    assert!(bearing_W_m.xy().norm() < 1e-3, "tick {tick}: off its line by {:?}", bearing_W_m.xy());
    let outside_m = (-bearing_W_m.z).max(bearing_W_m.z - rig.heave_m);
    // The end stops act where they are passed: by the way of a solver's step at most.
    assert!(outside_m < 2e-3, "tick {tick}: outside of its travel by {outside_m} m");
    let over_deg = tilt_deg(plant) - rig.tilt_max_rad.to_degrees();
    assert!(over_deg < 1.0, "tick {tick}: {over_deg} deg beyond the limit");
}

/// Commands that turn with all the rotors have about body x (or y), one way and then the other.
fn hard(tick: usize, axis: usize) -> [f64; 4] {
    let push = if (tick / 600).is_multiple_of(2) { 200.0 } else { 1.0 };
    let pull = 201.0 - push;
    if axis == 0 { [76.5, push, 76.5, pull] } else { [push, 76.5, pull, 76.5] }
}

#[test]
fn the_tilt_limit_holds_against_all_the_rotors_at_any_yaw_and_about_any_axis() {
    for text in [SLIDING, FIXED] {
        let scene = scene(text);
        let rig = scene.rig.unwrap();
        for yaw_deg in [0.0, 45.0, 90.0, 200.0] {
            for axis in [0, 1] {
                let mut plant = hanging(&scene, yaw_deg);
                let mut most_deg = 0.0_f64;
                for tick in 0..3_000 {
                    plant.step(&hard(tick, axis), TICK_S, &[]);
                    assert_held(&plant, &rig, tick);
                    most_deg = most_deg.max(tilt_deg(&plant));
                }
                assert!(most_deg > 44.5, "it has to reach the limit, or this shows nothing: {most_deg}");
            }
        }
    }
}

#[test]
fn it_hangs_at_the_lower_end_and_rises_to_the_upper_one() {
    let scene = scene(SLIDING);
    let rig = scene.rig.unwrap();
    let mut plant = hanging(&scene, 0.0);
    let fly = |plant: &mut Rapier, command: f64, ticks: usize| {
        for tick in 0..ticks {
            plant.step(&[command; 4], TICK_S, &[]);
            assert_held(plant, &rig, tick);
        }
        bearing_W_m(plant, &rig).z
    };
    assert!(fly(&mut plant, 1.0, 1_000).abs() < 1e-4, "the rope holds it");
    // Enough for the vehicle alone, and not for what hangs on it.
    assert!(fly(&mut plant, 78.0, 3_000).abs() < 1e-4, "the hanging mass is too heavy");
    assert!((fly(&mut plant, 120.0, 2_000) - 0.3).abs() < 1e-3, "the tube ends");
    assert!(fly(&mut plant, 1.0, 3_000).abs() < 1e-4, "and down again");
}

#[test]
fn the_accelerometer_feels_g_where_the_rope_carries_the_vehicle() {
    let mut plant = hanging(&scene(SLIDING), 30.0);
    for _ in 0..1_000 {
        plant.step(&[1.0; 4], TICK_S, &[]);
    }
    let felt = plant.accelerations().specific_force_B_m_s2;
    assert!((felt - Vector3::z() * 9.81).norm() < 1e-3, "{felt:?}");
    assert_eq!(plant.contact().count, 0, "a rig is no contact");
}

#[test]
fn hung_at_rest_the_accelerometer_feels_g_before_anything_has_moved() {
    for text in [SLIDING, FIXED] {
        for command in [1.0, 78.0] {
            let mut plant = hanging(&scene(text), 30.0);
            plant.settle_rotors(&[command; 4]);
            let felt = plant.accelerations().specific_force_B_m_s2;
            assert!((felt - Vector3::z() * 9.81).norm() < 1e-9, "{felt:?}");
        }
    }
    let mut plant = hanging(&scene(SLIDING), 0.0);
    plant.settle_rotors(&[120.0; 4]);
    assert!(plant.accelerations().specific_force_B_m_s2.z > 10.0, "it rises");
}

#[test]
fn the_bearing_holds_the_frame_where_it_is_whatever_the_centre_of_mass() {
    let kind = plant::effects::find("com-offset").unwrap();
    let effect = plant::effects::Effect { kind, values: common::values([0.02, -0.01, 0.005]) };
    let model = NewtonEuler::flying(Airframe::with_effects(hummingbird(), vec![effect]), 1);
    let effects = model.airframe().initial_state(0, "plant", TICK_S);
    let scene = scene(FIXED);
    let rig = scene.rig.unwrap();
    let mut plant = Rapier::new(model, effects, &scene, &RigidBody::level_at(Vector3::zeros()), 1.0);
    for tick in 0..500 {
        let body = plant.state().body;
        let mount_B_m = rig.mount_B_m - Vector3::new(0.02, -0.01, 0.005);
        let off_m = (body.position_W_m + body.attitude_WB * mount_B_m - rig.bearing_W_m).norm();
        assert!(off_m < 1e-3, "tick {tick}: {off_m}");
        plant.step(&[1.0; 4], TICK_S, &[]);
    }
    assert!(tilt_deg(&plant) > 5.0, "it swings, or this shows nothing");
}

#[test]
fn yaw_is_free() {
    let mut plant = hanging(&frictionless(FIXED), 0.0);
    let body = plant.state().body;
    plant.set_body(&RigidBody { angular_velocity_B_rad_s: Vector3::z() * 2.0, ..body });
    // Nothing but the drag of idling rotors, which cancels, and their spin-down.
    let mut turned_rad = 0.0;
    for _ in 0..5_000 {
        plant.step(&[1.0; 4], TICK_S, &[]);
        turned_rad += plant.state().body.angular_velocity_B_rad_s.z * TICK_S;
    }
    assert!((turned_rad - 10.0).abs() < 0.02, "it turns on by itself: {turned_rad}");
    assert!(tilt_deg(&plant) < 0.1);
}

/// Energy of the vehicle's motion and height, without that of its rotors.
fn energy_J(plant: &Rapier) -> f64 {
    let (vehicle, body) = (hummingbird(), plant.state().body);
    let w = body.angular_velocity_B_rad_s;
    0.5 * vehicle.mass_kg * body.velocity_W_m_s.norm_squared()
        + 0.5 * w.dot(&(vehicle.inertia_kg_m2 * w))
        + vehicle.mass_kg * vehicle.gravity_m_s2 * body.position_W_m.z
}

fn swinging(scene: &Scene) -> Rapier {
    let mut vehicle = hummingbird();
    (vehicle.thrust_coefficient, vehicle.torque_coefficient) = (0.0, 0.0);
    let body = RigidBody {
        attitude_WB: UnitQuaternion::from_euler_angles(0.5, 0.0, 0.3),
        ..RigidBody::level_at(Vector3::zeros())
    };
    common::rapier(NewtonEuler::new(vehicle, 1), scene, &body, 1.0)
}

#[test]
fn it_swings_about_the_bearing_as_a_pendulum_does() {
    let mut plant = swinging(&frictionless(FIXED));
    let start_J = energy_J(&plant);
    // A physical pendulum at 0.5 rad: 2 pi sqrt((J + m l^2) / (m g l)), times 1 + 0.5^2 / 16 + ...
    let (inertia, turning) = (5.6e-3 + 0.48 * 0.05_f64.powi(2), 0.48 * 9.81 * 0.05);
    let expected_s = std::f64::consts::TAU * f64::sqrt(inertia / turning) * 1.0158;
    let (mut crossings, mut before) = (Vec::new(), 1.0);
    for tick in 0..10_000 {
        plant.step(&[1.0; 4], TICK_S, &[]);
        let lean = (plant.state().body.attitude_WB.inverse_transform_vector(&Vector3::z())).y;
        if lean < 0.0 && before >= 0.0 {
            crossings.push(f64::from(tick) * TICK_S);
        }
        before = lean;
        let gained_J = energy_J(&plant) - start_J;
        assert!(gained_J.abs() < 1e-3, "tick {tick}: {gained_J} J of the 29 mJ that it swings with");
    }
    let periods = crossings.len() - 1;
    let period_s = (crossings[periods] - crossings[0]) / periods as f64;
    assert!((period_s / expected_s - 1.0).abs() < 0.005, "{period_s} s, expected {expected_s} s");
}

#[test]
fn a_bearing_that_sways_moves_aside_with_the_thrust_and_no_further_than_it_may() {
    let mut scene = frictionless(SLIDING);
    let rig = scene.rig.as_mut().unwrap();
    (rig.sway_m, rig.moving_mass_kg) = (0.2, 0.01);
    let rig = *rig;
    let lean = |tick| if tick < 150 { [76.5, 77.5, 76.5, 75.5] } else { [76.5, 75.5, 76.5, 77.5] };
    let mut plant = hanging(&scene, 0.0);
    let mut most_m = 0.0_f64;
    for tick in 0..4_000 {
        plant.step(&lean(tick % 300), TICK_S, &[]);
        let off_m = bearing_W_m(&plant, &rig).xy();
        // The end stop acts where it is passed, here by a vehicle that comes flying.
        assert!(off_m.amax() < rig.sway_m + 5e-3, "tick {tick}: {off_m:?}");
        most_m = most_m.max(off_m.amax());
    }
    assert!(most_m > 0.19, "it sways, or this shows nothing: {most_m}");
}

#[test]
fn while_it_may_sway_it_turns_and_moves_aside_as_in_free_flight() {
    let mut scene = frictionless(SLIDING);
    let rig = scene.rig.as_mut().unwrap();
    (rig.sway_m, rig.heave_m, rig.moving_mass_kg) = (100.0, 100.0, 1e-3);
    let start = RigidBody::level_at(Vector3::new(0.0, 0.0, 2.0));
    let flown = |scene: &Scene| {
        let mut plant = common::rapier(NewtonEuler::new(hummingbird(), 1), scene, &start, 1.0);
        plant.settle_rotors(&[78.0; 4]);
        for tick in 0..600 {
            let lean = if tick % 200 < 100 { 2.0 } else { -2.0 };
            plant.step(&[78.0 + lean, 78.0 + lean, 78.0 - lean, 78.0 - lean], TICK_S, &[]);
        }
        // Aside only: what hangs with it, a gram, weighs.
        (tilt_deg(&plant), (plant.state().body.position_W_m - start.position_W_m).xy())
    };
    let ((hung_deg, hung_m), (free_deg, free_m)) = (flown(&scene), flown(&Scene::default()));
    assert!(free_deg > 5.0 && free_m.norm() > 0.03, "it leans and moves: {free_deg} deg, {free_m:?}");
    assert!((hung_deg - free_deg).abs() < 0.02 * free_deg, "{hung_deg} deg, free {free_deg} deg");
    assert!((hung_m - free_m).norm() < 0.02 * free_m.norm(), "{hung_m:?}, free {free_m:?}");
}

#[test]
fn friction_takes_energy_and_brings_it_to_rest() {
    for text in first(1, "rigs", [SLIDING, FIXED]) {
        let mut plant = swinging(&scene(text));
        let mut last_J = energy_J(&plant);
        for tick in 0..20_000 {
            plant.step(&[1.0; 4], TICK_S, &[]);
            let energy_J = energy_J(&plant);
            assert!(energy_J < last_J + 1e-5, "tick {tick}: {energy_J} after {last_J}");
            last_J = last_J.min(energy_J);
        }
        assert!(plant.state().body.angular_velocity_B_rad_s.norm() < 0.01);
    }
}

#[test]
fn of_a_start_in_a_rig_only_the_height_counts_and_that_within_the_heave() {
    let scene = scene(SLIDING);
    for (height_m, expected_m) in [(0.0, 0.0), (1.6, 0.15), (9.0, 0.3)] {
        let body = RigidBody::level_at(Vector3::new(3.0, -2.0, height_m));
        let plant = common::rapier(NewtonEuler::new(hummingbird(), 1), &scene, &body, 1.0);
        let bearing_W_m = bearing_W_m(&plant, &scene.rig.unwrap());
        assert!((bearing_W_m - Vector3::z() * expected_m).norm() < 1e-12, "{bearing_W_m:?}");
    }
}
