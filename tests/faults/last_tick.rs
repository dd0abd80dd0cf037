//! Processes that die behind their last tick: all that they had to send is sent.

use crate::flight::{messages, write_manifest};
use crate::saboteur::{FAULT_VARIABLE, Fault};
use crate::support::{Ended, Place};

/// Ticks of these runs: no multiple of the longer periods.
const DURATION: &str = "run.duration_s=0.73";

/// Flies with a saboteur that sends every `period` ticks, and that fails behind its last one where it is told to.
fn fly(place: &Place, on_exit: &str, period: u32, recording: &str, fails: bool) -> Ended {
    let tables = format!(
        "[process.saboteur]\non_exit = \"{on_exit}\"\nperiod_ticks = {period}\noutputs.report.every_ticks = {period}\n"
    );
    let manifest = write_manifest(place, &tables);
    let fault = format!("{:?}", Fault::BehindTheEnd);
    let variables = [(FAULT_VARIABLE, fault.as_str())];
    let args = ["run", &manifest, "--record", recording, "--set", DURATION];
    place.start_with(&args, if fails { &variables } else { &[] }).end()
}

/// Flies undisturbed and with a death behind the end; requires exit code 0, the reason, and the same messages.
fn require_no_trace(on_exit: &str, period: u32) {
    let place = Place::new();
    let (calm, struck) = (place.path("calm.mcap"), place.path("struck.mcap"));
    fly(&place, on_exit, period, &calm, false).with_code(0);
    let ended = fly(&place, on_exit, period, &struck, true).with_code(0);
    ended.says(&["process `saboteur` ended with exit code 3", "It had completed its last tick"]);
    assert!(messages(&calm) == messages(&struck), "{on_exit}, every {period} ticks: other messages");
}

#[test]
fn a_process_under_restart_that_dies_behind_its_last_tick_is_not_missed() {
    for period in [1, 4, 10, 20, 100, 200] {
        require_no_trace("restart", period);
    }
}

#[test]
fn a_process_with_a_standby_that_dies_behind_its_last_tick_is_not_missed() {
    let place = Place::new();
    let recording = place.path("struck.mcap");
    // The standby fails in the same way, and is not missed either.
    let ended = fly(&place, "standby", 20, &recording, true).with_code(0);
    ended.says(&["process `saboteur` ended with exit code 3", "It had completed its last tick"]);
}

#[test]
fn a_process_that_dies_behind_its_last_tick_ends_the_run_under_stop() {
    let place = Place::new();
    let ended = fly(&place, "stop", 20, &place.path("struck.mcap"), true).with_code(2);
    ended.says(&["process `saboteur` ended with exit code 3", "aborted at tick 730"]);
}
