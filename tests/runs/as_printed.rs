//! What the thesis prints: flown by manifests/thesis, whose controllers alone are told the truth; docs/as-printed.md.

use crate::manifests::graph;
use crate::scenarios::{TRUTHS, readers_of};
use crate::support::{Place, repository};
use hummingbus::{Host, Launcher, Manifest};
use std::fs;

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
    for name in ["hover", "hover-estimated", "take-off", "propeller"] {
        let (place, path) = (Place::new(), repository(&format!("manifests/thesis/{name}.toml")));
        let ended = place.call(&["run", &path, "--record", &place.path("flight.mcap")]);
        assert_eq!(ended.code, Some(0), "{ended}");
    }
}

/// Every other file that is shipped leaves the kind `ideal` alone.
#[test]
fn the_truth_as_an_estimate_is_flown_by_what_the_thesis_prints_and_by_nothing_else() {
    for name in ["hover", "take-off"] {
        let told = readers_of(&graph(&repository(&format!("manifests/thesis/{name}.toml")), &[]), &TRUTHS);
        let expected = ["ideal", "imu", "recorder"].map(str::to_owned);
        assert!(expected.iter().all(|kind| told.contains(kind)) && told.len() == 3, "{name}: {told:?}");
    }
    let mut count = 0;
    for folder in ["manifests", "manifests/sets", "manifests/identify", "manifests/rig-delay"] {
        for entry in fs::read_dir(repository(folder)).unwrap().map(|entry| entry.unwrap().path()) {
            if entry.extension().is_some_and(|end| end == "toml") && !entry.ends_with("sets/printed.toml") {
                count += 1;
                assert!(!fs::read_to_string(&entry).unwrap().contains("\"ideal\""), "{}", entry.display());
            }
        }
    }
    assert!(count > 25, "found only {count}");
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
fn the_printed_roll_sign_tumbles_and_d_as_the_arm_halves_the_loops() {
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
