//! Processes that neither end nor go on: the watchdog names them.
#![allow(clippy::disallowed_methods, reason = "the launcher's watchdog counts host time")]

use crate::flight::{Reference, Watched, manifest};
use crate::saboteur::{FAULT_VARIABLE, Fault};
use crate::support::{Ended, Launch, Place, partial};
use rustix::process::{Pid, Signal, kill_process};
use std::time::Duration;

/// Watchdog of a node whose manifest states none.
const DEFAULT_WATCHDOG_MS: u64 = 20_000;

/// Requires that the run stood still for as long as its watchdog waits, or longer: a loaded machine looks late.
#[track_caller]
fn require_stood_still(ended: &Ended, watchdog_ms: u64) {
    let told =
        ended.error.split_once("the run stood still for ").and_then(|(_, rest)| rest.split_once(" s: "));
    let (stood_s, _) = told.unwrap_or_else(|| panic!("no time of standing still in\n{ended}"));
    let stood_s: f64 = stood_s.parse().unwrap();
    assert!(stood_s * 1e3 >= watchdog_ms as f64, "{ended}");
}

/// Flies, and stops `node` as `kill -STOP` does while the clock waits at `tick`.
fn stop_at(place: &Place, node: &str, tick: u32) -> Ended {
    let path = place.write("flight.toml", manifest());
    let launch = place.start(&["run", &path, "--record", &place.path("flight.mcap")]);
    let watched = Watched::attach(place);
    assert_eq!(watched.hold_at(tick), tick);
    kill_process(place.process_of(node), Signal::STOP).unwrap();
    watched.control.set_hold_tick(u32::MAX);
    launch.end()
}

#[test]
fn a_stopped_process_is_named_with_its_tick_and_the_topic_that_others_wait_for() {
    let place = Place::new();
    let ended = stop_at(&place, "imu", 1234).with_code(2);
    ended.says(&["was killed by the watchdog", "tick 1234 is not completed by `imu`"]);
    require_stood_still(&ended, DEFAULT_WATCHDOG_MS);
    ended.says(&["`ekf` waits for /imu/imu"]);
    // The others were alive, so the recording is whole: it ends where the silence began.
    let tail = place.call(&["cat", &partial(&place.path("flight.mcap")), "--topic", "/imu/imu"]).with_code(0);
    assert!(
        tail.output.lines().last().unwrap().contains("\"tick\":1233,"),
        "{:?}",
        tail.output.lines().last()
    );
}

/// The nodes of the flight.
const NODES: [&str; 8] = ["controller", "ekf", "imu", "mocap", "pilot", "plant", "recorder", "saboteur"];
/// Long enough for a process to start in on a machine that is busy.
const WATCHDOG_MS: u64 = 5000;

/// Starts the flight with this watchdog for every node, and a fault of the saboteur.
fn start_watched<'a>(place: &'a Place, fault: Option<Fault>) -> Launch<'a> {
    let path = place.write("flight.toml", manifest());
    let settings = NODES.map(|node| format!("process.{node}.watchdog_ms_host={WATCHDOG_MS}"));
    let recording = place.path("flight.mcap");
    let mut args = vec!["run", &path, "--record", &recording];
    settings.iter().for_each(|setting| args.extend(["--set", setting]));
    let fault = fault.map(|fault| format!("{fault:?}"));
    let variables: Vec<_> = fault.iter().map(|fault| (FAULT_VARIABLE, fault.as_str())).collect();
    place.start_with(&args, &variables)
}

#[test]
fn a_stopped_clock_is_named_and_no_node_is() {
    let place = Place::new();
    let launch = start_watched(&place, None);
    let watched = Watched::attach(&place);
    assert_eq!(watched.hold_at(700), 700);
    kill_process(place.clock(), Signal::STOP).unwrap();
    watched.control.set_hold_tick(u32::MAX);
    let ended = launch.end().with_code(2);
    ended.says(&["process `clock` was killed by the watchdog"]);
    require_stood_still(&ended, WATCHDOG_MS);
    ended.says(&["tick 700 is not granted by `clock`"]);
    let blamed = ended.error.lines().find(|line| line.contains("killed by the watchdog")).unwrap();
    NODES.iter().for_each(|node| assert!(!blamed.contains(&format!("`{node}`")), "{ended}"));
}

#[test]
fn a_clock_that_is_stopped_before_the_first_tick_is_named() {
    let place = Place::new();
    let launch = start_watched(&place, None);
    kill_process(place.clock(), Signal::STOP).unwrap();
    let ended = launch.end().with_code(2);
    ended.says(&["process `clock` was killed by the watchdog"]);
}

#[test]
fn a_process_that_does_not_join_is_named_after_its_own_watchdog() {
    let place = Place::new();
    let ended = start_watched(&place, Some(Fault::NeverJoins)).end().with_code(2);
    ended.says(&["process `saboteur` was killed by the watchdog"]);
    require_stood_still(&ended, WATCHDOG_MS);
    ended.says(&["waiting for `saboteur` to join"]);
}

/// Everything stands still for longer than any watchdog, as in a paused container or behind a closed lid.
#[test]
fn a_run_that_is_frozen_and_thawed_goes_on_as_if_nothing_had_been() {
    let place = Place::new();
    let launch = start_watched(&place, None);
    let watched = Watched::attach(&place);
    // In the midst of the flight, where every node has something to do; it is not over before it is frozen.
    watched.control.set_hold_tick(3500);
    watched.await_ticks(None, 500);
    let launcher = Pid::from_raw(i32::try_from(launch.id()).unwrap()).unwrap();
    let mut all: Vec<Pid> = place.processes().into_iter().map(|(process, _)| process).collect();
    all.sort_by_key(|&process| process != launcher);
    all.iter().for_each(|&process| kill_process(process, Signal::STOP).unwrap());
    watched.control.set_hold_tick(u32::MAX);
    std::thread::sleep(Duration::from_millis(2 * WATCHDOG_MS));
    // The launcher first: it has looked before the others can come on.
    kill_process(launcher, Signal::CONT).unwrap();
    std::thread::sleep(Duration::from_millis(WATCHDOG_MS / 10));
    all.iter().skip(1).for_each(|&process| kill_process(process, Signal::CONT).unwrap());
    launch.end().with_code(0);
    assert!(std::fs::read(place.path("flight.mcap")).unwrap() == Reference::fly().bytes(), "other bytes");
}
