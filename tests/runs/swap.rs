//! Contracts of successors: a swap, a shadow, a standby and a restart change what the manifest says and nothing
//! else.

use crate::support::{Ended, Launch, Place, repository};
use recorder::reader::Recording;
use std::fs;
use std::path::Path;

/// hover.toml, cut to 1.5 s, with more tables.
fn hover_with(place: &Place, name: &str, tables: &str) -> String {
    let text =
        format!("include = [{:?}]\n[run]\nduration_s = 1.5\n{tables}", repository("manifests/hover.toml"));
    place.write(name, text)
}

fn fly(place: &Place, manifest: &str, recording: &str) -> Ended {
    place.call(&["run", manifest, "--record", recording, "--json"])
}

/// The undisturbed flight of the same length.
fn undisturbed(place: &Place) -> String {
    let (manifest, recording) = (hover_with(place, "plain.toml", ""), place.path("plain.mcap"));
    fly(place, &manifest, &recording).flown();
    recording
}

/// Every message but those of shadows: topic, tick and bytes.
fn messages(recording: &str) -> Vec<(String, u32, Vec<u8>)> {
    let recording = Recording::open(Path::new(recording)).unwrap();
    let all = recording.messages().map(Result::unwrap);
    all.filter(|record| !record.topic.starts_with("/shadow/"))
        .map(|record| (record.topic, record.tick, record.cdr))
        .collect()
}

fn ticks_of(recording: &str, topic: &str) -> Vec<u32> {
    let recording = Recording::open(Path::new(recording)).unwrap();
    let all = recording.messages().map(Result::unwrap);
    all.filter(|record| record.topic == topic).map(|record| record.tick).collect()
}

const SWAP: &str = "[[swap]]\nprocess = \"controller\"\nat_tick = 700\nshadow_ticks = 50\n";
/// Every loop stiffer, so that the commands differ.
const GAINS: &str = "with.parameters.gains.altitude = { proportional_1_s2 = 16.0, integral_1_s3 = 3.0, \
                     derivative_1_s = 7.0 }\n";

#[test]
fn a_swap_to_an_identical_controller_changes_no_message() {
    let place = Place::new();
    let (manifest, recording) = (hover_with(&place, "swap.toml", SWAP), place.path("swap.mcap"));
    let ended = fly(&place, &manifest, &recording).flown();
    let succession = &ended.json()["successions"][0];
    assert_eq!(succession["take_over_tick"], 700, "{ended}");
    assert_eq!(succession["hand_over"], "state", "{ended}");
    assert!(messages(&recording) == messages(&undisturbed(&place)), "the flights differ");
    assert_eq!(ticks_of(&recording, "/shadow/controller/command"), (650..700).collect::<Vec<u32>>());
}

#[test]
fn the_plant_gets_exactly_one_command_a_tick_throughout() {
    let place = Place::new();
    let swaps = format!("{SWAP}repeat = 4\nevery_ticks = 100\n{GAINS}");
    let (manifest, recording) = (hover_with(&place, "swaps.toml", &swaps), place.path("swaps.mcap"));
    let ended = fly(&place, &manifest, &recording).flown();
    assert_eq!(ended.json()["successions"].as_array().unwrap().len(), 4, "{ended}");
    assert_eq!(ticks_of(&recording, "/controller/command"), (0..1500).collect::<Vec<u32>>());
}

#[test]
fn two_runs_with_the_same_swap_are_the_same_file() {
    let place = Place::new();
    let manifest = hover_with(&place, "swap.toml", &format!("{SWAP}{GAINS}"));
    let [a, b] = ["a.mcap", "b.mcap"].map(|name| place.path(name));
    fly(&place, &manifest, &a).flown();
    let words =
        ["run", &manifest, "--record", &b, "--json", "--window", "3", "--set", "run.start_order_seed=5"];
    place.call(&words).flown();
    assert!(fs::read(a).unwrap() == fs::read(b).unwrap(), "the files differ");
}

#[test]
fn a_swap_to_other_gains_steps_no_further_than_the_new_law_asks() {
    let place = Place::new();
    let manifest = hover_with(&place, "swap.toml", &format!("{SWAP}{GAINS}"));
    let ended = fly(&place, &manifest, &place.path("swap.mcap")).flown();
    let step = &ended.json()["successions"][0]["steps"][0];
    let number = |key: &str| step[key].as_f64().unwrap_or_else(|| panic!("no {key} in {ended}"));
    // The new law's own difference, and what a tick's noise moves the commands of either law by.
    let noise = 3.0 * number("step_before").max(0.1);
    assert!(number("step") <= number("law_difference") + noise, "{ended}");
}

#[test]
fn a_user_s_controller_in_its_own_binary_can_be_swapped_in() {
    let place = Place::new();
    let example = Path::new(env!("CARGO_BIN_EXE_hummingbus")).with_file_name("examples/custom_controller");
    let with = format!(
        "with = {{ command = [{example:?}], parameters = {{ hover_count = 76.5, altitude = [63.6, 31.8], \
         tilt = [11.6, 4.4] }} }}\n"
    );
    let manifest = hover_with(&place, "swap.toml", &format!("{SWAP}{with}"));
    let recording = place.path("swap.mcap");
    let ended = fly(&place, &manifest, &recording).flown();
    let succession = &ended.json()["successions"][0];
    assert_eq!(succession["hand_over"], "last output", "{ended}");
    assert!(succession["refused"].is_null(), "{ended}");
    assert!(messages(&recording) != messages(&undisturbed(&place)), "nothing was swapped");
}

#[test]
fn a_shadow_reports_its_difference_and_changes_no_message() {
    let place = Place::new();
    let shadow = format!("[[shadow]]\nprocess = \"controller\"\n{GAINS}");
    let (manifest, recording) = (hover_with(&place, "shadow.toml", &shadow), place.path("shadow.mcap"));
    let ended = fly(&place, &manifest, &recording).flown();
    let differences = ended.json()["shadows"].as_array().unwrap().clone();
    assert_eq!(differences.len(), 4, "{ended}");
    assert!(differences.iter().all(|difference| difference["samples"] == 1500), "{ended}");
    assert!(differences.iter().any(|difference| difference["rms"].as_f64() > Some(1e-4)), "{ended}");
    assert!(messages(&recording) == messages(&undisturbed(&place)), "the flights differ");
    place.call(&["shadow", &recording]).with_code(0).prints(&["/controller/command", "rms"]);
}

#[test]
fn a_controller_can_be_tried_as_a_shadow_without_a_change_of_the_manifest() {
    let place = Place::new();
    let manifest = hover_with(&place, "plain.toml", "");
    let with = GAINS.trim_start_matches("with.");
    let recording = place.path("shadow.mcap");
    let words = ["shadow", &manifest, "--process", "controller", "--with", with, "--record", &recording];
    let ended = place.call(&words);
    assert!(ended.error.is_empty(), "{ended}");
    ended.prints(&["/controller/command command[0]", "1500 samples"]);
    place.call(&["shadow", &manifest, "--process", "recorder"]).with_code(2).says(&["recorder"]);
}

/// A paced hover that goes on until it is told to stop.
fn start_live<'a>(place: &'a Place, manifest: &str) -> Launch<'a> {
    let record = place.path("live.mcap");
    let mut launch = place.start(&["run", manifest, "--record", &record, "--json", "--pace", "4"]);
    launch.await_ticks(50);
    launch
}

#[test]
fn a_process_of_a_live_run_is_swapped() {
    let place = Place::new();
    let launch = start_live(&place, &hover_with(&place, "plain.toml", ""));
    let run = place.run_id();
    let words = ["swap", "controller", "--with", "kind = \"pid\"", "--shadow-ticks", "20", "--run", &run];
    let swapped = place.start(&words).end_among_others().with_code(0);
    swapped.prints(&["controller.1", "handed over: state"]);
    let refused = place.start(&["swap", "recorder", "--run", &run]).end_among_others().with_code(2);
    refused.says(&["recorder"]);
    let ended = launch.end().flown();
    assert_eq!(ended.json()["successions"][0]["process"], "controller", "{ended}");
    // When it was swapped depends on when it was asked for, but to an identical controller: nothing changes.
    assert!(messages(&place.path("live.mcap")) == messages(&undisturbed(&place)), "the flights differ");
}

/// File descriptors of every process of a run, and its files in shared memory.
fn held(place: &Place) -> (usize, usize) {
    let count = |folder: String| fs::read_dir(folder).map_or(0, Iterator::count);
    let processes = place.processes();
    let descriptors =
        processes.iter().map(|(pid, _)| count(format!("/proc/{}/fd", pid.as_raw_nonzero()))).sum();
    let prefix = format!("hb_{}_", place.run_id());
    let files = fs::read_dir("/dev/shm").unwrap().flatten();
    (descriptors, files.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix)).count())
}

#[test]
fn a_thousand_swaps_in_one_run_leak_nothing() {
    let place = Place::new();
    let swaps = "[[swap]]\nprocess = \"controller\"\nat_tick = 400\nshadow_ticks = 5\nrepeat = 1000\nevery_ticks = 20\n";
    let text =
        format!("include = [{:?}]\n[run]\nduration_s = 21.0\n{swaps}", repository("manifests/hover.toml"));
    let manifest = place.write("swaps.toml", text);
    let recording = place.path("swaps.mcap");
    let mut launch = place.start(&["run", &manifest, "--record", &recording, "--json"]);
    // Held where no successor has been started, and again behind the last: what is open must be the same.
    let counts = [300, 20_500].map(|tick| {
        launch.hold_at(tick);
        let counts = held(&place);
        launch.release();
        counts
    });
    let ended = launch.end().flown();
    let successions = ended.json()["successions"].as_array().unwrap().clone();
    assert_eq!(successions.len(), 1000);
    assert!(successions.iter().all(|succession| succession["refused"].is_null()), "{ended}");
    let [before, after] = counts;
    // The first successor is started with the run: one process more, in the first count only.
    assert!(
        after.0 <= before.0 && after.1 <= before.1,
        "open files and shared memory: {before:?}, then {after:?}"
    );
    assert_eq!(ticks_of(&recording, "/controller/command"), (0..21_000).collect::<Vec<u32>>());
}
