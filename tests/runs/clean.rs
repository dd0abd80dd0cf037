//! What dead runs left is removed, and nothing of live ones, wherever their temporary files lie.

use crate::support::{Launch, Place, poll, repository};
use rustix::fs::{FlockOperation, flock};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::sleep;
use std::time::Duration;

/// `clean` looks at every run of the user: these tests would remove what the others are about to look at.
fn alone() -> MutexGuard<'static, ()> {
    static CLEANING: Mutex<()> = Mutex::new(());
    CLEANING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts hover.toml in real time; it is to be killed, or stopped.
fn take_off(place: &Place) -> Launch<'_> {
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("flown.mcap"));
    place.start(&["run", &manifest, "--record", &recording, "--pace", "realtime"])
}

/// Has a run fly for a while, then kills its launcher; returns the run's name.
fn crash(place: &Place) -> String {
    let mut launch = take_off(place);
    launch.await_ticks(100);
    let run_id = place.run_id();
    launch.kill();
    run_id
}

fn clean(place: &Place, words: &[&str]) -> Value {
    place.start(&[&["clean", "--json"], words].concat()).end_among_others().with_code(0).json()
}

fn remains_of<'a>(report: &'a Value, run_id: &str) -> Option<&'a Value> {
    report["dead"].as_array().unwrap().iter().find(|remains| remains["run_id"] == run_id)
}

fn is_live(report: &Value, run_id: &str) -> bool {
    report["live"].as_array().unwrap().iter().any(|live| live == run_id)
}

/// A file in shared memory that is removed at the end, if nobody else has.
struct Stray(PathBuf);

impl Stray {
    fn new(name: &str) -> Self {
        let path = Path::new("/dev/shm").join(name);
        std::fs::write(&path, "stray").unwrap();
        Self(path)
    }
}

impl Drop for Stray {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Sets a flag at the end of a scope, however it ends.
struct SetOnDrop<'a>(&'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn what_a_killed_launcher_left_is_removed_and_a_live_run_beside_it_is_kept() {
    let _alone = alone();
    // Three folders for temporary files: the dead run is found by its entry, the live one by its lock.
    let (dead, alive, cleaner) = (Place::new(), Place::new(), Place::new());
    let mut flight = take_off(&alive);
    flight.await_ticks(100);
    let live_id = alive.run_id();
    let dead_id = crash(&dead);
    assert!(!dead.left().is_empty());
    let told = clean(&cleaner, &["--dry-run"]);
    assert!(!dead.left().is_empty(), "a dry run removes nothing");
    let report = clean(&cleaner, &[]);
    for report in [&told, &report] {
        let remains = remains_of(report, &dead_id).unwrap_or_else(|| panic!("{dead_id}: {report:#}"));
        assert!(remains["bytes"].as_u64().unwrap() > 10_000, "{remains:#}");
        assert!(remains["paths"].as_array().unwrap().len() > 10, "{remains:#}");
        assert!(is_live(report, &live_id) && remains_of(report, &live_id).is_none(), "{report:#}");
    }
    assert_eq!(dead.left(), [""; 0]);
    assert!(remains_of(&clean(&cleaner, &[]), &dead_id).is_none());
    flight.end().with_code(0);
}

#[test]
fn what_was_removed_is_said_in_words() {
    let _alone = alone();
    let place = Place::new();
    let run_id = crash(&place);
    let run_dir = format!("-{run_id}\n");
    let ended = place.start(&["clean"]).end_among_others().with_code(0);
    ended.prints(&[&format!("removed run {run_id}: "), "iB", &run_dir, "in /dev/shm", "live run"]);
}

#[test]
fn files_that_are_not_of_runs_are_kept() {
    let _alone = alone();
    let stray = Stray::new("hb_fffffff-1_data");
    let others = ["hb_control-fffffff-1_control", "hb_fffffff_data", "hummingbus-fffffff-1"].map(Stray::new);
    let place = Place::new();
    std::fs::create_dir_all(place.path("tmp/hummingbus-notes")).unwrap();
    let report = clean(&place, &[]);
    assert_eq!(remains_of(&report, "fffffff-1").unwrap()["paths"][0], stray.0.to_str().unwrap());
    assert!(!stray.0.exists() && others.iter().all(|other| other.0.exists()));
    assert!(Path::new(&place.path("tmp/hummingbus-notes")).exists());
}

#[test]
fn a_run_directory_that_its_launcher_has_locked_is_kept() {
    let _alone = alone();
    let place = Place::new();
    // As in a container that has a shared memory of its own: there is no entry to be seen.
    let run_dir = place.path(&format!("tmp/hummingbus-{}-fffffff-2", bus::process::user_id()));
    std::fs::create_dir(&run_dir).unwrap();
    let lock = std::fs::File::open(&run_dir).unwrap();
    flock(&lock, FlockOperation::LockExclusive).unwrap();
    assert!(is_live(&clean(&place, &[]), "fffffff-2"));
    assert!(Path::new(&run_dir).exists());
    drop(lock);
    assert!(remains_of(&clean(&place, &[]), "fffffff-2").is_some());
    assert!(!Path::new(&run_dir).exists());
}

#[test]
fn a_process_that_outlived_its_run_is_killed() {
    let _alone = alone();
    let (place, dead) = (Place::new(), Place::new());
    let run_id = crash(&dead);
    let run_dir = dead.path(&format!("tmp/hummingbus-{}-{run_id}", bus::process::user_id()));
    assert!(Path::new(&run_dir).is_dir());
    let mut sleeper = Command::new("sleep")
        .arg("1000")
        .env("HUMMINGBUS_RUN", &run_dir)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let report = clean(&place, &[]);
    let ended = poll("the process lives", || sleeper.try_wait().unwrap());
    let id = sleeper.id();
    assert!(!ended.success() && dead.left().is_empty());
    let processes = remains_of(&report, &run_id).unwrap()["processes"].as_array().unwrap();
    assert!(processes.iter().any(|process| process == id), "{report:#}");
}

#[test]
fn a_launcher_killed_at_any_moment_of_its_start_can_be_cleaned_up() {
    let _alone = alone();
    let place = Place::new();
    for wait_ms in [0, 1, 2, 4, 8, 12, 16, 24, 32, 48, 64] {
        let launch = take_off(&place);
        sleep(Duration::from_millis(wait_ms));
        launch.kill();
        clean(&place, &[]);
        assert_eq!(place.left(), [""; 0], "after {wait_ms} ms");
    }
}

#[test]
fn runs_that_start_and_end_while_others_clean_are_not_disturbed() {
    let _alone = alone();
    let (place, cleaner) = (Place::new(), Place::new());
    let temporary = cleaner.path("tmp");
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let _end = SetOnDrop(&is_over);
        for _ in 0..2 {
            scope.spawn(|| {
                let words = ["clean", "--json"];
                while !is_over.load(Ordering::Relaxed) {
                    let report = Command::new(env!("CARGO_BIN_EXE_hummingbus"))
                        .args(words)
                        .env("TMPDIR", &temporary)
                        .output()
                        .unwrap();
                    assert!(report.status.success(), "{report:?}");
                }
            });
        }
        for _ in 0..12 {
            let (manifest, recording) = (repository("manifests/hover.toml"), place.path("short.mcap"));
            place.call(&["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.2"]).flown();
        }
    });
}
