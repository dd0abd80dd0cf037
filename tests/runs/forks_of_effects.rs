//! Forks whose vehicle has other effects than the flight before: those that are new begin, and the rest goes on.

use crate::checkpoints::{HOSTS, require_goes_on};
use crate::skipped::first;
use crate::support::{Place, repository};
use std::fs;

/// An effect that the flights do not have, at a value that does nothing, and at one that counts.
const WEAK: [&str; 2] = [
    "process.plant.vehicle.effects.weak-rotor.loss_1={ value = 0, unit = \"1\" }",
    "process.plant.vehicle.effects.weak-rotor.loss_1={ value = 0.1, unit = \"1\" }",
];
/// Another one, beside which nothing feels the air.
const WIND: &str = "process.plant.vehicle.effects.wind.x={ value = 3, unit = \"m/s\" }";

/// Flies a manifest up to a checkpoint at 1 s and beyond; returns the checkpoint and the recording `name`.
fn flown(place: &Place, manifest: &str, name: &str, set: &[&str]) -> [String; 2] {
    let record = place.path(&format!("{name}.mcap"));
    let args = ["run", manifest, "--record", &record, "--in-process", "--checkpoint-every", "1s"];
    place.call(&[&args[..], &["--set", "run.duration_s=1.4"], set].concat()).flown();
    [place.path(&format!("{name}.1000.ckpt")), record]
}

/// With either backend: what else the state of the plant holds goes on.
#[test]
fn an_effect_that_does_nothing_changes_no_message() {
    let place = Place::new();
    for name in ["hover", "slung-load", "take-off"] {
        let manifest = repository(&format!("manifests/{name}.toml"));
        let ([file, whole], fork) = (flown(&place, &manifest, name, &[]), place.path("fork.mcap"));
        for host in first(1, "hosts", HOSTS) {
            let args = ["run", "--from", &file, "--record", &fork, "--set", WEAK[0], "--set", WIND];
            // The air moves beside a vehicle that does not feel it.
            let args = if name == "hover" { &args[..] } else { &args[..7] };
            place.call(&[args, host].concat()).flown();
            require_goes_on(&place, &whole, &fork, 1000);
        }
    }
}

/// As if the flight had it from the start at a value that does nothing.
#[test]
fn an_effect_begins_in_a_fork() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let [without, whole] = flown(&place, &hover, "without", &[]);
    let [with, _] = flown(&place, &hover, "with", &["--set", WEAK[0]]);
    let forks = ["a", "b"].map(|name| place.path(&format!("{name}.mcap")));
    for (file, fork) in [without, with].iter().zip(&forks) {
        let args = ["run", "--from", file, "--record", fork, "--in-process", "--set", WEAK[1]];
        place.call(&args).flown();
    }
    place.call(&["diff", "--tolerance", "0", &forks[0], &forks[1]]).with_code(0);
    place.call(&["diff", &whole, &forks[0]]).with_code(1).prints(&["tick 1000, topic /"]);
}

#[test]
fn an_effect_ends_in_a_fork() {
    let place = Place::new();
    let vehicle = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    let plain = place.write("plain.toml", &vehicle);
    let effect = "[[effects]]\nname = \"weak-rotor\"\nloss_1 = { value = 0, unit = \"1\", source = \"a test\", uncertainty = \"not stated\" }\n";
    let weak = place.write("weak.toml", format!("{vehicle}\n{effect}"));
    let hover = fs::read_to_string(repository("manifests/hover.toml")).unwrap();
    let hover = hover.replacen("../vehicles/hummingbird.toml", &weak, 1);
    let hover = hover.replace("../vehicles", &repository("vehicles"));
    let manifest = place.write("m.toml", hover);
    let [file, whole] = flown(&place, &manifest, "weak", &[]);
    let (fork, set) = (place.path("fork.mcap"), format!("process.plant.vehicle={plain}"));
    for host in HOSTS {
        place.call(&[&["run", "--from", &file, "--record", &fork, "--set", &set][..], host].concat()).flown();
        require_goes_on(&place, &whole, &fork, 1000);
    }
}

#[test]
fn another_backend_is_refused_in_words() {
    let place = Place::new();
    let [file, _] = flown(&place, &repository("manifests/hover.toml"), "a", &[]);
    let set = "process.plant.parameters.backend=rapier";
    let args = ["run", "--from", &file, "--record", "none", "--in-process", "--set", set];
    place.call(&args).with_code(2).says(&["`plant`", "another backend", "effects may be other ones"]);
}
