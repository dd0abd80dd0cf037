//! Refused: files that are not there, with those that were probably meant, and folders and patterns in the place of a file.

use crate::refusals::good;
use crate::support::{Place, repository};
use std::fs;

#[test]
fn a_file_with_a_near_name_is_told_whatever_it_is() {
    let place = Place::new();
    let manifest = place.write("hover.toml", good());
    let recording = place.write("hover.mcap", "none");
    let vehicle =
        place.write("bird.toml", fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap());
    let refused = |args: &[&str], meant: &str| {
        let meant = format!("`{meant}`");
        place.call(args).with_code(2).says(&["No such file or directory (did you mean ", &meant]);
    };
    refused(&["check", &place.path("hovr.toml")], &manifest);
    refused(&["run", &place.path("hover.tml")], &manifest);
    refused(&["cat", &place.path("hovver.mcap")], &recording);
    refused(&["diff", &place.path("hover.csv"), &recording], &recording);
    refused(&["identify", &place.path("hovr.toml"), "--out", &place.path("out")], &manifest);
    let set = |value: &str| format!("process.plant.vehicle={}", place.path(value));
    refused(&["check", &manifest, "--set", &set("brid.toml")], &vehicle);
    let lost = good().replace(&repository("vehicles/hummingbird.toml"), "bird.tom");
    refused(&["check", &place.write("lost.toml", lost)], &vehicle);
}

#[test]
fn gains_scenes_and_logs_are_told_too() {
    let place = Place::new();
    let refused = |manifest: &str, key: &str, (named, meant): (&str, &str)| {
        let set = format!("{key}={}", repository(named));
        let asked = format!("did you mean `{}`?", repository(meant));
        let manifest = repository(&format!("manifests/{manifest}.toml"));
        place.call(&["check", &manifest, "--set", &set]).with_code(2).says(&[&asked]);
    };
    let gains = ("controllers/gains/cascad.toml", "controllers/gains/cascade.toml");
    refused("hover", "process.controller.gains", gains);
    refused("hover-rapier", "process.plant.scene", ("scenes/labyrint.toml", "scenes/labyrinth.toml"));
    let data = place.write("flight.csv", "t\n0\n");
    let set = format!("process.player.data={}", place.path("flight.mcap"));
    let replay = repository("manifests/replay-nanobench.toml");
    let ended = place.call(&["check", &replay, "--set", &set]).with_code(2);
    ended.says(&[&format!("did you mean `{data}`?")]);
}

#[test]
fn a_folder_in_the_place_of_a_file_is_told_as_one() {
    let place = Place::new();
    let folder = place.path("flights");
    fs::create_dir(&folder).unwrap();
    let out = place.path("out");
    let commands: [&[&str]; 6] = [
        &["cat", &folder],
        &["diff", &folder, &folder],
        &["check", &folder],
        &["run", &folder],
        &["identify", &folder, "--out", &out],
        &["identify", "rotor", &folder, "--out", &out],
    ];
    for args in commands {
        let ended = place.call(args).with_code(2);
        ended.says(&[&folder, "it is a folder; give the name of one file in it"]);
    }
}

#[test]
fn a_pattern_is_told_as_one_whether_a_file_fits_or_not() {
    let place = Place::new();
    let [a, b] = ["a.mcap", "b.mcap"].map(|name| place.write(name, "none"));
    place.call(&["cat", &place.path("*.csv")]).with_code(2).says(&["no file fits this pattern"]);
    // As a shell passes them on.
    place.call(&["cat", &a, &b]).with_code(2).says(&[&b, "one file more than the command takes", "`*`"]);
    let other = place.call(&["cat", &a, "missing"]).with_code(2);
    assert!(!other.error.contains("one file more"), "{other}");
}
