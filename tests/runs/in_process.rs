//! A run on one thread, without processes and shared memory, writes the same file and gives the same verdict.

use crate::manifests::{is_brief, settings, shipped};
use crate::recordings::require_same;
use crate::skipped::{cases, is_thorough};
use crate::support::{Place, repository};
use rustix::process::Signal;
use std::fs;
use std::path::Path;

/// Simulated length of the flights that are compared, s.
const DURATION_S: f64 = 0.5;

/// The part of a manifest that one thread cannot fly; nothing for others.
fn reason_against(manifest: &str) -> Option<&'static str> {
    match Path::new(manifest).file_stem()?.to_str()? {
        "llp-hlp" | "standby" | "swap-gains" | "swap-identical" | "swap-laws" => {
            Some("another process for `controller`")
        }
        "custom-controller" => Some("process `controller`: `command`"),
        _ => None,
    }
}

#[test]
fn every_shipped_manifest_writes_the_same_file_on_one_thread_or_says_why_not() {
    let place = Place::new();
    let mut flown = 0;
    let manifests = cases("manifests", shipped(), |path| is_brief(path));
    for (number, manifest) in manifests.iter().enumerate() {
        let duration = format!("run.duration_s={DURATION_S}");
        let reason = reason_against(manifest);
        let mut set = settings(&place, manifest);
        // A swap beyond the end of the run would be refused first.
        if reason.is_none() && !set.iter().any(|setting| setting.starts_with("run.duration_s")) {
            set.push(duration);
        }
        let (apart, alone) =
            (place.path(&format!("{number}.mcap")), place.path(&format!("{number}.one.mcap")));
        let args: Vec<&str> =
            ["run", manifest].into_iter().chain(set.iter().flat_map(|it| ["--set", it])).collect();
        let in_process = ["--record", &alone, "--in-process"];
        if let Some(reason) = reason {
            place.call(&[&args, &in_process[..]].concat()).with_code(2).says(&[reason]);
            continue;
        }
        // Conditions that a shorter flight misses are not what is looked at.
        let ended = place.call(&[&args, &in_process[..]].concat());
        assert!(!fs::read(&alone).unwrap_or_default().is_empty(), "{manifest}: {ended}");
        place.call(&[&args, &["--record", &apart][..]].concat());
        require_same(&fs::read(&apart).unwrap(), &alone);
        flown += 1;
    }
    let least = if is_thorough() { 30 } else { 8 };
    assert!(flown > least, "only {flown} manifests were flown");
}

#[test]
fn the_verdict_and_its_figures_are_those_of_processes_recorded_or_not() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("hover.mcap"));
    let judged = |more: &[&str]| {
        let args = ["run", &manifest, "--json", "--record"];
        let summary = place.call(&[&args, more].concat()).with_code(0).json();
        assert_eq!(summary["ticks"], 12_000);
        summary["pass"].clone()
    };
    let apart = judged(&[&recording]);
    assert!(apart.as_array().is_some_and(|verdicts| verdicts.len() > 2), "{apart}");
    assert_eq!(judged(&[&place.path("one.mcap"), "--in-process"]), apart);
    assert_eq!(judged(&["none", "--in-process"]), apart);
}

#[test]
fn it_leaves_no_process_and_stops_where_it_is_told() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("stopped.mcap"));
    let args = ["run", &manifest, "--record", &recording, "--in-process"];
    let launch = place.start_endless(&args);
    crate::support::poll("a recording under way", || {
        fs::metadata(crate::support::partial(&recording)).ok().filter(|file| file.len() > 4_000)
    });
    let processes = place.processes();
    assert!(matches!(&processes[..], [(_, node)] if node.is_empty()), "only the launcher: {processes:?}");
    let run = place.run_id();
    for asked in [vec!["ctl", "pause", "--run", &run], vec!["top", "--once", "--run", &run]] {
        let refused = place.start(&asked).end_among_others().with_code(2);
        refused.says(&["flies on one thread (--in-process)"]);
    }
    launch.signal(Signal::INT);
    launch.end().with_code(1).prints(&["stopped"]);
    assert!(fs::metadata(&recording).unwrap().len() > 4_000);
}

#[test]
fn what_watches_processes_is_refused() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    for (args, reason) in [
        (vec!["profile", &hover, "--in-process"], "a profile needs processes"),
        (vec!["run", &hover, "--in-process", "--compose", "all"], "--compose"),
        (vec!["run", &hover, "--in-process", "--set", "process.plant.cpu=0"], "`cpu`"),
        (vec!["run", &hover, "--in-process", "--set", "process.imu.on_exit=\"restart\""], "on_exit"),
    ] {
        place.call(&args).with_code(2).says(&[reason]);
    }
}
