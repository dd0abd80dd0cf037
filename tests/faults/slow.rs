//! Steps that take longer than their tick: the run gets slower, never different.

use crate::flight::manifest;
use crate::saboteur::{FAULT_VARIABLE, Fault};
use crate::support::Place;
use serde_json::Value;

/// Flies 300 ticks with a step of 3 ms in every tick of the saboteur, and compares with the undisturbed flight.
fn fly_slowly(pace: &str) -> Value {
    let place = Place::new();
    let path = place.write("flight.toml", manifest());
    let fly = |name: &str, pace: &str, variables: &[(&str, &str)]| {
        let recording = place.path(name);
        let args =
            ["run", &path, "--record", &recording, "--set", "run.duration_s=0.3", "--json", "--pace", pace];
        let summary = place.start_with(&args, variables).end().with_code(0).json();
        (summary, std::fs::read(recording).unwrap())
    };
    let (_, undisturbed) = fly("undisturbed.mcap", "free", &[]);
    let (summary, slow) = fly("slow.mcap", pace, &[(FAULT_VARIABLE, &format!("{:?}", Fault::SlowStep))]);
    assert!(slow == undisturbed, "a slow step changed the recording");
    assert!(summary["host_s"].as_f64().unwrap() >= 0.9, "300 steps of 3 ms: {summary}");
    summary
}

#[test]
fn a_slow_step_in_a_paced_run_is_counted_and_changes_no_byte() {
    let summary = fly_slowly("realtime");
    let late = |name: &str| {
        let process = summary["processes"].as_array().unwrap().iter().find(|process| process["name"] == name);
        process.unwrap()["late"].as_u64().unwrap()
    };
    assert!(summary["missed_deadlines"].as_u64().unwrap() > 0, "{summary}");
    assert!(late("saboteur") > 0, "{summary}");
    // Whoever waits for nobody is at his next tick's deadline, and the slow one is not.
    assert!(late("saboteur") >= late("pilot"), "{summary}");
}

#[test]
fn a_slow_step_in_a_free_run_only_makes_it_slower() {
    let summary = fly_slowly("free");
    assert_eq!(summary["missed_deadlines"], 0, "{summary}");
}
