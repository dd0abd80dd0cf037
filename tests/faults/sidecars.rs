//! Sidecars that fail, that are not ready, and what follows by their manifest.

use crate::flight::write_manifest;
use crate::support::{Ended, Launch, Place, poll};
use rustix::process::Signal;

/// Starts a flight of 0.5 s with a sidecar that runs `script`.
fn start<'a>(place: &'a Place, script: &str, more: &str, settings: &[&str]) -> Launch<'a> {
    let sidecar = format!(
        "[process.viewer]\nlockstep = false\ncommand = [\"sh\", \"-c\", {script:?}]\nworking_directory = {:?}\n{more}\n",
        place.path("")
    );
    let manifest = write_manifest(place, &sidecar);
    let recording = place.path("flight.mcap");
    let mut args = vec!["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.5"];
    settings.iter().for_each(|setting| args.extend(["--set", setting]));
    place.start(&args)
}

fn fly(script: &str, more: &str, settings: &[&str]) -> Ended {
    start(&Place::new(), script, more, settings).end()
}

/// A run at real time.
const PACED: &str = "run.pace=\"realtime\"";
/// A run that lasts until it is ended.
const ENDLESS: [&str; 2] = [PACED, "run.duration_s=4000000"];

/// Stops a run that goes on although its sidecar has ended.
fn stop(launch: Launch<'_>) -> Ended {
    launch.signal(Signal::INT);
    let ended = launch.end().with_code(1);
    ended.prints(&["stopped before its end"]);
    ended
}

/// Says to whoever started it that it is ready, as systemd-notify does.
const NOTIFY: &str = "python3 -c \"import os, socket; \
    socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM).sendto(b'STATUS=up\\nREADY=1', os.environ['NOTIFY_SOCKET'])\"";

#[test]
fn a_sidecar_that_ends_with_an_error_ends_the_run() {
    let ended = fly("echo no display >&2; exit 4", "", &ENDLESS).with_code(2);
    ended.says(&["process `viewer` ended with exit code 4", "no display", "The run was aborted at tick"]);
    fly("kill -9 $$", "", &ENDLESS).with_code(2).says(&["process `viewer` was killed by signal 9 (SIGKILL)"]);
}

#[test]
fn a_sidecar_that_has_done_its_part_is_not_missed() {
    let ended = fly("exit 0", "", &[PACED]).with_code(0);
    assert!(!ended.error.contains("viewer"), "{ended}");
}

#[test]
fn a_sidecar_that_may_be_missing_is_named_and_the_run_goes_on() {
    let place = Place::new();
    let launch = start(&place, "exit 4", "on_exit = \"ignore\"", &ENDLESS);
    launch.await_said("The run goes on without it");
    stop(launch).says(&["process `viewer` ended with exit code 4"]);
}

#[test]
fn a_sidecar_is_restarted_unless_it_ends_again_at_once() {
    let place = Place::new();
    let once = "if [ -e started ]; then sleep 600; else touch started; exit 4; fi";
    let launch = start(&place, once, "on_exit = \"restart\"", &ENDLESS);
    launch.await_said("`viewer` is restarted");
    stop(launch).says(&["process `viewer` ended with exit code 4"]);
    let ended = fly("exit 4", "on_exit = \"restart\"", &ENDLESS).with_code(2);
    ended.says(&["`viewer` is restarted", "it was restarted and ended again within a second"]);
}

#[test]
fn the_first_tick_waits_for_a_sidecar_that_says_when_it_is_ready() {
    let place = Place::new();
    let script = format!("while ! [ -e go ]; do sleep 0.02; done; {NOTIFY}; sleep 600");
    let mut launch = start(&place, &script, "ready = \"notify\"", &[]);
    launch.hold_at(0);
    launch.release();
    // Everybody has joined, and nobody computes.
    for _ in 0..20 {
        launch.await_looks(5);
        launch.hold_at(0);
        launch.release();
    }
    place.write("go", "");
    launch.end().with_code(0);
}

#[test]
fn a_sidecar_starts_when_those_before_it_are_ready() {
    let place = Place::new();
    let folder = place.path("");
    let script = format!("touch server; until [ -e go ]; do sleep 0.02; done; {NOTIFY}; sleep 600");
    // By their names, the client would be first.
    let client = format!(
        "ready = \"notify\"\n[process.client]\nlockstep = false\nafter = [\"viewer\"]\nworking_directory = {folder:?}\n\
         command = [\"touch\", \"client\"]\n"
    );
    let mut launch = start(&place, &script, &client, &[]);
    let exists = |name: &str| std::fs::metadata(place.path(name)).is_ok();
    poll("it was not started", || exists("server").then_some(()));
    launch.hold_at(0);
    launch.release();
    // A process has its log from its start on.
    let has_log = |name: &str| place.run_dirs()[0].join(format!("{name}.log")).exists();
    launch.await_looks(20);
    assert!(has_log("viewer") && !has_log("client") && !exists("client"), "it waits");
    place.write("go", "");
    launch.end().with_code(0);
    assert!(exists("client"), "it was started");
}

#[test]
fn a_sidecar_behind_one_that_may_be_missing_starts_without_it() {
    let place = Place::new();
    let folder = place.path("");
    let client = format!(
        "ready = \"notify\"\non_exit = \"ignore\"\n[process.client]\nlockstep = false\nafter = [\"viewer\"]\n\
         working_directory = {folder:?}\ncommand = [\"touch\", \"client\"]\n"
    );
    start(&place, "exit 4", &client, &[]).end().with_code(0).says(&["The run goes on without it"]);
    assert!(std::fs::metadata(place.path("client")).is_ok());
}

#[test]
fn the_first_tick_waits_for_a_sidecar_that_is_restarted_before_it_is_ready() {
    let place = Place::new();
    let script = format!(
        "if [ -e started ]; then until [ -e go ]; do sleep 0.02; done; {NOTIFY}; sleep 600; \
                          else touch started; exit 4; fi"
    );
    let mut launch = start(&place, &script, "ready = \"notify\"\non_exit = \"restart\"", &[]);
    launch.await_said("`viewer` is restarted");
    launch.hold_at(0);
    launch.release();
    // Everybody has joined, and nobody computes.
    for _ in 0..20 {
        launch.await_looks(5);
        launch.hold_at(0);
        launch.release();
    }
    place.write("go", "");
    launch.end().with_code(0).says(&["process `viewer` ended with exit code 4", "`viewer` is restarted"]);
}

#[test]
fn a_sidecar_that_never_ends_to_say_that_it_is_ready_keeps_nobody_waiting() {
    let endless = "python3 -c \"import os, socket\ns = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)\n\
                   while True: s.sendto(b'READY=1', os.environ['NOTIFY_SOCKET'])\"";
    fly(endless, "ready = \"notify\"", &[]).with_code(0);
}

#[test]
fn a_sidecar_that_does_not_get_ready_is_named() {
    let more = "ready = \"notify\"\nwatchdog_ms_host = 1500";
    let ended = fly("sleep 600", more, &[]).with_code(2);
    ended.says(&[
        "process `viewer` was killed by the watchdog",
        "did not say within 1500 ms that it is ready",
    ]);
    let ended = fly("exit 0", more, &[]).with_code(2);
    ended.says(&["process `viewer` ended with exit code 0 before it said that it is ready"]);
    // Whoever can be missing need not be ready.
    let ended = fly("sleep 600", &format!("{more}\non_exit = \"ignore\""), &[]).with_code(0);
    ended.says(&["did not say within 1500 ms that it is ready", "The run goes on without it"]);
}

#[test]
fn a_sidecar_dies_with_all_that_it_started() {
    let place = Place::new();
    let script = "setsid sleep 600 & sleep 600";
    let launch = start(&place, script, "", &ENDLESS);
    poll("no child of the sidecar", || (place.processes().len() >= 12).then_some(()));
    // The end of a run requires that no process of it is left.
    stop(launch);
}
