//! Processes that die in their last tick, or behind it, when all that they had to send is sent.

use crate::flight::{messages, write_manifest};
use crate::saboteur::{FAULT_VARIABLE, Fault, GENERATIONS_VARIABLE, MARK_VARIABLE, TICK_VARIABLE};
use crate::support::{Ended, Place};

/// Ticks of these runs: no multiple of the longer periods.
const DURATION: &str = "run.duration_s=0.73";
const BEHIND_THE_END: (&str, &str) = (FAULT_VARIABLE, "BehindTheEnd");

/// Flies with a saboteur that sends every `period` ticks, and that fails as these `variables` tell it to.
fn fly(place: &Place, on_exit: &str, period: u32, recording: &str, variables: &[(&str, &str)]) -> Ended {
    let tables = format!(
        "[process.saboteur]\non_exit = \"{on_exit}\"\nperiod_ticks = {period}\noutputs.report.every_ticks = {period}\n"
    );
    let manifest = write_manifest(place, &tables);
    place.start_with(&["run", &manifest, "--record", recording, "--set", DURATION], variables).end()
}

/// Flies undisturbed and with a death; requires exit code 0, the reason and what follows, and the same messages.
fn require_no_trace(on_exit: &str, period: u32, variables: &[(&str, &str)], follows: &str) {
    let place = Place::new();
    let (calm, struck) = (place.path("calm.mcap"), place.path("struck.mcap"));
    fly(&place, on_exit, period, &calm, &[]).with_code(0);
    let ended = fly(&place, on_exit, period, &struck, variables).with_code(0);
    ended.says(&["process `saboteur` ended with exit code 3", follows]);
    assert!(messages(&calm) == messages(&struck), "{on_exit}, every {period} ticks: other messages");
}

#[test]
fn a_process_under_restart_that_dies_behind_its_last_tick_is_not_missed() {
    for period in [1, 4, 10, 20, 100, 200] {
        require_no_trace("restart", period, &[BEHIND_THE_END], "It had completed its last tick");
    }
}

#[test]
fn a_process_that_dies_in_its_last_tick_is_replaced_when_all_others_have_completed_theirs() {
    let late = format!("{:?}", Fault::LateExit);
    for (period, last_tick) in [(1, "729"), (4, "728"), (20, "720")] {
        let place = Place::new();
        let mark = place.path("shadow");
        let all = [(FAULT_VARIABLE, &*late), (TICK_VARIABLE, last_tick), (GENERATIONS_VARIABLE, "1")];
        // The standby has computed the tick as a shadow; a process that is started anew reads it from the plant.
        let follows = format!("The standby of `saboteur` takes over at tick {last_tick}");
        require_no_trace("standby", period, &[&all[..], &[(MARK_VARIABLE, &mark)]].concat(), &follows);
        let follows = format!("`saboteur` is restarted at tick {last_tick}");
        require_no_trace("restart", period, &all, &follows);
    }
}

#[test]
fn a_process_with_a_standby_that_dies_behind_its_last_tick_is_not_missed() {
    let place = Place::new();
    let recording = place.path("struck.mcap");
    // The standby fails in the same way, and is not missed either.
    let ended = fly(&place, "standby", 20, &recording, &[BEHIND_THE_END]).with_code(0);
    ended.says(&["process `saboteur` ended with exit code 3", "It had completed its last tick"]);
}

#[test]
fn a_process_that_dies_behind_its_last_tick_ends_the_run_under_stop() {
    let place = Place::new();
    let ended = fly(&place, "stop", 20, &place.path("struck.mcap"), &[BEHIND_THE_END]).with_code(2);
    ended.says(&["process `saboteur` ended with exit code 3", "aborted at tick 730"]);
}
