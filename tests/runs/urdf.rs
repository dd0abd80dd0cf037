//! `hummingbus urdf`: what it prints and writes, and what it refuses without leaving a part of a file.

use crate::laps;
use crate::recordings::open;
use crate::support::{Place, repository};
use std::fs;
use std::path::Path;

#[test]
fn a_file_is_what_is_printed_and_a_recording_tells_the_same_as_its_vehicle_file() {
    let place = Place::new();
    let (vehicle, out) = (repository("vehicles/hummingbird.toml"), place.path("hummingbird.urdf"));
    let printed = place.call(&["urdf", &vehicle]).with_code(0).output;
    assert!(printed.contains("<link name=\"hb_body\">"), "{printed}");
    place.call(&["urdf", &vehicle, "--out", &out]).with_code(0);
    assert_eq!(fs::read_to_string(&out).unwrap(), printed);
    // A file of its own is replaced.
    place.call(&["urdf", &vehicle, "--frame", "other", "--out", &out]).with_code(0);
    assert_eq!(fs::read_to_string(&out).unwrap(), printed.replace("hb_body", "other"));

    let recording = place.path("laps.mcap");
    laps::record(Path::new(&recording), &["h1", "h2"], Some(""));
    let of_recording = place.call(&["urdf", &recording, "--vehicle", "h2"]).with_code(0).output;
    assert_eq!(
        of_recording,
        printed.replace("hb_body", "h2/body"),
        "the frame that the plant of h2 publishes"
    );
}

#[test]
fn files_of_one_name_in_two_folders_are_told_apart() {
    let place = Place::new();
    let vehicle = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    for (folder, mass) in [("a", "0.480"), ("b", "0.960")] {
        fs::create_dir(place.path(folder)).unwrap();
        place.write(
            &format!("{folder}/quad.toml"),
            vehicle.replace("value = 0.480", &format!("value = {mass}")),
        );
    }
    let hover = fs::read_to_string(repository("manifests/hover.toml")).unwrap();
    let (hover, _) = hover.split_once("[[pass]]").unwrap();
    let manifest = hover
        .replace("duration_s = 12.0", "duration_s = 0.05")
        .replacen("../vehicles/hummingbird.toml", "b/quad.toml", 1)
        .replace("../vehicles/hummingbird.toml", "a/quad.toml");
    let (manifest, recording) = (place.write("run.toml", manifest), place.path("run.mcap"));
    place.call(&["run", &manifest, "--record", &recording]).with_code(0);
    let names: Vec<_> = open(&recording).attachments().unwrap().into_iter().map(|(name, _)| name).collect();
    assert_eq!(names.iter().filter(|name| name.ends_with("/quad.toml")).count(), 2, "{names:?}");
    let told = place.call(&["urdf", &recording]).with_code(0).output;
    let heavy = place.call(&["urdf", &place.path("b/quad.toml")]).with_code(0).output;
    assert_eq!(told.replace("hb_body", "body"), heavy.replace("hb_body", "body"), "the vehicle of the plant");
}

#[test]
fn what_is_wrong_is_told_and_no_part_of_a_file_is_left() {
    let place = Place::new();
    let vehicle = repository("vehicles/hummingbird.toml");
    let out = place.path("out.urdf");
    let refused = |args: &[&str], parts: &[&str]| {
        place.call(&[&["urdf"], args].concat()).with_code(2).says(parts);
        assert!(!Path::new(&out).exists(), "{args:?}");
    };
    refused(&["none.toml", "--out", &out], &["none.toml", "No such file"]);
    refused(&[&repository("scenes/room.toml"), "--out", &out], &["room.toml"]);
    refused(&[&vehicle, "--out", "/nowhere/out.urdf"], &["/nowhere/out.urdf", "there is no folder"]);
    refused(&[&vehicle, "--out", "/dev/full"], &["/dev/full", "not a regular file"]);
    refused(&[&vehicle, "--frame", "", "--out", &out], &["--frame"]);
    refused(&[&vehicle, "--vehicle", "h1", "--out", &out], &["--vehicle h1"]);
    let pointless = fs::read_to_string(&vehicle).unwrap().replace("0.17", "0");
    let pointless = place.write("pointless.toml", pointless);
    refused(&[&pointless, "--out", &out], &["pointless.toml", "in one place"]);

    let letter = place.write("letter.txt", "a letter");
    refused(&[&vehicle, "--out", &letter], &["no URDF file of hummingbus"]);
    assert_eq!(fs::read_to_string(&letter).unwrap(), "a letter");
    let copy = place.write("copy.toml", fs::read(&vehicle).unwrap());
    refused(&[&copy, "--out", &copy], &["is what is read"]);

    let recording = place.path("laps.mcap");
    laps::record(Path::new(&recording), &["h1"], None);
    refused(&[&recording, "--out", &out], &["laps.mcap", "name the vehicle file"]);
    let left: Vec<_> =
        fs::read_dir(place.path("")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().starts_with(".hummingbus-")), "{left:?}");
}
