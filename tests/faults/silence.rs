//! Processes that neither end nor go on: the watchdog names them.

use crate::flight::{Watched, manifest};
use crate::support::{Ended, Place, partial};
use rustix::process::{Signal, kill_process};

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
    ended.says(&[
        "was killed by the watchdog",
        "stood still for 20.0 s",
        "tick 1234 is not completed by `imu`",
    ]);
    ended.says(&["`ekf` waits for /imu/imu"]);
    // The others were alive, so the recording is whole: it ends where the silence began.
    let tail = place.call(&["cat", &partial(&place.path("flight.mcap")), "--topic", "/imu/imu"]).with_code(0);
    assert!(
        tail.output.lines().last().unwrap().contains("\"tick\":1233,"),
        "{:?}",
        tail.output.lines().last()
    );
}
