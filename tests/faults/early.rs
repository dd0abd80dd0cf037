//! Runs that are asked to end while they start.
#![allow(clippy::disallowed_methods, reason = "a signal comes at a moment of host time")]

use crate::flight::manifest;
use crate::support::{Place, poll};
use rustix::process::{Signal, kill_process};
use std::time::Duration;

/// Sends SIGTERM to the launcher this long after it has begun to handle signals; returns what came of it.
fn stop_after(milliseconds: u64) {
    let place = Place::new();
    let path = place.write("flight.toml", manifest());
    let launch = place.start_endless(&["run", &path, "--record", &place.path("flight.mcap")]);
    let status = format!("/proc/{}/status", launch.id());
    poll("no handler of SIGTERM", || {
        let text = std::fs::read_to_string(&status).ok()?;
        let caught = text.lines().find_map(|line| line.strip_prefix("SigCgt:"))?;
        let mask = u64::from_str_radix(caught.trim(), 16).ok()?;
        (mask & (1 << (Signal::TERM.as_raw() - 1)) != 0).then_some(())
    });
    std::thread::sleep(Duration::from_millis(milliseconds));
    launch.signal(Signal::TERM);
    let ended = launch.end().with_code(1);
    ended.prints(&["stopped before its end"]);
}

/// Sends SIGTERM to a process of the run as soon as it can be seen.
fn stop_by(process: &str) {
    let place = Place::new();
    let path = place.write("flight.toml", manifest());
    let launch = place.start_endless(&["run", &path, "--record", &place.path("flight.mcap")]);
    let process = if process == "clock" { place.clock() } else { place.process_of(process) };
    kill_process(process, Signal::TERM).unwrap();
    let ended = launch.end().with_code(1);
    ended.prints(&["stopped before its end"]);
}

#[test]
fn a_process_that_is_asked_to_end_before_it_has_joined_stops_the_run() {
    for process in ["plant", "recorder", "clock", "imu", "pilot"] {
        stop_by(process);
    }
}

#[test]
fn a_run_that_is_stopped_while_it_starts_was_stopped_and_did_not_fail() {
    for milliseconds in [0, 1, 2, 5, 10, 15, 20, 30, 40, 60, 80, 100, 150] {
        stop_after(milliseconds);
    }
}
