//! Checkpoints of runs in which processes take each other's places: a run that goes on flies with whoever flies then.

use crate::checkpoints::{HOSTS, checkpoints, require_goes_on};
use crate::skipped::{cases, first};
use crate::support::{Place, repository};
use rustix::process::Signal;
use std::fs;

/// Keys of another law, for a swap in flight.
const CASCADE: &str = "kind = \"cascade\"";
/// Keys of the same law with another gain.
const SOFT: &str =
    "parameters.gains.roll = { proportional_1_s2 = 12.0, integral_1_s3 = 0.0, derivative_1_s = 6.0 }";

/// The ticks of the checkpoints of a run, by its summary as JSON.
fn ticks(summary: &serde_json::Value) -> Vec<u64> {
    summary["checkpoints"]
        .as_array()
        .unwrap()
        .iter()
        .map(|written| written["tick"].as_u64().unwrap())
        .collect()
}

#[test]
fn a_process_that_is_the_same_as_the_dead_one_is_the_one_of_the_manifest() {
    for on_exit in first(1, "policies", ["standby", "restart"]) {
        let place = Place::new();
        let hover = repository("manifests/hover.toml");
        let (whole, later) = (place.path("a.mcap"), place.path("b.mcap"));
        let on_exit = format!("process.controller.on_exit={on_exit}");
        let args =
            ["run", &hover, "--record", &whole, "--set", &on_exit, "--checkpoint-every", "500ms", "--json"];
        // The next standby joins by host time: at real time long before the checkpoint.
        let mut launch = place.start(&[&args[..], &["--pace", "1", "--set", "run.duration_s=4"]].concat());
        launch.hold_at(700);
        rustix::process::kill_process(place.process_of_generation("controller", 0), Signal::KILL).unwrap();
        launch.release();
        // It ends before all its conditions can hold.
        let summary = launch.end().with_code(1).json();
        assert_eq!(summary["missed_checkpoints"], serde_json::json!([]));
        assert_eq!(ticks(&summary), (1..8).map(|number| number * 500).collect::<Vec<u64>>());
        place.call(&["run", "--from", &place.path("a.3000.ckpt"), "--record", &later]).flown();
        require_goes_on(&place, &whole, &later, 3000);
    }
}

/// As a standby with another law does, which the two processors of the thesis have.
#[test]
fn a_standby_with_another_law_goes_on() {
    let place = Place::new();
    let two = repository("manifests/llp-hlp.toml");
    let (whole, later) = (place.path("a.mcap"), place.path("b.mcap"));
    // The next standby joins by host time: at real time long before the checkpoint.
    let args = ["run", &two, "--record", &whole, "--checkpoint-every", "1s", "--json", "--pace", "1"];
    let mut launch = place.start(&[&args[..], &["--set", "run.duration_s=5"]].concat());
    launch.hold_at(700);
    rustix::process::kill_process(place.process_of_generation("controller", 0), Signal::KILL).unwrap();
    launch.release();
    let summary = launch.end().json();
    assert_eq!(summary["missed_checkpoints"], serde_json::json!([]));
    let tick = u32::try_from(ticks(&summary)[3]).unwrap();
    let from = place.path(&format!("a.{tick}.ckpt"));
    place.call(&["run", "--from", &from, "--record", &later]).flown();
    require_goes_on(&place, &whole, &later, tick);
}

/// The checkpoint holds what the request has asked for. A run that goes on writes checkpoints of its own.
#[test]
fn a_swap_of_a_live_run_is_in_its_checkpoints() {
    for with in first(1, "ways to swap", [CASCADE, SOFT]) {
        let place = Place::new();
        let hover = repository("manifests/hover.toml");
        let (whole, later) = (place.path("a.mcap"), place.path("b.mcap"));
        let args = ["run", &hover, "--record", &whole, "--checkpoint-every", "1s", "--json", "--pace", "2"];
        let with = match with {
            CASCADE => format!("{CASCADE}\ngains = {:?}", repository("controllers/gains/cascade.toml")),
            other => other.to_owned(),
        };
        let mut launch = place.start(&args);
        launch.await_ticks(1200);
        let swap = ["swap", "controller", "--with", &with, "--run", &place.run_id()];
        place.start(&swap).end_among_others().with_code(0);
        let summary = launch.end().json();
        assert_eq!(summary["missed_checkpoints"], serde_json::json!([]));
        assert_eq!(ticks(&summary).len(), 11);
        assert!(summary["recording"].is_string());
        for host in first(1, "hosts", HOSTS) {
            let args = ["run", "--from", &place.path("a.6000.ckpt"), "--record", &later];
            place.call(&[&args[..], host].concat()).flown();
            require_goes_on(&place, &whole, &later, 6000);
        }
        let last = place.path("c.mcap");
        let args = ["run", "--from", &place.path("b.9000.ckpt"), "--record", &last, "--in-process"];
        place.call(&args).flown();
        require_goes_on(&place, &whole, &last, 9000);
    }
}

/// The backup joins again at the checkpoint's tick, also where it shadows more slowly than the clock ticks.
#[test]
fn a_checkpoint_within_a_swap_goes_on() {
    let place = Place::new();
    let swaps = [
        ("swap-identical", 1, "run.duration_s=3.2"),
        ("swap-gains", 1, "run.duration_s=3.2"),
        ("swap-laws", 1, "run.duration_s=9.2"),
        ("swap-gains", 4, "run.duration_s=3.2"),
    ];
    for (name, period_ticks, more) in cases("swaps", swaps, |(_, period_ticks, _)| *period_ticks == 4) {
        let manifest = repository(&format!("manifests/{name}.toml"));
        let ticks = [2801, 2950, 2998, 3000].map(|tick| format!("[[checkpoint]]\nat_tick = {tick}\n"));
        let manifest = place.write("m.toml", format!("include = [{manifest:?}]\n{}", ticks.concat()));
        let (whole, later) = (place.path("a.mcap"), place.path("b.mcap"));
        let period = format!("process.controller.period_ticks={period_ticks}");
        let args = ["run", &manifest, "--record", &whole, "--set", more, "--set", &period];
        place.call(&args).flown();
        // A flight with other laws is the longest.
        let is_taken = |tick: u32| name != "swap-laws" || tick == 2950;
        let what = format!("checkpoints of {name}");
        for tick in cases(&what, [2801, 2950, 2998, 3000], |tick| is_taken(*tick)) {
            let file = place.path(&format!("a.{tick}.ckpt"));
            place.call(&["run", "--from", &file, "--record", &later]).flown();
            require_goes_on(&place, &whole, &later, tick);
        }
    }
}

#[test]
fn a_checkpoint_of_a_pause_within_a_live_swap_goes_on() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let whole = place.path("a.mcap");
    let mut launch = place.start_endless(&["run", &hover, "--record", &whole]);
    launch.await_ticks(300);
    let run = place.run_id();
    let ctl = |args: &[&str]| {
        let all = [&["ctl"], args, &["--run", &run, "--json"]].concat();
        place.start(&all).end_among_others().with_code(0).json()["tick"].as_u64().unwrap()
    };
    let paused = ctl(&["pause"]);
    let take_over = (paused + 300).to_string();
    let args = ["swap", "controller", "--with", SOFT, "--at-tick", &take_over, "--shadow-ticks", "200"];
    let swap = place.start(&[&args[..], &["--run", &run]].concat());
    let waits =
        format!("paused at tick {paused}, and the swap waits until it goes on: `hummingbus ctl resume --run");
    swap.await_said(&waits);
    place.process_of_generation("controller", 1);
    let mut files = Vec::new();
    for ticks in ["150", "150", "50"] {
        let tick = ctl(&["step", ticks]);
        let file = place.path(&format!("at-{tick}.ckpt"));
        assert_eq!(ctl(&["checkpoint", &file]), tick);
        files.push((tick, file));
    }
    assert_eq!(files[1].0, paused + 300);
    let end = ctl(&["step", "100"]);
    swap.end_among_others().with_code(0);
    ctl(&["stop"]);
    launch.end().with_code(1);
    for (tick, file) in files {
        let (later, end) = (place.path("b.mcap"), format!("run.duration_s={}", end as f64 * 1e-3));
        place.call(&["run", "--from", &file, "--pace", "free", "--set", &end, "--record", &later]).flown();
        require_goes_on(&place, &whole, &later, u32::try_from(tick).unwrap());
    }
}

/// The filter before has another state: no part holds what the one that joins remembers.
#[test]
fn a_checkpoint_that_cannot_be_written_is_a_warning_and_the_next_one_is() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let swap = "[[swap]]\nprocess = \"ekf\"\nat_tick = 1000\nshadow_ticks = 100\n\
                with = { kind = \"ideal\", parameters = {}, inputs = { state = \"/plant/state\" } }\n";
    let manifest = place.write("m.toml", format!("include = [{hover:?}]\n{swap}"));
    let whole = place.path("a.mcap");
    let args =
        ["run", &manifest, "--record", &whole, "--checkpoint-every", "950ms", "--set", "run.duration_s=3"];
    let ended = place.call(&args);
    ended.prints(&["warning: no checkpoint of tick 950: another process joins `ekf` at tick 900"]);
    ended.flown();
    assert!(fs::exists(&whole).unwrap());
    assert_eq!(checkpoints(&place, "a").iter().map(|(tick, _)| *tick).collect::<Vec<_>>(), [1900, 2850]);
    let later = place.path("b.mcap");
    place.call(&["run", "--from", &place.path("a.1900.ckpt"), "--record", &later]).flown();
    require_goes_on(&place, &whole, &later, 1900);
}

#[test]
fn a_place_that_is_taken_meanwhile_costs_one_checkpoint_and_not_the_run() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let whole = place.path("a.mcap");
    let args = ["run", &hover, "--record", &whole, "--checkpoint-every", "1s", "--json", "--pace", "4"];
    let mut launch = place.start(&args);
    launch.await_ticks(100);
    fs::create_dir(place.path("a.2000.ckpt")).unwrap();
    let summary = launch.end().with_code(0).json();
    let missed = summary["missed_checkpoints"].as_array().unwrap();
    assert!(
        missed.len() == 1 && missed[0].as_str().unwrap().starts_with("no checkpoint of tick 2000:"),
        "{missed:?}"
    );
    assert_eq!(ticks(&summary)[..3], [1000, 3000, 4000]);
}

/// Also where the run before has written checkpoints at a period, which the fork has inherited.
#[test]
fn a_fork_may_add_a_swap() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let (whole, fork) = (place.path("a.mcap"), place.path("b.mcap"));
    let args = ["run", &hover, "--record", &whole, "--in-process", "--checkpoint-every", "500ms"];
    place.call(&[&args[..], &["--set", "run.duration_s=3"]].concat()).flown();
    let swap = format!("swap=[{{ process = \"controller\", at_tick = 2000, with = {{ {SOFT} }} }}]");
    let args = ["run", "--from", &place.path("a.1000.ckpt"), "--record", &fork, "--set", &swap];
    place.call(&args).flown();
    place.call(&["diff", &whole, &fork]).with_code(1).prints(&["/controller/"]);
}
