//! Contacts from any pose, at any speed, with any friction and restitution: nothing makes energy, nothing gets through.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use crate::skipped::drawn;
use common::parts::{body, given};
use common::{TICK_S, bodies_energy_J, free_body, hummingbird};
use nalgebra::{UnitQuaternion, Vector3};
use plant::contact_dynamics::hull::Hull;
use plant::{Airframe, Backend, Neighbour, NewtonEuler, Rapier, RigidBody};
use proptest::prelude::*;
use scenes::{Scene, Surface};

fn stand_m() -> f64 {
    Hull::of(&Airframe::new(hummingbird())).stand_m()
}

/// A body without thrust in this scene, whose surfaces are all alike.
fn plant(scene: &Scene, surface: Surface, start: &RigidBody) -> Rapier {
    let boxes = scene.boxes.iter().map(|cuboid| scenes::Cuboid { surface, ..cuboid.clone() }).collect();
    let scene = Scene { surface, boxes, ..Scene::default() };
    common::rapier(NewtonEuler::new(free_body(), 2), &scene, start, 1e9)
}

fn energy_J(body: &RigidBody) -> f64 {
    let (vehicle, w) = (free_body(), body.angular_velocity_B_rad_s);
    0.5 * vehicle.mass_kg * body.velocity_W_m_s.norm_squared()
        + 0.5 * w.dot(&(vehicle.inertia_kg_m2 * w))
        + vehicle.mass_kg * vehicle.gravity_m_s2 * body.position_W_m.z
}

/// Returns the greatest coordinate of the hull along `direction_W`.
fn reach_m(body: &RigidBody, direction_W: &Vector3<f64>) -> f64 {
    let hull = Hull::of(&Airframe::new(hummingbird()));
    let lean = (body.attitude_WB * Vector3::z()).dot(direction_W);
    let centre_m = (body.attitude_WB * hull.centre_B_m).dot(direction_W);
    let disc_m =
        centre_m + hull.disc_radius_m * (1.0 - lean * lean).max(0.0).sqrt() + hull.disc_half_m * lean.abs();
    let feet_m =
        hull.feet_B_m.map(|foot_B_m| (body.attitude_WB * foot_B_m).dot(direction_W) + hull.foot_radius_m);
    body.position_W_m.dot(direction_W) + feet_m.into_iter().fold(disc_m, f64::max)
}

fn vector(most: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-most..most).prop_map(Vector3::from)
}

fn start() -> impl Strategy<Value = RigidBody> {
    let place = (-4.6..4.6, -4.6..4.6, 0.35..1.0);
    (place, vector(5.0), vector(3.1), vector(12.0)).prop_map(|((x, y, z), velocity_W_m_s, turn, spin)| {
        RigidBody {
            position_W_m: Vector3::new(x, y, z),
            velocity_W_m_s,
            attitude_WB: UnitQuaternion::from_scaled_axis(turn),
            angular_velocity_B_rad_s: spin,
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: drawn(6, 30), failure_persistence: None, ..ProptestConfig::default() })]

    /// In a room of 10 m: floor, walls, corners.
    #[test]
    fn no_contact_makes_energy_and_none_is_passed(
        start in start(),
        friction in prop_oneof![0.0..1.0, 0.8..1.2, 1.0..10.0],
        restitution in prop_oneof![Just(0.0), Just(1.0), 0.0..1.0],
    ) {
        let room = Scene::parse(scenes::reference::ROOM, "room.toml").unwrap();
        let mut plant = plant(&room, Surface { friction, restitution }, &start);
        let mut before_J = energy_J(&start);
        for tick in 0..500 {
            plant.step(&[0.0; 4], TICK_S, &[]);
            let body = plant.state().body;
            prop_assert!(body.is_finite());
            let energy_J = energy_J(&body);
            prop_assert!(
                energy_J < before_J + 2e-3 * (1.0 + before_J.abs()),
                "tick {tick}: from {before_J} J to {energy_J} J"
            );
            before_J = before_J.min(energy_J);
            for (direction, room_m) in [(-Vector3::z(), 0.0), (Vector3::x(), 5.0), (-Vector3::x(), 5.0), (Vector3::y(), 5.0), (-Vector3::y(), 5.0)] {
                // Where it starts inside of a wall it is pushed out first.
                let depth_m = reach_m(&body, &direction) - room_m;
                let before_m = reach_m(&start, &direction) - room_m;
                prop_assert!(depth_m < before_m.max(0.0) + 5e-3, "tick {tick}: {depth_m} m into {direction:?}");
            }
        }
    }

    #[test]
    fn a_drop_from_any_height_bounces_to_the_square_of_the_restitution(
        height_m in 0.02..1.5_f64,
        restitution in 0.1..1.0_f64,
    ) {
        let start = RigidBody::level_at(Vector3::z() * (stand_m() + height_m));
        let mut plant = plant(&Scene::default(), Surface { friction: 0.5, restitution }, &start);
        let mut apex_m = 0.0_f64;
        let mut has_met = false;
        for _ in 0..2_000 {
            plant.step(&[0.0; 4], TICK_S, &[]);
            let body = plant.state().body;
            has_met |= body.velocity_W_m_s.z > 0.0;
            apex_m = if has_met { apex_m.max(body.position_W_m.z - stand_m()) } else { 0.0 };
            if has_met && body.velocity_W_m_s.z < 0.0 {
                break;
            }
        }
        let expected_m = restitution * restitution * height_m;
        prop_assert!((apex_m - expected_m).abs() < 1e-5, "{apex_m} m, not {expected_m} m");
    }
}

/// A ball that hits the falling vehicle from the side, and a box of `box_kg` that falls on it when it has come down.
fn thrown_at(box_kg: f64, restitution: f64) -> Scene {
    let surface = format!(
        "friction = {}\nrestitution = {}\n",
        given("0.5", "1"),
        given(&format!("{restitution:?}"), "1")
    );
    let mass = format!("{box_kg:?}");
    let falls =
        [("centre", "[0.05, 0.03, 1.4]", "m"), ("size", "[0.1, 0.08, 0.06]", "m"), ("mass", &*mass, "kg")];
    let flies = [
        ("centre", "[-1, 0.02, 0.7]", "m"),
        ("radius", "0.06", "m"),
        ("mass", "0.1", "kg"),
        ("velocity", "[6, 0, 0]", "m/s"),
    ];
    let text = format!(
        "name = \"test\"\n{surface}{}{}",
        body("boxes", "box", &falls),
        body("balls", "ball", &flies)
    );
    Scene::parse(&text, "test.toml").unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The check of each run leaves out the steps in which the vehicle is near a free body: rotors do work on it. Here they stand still.
#[test]
fn the_vehicle_and_free_bodies_together_gain_no_energy() {
    let turns = [Vector3::zeros(), Vector3::new(0.4, -0.3, 1.0), Vector3::new(2.8, 0.5, 0.0)];
    for (box_kg, restitution) in
        [(5e-3, 0.0), (5e-3, 0.6), (0.05, 1.0), (0.5, 0.3), (0.5, 1.0), (5.0, 0.0), (5.0, 0.6)]
    {
        for turn in turns {
            let scene = thrown_at(box_kg, restitution);
            let attitude_WB = UnitQuaternion::from_scaled_axis(turn);
            let start = RigidBody { attitude_WB, ..RigidBody::level_at(Vector3::z() * 0.7) };
            let mut plant = common::rapier(NewtonEuler::new(free_body(), 2), &scene, &start, 1e9);
            let whole_J = |plant: &Rapier| energy_J(&plant.state().body) + bodies_energy_J(&scene, plant);
            let mut least_J = whole_J(&plant);
            for tick in 0..1_000 {
                plant.step(&[0.0; 4], TICK_S, &[]);
                let found_J = whole_J(&plant);
                let case = format!("{box_kg} kg, restitution {restitution}, turned by {turn:?}, tick {tick}");
                assert!(
                    found_J < least_J + 5e-3 * (1.0 + least_J),
                    "{case}: from {least_J} J to {found_J} J"
                );
                least_J = least_J.min(found_J);
                assert_eq!(plant.trouble(), None, "{case}");
                let pushed_m_s = plant.state().body.velocity_W_m_s.x;
                assert!(tick != 250 || pushed_m_s > 0.05, "{case}: the ball misses, {pushed_m_s} m/s");
            }
        }
    }
}

#[test]
fn another_vehicle_that_comes_down_on_one_that_stands_does_not_drive_it_into_the_ground() {
    let start = RigidBody::level_at(Vector3::z() * stand_m());
    let mut plant = common::rapier(NewtonEuler::new(hummingbird(), 2), &Scene::default(), &start, 1.0);
    let mut most_m = 0.0_f64;
    for tick in 0..600 {
        let velocity_W_m_s = -Vector3::z();
        let position_W_m = Vector3::new(0.1, 0.05, 0.5 - f64::from(tick) * TICK_S);
        plant.step(&[1.0; 4], TICK_S, &[Neighbour { number: 1, position_W_m, velocity_W_m_s }]);
        let body = plant.state().body;
        let deepest_m = reach_m(&body, &-Vector3::z());
        assert!(deepest_m < 1e-3, "tick {tick}: {deepest_m} m into the ground");
        assert!(body.velocity_W_m_s.norm() < 3.0, "tick {tick}: it is thrown: {:?}", body.velocity_W_m_s);
        most_m = most_m.max(body.position_W_m.xy().norm());
    }
    assert!(most_m < 1.0, "it is not shot away: {most_m} m");
}
