//! Paused runs that go back to one of their checkpoints: what is flown then is what a run from that checkpoint flies.

use crate::recordings::first_tick;
use crate::skipped::first;
use crate::support::{Place, repository};
use std::fs;

/// Returns the answer to a request, as JSON.
fn ctl(place: &Place, run: &str, args: &[&str]) -> serde_json::Value {
    let all = [&["ctl"], args, &["--run", run, "--json"]].concat();
    place.start(&all).end_among_others().with_code(0).json()
}

#[test]
fn a_run_that_went_back_flies_as_one_from_the_checkpoint_and_its_recording_says_so() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    for compose in first(1, "compositions", ["none", "all"]) {
        let record = place.path("a.mcap");
        let args = ["run", &hover, "--record", &record, "--checkpoint-every", "100ms", "--compose", compose];
        let mut launch = place.start_endless(&args);
        launch.await_ticks(450);
        let run = place.run_id();
        let refused = |args: &[&str], says: &str| {
            let all = [&["ctl", "rewind"], args, &["--run", &run]].concat();
            place.start(&all).end_among_others().with_code(2).says(&[says]);
        };
        refused(&[], "is not paused");
        ctl(&place, &run, &["pause"]);
        // A known distance behind a checkpoint.
        let paused = ctl(&place, &run, &["status"])["tick"].as_u64().unwrap();
        let end = (paused / 100 + 2) * 100 + 37;
        ctl(&place, &run, &["step", &(end - paused).to_string()]);
        refused(
            &["123"],
            "there is no checkpoint of this run of tick 123: the run has those of the ticks 100, 200",
        );
        let aside = place.path("a.rewind-1.mcap");
        if compose == "none" {
            fs::write(&aside, "a letter").unwrap();
            refused(&[], "a.rewind-1.mcap");
            fs::remove_file(&aside).unwrap();
        }
        let back = ctl(&place, &run, &["rewind"]);
        assert_eq!(back["tick"], end - 37);
        let status = ctl(&place, &run, &["status"]);
        assert_eq!((status["tick"].as_u64(), status["state"].as_str()), (Some(end - 37), Some("paused")));
        assert_eq!(status["pace"], "realtime");
        ctl(&place, &run, &["step", "10"]);
        let file = place.path("a.300.ckpt");
        let text = ctl(&place, &run, &["rewind", &file])["text"].as_str().unwrap().to_owned();
        assert_eq!(text, format!("rewound from tick {} to tick 300, where it is paused", end - 27));
        // It is where the checkpoint is: the same is written again.
        let again = place.path("again.ckpt");
        assert_eq!(ctl(&place, &run, &["checkpoint", &again])["tick"], 300);
        assert!(fs::read(&again).unwrap() == fs::read(&file).unwrap(), "another checkpoint");
        refused(&["400"], "of tick 400: the run has those of the ticks 100, 200, 300");
        refused(&[&place.path("a.400.ckpt")], "a rewind goes back");
        ctl(&place, &run, &["step", &(end - 300).to_string()]);
        ctl(&place, &run, &["stop"]);
        let rewound =
            [format!("rewound from tick {end} to tick {}", end - 37), "to tick 300; up to there".to_owned()];
        let rewound: Vec<&str> = rewound.iter().map(String::as_str).collect();
        let ended = launch.end().with_code(1);
        ended.prints(&rewound);
        ended.prints(&["stopped before its end"]);
        assert!(!ended.output.contains("  conditions: not judged"), "{ended}");
        let [first, second] = [1, 2].map(|number| place.path(&format!("a.rewind-{number}.mcap")));
        assert_eq!([&first, &second, &record].map(|path| first_tick(path)), [0, end - 37, 300]);
        let expected = "begins at tick 300, and from there on all messages are those of";
        place.call(&["diff", &first, &record]).with_code(1).prints(&[expected]);
        let said = format!(
            "went back in flight from tick {} to tick 300; what was flown up to there is in a.rewind-2.mcap",
            end - 27
        );
        place.call(&["cat", &record, "--topic", "/plant/state"]).with_code(0).says(&[&said]);
        // As a run from the checkpoint.
        let (single, until) = (place.path("b.mcap"), format!("run.duration_s={}", end as f64 * 1e-3));
        let args = ["run", "--from", &file, "--pace", "free", "--set", &until, "--record", &single];
        place.call(&[&args[..], &["--in-process"]].concat()).flown();
        place.call(&["diff", &first, &single]).with_code(1).prints(&[expected]);
    }
}

/// The judge goes back too: verdicts are those of one flight without a detour.
#[test]
fn a_run_that_went_back_is_judged_as_a_whole() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let undisturbed =
        place.call(&["run", &hover, "--record", "none", "--in-process", "--json"]).with_code(0).json();
    let manifest = place.write("m.toml", format!("include = [{hover:?}]\n"));
    let args = ["run", &manifest, "--record", "none", "--checkpoint-every", "500ms", "--json", "--pace", "2"];
    let mut launch = place.start(&args);
    launch.await_ticks(1200);
    let run = place.run_id();
    ctl(&place, &run, &["pause"]);
    let to = ctl(&place, &run, &["rewind", "1000"]);
    assert_eq!(to["tick"], 1000);
    ctl(&place, &run, &["pace", "free"]);
    ctl(&place, &run, &["resume"]);
    let summary = launch.end().with_code(0).json();
    assert_eq!(summary["pass"], undisturbed["pass"]);
    assert_eq!((&summary["rewinds"][0]["to_tick"], &summary["first_tick"]), (&1000.into(), &1000.into()));
    let ticks: Vec<u64> =
        summary["checkpoints"].as_array().unwrap().iter().map(|one| one["tick"].as_u64().unwrap()).collect();
    assert!(ticks.starts_with(&[500, 1000, 1500, 2000]), "{ticks:?}");
}

/// Each tick is in the profile once: those of the flight that was left are not.
#[test]
fn a_profile_of_a_run_that_went_back_begins_there() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let (record, trace) = (place.path("a.mcap"), place.path("trace.json"));
    let args =
        ["profile", &hover, "--record", &record, "--trace", &trace, "--checkpoint-every", "100ms", "--json"];
    let mut launch = place.start_endless(&args);
    launch.await_ticks(350);
    let run = place.run_id();
    ctl(&place, &run, &["pause"]);
    assert_eq!(ctl(&place, &run, &["rewind", "200"])["tick"], 200);
    ctl(&place, &run, &["step", "50"]);
    ctl(&place, &run, &["stop"]);
    let summary = launch.end().with_code(1).json();
    let (ticks, profile) = (summary["ticks"].as_u64().unwrap(), &summary["profile"]);
    assert!(ticks >= 50, "{summary}");
    assert_eq!(profile["ticks"], ticks, "{profile}");
    assert_eq!((&profile["first_tick"], &summary["rewinds"][0]["to_tick"]), (&200.into(), &200.into()));
    let plant = profile["nodes"].as_array().unwrap().iter().find(|node| node["name"] == "plant").unwrap();
    assert_eq!(plant["compute"]["count"], ticks, "{plant}");
    let trace = fs::read_to_string(trace).unwrap();
    assert!(trace.contains("\"tick 200\"") && !trace.contains("\"tick 199\""), "the trace has other ticks");
}

#[test]
fn a_profile_from_a_checkpoint_says_where_it_begins() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let (record, short) = (place.path("a.mcap"), "run.duration_s=0.3");
    let args = ["run", &hover, "--record", &record, "--checkpoint-every", "200ms", "--set", short];
    place.call(&[&args[..], &["--in-process"]].concat()).flown();
    let file = place.path("a.200.ckpt");
    let ended = place.call(&["profile", "--from", &file, "--record", &place.path("b.mcap"), "--set", short]);
    ended.flown().prints(&["profiled from tick 200 on"]);
}

#[test]
fn a_checkpoint_of_another_run_is_refused() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let args = ["run", &hover, "--record", &place.path("other.mcap"), "--checkpoint-every", "100ms"];
    place
        .call(&[&args[..], &["--set", "run.seed=2", "--set", "run.duration_s=0.2", "--in-process"]].concat())
        .flown();
    // An earlier run of the same manifest, under the same name.
    let args = ["run", &hover, "--record", &place.path("a.mcap"), "--checkpoint-every", "100ms"];
    place.call(&[&args[..], &["--set", "run.duration_s=0.15", "--in-process"]].concat()).flown();
    let mut launch = place.start_endless(&["run", &hover, "--record", &place.path("a.mcap")]);
    launch.await_ticks(200);
    let run = place.run_id();
    ctl(&place, &run, &["pause"]);
    let refused = |to: &[&str], says: &str| {
        let all = [&["ctl", "rewind"], to, &["--run", &run]].concat();
        place.start(&all).end_among_others().with_code(2).says(&[says]);
    };
    refused(&[&place.path("other.100.ckpt")], "other.100.ckpt is a checkpoint of another run");
    refused(&[], "the run has written none");
    refused(&["100"], "the run has written none");
    fs::write(place.path("letter.ckpt"), "a letter").unwrap();
    refused(&[&place.path("letter.ckpt")], "no checkpoint of hummingbus");
    // It flies on, and writes one itself.
    ctl(&place, &run, &["checkpoint"]);
    ctl(&place, &run, &["step", "20"]);
    ctl(&place, &run, &["rewind"]);
    ctl(&place, &run, &["stop"]);
    launch.end().with_code(1).prints(&["rewound from tick"]);
}
