//! Commands with gaps, and commands that a log writes only when they change.

use crate::support;
use flights::{Flight, FlightsError, KnownRotors, csv};
use std::ops::Range;
use support::{Motion, Place};

const CHANNELS: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
"#;

/// The made-up flight of 10 s whose commands are there where `is_logged` is true.
fn read(is_logged: impl Fn(f64) -> bool, channels: &str, extra: &str) -> Result<Flight, FlightsError> {
    let text = Motion::default().csv();
    let (header, rows) = text.split_once('\n').expect("a header");
    let commands: Vec<usize> =
        header.split(',').enumerate().filter(|(_, name)| name.starts_with('m')).map(|(at, _)| at).collect();
    let row = |line: &str| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if !is_logged(cells[0].parse().expect("a time")) {
            commands.iter().for_each(|at| cells[*at] = "");
        }
        cells.join(",") + "\n"
    };
    let place = Place::new();
    let rows: String = rows.lines().map(row).collect();
    place.write("log.csv", format!("{header}\n{rows}").as_bytes());
    place.load("log.csv", channels, extra)
}

fn gap(t: f64) -> bool {
    !(2.0..5.0).contains(&t)
}

#[test]
fn a_gap_of_the_commands_is_noted_with_its_consequence() {
    let flight = read(gap, CHANNELS, "").unwrap();
    let note = flight.notes.iter().find(|note| note.starts_with("command: gaps")).expect("a note");
    for part in [
        "the longest from 1.990 s to 5.000 s",
        "unknown there and for 0.5 s after each",
        "`on_change = true`",
    ] {
        assert!(note.contains(part), "no {part:?} in {note}");
    }
    let known = KnownRotors::of(&flight);
    assert!(known.hold(0.5, 1.9) && !known.hold(1.9, 2.1) && !known.hold(5.2, 5.4) && known.hold(5.5, 10.0));
    let (written, text) = csv(&flight).unwrap();
    let in_gap = |line: &str| {
        let time_s: f64 = line.split(',').next().and_then(|cell| cell.parse().ok()).unwrap_or(0.0);
        (2.0..4.995).contains(&time_s)
    };
    assert!(!text.lines().any(in_gap) && written.rows > 600, "{:?}", written.notes);
}

#[test]
fn commands_written_on_change_have_no_gap() {
    let channels = CHANNELS.replace("unit = \"count\"", "unit = \"count\", on_change = true");
    let flight = read(gap, &channels, "").unwrap();
    assert!(flight.commands_on_change && !flight.notes.iter().any(|note| note.contains("command: gaps")));
    assert!(KnownRotors::of(&flight).hold(0.5, 10.0));
    let (written, _) = csv(&flight).unwrap();
    assert_eq!(written.rows, 1001);
    let wrong = CHANNELS.replace("unit = \"rad/s\"", "unit = \"rad/s\", on_change = false");
    let error = read(gap, &wrong, "").unwrap_err().to_string();
    assert!(error.contains("on_change") && error.contains("`command` alone"), "{error}");
}

/// The command before a gap does not hold at a start within it; one within its period does.
#[test]
fn a_part_that_begins_in_a_gap_begins_with_the_next_command() {
    let begins_s = |channels: &str, extra: &str| read(gap, channels, extra).unwrap().command.time_s[0];
    assert!((begins_s(CHANNELS, "from_s = 3.0") - 2.0).abs() < 1e-9);
    assert_eq!(begins_s(CHANNELS, "from_s = 1.005"), 0.0);
    let on_change = CHANNELS.replace("unit = \"count\"", "unit = \"count\", on_change = true");
    assert_eq!(begins_s(&on_change, "from_s = 3.0"), 0.0);
}

#[test]
fn a_table_needs_commands_and_motion_at_one_time() {
    let mut flight = read(|_| true, CHANNELS, "").unwrap();
    flight.command.time_s.iter_mut().for_each(|time_s| *time_s += 1000.0);
    let error = csv(&flight).unwrap_err().to_string();
    for part in [
        "expected an attitude",
        "command from 1000.000 s",
        "attitude from 0.000 s to 10.000 s",
        "correct the clocks",
    ] {
        assert!(error.contains(part), "no {part:?} in {error}");
    }
}

/// The made-up flight of 10 s with noisy commands, which `change` replaces in some rows; `extra` is in the flight's table.
fn merged(change: impl Fn(usize, usize, &[f64]) -> Option<f64>, extra: &str) -> Flight {
    let text = Motion::default().csv();
    let (header, rows) = text.split_once('\n').expect("a header");
    let noise = |at: usize, rotor: usize| 76.0 + ((at * 7919 + rotor * 131) % 97) as f64 / 20.0;
    let columns: Vec<Vec<f64>> =
        (0..4).map(|rotor| (0..=1000).map(|at| noise(at, rotor)).collect()).collect();
    let row = |(at, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        for (rotor, column) in columns.iter().enumerate() {
            cells[rotor + 1] = change(at, rotor, column).unwrap_or(column[at]).to_string();
        }
        cells.join(",") + "\n"
    };
    let rows: String = rows.lines().enumerate().map(row).collect();
    let place = Place::new();
    place.write("log.csv", format!("{header}\n{rows}").as_bytes());
    place.load("log.csv", CHANNELS, extra).unwrap()
}

/// Row `at` of the straight line over the rows `gap`, as `interpolate` of pandas fills them.
fn interpolated(column: &[f64], gap: &Range<usize>, at: usize) -> f64 {
    let (before, behind) = (gap.start - 1, gap.end);
    let part = (at - before) as f64 / (behind - before) as f64;
    column[before] + (column[behind] - column[before]) * part
}

#[test]
fn commands_that_an_exporter_filled_in_are_a_gap_and_noted() {
    let gap = 300..400;
    let zeros = merged(|at, _, _| gap.contains(&at).then_some(0.0), "");
    let line =
        |at: usize, _: usize, column: &[f64]| gap.contains(&at).then(|| interpolated(column, &gap, at));
    for (flight, kind) in
        [(zeros, "zeros, although the vehicle flies"), (merged(line, ""), "straight lines of all rotors")]
    {
        let note =
            flight.notes.iter().find(|note| note.contains("filled in by an exporter")).expect("a note");
        for part in ["100 of 1001 samples in 1 stretch were filled in", kind, "from 3.00 s to 3.99 s"] {
            assert!(note.contains(part), "no {part:?} in {note}");
        }
        assert_eq!(flight.command.time_s.len(), 901);
        let known = KnownRotors::of(&flight);
        assert!(
            known.hold(0.5, 2.99) && !known.hold(3.1, 3.2) && !known.hold(4.1, 4.4) && known.hold(4.51, 10.0)
        );
    }
    let plain = merged(|_, _, _| None, "");
    let steady = merged(|_, _, _| Some(76.0), "");
    assert!([&plain, &steady].iter().all(|flight| flight.command.time_s.len() == 1001), "{:?}", steady.notes);
}

/// From the log to the rows that are compared: both fillers in one log, of which the flight is a part.
#[test]
fn rows_that_an_exporter_filled_in_are_not_compared() {
    let (zeros, line) = (300..400, 600..700);
    let filler = |at: usize, _: usize, column: &[f64]| {
        if zeros.contains(&at) {
            return Some(0.0);
        }
        line.contains(&at).then(|| interpolated(column, &line, at))
    };
    let flight = merged(filler, "from_s = 1.0");
    let notes: Vec<&String> =
        flight.notes.iter().filter(|note| note.contains("filled in by an exporter")).collect();
    // Times are those of the flight, which begins 1 s after the log.
    let [of_zeros, of_line] = notes[..] else { panic!("{:?}", flight.notes) };
    assert!(of_zeros.contains("zeros") && of_zeros.contains("from 2.00 s to 2.99 s"), "{of_zeros}");
    assert!(of_line.contains("straight lines") && of_line.contains("from 5.00 s to 5.99 s"), "{of_line}");
    // A window counts if the rotors are known throughout.
    let known = KnownRotors::of(&flight);
    for (from_s, to_s, is_known) in [
        (0.5, 1.9, true),
        (1.9, 2.1, false),
        (2.4, 2.6, false),
        (3.1, 3.4, false),
        (3.51, 4.9, true),
        (5.4, 5.6, false),
        (6.1, 6.4, false),
        (6.51, 9.0, true),
    ] {
        assert_eq!(known.hold(from_s, to_s), is_known, "{from_s} s to {to_s} s: {:?}", known.stretches_s());
    }
    // The table that a replay flies has no row of them.
    let (written, text) = csv(&flight).unwrap();
    let times = text.lines().skip(1).map(|row| row.split(',').next().unwrap().parse::<f64>().unwrap());
    let is_filled = |time_s: &f64| (1.995..2.995).contains(time_s) || (4.995..5.995).contains(time_s);
    assert_eq!((times.filter(is_filled).count(), written.rows), (0, 701), "{:?}", written.notes);
    assert!(written.notes.iter().any(|note| note.contains("200 of 901 rows")), "{:?}", written.notes);
}
