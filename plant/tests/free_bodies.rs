//! Free bodies and joints against closed forms, and their forces on the vehicle.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use crate::skipped::{is_left, quick_or};
use common::parts::{body, given, joint};
use common::{G_M_S2, TICK_S, bodies_energy_J, hummingbird};
use nalgebra::{Matrix3, Vector3};
use plant::{Backend, NewtonEuler, Rapier, RigidBody};
use scenes::Scene;
use std::f64::consts::PI;
use vehicles::Vehicle;

/// A scene in which the vehicle is far away.
fn plant(parts: &[String]) -> Rapier {
    plant_at(parts, Vector3::new(100.0, 0.0, 50.0))
}

fn plant_at(parts: &[String], vehicle_W_m: Vector3<f64>) -> Rapier {
    let text = format!("name = \"test\"\n{}", parts.concat());
    let scene = Scene::parse(&text, "test.toml").unwrap_or_else(|error| panic!("{error}\n{text}"));
    let model = NewtonEuler::new(hummingbird(), 2);
    common::rapier(model, &scene, &RigidBody::level_at(vehicle_W_m), 1e9)
}

fn tick(plant: &mut Rapier) -> RigidBody {
    plant.step(&[hummingbird().hover_command(); 4], TICK_S, &[]);
    plant.bodies()[0]
}

fn after(plant: &mut Rapier, time_s: f64) -> RigidBody {
    (0..(time_s / TICK_S).round() as u32).map(|_| tick(plant)).last().unwrap()
}

const BALL: [(&str, &str, &str); 3] =
    [("centre", "[0, 0, 5]", "m"), ("radius", "0.05", "m"), ("mass", "0.3", "kg")];

#[test]
fn what_nothing_holds_flies_on_a_parabola_and_keeps_its_spin() {
    let thrown = [("velocity", "[1, -2, 3]", "m/s"), ("angular_velocity", "[4, 5, 6]", "rad/s")];
    let mut plant = plant(&[body("balls", "ball", &[&BALL[..], &thrown].concat())]);
    let found = after(&mut plant, 1.0);
    let expected_W_m = Vector3::new(1.0, -2.0, 5.0 + 3.0 - G_M_S2 / 2.0);
    assert!((found.position_W_m - expected_W_m).norm() < 1e-10, "{found:?}");
    let spin_W_rad_s = found.attitude_WB * found.angular_velocity_B_rad_s;
    assert!((spin_W_rad_s - Vector3::new(4.0, 5.0, 6.0)).norm() < 1e-10, "{found:?}");
}

#[test]
fn a_pendulum_on_a_ball_joint_swings_as_the_elliptic_integral_says() {
    if is_left("`rigs::it_swings_about_the_bearing_as_a_pendulum_does` has a pendulum") {
        return;
    }
    // A ball of radius 0.05 m, 1 m below the joint, from 60 degrees.
    let (sin, cos) = libm::sincos(PI / 3.0);
    let centre = format!("[{sin}, 0, {}]", 5.0 - cos);
    let ball = [("centre", &*centre, "m"), BALL[1], BALL[2]];
    let tie = joint("ball", ["world", "ball"], &[("anchor", "[0, 0, 5]", "m")]);
    let mut plant = plant(&[body("balls", "ball", &ball), tie]);
    // T = 4 sqrt(I / m g l) K(sin(30 deg)), K = 1.685750354812596.
    let about_m2 = 1.0 + 0.4 * 0.05 * 0.05;
    let period_s = 4.0 * (about_m2 / G_M_S2).sqrt() * 1.685_750_354_812_596;
    let mut crossings = Vec::new();
    let mut before_m = sin;
    for number in 1..=9_000_u32 {
        let found = tick(&mut plant);
        assert!(((found.position_W_m - Vector3::z() * 5.0).norm() - 1.0).abs() < 1e-11, "{found:?}");
        assert!(found.position_W_m.y.abs() < 1e-12);
        let x_m = found.position_W_m.x;
        if before_m < 0.0 && x_m >= 0.0 {
            crossings.push((f64::from(number) - x_m / (x_m - before_m)) * TICK_S);
        }
        before_m = x_m;
    }
    let found_s = (crossings[3] - crossings[0]) / 3.0;
    assert!((found_s - period_s).abs() < 2e-6, "{found_s} s, not {period_s} s");
}

#[test]
fn a_hinge_turns_about_its_axis_alone_and_stops_at_its_limits() {
    let door = [
        ("centre", "[0.5, 0, 1.1]", "m"),
        ("size", "[0.8, 0.05, 1.8]", "m"),
        ("mass", "8", "kg"),
        ("angular_velocity", "[0, 0, 2]", "rad/s"),
        ("velocity", "[0, 1, 0]", "m/s"),
    ];
    let limits = [
        ("anchor", "[0, 0, 1.1]", "m"),
        ("axis", "[0, 0, 1]", "1"),
        ("lower", "-90", "deg"),
        ("upper", "60", "deg"),
    ];
    let mut plant = plant(&[body("boxes", "door", &door), joint("revolute", ["world", "door"], &limits)]);
    for number in 1..=2_000_u32 {
        let found = tick(&mut plant);
        let angle_rad = found.attitude_WB.angle();
        let time_s = f64::from(number) * TICK_S;
        // Two rad/s up to the stop, which is inelastic.
        let expected_rad = (2.0 * time_s).min(PI / 3.0);
        assert!((angle_rad - expected_rad).abs() < 3e-5, "{angle_rad} rad after {time_s} s");
        assert!((found.attitude_WB * Vector3::z() - Vector3::z()).norm() < 1e-10, "it stands upright");
        assert!((found.position_W_m.z - 1.1).abs() < 1e-10, "it hangs where it hung");
    }
}

#[test]
fn a_slide_falls_freely_along_its_axis_and_stops_at_its_end() {
    let slope = [("anchor", "[0, 0, 5]", "m"), ("axis", "[1, 0, -1]", "1"), ("upper", "1", "m")];
    let mut plant = plant(&[body("balls", "ball", &BALL), joint("prismatic", ["world", "ball"], &slope)]);
    let along = Vector3::new(1.0, 0.0, -1.0).normalize();
    for number in 1..=1_000_u32 {
        let time_s = f64::from(number) * TICK_S;
        let off_W_m = tick(&mut plant).position_W_m - Vector3::z() * 5.0;
        let expected_m = (G_M_S2 / 2.0_f64.sqrt() / 2.0 * time_s * time_s).min(1.0);
        assert!((off_W_m - along * expected_m).norm() < 1e-5, "{off_W_m:?}, not {expected_m} m along");
    }
}

#[test]
fn a_damped_slide_nears_its_terminal_speed() {
    let shaft = [("anchor", "[0, 0, 5]", "m"), ("axis", "[0, 0, 1]", "1"), ("damping", "3", "N*s/m")];
    let mut plant = plant(&[body("balls", "ball", &BALL), joint("prismatic", ["world", "ball"], &shaft)]);
    // v = m g / d (1 - exp(-t d / m)): 0.981 m/s, with a time constant of 0.1 s.
    let found = after(&mut plant, 0.2);
    let expected_m_s = -0.981 * (1.0 - libm::exp(-2.0));
    assert!((found.velocity_W_m_s.z - expected_m_s).abs() < 1e-9, "{found:?}");
}

#[test]
fn a_rope_lets_a_ball_fall_freely_and_then_holds_it() {
    let rope = [("anchor", "[0, 0, 5]", "m"), ("end", "[0, 0, 5]", "m"), ("length", "1.25", "m")];
    let mut plant = plant(&[body("balls", "ball", &BALL), joint("rope", ["world", "ball"], &rope)]);
    for number in 1..=3_000_u32 {
        let time_s = f64::from(number) * TICK_S;
        let height_m = tick(&mut plant).position_W_m.z;
        let expected_m = (5.0 - G_M_S2 / 2.0 * time_s * time_s).max(3.75);
        assert!((height_m - expected_m).abs() < 2e-6, "{height_m} m, not {expected_m} m, after {time_s} s");
    }
}

#[test]
fn a_rope_that_swings_keeps_its_energy_and_its_length() {
    let ball = [("centre", "[1, 0, 5]", "m"), BALL[1], BALL[2]];
    let rope = [("anchor", "[0, 0, 5]", "m"), ("end", "[1, 0, 5]", "m"), ("length", "1", "m")];
    let mut plant = plant(&[body("balls", "ball", &ball), joint("rope", ["world", "ball"], &rope)]);
    for _ in 0..quick_or(3_000, 10_000, "longer times") {
        let found = tick(&mut plant);
        let energy_J_kg = found.velocity_W_m_s.norm_squared() / 2.0 + G_M_S2 * (found.position_W_m.z - 5.0);
        assert!(energy_J_kg.abs() < 1e-6, "{energy_J_kg} J/kg at {found:?}");
        assert!((found.position_W_m - Vector3::z() * 5.0).norm() < 1.0 + 1e-9);
    }
}

#[test]
fn a_box_slides_as_coulomb_says_and_a_stack_stands() {
    let boxed = |name: &str, z: &str| {
        let keys = [("centre", z, "m"), ("size", "[0.2, 0.2, 0.2]", "m"), ("mass", "1", "kg")];
        body("boxes", name, &keys)
    };
    let mut stack = plant(&[boxed("low", "[0, 0, 0.1]"), boxed("high", "[0.03, 0, 0.3]")]);
    (0..2_000).for_each(|_| _ = tick(&mut stack));
    for (found, expected_W_m) in
        stack.bodies().iter().zip([Vector3::new(0.0, 0.0, 0.1), Vector3::new(0.03, 0.0, 0.3)])
    {
        assert!((found.position_W_m - expected_W_m).norm() < 1e-8, "{found:?}");
        assert!(found.velocity_W_m_s.norm() < 1e-10 && found.attitude_WB.angle() < 1e-8, "{found:?}");
    }
    let pushed = [
        ("centre", "[0, 0, 0.05]", "m"),
        ("size", "[0.4, 0.4, 0.1]", "m"),
        ("mass", "1", "kg"),
        ("velocity", "[1.8, 2.4, 0]", "m/s"),
    ];
    let mut slide = plant(&[body("boxes", "crate", &pushed)]);
    let found = after(&mut slide, 2.0);
    let expected_m = 9.0 / (2.0 * 0.5 * G_M_S2);
    assert!((found.position_W_m.xy().norm() - expected_m).abs() < 1e-5, "{found:?}, not {expected_m} m");
    assert!(found.attitude_WB.angle() < 1e-8, "straight on: {found:?}");
}

#[test]
fn balls_that_meet_head_on_pass_their_motion_on() {
    let ball = |name: &str, centre: &str, speed: &str| {
        let keys = [("centre", centre, "m"), BALL[1], BALL[2], ("velocity", speed, "m/s")];
        body("balls", name, &keys) + "restitution = " + &given("1", "1") + "\n"
    };
    let mut plant =
        plant(&[ball("one", "[0, 0, 30]", "[2, 0, 0]"), ball("two", "[0.5, 0, 30]", "[0, 0, 0]")]);
    (0..400).for_each(|_| _ = tick(&mut plant));
    let [one, two] = plant.bodies() else { panic!("two bodies") };
    assert!(
        one.velocity_W_m_s.x.abs() < 1e-9 && (two.velocity_W_m_s.x - 2.0).abs() < 1e-9,
        "{one:?} {two:?}"
    );
}

#[test]
fn a_load_that_the_ground_carries_in_part_leaves_the_rope_as_tight_as_the_rotors_pull() {
    // Straight below the vehicle, the rope just taut, and the rotors lift 0.1 N more than the vehicle weighs.
    let load = [("centre", "[0, 0, -0.63]", "m"), ("radius", "0.03", "m"), ("mass", "0.1", "kg")];
    let rope = [("anchor", "[0, 0, 0]", "m"), ("end", "[0, 0, -0.6]", "m"), ("length", "0.6", "m")];
    let parts = [body("balls", "load", &load), joint("rope", ["vehicle", "load"], &rope)];
    let mut plant = plant_at(&parts, Vector3::z() * 0.66);
    let vehicle = hummingbird();
    let per_rotor_N = (vehicle.mass_kg * G_M_S2 + 0.1) / 4.0;
    let command = vehicle.command.command((per_rotor_N / vehicle.thrust_coefficient).sqrt());
    plant.settle_rotors(&[command; 4]);
    for number in 0..1_000 {
        plant.step(&[command; 4], TICK_S, &[]);
        let (body, load) = (plant.state().body, plant.bodies()[0]);
        assert!((load.position_W_m.z - 0.03).abs() < 1e-8, "tick {number}: {load:?}");
        assert!((body.position_W_m.z - 0.66).abs() < 2e-6, "tick {number}: {body:?}");
        // The rope takes the 0.1 N: what is felt is g.
        let felt_m_s2 = plant.accelerations().specific_force_B_m_s2.z;
        assert!(number < 5 || (felt_m_s2 - G_M_S2).abs() < 1e-6, "tick {number}: {felt_m_s2}");
    }
}

#[test]
fn what_happens_far_away_leaves_the_vehicles_flight_to_the_last_bit() {
    let bouncing = [&BALL[..], &[("velocity", "[1, 0, 0]", "m/s")]].concat();
    let mut plant = plant(&[body("balls", "ball", &bouncing) + "restitution = " + &given("0.9", "1") + "\n"]);
    let model = NewtonEuler::new(hummingbird(), 2);
    let effects = model.airframe().initial_state(0, "plant", TICK_S);
    let mut free =
        plant::FreeFlight::new(model, RigidBody::level_at(Vector3::new(100.0, 0.0, 50.0)), effects);
    for _ in 0..3_000 {
        let commands = [80.0, 80.5, 80.0, 79.5];
        plant.step(&commands, TICK_S, &[]);
        free.step(&commands, TICK_S, &[]);
        assert_eq!(plant.state(), free.state());
    }
    assert!(plant.bodies()[0].position_W_m.z < 4.0, "it bounced");
}

#[test]
fn two_that_fly_at_each_other_at_any_speed_meet() {
    for speed_m_s in [3.0, 20.0, 120.0, 300.0] {
        for off_m in [0.0, 0.013, 0.031, 0.047] {
            let ball = |name: &str, sign: f64| {
                let centre = format!("[{}, 0, 40]", -sign * (1.0 + off_m));
                let velocity = format!("[{}, 0, 0]", sign * speed_m_s);
                let keys = [
                    ("centre", &*centre, "m"),
                    ("radius", "0.02", "m"),
                    BALL[2],
                    ("velocity", &velocity, "m/s"),
                ];
                body("balls", name, &keys) + "restitution = " + &given("1", "1") + "\n"
            };
            let mut plant = plant(&[ball("left", 1.0), ball("right", -1.0)]);
            after(&mut plant, 1.5 / speed_m_s);
            let [left, right] = plant.bodies() else { panic!("two bodies") };
            assert!(left.position_W_m.x < right.position_W_m.x, "{speed_m_s} m/s: {left:?} {right:?}");
            assert!(
                (left.velocity_W_m_s.x + speed_m_s).abs() < 1e-6 * speed_m_s,
                "{speed_m_s} m/s: {left:?}"
            );
        }
    }
}

#[test]
fn a_ball_that_hits_the_vehicle_hands_its_motion_on_and_is_told() {
    let ball = [
        ("centre", "[-1, 0, 50]", "m"),
        ("radius", "0.02", "m"),
        ("mass", "0.05", "kg"),
        ("velocity", "[3, 0, 1.158]", "m/s"),
    ];
    let mut plant = plant_at(&[body("balls", "ball", &ball)], Vector3::z() * 50.0);
    let vehicle = hummingbird();
    plant.settle_rotors(&[vehicle.hover_command(); 4]);
    let mut most_N = 0.0_f64;
    for number in 1..=300_u32 {
        let ball = tick(&mut plant);
        let body = plant.state().body;
        let momentum = body.velocity_W_m_s * vehicle.mass_kg + ball.velocity_W_m_s * 0.05;
        // Along the way of the ball nothing else pushes, while the vehicle is level.
        if body.attitude_WB.angle() < 1e-6 {
            assert!((momentum.x - 0.15).abs() < 1e-7, "tick {number}: {momentum:?}");
        }
        most_N = most_N.max(plant.contact().force_W_N.norm());
    }
    let contact = plant.contact();
    assert_eq!((contact.began, contact.crashed), (1, false), "{contact:?}");
    assert!(plant.state().body.velocity_W_m_s.x > 0.05, "{:?}", plant.state().body);
    // At least its momentum in a tick.
    assert!(most_N > 150.0, "{most_N} N");
}

#[test]
fn a_vehicle_that_is_put_elsewhere_takes_along_what_hangs_from_it() {
    let load = [("centre", "[0.5, 0, 0]", "m"), ("radius", "0.03", "m"), ("mass", "0.1", "kg")];
    let rope = [("anchor", "[0, 0, 0]", "m"), ("end", "[0.5, 0, 0]", "m"), ("length", "0.6", "m")];
    let parts = [body("balls", "load", &load), joint("rope", ["vehicle", "load"], &rope)];
    let mut plant = plant_at(&parts, Vector3::z() * 50.0);
    after(&mut plant, 1.0);
    let arm_W_m = plant.bodies()[0].position_W_m - plant.state().body.position_W_m;
    let elsewhere = RigidBody { position_W_m: Vector3::new(7.0, 8.0, 20.0), ..plant.state().body };
    plant.set_body(&elsewhere);
    let found_W_m = plant.bodies()[0].position_W_m - elsewhere.position_W_m;
    assert!((found_W_m - arm_W_m).norm() < 1e-12, "{found_W_m:?}, not {arm_W_m:?}");
}

#[test]
fn a_load_on_a_rope_is_lifted_and_momentum_is_what_forces_make_it() {
    let load = [("centre", "[0.5, 0, 0]", "m"), ("radius", "0.03", "m"), ("mass", "0.1", "kg")];
    let rope = [("anchor", "[0, 0, 0]", "m"), ("end", "[0.5, 0, 0]", "m"), ("length", "0.6", "m")];
    let parts = [body("balls", "load", &load), joint("rope", ["vehicle", "load"], &rope)];
    let mut plant = plant_at(&parts, Vector3::z() * 50.0);
    let vehicle = hummingbird();
    plant.settle_rotors(&[vehicle.hover_command(); 4]);
    let mut taut = 0;
    for number in 1..=3_000_u32 {
        let load = tick(&mut plant);
        let body = plant.state().body;
        // Thrust along body z carries the vehicle; the rope is inner to both.
        let lift_W_N = body.attitude_WB * Vector3::z() * (vehicle.mass_kg * G_M_S2);
        assert!(
            (lift_W_N - Vector3::z() * lift_W_N.norm()).norm() < 1e-9,
            "anchored at the centre it does not tilt"
        );
        let momentum = body.velocity_W_m_s * vehicle.mass_kg + load.velocity_W_m_s * 0.1;
        let expected = Vector3::z() * (-0.1 * G_M_S2 * f64::from(number) * TICK_S);
        assert!((momentum - expected).norm() < 1e-9, "{momentum:?}, not {expected:?}");
        let apart_m = (load.position_W_m - body.position_W_m).norm();
        assert!(apart_m < 0.6 + 1e-6, "{apart_m}");
        taut += u32::from(apart_m > 0.6 - 1e-9);
    }
    assert!(taut > 2_000, "{taut} ticks");
}

#[test]
fn a_box_that_is_fixed_to_the_vehicle_flies_as_one_body_with_it() {
    let cargo =
        [("centre", "[0.02, 0.01, -0.04]", "m"), ("size", "[0.06, 0.05, 0.04]", "m"), ("mass", "0.15", "kg")];
    let parts = [
        body("boxes", "cargo", &cargo),
        joint("fixed", ["vehicle", "cargo"], &[("anchor", "[0, 0, 0]", "m")]),
    ];
    let mut plant = plant_at(&parts, Vector3::z() * 50.0);
    // The two as one vehicle: its centre of mass is elsewhere, and its inertia by the parallel axes.
    let vehicle = hummingbird();
    let (cargo_B_m, cargo_kg) = (Vector3::new(0.02, 0.01, -0.04), 0.15);
    let mass_kg = vehicle.mass_kg + cargo_kg;
    let centre_B_m = cargo_B_m * (cargo_kg / mass_kg);
    let about = |arm_m: Vector3<f64>, mass_kg: f64| {
        (Matrix3::from_diagonal_element(arm_m.norm_squared()) - arm_m * arm_m.transpose()) * mass_kg
    };
    let halves_m2 = Vector3::new(0.03_f64.powi(2), 0.025_f64.powi(2), 0.02_f64.powi(2));
    let own = Matrix3::from_diagonal(&(Vector3::repeat(halves_m2.sum()) - halves_m2)) * (cargo_kg / 3.0);
    let inertia_kg_m2 = vehicle.inertia_kg_m2
        + about(centre_B_m, vehicle.mass_kg)
        + own
        + about(cargo_B_m - centre_B_m, cargo_kg);
    let mut whole = Vehicle { mass_kg, inertia_kg_m2, ..vehicle };
    whole.rotors.iter_mut().for_each(|rotor| rotor.position_m -= centre_B_m);
    let mut whole = common::rapier(
        NewtonEuler::new(whole, 2),
        &Scene::default(),
        &RigidBody::level_at(Vector3::z() * 50.0 + centre_B_m),
        1e9,
    );
    plant.settle_rotors(&[80.0; 4]);
    whole.settle_rotors(&[80.0; 4]);
    for _ in 0..1_000 {
        let commands = [80.0, 80.5, 80.0, 79.5];
        plant.step(&commands, TICK_S, &[]);
        whole.step(&commands, TICK_S, &[]);
        let (body, cargo, expected) = (plant.state().body, plant.bodies()[0], whole.state().body);
        let seen_B_m = body.attitude_WB.inverse_transform_vector(&(cargo.position_W_m - body.position_W_m));
        assert!((seen_B_m - cargo_B_m).norm() < 1e-12, "{seen_B_m:?}");
        assert!((body.attitude_WB.inverse() * cargo.attitude_WB).angle() < 1e-11);
        let off_m = (body.position_W_m + body.attitude_WB * centre_B_m - expected.position_W_m).norm();
        let off_rad = body.attitude_WB.angle_to(&expected.attitude_WB);
        assert!(off_m < 1e-9 && off_rad < 1e-9, "{off_m} m, {off_rad} rad");
    }
    assert!(plant.state().body.attitude_WB.angle() > 0.1, "it turned");
}

#[test]
fn another_instance_goes_on_from_a_snapshot_to_the_same_bits() {
    let load = [("centre", "[0.5, 0, 0]", "m"), ("radius", "0.03", "m"), ("mass", "0.1", "kg")];
    let rope = [("anchor", "[0, 0, 0]", "m"), ("end", "[0.5, 0, 0]", "m"), ("length", "0.6", "m")];
    let parts = [body("balls", "load", &load), joint("rope", ["vehicle", "load"], &rope)];
    let mut first = plant_at(&parts, Vector3::z() * 0.3);
    (0..700).for_each(|_| _ = tick(&mut first));
    let mut second = plant_at(&parts, Vector3::z() * 0.3);
    second.restore(&first.snapshot().unwrap()).unwrap();
    for _ in 0..1_000 {
        assert_eq!((tick(&mut first), first.state()), (tick(&mut second), second.state()));
    }
    let mut heavier = plant_at(&[parts[0].replace("0.1,", "0.2,"), parts[1].clone()], Vector3::z() * 0.3);
    assert!(heavier.restore(&first.snapshot().unwrap()).is_err(), "another mass is another world");
}

/// A room of 4 m with bodies of every shape, thrown about: nothing makes energy, and nothing gets out.
mod thrown {
    use super::*;
    use crate::skipped::drawn;
    use proptest::prelude::*;

    fn numbers(most: f64) -> impl Strategy<Value = String> {
        prop::array::uniform3(-most..most).prop_map(|numbers| format!("{numbers:?}"))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: drawn(5, 12), failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn makes_no_energy_and_stays_in_the_room(
            speeds in prop::array::uniform4(numbers(4.0)),
            spins in prop::array::uniform4(numbers(8.0)),
            friction in prop_oneof![Just(0.0), 0.1..1.0],
            restitution in prop_oneof![Just(0.0), Just(1.0), 0.1..0.9],
        ) {
            let wall = |name: &str, centre: &str, size: &str| {
                body("boxes", name, &[("centre", centre, "m"), ("size", size, "m")])
            };
            let thrown = |kind: &str, number: usize, more: &[(&str, &str, &str)]| {
                let motion = [("velocity", &*speeds[number], "m/s"), ("angular_velocity", &*spins[number], "rad/s")];
                body(kind, &format!("body {number}"), &[more, &motion].concat())
            };
            let surface = format!(
                "friction = {}\nrestitution = {}\n",
                given(&friction.to_string(), "1"),
                given(&restitution.to_string(), "1")
            );
            let parts = [
                surface,
                wall("+x", "[2.5, 0, 5]", "[1, 6, 20]"),
                wall("-x", "[-2.5, 0, 5]", "[1, 6, 20]"),
                wall("+y", "[0, 2.5, 5]", "[6, 1, 20]"),
                wall("-y", "[0, -2.5, 5]", "[6, 1, 20]"),
                thrown("boxes", 0, &[("centre", "[0, 0, 0.4]", "m"), ("size", "[0.3, 0.2, 0.1]", "m"), ("mass", "1", "kg")]),
                thrown("boxes", 1, &[("centre", "[0.8, 0, 0.5]", "m"), ("size", "[0.2, 0.2, 0.4]", "m"), ("mass", "0.3", "kg")]),
                thrown("balls", 2, &[("centre", "[0, 0.8, 0.4]", "m"), ("radius", "0.1", "m"), ("mass", "2", "kg")]),
                thrown("balls", 3, &[("centre", "[0, 1.2, 0.4]", "m"), ("radius", "0.08", "m"), ("mass", "0.2", "kg")]),
                joint("ball", ["body 2", "body 3"], &[("anchor", "[0, 1, 0.4]", "m")]),
            ];
            let text = format!("name = \"test\"\n{}", parts.concat());
            let scene = Scene::parse(&text, "test.toml").unwrap();
            let mut plant = common::rapier(
                NewtonEuler::new(hummingbird(), 2),
                &scene,
                &RigidBody::level_at(Vector3::new(100.0, 0.0, 50.0)),
                1e9,
            );
            // The joint's constraint holds from the first step on.
            tick(&mut plant);
            let mut before_J = bodies_energy_J(&scene, &plant);
            for at in 0..800 {
                tick(&mut plant);
                let after_J = bodies_energy_J(&scene, &plant);
                prop_assert!(after_J < before_J + 5e-3 * (1.0 + before_J), "tick {at}: {before_J} J to {after_J} J");
                before_J = before_J.min(after_J);
                for found in plant.bodies() {
                    prop_assert!(found.is_finite());
                    let [x, y, z] = found.position_W_m.into();
                    prop_assert!(x.abs() < 2.0 && y.abs() < 2.0 && z > 0.0, "tick {at}: {found:?}");
                }
                let [_, _, one, two] = plant.bodies() else { panic!("four bodies") };
                let ends = [(one, 0.2), (two, -0.2)].map(|(found, arm_m)| {
                    found.position_W_m + found.attitude_WB * Vector3::new(0.0, arm_m, 0.0)
                });
                prop_assert!((ends[0] - ends[1]).norm() < 1e-9, "tick {at}: the joint is apart: {ends:?}");
            }
        }
    }
}
