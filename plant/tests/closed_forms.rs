//! Contacts and stops against closed forms: bounce, slide, rest, tip over an edge, the stops and the swing of a rig.
//!
//! `docs/world.md` has the same with the figures, beside those of MuJoCo.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use common::{G_M_S2, TICK_S, free_body};
use nalgebra::{UnitQuaternion, Vector3};
use plant::contact_dynamics::hull::Hull;
use plant::{Airframe, Backend, NewtonEuler, Rapier, RigidBody};
use scenes::{Rig, Scene, Surface};
use std::f64::consts::TAU;
use vehicles::Vehicle;

/// Nothing but a rigid body; its moments about x and y are the same.
fn vehicle() -> Vehicle {
    Vehicle { inertia_kg_m2: common::hummingbird().inertia_kg_m2, ..free_body() }
}

fn plant(scene: &Scene, body: &RigidBody) -> Rapier {
    common::rapier(NewtonEuler::new(vehicle(), 2), scene, body, 1e9)
}

fn ground(friction: f64, restitution: f64) -> Scene {
    Scene { surface: Surface { friction, restitution }, ..Scene::default() }
}

fn stand_m() -> f64 {
    Hull::of(&Airframe::new(vehicle())).stand_m()
}

fn tick(plant: &mut Rapier) -> RigidBody {
    plant.step(&[0.0; 4], TICK_S, &[]);
    plant.state().body
}

fn tilt_rad(body: &RigidBody) -> f64 {
    let up_W = body.attitude_WB * Vector3::z();
    libm::atan2(up_W.xy().norm(), up_W.z)
}

#[test]
fn a_level_drop_bounces_to_the_square_of_the_restitution_and_stays_level() {
    for restitution in [0.0, 0.2, 0.5, 0.8] {
        for height_m in [0.05, 0.1, 0.25, 0.499, 0.5, 0.501, 0.502, 1.0] {
            let start = RigidBody::level_at(Vector3::z() * (stand_m() + height_m));
            let mut plant = plant(&ground(0.5, restitution), &start);
            let mut expected_m = height_m;
            // Three bounces, as far as they are higher than what is taken for none.
            for _ in 0..3 {
                expected_m *= restitution * restitution;
                while tick(&mut plant).velocity_W_m_s.z < 0.0 {}
                let mut apex_m = 0.0_f64;
                loop {
                    let body = tick(&mut plant);
                    apex_m = apex_m.max(body.position_W_m.z - stand_m());
                    assert!(tilt_rad(&body) < 1e-8, "{} rad from {height_m} m", tilt_rad(&body));
                    if body.velocity_W_m_s.z <= 0.0 {
                        break;
                    }
                }
                let off_m = (apex_m - expected_m).abs();
                assert!(
                    off_m < 5e-6,
                    "restitution {restitution}, from {height_m} m: {apex_m} m, not {expected_m} m"
                );
                if expected_m * restitution * restitution < 1e-4 {
                    break;
                }
            }
        }
    }
}

#[test]
fn an_oblique_bounce_loses_friction_times_the_normal_impulse_along_the_ground() {
    for heading_rad in [0.0, 0.3, 0.8, 1.9, 4.0] {
        let along = Vector3::new(libm::cos(heading_rad), libm::sin(heading_rad), 0.0);
        let velocity_W_m_s = along * 3.0 - Vector3::z();
        let start = RigidBody { velocity_W_m_s, ..RigidBody::level_at(Vector3::z() * (stand_m() + 2e-4)) };
        let mut plant = plant(&ground(0.5, 0.2), &start);
        let body = (0..3).map(|_| tick(&mut plant)).last().unwrap();
        // 0.2 mm of fall first.
        let met_m_s = (1.0 + 2.0 * G_M_S2 * 2e-4_f64).sqrt();
        let expected_m_s = 3.0 - 0.5 * 1.2 * met_m_s;
        let found_m_s = body.velocity_W_m_s.dot(&along);
        assert!((found_m_s - expected_m_s).abs() < 1e-5, "{found_m_s} m/s, not {expected_m_s}");
        assert!(body.angular_velocity_B_rad_s.norm() < 1e-6, "{body:?}");
        assert!(body.velocity_W_m_s.cross(&along).z.abs() < 1e-9, "straight on");
    }
}

#[test]
fn it_slides_as_far_as_friction_lets_it_straight_on_and_without_yaw() {
    for friction in [0.1, 0.5, 0.8] {
        for (speed_m_s, heading_rad) in [(0.5, 0.0), (1.0, 0.3), (3.0, 0.0), (3.0, 0.6435), (3.0, 2.2)] {
            let along = Vector3::new(libm::cos(heading_rad), libm::sin(heading_rad), 0.0);
            let start = RigidBody {
                velocity_W_m_s: along * speed_m_s,
                ..RigidBody::level_at(Vector3::z() * stand_m())
            };
            let mut plant = plant(&ground(friction, 0.2), &start);
            let body = (0..4_000).map(|_| tick(&mut plant)).last().unwrap();
            let expected_m = speed_m_s * speed_m_s / (2.0 * friction * G_M_S2);
            let off_W_m = body.position_W_m - start.position_W_m - along * expected_m;
            // The tick in which it stops.
            assert!(off_W_m.norm() < 3e-6, "friction {friction}, {speed_m_s} m/s: off by {off_W_m:?} m");
            assert!(body.attitude_WB.angle() < 1e-9, "{} rad", body.attitude_WB.angle());
            assert!(body.velocity_W_m_s.norm() < 1e-12, "it lies still");
        }
    }
}

/// A slope through the origin that falls along x at `slope_rad`, 20 m long.
fn slope(slope_rad: f64, friction: f64) -> Scene {
    let (x, z) = (10.0 * libm::cos(slope_rad), 10.0 * libm::sin(slope_rad));
    let corners = [(-x, z), (x, -z), (x, -z - 1.0), (-x, z - 1.0)].map(|(x, z)| {
        // Lifted by 20 m, so that the ground is out of the way.
        format!("v {x:?} -5 {:?}\nv {x:?} 5 {:?}\n", z + 20.0, z + 20.0)
    });
    let faces = "f 1 3 4 2\nf 3 5 6 4\nf 5 7 8 6\nf 7 1 2 8\nf 1 7 5 3\nf 2 4 6 8\n";
    let read = |_: &std::path::Path| Ok(format!("{}{faces}", corners.concat()).into_bytes());
    let number = |value: &str, unit: &str| {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
    };
    let text = format!(
        "name = \"test\"\nfriction = {}\n[[meshes]]\nname = \"slope\"\nfile = \"slope.obj\"\nposition = {}\nscale = {}\nsolid = \"convex\"\n",
        number(&format!("{friction:?}"), "1"),
        number("[0, 0, 0]", "m"),
        number("1", "m")
    );
    Scene::parse_with(&text, "test.toml", &read).unwrap()
}

/// Returns the way down a slope in two seconds, and the speed then.
fn down(slope_rad: f64, friction: f64) -> (f64, f64) {
    let attitude_WB = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), slope_rad);
    let start_W_m = Vector3::z() * 20.0 + attitude_WB * (Vector3::z() * stand_m());
    let start = RigidBody { attitude_WB, ..RigidBody::level_at(start_W_m) };
    let mut plant = plant(&slope(slope_rad, friction), &start);
    let body = (0..2_000).map(|_| tick(&mut plant)).last().unwrap();
    let turned_rad = body.attitude_WB.angle_to(&attitude_WB);
    assert!(turned_rad < 1e-6, "{slope_rad}: it stays along the slope: {turned_rad}");
    let along = attitude_WB * Vector3::x();
    ((body.position_W_m - start_W_m).dot(&along), body.velocity_W_m_s.dot(&along))
}

#[test]
fn on_a_slope_it_rests_below_the_angle_of_friction_and_slides_above_it() {
    // The angle of friction 0.3 is 16.7 degrees.
    for slope_deg in [5.0, 10.0, 16.0_f64] {
        let (way_m, speed_m_s) = down(slope_deg.to_radians(), 0.3);
        assert!(way_m.abs() < 1e-6 && speed_m_s.abs() < 1e-9, "{slope_deg}: {way_m} m, {speed_m_s} m/s");
    }
    for slope_deg in [17.5, 20.0, 30.0_f64] {
        let slope_rad = slope_deg.to_radians();
        let (way_m, speed_m_s) = down(slope_rad, 0.3);
        let expected_m_s2 = G_M_S2 * (libm::sin(slope_rad) - 0.3 * libm::cos(slope_rad));
        assert!((way_m - 2.0 * expected_m_s2).abs() < 2e-5, "{slope_deg}: {way_m} m");
        assert!((speed_m_s - 2.0 * expected_m_s2).abs() < 2e-5, "{slope_deg}: {speed_m_s} m/s");
    }
}

/// A table whose edge is at x = -3 cm and whose top is 2 m up.
fn table() -> Scene {
    let number = |value: &str, unit: &str| {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
    };
    let text = format!(
        "name = \"test\"\nfriction = {}\nrestitution = {}\n[[boxes]]\nname = \"table\"\ncentre = {}\nsize = {}\n",
        number("5", "1"),
        number("0", "1"),
        number("[-1.03, 0, 1.9]", "m"),
        number("[2, 2, 0.2]", "m")
    );
    Scene::parse(&text, "test.toml").unwrap()
}

/// With its rear feet on the table and its front feet over the edge it rolls over the balls of its rear feet.
/// The height that it loses turns it, about the point where the balls touch the table.
#[test]
fn it_tips_over_an_edge_as_fast_as_the_height_that_it_loses_says() {
    let hull = Hull::of(&Airframe::new(vehicle()));
    let start = RigidBody::level_at(Vector3::z() * (2.0 + stand_m()));
    let mut plant = plant(&table(), &start);
    let foot_B_m = hull.feet_B_m[2];
    let mut most_rad = 0.0_f64;
    for _ in 0..200 {
        let body = tick(&mut plant);
        let tilt_rad = tilt_rad(&body);
        if tilt_rad > 0.7 {
            break;
        }
        most_rad = tilt_rad.max(most_rad);
        let ball_W_m = body.position_W_m + body.attitude_WB * foot_B_m;
        assert!(
            (ball_W_m.z - 2.0 - hull.foot_radius_m).abs() < 1e-6,
            "the feet stay on the table: {ball_W_m:?}"
        );
        // It rolls without slipping.
        let rolled_m = hull.foot_radius_m * tilt_rad;
        assert!((ball_W_m.x - foot_B_m.x - rolled_m).abs() < 2e-4, "{} rolled {rolled_m}", ball_W_m.x);
        let touches_W_m = ball_W_m - Vector3::z() * hull.foot_radius_m;
        let arm_W_m = body.position_W_m - touches_W_m;
        let vehicle = vehicle();
        let inertia_kg_m2 =
            vehicle.inertia_kg_m2[(1, 1)] + vehicle.mass_kg * (arm_W_m.x.powi(2) + arm_W_m.z.powi(2));
        let lost_m = start.position_W_m.z - body.position_W_m.z;
        let expected_rad_s = (2.0 * vehicle.mass_kg * G_M_S2 * lost_m / inertia_kg_m2).sqrt();
        let found_rad_s = body.angular_velocity_B_rad_s.y;
        assert!(
            (found_rad_s - expected_rad_s).abs() < 2e-3 * (1.0 + expected_rad_s),
            "{found_rad_s} rad/s, not {expected_rad_s}, at {tilt_rad} rad"
        );
    }
    assert!(most_rad > 0.6, "it tips, or this shows nothing: {most_rad}");
}

fn frictionless(text: &str) -> (Scene, Rig) {
    let mut scene = Scene::parse(text, "rig.toml").unwrap();
    let rig = scene.rig.as_mut().unwrap();
    (rig.bearing_friction_N_m, rig.bearing_damping_N_m_s) = (0.0, 0.0);
    (rig.slide_friction_N, rig.slide_damping_N_s_m) = (0.0, 0.0);
    let rig = *rig;
    (scene, rig)
}

fn bearing_m(rig: &Rig, body: &RigidBody) -> Vector3<f64> {
    body.position_W_m + body.attitude_WB * rig.mount_B_m - rig.bearing_W_m
}

#[test]
fn the_ends_of_the_slider_throw_nothing_back() {
    let (scene, rig) = frictionless(scenes::reference::RIG_SLIDING);
    for (height_m, speed_m_s) in [(0.05, 0.0), (0.1, 0.0), (0.2, 0.0), (0.25, -2.0), (0.1, 2.5), (0.2, 4.0)] {
        let start = RigidBody {
            velocity_W_m_s: Vector3::z() * speed_m_s,
            ..RigidBody::level_at(rig.bearing_W_m - rig.mount_B_m + Vector3::z() * height_m)
        };
        let mut plant = plant(&scene, &start);
        plant.set_body(&start);
        // As what is thrown up flies, until it meets an end; there it stays, or falls from.
        let mut highest_m_s2 = f64::NEG_INFINITY;
        let mut before = plant.state().body;
        for tick_number in 0..1_000 {
            let body = tick(&mut plant);
            let raised_m = bearing_m(&rig, &body);
            assert!(raised_m.xy().norm() < 1e-9, "tick {tick_number}: on its line: {raised_m:?}");
            assert!((-1e-6..=rig.heave_m + 1e-6).contains(&raised_m.z), "within its travel: {raised_m:?}");
            highest_m_s2 = highest_m_s2.max(body.velocity_W_m_s.z - before.velocity_W_m_s.z);
            // It slows down, or it stops; nothing throws it.
            let rises_m_s = body.velocity_W_m_s.z;
            assert!(
                rises_m_s <= before.velocity_W_m_s.z.max(0.0) + 1e-9,
                "tick {tick_number}: {rises_m_s} m/s"
            );
            let falls_m_s = -rises_m_s;
            assert!(falls_m_s <= (2.0 * G_M_S2 * rig.heave_m + speed_m_s * speed_m_s).sqrt(), "{falls_m_s}");
            before = body;
        }
        assert!(highest_m_s2 > 0.9, "it meets an end, or this shows nothing");
        assert!(
            before.velocity_W_m_s.norm() < 1e-9 && bearing_m(&rig, &before).z < 1e-6,
            "it lies at the lower end"
        );
        assert!(tilt_rad(&before) < 1e-9);
    }
}

#[test]
fn the_cone_of_either_rig_stops_a_tilt_without_throwing_it_back() {
    for text in [scenes::reference::RIG_SLIDING, scenes::reference::RIG_FIXED] {
        let (scene, rig) = frictionless(text);
        for (yaw_deg, rate_rad_s) in [(0.0_f64, 5.5), (30.0, 6.0), (77.0, 9.0), (200.0, 12.0)] {
            let start = RigidBody {
                attitude_WB: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_deg.to_radians()),
                // Not along an axis of symmetry.
                angular_velocity_B_rad_s: Vector3::new(0.8, 0.6, 0.0) * rate_rad_s,
                ..RigidBody::level_at(rig.bearing_W_m - rig.mount_B_m)
            };
            let mut plant = plant(&scene, &start);
            plant.set_body(&start);
            let (mut before_rad, mut fastest_rad_s, mut stopped) = (0.0_f64, 0.0_f64, false);
            for _ in 0..400 {
                let tilt_rad = tilt_rad(&tick(&mut plant));
                let rate_rad_s = (tilt_rad - before_rad) / TICK_S;
                before_rad = tilt_rad;
                assert!(tilt_rad < rig.tilt_max_rad + 1e-5, "{tilt_rad} rad");
                fastest_rad_s = fastest_rad_s.max(rate_rad_s);
                if !stopped && rig.tilt_max_rad - tilt_rad < 5e-5 {
                    // The tick after: what was thrown back would be on its way.
                    let after_rad = self::tilt_rad(&tick(&mut plant));
                    let back_rad_s = (tilt_rad - after_rad) / TICK_S;
                    assert!(back_rad_s < 0.15, "it falls back by its weight alone: {back_rad_s} rad/s");
                    (before_rad, stopped) = (after_rad, true);
                }
            }
            assert!(stopped && fastest_rad_s > 3.0, "it meets the cone: {fastest_rad_s}");
        }
    }
}

/// The complete elliptic integral of the first kind, by the arithmetic-geometric mean.
fn elliptic_k(modulus: f64) -> f64 {
    let (mut a, mut b) = (1.0_f64, (1.0 - modulus * modulus).sqrt());
    for _ in 0..20 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    TAU / 4.0 / a
}

#[test]
fn rig_b_swings_with_the_period_of_a_physical_pendulum_and_keeps_its_energy() {
    let (scene, rig) = frictionless(scenes::reference::RIG_FIXED);
    for swing_rad in [0.05, 0.2, 0.5, 0.75] {
        let attitude_WB = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), swing_rad);
        let mut plant = plant(&scene, &RigidBody { attitude_WB, ..RigidBody::level_at(Vector3::zeros()) });
        let vehicle = vehicle();
        let (mass_kg, lever_m) = (vehicle.mass_kg, rig.mount_B_m.z);
        let inertia_kg_m2 = vehicle.inertia_kg_m2[(0, 0)] + mass_kg * lever_m * lever_m;
        let slow_s = 4.0 * f64::sqrt(inertia_kg_m2 / (mass_kg * G_M_S2 * lever_m));
        let expected_s = slow_s * elliptic_k(libm::sin(swing_rad / 2.0));
        let energy_J = |body: &RigidBody| {
            let w = body.angular_velocity_B_rad_s;
            0.5 * mass_kg * body.velocity_W_m_s.norm_squared()
                + 0.5 * w.dot(&(vehicle.inertia_kg_m2 * w))
                + mass_kg * G_M_S2 * (body.position_W_m.z + lever_m - rig.bearing_W_m.z)
        };
        let lowest_J = 0.0;
        let start_J = energy_J(&plant.state().body) - lowest_J;
        let (mut crossings, mut before) = (Vec::new(), 1.0);
        for number in 0..12_000 {
            let body = tick(&mut plant);
            let lean = (body.attitude_WB * Vector3::z()).y;
            if lean > 0.0 && before <= 0.0 {
                crossings.push((f64::from(number) - lean / (lean - before)) * TICK_S);
            }
            before = lean;
            let gained = energy_J(&body) / start_J - 1.0;
            assert!(gained.abs() < 1e-6, "it gains {gained} of the energy that it swings with");
        }
        let period_s = (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64;
        assert!((period_s - expected_s).abs() < 2e-6, "{swing_rad} rad: {period_s} s, not {expected_s} s");
    }
}
