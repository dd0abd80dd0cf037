//! Driven joints against closed forms.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use crate::skipped::is_left;
use common::parts::{body, given, joint, keys};
use common::{G_M_S2, TICK_S, hummingbird};
use nalgebra::Vector3;
use plant::{Backend, NewtonEuler, Rapier, RigidBody};
use scenes::Scene;

/// Moment of inertia of [`BALL`], 2/5 m r²: 3e-4 kg m².
const BALL_KG_M2: f64 = 0.4 * 0.3 * 0.05 * 0.05;

const BALL: [(&str, &str, &str); 3] =
    [("centre", "[0, 0, 5]", "m"), ("radius", "0.05", "m"), ("mass", "0.3", "kg")];

/// An upright axis through the ball's middle, so that gravity does not turn it.
const SPINDLE: [(&str, &str, &str); 2] = [("anchor", "[0, 0, 5]", "m"), ("axis", "[0, 0, 1]", "1")];

/// The table of a drive, behind its joint.
fn drive(mode: &str, numbers: &[(&str, &str, &str)]) -> String {
    format!("[joints.drive]\nmode = \"{mode}\"\n{}", keys(numbers))
}

/// The ball on a spindle with these further keys of the joint.
fn spindle(more: &[(&str, &str, &str)], drive: &str) -> [String; 2] {
    let tie = joint("revolute", ["world", "ball"], &[&SPINDLE[..], more].concat()) + drive;
    [body("balls", "ball", &BALL), tie]
}

/// A scene in which the vehicle hovers 100 m away.
fn plant(parts: &[String]) -> Rapier {
    plant_at(parts, Vector3::new(100.0, 0.0, 50.0))
}

fn plant_at(parts: &[String], vehicle_W_m: Vector3<f64>) -> Rapier {
    let text = format!("name = \"test\"\n{}", parts.concat());
    let scene = Scene::parse(&text, "test.toml").unwrap_or_else(|error| panic!("{error}\n{text}"));
    let model = NewtonEuler::new(hummingbird(), 2);
    let mut plant = common::rapier(model, &scene, &RigidBody::level_at(vehicle_W_m), 1e9);
    plant.settle_rotors(&[hummingbird().hover_command(); 4]);
    plant
}

fn tick(plant: &mut Rapier) -> RigidBody {
    plant.step(&[hummingbird().hover_command(); 4], TICK_S, &[]);
    plant.bodies()[0]
}

/// The bodies of each tick up to `time_s`, with the time.
fn flown(plant: &mut Rapier, time_s: f64) -> Vec<(f64, RigidBody)> {
    let ticks = (time_s / TICK_S).round() as u32;
    (1..=ticks).map(|number| (f64::from(number) * TICK_S, tick(plant))).collect()
}

fn spin_rad_s(body: &RigidBody) -> f64 {
    (body.attitude_WB * body.angular_velocity_B_rad_s).z
}

/// The angle about the vertical, from -pi to pi.
fn angle_rad(body: &RigidBody) -> f64 {
    let turn = body.attitude_WB;
    2.0 * libm::atan2(turn.k * turn.w.signum(), turn.w.abs())
}

#[track_caller]
fn near(found: f64, expected: f64, within: f64, time_s: f64) {
    assert!((found - expected).abs() < within, "{found}, not {expected}, after {time_s} s");
}

#[test]
fn a_speed_is_neared_with_the_time_constant_of_inertia_by_damping() {
    let drive = drive("speed", &[("damping", "0.006", "N*m*s/rad"), ("schedule", "[[0, 2]]", "rad/s")]);
    let lag_s = BALL_KG_M2 / 0.006;
    for (time_s, found) in flown(&mut plant(&spindle(&[], &drive)), 0.5) {
        near(spin_rad_s(&found), 2.0 * (1.0 - libm::exp(-time_s / lag_s)), 1e-9, time_s);
    }
}

#[test]
fn a_scheduled_speed_is_followed_late_by_the_time_constant() {
    // A ramp of 4 rad/s2 from 0.1 s to 0.5 s. A ball bounces far away, so that most steps are cut at impacts.
    let schedule = ("schedule", "[[0.1, 0], [0.5, 1.6]]", "rad/s");
    let drive = drive("speed", &[("damping", "0.006", "N*m*s/rad"), schedule]);
    let low = [("centre", "[3, 0, 0.0602]", "m"), BALL[1], BALL[2]];
    let bouncing = body("balls", "bouncing", &low) + "restitution = " + &given("1", "1") + "\n";
    let [ball, tie] = spindle(&[], &drive);
    let lag_s = BALL_KG_M2 / 0.006;
    let ramp_rad_s = |time_s: f64| 4.0 * (time_s - lag_s * (1.0 - libm::exp(-time_s / lag_s)));
    for (time_s, found) in flown(&mut plant(&[ball, bouncing, tie]), 1.0) {
        let expected_rad_s = match time_s {
            before if before <= 0.1 => 0.0,
            during if during <= 0.5 => ramp_rad_s(during - 0.1),
            after => 1.6 - (1.6 - ramp_rad_s(0.4)) * libm::exp(-(after - 0.5) / lag_s),
        };
        near(spin_rad_s(&found), expected_rad_s, 1e-9, time_s);
    }
}

#[test]
fn a_position_without_damping_is_swung_about_with_the_frequency_of_stiffness_by_inertia() {
    let drive = drive("position", &[("stiffness", "0.03", "N*m/rad"), ("schedule", "[[0, 0.5]]", "rad")]);
    // 10 rad/s.
    let frequency_rad_s = (0.03 / BALL_KG_M2).sqrt();
    for (time_s, found) in flown(&mut plant(&spindle(&[], &drive)), 5.0) {
        let expected_rad = 0.5 * (1.0 - libm::cos(frequency_rad_s * time_s));
        near(angle_rad(&found), expected_rad, 1e-8, time_s);
    }
}

#[test]
fn a_damped_position_comes_to_rest_as_an_oscillator_does() {
    let gains = [("stiffness", "0.03", "N*m/rad"), ("damping", "0.002", "N*m*s/rad")];
    let drive = drive("position", &[&gains[..], &[("schedule", "[[0, 30]]", "deg")]].concat());
    // Beside the damping of the joint itself.
    let parts = spindle(&[("damping", "0.001", "N*m*s/rad")], &drive);
    let target_rad = 30.0_f64.to_radians();
    let decay_per_s = 0.003 / (2.0 * BALL_KG_M2);
    let swing_rad_s = (0.03 / BALL_KG_M2 - decay_per_s * decay_per_s).sqrt();
    for (time_s, found) in flown(&mut plant(&parts), 2.0) {
        let (sin, cos) = libm::sincos(swing_rad_s * time_s);
        let left = libm::exp(-decay_per_s * time_s) * (cos + decay_per_s / swing_rad_s * sin);
        near(angle_rad(&found), target_rad * (1.0 - left), 1e-9, time_s);
    }
}

#[test]
fn a_jump_acts_from_its_time_on_and_not_before() {
    // At a tick, and between two steps of half a millisecond within one.
    for at_s in [0.1, 0.1005] {
        let points = format!("[[0, 0], [{at_s}, 0], [{at_s}, 2]]");
        let drive = drive("speed", &[("damping", "0.006", "N*m*s/rad"), ("schedule", &points, "rad/s")]);
        let lag_s = BALL_KG_M2 / 0.006;
        for (time_s, found) in flown(&mut plant(&spindle(&[], &drive)), 0.4) {
            let since_s = (time_s - at_s).max(0.0);
            near(spin_rad_s(&found), 2.0 * (1.0 - libm::exp(-since_s / lag_s)), 1e-9, time_s);
        }
    }
}

#[test]
fn a_slide_is_held_against_gravity_below_its_target_by_weight_by_stiffness() {
    let shaft = [("anchor", "[0, 0, 5]", "m"), ("axis", "[0, 0, 1]", "1")];
    let gains = [("stiffness", "300", "N/m"), ("damping", "19", "N*s/m"), ("schedule", "[[0, 20]]", "cm")];
    let tie = joint("prismatic", ["world", "ball"], &shaft) + &drive("position", &gains);
    let mut plant = plant(&[body("balls", "ball", &BALL), tie]);
    let (time_s, found) = *flown(&mut plant, 2.0).last().unwrap();
    near(found.position_W_m.z, 5.2 - 0.3 * G_M_S2 / 300.0, 1e-10, time_s);
    assert!(found.position_W_m.xy().norm() < 1e-12 && found.attitude_WB.angle() < 1e-12, "{found:?}");
}

#[test]
fn a_force_at_its_limit_accelerates_evenly() {
    let limit = ("limit", "0.0012", "N*m");
    let speed = [("damping", "1", "N*m*s/rad"), limit, ("schedule", "[[0, -50]]", "rad/s")];
    // 4 rad/s2, down to the target.
    for (time_s, found) in flown(&mut plant(&spindle(&[], &drive("speed", &speed))), 1.0) {
        near(spin_rad_s(&found), -4.0 * time_s, 1e-10, time_s);
    }
    let position = [("stiffness", "10", "N*m/rad"), limit, ("schedule", "[[0, 3]]", "rad")];
    for (time_s, found) in flown(&mut plant(&spindle(&[], &drive("position", &position))), 1.0) {
        near(angle_rad(&found), 2.0 * time_s * time_s, 1e-10, time_s);
    }
}

#[test]
fn two_free_bodies_are_pushed_in_opposite_ways_and_keep_their_momentum() {
    // A ball of twice the radius and mass: eight times the inertia. Both fall, and one turns the other.
    let other = [("centre", "[0, 0, 5.2]", "m"), ("radius", "0.1", "m"), ("mass", "0.6", "kg")];
    let drive = drive("speed", &[("damping", "0.006", "N*m*s/rad"), ("schedule", "[[0, 3]]", "rad/s")]);
    let tie = joint("revolute", ["other", "ball"], &SPINDLE) + &drive;
    let mut plant = plant(&[body("balls", "ball", &BALL), body("balls", "other", &other), tie]);
    let other_kg_m2 = 8.0 * BALL_KG_M2;
    let lag_s = BALL_KG_M2 * other_kg_m2 / (BALL_KG_M2 + other_kg_m2) / 0.006;
    for number in 1..=500_u32 {
        tick(&mut plant);
        let time_s = f64::from(number) * TICK_S;
        let [ball, other] = plant.bodies() else { panic!("two bodies") };
        let spins_rad_s = [spin_rad_s(ball), spin_rad_s(other)];
        near(spins_rad_s[0] - spins_rad_s[1], 3.0 * (1.0 - libm::exp(-time_s / lag_s)), 1e-9, time_s);
        near(BALL_KG_M2 * spins_rad_s[0] + other_kg_m2 * spins_rad_s[1], 0.0, 1e-15, time_s);
        for (body, start_m) in [(ball, 5.0), (other, 5.2)] {
            near(body.position_W_m.z, start_m - G_M_S2 / 2.0 * time_s * time_s, 1e-10, time_s);
        }
    }
}

#[test]
fn a_slide_between_two_free_bodies_keeps_their_momentum() {
    let other = [("centre", "[1, 0, 5]", "m"), BALL[1], ("mass", "0.9", "kg")];
    let rail = [("anchor", "[0, 0, 5]", "m"), ("axis", "[1, 0, 0]", "1")];
    let drive = drive("speed", &[("damping", "2", "N*s/m"), ("schedule", "[[0, 0.4]]", "m/s")]);
    let tie = joint("prismatic", ["ball", "other"], &rail) + &drive;
    let mut plant = plant(&[body("balls", "ball", &BALL), body("balls", "other", &other), tie]);
    let lag_s = 0.3 * 0.9 / 1.2 / 2.0;
    for number in 1..=500_u32 {
        tick(&mut plant);
        let time_s = f64::from(number) * TICK_S;
        let [ball_m_s, other_m_s] = [0, 1].map(|place| plant.bodies()[place].velocity_W_m_s.x);
        near(other_m_s - ball_m_s, 0.4 * (1.0 - libm::exp(-time_s / lag_s)), 1e-9, time_s);
        near(0.3 * ball_m_s + 0.9 * other_m_s, 0.0, 1e-13, time_s);
    }
}

#[test]
fn an_arm_of_the_vehicle_turns_the_vehicle_the_other_way_and_it_is_felt() {
    // Below the centre of mass, on the vertical axis through it.
    let arm = [("centre", "[0, 0, -0.05]", "m"), ("radius", "0.02", "m"), ("mass", "0.2", "kg")];
    let axis = [("anchor", "[0, 0, -0.05]", "m"), ("axis", "[0, 0, 1]", "1")];
    let limited =
        [("damping", "1", "N*m*s/rad"), ("limit", "0.002", "N*m"), ("schedule", "[[0, 500]]", "rad/s")];
    let tie = joint("revolute", ["vehicle", "arm"], &axis) + &drive("speed", &limited);
    let mut plant = plant_at(&[body("balls", "arm", &arm), tie], Vector3::z() * 50.0);
    let about_z_kg_m2 = hummingbird().inertia_kg_m2[(2, 2)];
    for number in 1..=500_u32 {
        let (arm, time_s) = (tick(&mut plant), f64::from(number) * TICK_S);
        near(spin_rad_s(&arm), 0.002 / (0.4 * 0.2 * 0.02 * 0.02) * time_s, 1e-6, time_s);
        near(spin_rad_s(&plant.state().body), -0.002 / about_z_kg_m2 * time_s, 1e-6, time_s);
        let felt_rad_s2 = plant.accelerations().angular_acceleration_B_rad_s2.z;
        near(felt_rad_s2, -0.002 / about_z_kg_m2, 1e-6, time_s);
    }
}

#[test]
fn a_hinge_without_stops_turns_round_as_often_as_its_schedule_says() {
    let gains = [("stiffness", "0.03", "N*m/rad"), ("damping", "0.006", "N*m*s/rad")];
    // Three turns within 3 s, and back by a quarter.
    let schedule = ("schedule", "[[0, 0], [3, 1080], [3.5, 990]]", "deg");
    let mut plant = plant(&spindle(&[], &drive("position", &[&gains[..], &[schedule]].concat())));
    let states = flown(&mut plant, 5.0);
    let turned_rad: f64 = states.iter().map(|(_, body)| spin_rad_s(body) * TICK_S).sum();
    near(turned_rad, 990.0_f64.to_radians(), 1e-2, 5.0);
    near(angle_rad(&states.last().unwrap().1), -90.0_f64.to_radians(), 1e-5, 5.0);
}

#[test]
fn a_target_beyond_a_stop_presses_against_it() {
    let stops = [("lower", "-170", "deg"), ("upper", "60", "deg")];
    let gains = [("stiffness", "0.03", "N*m/rad"), ("damping", "0.006", "N*m*s/rad")];
    let schedule = ("schedule", "[[0, 0], [0.5, 170], [1, 170], [1, -160]]", "deg");
    let drive = drive("position", &[&gains[..], &[schedule]].concat());
    for (time_s, found) in flown(&mut plant(&spindle(&stops, &drive)), 4.0) {
        let angle_deg = angle_rad(&found).to_degrees();
        assert!(angle_deg < 60.0 + 1e-3, "{angle_deg} deg after {time_s} s");
        if (0.6..1.0).contains(&time_s) {
            near(angle_deg, 60.0, 1e-3, time_s);
        }
        if time_s > 3.5 {
            // Not the shorter way, through the stops.
            near(angle_deg, -160.0, 1e-3, time_s);
        }
    }
}

#[test]
fn gains_as_fast_as_a_step_may_follow_come_to_rest() {
    // A pole of 2.5 by a step of half a millisecond, as damping and as stiffness.
    let pole_per_s = 2.5 / (TICK_S / 2.0);
    let damping = (BALL_KG_M2 * pole_per_s).to_string();
    let stiffness = (BALL_KG_M2 * pole_per_s * pole_per_s).to_string();
    let speed = drive("speed", &[("damping", &damping, "N*m*s/rad"), ("schedule", "[[0, 1]]", "rad/s")]);
    let (time_s, found) = *flown(&mut plant(&spindle(&[], &speed)), 1.0).last().unwrap();
    near(spin_rad_s(&found), 1.0, 1e-9, time_s);
    let held = drive("position", &[("stiffness", &stiffness, "N*m/rad"), ("schedule", "[[0, 1]]", "rad")]);
    let (time_s, found) = *flown(&mut plant(&spindle(&[], &held)), 1.0).last().unwrap();
    near(angle_rad(&found), 1.0, 1e-9, time_s);
}

/// Driven joints of the world, of the vehicle and of both kinds, with schedules.
fn reference() -> Rapier {
    let scene = Scene::parse(scenes::reference::DRIVEN_JOINTS, "driven-joints.toml").unwrap();
    let model = NewtonEuler::new(hummingbird(), 2);
    common::rapier(model, &scene, &RigidBody::level_at(Vector3::z()), 1e9)
}

#[test]
fn two_flights_are_the_same_bytes_and_a_snapshot_goes_on_in_the_middle_of_a_schedule() {
    if is_left("`free_bodies::another_instance_goes_on_from_a_snapshot_to_the_same_bits` has joints") {
        return;
    }
    let [mut first, mut second] = [reference(), reference()];
    for plant in [&mut first, &mut second] {
        flown(plant, 3.3);
    }
    let bytes = first.snapshot().unwrap();
    assert_eq!(bytes, second.snapshot().unwrap());
    let mut restored = reference();
    restored.restore(&bytes).unwrap();
    flown(&mut first, 2.0);
    flown(&mut restored, 2.0);
    assert_eq!((first.state(), first.bodies()), (restored.state(), restored.bodies()));
    assert_eq!(first.snapshot().unwrap(), restored.snapshot().unwrap());
    assert!(first.bodies()[1].position_W_m.y > 1.2, "the gate is open: {:?}", first.bodies());
}

#[test]
fn a_snapshot_of_another_schedule_is_refused() {
    let with = |target: &str| {
        let schedule = ("schedule", target, "rad/s");
        plant(&spindle(&[], &drive("speed", &[("damping", "0.006", "N*m*s/rad"), schedule])))
    };
    let bytes = with("[[0, 2]]").snapshot().unwrap();
    assert!(with("[[0, 2]]").restore(&bytes).is_ok());
    for other in ["[[0, 2.5]]", "[[1, 2]]", "[[0, 2], [1, 2]]"] {
        assert!(with(other).restore(&bytes).is_err(), "{other}");
    }
}
