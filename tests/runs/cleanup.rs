//! Runs that are stopped or killed: they end at a tick boundary, and nothing outlives them.

use crate::recordings::{open, require_same_messages, topics};
use crate::skipped::first;
use crate::support::{ENDLESS, Ended, HUMMINGBUS, Place, partial, poll, repository};
use rustix::process::{Signal, kill_process};
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

/// Flies hover.toml, very long, and sends `signal` to the launcher after 500 ticks.
fn stop_with(place: &Place, signal: Signal, more: &[&str]) -> (Ended, String) {
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("stopped.mcap"));
    let args = ["run", &manifest, "--record", &recording, "--set", "run.duration_s=4000000"];
    let mut launch = place.start(&[&args, more].concat());
    launch.await_ticks(500);
    launch.signal(signal);
    (launch.end(), recording)
}

/// Requires that the recording holds what an undisturbed run of as many ticks records.
fn require_undisturbed(place: &Place, recording: &str, ticks: u64) {
    let undisturbed = place.path("undisturbed.mcap");
    let duration = format!("run.duration_s={}", ticks as f64 * 1e-3);
    let manifest = repository("manifests/hover.toml");
    place.call(&["run", &manifest, "--record", &undisturbed, "--set", &duration]).flown();
    require_same_messages(&topics(&undisturbed), &topics(recording));
}

#[test]
fn a_good_run_leaves_only_its_recording() {
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let recording = place.path("hover.mcap");
    // That nothing else is left is what `call` requires of every launch.
    place.call(&["run", &manifest, "--record", &recording]).with_code(0).prints(&["passed"]);
    open(&recording);
}

#[test]
fn ctrl_c_stops_at_a_tick_and_the_recording_is_the_start_of_the_undisturbed_one() {
    let place = Place::new();
    let (ended, recording) = stop_with(&place, Signal::INT, &["--json", "--pace", "realtime"]);
    let summary = ended.with_code(1).json();
    assert_eq!((&summary["passed"], &summary["stopped_early"]), (&false.into(), &true.into()));
    let ticks = summary["ticks"].as_u64().unwrap();
    assert!(ticks >= 500, "{ticks}");
    require_undisturbed(&place, &recording, ticks);
}

#[test]
fn a_stopped_run_says_so() {
    let place = Place::new();
    let (ended, _) = stop_with(&place, Signal::INT, &["--pace", "realtime"]);
    let ended = ended.with_code(1);
    ended.prints(&["stopped before its end"]);
    assert!(!ended.output.contains("passed") && !ended.output.contains("FAILED"), "{ended}");
}

#[test]
fn sigterm_stops_a_run_as_ctrl_c_does() {
    let place = Place::new();
    let (ended, recording) = stop_with(&place, Signal::TERM, &["--json", "--pace", "realtime"]);
    let ticks = ended.with_code(1).json()["ticks"].as_u64().unwrap();
    require_undisturbed(&place, &recording, ticks);
}

#[test]
fn sigterm_to_a_node_stops_the_run_at_a_tick_as_well() {
    let place = Place::new();
    for node in first(1, "nodes", ["recorder", "plant", "pilot"]) {
        let (manifest, recording) = (repository("manifests/hover.toml"), place.path("stopped.mcap"));
        let mut launch = place.start_endless(&["run", &manifest, "--record", &recording, "--json"]);
        launch.await_ticks(300);
        kill_process(place.process_of(node), Signal::TERM).unwrap();
        let ticks = launch.end().with_code(1).json()["ticks"].as_u64().unwrap();
        require_undisturbed(&place, &recording, ticks);
    }
}

#[test]
fn sigterm_to_every_process_at_once_leaves_a_whole_recording() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("stopped.mcap"));
    let mut launch = place.start_endless(&["run", &manifest, "--record", &recording, "--json"]);
    launch.await_ticks(300);
    // The first to hear of it may have ended the run before the last is told.
    for (pid, _) in place.processes() {
        let _ = kill_process(pid, Signal::TERM);
    }
    let ticks = launch.end().with_code(1).json()["ticks"].as_u64().unwrap();
    require_undisturbed(&place, &recording, ticks);
}

#[test]
fn a_free_run_stops_at_a_tick_as_well() {
    let place = Place::new();
    let (ended, recording) = stop_with(&place, Signal::INT, &["--json"]);
    let ticks = ended.with_code(1).json()["ticks"].as_u64().unwrap();
    require_undisturbed(&place, &recording, ticks);
}

#[test]
fn ctrl_c_stops_a_run_whose_next_tick_is_ten_seconds_away() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("slow.mcap"));
    let mut launch = place.start(&["run", &manifest, "--record", &recording, "--pace", "0.0001", "--json"]);
    launch.await_ticks(1);
    launch.signal(Signal::INT);
    let ticks = launch.end().with_code(1).json()["ticks"].as_u64().unwrap();
    require_undisturbed(&place, &recording, ticks);
}

#[test]
fn a_second_ctrl_c_aborts_a_run_that_does_not_come_to_its_boundary() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("stuck.mcap"));
    let mut launch = place.start_endless(&["run", &manifest, "--record", &recording]);
    launch.await_ticks(300);
    kill_process(place.process_of("plant"), Signal::STOP).unwrap();
    launch.signal(Signal::INT);
    launch.await_stop_request();
    launch.signal(Signal::INT);
    launch.end().with_code(2).says(&["interrupted twice"]);
    open(&partial(&recording));
}

/// Waits until a process does not ignore SIGINT any more; until then the signal would be lost.
fn await_no_ignored_sigint(process: u32) {
    poll("SIGINT stays ignored", || {
        let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
        let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
        let mask = u64::from_str_radix(ignored.trim(), 16).ok()?;
        (mask & (1 << (Signal::INT.as_raw() - 1)) == 0).then_some(())
    });
}

#[test]
fn ctrl_c_at_any_moment_of_the_start_leaves_nothing() {
    let place = Place::new();
    for wait_ms in [0, 1, 2, 4, 8, 12, 16, 24, 32, 48, 64] {
        let (manifest, recording) = (repository("manifests/hover.toml"), place.path("early.mcap"));
        // Whoever started these tests in the background has SIGINT ignored from the start.
        let mut command = Command::new("env");
        command.args(["--default-signal=INT", HUMMINGBUS, "run", &manifest, "--record", &recording]);
        command.args(ENDLESS);
        let launch = place.launch(command);
        await_no_ignored_sigint(launch.id());
        sleep(Duration::from_millis(wait_ms));
        launch.signal(Signal::INT);
        let ended = launch.end();
        // No code: the signal came before anything was set up, and ended the process as it does any other.
        assert!(matches!(ended.code, None | Some(1)), "after {wait_ms} ms: {ended}");
        if ended.code == Some(1) {
            open(&recording);
        }
    }
}

#[test]
fn no_process_outlives_a_killed_launcher() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("killed.mcap"));
    let mut launch = place.start_endless(&["run", &manifest, "--record", &recording]);
    launch.await_ticks(200);
    assert_eq!(place.processes().len(), 9, "launcher, clock and seven nodes");
    launch.kill();
    place.await_no_process();
}

#[test]
fn no_process_outlives_a_launcher_killed_at_any_moment_of_the_start() {
    let place = Place::new();
    for wait_ms in [0, 1, 2, 4, 8, 12, 16, 24, 32, 48, 64] {
        let (manifest, recording) = (repository("manifests/hover.toml"), place.path("killed.mcap"));
        let launch = place.start_endless(&["run", &manifest, "--record", &recording]);
        sleep(Duration::from_millis(wait_ms));
        launch.kill();
        place.await_no_process();
    }
}

#[test]
fn what_a_killed_launcher_left_does_not_hinder_the_next_run() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("killed.mcap"));
    let args = ["run", &manifest, "--record", &recording];
    let mut launch = place.start_endless(&args);
    launch.await_ticks(200);
    launch.kill();
    place.await_no_process();
    place.start(&args).end_among_others().with_code(0);
}

#[test]
fn a_refused_manifest_leaves_nothing_and_touches_no_recording() {
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let recording = place.write("kept.mcap", "kept");
    place.call(&["run", &manifest, "--record", &recording, "--set", "run.seeed=1"]).with_code(2);
    assert_eq!(std::fs::read_to_string(recording).unwrap(), "kept");
}
