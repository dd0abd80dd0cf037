//! Runs that are watched and steered while they fly: what is seen is true, and nothing of it changes a recording.

use crate::recordings::require_same;
use crate::skipped::{first, is_left};
use crate::support::{Ended, Launch, Place, poll, repository};
use crate::terminal::Terminal;
use rustix::process::Signal;
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::thread::sleep;
use std::time::Duration;

/// Duration of a run that no test outlasts, in s.
const ENDLESS: u32 = 4_000_000;
/// Duration of a run that is to come to its end, in s.
const SHORT: u32 = 17;
/// Pace at which a [`SHORT`] run lasts for 340 s, longer than the watchdog of a launch waits.
const SLOW: &str = "0.05";

/// Starts hover.toml at `pace`, recording to `name`, and waits until it is well on its way.
fn take_off<'a>(place: &'a Place, name: &str, pace: &str, duration_s: u32) -> Launch<'a> {
    take_off_with(place, name, pace, duration_s, &[])
}

/// The same with `more` arguments.
fn take_off_with<'a>(
    place: &'a Place,
    name: &str,
    pace: &str,
    duration_s: u32,
    more: &[String],
) -> Launch<'a> {
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path(name));
    let duration = format!("run.duration_s={duration_s}");
    let args = ["run", &manifest, "--record", &recording, "--pace", pace, "--set", &duration, "--json"];
    let more = more.iter().map(String::as_str);
    let mut launch = place.start(&args.into_iter().chain(more).collect::<Vec<_>>());
    launch.await_ticks(100);
    launch
}

/// `hummingbus VERB --run ID` and `args`, for the run that is up in `place`.
fn call(place: &Place, verb: &str, args: &[&str]) -> Ended {
    place.start(&[&[verb, "--run", &place.run_id()], args].concat()).end_among_others()
}

fn ctl(place: &Place, args: &[&str]) -> Value {
    call(place, "ctl", &[args, &["--json"]].concat()).with_code(0).json()
}

/// The tick after `hummingbus ctl` with `args`.
fn tick_after(place: &Place, args: &[&str]) -> u64 {
    ctl(place, args)["tick"].as_u64().unwrap()
}

fn state(place: &Place) -> (String, u64) {
    let status = ctl(place, &["status"]);
    (status["state"].as_str().unwrap().to_owned(), status["tick"].as_u64().unwrap())
}

/// Requires that a paused run stands still at a pace at which it would be at its end soon.
fn require_still(place: &Place, held: u64) {
    ctl(place, &["pace", "free"]);
    for _ in 0..5 {
        assert_eq!(state(place), ("paused".to_owned(), held), "a paused run stands still");
    }
    ctl(place, &["pace", SLOW]);
}

#[test]
fn pausing_stepping_and_pacing_change_no_byte_of_a_recording() {
    if is_left(
        "`view::a_run_that_is_watched_and_steered_writes_the_same_bytes_and_ends_with_its_page` steers a run",
    ) {
        return;
    }
    let place = Place::new();
    let flight = take_off(&place, "steered.mcap", SLOW, SHORT);
    let held = tick_after(&place, &["pause"]);
    assert!(held >= 100, "{held}");
    require_still(&place, held);
    assert_eq!(tick_after(&place, &["pause"]), held);
    for answer in [ctl(&place, &["pause"]), ctl(&place, &["status"])] {
        assert_eq!(answer["run_id"], place.run_id(), "{answer}");
        assert!(answer["manifest"].as_str().unwrap().ends_with("hover.toml"), "{answer}");
    }
    let run = format!("run {} (hover.toml): paused at tick {held} of ", place.run_id());
    call(&place, "ctl", &["status"]).with_code(0).prints(&[&run]);
    assert_eq!(tick_after(&place, &["step", "7"]), held + 7);
    assert_eq!(tick_after(&place, &["step"]), held + 8);
    require_still(&place, held + 8);
    ctl(&place, &["pace", "realtime"]);
    ctl(&place, &["pace", SLOW]);
    ctl(&place, &["resume"]);
    let stepped = tick_after(&place, &["step", "3"]);
    assert!(stepped >= held + 11, "{stepped}");
    assert_eq!(state(&place), ("paused".to_owned(), stepped));
    ctl(&place, &["pace", "2"]);
    ctl(&place, &["pace", SLOW]);
    ctl(&place, &["resume"]);
    ctl(&place, &["pace", "free"]);
    flight.end().flown();
    let undisturbed = place.path("undisturbed.mcap");
    let args = ["run", &repository("manifests/hover.toml"), "--record", &undisturbed];
    let duration = format!("run.duration_s={SHORT}");
    place.call(&[&args[..], &["--set", &duration]].concat()).flown();
    require_same(&std::fs::read(undisturbed).unwrap(), &place.path("steered.mcap"));
}

#[test]
fn every_pause_holds_the_tick_that_it_names() {
    let place = Place::new();
    let flight = take_off(&place, "often.mcap", "free", ENDLESS);
    for _ in first(10, "pauses", 0..30) {
        let held = tick_after(&place, &["pause"]);
        assert_eq!(state(&place), ("paused".to_owned(), held));
        ctl(&place, &["resume"]);
    }
    ctl(&place, &["stop"]);
    flight.end().with_code(1);
}

#[test]
fn a_run_can_be_paused_for_longer_than_the_watchdog_waits() {
    if is_left("it waits for watchdogs; `every_pause_holds_the_tick_that_it_names` pauses") {
        return;
    }
    let place = Place::new();
    let watchdogs = ["controller", "ekf", "imu", "mocap", "pilot", "plant", "recorder"]
        .map(|name| format!("--set=process.{name}.watchdog_ms_host=5000"));
    let flight = take_off_with(&place, "long.mcap", "realtime", ENDLESS, &watchdogs);
    let held = tick_after(&place, &["pause"]);
    sleep(Duration::from_secs(8));
    assert_eq!(state(&place), ("paused".to_owned(), held));
    ctl(&place, &["resume"]);
    poll("the run does not go on", || (state(&place).1 > held + 100).then_some(()));
    ctl(&place, &["stop"]);
    flight.end().with_code(1);
}

#[test]
fn a_stop_and_ctrl_c_end_a_paused_run_at_its_tick() {
    for is_signal in first(1, "ways to end", [true, false]) {
        let place = Place::new();
        let flight = take_off(&place, "stopped.mcap", "realtime", 1000);
        let held = tick_after(&place, &["pause"]);
        if is_signal {
            flight.signal(Signal::INT);
        } else {
            ctl(&place, &["stop"]);
        }
        let summary = flight.end().with_code(1).json();
        assert_eq!((&summary["stopped_early"], &summary["ticks"]), (&true.into(), &held.into()));
        // Those of hover.toml.
        assert_eq!((&summary["passed"], &summary["not_judged"]), (&false.into(), &6.into()));
    }
}

#[test]
fn a_program_can_speak_to_the_socket_and_nonsense_is_refused() {
    let place = Place::new();
    let flight = take_off(&place, "spoken.mcap", "realtime", 1000);
    let run_dir = format!("tmp/hummingbus-{}-{}", bus::process::user_id(), place.run_id());
    let socket = UnixStream::connect(place.path(&format!("{run_dir}/ctl.sock"))).unwrap();
    let mut answers = BufReader::new(socket.try_clone().unwrap()).lines();
    let mut ask = |line: &str| -> Value {
        writeln!(&socket, "{line}").unwrap();
        serde_json::from_str(&answers.next().unwrap().unwrap()).unwrap()
    };
    assert_eq!(ask("nonsense")["answer"], "refused");
    assert_eq!(ask(r#"{"request":"fly"}"#)["answer"], "refused");
    assert_eq!(ask(r#"{"request":"pace","pace":0}"#)["answer"], "refused");
    assert_eq!(ask(r#"{"request":"status"}"#)["run_id"], place.run_id());
    assert_eq!(ask(r#"{"request":"stop"}"#)["answer"], "done");
    flight.end().with_code(1);
}

#[test]
fn a_step_to_the_end_ends_the_run_and_one_beyond_it_is_refused() {
    let place = Place::new();
    let flight = take_off(&place, "stepped.mcap", SLOW, SHORT);
    let held = tick_after(&place, &["pause"]);
    call(&place, "ctl", &["step", "100000"]).with_code(2).says(&["only", "ends at tick 17000"]);
    assert_eq!(state(&place), ("paused".to_owned(), held));
    ctl(&place, &["pace", "free"]);
    assert_eq!(tick_after(&place, &["step", &(17_000 - held).to_string()]), 17_000);
    flight.end().flown();
}

#[test]
fn a_later_request_overtakes_a_long_step() {
    let place = Place::new();
    let flight = take_off(&place, "overtaken.mcap", "realtime", 1000);
    let run_id = place.run_id();
    let step = place.start(&["ctl", "--run", &run_id, "step", "900000"]);
    while state(&place).0 != "stepping" {
        sleep(Duration::from_millis(2));
    }
    let held = tick_after(&place, &["pause"]);
    step.end_among_others().with_code(2).says(&["a later request took its place"]);
    assert_eq!(state(&place), ("paused".to_owned(), held));
    call(&place, "ctl", &["stop"]).with_code(0).prints(&["stopping at the next tick boundary"]);
    flight.end().with_code(1);
}

#[test]
fn a_run_that_is_not_there_or_has_ended_is_an_error() {
    let place = Place::new();
    let flight = take_off(&place, "gone.mcap", "realtime", ENDLESS);
    let run_id = place.run_id();
    for verb in [&["ctl", "pause"][..], &["top", "--once"]] {
        let ended = place.start(&[verb, &["--run", "0-0"]].concat()).end_among_others();
        ended.with_code(2).says(&["no run `0-0` is alive", &run_id, "hover.toml"]);
    }
    ctl(&place, &["stop"]);
    flight.end().with_code(1);
    let ended = place.start(&["ctl", "pause", "--run", &run_id]).end_among_others().with_code(2);
    assert!(ended.error.contains("is alive"), "{ended}");
}

#[test]
fn a_backup_that_cannot_be_read_is_refused_before_the_run_is_asked() {
    let place = Place::new();
    let nowhere = place.path("nowhere.toml");
    place.call(&["swap", "controller", "--with", &nowhere]).with_code(2).says(&["cannot read", &nowhere]);
    place.call(&["swap", "controller", "--with", "kind='"]).with_code(2).says(&["its text is no TOML"]);
}

#[test]
fn top_once_shows_what_flies() {
    let place = Place::new();
    let flight = take_off(&place, "seen.mcap", "realtime", 1000);
    let view = call(&place, "top", &["--once", "--json"]).with_code(0).json();
    assert_eq!(
        (&view["state"], &view["pace"], &view["end_tick"]),
        (&"running".into(), &"realtime".into(), &1_000_000.into())
    );
    assert!(
        view["real_time_factor"].as_f64().unwrap() > 0.0 && view["tick"].as_u64().unwrap() >= 100,
        "{view:#}"
    );
    let processes = view["processes"].as_array().unwrap();
    let names: Vec<&str> = processes.iter().map(|process| process["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["clock", "controller", "ekf", "imu", "mocap", "pilot", "plant", "recorder"]);
    for process in &processes[1..] {
        let us = |key| process[key].as_f64().unwrap();
        assert!(us("step_p50_us") > 0.0 && us("step_p99_us") >= us("step_p50_us"), "{process:#}");
        assert!(process["cpu_share"].is_number() && process["tick"].as_u64().unwrap() >= 100, "{process:#}");
    }
    let topics = view["topics"].as_array().unwrap();
    let topic = |name| topics.iter().find(|topic| topic["name"] == name).unwrap();
    let (state, pose) = (topic("/plant/state"), topic("/plant/pose"));
    assert_eq!((&state["publisher"], &state["lost"]), (&"plant".into(), &0.into()));
    // Ten times as many, but for the samples of the moment.
    let samples = |topic: &Value| topic["samples"].as_f64().unwrap();
    assert!((samples(state) / 10.0 - samples(pose)).abs() <= 2.0, "{state:#} {pose:#}");
    assert!(state["rate_hz"].as_f64().unwrap() > pose["rate_hz"].as_f64().unwrap());
    let page = call(&place, "top", &["--once"]).with_code(0);
    page.prints(&["hover.toml  run ", "running\n", "p99 µs", "/plant/state", "holds the run"][..4]);
    // The recording then has a whole second more.
    ctl(&place, &["step", "1500"]);
    let paused = call(&place, "top", &["--once"]).with_code(0);
    paused.prints(&["paused\n", "holds the run", "0.00 × real time"]);
    assert!(!paused.output.contains("height - m"), "{paused}");
    ctl(&place, &["stop"]);
    flight.end().with_code(1);
}

#[test]
fn top_without_a_terminal_says_what_to_do() {
    Place::new().call(&["top"]).with_code(2).says(&["no terminal", "--once"]);
}

#[test]
fn the_keyboard_of_top_steers_a_run() {
    let place = Place::new();
    let flight = take_off(&place, "keys.mcap", "realtime", 1000);
    let mut terminal = Terminal::start(&place, &["top", "--run", &place.run_id()]);
    terminal.await_texts(&["hover.toml", "running", "pace realtime", "/plant/state", "recorder", "x stop"]);
    assert!(terminal.is_taken());
    terminal.press(" ");
    terminal.await_texts(&["  paused", "paused at tick ", "holds the run", "0.00 × real time"]);
    let (_, held) = state(&place);
    terminal.press("s");
    terminal.await_texts(&[&format!("paused at tick {}, 1 tick on", held + 1)]);
    terminal.press("S");
    terminal.await_texts(&[&format!("paused at tick {}, 100 ticks on", held + 101)]);
    assert_eq!(state(&place), ("paused".to_owned(), held + 101));
    for (key, pace) in [
        ("+", "2"),
        ("+", "4"),
        ("-", "2"),
        ("f", "free"),
        ("-", "realtime"),
        ("-", "0.5"),
        ("r", "realtime"),
    ] {
        terminal.press(key);
        terminal.await_texts(&[&format!("× real time  pace {pace}  ")]);
    }
    terminal.press(" ");
    terminal.await_texts(&["  running", &format!("running on from tick {}", held + 101)]);
    terminal.press("x");
    terminal.await_texts(&["stop the run? y / n"]);
    terminal.press("n");
    terminal.press("x");
    terminal.await_texts(&["stop the run? y / n"]);
    assert_eq!(state(&place).0, "running");
    terminal.press("y");
    terminal.await_texts(&["  ended"]);
    flight.end_among_others().with_code(1);
    terminal.press("q");
    assert!(terminal.end().success());
    poll("the screen is not given back", || (!terminal.is_taken()).then_some(()));
}

#[test]
fn who_leaves_top_leaves_the_run_flying() {
    let place = Place::new();
    let flight = take_off(&place, "left.mcap", "realtime", 1000);
    for leave in [Some("q"), Some("\x1b"), Some("\x03"), None] {
        let mut terminal = Terminal::start(&place, &["top", "--run", &place.run_id()]);
        terminal.await_texts(&["running"]);
        match leave {
            Some(key) => terminal.press(key),
            None => terminal.signal(Signal::TERM),
        }
        assert!(terminal.end().success());
        poll("the screen is not given back", || (!terminal.is_taken()).then_some(()));
        assert_eq!(state(&place).0, "running");
    }
    ctl(&place, &["stop"]);
    flight.end().with_code(1);
}
