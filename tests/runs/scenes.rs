//! Runs in a scene: ground, walls, rigs and other vehicles.

use crate::recordings;
use crate::refusals::{good, refused, refused_text};
use crate::skipped::is_left;
use crate::support::{Place, repository};
use bus::messages::{Contact, PlantState, Traffic};
use std::collections::{BTreeMap, BTreeSet};

/// The good manifest's plant on the backend `rapier`, with `more` of its keys.
fn in_rapier(more: &str) -> String {
    good().replace("kind = \"plant\"", &format!("kind = \"plant\"\nparameters.backend = \"rapier\"\n{more}"))
}

#[test]
fn the_hover_is_flown_on_rapier_and_twice_it_is_the_same_file() {
    if is_left("`scenarios::hover_and_doublet_on_both_backends` flies it, `compose` compares files") {
        return;
    }
    let place = Place::new();
    let (manifest, backend) = (repository("manifests/hover.toml"), "process.plant.parameters.backend=rapier");
    let [first, second] = ["first.mcap", "second.mcap"].map(|name| {
        let path = place.path(name);
        place.call(&["run", &manifest, "--set", backend, "--record", &path]).with_code(0);
        path
    });
    place.call(&["diff", &first, &second]).with_code(0);
}

#[test]
fn a_load_that_is_carried_is_the_same_file_twice() {
    let (place, manifest) = (Place::new(), repository("manifests/slung-load.toml"));
    let [first, second] = ["first.mcap", "second.mcap"].map(|name| {
        let path = place.path(name);
        let cut = ["--set", "run.duration_s=3"];
        place.call(&[&["run", &manifest, "--record", &path][..], &cut].concat());
        path
    });
    place.call(&["diff", &first, &second]).with_code(0);
}

#[test]
fn free_bodies_are_refused_where_nobody_could_say_where_they_are() {
    let place = Place::new();
    let with = |file: &str, more: &[&str]| {
        let manifest = repository(&format!("manifests/{file}.toml"));
        let ended = place.call(&[&["check", &manifest][..], more].concat());
        (ended.code, ended.error)
    };
    let cases: [(&str, &[&str], &[&str]); 5] = [
        ("slung-load", &["--set", "process.plant.parameters.backend=newton-euler"], &["`contact`", "rapier"]),
        ("slung-load", &["--set", "process.plant.parameters.initial_position_m=[0,0,0]"], &[]),
        (
            "workshop",
            &["--set", "process.plant.parameters.initial_position_m=[2.05,-0.1,1]"],
            &["workshop", "door", "vehicle"],
        ),
        ("workshop", &["--set", "process.range.inputs={ state = '/plant/state' }"], &["range", "`bodies`"]),
        ("hover-rapier", &["--set", "process.plant.outputs.bodies={}"], &["`bodies`", "mass"]),
    ];
    for (file, more, told) in cases {
        let (code, stderr) = with(file, more);
        assert_eq!(code == Some(0), told.is_empty(), "{file} {more:?}: {stderr}");
        assert!(told.iter().all(|word| stderr.contains(word)), "{file} {more:?}: {stderr}");
    }
}

#[test]
fn two_vehicles_that_share_a_room_meet() {
    let place = Place::new();
    let vehicle = |name: &str, x_m: f64, speed_m_s: f64| {
        format!(
            r#"
[[vehicle]]
name = "{name}"
set = "hummingbird"
process.plant.parameters.initial_position_m = [{x_m:?}, 0.0, 1.0]
process.plant.parameters.initial_velocity_m_s = [{speed_m_s:?}, 0.0, 0.0]

[[pass]]
name = "{name} is met at 2 m/s"
topic = "/{name}/plant/contact"
field = "impact_speed"
unit = "m/s"
statistic = "max"
min = 1.9
max = 2.1
"#
        )
    };
    let text = format!(
        r#"include = ["{set}"]

[run]
duration_s = 1.0

[process.traffic]
kind = "traffic"
inputs = {{ h1 = "/h1/plant/state", h2 = "/h2/plant/state" }}

[process.recorder]
kind = "recorder"

[set.hummingbird.process.plant]
scene = "{room}"
parameters.backend = "rapier"
inputs.traffic = {{ topic = "/traffic/traffic", delay_ticks = 1, initial = {{ count = 0 }} }}
outputs.contact = {{}}
{first}{second}"#,
        set = repository("manifests/sets/hover-set.toml"),
        room = repository("scenes/room.toml"),
        first = vehicle("h1", -0.5, 1.0),
        second = vehicle("h2", 0.5, -1.0),
    );
    let path = place.write("meet.toml", text);
    place.call(&["run", &path]).with_code(0);
}

/// Numbers of the two of [`twenty`] that fly towards each other.
const PAIR: [usize; 2] = [18, 19];

/// Start of vehicle `number`, and its speed along x: the pair 1 m from each other at 1 m/s, the others 2 m apart on a grid.
fn start_of(number: usize) -> ([f64; 3], f64) {
    match number {
        18 => ([2.5, 3.0, 1.0], 1.0),
        19 => ([3.5, 3.0, 1.0], -1.0),
        _ => ([2.0 * (number % 5) as f64 - 4.0, 2.0 * (number / 5) as f64 - 3.0, 1.0], 0.0),
    }
}

/// Twenty vehicles of the hover's set in the room of the thesis, each with its own estimator and controller. The world of each has the
/// others.
fn twenty() -> String {
    let vehicle = |number: usize| {
        let (position, speed_m_s) = start_of(number);
        format!(
            r#"
[[vehicle]]
name = "v{number:02}"
set = "hummingbird"
process.plant.parameters.initial_position_m = {position:?}
process.plant.parameters.initial_velocity_m_s = [{speed_m_s:?}, 0.0, 0.0]
process.ekf.parameters.initial_position_m = {position:?}
"#
        )
    };
    let inputs: Vec<String> =
        (0..20).map(|number| format!("v{number:02} = \"/v{number:02}/plant/state\"")).collect();
    format!(
        r#"include = ["{set}"]

[run]
duration_s = 0.8

[process.traffic]
kind = "traffic"
inputs = {{ {inputs} }}

[set.hummingbird.process.plant]
scene = "{room}"
parameters.backend = "rapier"
inputs.traffic = {{ topic = "/traffic/traffic", delay_ticks = 1, initial = {{ count = 0 }} }}
outputs.contact = {{}}
{vehicles}"#,
        set = repository("manifests/sets/hover-set.toml"),
        inputs = inputs.join(", "),
        room = repository("scenes/room.toml"),
        vehicles = (0..20).map(vehicle).collect::<String>(),
    )
}

#[test]
fn of_twenty_vehicles_that_share_a_room_two_meet_as_far_as_the_shape_reaches() {
    // Twice the radius of the disc around all propellers: an arm of 0.17 m and a propeller of 0.1016 m.
    const MEET_M: f64 = 2.0 * 0.2716;
    // Both move on by a part of a tick, at up to 3 m/s from each other.
    const WITHIN_M: f64 = 5e-3;
    let place = Place::new();
    let manifest = hummingbus::load(place.write("twenty.toml", twenty())).unwrap();
    let mut simulation = hummingbus::simulate(&manifest).unwrap();
    let topic = |number: usize, port: &str| format!("/v{number:02}/plant/{port}");
    let states: Vec<_> =
        (0..20).map(|number| simulation.topic::<PlantState>(&topic(number, "state")).unwrap()).collect();
    let contacts: Vec<_> =
        (0..20).map(|number| simulation.topic::<Contact>(&topic(number, "contact")).unwrap()).collect();
    let traffic = simulation.topic::<Traffic>("/traffic/traffic").unwrap();
    let (mut met, mut nearest_m) = ([None; 2], f64::INFINITY);
    for tick in 0..800 {
        simulation.step().unwrap();
        let [one, other] = PAIR.map(|number| simulation.newest(states[number]).unwrap().position);
        let apart_m = libm::hypot(libm::hypot(other.x - one.x, other.y - one.y), other.z - one.z);
        nearest_m = nearest_m.min(apart_m);
        for (met, number) in met.iter_mut().zip(PAIR) {
            let contact = simulation.newest(contacts[number]).unwrap();
            if contact.began > 0 && met.is_none() {
                *met = Some((tick, apart_m, contact.object));
            }
        }
    }
    for (met, object) in met.into_iter().zip([1019, 1018]) {
        let (tick, apart_m, met) = met.unwrap_or_else(|| panic!("they do not meet: {nearest_m} m"));
        // 0.4568 m at 2 m/s.
        assert!((215..245).contains(&tick), "they meet at tick {tick}");
        assert!((apart_m - MEET_M).abs() < WITHIN_M, "they meet at {apart_m} m");
        assert_eq!(met, object, "each meets the other");
    }
    assert!(nearest_m > MEET_M - WITHIN_M, "they come as near as {nearest_m} m");
    let seen = simulation.newest(traffic).unwrap();
    assert_eq!(seen.count, 20);
    for number in (0..20).filter(|number| !PAIR.contains(number)) {
        let (state, (start_m, _)) = (simulation.newest(states[number]).unwrap(), start_of(number));
        let off_m =
            [state.position.x - start_m[0], state.position.y - start_m[1], state.position.z - start_m[2]];
        assert!(off_m.iter().all(|off_m| off_m.abs() < 0.2), "v{number:02} is off its place by {off_m:?} m");
        assert!(state.rotor_speed[0] > 100.0, "v{number:02} flies");
        assert_eq!(simulation.newest(contacts[number]).unwrap().began, 0, "v{number:02} touches nothing");
        assert_eq!(<[f64; 3]>::from(seen.position[number]), <[f64; 3]>::from(state.position));
    }
}

#[test]
fn a_vehicle_that_stands_on_the_ground_touches_it_and_one_in_a_rig_hangs() {
    let place = Place::new();
    for (scene, object, height_m) in [("ground", 1.0, 0.06), ("rig-sliding", 0.0, 1.45)] {
        let pass = |topic: &str, field: &str, unit: &str, value: f64| {
            format!(
                "[[pass]]\nname = \"{field}\"\ntopic = \"{topic}\"\nfield = \"{field}\"\nunit = \"{unit}\"\n\
                 statistic = \"every\"\nmin = {:?}\nmax = {:?}\n",
                value - 1e-3,
                value + 1e-3,
            )
        };
        let scene_key =
            format!("scene = \"{}\"\noutputs.contact = {{}}", repository(&format!("scenes/{scene}.toml")));
        let text = in_rapier(&scene_key)
            .replace("[70, 70, 70, 70]", "[1, 1, 1, 1]")
            .replace("initial_altitude_m = 1.0", "initial_altitude_m = 0.0");
        let text = text.replace("to = 1.5", "to = 0.0")
            + &pass("/plant/contact", "object", "1", object)
            + &pass("/plant/state", "position.z", "m", height_m);
        place.call(&["run", &place.write("stand.toml", text)]).with_code(0);
    }
}

#[test]
fn what_free_flight_does_not_know_is_refused() {
    let rig = repository("scenes/rig-fixed.toml");
    refused("kind = \"plant\"", &format!("kind = \"plant\"\nscene = §\"{rig}\""))
        .says(&["holds a rig", "\"rapier\""]);
    refused("kind = \"plant\"", "kind = \"plant\"\nparameters.§crash_speed_m_s = 2.0")
        .says(&["touches nothing"]);
    refused("kind = \"plant\"", "kind = \"plant\"\nparameters.§backend = \"bullet\"").says(&[
        "`backend` must be one of",
        "found `bullet`",
        "`newton-euler`",
        "`rapier`",
    ]);
    let place = Place::new();
    let text = good().replace("kind = \"plant\"", "kind = \"plant\"\noutputs.contact = {}");
    place
        .call(&["run", &place.write("contact.toml", text)])
        .with_code(2)
        .says(&["needs `backend` = \"rapier\""]);
}

#[test]
fn a_start_that_is_no_number_and_a_traffic_of_thirty_three_are_refused() {
    refused("kind = \"plant\"", "kind = \"plant\"\nparameters.initial_yaw_deg = §nan")
        .says(&["initial_yaw_deg"]);
    let inputs: Vec<String> = (0..33).map(|number| format!("h{number} = \"/plant/state\"")).collect();
    let traffic = format!("[process.§traffic]\nkind = \"traffic\"\ninputs = {{ {} }}\n", inputs.join(", "));
    refused_text(&(good() + &traffic)).says(&["at most 32 vehicles"]);
}

/// Viewers draw what a frame's name says: ten bodies under one name would be one that jumps.
#[test]
fn each_of_ten_vehicles_in_one_room_has_a_frame_of_its_own() {
    let (place, manifest) = (Place::new(), repository("manifests/ten-vehicles.toml"));
    let recording = place.path("frames.mcap");
    let tf = r#"set.wall-follower.process.plant.outputs.tf={ topic = "/tf", every_ticks = 10 }"#;
    // Whether it passes does not matter: it is cut short.
    place
        .call(&["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.1", "--set", tf])
        .flown();
    let recording = recordings::open(&recording);
    let (mut frames, mut drawn, mut flown) = (BTreeSet::new(), BTreeMap::new(), BTreeMap::new());
    for record in recording.messages().map(Result::unwrap) {
        let leaves = recording.decode(&record).unwrap();
        let value = |path: &str| leaves.iter().find(|leaf| leaf.path == path).unwrap().value.to_string();
        let position = |path: &str| ["x", "y", "z"].map(|axis| value(&format!("{path}.{axis}")));
        if let Some(vehicle) = record.topic.strip_suffix("/tf") {
            frames.insert((vehicle.to_owned(), value("transforms[0].child_frame_id")));
            let at = position("transforms[0].transform.translation");
            drawn.insert((vehicle.to_owned(), record.tick), at);
        } else if let Some(vehicle) = record.topic.strip_suffix("/plant/state") {
            flown.insert((vehicle.to_owned(), record.tick), position("position"));
        }
    }
    let expected = (0..10).map(|number| (format!("/v{number}"), format!("\"v{number}/body\"")));
    assert_eq!(frames, expected.collect());
    assert_eq!(drawn.len(), 100);
    assert!(drawn.iter().all(|(at, position)| flown[at] == *position), "{drawn:?}");
}
