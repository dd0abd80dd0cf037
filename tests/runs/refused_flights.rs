//! Refused: recorded flights that cannot be replayed.

use crate::refusals::refused_setting;
use crate::replay::flight;
use crate::support::{Ended, Place, repository};

/// Replays `flight` with more overrides.
fn replay<'a>(place: &'a Place, flight: &str, more: &[&str]) -> crate::support::Launch<'a> {
    let manifest = repository("manifests/replay-nanobench.toml");
    let data = format!("process.player.data={}", place.write("flight.csv", flight));
    let recording = place.path("replay.mcap");
    let args = ["run", &manifest, "--record", &recording, "--set", &data];
    place.start(&[&args, more].concat())
}

/// Requires that the replay of `flight` is refused at a place in its manifest, or at a setting.
#[track_caller]
fn refused_replay(flight: &str, more: &[&str]) -> Ended {
    let ended = replay(&Place::new(), flight, more).end().with_code(2);
    let start = format!("error: {}:", repository("manifests/replay-nanobench.toml"));
    let rest = ended.error.strip_prefix(&start).unwrap_or_else(|| panic!("no place in\n{ended}"));
    let is_place = |c: char| c.is_ascii_digit();
    assert!(rest.starts_with(is_place) || rest.starts_with(" --set process.player."), "no place in\n{ended}");
    ended
}

const FROM_THE_START: [&str; 4] =
    ["--set", "process.player.parameters.from_s=0", "--set", "run.duration_s=1"];

#[test]
fn the_good_flight_is_replayed() {
    let place = Place::new();
    replay(&place, &flight(), &[&FROM_THE_START[..], &["--set", "run.duration_s=1.001"]].concat())
        .end()
        .flown();
}

#[test]
fn a_flight_that_is_not_there() {
    let manifest = repository("manifests/replay-nanobench.toml");
    let ended = refused_setting(&manifest, &["process.player.data=/no/flight.csv"]);
    ended.says(&["process `player`", "/no/flight.csv cannot be read", "--set process.<player>.data=PATH"]);
}

#[test]
fn a_flight_without_a_column() {
    let flight = flight().replacen(",py,", ",sideways,", 1);
    refused_replay(&flight, &FROM_THE_START).says(&[
        "process `player`",
        "no column `py`",
        "`position`",
        "sideways",
    ]);
}

#[test]
fn a_flight_with_a_cell_that_is_no_number() {
    let flight = flight().replacen("0.010,0.001,", "0.010,left,", 1);
    refused_replay(&flight, &FROM_THE_START)
        .says(&["line 3, column `px`", "\"left\" is not a finite number"]);
}

#[test]
fn a_flight_with_a_quotation_mark_that_swallows_rows() {
    let flight = flight().replacen("0.010,0.001,", "0.010,\"0.001,", 1);
    refused_replay(&flight, &FROM_THE_START).says(&["line 3, cell 2", "quotation mark", "remove the mark"]);
}

#[test]
fn a_flight_whose_time_stands_still() {
    let flight = flight().replacen("0.020,", "0.010,", 1);
    refused_replay(&flight, &FROM_THE_START).says(&["time does not grow from line 3"]);
}

#[test]
fn a_column_map_without_a_unit_or_with_a_wrong_one() {
    let columns = "process.player.parameters.columns.time";
    let missing = format!("{columns}={{ columns = [\"t\"] }}");
    refused_replay(&flight(), &["--set", &missing])
        .says(&["process `player`", "missing key `columns.time.unit`"]);
    let wrong = format!("{columns}.unit=h");
    refused_replay(&flight(), &["--set", &wrong])
        .says(&["`time` has the unit `h`", "\"s\" or \"ms\" or \"us\""]);
}

/// A column that is missing, a unit, a cell, times and a quaternion.
#[test]
fn all_faults_of_a_flight_are_told() {
    let flight = flight()
        .replacen(",py,", ",sideways,", 1)
        .replacen("0.010,0.001,0,1,0.01,", "0.010,0.001,0,1,left,", 1)
        .replacen("0.020,", "0.010,", 1)
        .replacen("0,0,0,1,0,0,0,5,", "0,0,0,0,0,0,0,5,", 1);
    let wrong = "process.player.parameters.columns.angular_velocity.unit=h";
    refused_replay(&flight, &[&FROM_THE_START[..], &["--set", wrong]].concat()).says(&[
        "no column `py`",
        "line 3, column `vx`: \"left\" is not a finite number",
        "time does not grow from line 3",
        "line 7, column `qw`: \"0\" is not part of an attitude",
        "`angular_velocity` has the unit `h`",
    ]);
}

#[test]
fn a_run_that_plays_a_gap() {
    let without = |line: &(usize, &str)| !(40..60).contains(&line.0);
    let lines = flight();
    let holed: String =
        lines.lines().enumerate().filter(without).map(|(_, line)| line.to_owned() + "\n").collect();
    refused_replay(&holed, &FROM_THE_START).says(&[
        "the flight has no rows from 0.380 s to 0.590 s",
        "the commands there are unknown",
        "`from_s`",
    ]);
    let held = ["--set", "process.player.parameters.gaps=hold", "--set", "run.duration_s=1.001"];
    replay(&Place::new(), &holed, &[&FROM_THE_START[..], &held].concat()).end().flown();
}

#[test]
fn a_start_beyond_the_end_of_the_flight() {
    refused_replay(&flight(), &[]).says(&["`from_s` is 6 s, the flight lasts 1.000 s"]);
}
