//! Campaigns on a machine that fails: a full disk, workers and campaigns that are killed. What was flown is kept. Campaigns with
//! several faults.

use crate::campaign::{HOVERS, rows, written};
use crate::support::{HUMMINGBUS, Launch, Place, poll};
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::process::Command;

/// Flights that take seconds, so that they can be disturbed.
fn long(place: &Place) -> String {
    written(place, "c.toml", &HOVERS.replace("0.4\"", "10.0\"").replace("flights = 12", "flights = 6"))
}

/// Waits for the first row of the campaign in `folder`.
fn await_row(launch: &mut Launch<'_>, folder: &str) {
    poll("no flight ended", || {
        assert!(!launch.has_ended(), "it ended by itself: {}", launch.errors());
        let text = fs::read_to_string(format!("{folder}/rows.jsonl")).unwrap_or_default();
        (text.lines().count() > 1).then_some(())
    });
}

fn workers(place: &Place) -> Vec<Pid> {
    let is_worker = |pid: &Pid| {
        let args = fs::read(format!("/proc/{}/cmdline", pid.as_raw_nonzero())).unwrap_or_default();
        args.ends_with(b"\0--worker\0")
    };
    place.processes().into_iter().map(|(pid, _)| pid).filter(is_worker).collect()
}

#[test]
fn flights_whose_workers_are_killed_are_flown_again() {
    let place = Place::new();
    let (campaign, out) = (long(&place), place.path("out"));
    let mut launch = place.start(&["campaign", &campaign, "--out", &out, "--workers", "2"]);
    await_row(&mut launch, &out);
    let killed = workers(&place);
    assert!(!killed.is_empty());
    for worker in killed {
        kill_process(worker, Signal::KILL).unwrap();
    }
    launch.end().with_code(0).prints(&["6 of 6 flights passed"]);
    let kept = fs::read_to_string(format!("{out}/rows.jsonl")).unwrap();
    place.call(&["campaign", &campaign, "--out", &out]).with_code(0);
    assert_eq!(kept, fs::read_to_string(format!("{out}/rows.jsonl")).unwrap());
}

#[test]
fn a_campaign_that_is_killed_goes_on_to_the_same_table() {
    let place = Place::new();
    let (campaign, out, whole) = (long(&place), place.path("out"), place.path("whole"));
    let mut launch = place.start(&["campaign", &campaign, "--out", &out, "--workers", "2"]);
    await_row(&mut launch, &out);
    launch.kill();
    // The workers go with it.
    place.await_no_process();
    let before = rows(&out);
    assert!((1..6).contains(&before.len()), "{before:?}");
    for folder in [&out, &whole] {
        place.call(&["campaign", &campaign, "--out", folder]).with_code(0).prints(&["6 of 6 flights passed"]);
    }
    let after = rows(&out);
    assert!(before.iter().all(|row| after.contains(row)) && after.len() == 6);
    let table = |folder: &str| fs::read(format!("{folder}/flights.parquet")).unwrap();
    assert!(table(&out) == table(&whole), "the table is another one");
    let left = fs::read_dir(&out).unwrap().flatten().map(|entry| entry.file_name().into_string().unwrap());
    assert_eq!(left.filter(|name| name.starts_with('.')).count(), 0);
}

#[test]
fn a_full_disk_is_named_and_costs_no_row_that_was_written() {
    let place = Place::new();
    let campaign = written(&place, "c.toml", &HOVERS.replace("flights = 12", "flights = 60"));
    let out = place.path("out");
    // No file may grow beyond four blocks; the signal of that is ignored, so that writing fails as on a full disk.
    let limited = "trap '' XFSZ; ulimit -f 4; exec \"$@\"";
    let mut command = Command::new("sh");
    command.args(["-c", limited, "sh", HUMMINGBUS, "campaign", &campaign, "--out", &out, "--workers", "1"]);
    let ended = place.launch(command).end().with_code(2);
    ended.says(&[
        &format!("flights kept in {out}; the same command flies the rest"),
        "cannot write",
        "rows.jsonl",
        "File too large",
    ]);
    let path = format!("{out}/rows.jsonl");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.ends_with('\n'), "a part of a row is left: {text}");
    let kept = text.lines().count() as u64 - 1;
    ended.prints(&[
        &format!("{kept} of {kept} flights passed"),
        &format!("{} of 60 planned flights were not flown", 60 - kept),
    ]);
    let whole: String = text.split_inclusive('\n').filter(|line| line.ends_with('\n')).collect();
    let kept = whole.lines().count() - 1;
    assert!((1..60).contains(&kept), "{kept}");
    place.call(&["campaign", &campaign, "--out", &out]).with_code(0).prints(&["60 of 60 flights passed"]);
    assert!(fs::read_to_string(&path).unwrap().starts_with(&whole));
}

#[test]
fn the_faults_of_a_campaign_and_of_its_manifest_are_told_at_once() {
    let place = Place::new();
    let faulty = HOVERS.replace("flights = 12", "flights = 0").replace("[0.8, 1.2]", "[1.2, 0.8]");
    let campaign = written(&place, "c.toml", &faulty);
    let hover = fs::read_to_string(place.path("hover.toml")).unwrap();
    let misspelt = hover.replace("period_ticks = 5", "period_tick = 5");
    assert_ne!(misspelt, hover);
    place.write("hover.toml", misspelt);
    let out = place.path("out");
    let told =
        ["c.toml:2:11: `flights` must be", "`uniform` must be", "unknown key `process.mocap.period_tick`"];
    place.call(&["campaign", &campaign, "--out", &out]).with_code(2).says(&told);
    // Sound files, of which two choices are refused.
    let kinds = "[[vary]]\nkey = \"process.controller.kind\"\nvalues = [\"pid\", \"pdi\", \"lrq\"]\n";
    let text = HOVERS.replace("[[measure]]", &format!("{kinds}[[measure]]"));
    let campaign = written(&place, "kinds.toml", &text);
    let ended = place.call(&["campaign", &campaign, "--out", &out]).with_code(2);
    ended.says(&["no flight with \"pdi\" as `kind`", "no flight with \"lrq\" as `kind`"]);
    assert!(!std::path::Path::new(&out).exists(), "a folder for flights that are none");
}
