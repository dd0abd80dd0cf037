//! Set points of a person: sent at a tick, recorded, and sent again by a run with the recording.

use crate::recordings::require_same;
use crate::skipped::is_steady;
use crate::support::{Place, repository};
use crate::view::Page;
use recorder::reader::Recording;
use serde_json::{Value, json};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

const SET_POINT: &str = "/pilot/set_point";

fn asking(process: &str, altitude_m: f64, roll_rad: f64) -> Value {
    json!({ "process": process, "altitude_m": altitude_m, "roll_rad": roll_rad, "pitch_rad": 0.05, "yaw_rad": 0.2 })
}

/// The values of a field of the set points.
fn flown(recording: &str, field: &str) -> Vec<f64> {
    let recording = Recording::open(Path::new(recording)).unwrap();
    recording.series(&[(SET_POINT, field)]).unwrap().remove(0).value
}

/// The values without those that follow a like one.
fn changes(values: &[f64]) -> Vec<f64> {
    let mut changes = values.to_vec();
    changes.dedup();
    changes
}

#[test]
fn what_a_person_asks_is_recorded_and_flown_again_bit_for_bit() {
    if !is_steady() {
        return;
    }
    let place = Place::new();
    let (manifest, recording, again) =
        (repository("manifests/by-hand.toml"), place.path("flown.mcap"), place.path("again.mcap"));
    let run = place.start(&[
        "run",
        &manifest,
        "--record",
        &recording,
        "--view",
        "--no-open",
        "--set",
        "run.duration_s=4000",
    ]);
    let mut page = Page::of(&run);
    let await_ticks = |page: &mut Page, ticks: u64| {
        let begin =
            page.await_event(|event| event["run"]["state"] == "running")["run"]["tick"].as_u64().unwrap();
        page.await_event(|event| event["run"]["tick"].as_u64() > Some(begin + ticks))
    };
    await_ticks(&mut page, 50);
    // For as long as somebody asks, however slow the machine is.
    for (altitude_m, roll_rad) in [(2.0, 0.1), (9.0, -0.15)] {
        for _ in 0..20 {
            let (head, _) = page.post("fly", &asking("pilot", altitude_m, roll_rad));
            assert!(head.starts_with("HTTP/1.1 204"), "{head}");
            sleep(Duration::from_millis(10));
        }
    }
    // Then he falls silent.
    sleep(Duration::from_millis(300));
    await_ticks(&mut page, 50);
    for (process, part) in [("plant", "`plant` takes no set points"), ("nobody", "no process `nobody`")] {
        let (head, body) = page.post("fly", &asking(process, 1.0, 0.0));
        assert!(head.starts_with("HTTP/1.1 409") && body.contains(part), "{head} {body}");
    }
    page.done(&json!({ "request": "stop" }));
    page.await_event(|event| event["run"]["state"] == "ended");
    let (head, body) = page.post("fly", &asking("pilot", 1.0, 0.0));
    assert!(head.starts_with("HTTP/1.1 409") && body.contains("the run has ended"), "{head} {body}");
    drop(page);
    run.end().with_code(1);

    // The initial values, those that were asked for within the limits, and the fallback.
    let altitudes = changes(&flown(&recording, "altitude"));
    assert_eq!(altitudes, [1.5, 2.0, 4.0]);
    let rolls = changes(&flown(&recording, "roll"));
    assert_eq!((rolls[0], *rolls.last().unwrap()), (0.0, 0.0), "{rolls:?}");
    assert!(rolls.contains(&0.1) && rolls.contains(&-0.15), "{rolls:?}");
    assert_eq!(*flown(&recording, "yaw").last().unwrap(), 0.2, "yaw holds");

    let ticks = Recording::open(Path::new(&recording)).unwrap().messages().last().unwrap().unwrap().tick + 1;
    let duration = format!("run.duration_s={}", f64::from(ticks) * 1e-3);
    let data = format!("process.pilot.parameters.data={recording:?}");
    let fly_again = |recording: &str| {
        let args =
            ["run", &manifest, "--record", recording, "--pace", "free", "--set", &duration, "--set", &data];
        place.call(&args).flown();
    };
    fly_again(&again);
    // The manifest says where the set points come from, and is attached.
    let compared = place.call(&["diff", &recording, &again]).with_code(1);
    compared.prints(&["all messages are the same", "the attachment `by-hand.toml` differs"]);
    let once_more = place.path("once-more.mcap");
    fly_again(&once_more);
    require_same(&std::fs::read(again).unwrap(), &once_more);
}

#[test]
fn a_run_that_nobody_flies_is_the_same_each_time_and_under_any_host() {
    let place = Place::new();
    let manifest = repository("manifests/by-hand.toml");
    let recordings = ["a.mcap", "b.mcap"].map(|name| place.path(name));
    for (recording, host) in recordings.iter().zip([&[][..], &["--in-process"]]) {
        let args = ["run", &manifest, "--record", recording, "--pace", "free", "--set", "run.duration_s=2"];
        place.call(&[&args[..], host].concat()).with_code(0);
    }
    place.call(&["diff", &recordings[0], &recordings[1]]).with_code(0);
    assert_eq!(changes(&flown(&recordings[0], "altitude")), [1.5]);
}

#[test]
fn a_recording_without_set_points_is_refused_in_words() {
    let place = Place::new();
    let recording = place.path("hover.mcap");
    let args =
        ["run", &repository("manifests/hover.toml"), "--record", &recording, "--set", "run.duration_s=0.1"];
    place.call(&args).with_code(1);
    let manifest = repository("manifests/by-hand.toml");
    let data = format!("process.pilot.parameters.data={recording:?}");
    let refused = |set: &str| place.call(&["check", &manifest, "--set", &data, "--set", set]).with_code(2);
    refused("process.pilot.parameters.topic=\"/none\"").says(&["/none", "/pilot/set_point"]);
}
