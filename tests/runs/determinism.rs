//! A run is a function of its manifest: the same file, byte for byte, however it is flown.

use crate::recordings::{open, require_same, rows, topics};
use crate::skipped::{cases, first};
use crate::support::{Load, Place, repository};
use std::fs;
use std::sync::OnceLock;

const PROCESSES: [&str; 7] = ["controller", "ekf", "imu", "mocap", "pilot", "plant", "recorder"];

/// Flies hover.toml for `duration_s` with `more` arguments; returns the recording.
fn hover(place: &Place, duration_s: u32, more: &[&str]) -> String {
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("hover.mcap"));
    let duration = format!("run.duration_s={duration_s}");
    let args = ["run", &manifest, "--record", &recording, "--set", &duration];
    place.call(&[&args, more].concat()).flown();
    recording
}

/// The recording of hover.toml for 2 s and for 3 s, flown once.
fn reference(duration_s: u32) -> &'static [u8] {
    static RECORDINGS: [OnceLock<Vec<u8>>; 2] = [const { OnceLock::new() }; 2];
    RECORDINGS[duration_s as usize - 2]
        .get_or_init(|| fs::read(hover(&Place::new(), duration_s, &[])).unwrap())
}

/// Requires that hover.toml flown with `more` arguments gives the reference's file.
#[track_caller]
fn require_reference(duration_s: u32, more: &[&str]) {
    let place = Place::new();
    require_same(reference(duration_s), &hover(&place, duration_s, more));
}

/// `--set process.<each>.<key>=<value>` for every process.
fn set_each(key: &str, value: impl Fn(usize) -> String) -> Vec<String> {
    let set = |(index, name)| format!("--set=process.{name}.{key}={}", value(index));
    PROCESSES.iter().enumerate().map(set).collect()
}

fn borrowed(args: &[String]) -> Vec<&str> {
    args.iter().map(String::as_str).collect()
}

#[test]
fn two_runs_give_the_same_file() {
    let (one, other) = (Place::new(), Place::new());
    require_same(&fs::read(hover(&one, 10, &[])).unwrap(), &hover(&other, 10, &[]));
}

#[test]
fn the_recording_is_the_same_at_any_pace() {
    let paces = [["--pace", "4"], ["--pace", "realtime"], ["--set", "run.pace=1000"]];
    for more in first(1, "paces", paces) {
        require_reference(2, &more);
    }
}

#[test]
fn the_recording_is_the_same_with_any_window() {
    let is_quick = |window: &str| ["1", "4096"].contains(&window);
    for window in cases("windows", ["1", "2", "3", "64", "1000", "4096"], |window| is_quick(window)) {
        require_reference(3, &["--window", window]);
    }
}

#[test]
fn the_recording_is_the_same_with_any_window_at_a_pace() {
    for window in ["1", "7"] {
        require_reference(2, &["--window", window, "--pace", "8"]);
    }
}

#[test]
fn the_recording_is_the_same_in_any_start_order() {
    for seed in first(2, "orders", 1..=4) {
        require_reference(3, &["--set", &format!("run.start_order_seed={seed}")]);
    }
}

#[test]
fn the_recording_is_the_same_however_processes_wait() {
    // The last flight has all of them; more processes than cores that spin take long.
    for wait in cases("ways to wait", ["block", "adaptive", "spin"], |wait| *wait == "adaptive") {
        require_reference(2, &borrowed(&set_each("wait", |_| wait.to_owned())));
    }
    let mixed = set_each("wait", |index| ["spin", "block", "adaptive"][index % 3].to_owned());
    require_reference(2, &borrowed(&mixed));
}

#[test]
fn the_recording_is_the_same_on_any_core() {
    let ways = [
        set_each("cpu", |_| "0".to_owned()),
        set_each("cpu", |index| (index % 2).to_string()),
        vec!["--set=process.plant.cpu=1".to_owned()],
        vec!["--set=run.clock_cpu=0".to_owned(), "--set=process.recorder.cpu=0".to_owned()],
    ];
    for more in first(1, "placements", ways) {
        require_reference(3, &borrowed(&more));
    }
}

#[test]
fn the_recording_is_the_same_on_a_loaded_machine() {
    let _load = Load::of_threads(4);
    for more in first(1, "paces", [&["--pace", "4"][..], &[]]) {
        require_reference(3, more);
    }
}

#[test]
fn the_recording_is_the_same_wherever_the_manifest_lies() {
    let place = Place::new();
    for folder in ["manifests", "vehicles"] {
        fs::create_dir(place.path(folder)).unwrap();
    }
    for file in ["manifests/hover.toml", "vehicles/hummingbird.toml"] {
        fs::copy(repository(file), place.path(file)).unwrap();
    }
    place.call(&["run", &place.path("manifests/hover.toml"), "--set", "run.duration_s=2"]).flown();
    require_same(reference(2), &place.path("manifests/hover.mcap"));
}

#[test]
fn runs_side_by_side_do_not_meet() {
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let recordings = ["a", "b", "c"].map(|name| place.path(name));
    let launches = recordings
        .each_ref()
        .map(|path| place.start(&["run", &manifest, "--record", path, "--set", "run.duration_s=3"]));
    for launch in launches {
        launch.end_among_others().flown();
    }
    recordings.iter().for_each(|recording| require_same(reference(3), recording));
}

#[test]
fn another_seed_gives_another_file_and_diff_names_the_first_difference() {
    let place = Place::new();
    let other = hover(&place, 3, &["--set", "run.seed=2"]);
    let reference = place.write("reference.mcap", reference(3));
    let ended = place.call(&["diff", &reference, &other]).with_code(1);
    let (tick, topic, field, values) = first_difference(&reference, &other);
    let expected =
        format!("tick {tick}, topic {topic}, field {field}: {:?} against {:?}", values[0], values[1]);
    assert_eq!(ended.output.trim_end(), expected);
}

/// The first difference by tick, then topic, found without the project's own comparison.
fn first_difference(a: &str, b: &str) -> (u32, String, String, [f64; 2]) {
    let (left, right) = (topics(a), topics(b));
    let differing = left.iter().filter_map(|(topic, messages)| {
        let mut pairs = messages.iter().zip(&right[topic]);
        pairs.find(|(a, b)| a != b).map(|(a, _)| (a.tick, topic.clone()))
    });
    let (tick, topic) = differing.min().unwrap();
    let of_tick = |path| rows(path, &topic).into_iter().find(|row| row.tick == tick).unwrap();
    let (left, right) = (of_tick(a), of_tick(b));
    let recording = open(a);
    let record = recording.messages().map(Result::unwrap).find(|record| record.topic == topic);
    let leaves = recording.decode(&record.unwrap()).unwrap();
    let field = leaves.into_iter().map(|leaf| leaf.path).find(|path| left.get(path) != right.get(path));
    let field = field.unwrap();
    let values = [left.get(&field), right.get(&field)];
    (tick, topic, field, values)
}

#[test]
fn a_recording_is_identical_to_itself() {
    let place = Place::new();
    let (a, b) = (place.write("a.mcap", reference(2)), place.write("b.mcap", reference(2)));
    let ended = place.call(&["diff", &a, &b]).with_code(0);
    assert_eq!(ended.output, "identical\n");
}

#[test]
fn another_sensor_changes_no_other_noise() {
    let place = Place::new();
    let text = fs::read_to_string(repository("manifests/hover.toml")).unwrap();
    let text = text.replace("../vehicles", &repository("vehicles"));
    let second = "\n[process.imu2]\nkind = \"imu\"\ninputs.state = \"/plant/state\"\n";
    place.write("one.toml", &text);
    place.write("two.toml", text + second);
    for name in ["one.toml", "two.toml"] {
        place.call(&["run", &place.path(name), "--set", "run.duration_s=3"]).flown();
    }
    let cat = |name, topic| place.call(&["cat", &place.path(name), "--topic", topic]).with_code(0).output;
    for topic in ["/plant/state", "/imu/imu", "/controller/command"] {
        assert!(cat("one.mcap", topic) == cat("two.mcap", topic), "{topic} differs");
    }
    let noise = |topic| rows(&place.path("two.mcap"), topic)[0].vector("specific_force");
    assert_ne!(noise("/imu/imu"), noise("/imu2/imu"), "the two sensors share their noise");
}
