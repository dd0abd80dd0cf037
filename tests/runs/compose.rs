//! Composition: nodes that share a process give the same bytes, are swapped like others, and end like others.

use crate::recordings::require_same;
use crate::skipped::{cases, first};
use crate::support::{Place, repository};
use rand_core::Rng;
use rustix::process::{Signal, kill_process};
use serde_json::Value;
use std::fs;
use std::ops::Range;

/// Flies `manifest` for `duration_s` with `more` arguments; returns the recording.
fn fly(place: &Place, manifest: &str, duration_s: f64, more: &[&str]) -> String {
    let (manifest, recording) = (repository(manifest), place.path("flight.mcap"));
    let duration = format!("run.duration_s={duration_s}");
    let args = ["run", &manifest, "--record", &recording, "--set", &duration];
    // Conditions that a shorter flight misses are not what is looked at.
    let ended = place.call(&[&args, more].concat());
    assert!(!fs::read(&recording).unwrap_or_default().is_empty(), "{ended}");
    recording
}

/// Requires that `manifest` with `settings` gives the same file with each of these compositions as without any.
#[track_caller]
fn require_same_file(manifest: &str, duration_s: f64, settings: &[&str], compositions: &[String]) {
    let more: Vec<&str> = settings.iter().flat_map(|setting| ["--set", setting]).collect();
    let place = Place::new();
    let alone = fs::read(fly(&place, manifest, duration_s, &[&more[..], &["--compose", "none"]].concat()));
    let alone = alone.unwrap();
    for composition in compositions {
        let place = Place::new();
        let composed = fly(&place, manifest, duration_s, &[&more[..], &["--compose", composition]].concat());
        assert!(
            alone == fs::read(&composed).unwrap(),
            "{manifest}: another file with --compose {composition}"
        );
    }
}

/// The nodes of `manifest` that can be members of a group.
fn nodes(manifest: &str) -> Vec<String> {
    let manifest = repository(manifest);
    let plan = Place::new().call(&["check", &manifest, "--compose", "all", "--json"]).with_code(0).json();
    let members = plan["groups"][0]["members"].as_array().unwrap().iter();
    let node = |member: &Value| &plan["nodes"][usize::try_from(member["node"].as_u64().unwrap()).unwrap()];
    members.map(|member| node(member)["name"].as_str().unwrap().to_owned()).collect()
}

/// A partition of `nodes`, drawn from `seed`; a set of one node is no group.
fn partition(nodes: &[String], seed: u64) -> String {
    let mut random = bus::random::stream(seed, "partition");
    let mut sets: [Vec<&str>; 3] = Default::default();
    nodes.iter().for_each(|node| sets[(random.next_u64() % 3) as usize].push(node));
    let groups: Vec<String> = sets.iter().filter(|set| set.len() > 1).map(|set| set.join("+")).collect();
    if groups.is_empty() { "none".to_owned() } else { groups.join(",") }
}

/// Partitions of the nodes of `manifest`, drawn from `seeds`.
fn partitions(manifest: &str, seeds: Range<u64>) -> Vec<String> {
    let nodes = nodes(manifest);
    seeds.map(|seed| partition(&nodes, seed)).collect()
}

#[test]
fn every_partition_of_the_hover_gives_the_same_file() {
    let mut compositions = first(4, "partitions", partitions("manifests/hover.toml", 0..12));
    compositions.push("all".to_owned());
    require_same_file("manifests/hover.toml", 1.0, &[], &compositions);
}

/// The swaps of swap-laws.toml at the beginning of the flight. The second backup joins soon after the first has taken over.
const EARLY_SWAPS: [&str; 3] = ["swap.0.at_tick=250", "swap.1.at_tick=500", "swap.2.at_tick=750"];

#[test]
fn partitions_of_other_flights_give_the_same_file() {
    let flights: [(&str, f64, &[&str], Range<u64>); 3] = [
        ("manifests/wall-follow-varying.toml", 0.5, &[], 12..15),
        ("manifests/figure-eight.toml", 0.5, &[], 15..18),
        ("manifests/swap-laws.toml", 0.9, &EARLY_SWAPS, 18..21),
    ];
    let is_quick = |name: &str| !name.contains("figure-eight");
    for (manifest, duration_s, settings, seeds) in cases("flights", flights, |(name, ..)| is_quick(name)) {
        let what = format!("partitions of {manifest}");
        let compositions = first(1, &what, partitions(manifest, seeds));
        require_same_file(manifest, duration_s, settings, &compositions);
    }
}

/// The clock is held for the next backup until the member before has left its group, whose other members wait meanwhile.
#[test]
fn a_member_leaves_its_group_while_the_others_wait() {
    let compositions = ["controller+imu,ekf+pilot+trajectory", "controller+imu"].map(str::to_owned);
    let compositions = first(1, "compositions", compositions);
    require_same_file("manifests/swap-laws.toml", 0.9, &EARLY_SWAPS, &compositions);
}

#[test]
fn ten_vehicles_give_the_same_file_whole_by_vehicle_and_in_any_partition() {
    let manifest = "manifests/ten-vehicles.toml";
    let mut compositions = partitions(manifest, 21..22);
    compositions.extend(["all".to_owned(), "vehicles".to_owned()]);
    let compositions = cases("compositions", compositions, |composition| composition == "vehicles");
    require_same_file(manifest, 0.3, &[], &compositions);
}

#[test]
fn contacts_walls_figures_and_swaps_give_the_same_file() {
    let manifests = [
        "manifests/wall-follow-varying.toml",
        "manifests/figure-eight.toml",
        "manifests/swap-laws.toml",
        "manifests/standby.toml",
        "manifests/hover-rapier.toml",
        "manifests/computing-time.toml",
    ];
    // Partitions of the others are flown in other tests.
    let is_quick = |name: &str| ["standby", "hover-rapier"].iter().any(|it| name.contains(it));
    for manifest in cases("manifests", manifests, |name| is_quick(name)) {
        // swap-laws swaps up to 9 s.
        let duration_s = if manifest.contains("swap") { 12.0 } else { 2.5 };
        require_same_file(manifest, duration_s, &[], &["all".to_owned()]);
    }
}

#[test]
fn the_recording_is_the_same_with_any_window_and_at_a_pace() {
    let place = Place::new();
    let alone = fs::read(fly(&place, "manifests/hover.toml", 1.0, &[])).unwrap();
    for more in [["--window", "1"], ["--window", "5"], ["--window", "4096"], ["--pace", "8"]] {
        let place = Place::new();
        let composed = fly(&place, "manifests/hover.toml", 1.0, &[&["--compose", "all"], &more[..]].concat());
        require_same(&alone, &composed);
    }
}

#[test]
fn a_group_of_a_manifest_flies_and_is_listed() {
    let place = Place::new();
    let text = format!(
        "include = [{:?}]\n[run]\nduration_s = 0.5\n[group.estimation]\nprocesses = [\"imu\", \"mocap\", \"ekf\"]\n",
        repository("manifests/hover.toml")
    );
    let manifest = place.write("grouped.toml", text);
    place.call(&["check", &manifest]).with_code(0).prints(&["group estimation: ekf, imu, mocap"]);
    let launch = place.start_endless(&["run", &manifest, "--record", &place.path("grouped.mcap")]);
    // Clock, controller, pilot, plant, recorder and the group.
    launch.await_process_count(&place, 6);
    launch.signal(Signal::INT);
    launch.end_among_others().with_code(1);
}

/// No file can have the name of this group.
#[test]
fn a_group_with_a_long_name_flies() {
    let place = Place::new();
    let text = format!(
        "include = [{:?}]\n[run]\nduration_s = 0.2\n[group.{}]\nprocesses = [\"imu\", \"mocap\"]\n",
        repository("manifests/hover.toml"),
        "g".repeat(300)
    );
    let manifest = place.write("long.toml", text);
    // The conditions see no sample in a flight this short.
    let ended = place.call(&["run", &manifest, "--record", &place.path("long.mcap"), "--json"]).with_code(1);
    assert_eq!(ended.json()["ticks"], 200, "{ended}");
}

#[test]
fn a_group_that_cannot_be_is_refused_with_the_reason() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    for (composition, reason) in [
        ("plant+recorder", "it is the recorder"),
        ("plant+imu,imu+ekf", "`imu` is a member of group `plant+imu` and of group `imu+ekf`"),
        ("plant+gyro", "a group names `gyro`, which is not there"),
        ("plnat", "there is no group `plnat`"),
        ("plant+plant", "names `plant` twice"),
        ("vehicles", "there is no vehicle to compose"),
    ] {
        let args = ["run", &hover, "--record", &place.path("no.mcap"), "--compose", composition];
        place.call(&args).with_code(2).says(&[reason]);
    }
    place.call(&["run", &hover, "--compose", "plant+"]).with_code(2).says(&["such as plant+imu"]);
}

/// A companion outside of the loop, which comes first by its name, does not pull a sensor away from the core of its loop.
#[test]
fn a_group_has_the_core_of_its_member_in_a_feedback_loop() {
    let place = Place::new();
    let sensors = repository("manifests/sensors.toml");
    let plan = |composition: &str| {
        place.call(&["check", &sensors, "--compose", composition, "--json"]).with_code(0).json()
    };
    let (composed, apart) = (plan("imu+battery,plant"), plan("none"));
    for (group, node) in [("imu+battery", "imu"), ("plant", "plant")] {
        assert_eq!(cpu(&composed, "groups", group), cpu(&apart, "nodes", node));
    }
    assert_eq!(cpu(&composed, "nodes", "battery"), cpu(&composed, "groups", "imu+battery"));
}

/// Core of the entry `name` in a `list` of a checked plan.
fn cpu(plan: &Value, list: &str, name: &str) -> Value {
    let found = plan[list].as_array().unwrap().iter().find(|entry| entry["name"] == name);
    found.unwrap_or_else(|| panic!("{plan}"))["cpu"].clone()
}

#[test]
fn members_have_the_core_that_their_group_states() {
    let place = Place::new();
    for core in bus::process::allowed_cores().into_iter().take(2) {
        let text = format!(
            "include = [{:?}]\n[group.est]\nprocesses = [\"imu\", \"ekf\"]\ncpu = {core}\n",
            repository("manifests/hover.toml")
        );
        let manifest = place.write("placed.toml", text);
        let plan = place.call(&["check", &manifest, "--json"]).with_code(0).json();
        for (list, name) in [("groups", "est"), ("nodes", "imu"), ("nodes", "ekf")] {
            assert_eq!(cpu(&plan, list, name), core, "{name}");
        }
        let lines = [format!("imu (imu), 1000 Hz, cpu {core}"), format!("ekf (ekf), 1000 Hz, cpu {core}")];
        place.call(&["check", &manifest]).with_code(0).prints(&[&lines[0], &lines[1]]);
    }
}

#[test]
fn a_live_run_names_the_group_of_each_member() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("watched.mcap"));
    let compose = ["--record", &recording, "--compose", "imu+ekf"];
    let mut launch = place.start_endless(&[&["run", &manifest], &compose[..]].concat());
    launch.await_ticks(100);
    let top = |more: &[&str]| {
        let run = place.run_id();
        place.start(&[&["top", "--once", "--run", &run], more].concat()).end_among_others().with_code(0)
    };
    top(&[]).prints(&["ekf [imu+ekf]", "imu [imu+ekf]"]);
    let view = top(&["--json"]).json();
    let processes = view["processes"].as_array().unwrap();
    let grouped = processes.iter().filter(|process| process["group"] == "imu+ekf");
    let names: Vec<_> = grouped.map(|process| process["name"].clone()).collect();
    assert_eq!(names, ["ekf", "imu"]);
    let status = |more: &[&str]| {
        let run = place.run_id();
        let started = place.start(&[&["ctl", "status", "--run", &run], more].concat());
        started.end_among_others().with_code(0)
    };
    status(&[]).prints(&["\ngroup imu+ekf: ekf, imu"]);
    let groups = serde_json::json!([{ "name": "imu+ekf", "members": ["ekf", "imu"] }]);
    assert_eq!(status(&["--json"]).json()["groups"], groups);
    let height_m = view["vehicles"][0]["height_m"].as_f64().unwrap();
    assert!((0.9..1.6).contains(&height_m), "{view}");
    launch.signal(Signal::INT);
    launch.end().with_code(1);
}

#[test]
fn a_killed_group_ends_the_run_in_order_and_is_named() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("killed.mcap"));
    let mut launch = place.start_endless(&["run", &manifest, "--record", &recording, "--compose", "all"]);
    launch.await_ticks(300);
    kill_process(place.group(), Signal::KILL).unwrap();
    launch.end().with_code(2).says(&["of group `all`", "was killed by signal 9", "aborted at tick"]);
}

#[test]
fn a_member_is_swapped_in_flight_and_the_others_fly_on() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("live.mcap"));
    let args = ["--record", &recording, "--json", "--compose", "all", "--set", "run.duration_s=1.5"];
    let mut launch = place.start(&[&["run", &manifest], &args[..]].concat());
    launch.hold_at(300);
    let run = place.run_id();
    let args = ["swap", "controller", "--with", "kind = \"pid\"", "--shadow-ticks", "20", "--run", &run];
    let swap = place.start(&args);
    launch.await_slot("controller", 1);
    launch.release();
    swap.end_among_others().with_code(0).prints(&["controller.1", "from tick 320", "handed over: state"]);
    let ended = launch.end();
    assert_eq!(ended.json()["successions"][0]["join_tick"], 300, "{ended}");
    let commands = |recording: &str| -> Vec<Vec<u8>> {
        let recording = recorder::reader::Recording::open(recording.as_ref()).unwrap();
        let all = recording.messages().map(Result::unwrap);
        all.filter(|record| !record.topic.starts_with("/shadow/")).map(|record| record.cdr).collect()
    };
    let place = Place::new();
    let alone = fly(&place, "manifests/hover.toml", 1.5, &[]);
    assert!(commands(&recording) == commands(&alone), "the flights differ");
}
