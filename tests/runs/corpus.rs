//! Every input that a fuzzer found worth keeping is read once more, by what the fuzzers call.

#[path = "../../fuzz/targets.rs"]
mod targets;

use crate::support::repository;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The inputs of `target`, in the order of their names.
fn inputs(target: &str) -> BTreeSet<PathBuf> {
    let folder = repository(&format!("fuzz/corpus/{target}"));
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{folder}: {error}"));
    entries.map(|entry| entry.unwrap().path()).collect()
}

fn replay(name: &str) {
    let (_, target) = targets::TARGETS.into_iter().find(|(target, _)| *target == name).unwrap();
    let mut accepted = 0;
    for path in inputs(name) {
        // What panics, panics below this line of the output.
        println!("{}", path.display());
        let is_accepted = target(&fs::read(&path).unwrap());
        if path.file_name().unwrap().to_string_lossy().starts_with("accepted-") {
            assert!(is_accepted, "{} is refused, and leads nowhere", path.display());
            accepted += 1;
        }
    }
    assert!(accepted > 0, "no input of `{name}` is accepted");
}

#[test]
fn every_manifest_of_the_corpus_is_checked_or_refused_in_words() {
    replay("manifest");
}

#[test]
fn every_model_of_the_corpus_is_converted_or_refused_in_words() {
    replay("model");
}

#[test]
fn every_vehicle_of_the_corpus_is_read_or_refused_in_words() {
    replay("vehicle");
}

#[test]
fn every_scene_of_the_corpus_is_read_or_refused_in_words() {
    replay("scene");
}

#[test]
fn every_flights_file_of_the_corpus_is_read_or_refused_in_words() {
    replay("flights");
}

#[test]
fn every_log_of_the_corpus_is_read_or_refused_in_words() {
    ["csv", "ulog", "crazyflie", "dataflash", "parquet", "mcap"].into_iter().for_each(replay);
}

/// Without an end to what is read, each of these would fill the memory.
#[test]
fn a_device_in_the_place_of_a_file_is_refused_in_words() {
    let hover = repository("manifests/hover.toml");
    for key in ["process.plant.vehicle", "process.controller.vehicle"] {
        let overrides = [format!("{key}=\"/dev/zero\"")];
        let problem = hummingbus::check(Path::new(&hover), &overrides).unwrap_err().to_string();
        assert!(problem.contains("/dev/zero: cannot read this file: it is not a regular file"), "{problem}");
    }
    let problem = hummingbus::check(Path::new("/dev/zero"), &[]).unwrap_err().to_string();
    assert!(problem.starts_with("/dev/zero: cannot be read: it is not a regular file"), "{problem}");
    let text = "include = [\"/dev/zero\"]";
    let problem = hummingbus::check_text(text, Path::new("new.toml"), &[]).unwrap_err().to_string();
    assert!(problem.starts_with("new.toml:1:12: the included file /dev/zero cannot be read"), "{problem}");
    let replay = repository("manifests/replay-nanobench.toml");
    let overrides = ["process.player.data=\"/dev/zero\"".to_owned()];
    let problem = hummingbus::check(Path::new(&replay), &overrides).unwrap_err().to_string();
    assert!(problem.contains("/dev/zero") && problem.contains("not a regular file"), "{problem}");
    let problem = flights::FlightSet::load(Path::new("/dev/zero")).unwrap_err().to_string();
    assert!(problem.contains("/dev/zero") && problem.contains("not a regular file"), "{problem}");
}

#[test]
fn every_target_has_a_corpus_an_entry_for_the_fuzzer_and_a_word_in_its_script() {
    let names: BTreeSet<String> = targets::TARGETS.iter().map(|(name, _)| (*name).to_owned()).collect();
    let there = |folder: &str, end: &str| -> BTreeSet<String> {
        let entries = fs::read_dir(repository(folder)).unwrap().map(|entry| entry.unwrap().file_name());
        entries.map(|name| name.to_string_lossy().trim_end_matches(end).to_owned()).collect()
    };
    assert_eq!(there("fuzz/corpus", ""), names);
    assert_eq!(there("fuzz/fuzz_targets", ".rs"), names);
    let script = fs::read_to_string(repository("scripts/fuzz")).unwrap();
    let (_, list) = script.split_once("ALL=(").unwrap();
    let list: BTreeSet<String> =
        list.split(')').next().unwrap().split_whitespace().map(str::to_owned).collect();
    assert_eq!(list, names);
}
