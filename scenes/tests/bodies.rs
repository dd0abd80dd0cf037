//! Free bodies and joints of a scene file: their values, and the faults that are refused.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use nalgebra::Vector3;
use scenes::{BodyPose, End, Freedom, RayCaster, Scene};

fn given(value: &str, unit: &str) -> String {
    format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
}

fn ball(name: &str, more: &str) -> String {
    let (centre, radius) = (given("[1, 0, 2]", "m"), given("0.1", "m"));
    format!("[[balls]]\nname = \"{name}\"\ncentre = {centre}\nradius = {radius}\n{more}")
}

fn heavy(name: &str) -> String {
    ball(name, &format!("mass = {}\n", given("0.5", "kg")))
}

/// A joint of this kind between these two with these further keys.
fn joint(kind: &str, parent: &str, child: &str, more: &str) -> String {
    let anchor = given("[0, 0, 1]", "m");
    format!(
        "[[joints]]\nname = \"joint\"\nkind = \"{kind}\"\nparent = \"{parent}\"\nchild = \"{child}\"\n\
         anchor = {anchor}\n{more}"
    )
}

fn scene(parts: &[String]) -> Result<Scene, diagnostics::Diagnostic> {
    Scene::parse(&format!("name = \"test\"\n{}", parts.concat()), "test.toml")
}

#[track_caller]
fn refused(parts: &[String], told: &[&str]) {
    let error = scene(parts).unwrap_err().to_string();
    assert!(error.contains("test.toml:"), "{error}");
    assert!(told.iter().all(|word| error.contains(word)), "{told:?} in {error}");
}

#[test]
fn a_thing_with_a_mass_is_a_body_and_keeps_its_number_among_things() {
    let boxed = format!(
        "[[boxes]]\nname = \"wall\"\ncentre = {}\nsize = {}\n",
        given("[5, 0, 1]", "m"),
        given("[1, 1, 1]", "m")
    );
    let scene = scene(&[boxed, ball("lamp", ""), heavy("load")]).unwrap();
    let bodies: Vec<_> = scene.bodies().collect();
    assert_eq!((bodies.len(), bodies[0].0, scene.name_of(2)), (1, 2, Some("load")));
    // 2/5 m r^2.
    assert!((bodies[0].1.inertia_kg_m2[(1, 1)] - 0.4 * 0.5 * 0.01).abs() < 1e-15);
}

#[test]
fn what_hangs_from_the_vehicle_is_found_along_chains_and_not_through_the_world() {
    let parts = [
        heavy("a"),
        heavy("b"),
        heavy("c"),
        joint("ball", "b", "a", "").replace("\"joint\"", "\"one\""),
        joint("ball", "vehicle", "b", "").replace("\"joint\"", "\"two\""),
        joint("ball", "world", "c", ""),
    ];
    let scene = scene(&parts).unwrap();
    assert_eq!(scene.hanging(), [true, true, false]);
    assert_eq!((scene.joints[0].parent, scene.joints[0].child), (End::Body(1), End::Body(0)));
    assert!(scene.is_vehicle_tied() && matches!(scene.joints[0].freedom, Freedom::Ball));
}

#[test]
fn rays_meet_a_body_where_it_is() {
    let caster = RayCaster::new(&scene(&[heavy("load")]).unwrap());
    let down = |x_m: f64, bodies: &[BodyPose]| {
        caster.distance_among_m(bodies, &Vector3::new(x_m, 0.0, 3.0), &-Vector3::z(), 10.0).unwrap()
    };
    let start = scene(&[heavy("load")]).unwrap().bodies().next().unwrap().1.start();
    let moved = BodyPose { position_W_m: Vector3::new(7.0, 0.0, 1.0), ..start };
    assert!((down(1.0, &[start]) - 0.9).abs() < 1e-12 && (down(1.0, &[moved]) - 3.0).abs() < 1e-12);
    assert!((down(7.0, &[moved]) - 1.9).abs() < 1e-12);
    assert!((caster.clearance_among_m(&[moved], &Vector3::new(7.0, 0.0, 3.0)) - 1.9).abs() < 1e-12);
}

#[test]
fn what_no_body_can_be_is_refused_with_its_key() {
    let mass = |value: &str| ball("load", &format!("mass = {}\n", given(value, "kg")));
    refused(&[mass("0")], &["balls.0.mass"]);
    refused(&[mass("-1")], &["balls.0.mass"]);
    refused(&[mass("1e9")], &["balls.0.mass"]);
    let speed = format!("velocity = {}\n", given("[1, 0, 0]", "m/s"));
    refused(&[ball("load", &speed)], &["balls.0.velocity"]);
    refused(&[heavy("load"), heavy("load")], &["`name`", "one of its own", "load"]);
    refused(&[heavy("vehicle")], &["vehicle"]);
    refused(&[heavy("world")], &["world"]);
    let many: Vec<_> = (0..17).map(|number| heavy(&format!("body {number}"))).collect();
    refused(&many, &["at most 16", "17"]);
    assert!(scene(&many[..16]).is_ok());
}

#[test]
fn what_no_drive_can_be_is_refused_with_its_key() {
    let axis = format!("axis = {}\n", given("[0, 0, 1]", "1"));
    let with = |kind: &str, axis: &str, keys: &str| {
        [heavy("load"), joint(kind, "world", "load", axis) + "[joints.drive]\n" + keys]
    };
    let key = |name: &str, value: &str, unit: &str| format!("{name} = {}\n", given(value, unit));
    let mode = |name: &str| format!("mode = \"{name}\"\n");
    let speeds = |points: &str| key("schedule", points, "rad/s");
    let damping = |value: &str| key("damping", value, "N*m*s/rad");
    let stiffness = |value: &str| key("stiffness", value, "N*m/rad");
    let speed = mode("speed") + &damping("1") + &speeds("[[0, 1]]");
    let position = mode("position") + &stiffness("1") + &key("schedule", "[[0, 90], [1, -90]]", "deg");
    for whole in [&speed, &position, &(position.clone() + &damping("0") + &key("limit", "0", "N*m"))] {
        assert!(scene(&with("revolute", &axis, whole)).is_ok(), "{whole}");
    }
    for kind in ["fixed", "ball"] {
        refused(
            &with(kind, "", &speed),
            &["test.toml:13:1:", "joints.0.drive", "revolute or prismatic", kind],
        );
    }
    let hinge = |keys: &str, told: &[&str]| refused(&with("revolute", &axis, keys), told);
    // Modes and their gains.
    hinge(&speed.replace("speed", "torque"), &["joints.0.drive.mode", "\"position\"", "\"torque\""]);
    hinge(&(mode("speed") + &speeds("[[0, 1]]")), &["missing key `joints.0.drive.damping`"]);
    hinge(
        &position.replace("stiffness", "damping").replace("N*m/rad", "N*m*s/rad"),
        &["missing key `joints.0.drive.stiffness`"],
    );
    hinge(&(speed.clone() + &stiffness("1")), &["joints.0.drive.stiffness", "\"position\""]);
    hinge(&(speed.clone() + &key("gain", "1", "1")), &["joints.0.drive.gain", "unknown"]);
    // Numbers.
    hinge(&speed.replace(&damping("1"), &damping("-1")), &["joints.0.drive.damping", "-1"]);
    hinge(&speed.replace(&damping("1"), &damping("0")), &["joints.0.drive.damping", "above 0"]);
    hinge(&speed.replace(&damping("1"), &damping("nan")), &["joints.0.drive.damping", "finite", "nan"]);
    hinge(&position.replace(&stiffness("1"), &stiffness("-1")), &["joints.0.drive.stiffness", "-1"]);
    hinge(
        &position.replace(&stiffness("1"), &stiffness("inf")),
        &["joints.0.drive.stiffness", "finite", "inf"],
    );
    hinge(&(position.clone() + &damping("-1")), &["joints.0.drive.damping", "-1"]);
    hinge(&(speed.clone() + &key("limit", "-1", "N*m")), &["joints.0.drive.limit", "-1"]);
    hinge(&(speed.clone() + &key("limit", "1", "N")), &["joints.0.drive.limit.unit", "N*m"]);
    refused(&with("prismatic", &axis, &speed), &["joints.0.drive.damping.unit", "N*s/m"]);
}

#[test]
fn what_no_schedule_can_be_is_refused_with_its_point() {
    let with = |points: &str| {
        let axis = format!("axis = {}\n", given("[0, 0, 1]", "1"));
        let damping = given("1", "N*m*s/rad");
        let keys = format!("mode = \"speed\"\ndamping = {damping}\nschedule = {}\n", given(points, "rad/s"));
        [heavy("load"), joint("revolute", "world", "load", &axis) + "[joints.drive]\n" + &keys]
    };
    let schedule = "joints.0.drive.schedule";
    assert!(scene(&with("[[0, 1], [2, 3], [2, 4]]")).is_ok(), "two of one time are a jump");
    refused(&with("[]"), &["test.toml:17:22:", schedule, "one or more points", "empty"]);
    refused(&with("1"), &[schedule, "one or more points", "found 1"]);
    refused(&with("[1, 2]"), &["schedule.value.0", "two numbers", "found 1"]);
    refused(&with("[[0, 1], [1, 2, 3]]"), &["schedule.value.1", "two numbers", "an array of 3"]);
    refused(&with("[[0, 1], [2, 2], [1.5, 3]]"), &["schedule.value.2", "2 s or later", "1.5 s"]);
    refused(&with("[[-1, 1]]"), &["schedule.value.0", "since the start", "-1"]);
    refused(&with("[[0, nan]]"), &["schedule.value.0", "finite", "nan"]);
    refused(&with("[[inf, 1]]"), &["schedule.value.0", "finite", "inf"]);
    refused(&with("[[0, 1e9]]"), &["schedule.value.0", "wrong unit", "1000000000.0 rad/s"]);
    refused(&with("[[0, \"fast\"]]"), &["schedule.value.0", "finite number", "fast"]);
}

#[test]
fn what_no_joint_can_be_is_refused_with_its_key() {
    let body = || heavy("load");
    let with = |text: String| [body(), text];
    refused(&with(joint("weld", "world", "load", "")), &["joints.0.kind", "\"revolute\""]);
    refused(&with(joint("ball", "world", "lode", "")), &["joints.0.child", "lode", "load"]);
    refused(&with(joint("ball", "load", "load", "")), &["joints.0.child", "parent"]);
    refused(&with(joint("ball", "load", "world", "")), &["joints.0.child", "swap"]);
    refused(&with(joint("revolute", "world", "load", "")), &["joints.0.axis"]);
    let axis = |value: &str| format!("axis = {}\n", given(value, "1"));
    refused(&with(joint("revolute", "world", "load", &axis("[0, 0, 0]"))), &["joints.0.axis", "zeros"]);
    let limits = axis("[0, 0, 1]") + &format!("lower = {}\n", given("10", "deg"));
    refused(&with(joint("revolute", "world", "load", &limits)), &["joints.0.lower", "starts at 0"]);
    let limits = axis("[0, 0, 1]") + &format!("upper = {}\n", given("200", "deg"));
    refused(&with(joint("revolute", "world", "load", &limits)), &["joints.0.upper"]);
    let limits = axis("[0, 0, 1]") + &format!("upper = {}\n", given("60", "deg"));
    refused(&with(joint("revolute", "world", "load", &limits)), &["joints.0.upper", "give the other"]);
    refused(&with(joint("ball", "world", "load", &axis("[0, 0, 1]"))), &["joints.0.axis"]);
    refused(&with(joint("rope", "world", "load", "")), &["joints.0.length"]);
    let damped = format!("damping = {}\n", given("1", "N*m*s/rad"));
    refused(&with(joint("fixed", "world", "load", &damped)), &["joints.0.damping"]);
    refused(&with(joint("ball", "world", "vehicle", "")), &["joints.0.kind", "rope"]);
    let twice = [body(), joint("ball", "world", "load", ""), joint("ball", "world", "load", "")];
    refused(&twice, &["joints.1.name", "second"]);
    let chain = [
        body(),
        joint("ball", "vehicle", "load", ""),
        joint("ball", "world", "load", "").replace("\"joint\"", "\"other\""),
    ];
    refused(&chain, &["joints.1.kind", "rope"]);
}
