//! Contacts of the rapier backend, and its reports of them.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use common::{TICK_S, hummingbird};
use nalgebra::{UnitQuaternion, Vector3};
use plant::contact_dynamics::hull::Hull;
use plant::{Airframe, Backend, ContactReport, Neighbour, NewtonEuler, Rapier, RigidBody};
use scenes::Scene;

const CRASH_SPEED_M_S: f64 = 1.0;
/// The lowest command: 1075 rpm, which carries a thirteenth of the weight.
const IDLE: [f64; 4] = [1.0; 4];

fn plant(scene: &Scene, body: &RigidBody) -> Rapier {
    common::rapier(NewtonEuler::new(hummingbird(), 1), scene, body, CRASH_SPEED_M_S)
}

fn room() -> Scene {
    Scene::parse(scenes::reference::ROOM, "room.toml").unwrap()
}

fn fly(plant: &mut Rapier, commands: &[f64; 4], ticks: usize) -> Vec<ContactReport> {
    let mut step = || {
        plant.step(commands, TICK_S, &[]);
        plant.contact()
    };
    (0..ticks).map(|_| step()).collect()
}

fn hull() -> Hull {
    Hull::of(&Airframe::new(hummingbird()))
}

fn stand_m() -> f64 {
    hull().stand_m()
}

#[test]
fn at_rest_on_the_ground_the_accelerometer_feels_g_before_anything_has_moved() {
    let mut plant = plant(&Scene::default(), &RigidBody::level_at(Vector3::zeros()));
    plant.settle_rotors(&IDLE);
    let felt = plant.accelerations().specific_force_B_m_s2;
    assert!((felt - Vector3::z() * 9.81).norm() < 1e-9, "{felt:?}");
    assert!(plant.contact().force_W_N.z > 4.0, "the ground carries it: {:?}", plant.contact());
    // More than its weight: the ground does not hold it back.
    plant.settle_rotors(&[120.0; 4]);
    assert!(plant.accelerations().specific_force_B_m_s2.z > 10.0);
    // In the air nothing carries it.
    plant.set_body(&RigidBody::level_at(Vector3::z()));
    plant.settle_rotors(&IDLE);
    assert!(plant.accelerations().specific_force_B_m_s2.z < 1.0);
}

/// Its front feet 0.2 mm above the ground, coming down slowly; its nose coming down fast.
fn nose_down() -> RigidBody {
    let attitude_WB = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.1);
    let angular_velocity_B_rad_s = Vector3::y() * 14.0;
    let foot_W_m = attitude_WB * hull().feet_B_m[0];
    let turning_W_m_s = angular_velocity_B_rad_s.cross(&foot_W_m);
    RigidBody {
        position_W_m: Vector3::z() * (hull().foot_radius_m + 2e-4 - foot_W_m.z),
        velocity_W_m_s: -Vector3::z() * 0.3 - turning_W_m_s,
        attitude_WB,
        angular_velocity_B_rad_s,
    }
}

#[test]
fn a_disc_that_is_slammed_down_while_a_foot_touches_already_is_a_crash() {
    let mut plant = plant(&Scene::default(), &nose_down());
    let reports = fly(&mut plant, &IDLE, 100);
    let first = reports.iter().find(|report| report.count > 0).expect("the feet touch");
    assert!(!first.crashed && first.impact_speed_m_s < 0.5, "{first:?}");
    let slam = reports.iter().find(|report| report.crashed).expect("the disc follows");
    assert_eq!((slam.began, slam.count, slam.object), (1, 1, 1), "it is the same contact: {slam:?}");
    assert!((2.0..4.0).contains(&slam.impact_speed_m_s), "{slam:?}");
}

#[test]
fn a_centre_of_mass_that_is_elsewhere_moves_the_whole_hull_and_leaves_its_shape() {
    let offset_B_m = Vector3::new(0.02, -0.01, 0.005);
    let kind = plant::effects::find("com-offset").unwrap();
    let [x_m, y_m, z_m]: [f64; 3] = offset_B_m.into();
    let effect = plant::effects::Effect { kind, values: common::values([x_m, y_m, z_m]) };
    let (moved, declared) = (Hull::of(&Airframe::with_effects(hummingbird(), vec![effect])), hull());
    assert!((moved.disc_radius_m - declared.disc_radius_m).abs() < 1e-12);
    assert!((moved.centre_B_m - (declared.centre_B_m - offset_B_m)).norm() < 1e-12);
    for (foot_B_m, there_B_m) in moved.feet_B_m.iter().zip(declared.feet_B_m) {
        assert!((foot_B_m - (there_B_m - offset_B_m)).norm() < 1e-12, "{foot_B_m:?}");
    }
}

#[test]
fn a_vehicle_that_starts_on_the_ground_stands_on_its_feet_and_stays_there() {
    let mut plant = plant(&Scene::default(), &RigidBody::level_at(Vector3::zeros()));
    assert_eq!(plant.state().body.position_W_m.z, stand_m());
    let reports = fly(&mut plant, &IDLE, 3_000);
    let body = plant.state().body;
    assert!((body.position_W_m - Vector3::z() * stand_m()).norm() < 2e-4, "{:?}", body.position_W_m);
    assert!(body.attitude_WB.angle() < 1e-3, "{}", body.attitude_WB.angle());
    assert!(body.velocity_W_m_s.norm() < 1e-3 && body.angular_velocity_B_rad_s.norm() < 1e-2, "{body:?}");
    let last = reports.last().unwrap();
    assert_eq!((last.object, last.count, last.began, last.crashed), (1, 1, 0, false));
    assert!(reports.iter().all(|report| report.object == 1), "it never leaves the ground");
}

#[test]
fn the_ground_carries_what_the_rotors_do_not_and_the_accelerometer_feels_g() {
    let mut plant = plant(&Scene::default(), &RigidBody::level_at(Vector3::zeros()));
    let reports = fly(&mut plant, &IDLE, 2_000);
    let vehicle = hummingbird();
    let lift_N: f64 =
        plant.state().rotors.iter().map(|rotor| plant::rotor::thrust_N(&vehicle, rotor.speed_rad_s)).sum();
    let mean_N = reports[1_000..].iter().map(|report| report.force_W_N).sum::<Vector3<f64>>() / 1_000.0;
    let expected_N = Vector3::z() * (vehicle.mass_kg * vehicle.gravity_m_s2 - lift_N);
    assert!((mean_N - expected_N).norm() < 0.02, "{mean_N:?} {expected_N:?}");
    let felt = plant.accelerations().specific_force_B_m_s2;
    assert!((felt - Vector3::z() * 9.81).norm() < 0.05, "{felt:?}");
}

#[test]
fn a_fall_is_met_at_its_speed_counted_once_and_a_crash_above_the_limit() {
    // 4 cm of fall is 0.9 m/s, 0.5 m is 3.1 m/s; the idling rotors take a thirteenth of the weight off.
    for (height_m, crashed) in [(0.04, false), (0.5, true)] {
        let start = RigidBody::level_at(Vector3::z() * (stand_m() + height_m));
        let mut plant = plant(&Scene::default(), &start);
        let mut speed_before_m_s = 0.0;
        let mut met = None;
        for _ in 0..3_000 {
            if met.is_none() {
                speed_before_m_s = -plant.state().body.velocity_W_m_s.z;
            }
            plant.step(&IDLE, TICK_S, &[]);
            met = met.or(Some(plant.contact()).filter(|report| report.count > 0));
        }
        let met = met.expect("it falls onto the ground");
        // It is met within the tick, in which it gained a little more speed.
        let gained_m_s = met.impact_speed_m_s - speed_before_m_s;
        assert!((0.0..9.81e-3).contains(&gained_m_s), "{met:?} {speed_before_m_s}");
        assert_eq!((met.object, met.began, met.crashed), (1, 1, crashed), "{met:?}");
        assert!(plant.contact().began >= 1 && plant.contact().crashed == crashed);
        assert!((plant.state().body.position_W_m.z - stand_m()).abs() < 1e-3, "it comes to rest on its feet");
    }
}

/// A bounce may begin and end between two ticks, a millimetre away from the ground again at the end.
#[test]
fn an_impact_is_told_also_where_it_is_over_within_a_tick() {
    let surface = scenes::Surface { friction: 0.5, restitution: 0.9 };
    let ground = Scene { surface, ..Scene::default() };
    for height_um in 0..40 {
        let start = RigidBody {
            velocity_W_m_s: -Vector3::z() * 6.0,
            ..RigidBody::level_at(Vector3::z() * (stand_m() + 0.02 + 3e-4 * f64::from(height_um)))
        };
        let mut plant = common::rapier(NewtonEuler::new(hummingbird(), 2), &ground, &start, CRASH_SPEED_M_S);
        let reports = fly(&mut plant, &IDLE, 20);
        let began = reports.iter().find(|report| report.began > 0).expect("it meets the ground");
        assert_eq!((began.object, began.count), (1, 1), "{began:?}");
        assert!(began.force_W_N.z > 1_000.0 && (began.impact_speed_m_s - 6.0).abs() < 0.1, "{began:?}");
        assert_eq!(reports.last().map(|report| (report.count, report.began)), Some((0, 1)), "it is gone");
    }
}

#[test]
fn lift_off_ends_the_contact_and_leaves_none_counted() {
    let mut plant = plant(&Scene::default(), &RigidBody::level_at(Vector3::zeros()));
    let reports = fly(&mut plant, &[120.0; 4], 1_500);
    assert!(plant.state().body.position_W_m.z > 0.5);
    let last = reports.last().unwrap();
    assert_eq!((last.count, last.object, last.began, last.crashed), (0, 0, 0, false));
    assert_eq!(last.force_W_N, Vector3::zeros());
}

/// Returns the greatest coordinate of the vehicle's disc along `direction`.
fn reach_m(plant: &Rapier, hull: &Hull, direction: &Vector3<f64>) -> f64 {
    let body = plant.state().body;
    let lean = (body.attitude_WB * Vector3::z()).dot(direction).abs();
    let rim_m = hull.disc_radius_m * (1.0 - lean * lean).sqrt() + hull.disc_half_m * lean;
    body.position_W_m.dot(direction) + rim_m
}

#[test]
fn walls_hold_a_vehicle_and_are_named() {
    let hull = hull();
    let hover = [hummingbird().hover_command(); 4];
    for (direction, object) in [(Vector3::x(), 2), (-Vector3::x(), 3), (Vector3::y(), 4), (-Vector3::y(), 5)]
    {
        let start = RigidBody {
            velocity_W_m_s: direction * 2.0,
            ..RigidBody::level_at(direction * 4.0 + Vector3::z())
        };
        let mut plant = plant(&room(), &start);
        plant.settle_rotors(&hover);
        let mut met = None;
        for _ in 0..1_000 {
            plant.step(&hover, TICK_S, &[]);
            met = met.or(Some(plant.contact()).filter(|report| report.count > 0));
            let depth_m = reach_m(&plant, &hull, &direction) - 5.0;
            assert!(depth_m < 2e-3, "it enters the wall by {depth_m} m");
        }
        let met = met.expect("it flies into the wall");
        assert_eq!((met.object, met.began, met.crashed), (object, 1, true));
        assert!((met.impact_speed_m_s - 2.0).abs() < 0.01, "{met:?}");
        assert!(met.force_W_N.dot(&direction) < 0.0, "the wall pushes back");
    }
}

#[test]
fn another_vehicle_is_met_where_it_flies() {
    let hover = [hummingbird().hover_command(); 4];
    let hull = hull();
    let mut plant = plant(&room(), &RigidBody::level_at(Vector3::new(0.0, 0.0, 1.0)));
    plant.settle_rotors(&hover);
    let (mut met, mut met_at_m) = (None, 0.0);
    for tick in 0..2_000 {
        let position_W_m = Vector3::new(2.0 - 1.5 * f64::from(tick) * TICK_S, 0.0, 1.0);
        let velocity_W_m_s = -Vector3::x() * 1.5;
        plant.step(&hover, TICK_S, &[Neighbour { number: 3, position_W_m, velocity_W_m_s }]);
        if met.is_none() && plant.contact().count > 0 {
            met = Some(plant.contact());
            met_at_m = position_W_m.x;
        }
    }
    let met = met.expect("they meet");
    assert_eq!((met.object, met.crashed), (1003, true));
    assert!((met_at_m - 2.0 * hull.disc_radius_m).abs() < 0.01, "{met_at_m}");
    assert!((met.impact_speed_m_s - 1.5).abs() < 0.01, "{met:?}");
    assert!(plant.state().body.position_W_m.x < -0.3, "it is pushed away");
}

#[test]
fn a_tumbling_fall_ends_on_the_ground_and_not_in_it() {
    let start = RigidBody {
        attitude_WB: UnitQuaternion::from_euler_angles(2.5, 0.4, 1.0),
        angular_velocity_B_rad_s: Vector3::new(5.0, -3.0, 2.0),
        ..RigidBody::level_at(Vector3::z() * 2.0)
    };
    let mut plant = plant(&room(), &start);
    let hull = hull();
    for tick in 0..8_000 {
        plant.step(&IDLE, TICK_S, &[]);
        let depth_m = reach_m(&plant, &hull, &-Vector3::z());
        assert!(depth_m < 2e-3, "at tick {tick} it enters the ground by {depth_m} m");
    }
    assert!(plant.state().body.position_W_m.z < hull.disc_radius_m + 0.01, "it lies on the ground");
    assert!(plant.state().body.velocity_W_m_s.norm() < 0.05, "it does not roll on");
}

/// A table of 2 m by 2 m whose top is at 0.7 m, as a box or as a mesh.
fn table(shape: &str) -> Scene {
    let number = |value: &str| {
        format!("{{ value = {value}, unit = \"m\", source = \"test\", uncertainty = \"exact\" }}")
    };
    let text = if shape == "box" {
        format!(
            "[[boxes]]\nname = \"table\"\ncentre = {}\nsize = {}\n",
            number("[0, 0, 0.6]"),
            number("[2, 2, 0.2]")
        )
    } else {
        let place = format!("position = {}\nscale = {}\n", number("[0, 0, 0]"), number("1"));
        format!("[[meshes]]\nname = \"table\"\nfile = \"table.obj\"\n{place}solid = \"{shape}\"\n")
    };
    let corners = ["-1 -1", "1 -1", "1 1", "-1 1"];
    let corners = [0.5, 0.7].map(|z| corners.map(|xy| format!("v {xy} {z}\n")).concat()).concat();
    let faces = "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    let read = |_: &std::path::Path| Ok(format!("{corners}{faces}").into_bytes());
    Scene::parse_with(&format!("name = \"test\"\n{text}"), "test.toml", &read).unwrap()
}

#[test]
fn a_vehicle_comes_to_rest_on_a_mesh_as_on_a_box() {
    let start = RigidBody::level_at(Vector3::new(0.3, -0.2, 0.7 + stand_m() + 0.02));
    let rest_m = ["box", "triangles", "convex"].map(|shape| {
        let mut plant = plant(&table(shape), &start);
        let last = *fly(&mut plant, &IDLE, 4_000).last().unwrap();
        assert_eq!((last.object, last.count, last.crashed), (2, 1, false), "{shape}: {last:?}");
        let body = plant.state().body;
        assert!(body.velocity_W_m_s.norm() < 1e-3, "{shape}: {body:?}");
        body.position_W_m.z
    });
    for (shape, height_m) in ["box", "triangles", "convex"].iter().zip(rest_m) {
        assert!((height_m - 0.7 - stand_m()).abs() < 1e-3, "on a {shape} it stands {height_m} m high");
    }
}

#[test]
fn a_vehicle_does_not_pass_through_triangles_that_it_flies_against() {
    // A wall without thickness at x = 1 m.
    let number = "{ value = [1, 0, 0], unit = \"m\", source = \"test\", uncertainty = \"exact\" }";
    let scale = "{ value = 1, unit = \"m\", source = \"test\", uncertainty = \"exact\" }";
    let text = format!(
        "name = \"test\"\n[[meshes]]\nname = \"wall\"\nfile = \"wall.obj\"\nposition = {number}\nscale = {scale}\nsolid = \"triangles\"\n"
    );
    let wall = "v 0 -5 0\nv 0 5 0\nv 0 5 5\nv 0 -5 5\nf 1 2 3\nf 1 3 4\n";
    let scene = Scene::parse_with(&text, "test.toml", &|_| Ok(wall.as_bytes().to_vec())).unwrap();
    for speed_m_s in [0.5, 2.0, 5.0, 10.0] {
        let start = RigidBody {
            velocity_W_m_s: Vector3::x() * speed_m_s,
            ..RigidBody::level_at(Vector3::new(0.0, 0.0, 2.0))
        };
        let mut plant = plant(&scene, &start);
        let hover = [76.5; 4];
        plant.settle_rotors(&hover);
        let reports = fly(&mut plant, &hover, 2_500);
        let met = reports.iter().find(|report| report.count > 0);
        let met = met.unwrap_or_else(|| panic!("{speed_m_s} m/s: the wall is met"));
        assert_eq!((met.object, met.crashed), (2, speed_m_s > CRASH_SPEED_M_S), "{met:?}");
        let reach_m = hull().disc_radius_m;
        let x_m = plant.state().body.position_W_m.x;
        assert!(x_m < 1.0 - 0.5 * reach_m, "{speed_m_s} m/s: it is at {x_m} m in the end");
    }
}

/// A wall without thickness in the plane x = 0, 4.2 m wide and 2.6 m high, with a doorway from y = -0.6 m to 0.6 m, 2.1 m high.
const DOORWAYS: [(&str, &str); 2] = [
    (
        "one polygon",
        "v 0 -2.1 0\nv 0 -0.6 0\nv 0 -0.6 2.1\nv 0 0.6 2.1\nv 0 0.6 0\nv 0 2.1 0\nv 0 2.1 2.6\nv 0 -2.1 2.6\nf 1 2 3 4 5 6 7 8\n",
    ),
    (
        "three quads",
        "v 0 -2.1 0\nv 0 -0.6 0\nv 0 -0.6 2.6\nv 0 -2.1 2.6\nv 0 0.6 0\nv 0 2.1 0\nv 0 2.1 2.6\nv 0 0.6 2.6\nv 0 -0.6 2.1\n\
         v 0 0.6 2.1\nf 1 2 3 4\nf 5 6 7 8\nf 9 10 8 3\n",
    ),
];

/// A vehicle in the plane of a sheet of triangles meets its border as it meets the edge of a thin box: it goes no further in,
/// and leaves with a fifth of its speed.
#[test]
fn a_vehicle_in_the_plane_of_a_sheet_meets_its_border() {
    let number = "{ value = [0, 0, 0], unit = \"m\", source = \"test\", uncertainty = \"exact\" }";
    let scale = "{ value = 1, unit = \"m\", source = \"test\", uncertainty = \"exact\" }";
    let text = format!(
        "name = \"test\"\n[[meshes]]\nname = \"wall\"\nfile = \"wall.obj\"\nposition = {number}\nscale = {scale}\nsolid = \"triangles\"\n"
    );
    let radius_m = hull().disc_radius_m;
    for (name, wall) in DOORWAYS {
        let scene = Scene::parse_with(&text, "test.toml", &|_| Ok(wall.as_bytes().to_vec())).unwrap();
        // From the doorway towards a post, and from outside towards the other side of it.
        for (from_m, post_m) in [(0.0, -0.6), (0.0, 0.6), (-2.6, -2.1), (2.6, 2.1)] {
            for (aside_m, speed_m_s) in [(0.0, 0.5), (0.004, 1.3), (-0.004, 3.0), (0.1, 0.5)] {
                let towards = f64::signum(post_m - from_m);
                let start = RigidBody {
                    velocity_W_m_s: Vector3::y() * towards * speed_m_s,
                    ..RigidBody::level_at(Vector3::new(aside_m, from_m, 1.0))
                };
                let mut plant = plant(&scene, &start);
                plant.settle_rotors(&[hummingbird().hover_command(); 4]);
                let reaches_m = f64::sqrt(radius_m * radius_m - aside_m * aside_m);
                let (mut nearest_m, mut slowest_m_s) = (f64::INFINITY, f64::INFINITY);
                let (mut met, mut left) = (false, 0);
                while left < 20 && plant.state().body.position_W_m.y.abs() < 3.0 {
                    plant.step(&[hummingbird().hover_command(); 4], TICK_S, &[]);
                    let body = &plant.state().body;
                    nearest_m = nearest_m.min((post_m - body.position_W_m.y) * towards - reaches_m);
                    slowest_m_s = slowest_m_s.min(body.velocity_W_m_s.y * towards);
                    met |= plant.contact().began > 0;
                    left += u32::from(met);
                }
                let case =
                    format!("{name}, from {from_m} m to {post_m} m, {aside_m} m aside, {speed_m_s} m/s");
                assert!(nearest_m.abs() < 2e-3, "{case}: {nearest_m} m from the border at the nearest");
                let back_m_s = if aside_m.abs() < 0.01 { -0.19 * speed_m_s } else { 0.7 * speed_m_s };
                assert!(slowest_m_s < back_m_s, "{case}: {slowest_m_s} m/s");
                assert_eq!(plant.contact().object, 0, "{case}: it is free again");
                let turn_B_rad_s = plant.state().body.angular_velocity_B_rad_s;
                let pitch_rad_s = turn_B_rad_s.xy().norm();
                assert!(pitch_rad_s < 0.3 * speed_m_s, "{case}: it pitches by {pitch_rad_s} rad/s");
            }
        }
    }
}

/// A box that stands on the ground with a vertical edge towards -x, at the origin.
fn edge(height_m: f64) -> Scene {
    let number = |value: &str, unit: &str| {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
    };
    let half_m = 0.5 * std::f64::consts::SQRT_2;
    let text = format!(
        "name = \"edge\"\nfriction = {}\n[[boxes]]\nname = \"box\"\ncentre = {}\nsize = {}\nyaw = {}\n",
        number("0", "1"),
        number(&format!("[{half_m}, 0, {}]", height_m / 2.0), "m"),
        number(&format!("[1, 1, {height_m}]"), "m"),
        number("45", "deg"),
    );
    Scene::parse(&text, "edge.toml").unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_rim_that_meets_a_vertical_edge_meets_it_along_a_line_and_does_not_pitch() {
    let centre_z_m = hull().centre_B_m.z;
    assert!(centre_z_m.abs() < 1e-9, "the disc is level with the centre of mass");
    for (aside_m, turn_rad) in [(0.0, 0.0), (0.08, 0.0), (-0.15, 0.3), (0.2, 1.0), (0.11, -0.7)] {
        let start = RigidBody {
            attitude_WB: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn_rad),
            velocity_W_m_s: Vector3::x() * 2.0,
            ..RigidBody::level_at(Vector3::new(-0.6, aside_m, 1.5))
        };
        let mut plant = common::rapier(NewtonEuler::new(common::free_body(), 2), &edge(3.0), &start, 1e9);
        fly(&mut plant, &[0.0; 4], 300);
        let body = plant.state().body;
        assert_eq!(plant.contact().began, 1, "it met the edge");
        assert!(body.velocity_W_m_s.x < 1.9, "{body:?}");
        let spin = body.angular_velocity_B_rad_s;
        assert!(spin.x.abs() < 1e-6 && spin.y.abs() < 1e-6, "{aside_m} m aside: {spin:?}");
    }
}

#[test]
fn a_box_that_hits_the_rim_with_a_vertical_edge_tips_neither() {
    for (aside_m, yaw_deg) in [(0.05, 45.0), (-0.1, 30.0), (0.15, 60.0)] {
        let mut scene = edge(1.0);
        let number = |value: &str, unit: &str| {
            format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
        };
        let text = format!(
            "name = \"thrown\"\n[[boxes]]\nname = \"box\"\ncentre = {}\nsize = {}\nyaw = {}\nmass = {}\nvelocity = {}\nfriction = {}\n",
            number(&format!("[-1, {aside_m}, 3]"), "m"),
            number("[0.2, 0.2, 0.4]", "m"),
            number(&yaw_deg.to_string(), "deg"),
            number("0.3", "kg"),
            number("[2, 0, 0]", "m/s"),
            number("0", "1"),
        );
        scene.boxes = Scene::parse(&text, "thrown.toml").unwrap_or_else(|error| panic!("{error}")).boxes;
        let start = RigidBody::level_at(Vector3::z() * 3.0);
        let mut plant = common::rapier(NewtonEuler::new(common::free_body(), 2), &scene, &start, 1e9);
        fly(&mut plant, &[0.0; 4], 350);
        let spins = [&plant.state().body, &plant.bodies()[0]]
            .map(|body| body.attitude_WB * body.angular_velocity_B_rad_s);
        assert!(plant.contact().began > 0, "they met");
        for spin in spins {
            assert!(spin.xy().norm() < 1e-6, "{aside_m} m aside: {spin:?}");
        }
    }
}

#[test]
fn a_line_ends_where_the_edge_ends() {
    let (speed_m_s, below_m) = (2.0, 5e-3);
    let start = RigidBody {
        velocity_W_m_s: Vector3::x() * speed_m_s,
        ..RigidBody::level_at(Vector3::new(-0.3, 0.0, 1.5))
    };
    let fall_m = 0.5 * 9.81 * ((0.3 - hull().disc_radius_m) / speed_m_s).powi(2);
    let scene = edge(1.5 - fall_m - below_m);
    let vehicle = common::free_body();
    let (mass_kg, inertia_kg_m2) = (vehicle.mass_kg, vehicle.inertia_kg_m2.m22);
    let mut plant = common::rapier(NewtonEuler::new(vehicle, 2), &scene, &start, 1e9);
    fly(&mut plant, &[0.0; 4], 20);
    // The impulse acts at the upper end of the line, which is as high as the box.
    let yields_per_kg = 1.0 / mass_kg + below_m * below_m / inertia_kg_m2;
    let impulse_N_s = (1.0 + scene.boxes[0].surface.restitution) * speed_m_s / yields_per_kg;
    let spin = plant.state().body.angular_velocity_B_rad_s;
    let expected_rad_s = below_m * impulse_N_s / inertia_kg_m2;
    assert!(
        (spin.y - expected_rad_s).abs() < 1e-4 && spin.x.abs() < 1e-6,
        "{spin:?}, not {expected_rad_s} rad/s"
    );
}

#[test]
fn a_vehicle_that_rolls_on_its_rim_slows_down_and_stops() {
    let (radius_m, speed_m_s) = (hull().disc_radius_m, 0.2);
    // The disc upright, its axis along y: rolling without slip.
    let start = RigidBody {
        attitude_WB: UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2),
        velocity_W_m_s: Vector3::x() * speed_m_s,
        angular_velocity_B_rad_s: Vector3::z() * (speed_m_s / radius_m),
        ..RigidBody::level_at(Vector3::z() * radius_m)
    };
    let vehicle = common::free_body();
    let mut plant = common::rapier(NewtonEuler::new(vehicle.clone(), 2), &Scene::default(), &start, 1e9);
    fly(&mut plant, &[0.0; 4], 1_000);
    // The ground carries it 0.02 radii ahead of the contact.
    let carried_kg = vehicle.mass_kg + vehicle.inertia_kg_m2.m33 / (radius_m * radius_m);
    let slows_m_s2 = 0.02 * vehicle.mass_kg * 9.81 / carried_kg;
    let expected_m_s = speed_m_s - slows_m_s2;
    let found_m_s = plant.state().body.velocity_W_m_s.x;
    assert!((found_m_s - expected_m_s).abs() < 2e-3, "{found_m_s} m/s, not {expected_m_s} m/s");
    fly(&mut plant, &[0.0; 4], 1_000);
    let body = plant.state().body;
    assert!(body.velocity_W_m_s.norm() < 1e-6 && body.angular_velocity_B_rad_s.norm() < 1e-6, "{body:?}");
}
