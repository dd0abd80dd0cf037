//! Profiled runs: every tick is in the profile, and the recording knows nothing of it.

use crate::nodes::{manifest, sender};
use crate::recordings::{require_same, topics};
use crate::skipped::is_left;
use crate::support::{Ended, Place, repository};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// Ticks of a run here.
const TICKS: u32 = 2000;
const DURATION: &str = "run.duration_s=2";
/// Terminals have this many columns.
const COLUMNS: usize = 100;

/// Profiles hover.toml; the recording is `hover.mcap`.
fn hover(place: &Place, more: &[&str]) -> Ended {
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("hover.mcap"));
    let args = ["profile", &manifest, "--record", &recording, "--set", DURATION];
    place.call(&[&args, more].concat()).flown()
}

/// The entry of `list` whose `key` is `value`.
#[track_caller]
fn find<'a>(list: &'a Value, key: &str, value: &str) -> &'a Value {
    let mut entries = list.as_array().unwrap().iter();
    entries.find(|entry| entry[key] == value).unwrap_or_else(|| panic!("no {key} {value} in {list}"))
}

/// Ticks from one of the node's to the next in hover.toml.
fn period_ticks(node: &str) -> u32 {
    if node == "mocap" { 5 } else { 1 }
}

#[test]
fn a_profiled_run_records_the_same_file() {
    let (plain, profiled) = (Place::new(), Place::new());
    let recording = plain.path("hover.mcap");
    let args = ["run", &repository("manifests/hover.toml"), "--record", &recording, "--set", DURATION];
    plain.call(&args).flown();
    let (trace, page) = (profiled.path("trace.json"), profiled.path("page.html"));
    let summary = hover(&profiled, &["--trace", &trace, "--html", &page, "--json"]).json();
    assert_eq!(summary["profile"]["files"], serde_json::json!({ "trace": trace, "html": page }));
    require_same(&std::fs::read(recording).unwrap(), &profiled.path("hover.mcap"));
}

/// The times of the measurements are fields of recorded samples.
#[test]
fn ages_without_a_recording_are_said_to_count_from_the_stamps() {
    let note = "ages count from the stamps of samples";
    let place = Place::new();
    let args = ["profile", &repository("manifests/hover.toml"), "--record", "none", "--set", DURATION];
    place.call(&args).flown().prints(&[note]);
    let json = place.call(&[&args[..], &["--json"]].concat()).flown().json();
    assert_eq!(json["profile"]["age_from_stamps"], true);
    let recorded = hover(&place, &[]);
    assert!(!recorded.output.contains(note), "{recorded}");
}

#[test]
fn every_tick_of_every_node_is_in_the_profile() {
    let profile = &hover(&Place::new(), &["--json"]).json()["profile"];
    assert_eq!(
        (&profile["ticks"], &profile["noted"], &profile["left_out"]),
        (&TICKS.into(), &(6 * TICKS + TICKS / 5).into(), &0.into())
    );
    for name in ["controller", "ekf", "imu", "mocap", "pilot", "plant", "recorder"] {
        let node = find(&profile["nodes"], "name", name);
        let ticks = TICKS / period_ticks(name);
        // What a node waited for before its first tick is the start of the run.
        for (part, count) in [("compute", ticks), ("publish", ticks), ("wait", ticks - 1)] {
            assert_eq!(node[part]["count"], count, "{part} of {name}");
        }
        assert!(node["wake_up"]["count"].as_u64().unwrap() < ticks.into());
        let at = |key: &str| node["compute"][key].as_f64().unwrap();
        let quantiles = ["p50_us", "p90_us", "p99_us", "p99.9_us", "max_us"].map(at);
        assert!(quantiles.is_sorted() && quantiles[0] > 0.0, "{name}: {quantiles:?}");
    }
    assert_eq!(profile["pacing"], Value::Null);
}

#[test]
fn the_critical_path_and_the_ages_are_those_of_the_loop() {
    let profile = &hover(&Place::new(), &["--json"]).json()["profile"];
    let path = &profile["critical_path"];
    assert_eq!(path["tick_time"]["count"], TICKS);
    let shares = path["places"].as_array().unwrap().iter().map(|place| place["share"].as_f64().unwrap());
    assert!((shares.sum::<f64>() - 1.0).abs() < 1e-9);
    // The command is what closes the loop, so its sender is on every path; the recorder is in no loop.
    assert_eq!(find(&path["places"], "place", "controller")["ticks"], TICKS);
    assert!(!path.to_string().contains("recorder"), "{path}");
    let sources: Vec<_> = profile["age"].as_array().unwrap().iter().map(|age| &age["source"]).collect();
    assert_eq!(sources, ["/ekf/estimate", "/imu/imu", "/mocap/mocap", "/pilot/set_point", "/plant/state"]);
    for age in profile["age"].as_array().unwrap() {
        assert_eq!((&age["command"], &age["host"]["count"]), (&"/controller/command".into(), &TICKS.into()));
        // Every edge of the loop but one is of the same tick; a pose of motion capture is sent for ten, and measured 10 ms before it
        // arrives.
        let max_us = match age["source"].as_str().unwrap() {
            "/mocap/mocap" => 19_000.0,
            "/plant/state" => 9000.0,
            _ => 0.0,
        };
        assert_eq!(age["simulated"]["max_us"], max_us, "{age}");
    }
}

#[test]
fn the_age_of_a_pose_counts_from_its_measurement() {
    let profile =
        &hover(&Place::new(), &["--json", "--set=process.mocap.parameters.delay_ms=40"]).json()["profile"];
    let age = find(&profile["age"], "source", "/mocap/mocap")["simulated"].clone();
    // 40 ms late, and used for 10 ms.
    assert_eq!(age["max_us"], 49_000.0, "{age}");
    assert!((40_000.0..=49_000.0).contains(&age["p50_us"].as_f64().unwrap()), "{age}");
}

#[test]
fn ages_follow_from_the_periods_of_the_nodes() {
    let more = ["--json", "--set=process.imu.period_ticks=5"];
    let profile = &hover(&Place::new(), &more).json()["profile"];
    let age = |source| find(&profile["age"], "source", source)["simulated"].clone();
    // A tick is 1 ms; a reading is used at its own tick and the four after it, a pose at nine after it.
    for (source, max_us) in [("/imu/imu", 4000.0), ("/plant/state", 9000.0)] {
        assert_eq!((&age(source)["max_us"], &age(source)["count"]), (&max_us.into(), &TICKS.into()));
    }
    assert_eq!(age("/pilot/set_point")["max_us"], 0.0);
    assert_eq!(find(&profile["nodes"], "name", "imu")["compute"]["count"], TICKS / 5);
}

#[test]
fn the_node_that_a_tick_waits_for_is_named() {
    let place = Place::new();
    let nap = "parameters = { at_tick = 100, nap_ms = 60 }";
    let (to_slow, to_fast) = (
        "inputs.input = { topic = \"/fast/note\", delay_ticks = 1, initial = {} }",
        "inputs.input = \"/slow/note\"",
    );
    let nodes = [sender("slow", 1, &format!("{to_slow}\n{nap}")), sender("fast", 1, to_fast)];
    let path = place.write("nap.toml", manifest(200, &nodes));
    let profile = &place.call(&["profile", &path, "--json"]).with_code(0).json()["profile"];
    // A sleep lasts at least as long as it is asked to.
    let slow = find(&profile["critical_path"]["places"], "place", "slow");
    assert!(slow["time"]["max_us"].as_f64().unwrap() >= 60e3, "{slow}");
    let tick_time = &profile["critical_path"]["tick_time"]["max_us"];
    assert!(tick_time.as_f64() >= slow["time"]["max_us"].as_f64(), "{tick_time}, {slow}");
}

#[test]
fn a_paced_run_tells_how_its_deadlines_were_kept() {
    let place = Place::new();
    let summary = hover(&place, &["--pace", "4", "--json"]).json();
    let pacing = &summary["profile"]["pacing"];
    assert_eq!(pacing["jitter"]["count"], TICKS);
    assert_eq!(pacing["missed_deadlines"], summary["missed_deadlines"]);
    assert_eq!(pacing["overruns"].as_array().unwrap().len(), 7);
    hover(&place, &["--pace", "4"]).prints(&["deadlines [µs]", "jitter: deadline to grant", "overruns: "]);
}

#[test]
fn the_tables_fit_a_terminal_and_follow_the_summary() {
    let ended = hover(&Place::new(), &[]);
    ended.prints(&["hover: 2000 ticks", "node, per tick [µs]", "transport, ", "age in /controller/command"]);
    ended.prints(&["critical path [µs]", "p99.9", " % /plant/state → imu "]);
    let (_, tables) = ended.output.split_once("node, per tick").unwrap();
    let longest = tables.lines().max_by_key(|line| line.chars().count()).unwrap();
    assert!(longest.chars().count() <= COLUMNS, "{longest}");
}

#[test]
fn the_exit_code_is_that_of_a_run() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let args = ["profile", &hover, "--record", &place.path("a.mcap")];
    place.call(&args).with_code(0).prints(&["\npassed\n"]);
    place.call(&[&args[..], &["--set", DURATION]].concat()).with_code(1).prints(&["\nFAILED\n"]);
    let nowhere = place.path("nowhere/page.html");
    let ended = place.call(&[&args[..], &["--html", &nowhere]].concat()).with_code(2);
    ended.says(&["cannot create", &nowhere]);
}

#[test]
fn a_run_that_is_stopped_is_profiled_up_to_there() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let args = ["profile", &hover, "--record", &place.path("a.mcap"), "--json"];
    let mut launch = place.start_endless(&args);
    launch.await_ticks(50);
    launch.signal(Signal::INT);
    let summary = launch.end().with_code(1).json();
    let (ticks, profile) = (&summary["ticks"], &summary["profile"]);
    assert!(ticks.as_u64().unwrap() >= 50);
    assert_eq!(&find(&profile["nodes"], "name", "plant")["compute"]["count"], ticks);
}

#[test]
fn a_run_whose_manifest_asks_for_a_profile_writes_page_and_trace_beside_its_recording() {
    if is_left("`a_profiled_run_records_the_same_file` has a profile") {
        return;
    }
    let place = Place::new();
    let plain = place.path("plain.mcap");
    let hover = repository("manifests/hover.toml");
    place.call(&["run", &hover, "--record", &plain, "--set", DURATION]).flown();
    let text = format!("include = [{hover:?}]\n[run]\nduration_s = 2.0\nprofile = true\n");
    let (manifest, recording) = (place.write("profiled.toml", text), place.path("profiled.mcap"));
    let summary = place.call(&["run", &manifest, "--record", &recording, "--json"]).flown().json();
    let (page, trace) = (place.path("profiled.profile.html"), place.path("profiled.trace.json"));
    assert_eq!(summary["profile"]["files"], serde_json::json!({ "trace": trace, "html": page }));
    assert!(std::fs::read_to_string(page).unwrap().contains("id=\"data\">"));
    assert!(!slices(&trace, "plant").is_empty());
    assert!(topics(&recording) == topics(&plain), "the messages differ");
    // As a flag it is not even in the manifest that is attached.
    let args = ["run", &hover, "--record", &recording, "--set", DURATION, "--set", "run.profile=true"];
    place.call(&args).flown();
    require_same(&std::fs::read(plain).unwrap(), &recording);
}

/// The ticks of `node` in a trace, in the order of their starts: number, start and length in µs.
fn slices(trace: &str, node: &str) -> Vec<(u32, f64, f64)> {
    let trace: Value = serde_json::from_str(&std::fs::read_to_string(trace).unwrap()).unwrap();
    let events = trace["traceEvents"].as_array().unwrap();
    let is_name = |event: &&Value| event["name"] == "process_name" && event["args"]["name"] == node;
    let process = &events.iter().find(is_name).unwrap()["pid"];
    let tick = |event: &Value| {
        let tick = event["name"].as_str()?.strip_prefix("tick ")?.parse().ok()?;
        Some((tick, event["ts"].as_f64()?, event["dur"].as_f64()?))
    };
    let mut ticks: Vec<_> = events.iter().filter(|event| event["pid"] == *process).filter_map(tick).collect();
    ticks.sort_by(|a, b| a.1.total_cmp(&b.1));
    ticks
}

#[test]
fn whoever_was_a_node_at_a_tick_is_the_one_that_is_profiled() {
    let place = Place::new();
    let nap = |ms: u32, at_tick: u32| format!("parameters = {{ nap_ms = {ms}, at_tick = {at_tick} }}");
    let nodes = [sender("slow", 1, &nap(60, 130)), sender("fast", 1, "inputs.input = \"/slow/note\"")];
    // It shadows from tick 100 on; what its predecessor does at tick 130, it does at tick 180.
    let swap =
        format!("[[swap]]\nprocess = \"slow\"\nat_tick = 150\nshadow_ticks = 50\nwith.{}\n", nap(60, 180));
    let path = place.write("swap.toml", manifest(200, &nodes) + &swap);
    let trace = place.path("trace.json");
    let ended = place.call(&["profile", &path, "--trace", &trace, "--json"]).with_code(0);
    assert_eq!(ended.json()["profile"]["noted"], 3 * 200, "{ended}");
    let ticks = slices(&trace, "slow");
    assert_eq!(ticks.iter().map(|(tick, ..)| *tick).collect::<Vec<_>>(), (0..200).collect::<Vec<_>>());
    for nap in [130, 180] {
        // A sleep lasts at least as long as it is asked to; the shadow slept at neither tick.
        assert!(ticks[nap].2 >= 60e3, "tick {nap}: {:?}", ticks[nap]);
    }
}

/// The process with which `node` began: a standby has the same name.
fn first_process_of(place: &Place, node: &str) -> Pid {
    let is_first = |pid: &Pid| {
        let environment = std::fs::read(format!("/proc/{}/environ", pid.as_raw_nonzero())).unwrap();
        environment.split(|&byte| byte == 0).any(|variable| variable == b"HUMMINGBUS_GENERATION=0")
    };
    let mut of_node = place.processes().into_iter().filter(|(_, name)| name == node).map(|(pid, _)| pid);
    of_node.find(is_first).unwrap()
}

#[test]
fn a_profile_goes_on_over_a_swap_a_restart_and_a_promotion() {
    if is_left("other tests have profiles of runs without successions") {
        return;
    }
    let place = Place::new();
    let tables = "[process.controller]\non_exit = \"restart\"\n[process.ekf]\non_exit = \"standby\"\n\
                  [[swap]]\nprocess = \"imu\"\nat_tick = 700\n";
    let hover = repository("manifests/hover.toml");
    let text = format!("include = [{hover:?}]\n[run]\nduration_s = 1.5\n{tables}");
    let (manifest, trace) = (place.write("changes.toml", text), place.path("trace.json"));
    let record = place.path("changes.mcap");
    let mut launch = place.start(&["profile", &manifest, "--record", &record, "--trace", &trace, "--json"]);
    for (node, tick) in [("controller", 300), ("ekf", 1000)] {
        launch.hold_at(tick);
        kill_process(first_process_of(&place, node), Signal::KILL).unwrap();
        launch.release();
    }
    let ended = launch.end();
    let summary = ended.json();
    for (process, purpose, tick) in
        [("controller", "restart", 300), ("imu", "swap", 700), ("ekf", "standby", 1000)]
    {
        let mut successions = summary["successions"].as_array().unwrap().iter();
        let found = successions.any(|succession| {
            (&succession["process"], &succession["purpose"], &succession["take_over_tick"])
                == (&process.into(), &purpose.into(), &tick.into())
        });
        assert!(found, "no {purpose} of {process} at {tick}: {ended}");
    }
    let profile = &summary["profile"];
    assert_eq!(profile["noted"], 6 * 1500 + 300, "{}", summary["successions"]);
    assert_eq!(profile["critical_path"]["tick_time"]["count"], 1500);
    for node in ["controller", "ekf", "imu", "mocap", "pilot", "plant", "recorder"] {
        let ticks = slices(&trace, node);
        // In the order of host time: one process after the other, none of their ticks twice.
        let expected: Vec<_> = (0..1500).step_by(period_ticks(node) as usize).collect();
        assert_eq!(ticks.iter().map(|(tick, ..)| *tick).collect::<Vec<_>>(), expected);
    }
}
