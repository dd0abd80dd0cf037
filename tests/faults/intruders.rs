//! Processes that the launcher did not start: a second clock, a second process of a node. They are refused,
//! and the run goes on as if nothing had been.

use crate::flight::{Reference, Watched, manifest};
use crate::support::{HUMMINGBUS, Place};
use bus::process::RUN_VARIABLE;
use std::process::{Command, Output};

/// Starts a process of the run in `place` as its launcher would.
fn intrude(place: &Place, kind: &str, node: Option<&str>) -> Output {
    let mut command = Command::new(HUMMINGBUS);
    command.args(["node", kind]).env(RUN_VARIABLE, &place.run_dirs()[0]);
    command.envs(node.map(|node| (bus::NODE_VARIABLE, node)));
    command.output().unwrap()
}

/// Flies, intrudes while the clock waits at a tick and again in flight, and requires that nothing came of it.
fn intrude_on_flight(kind: &str, node: Option<&str>, name: &str) {
    let place = Place::new();
    let (path, recording) = (place.write("flight.toml", manifest()), place.path("flight.mcap"));
    let launch = place.start(&["run", &path, "--record", &recording]);
    let watched = Watched::attach(&place);
    for tick in [0, 700, 2100] {
        assert_eq!(watched.hold_at(tick), tick);
        let Output { status, stderr, .. } = intrude(&place, kind, node);
        let message = String::from_utf8_lossy(&stderr);
        assert_eq!(status.code(), Some(2), "{message}");
        assert!(message.contains(&format!("the run has a process `{name}` already")), "{message}");
        assert_eq!(watched.control.held_at(), Some(tick), "the intruder moved the run");
    }
    watched.control.set_hold_tick(u32::MAX);
    launch.end().with_code(0);
    assert!(
        std::fs::read(recording).unwrap() == Reference::fly().bytes(),
        "the intruder changed the recording"
    );
}

#[test]
fn a_second_clock_is_refused() {
    intrude_on_flight("clock", None, "clock");
}

#[test]
fn a_second_publisher_of_a_taken_topic_is_refused() {
    intrude_on_flight("imu", Some("imu"), "imu");
}

#[test]
fn a_second_recorder_is_refused_before_it_touches_the_file() {
    intrude_on_flight("recorder", Some("recorder"), "recorder");
}

#[test]
fn a_process_that_the_plan_does_not_know_is_refused() {
    let place = Place::new();
    let (path, recording) = (place.write("flight.toml", manifest()), place.path("flight.mcap"));
    let launch = place.start(&["run", &path, "--record", &recording]);
    let watched = Watched::attach(&place);
    watched.hold_at(100);
    let Output { status, stderr, .. } = intrude(&place, "imu", Some("imu2"));
    let message = String::from_utf8_lossy(&stderr);
    assert_eq!(status.code(), Some(2), "{message}");
    assert!(message.contains("the run has no node named `imu2`; it has "), "{message}");
    watched.control.set_hold_tick(u32::MAX);
    launch.end().with_code(0);
}
