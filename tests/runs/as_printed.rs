//! Flights as the thesis prints them: manifests/thesis, whose controllers alone are told the truth; docs/as-printed.md.

use crate::manifests::graph;
use crate::scenarios::{TRUTHS, kind, nodes, readers_of};
use crate::support::{Place, repository};
use hummingbus::{Host, Launcher, Manifest};
use std::fs;
use std::path::{Path, PathBuf};

fn of_the_thesis(name: &str) -> Manifest {
    hummingbus::load(repository(&format!("manifests/thesis/{name}.toml"))).unwrap()
}

/// The heights (m) and rolls of a flight of a manifest, sample by sample.
fn flown(manifest: &Manifest) -> [Vec<f64>; 2] {
    let place = Place::new();
    let launcher = Launcher::new(Host::InProcess);
    let (_, recording) = launcher.fly(manifest, place.path("flight.mcap").as_ref()).unwrap();
    let fields = ["position.z", "attitude.roll"].map(|field| ("/plant/state", field));
    let mut series = recording.unwrap().series(&fields).unwrap().into_iter();
    [(); 2].map(|()| series.next().unwrap().value)
}

#[test]
fn the_family_flies_as_its_conditions_say() {
    for name in
        ["hover", "hover-estimated", "take-off", "propeller", "propeller-steps", "propeller-steps-noisy"]
    {
        let (place, path) = (Place::new(), repository(&format!("manifests/thesis/{name}.toml")));
        let ended = place.call(&["run", &path, "--record", &place.path("flight.mcap"), "--compose", "all"]);
        assert_eq!(ended.code, Some(0), "{ended}");
    }
}

/// Files that `check` refuses: parts that manifests include, and files that are not manifests.
const NO_MANIFESTS: [&str; 17] = [
    "identify/course.toml",
    "identify/flight.toml",
    "identify/rig-gains.toml",
    "rig-delay/answer.toml",
    "rig-delay/late.toml",
    "sets/flight.toml",
    "sets/hover-set.toml",
    "sets/printed.toml",
    "sets/room-set.toml",
    "sets/room.toml",
    "sets/stick-set.toml",
    "sets/take-off.toml",
    "sets/wall-stand.toml",
    // They fly programs that are built first.
    "cpp-controller.toml",
    "custom-controller.toml",
    "fmu-controller.toml",
    "swap-cpp.toml",
];

/// The files below a folder, by their paths from it.
fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect()
}

#[test]
fn the_truth_as_an_estimate_is_flown_by_what_the_thesis_prints_and_by_nothing_else() {
    for name in ["hover", "take-off"] {
        let told = readers_of(&graph(&repository(&format!("manifests/thesis/{name}.toml")), &[]), &TRUTHS);
        let expected = ["ideal", "imu", "recorder"].map(str::to_owned);
        assert!(expected.iter().all(|kind| told.contains(kind)) && told.len() == 3, "{name}: {told:?}");
    }
    let (folder, place) = (PathBuf::from(repository("manifests")), Place::new());
    let (mut refused, mut count) = (Vec::new(), 0);
    for file in files_below(&folder) {
        let name = file.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned();
        // Campaign and tuning files name manifests; those of firmware need a program that is not shipped.
        let is_other =
            ["thesis/", "campaigns/", "tune/", "autopilots/"].iter().any(|folder| name.starts_with(folder));
        if !name.ends_with(".toml") || is_other {
            continue;
        }
        let checked = place.call(&["check", file.to_str().unwrap(), "--json", "--no-programs"]);
        if checked.code == Some(0) {
            count += 1;
            assert!(nodes(&checked.json()).all(|node| kind(node) != "ideal"), "{name} flies the truth");
        } else {
            refused.push(name);
        }
    }
    assert!(count > 40, "looked at {count} only");
    refused.retain(|name| !NO_MANIFESTS.contains(&name.as_str()));
    assert!(refused.is_empty(), "`check` refuses {refused:?}");
}

#[test]
fn the_familys_gains_are_those_of_table_5_1() {
    let read = |path: &str| fs::read_to_string(repository(path)).unwrap().parse::<toml::Table>().unwrap();
    let set = read("manifests/sets/printed.toml");
    let flown = &set["process"]["controller"]["parameters"]["gains"];
    let table = read("controllers/gains/pid-thesis.toml");
    for axis in ["altitude", "roll", "pitch"] {
        for (key, of_file) in [
            ("proportional_1_s2", "proportional"),
            ("integral_1_s3", "integral"),
            ("derivative_1_s", "derivative"),
        ] {
            let printed = table[axis][of_file]["value"].as_integer().unwrap();
            assert_eq!(flown[axis][key].as_float(), Some(printed as f64), "{axis} {key}");
        }
    }
}

#[test]
fn the_printed_motor_gain_leaves_no_thrust_that_comes_down() {
    let manifest = of_the_thesis("hover").set("run.duration_s", 2.0).unwrap();
    let hover = toml::toml! { command = [2.2728, 2.2728, 2.2728, 2.2728] };
    let manifest = manifest.set("process.plant.inputs.command.initial", hover).unwrap();
    let vehicle = repository("vehicles/printed/motor-gain.toml");
    let [height_m, _] = flown(&manifest.set("process.plant.vehicle", vehicle).unwrap());
    assert!(height_m[2000 - 1] > 50.0, "{} m after 2 s", height_m[2000 - 1]);
}

#[test]
fn the_printed_roll_sign_tumbles_and_d_as_the_arm_overshoots_by_more() {
    let with = |file: &str| {
        let vehicle = repository(&format!("vehicles/printed/{file}.toml"));
        let short = of_the_thesis("hover").set("run.duration_s", 7.5).unwrap();
        short.set("process.controller.vehicle", vehicle).unwrap()
    };
    let most_deg = |manifest: &Manifest| {
        let [_, roll_rad] = flown(manifest);
        roll_rad.iter().fold(0.0, |most: f64, roll| most.max(roll.abs())).to_degrees()
    };
    assert!(most_deg(&with("roll-sign")) > 90.0);
    let (wide, right) = (most_deg(&with("arm")), most_deg(&with("../hummingbird")));
    assert!(wide < 20.0 && wide > right + 0.5, "{wide} deg with d, {right} deg with the arm");
}
