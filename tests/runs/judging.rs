//! Runs without a recording are judged in flight, and come to the verdict that their recording has.

use crate::nodes::{sender, table};
use crate::refusals::good;
use crate::skipped::{cases, first, quick_or};
use crate::support::{Ended, Place, repository};
use serde_json::Value;

/// The summary of `manifest` flown with `more`, as JSON.
fn flown(place: &Place, manifest: &str, more: &[&str]) -> (Ended, Value) {
    let ended = place.call(&[&["run", manifest, "--json"], more].concat());
    let summary = ended.json();
    (ended, summary)
}

/// Parts of a summary that are functions of the flight.
const OF_THE_FLIGHT: [&str; 7] =
    ["passed", "ticks", "stopped_early", "pass", "measures", "compare", "computing_times"];

/// Flies `manifest` with its recording and without, in each of these ways of composition, and requires the same verdict,
/// figure for figure; returns it.
fn require_same_verdict(manifest: &str, ways: &[&str], more: &[&str]) -> Value {
    let place = Place::new();
    let recording = place.path("with.mcap");
    let recorded = [&["--record", &recording, "--compose", "all"], more].concat();
    let (with, expected) = flown(&place, manifest, &recorded);
    for compose in ways {
        let unrecorded = [&["--record", "none", "--compose", compose], more].concat();
        let (without, found) = flown(&place, manifest, &unrecorded);
        for part in OF_THE_FLIGHT {
            assert_eq!(
                found[part], expected[part],
                "{part} of {manifest} with --compose {compose}\n{without}"
            );
        }
        assert_eq!(without.code, with.code, "{manifest}\n{without}");
        assert_eq!(found["recording"], Value::Null);
    }
    expected
}

#[test]
fn a_run_without_a_recording_has_the_verdict_of_its_recording() {
    let (both, composed) = (["none", "all"].as_slice(), ["all"].as_slice());
    // Its last condition begins 12 s after the start.
    let take_off_s = quick_or("12.5", "20.0", "ends of a take-off");
    let flights = [
        ("hover", "12.0", both),
        ("rig-a", "30.0", composed),
        ("slung-load", "18.0", composed),
        ("take-off-attitude", take_off_s, composed),
        ("swap-laws", "12.0", both),
        ("wall-stop-open", "20.0", composed),
        ("computing-time", "6.0", both),
    ];
    // A plain flight, spans, swaps, and steps that take time.
    let quick = ["hover", "take-off-attitude", "swap-laws", "computing-time"];
    let is_quick = |name: &str| quick.contains(&name);
    for (manifest, seconds, ways) in cases("manifests", flights, |(name, ..)| is_quick(name)) {
        let duration = format!("run.duration_s={seconds}");
        let ways = first(1, &format!("compositions of {manifest}"), ways.iter().copied());
        let manifest = repository(&format!("manifests/{manifest}.toml"));
        let verdict = require_same_verdict(&manifest, &ways, &["--set", &duration]);
        let conditions = verdict["pass"].as_array().unwrap();
        assert!(conditions.iter().any(|pass| !pass["values"].as_array().unwrap().is_empty()), "{verdict}");
    }
}

#[test]
fn comparisons_are_the_same_without_a_recording() {
    let place = Place::new();
    let flight = format!("process.player.data={}", place.write("flight.csv", crate::replay::flight()));
    let manifest = repository("manifests/replay-nanobench.toml");
    let from = ["--set", "process.player.parameters.from_s=0.0", "--set", "run.duration_s=1.001"];
    let verdict =
        require_same_verdict(&manifest, &["none", "all"], &[&["--set", &flight], &from[..]].concat());
    assert_eq!(verdict["compare"].as_array().unwrap().len(), 3, "{verdict}");
}

/// The lines of a printed summary that begin with a mark, and the last one.
fn verdict_lines(ended: &Ended) -> Vec<&str> {
    let is_verdict = |line: &&str| {
        ["  ok ", "  FAILED", "  value", "passed", "FAILED"].iter().any(|mark| line.starts_with(mark))
    };
    ended.output.lines().filter(is_verdict).collect()
}

#[test]
fn a_failed_condition_is_printed_as_with_a_recording_and_has_its_exit_code() {
    let place = Place::new();
    let pass = "[[pass]]\nname = \"above 2 m\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"cm\"\n\
                statistic = \"every\"\nmin = 200.0\n";
    let manifest = place.write("high.toml", good() + pass);
    let with = place.call(&["run", &manifest, "--record", &place.path("a.mcap")]).with_code(1);
    let without = place.call(&["run", &manifest, "--record", "none"]).with_code(1);
    assert_eq!(verdict_lines(&with), verdict_lines(&without));
    without.prints(&["  FAILED above 2 m: ", "cm (at least 200)"]);
    assert!(!without.output.contains("recording"), "{without}");
    assert!(!std::path::Path::new(&place.path("high.mcap")).exists());
}

/// The recorder's place is taken by a judge, which reads the topics of the conditions and no other.
#[test]
fn only_topics_of_conditions_are_read() {
    let place = Place::new();
    let check = |more: &[&str]| {
        let manifest = repository("manifests/hover.toml");
        place.call(&[&["check", &manifest, "--json"], more].concat()).with_code(0).json()
    };
    let inputs = |plan: &Value, name: &str| -> Option<Vec<String>> {
        let nodes = plan["nodes"].as_array().unwrap();
        let node = nodes.iter().find(|node| node["name"] == name)?;
        let ports = node["inputs"].as_array().unwrap().iter();
        Some(ports.map(|input| input["port"].as_str().unwrap().to_owned()).collect())
    };
    let recorded = check(&[]);
    assert_eq!(inputs(&recorded, "recorder").unwrap().len(), 8);
    assert_eq!(inputs(&recorded, "judge"), None);
    let judged = check(&["--set", "run.record=none"]);
    assert_eq!(inputs(&judged, "recorder"), None);
    assert_eq!(inputs(&judged, "judge").unwrap(), ["/plant/state"]);
}

#[test]
fn a_manifest_without_a_recorder_is_judged() {
    let place = Place::new();
    let pass = "[[pass]]\nname = \"low\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"max\"\nmax = 1\n";
    let without = good().replace("[process.recorder]\nkind = \"recorder\"\n", pass);
    let manifest = place.write("judged.toml", &without);
    place.call(&["run", &manifest]).with_code(0).prints(&["  ok     low: ", "passed"]);
    // A process of the user's own may be called so, and the judge then has another name.
    let own = without + "[process.judge]\nkind = \"ideal\"\ninputs.state = \"/plant/state\"\n";
    let manifest = place.write("own.toml", own);
    place.call(&["check", &manifest]).with_code(0).prints(&["judge (ideal)", "judge-2 (judge)"]);
    place.call(&["run", &manifest]).with_code(0).prints(&["  ok     low: "]);
}

#[test]
fn a_run_without_recording_and_conditions_has_no_judge() {
    let place = Place::new();
    let manifest = place.write("good.toml", good());
    let (_, summary) = flown(&place, &manifest, &["--record", "none"]);
    let names = summary["processes"].as_array().unwrap().iter().map(|process| process["name"].clone());
    let names: Vec<Value> = names.collect();
    assert_eq!(names, ["clock", "controller", "ekf", "imu", "mocap", "pilot", "plant"]);
    assert_eq!(summary["passed"], true);
}

/// `--record` says which file, also where the manifest says that there is none.
#[test]
fn a_recording_that_is_asked_for_is_made_whatever_the_manifest_says() {
    let place = Place::new();
    let manifest = place.write("good.toml", good().replace("[run]", "[run]\nrecord = \"none\""));
    place.call(&["run", &manifest]).with_code(0);
    assert!(!std::path::Path::new(&place.path("good.mcap")).exists());
    let recording = place.path("asked.mcap");
    place
        .call(&["run", &manifest, "--record", &recording])
        .with_code(0)
        .prints(&["recording: ", "asked.mcap"]);
    assert!(recorder::reader::Recording::open(recording.as_ref()).unwrap().topic("/plant/state").is_ok());
}

/// Messages of a program of one's own are known to that program alone, until it has joined.
#[test]
fn a_message_of_one_s_own_is_judged_and_its_unknown_field_ends_the_run() {
    let place = Place::new();
    let condition = |field: &str| {
        format!(
            "[run]\nduration_s = 0.1\n{}[[pass]]\nname = \"counts\"\ntopic = \"/source/note\"\nfield = \"{field}\"\n\
             unit = \"\"\nstatistic = \"last\"\nmin = 0\n",
            sender("source", 1, "") + &table("reader", "inputs.input = \"/source/note\"")
        )
    };
    let manifest = place.write("own.toml", condition("tick"));
    place.call(&["run", &manifest]).with_code(0).prints(&["  ok     counts: 99 "]);
    let manifest = place.write("unknown.toml", condition("lap"));
    place.call(&["run", &manifest]).with_code(2).says(&["/source/note has no field `lap`", "tick", "judge"]);
}

#[test]
fn a_judge_in_a_manifest_is_refused() {
    let place = Place::new();
    let manifest = place.write("judge.toml", good() + "[process.judge]\nkind = \"judge\"\n");
    let ended = place.call(&["run", &manifest]).with_code(2);
    ended.says(&["judge.toml:", "`judge` is not a kind for a manifest", "leave the process out"]);
}

#[test]
fn a_stopped_run_is_not_judged() {
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let mut launch = place.start_endless(&["run", &manifest, "--record", "none", "--json"]);
    launch.await_ticks(100);
    launch.signal(rustix::process::Signal::INT);
    let summary = launch.end().with_code(1).json();
    assert_eq!((&summary["stopped_early"], &summary["pass"]), (&true.into(), &Value::Array(Vec::new())));
}

#[test]
fn a_killed_judge_ends_the_run_in_order() {
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let mut launch = place.start_endless(&["run", &manifest, "--record", "none"]);
    launch.await_ticks(100);
    rustix::process::kill_process(place.process_of("judge"), rustix::process::Signal::KILL).unwrap();
    launch.end().with_code(2).says(&["`judge`", "was killed by signal 9", "aborted at tick"]);
}
