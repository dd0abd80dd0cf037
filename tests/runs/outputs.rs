//! Outputs of runs and other commands in place of a file: another run's, a user's own, a link.

use crate::laps;
use crate::nodes::{manifest, sender, table};
use crate::recordings::{open, rows};
use crate::skipped::{cases, first, quick_or};
use crate::support::{Ended, HUMMINGBUS, Launch, Place, partial, poll, repository};
use recorder::reader::Recording;
use rustix::process::{Signal, kill_process};
use std::fs::{self, File};
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, symlink};
use std::path::Path;
use std::process::Command;

/// A manifest of a run of 50 ticks that has no conditions; its recording is `short.mcap`.
fn short(place: &Place) -> String {
    place.write("short.toml", manifest(50, &[sender("source", 1, "")]))
}

/// Requires that a second run is refused with the first one's name and process, and with advice.
fn require_named(refused: &Ended, first: &Launch<'_>, run_id: &str, advice: &str) {
    assert_eq!(refused.code, Some(2), "{refused}");
    let launcher = format!("(launcher {})", first.id());
    refused.says(&[&format!("run {run_id} of "), &launcher, "writes to it now", advice]);
}

fn pipe(place: &Place, name: &str) -> String {
    let pipe = place.path(name);
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    pipe
}

fn is_pipe(path: &str) -> bool {
    fs::metadata(path).unwrap().file_type().is_fifo()
}

/// The names in the folder `folder`, sorted.
fn names(folder: &str) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap().flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

// Two runs

#[test]
fn a_second_run_to_the_recording_of_a_live_one_is_refused_by_any_spelling() {
    let (place, folder) = (Place::new(), "recorded");
    let hover = repository("manifests/hover.toml");
    fs::create_dir(place.path(folder)).unwrap();
    let recording = place.path("recorded/flown.mcap");
    place.call(&["run", &short(&place), "--record", &recording]).with_code(0);
    symlink(place.path(folder), place.path("folder")).unwrap();
    symlink("recorded/flown.mcap", place.path("link.mcap")).unwrap();
    let duration = format!("run.duration_s={}", quick_or(3, 9, "longer flights"));
    let fly = |recording: &str, seed: &str| {
        let seed = format!("run.seed={seed}");
        place.start(&["run", &hover, "--record", recording, "--set", &seed, "--json", "--set", &duration])
    };
    let mut first = fly(&recording, "1");
    first.hold_at(300);
    let run_id = place.run_id();
    for spelling in
        ["recorded/flown.mcap", "recorded/../recorded/./flown.mcap", "folder/flown.mcap", "link.mcap"]
    {
        let second = fly(&place.path(spelling), "2").end_among_others();
        require_named(&second, &first, &run_id, "--record PATH");
    }
    first.release();
    let judged = first.end().flown().json();
    let (alone, reference) = (place.path("alone.mcap"), fly(&place.path("alone.mcap"), "1"));
    assert_eq!(judged["pass"], reference.end().flown().json()["pass"], "figures of another run");
    assert!(fs::read(&recording).unwrap() == fs::read(alone).unwrap(), "the recording of another run");
    assert_eq!(names(&place.path(folder)), ["flown.mcap"]);
    // Nobody writes there any more.
    fly(&recording, "2").end().flown();
}

#[test]
fn runs_to_two_names_of_one_recording_leave_each_its_own() {
    let (place, hover) = (Place::new(), repository("manifests/hover.toml"));
    let [a, b] = ["a.mcap", "b.mcap"].map(|name| place.path(name));
    place.call(&["run", &short(&place), "--record", &a]).with_code(0);
    fs::hard_link(&a, &b).unwrap();
    let fly = |recording: &str, seed: &str| {
        place.start(&["run", &hover, "--record", recording, "--set", seed, "--set", "run.duration_s=1"])
    };
    let launches = [fly(&a, "run.seed=1"), fly(&b, "run.seed=2")];
    launches.into_iter().for_each(|launch| drop(launch.end_among_others().flown()));
    let noise = |path: &str| rows(path, "/imu/imu")[0].vector("specific_force");
    fly(&place.path("alone.mcap"), "run.seed=1").end().flown();
    assert_eq!(noise(&a), noise(&place.path("alone.mcap")));
    assert_ne!(noise(&a), noise(&b));
}

#[test]
fn of_many_runs_that_start_at_once_exactly_one_flies() {
    let (place, hover) = (Place::new(), repository("manifests/hover.toml"));
    place.call(&["run", &short(&place), "--record", &place.path("flown.mcap")]).with_code(0);
    for round in first(2, "rounds", 0..4) {
        if round % 2 == 1 {
            fs::copy(place.path("flown.mcap"), place.path("flown.partial.mcap")).unwrap();
        }
        let args = ["run", &hover, "--record", &place.path("flown.mcap")];
        let mut launches: Vec<Launch<'_>> = (0..12).map(|_| place.start_endless(&args)).collect();
        let mut refused = Vec::new();
        poll("more than one run flies", || {
            let ended = launches.iter_mut().position(Launch::has_ended)?;
            refused.push(launches.swap_remove(ended).end_among_others());
            (launches.len() == 1).then_some(())
        });
        let mut winner = launches.pop().unwrap();
        winner.await_ticks(50);
        let run_id = place.run_id();
        refused.iter().for_each(|refused| require_named(refused, &winner, &run_id, "--record PATH"));
        winner.signal(Signal::INT);
        winner.end().with_code(1).prints(&["stopped before its end"]);
        open(&place.path("flown.mcap"));
        assert!(!Path::new(&place.path("flown.partial.mcap")).exists());
    }
}

#[test]
fn a_second_run_to_the_log_of_a_live_one_is_refused() {
    let (place, hover) = (Place::new(), repository("manifests/hover.toml"));
    let log = format!("process.imu.log={}", place.path("imu.log"));
    let fly = |recording: &str| {
        place.start_endless(&["run", &hover, "--record", &place.path(recording), "--set", &log])
    };
    let mut first = fly("first.mcap");
    first.await_ticks(100);
    let run_id = place.run_id();
    fs::hard_link(place.path("imu.log"), place.path("same.log")).unwrap();
    let same = format!("process.imu.log={}", place.path("same.log"));
    for log in [&log, &same] {
        let args = ["run", &hover, "--record", &place.path("second.mcap"), "--set", log];
        let second = place.start(&args).end_among_others();
        require_named(&second, &first, &run_id, "--set process.imu.log=PATH");
    }
    first.signal(Signal::INT);
    first.end().with_code(1);
    assert!(!Path::new(&place.path("second.partial.mcap")).exists(), "litter of a refused run");
}

#[test]
fn a_lock_does_not_outlive_a_killed_launcher() {
    let (place, hover) = (Place::new(), repository("manifests/hover.toml"));
    let recording = place.path("flown.mcap");
    place.call(&["run", &short(&place), "--record", &recording]).with_code(0);
    let good = fs::read(&recording).unwrap();
    let mut launch = place.start_endless(&["run", &hover, "--record", &recording]);
    // Between two flushes of the recorder, whenever the kill comes.
    launch.hold_at(1200);
    launch.kill();
    place.await_no_process();
    assert!(fs::read(&recording).unwrap() == good, "a killed run has replaced a recording");
    let left = place.path("flown.partial.mcap");
    let cut = place.start(&["cat", &left, "--topic", "/imu/imu"]).end_among_others().with_code(1);
    cut.says(&["was cut off", "ends after tick 999"]);
    let cut = fs::read(&left).unwrap();
    let aside = place.path("flown.partial-2.mcap");
    let ended = place.start(&["run", &hover, "--record", &recording]).end_among_others().with_code(0);
    ended.says(&[&format!("what an earlier run left unfinished is kept as {aside}")]);
    assert!(!Path::new(&left).exists() && fs::read(&aside).unwrap() == cut, "what a killed run left is lost");
    assert_eq!(rows(&recording, "/imu/imu").len(), 12_000);
}

// A run that breaks

#[test]
fn a_run_that_breaks_leaves_the_good_recording_and_says_where_its_own_is() {
    let place = Place::new();
    let recording = place.path("failing.mcap");
    let fault = "parameters = { fault = \"error\", at_tick = 50 }";
    let good = place.write("good.toml", manifest(200, &[sender("source", 1, "")]));
    let bad = place.write("failing.toml", manifest(200, &[sender("source", 1, fault)]));
    place.call(&["run", &good, "--record", &recording]).with_code(0);
    let kept = fs::read(&recording).unwrap();
    let left = place.path("failing.partial.mcap");
    for _ in 0..2 {
        let ended = place.call(&["run", &bad, "--json"]).with_code(2);
        ended.says(&["aborted at tick 50", &format!("What was recorded until then is in {left}")]);
        let json = ended.json();
        assert_eq!((&json["passed"], &json["recording"]), (&false.into(), &serde_json::Value::Null));
        assert_eq!(json["partial_recording"], left);
        assert!(json["error"].as_str().unwrap().contains("the battery is empty"), "{json}");
        assert!(fs::read(&recording).unwrap() == kept, "a broken run has replaced a good recording");
        assert_eq!(rows(&left, "/source/note").len(), 50);
    }
    // Whatever reads recordings reads it.
    place.call(&["diff", &left, &left]).with_code(0).prints(&["identical"]);
    place.call(&["cat", &left]).with_code(0);
    place.call(&["plot", &left, "--plot", "/source/note:tick"]).with_code(0);
    place.call(&["run", &good, "--record", &recording]).with_code(0);
    assert!(!Path::new(&left).exists(), "a later run has left it there");
    for number in [2, 3] {
        let aside = place.path(&format!("failing.partial-{number}.mcap"));
        assert_eq!(rows(&aside, "/source/note").len(), 50, "what a broken run left is lost");
    }
}

#[test]
fn a_run_that_is_refused_or_breaks_before_it_flies_leaves_nothing_beside_the_recording() {
    let place = Place::new();
    fs::create_dir(place.path("recorded")).unwrap();
    let recording = place.path("recorded/short.mcap");
    let (path, fails) = (short(&place), "process.source.command=[\"false\"]");
    place.call(&["run", &path, "--record", &recording, "--set", fails]).with_code(2);
    assert_eq!(names(&place.path("recorded")), [""; 0]);
    let named = place.path("recorded/short.partial.mcap");
    let ended = place.call(&["run", &path, "--record", &named]).with_code(2);
    ended.says(&["such a name is that of what a broken run leaves; name another file"]);
}

#[test]
fn what_somebody_puts_in_the_place_of_a_recording_in_flight_is_kept() {
    let (place, hover) = (Place::new(), repository("manifests/hover.toml"));
    let (recording, left) = (place.path("flown.mcap"), place.path("flown.partial.mcap"));
    let fly = || {
        let mut launch = place.start(&["run", &hover, "--record", &recording, "--set", "run.duration_s=0.5"]);
        launch.hold_at(300);
        launch
    };
    let mut launch = fly();
    fs::write(&recording, "somebody's own").unwrap();
    launch.release();
    let ended = launch.end().with_code(2);
    ended.says(&[
        &recording,
        "no recording of hummingbus",
        &format!("What was recorded until then is in {left}"),
    ]);
    assert_eq!(fs::read_to_string(&recording).unwrap(), "somebody's own");
    assert_eq!(rows(&left, "/imu/imu").len(), 500);
    fs::remove_file(&recording).unwrap();
    let mut launch = fly();
    fs::remove_file(&left).unwrap();
    fs::write(&left, "somebody's own").unwrap();
    launch.release();
    launch.end().with_code(2).says(&["somebody removed or replaced it during the run"]);
    assert_eq!(fs::read_to_string(&left).unwrap(), "somebody's own");
}

// What is in the place

#[test]
fn a_link_to_a_pipe_is_refused_and_left_alone_whoever_writes() {
    let place = Place::new();
    let (path, pipe) = (short(&place), pipe(&place, "pipe"));
    let recording = place.path("laps.mcap");
    laps::record(recording.as_ref(), &[""], None);
    let link = |name: &str| {
        let link = place.path(name);
        symlink("pipe", &link).unwrap();
        link
    };
    let log = format!("process.source.log={}", link("l.log"));
    for args in [
        vec!["run", &path, "--record", &link("l.mcap")],
        vec!["run", &path, "--set", &log],
        vec!["profile", &path, "--html", &link("l.html")],
        vec!["profile", &path, "--trace", &link("l.json")],
        vec!["plot", &recording, "--svg", &link("l.svg")],
        vec!["plot", &recording, "--png", &link("l.png")],
        vec!["plot", &recording, "--out", &link("page.html")],
    ] {
        let ended = place.call(&args).with_code(2);
        ended.says(&["it exists and is not a regular file; name another file"]);
        let named = args[3].rsplit('=').next().unwrap();
        assert!(fs::symlink_metadata(named).unwrap().is_symlink(), "{named}: the link is gone");
        assert!(is_pipe(named) && is_pipe(&pipe), "{named}: the pipe is gone");
    }
    assert!(!Path::new(&place.path("short.mcap")).exists(), "a refused run has flown");
}

#[test]
fn a_link_to_a_recording_is_written_through() {
    let place = Place::new();
    let path = short(&place);
    fs::create_dir(place.path("disk")).unwrap();
    symlink("disk/flown.mcap", place.path("link.mcap")).unwrap();
    // The first time it points to nothing yet.
    for _ in 0..2 {
        let ended = place.call(&["run", &path, "--record", &place.path("link.mcap"), "--json"]).with_code(0);
        assert_eq!(ended.json()["recording"], place.path("link.mcap"));
        assert!(fs::symlink_metadata(place.path("link.mcap")).unwrap().is_symlink());
        assert_eq!(rows(&place.path("disk/flown.mcap"), "/source/note").len(), 50);
        assert_eq!(names(&place.path("disk")), ["flown.mcap"]);
    }
}

/// Runs `args`, whose output is `file`, over somebody's own file, an empty one, and what it has itself written.
fn require_own_kind(place: &Place, args: &[&str], file: &str) {
    fs::write(file, "somebody's own").unwrap();
    let ended = place.call(args).with_code(2);
    ended.says(&[file, "of hummingbus, and would be lost; name another file"]);
    assert_eq!(fs::read_to_string(file).unwrap(), "somebody's own", "{ended}");
    fs::write(file, "").unwrap();
    place.call(args).with_code(0);
    let first = fs::read(file).unwrap();
    assert!(first.len() > 40, "{file} is empty");
    place.call(args).with_code(0);
    assert!(!fs::read(file).unwrap().is_empty());
    // Not that of another kind either.
    let other = if file.ends_with(".svg") { "page.html" } else { "laps.svg" };
    fs::copy(place.path(other), file).unwrap();
    place.call(args).with_code(2).says(&[file, "would be lost"]);
}

#[test]
fn nothing_is_replaced_but_a_file_of_the_same_kind() {
    let place = Place::new();
    let (path, recording) = (short(&place), place.path("laps.mcap"));
    laps::record(recording.as_ref(), &[""], None);
    place
        .call(&["plot", &recording, "--svg", &place.path("laps.svg"), "--out", &place.path("page.html")])
        .with_code(0);
    let file = |name: &str| place.path(name);
    let log = format!("process.source.log={}", file("a.log"));
    let quick = ["a.mcap", "a.html", "a.svg"];
    for (args, name) in cases(
        "kinds of files",
        [
            (vec!["run", &path, "--record", &file("a.mcap")], "a.mcap"),
            (vec!["run", &path, "--set", &log], "a.log"),
            (vec!["profile", &path, "--html", &file("a.html")], "a.html"),
            (vec!["profile", &path, "--trace", &file("a.json")], "a.json"),
            (vec!["plot", &recording, "--svg", &file("a.svg")], "a.svg"),
            (vec!["plot", &recording, "--png", &file("a.png")], "a.png"),
            (vec!["plot", &recording, "--out", &file("b.html")], "b.html"),
        ],
        |(_, name)| quick.contains(name),
    ) {
        require_own_kind(&place, &args, &file(name));
    }
    // A broken run's name is somebody's own.
    fs::write(file("c.partial.mcap"), "somebody's own").unwrap();
    place.call(&["run", &path, "--record", &file("c.mcap")]).with_code(2).says(&[&file("c.partial.mcap")]);
    assert_eq!(fs::read_to_string(file("c.partial.mcap")).unwrap(), "somebody's own");
}

#[test]
fn a_recording_of_another_program_is_not_replaced() {
    let place = Place::new();
    let (path, recording) = (short(&place), place.path("flown.mcap"));
    place.call(&["run", &path, "--record", &recording]).with_code(0);
    let mut bytes = fs::read(&recording).unwrap();
    let library = bytes.windows(10).position(|bytes| bytes == b"hummingbus").unwrap();
    bytes[library..library + 10].copy_from_slice(b"rosbag2-12");
    fs::write(&recording, &bytes).unwrap();
    let ended = place.call(&["run", &path, "--record", &recording]).with_code(2);
    ended.says(&["no recording of hummingbus"]);
    assert!(fs::read(&recording).unwrap() == bytes);
}

// What a run reads, and writes otherwise

#[test]
fn no_file_that_a_run_reads_is_written_to() {
    let place = Place::new();
    let (empty, vehicle) = (place.write("empty.toml", ""), place.path("own.toml"));
    fs::copy(repository("vehicles/hummingbird.toml"), &vehicle).unwrap();
    let text = format!("include = [\"empty.toml\"]\n{}", manifest(50, &[sender("source", 1, "")]));
    let path = place.write("short.toml", &text);
    fs::hard_link(&empty, place.path("hard.toml")).unwrap();
    let ours = place.write("data.mcap", "");
    let reads = format!("process.source.data={ours}");
    let log = |file: &str| format!("process.source.log={file}");
    for (args, input) in [
        (["--record", &empty, "--json"], &empty),
        (["--set", &log(&empty), "--json"], &empty),
        (["--set", &log(&place.path("hard.toml")), "--json"], &empty),
        (["--record", &ours, &format!("--set={reads}")], &ours),
    ] {
        let ended = place.call(&[&["run", &path][..], &args].concat()).with_code(2);
        ended.says(&["the run reads it, as", input, "name another file"]);
    }
    let left = place.write("own.partial.mcap", "");
    let reads = format!("process.source.data={left}");
    for args in [["--set", &log(&left)], ["--set", &reads]] {
        let ended = place.call(&[&["run", &path, "--record", &place.path("own.mcap")], &args[..]].concat());
        ended.with_code(2).says(&[&left, "the recording until it is complete"]);
    }
    for file in [&path, &vehicle] {
        let before = fs::read(file).unwrap();
        let ended = place.call(&["run", &path, "--set", &log(file)]).with_code(2);
        ended.says(&["`log`: ", file, "no log of hummingbus"]);
        assert!(fs::read(file).unwrap() == before);
    }
    assert!(fs::read(empty).unwrap().is_empty() && fs::read(ours).unwrap().is_empty());
}

#[test]
fn two_outputs_of_one_command_are_two_files() {
    let place = Place::new();
    let (path, recording) = (short(&place), place.path("flown.mcap"));
    let log = format!("process.source.log={recording}");
    let page = place.path("a.html");
    let ended = place.call(&["run", &path, "--record", &recording, "--set", &log]).with_code(2);
    ended.says(&["the log of `source`", "the recording", "give each a file of its own"]);
    let ended = place.call(&["profile", &path, "--html", &page, "--trace", &page]).with_code(2);
    ended.says(&["the page", "the trace", "give each a file of its own"]);
    let ended = place.call(&["profile", &path, "--record", &recording, "--html", &recording]).with_code(2);
    ended.says(&["the page", "the recording", "give each a file of its own"]);
    place.call(&["run", &path, "--record", &recording]).with_code(0);
    let args = ["plot", &recording, "--plot", "/source/note:tick", "--svg", &page, "--out", &page];
    place.call(&args).with_code(2).says(&["is named twice"]);
    let before = fs::read(&recording).unwrap();
    place.call(&["profile", &path, "--record", &place.path("b.mcap"), "--html", &recording]).with_code(2);
    assert!(fs::read(&recording).unwrap() == before, "a page has replaced a recording");
}

#[test]
fn a_log_holds_one_run_with_all_processes_of_a_node() {
    let place = Place::new();
    let fault = "parameters = { fault = \"panic\", at_tick = 20 }";
    let path = place.write("short.toml", manifest(50, &[sender("source", 1, fault)]));
    let log = format!("process.source.log={}", place.path("a.log"));
    let mut texts = (0..2).map(|_| {
        place.call(&["run", &path, "--set", &log]).with_code(2).says(&["the propeller came off"]);
        let text = fs::read_to_string(place.path("a.log")).unwrap();
        assert!(text.starts_with("# What a process of a run said. Written by hummingbus.\n"), "{text}");
        text.matches("the propeller came off").count()
    });
    assert_eq!((texts.next(), texts.next()), (Some(1), Some(1)));
    let restart = "process.source.on_exit=\"restart\"";
    place.call(&["run", &path, "--set", &log, "--set", restart]).with_code(2);
    let text = fs::read_to_string(place.path("a.log")).unwrap();
    assert_eq!(text.matches("the propeller came off").count(), 2, "{text}");
}

#[test]
fn what_is_written_has_the_mode_of_the_umask() {
    let place = Place::new();
    let path = short(&place);
    let [recording, page, trace] = ["a.mcap", "a.html", "a.json"].map(|name| place.path(name));
    for (umask, mode) in [("027", 0o640), ("002", 0o664)] {
        let mut command = Command::new("sh");
        let script = format!("umask {umask}; exec \"$@\"");
        command.args(["-c", &script, "sh", crate::support::HUMMINGBUS, "profile", &path]);
        command.args(["--record", &recording, "--html", &page, "--trace", &trace]);
        place.launch(command).end().with_code(0);
        for file in [&recording, &page, &trace] {
            assert_eq!(fs::metadata(file).unwrap().permissions().mode() & 0o777, mode, "{file}");
        }
    }
}

#[test]
fn who_reads_a_page_or_a_recording_keeps_it_whole_while_it_is_replaced() {
    let place = Place::new();
    let (path, recording) = (short(&place), place.path("short.mcap"));
    let args = ["plot", &recording, "--plot", "/source/note:tick"];
    let node = |path: &str| fs::metadata(path).unwrap().ino();
    place.call(&["run", &path]).with_code(0);
    place.call(&args).with_code(0);
    let (held, page) = (open(&recording), File::open(place.path("short.html")).unwrap());
    let messages = |held: &Recording| -> Vec<_> {
        held.messages()
            .map(|record| record.map(|record| (record.topic, record.tick, record.cdr)).unwrap())
            .collect()
    };
    let (flown, length) = (messages(&held), page.metadata().unwrap().len());
    place.call(&["run", &path]).with_code(0);
    place.call(&args).with_code(0);
    assert_ne!(page.metadata().unwrap().ino(), node(&place.path("short.html")), "it was written over");
    assert!(messages(&held) == flown && page.metadata().unwrap().len() == length);
}

// Folders that commands fill

/// A flights file of one flight called `name`, whose log is `file`.
fn flights(place: &Place, vehicle: &str, flights: &[(&str, &str)]) -> String {
    let channels = "[channels]\ntime = { columns = [\"t\"], unit = \"s\" }\n\
        command = { columns = [\"m1\", \"m2\", \"m3\", \"m4\"], unit = \"count\" }\n\
        attitude = { columns = [\"qx\", \"qy\", \"qz\", \"qw\"], unit = \"1\" }\n\
        angular_velocity = { columns = [\"wx\", \"wy\", \"wz\"], unit = \"rad/s\" }\n";
    let entry = |(name, file): &(&str, &str)| {
        format!("[[flight]]\nname = {name:?}\nfile = {file:?}\nrole = \"test\"\n")
    };
    let entries: String = flights.iter().map(entry).collect();
    place.write("flights.toml", format!("vehicle = {vehicle:?}\n{channels}{entries}"))
}

/// A flight of a second, level and without a turn.
fn level_flight(place: &Place, name: &str) -> String {
    let row = |index: u32| {
        format!("{},76,76,76,76,0,0,0,1,0,0,{}\n", f64::from(index) * 0.01, f64::from(index % 7) * 1e-4)
    };
    let rows: String = (0..100).map(row).collect();
    place.write(name, format!("t,m1,m2,m3,m4,qx,qy,qz,qw,wx,wy,wz\n{rows}"))
}

#[test]
fn validate_keeps_in_a_folder_of_its_own_and_replaces_its_own_files_alone() {
    let place = Place::new();
    let vehicle = repository("vehicles/hummingbird.toml");
    let (log, kept) = (level_flight(&place, "level.csv"), place.path("kept"));
    let set = flights(&place, &vehicle, &[("level", &log)]);
    let args = ["validate", &vehicle, &set, "--keep", &kept];
    place.call(&args).with_code(0);
    place.call(&args).with_code(0);
    assert_eq!(names(&place.path("kept/level")), ["flight.csv", "flight.mcap", "manifest.toml"]);
    let folder = File::open(place.path("kept/level")).unwrap();
    folder.lock().unwrap();
    place.call(&args).with_code(2).says(&["another hummingbus writes to it now"]);
    // Not by closing it: a process that another test starts at this moment may have it open too.
    folder.unlock().unwrap();
    // A flight that was kept is read again: it is not to be replaced by what comes of it.
    let kept_flight = place.path("kept/level/flight.csv");
    let again = flights(&place, &vehicle, &[("level", &kept_flight)]);
    let ended = place.call(&["validate", &vehicle, &again, "--keep", &kept]).with_code(2);
    ended.says(&[&kept_flight, "would be replaced, and is read; keep it in another folder"]);
    for name in ["flight.csv", "manifest.toml", "flight.mcap"] {
        let set = flights(&place, &vehicle, &[("level", &log)]);
        let file = place.path(&format!("kept/level/{name}"));
        let ours = fs::read(&file).unwrap();
        fs::write(&file, "somebody's own").unwrap();
        let ended = place.call(&["validate", &vehicle, &set, "--keep", &kept]).with_code(2);
        ended.says(&[name, "would be lost; name another file"]);
        assert_eq!(fs::read_to_string(&file).unwrap(), "somebody's own");
        fs::write(&file, ours).unwrap();
    }
    let two = flights(&place, &vehicle, &[("a b", &log), ("a/b", &log)]);
    let ended = place.call(&["validate", &vehicle, &two, "--keep", &kept]).with_code(2);
    ended.says(&["`a b` and `a/b` would both be kept in the folder a-b"]);
}

#[test]
fn identify_replaces_its_own_files_alone_and_not_what_it_reads() {
    let place = Place::new();
    let log = level_flight(&place, "level.csv");
    let out = place.path("out");
    fs::create_dir(&out).unwrap();
    let declared = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    for name in ["vehicle.toml", "report.html", "report.json"] {
        let set = flights(&place, &repository("vehicles/hummingbird.toml"), &[("level", &log)]);
        let file = place.write(&format!("out/{name}"), &declared);
        let ended = place.call(&["identify", &set, "--out", &out, "--no-bus"]).with_code(2);
        ended.says(&[&file, "would be lost; name another file"]);
        assert_eq!(fs::read_to_string(&file).unwrap(), declared);
        fs::remove_file(&file).unwrap();
    }
    // What was identified is declared now.
    let ours = place.write("out/vehicle.toml", format!("# Written by hummingbus identify.\n{declared}"));
    let set = flights(&place, &ours, &[("level", &log)]);
    let ended = place.call(&["identify", &set, "--out", &out, "--no-bus"]).with_code(2);
    ended.says(&[&ours, "would be replaced, and is read", "name another folder with --out"]);
}

#[test]
fn a_run_without_a_recorder_claims_nothing() {
    let place = Place::new();
    let text = format!("[run]\nduration_s = 0.05\n{}", table("idler", ""));
    let path = place.write("bare.toml", text);
    let kept = place.write("bare.mcap", "somebody's own");
    place.call(&["run", &path]).with_code(0);
    assert_eq!(fs::read_to_string(kept).unwrap(), "somebody's own");
}

#[test]
fn an_aborted_recording_in_flight_is_partial_until_its_end() {
    let (place, hover) = (Place::new(), repository("manifests/hover.toml"));
    let recording = place.path("flown.mcap");
    let mut launch = place.start(&["run", &hover, "--record", &recording]);
    launch.hold_at(1500);
    let left = partial(&recording);
    place.start(&["cat", &left]).end_among_others().with_code(1).says(&["was cut off"]);
    kill_process(place.process_of("imu"), Signal::KILL).unwrap();
    launch.end().with_code(2).says(&[&left]);
    assert_eq!(rows(&partial(&recording), "/imu/imu").len(), 1500);
}

#[test]
fn a_recording_does_not_take_the_place_of_what_the_command_prints() {
    let place = Place::new();
    let path = short(&place);
    let script = format!("exec '{HUMMINGBUS}' run '{path}' --record /dev/stdout >printed");
    let mut command = std::process::Command::new("sh");
    command.args(["-c", &script]).current_dir(place.path(""));
    place.launch(command).end().with_code(2).says(&["/dev/stdout: it is where this command prints"]);
}

#[test]
fn a_run_that_never_flew_leaves_no_recording() {
    let place = Place::new();
    let path = place.write("flown.toml", manifest(200, &[sender("source", 1, "")]));
    let ended = place.call(&["run", &path, "--set", "process.source.command=[\"false\"]"]).with_code(2);
    assert!(!ended.error.contains("What was recorded"), "{ended}");
    assert!(!Path::new(&partial(&place.path("flown.mcap"))).exists(), "{ended}");
}
