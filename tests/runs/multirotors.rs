//! Vehicles with any number of rotors, upright and tilted: flown, refused, and warned of.
#![allow(non_snake_case, reason = "N is the newton")]

use crate::recordings::{Row, rows};
use crate::scenarios::composed;
use crate::support::{Ended, Place, repository};
use std::fmt::Write as _;
use std::path::Path;
use vehicles::{MotorModel, Vehicle};

/// The arms of the F550: name of the rotor, angle from the nose in degrees, counter-clockwise seen from above, and spin.
const ARMS: [(&str, f64, f64); 6] = [
    ("right", 270.0, -1.0),
    ("left", 90.0, 1.0),
    ("front left", 30.0, -1.0),
    ("rear right", 210.0, 1.0),
    ("front right", 330.0, 1.0),
    ("rear left", 150.0, -1.0),
];
const ARM_M: f64 = 0.27;

/// A table `[[rotors]]`.
fn rotor(name: &str, position_m: [f64; 3], axis: [f64; 3], spin: f64) -> String {
    let sense = if spin > 0.0 { "counter-clockwise" } else { "clockwise" };
    format!(
        "[[rotors]]\nname = \"{name}\"\n\
         position = {{ value = {position_m:?}, unit = \"m\", source = \"a test\", uncertainty = \"exact\" }}\n\
         axis = {{ value = {axis:?}, unit = \"1\", source = \"a test\", uncertainty = \"exact\" }}\n\
         spin = {{ value = \"{sense}\", source = \"a test\" }}\n"
    )
}

/// A vehicle file that has all but the rotors, and the tables `body`, of the F550.
fn on_the_f550(place: &Place, name: &str, body: &str, rotors: &[String]) -> String {
    let base = repository("vehicles/dji-f550.toml");
    place.write(
        &format!("{name}.toml"),
        format!("base = {base:?}\nname = \"{name}\"\n{body}{}", rotors.concat()),
    )
}

/// The F550 with rotors that lean by `lean_deg` about their arms, each in its own sense of rotation. The thrust then turns the
/// vehicle in the sense of the rotor, and the drag against it.
fn leaning(place: &Place, name: &str, lean_deg: f64) -> String {
    let (sine, cosine) = libm::sincos(lean_deg.to_radians());
    let rotors = ARMS.map(|(name, angle_deg, spin)| {
        let (y, x) = libm::sincos(angle_deg.to_radians());
        rotor(name, [ARM_M * x, ARM_M * y, 0.0], [-y * spin * sine, x * spin * sine, cosine], spin)
    });
    on_the_f550(place, name, "", &rotors)
}

/// Two F550s in one: on each arm a rotor above, and below it one that turns the other way. Mass and inertia are doubled.
fn twelve(place: &Place) -> String {
    let rotors = ARMS.map(|(name, angle_deg, spin)| {
        let (y, x) = libm::sincos(angle_deg.to_radians());
        let at = |level: &str, z_m: f64, spin: f64| {
            rotor(&format!("{level} {name}"), [ARM_M * x, ARM_M * y, z_m], [0.0, 0.0, 1.0], spin)
        };
        at("upper", 0.03, spin) + &at("lower", -0.03, -spin)
    });
    let given = |key: &str, value: f64, unit: &str| {
        format!(
            "{key} = {{ value = {value}, unit = \"{unit}\", source = \"a test\", uncertainty = \"exact\" }}\n"
        )
    };
    let body = [
        "[body]\n".to_owned(),
        given("mass", 4.0, "kg"),
        given("inertia_xx", 0.076_233_34, "kg*m^2"),
        given("inertia_yy", 0.076_233_34, "kg*m^2"),
        given("inertia_zz", 0.1458, "kg*m^2"),
    ];
    on_the_f550(place, "twelve", &body.concat(), &rotors)
}

/// A condition on an angle: name, field, span in s, statistic, range in degrees.
type Condition = (&'static str, &'static str, [f64; 2], &'static str, [f64; 2]);

/// Those on pitch and yaw, whose doublets follow that of the roll; `hover.toml` has the others. While one axis moves, the other
/// two stay level. The yaw law is critically damped at 1.5 rad/s, so that its pulses of 4 s end 2 % short.
const CONDITIONS: [Condition; 10] = [
    ("pitch within 1° until its doublet", "pitch", [0.0, 9.0], "every", [-1.0, 1.0]),
    ("pitch to +10°", "pitch", [9.0, 11.0], "max", [9.5, 12.5]),
    ("pitch to -10°", "pitch", [10.0, 12.0], "min", [-12.5, -9.5]),
    ("pitch at the end of +10°", "pitch", [9.95, 10.0], "every", [9.0, 11.0]),
    ("pitch at the end of -10°", "pitch", [10.95, 11.0], "every", [-11.0, -9.0]),
    ("pitch within 1° after its doublet", "pitch", [12.0, 24.0], "every", [-1.0, 1.0]),
    ("yaw within 1° until its doublet", "yaw", [0.0, 12.0], "every", [-1.0, 1.0]),
    ("yaw at the end of +10°", "yaw", [15.9, 16.0], "every", [9.0, 11.0]),
    ("yaw at the end of -10°", "yaw", [19.9, 20.0], "every", [-11.0, -9.0]),
    ("yaw within 1° after its doublet", "yaw", [23.9, 24.0], "every", [-1.0, 1.0]),
];

/// The hover with doublets about all axes.
fn about_all_axes(place: &Place) -> String {
    let mut text = format!("include = [{:?}]\n", repository("manifests/hover.toml"));
    text += "[run]\nduration_s = 24.0\n[process.controller]\noutputs.status = {}\n\
             [process.pilot.parameters]\nset_points = [\n\
             { kind = \"step\", channel = \"altitude\", at_s = 2.0, to = 1.5, unit = \"m\" },\n";
    for (channel, at_s, duration_s) in [("roll", 6.0, 1.0), ("pitch", 9.0, 1.0), ("yaw", 12.0, 4.0)] {
        writeln!(
            text,
            "{{ kind = \"doublet\", channel = \"{channel}\", at_s = {at_s:?}, amplitude = 10.0, unit = \"deg\", \
             duration_s = {duration_s:?} }},"
        )
        .unwrap();
    }
    text += "]\n";
    for (name, angle, [from_s, to_s], statistic, [min, max]) in CONDITIONS {
        writeln!(
            text,
            "[[pass]]\nname = \"{name}\"\ntopic = \"/plant/state\"\nfield = \"attitude.{angle}\"\nunit = \"deg\"\n\
             from_s = {from_s:?}\nto_s = {to_s:?}\nstatistic = \"{statistic}\"\nmin = {min:?}\nmax = {max:?}"
        )
        .unwrap();
    }
    text += "[[pass]]\nname = \"the rotors make all that is asked for\"\ntopic = \"/controller/status\"\n\
             field = \"saturated\"\nunit = \"1\"\nstatistic = \"max\"\nmax = 0\n";
    place.write("axes.toml", text)
}

/// Flies doublets about all axes with one vehicle file for the plant and one for the controller.
fn fly_about_all_axes(place: &Place, recording: &str, flown: &str, known: &str) -> Ended {
    let vehicle = load(flown);
    let commands = vec![vehicle.hover_command(); vehicle.rotors.len()];
    let sets = [
        format!("process.plant.vehicle={flown}"),
        format!("process.controller.vehicle={known}"),
        format!("process.plant.inputs.command.initial.command={commands:?}"),
    ];
    composed(place, &about_all_axes(place), recording, &sets.each_ref().map(String::as_str))
}

#[track_caller]
fn load(path: &str) -> Vehicle {
    Vehicle::load(Path::new(path)).unwrap_or_else(|error| panic!("{error}"))
}

/// Upward part of the thrust of all rotors, N.
fn lift(vehicle: &Vehicle, state: &Row) -> f64 {
    let rotors = vehicle.rotors.iter().enumerate();
    let squares =
        rotors.map(|(number, rotor)| rotor.axis.z * state.get(&format!("rotor_speed[{number}]")).powi(2));
    vehicle.thrust_coefficient * squares.sum::<f64>()
}

/// The rotors lean by 30° about their arms. About z, the lever of the thrust is 0.27 m sin 30° = 0.135 m. The drag, against it, is as
/// much thrust at 0.07 m cos 30° = 0.061 m. An allocation that ignored the tilt would know the drag alone. Its yaw torque would
/// have the wrong sign, and the yaw would run away. The rotors would also lift a seventh less than it counts on. The second flight
/// shows this: there the controller has the vehicle file with upright rotors.
#[test]
fn a_hexacopter_with_tilted_rotors_flies_about_all_axes_if_its_controller_knows_the_tilt() {
    let place = Place::new();
    let (recording, tilted, upright) =
        (place.path("flight.mcap"), leaning(&place, "tilted", 30.0), leaning(&place, "upright", 0.0));
    fly_about_all_axes(&place, &recording, &tilted, &tilted).with_code(0);
    let (states, vehicle) = (rows(&recording, "/plant/state"), load(&tilted));
    let weight_N = vehicle.mass_kg * vehicle.gravity_m_s2;
    assert!((lift(&vehicle, states.last().unwrap()) / weight_N - 1.0).abs() < 0.01);
    let ended = fly_about_all_axes(&place, &recording, &tilted, &upright).with_code(1);
    ended.prints(&["FAILED yaw within 1° until its doublet", "FAILED the rotors make all that is asked for"]);
    // The upright vehicle itself passes.
    fly_about_all_axes(&place, &recording, &upright, &upright).with_code(0);
}

#[test]
fn a_vehicle_with_twelve_rotors_flies_about_all_axes() {
    let place = Place::new();
    let (recording, vehicle) = (place.path("flight.mcap"), twelve(&place));
    fly_about_all_axes(&place, &recording, &vehicle, &vehicle).with_code(0);
    let (states, vehicle) = (rows(&recording, "/plant/state"), load(&vehicle));
    let (last, hover_rad_s) = (states.last().unwrap(), vehicle.hover_speed_rad_s());
    for rotor in 0..12 {
        let speed_rad_s = last.get(&format!("rotor_speed[{rotor}]"));
        assert!((speed_rad_s / hover_rad_s - 1.0).abs() < 0.05, "{rotor}: {speed_rad_s}, {hover_rad_s}");
    }
    let weight_N = vehicle.mass_kg * vehicle.gravity_m_s2;
    assert!((lift(&vehicle, last) / weight_N - 1.0).abs() < 0.01, "{last:?}");
}

/// The vehicle file of the hexacopter with `line` in the table of its rotor `left`.
fn hexacopter_with(place: &Place, line: &str) -> String {
    let text = std::fs::read_to_string(repository("vehicles/dji-f550.toml")).unwrap();
    place.write("hexa.toml", text.replacen("name = \"left\"", &format!("name = \"left\"\n{line}"), 1))
}

/// The key of a rotor that has failed.
const FAILED: &str = "failed = { value = true, source = \"test\" }";

#[test]
fn vehicles_that_cannot_hover_are_refused_with_the_reason() {
    let place = Place::new();
    let text = std::fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    let first = |count: usize| {
        let parts: Vec<&str> = text.split("[[rotors]]").take(count + 1).collect();
        place.write(&format!("{count}.toml"), parts.join("[[rotors]]"))
    };
    let one_way = place.write("one-way.toml", text.replace("\"counter-clockwise\"", "\"clockwise\""));
    for (vehicle, told) in [
        (first(1), ["its 1 working rotors of 1 cannot", "(a single rotor makes no torque without thrust)"]),
        (first(2), ["its 2 working rotors of 2 cannot", "(two rotors are always in a line)"]),
        (first(3), ["yaw is not controllable", "a tricopter needs a servo"]),
        (
            hexacopter_with(&place, FAILED),
            ["its 5 working rotors of 6 cannot hover", "yaw is not controllable both ways"],
        ),
        (
            one_way,
            [
                "all rotors turn one way, so that yaw follows from thrust",
                "\n  help: let half of the rotors turn the other way: `spin`\n",
            ],
        ),
    ] {
        let set = format!("process.controller.vehicle={vehicle}");
        let check = ["check", &repository("manifests/hexa-hover.toml"), "--set", &set];
        place.call(&check).with_code(2).says(&told);
    }
}

/// Rotors that are all in front, two of them in one place.
#[test]
fn rotors_that_leave_a_torque_in_hover_are_refused_with_all_that_is_odd() {
    let place = Place::new();
    let text = std::fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    let text = ["[0.17, 0, 0]", "[0, -0.17, 0]", "[-0.17, 0, 0]", "[0, 0.17, 0]"]
        .into_iter()
        .zip(["[0.4, 0, 0]", "[0.2, -0.17, 0]", "[0.4, 0, 0]", "[0.2, 0.17, 0]"])
        .fold(text, |text, (from, to)| {
            text.replacen(&format!("value = {from}"), &format!("value = {to}"), 1)
        });
    let (head, rotors) = text.split_once("[[rotors]]").unwrap();
    let (front, others) = rotors.split_at(rotors.find("[[rotors]]").unwrap());
    let vehicle = format!("{head}[[rotors]]{}{others}", front.replace("\"clockwise", "\"counter-clockwise"));
    let vehicle = place.write("ahead.toml", vehicle);
    let sets = ["plant", "controller"].map(|process| format!("process.{process}.vehicle={vehicle}"));
    let check = ["check", &repository("manifests/hover.toml"), "--set", &sets[0], "--set", &sets[1]];
    let ended = place.call(&check).with_code(2);
    ended.says(&[
        "its 4 working rotors of 4 cannot hover",
        "a pitch torque remains unbalanced",
        "ahead.toml:",
    ]);
    ended.says(&["warning: ", "its rotors \"front\" and \"rear\" in one place"]);
}

/// The hexacopter whose neighbours turn alike in two pairs, with `line` in the table of its rotor `left`. From that rotor on,
/// counter-clockwise seen from above, it has P P N N P N, and flies on without one of the first four.
pub fn hexacopter_of_pairs(place: &Place, line: &str) -> String {
    let vehicle = hexacopter_with(place, line);
    let text = std::fs::read_to_string(&vehicle).unwrap();
    let mut document: toml_edit::DocumentMut = text.parse().unwrap();
    let spins = [
        ("left", "counter-clockwise"),
        ("rear left", "counter-clockwise"),
        ("rear right", "clockwise"),
        ("right", "clockwise"),
        ("front right", "counter-clockwise"),
        ("front left", "clockwise"),
    ];
    for rotor in document["rotors"].as_array_of_tables_mut().unwrap().iter_mut() {
        let name = rotor["name"].as_str().unwrap().to_owned();
        rotor["spin"]["value"] = toml_edit::value(spins.iter().find(|spin| spin.0 == name).unwrap().1);
    }
    std::fs::write(&vehicle, document.to_string()).unwrap();
    vehicle
}

/// With neighbours that turn alike the others take over, and it flies on.
#[test]
fn a_hexacopter_whose_spins_allow_it_flies_on_without_a_rotor() {
    let place = Place::new();
    let vehicle = hexacopter_of_pairs(&place, FAILED);
    let recording = place.path("flight.mcap");
    let [plant, controller] =
        ["plant", "controller"].map(|process| format!("process.{process}.vehicle={vehicle}"));
    let manifest = repository("manifests/hexa-hover.toml");
    composed(&place, &manifest, &recording, &[&plant, &controller]).flown();
    let states = rows(&recording, "/plant/state");
    assert!(states.iter().all(|state| state.get("rotor_speed[1]") == 0.0));
    let last = states.last().unwrap();
    assert!((last.get("position.z") - 1.5).abs() < 0.05, "{last:?}");
    let tilt = libm::hypot(last.get("attitude.x"), last.get("attitude.y"));
    assert!(tilt < 0.01 && last.get("attitude.z").abs() < 0.05, "{last:?}");
}

/// Settings of a vehicle file that make it odd, and the warning.
fn oddities(vehicle: &Vehicle) -> [(Vec<String>, &'static str); 5] {
    let numbers = 0..vehicle.rotors.len();
    let place =
        |number: usize, scale: f64| -> [f64; 3] { (vehicle.rotors[number].position_m * scale).into() };
    let arm_m = vehicle.rotors[0].position_m.norm();
    let far = |number: usize| format!("rotors.{number}.position.value={:?}", place(number, 88.0 / arm_m));
    let moments = ["xx", "yy", "zz"].map(|axis| format!("body.inertia_{axis}.value=2.0"));
    let slow: &[&str] = match vehicle.motor {
        MotorModel::FirstOrder { .. } => &["motor.time_constant.value=25.0"],
        MotorModel::SecondOrder { .. } => {
            &["motor.natural_frequency.value=0.04", "motor.damping_ratio.value=1.0"]
        }
    };
    [
        (numbers.clone().map(far).collect(), "has arms of 88 m"),
        (vec![format!("rotors.1.position.value={:?}", place(0, 1.0))], "in one place"),
        (
            numbers.map(|number| format!("rotors.{number}.spin.value=clockwise")).collect(),
            "rotors that all turn one way",
        ),
        (
            [&moments[..], &["body.mass.value=0.5".to_owned()]].concat(),
            "has a moment of inertia of 2.0000e0 kg*m^2 at 0.5000 kg",
        ),
        (slow.iter().map(|&set| set.to_owned()).collect(), "has motors that take 25.0000 s to follow"),
    ]
}

#[test]
fn what_is_odd_about_a_quadrotor_and_a_hexacopter_is_told_by_check() {
    let place = Place::new();
    for (manifest, vehicle) in [("hover", "hummingbird"), ("hexa-hover", "dji-f550")] {
        let manifest = repository(&format!("manifests/{manifest}.toml"));
        let vehicle = load(&repository(&format!("vehicles/{vehicle}.toml")));
        for (settings, told) in oddities(&vehicle) {
            let sets: Vec<_> =
                settings.iter().map(|setting| format!("process.plant.vehicle.{setting}")).collect();
            let sets = sets.iter().flat_map(|set| ["--set", set]);
            let args: Vec<&str> = ["check", &manifest].into_iter().chain(sets).collect();
            let ended = place.call(&args).with_code(0);
            ended.says(&["warning: ", &format!("`vehicle` \"{}\" ", vehicle.name), told]);
        }
        assert_eq!(place.call(&["check", &manifest]).with_code(0).error, "");
    }
}
