//! The measured flight: what is replayed, where the plants start, and the errors of the summary.

use crate::recordings::{require_same, rows};
use crate::skipped::is_left;
use crate::support::{Ended, Place, repository};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const MANIFEST: &str = "manifests/replay-nanobench.toml";
const FLIGHT: &str = "nanobench/B3_figure8_fast_rep1.csv";
/// Time of tick 0 in the flight: the manifest's `from_s`.
const FROM_S: f64 = 6.0;
/// The plants with the length of their windows.
const PLANTS: [(&str, u32); 3] = [("plant-100ms", 100), ("plant-500ms", 500), ("plant-1s", 1000)];

/// The folder of measured flights; says so where it is not given.
pub fn data() -> Option<String> {
    crate::skipped::variable_or_skip("HUMMINGBUS_DATA", "the folder of measured flights")
}

/// Replays the flight; returns the summary and the recording.
fn replay(place: &Place, data: &str) -> (Value, String) {
    let (manifest, recording) = (repository(MANIFEST), place.path("replay.mcap"));
    let args = ["run", &manifest, "--record", &recording, "--json"];
    let summary = place.start_with(&args, &[("HUMMINGBUS_DATA", data)]).end().with_code(0).json();
    (summary, recording)
}

/// The rows of a CSV file by column name.
fn csv(path: &Path) -> Vec<BTreeMap<String, f64>> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names: Vec<_> = lines.next().unwrap().split(',').map(str::to_owned).collect();
    let numbers =
        |line: &str| line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect::<Vec<_>>();
    lines.map(|line| names.iter().cloned().zip(numbers(line)).collect()).collect()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn the_flight_is_replayed_to_its_end() {
    let Some(data) = data() else { return };
    let (summary, _) = replay(&Place::new(), &data);
    assert_eq!((&summary["passed"], &summary["ticks"]), (&true.into(), &16_001.into()));
}

#[test]
fn the_measured_topic_lies_between_the_rows_of_the_flight() {
    let Some(data) = data() else { return };
    let place = Place::new();
    let measured = rows(&replay(&place, &data).1, "/player/measured");
    let flight = csv(&Path::new(&data).join(FLIGHT));
    let time_s = |row: &BTreeMap<String, f64>| row["t"] - flight[0]["t"] - FROM_S;
    let mut after = 1;
    for row in &measured {
        let now_s = row.time_ns as f64 * 1e-9;
        after += flight[after..].iter().take_while(|row| time_s(row) <= now_s).count();
        let (before, after) = (&flight[after - 1], &flight[after]);
        let part = (now_s - time_s(before)) / (time_s(after) - time_s(before));
        let blend = |name: &str| before[name] + (after[name] - before[name]) * part;
        assert!(distance(row.vector("position"), ["px", "py", "pz"].map(blend)) < 1e-8, "{row:?}");
        assert!(distance(row.vector("velocity"), ["vx", "vy", "vz"].map(blend)) < 1e-7, "{row:?}");
    }
    assert_eq!(measured.len(), 16_001);
}

/// A made-up flight of a second at 100 Hz, with the columns of the measured one.
pub fn flight() -> String {
    let header = "t,px,py,pz,vx,vy,vz,qx,qy,qz,qw,imu_gyro_x,imu_gyro_y,imu_gyro_z,\
                  motor_motor_m1,motor_motor_m2,motor_motor_m3,motor_motor_m4\n";
    let row = |index: i32| {
        let (time_s, x_m) = (f64::from(index) * 0.01, f64::from(index * index) * 1e-3);
        format!("{time_s:.3},{x_m},0,1,{time_s},0,0,0,0,0,1,0,0,0,{index},9,9,9\n")
    };
    (0..=100).map(row).fold(header.to_owned(), |text, row| text + &row)
}

/// Replays the made-up flight with a comparison's limit.
fn replay_made_up(place: &Place, limit_m: f64) -> Ended {
    let text = fs::read_to_string(repository(MANIFEST)).unwrap();
    let text = text.replace("../vehicles", &repository("vehicles")).replace("from_s = 6.0", "from_s = 0.0");
    // The made-up flight is none of the vehicle's: the limits of the real one do not hold for it.
    let is_kept = |line: &&str| !line.starts_with("max_") && !line.starts_with("judged");
    let text: Vec<&str> = text.lines().filter(is_kept).collect();
    let text = format!("{}\n", text.join("\n"));
    let limits = format!("max_position_m = {limit_m:?}\n");
    let text = text.split_inclusive('\n').fold(String::new(), |text, line| {
        let limit = if line.starts_with("window_s") { limits.as_str() } else { "" };
        text + line + limit
    });
    let manifest = place.write("made-up.toml", text);
    let data = format!("process.player.data={}", place.write("flight.csv", flight()));
    place.call(&["run", &manifest, "--set", &data, "--set", "run.duration_s=1.001"])
}

#[test]
fn a_row_that_lies_on_a_tick_is_sent_as_it_stands() {
    let place = Place::new();
    replay_made_up(&place, f64::MAX).with_code(0);
    let recording = place.path("made-up.mcap");
    for row in rows(&recording, "/player/measured").iter().step_by(10) {
        let index = f64::from(row.tick / 10);
        assert!(distance(row.vector("position"), [index * index * 1e-3, 0.0, 1.0]) < 1e-12, "{row:?}");
        assert!(distance(row.vector("velocity"), [index * 0.01, 0.0, 0.0]) < 1e-12, "{row:?}");
    }
    // A command holds until the next row.
    for row in rows(&recording, "/player/command") {
        assert_eq!(row.get("command[0]"), f64::from(row.tick / 10), "{row:?}");
    }
}

#[test]
fn a_comparison_beyond_its_limit_fails_the_run() {
    let place = Place::new();
    replay_made_up(&place, 1e-6)
        .with_code(1)
        .prints(&["  FAILED /plant-1s/state after 1 s", "(at most 0.000001)"]);
}

/// Each figure stands beside its limit; errors without a limit are values.
#[test]
fn a_summary_shows_what_a_comparison_has_judged() {
    let Some(data) = data() else { return };
    let place = Place::new();
    let args = ["run", &repository(MANIFEST), "--record", &place.path("a.mcap")];
    let ended = place.start_with(&args, &[("HUMMINGBUS_DATA", data.as_str())]).end().with_code(0);
    ended.prints(&["  ok     /plant-100ms/state after 0.1 s", "m (at most 0.06)", "deg (at most 30)"]);
    ended.prints(&["  value  /plant-500ms/state after 0.5 s", "  value  /plant-1s/state after 1 s"]);
}

#[test]
fn a_flight_that_ends_before_the_run_is_refused() {
    let place = Place::new();
    let (manifest, recording) = (repository(MANIFEST), place.path("a.mcap"));
    let data = format!("process.player.data={}", place.write("flight.csv", flight()));
    let args = ["run", &manifest, "--record", &recording, "--set", &data];
    let ended = place.call(&[&args[..], &["--set", "process.player.parameters.from_s=0.5"]].concat());
    let ended = ended.with_code(2);
    // Before it starts, not at the tick at which it would have to stop.
    ended.says(&["process `player`", "ends 0.500 s after `from_s`", "last tick lies at 16.000 s"]);
    ended.says(&["shorten run.duration_s"]);
}

#[test]
fn each_window_starts_from_the_measured_state() {
    let Some(data) = data() else { return };
    let place = Place::new();
    let recording = replay(&place, &data).1;
    let measured = rows(&recording, "/player/measured");
    for (plant, window) in PLANTS {
        let states = rows(&recording, &format!("/{plant}/state"));
        for tick in (0..16_000).step_by(window as usize) {
            let error_m = distance(states[tick + 1].vector("position"), measured[tick].vector("position"));
            assert!(error_m < 0.005, "{plant}, tick {tick}: the next sample is {error_m} m away");
        }
    }
}

/// The lines that `cat` prints of a topic, by tick.
fn cat(place: &Place, recording: &str, topic: &str) -> BTreeMap<u64, Value> {
    let ended = place.call(&["cat", recording, "--topic", topic]).with_code(0);
    let lines = ended.output.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines.map(|line| (line["tick"].as_u64().unwrap(), line["fields"].clone())).collect()
}

#[test]
fn the_summary_s_errors_are_those_of_the_recording() {
    if is_left("`judging::comparisons_are_the_same_without_a_recording` has comparisons") {
        return;
    }
    let Some(data) = data() else { return };
    let place = Place::new();
    let (summary, recording) = replay(&place, &data);
    let measured = cat(&place, &recording, "/player/measured");
    for (index, (plant, window)) in PLANTS.into_iter().enumerate() {
        let simulated = cat(&place, &recording, &format!("/{plant}/state"));
        let ends = (1..=16_000 / u64::from(window)).map(|number| number * u64::from(window));
        let position =
            |fields: &Value| ["x", "y", "z"].map(|axis| fields[format!("position.{axis}")].as_f64().unwrap());
        let squares: Vec<_> = ends
            .map(|tick| distance(position(&simulated[&tick]), position(&measured[&tick])).powi(2))
            .collect();
        let rms_m = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let errors = &summary["compare"][index];
        assert_eq!(errors["windows"].as_u64(), Some(squares.len() as u64), "{plant}");
        assert!(
            (errors["position_rms_m"].as_f64().unwrap() - rms_m).abs() < 1e-9,
            "{plant}: {rms_m}, {errors}"
        );
        let is_finite = |key: &str| errors[key].as_f64().is_some_and(f64::is_finite);
        assert!(is_finite("velocity_rms_m_s") && is_finite("attitude_rms_deg"), "{errors}");
    }
}

#[test]
fn two_replays_are_the_same_file() {
    let Some(data) = data() else { return };
    let (one, other) = (Place::new(), Place::new());
    let (a, b) = (replay(&one, &data).1, replay(&other, &data).1);
    require_same(&fs::read(a).unwrap(), &b);
}
