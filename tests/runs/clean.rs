//! Files of dead runs are removed, and none of live runs, wherever their temporary files lie.

use crate::skipped::{first, is_left, skip};
use crate::support::{ENDLESS, Launch, Place, poll, repository};
use rustix::process::Signal;
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
    place.start_endless(&["run", &manifest, "--record", &recording])
}

/// Has a run fly for a while, then kills its launcher; returns the run's name.
fn crash(place: &Place) -> String {
    let mut launch = take_off(place);
    launch.await_ticks(100);
    let run_id = place.run_id();
    launch.kill();
    run_id
}

fn clean(place: &Place, args: &[&str]) -> Value {
    place.start(&[&["clean", "--json"], args].concat()).end_among_others().with_code(0).json()
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
    flight.signal(Signal::INT);
    flight.end().with_code(1).prints(&["stopped before its end"]);
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
    lock.lock().unwrap();
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
    // Where a run has its processes write.
    let log = std::fs::File::create(format!("{run_dir}/sleeper.log")).unwrap();
    let mut sleeper =
        Command::new("sleep").arg("1000").env("HUMMINGBUS_RUN", &run_dir).stdout(log).spawn().unwrap();
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
                let args = ["clean", "--json"];
                while !is_over.load(Ordering::Relaxed) {
                    let report = Command::new(env!("CARGO_BIN_EXE_hummingbus"))
                        .args(args)
                        .env("TMPDIR", &temporary)
                        .output()
                        .unwrap();
                    assert!(report.status.success(), "{report:?}");
                }
            });
        }
        for _ in first(6, "runs", 0..12) {
            let (manifest, recording) = (repository("manifests/hover.toml"), place.path("short.mcap"));
            place.call(&["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.2"]).flown();
        }
    });
}

#[test]
fn a_process_that_only_inherited_the_name_of_a_dead_run_is_left_alone() {
    let _alone = alone();
    let (place, dead) = (Place::new(), Place::new());
    let run_id = crash(&dead);
    let run_dir = dead.path(&format!("tmp/hummingbus-{}-{run_id}", bus::process::user_id()));
    let mut sleeper = Command::new("sleep")
        .arg("1000")
        .env("HUMMINGBUS_RUN", &run_dir)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let report = clean(&place, &[]);
    let ended = sleeper.try_wait().unwrap();
    sleeper.kill().unwrap();
    sleeper.wait().unwrap();
    assert!(ended.is_none() && dead.left().is_empty(), "{report:#}");
    let dead_runs = report["dead"].as_array().unwrap();
    let of_run = dead_runs.iter().find(|remains| remains["run_id"] == run_id.as_str()).unwrap();
    assert_eq!(of_run["spared"], serde_json::json!([sleeper.id()]), "it is not said: {report:#}");
}

#[test]
fn a_run_that_a_process_of_a_dead_run_started_flies_on() {
    let _alone = alone();
    let (place, outer, inner) = (Place::new(), Place::new(), Place::new());
    let hover = repository("manifests/hover.toml");
    // So slow that it would last for longer than any test waits.
    let args =
        ["run", &hover, "--record", &inner.path("inner.mcap"), "--pace", "0.02", "--set", "run.duration_s=8"];
    let args: Vec<String> = [&[env!("CARGO_BIN_EXE_hummingbus")], &args[..]]
        .concat()
        .iter()
        .map(|word| format!("'{word}'"))
        .collect();
    // Detached as a daemon is; what it says goes where the outer run has its sidecar write.
    let command = format!("setsid --fork env TMPDIR='{}' {}; sleep 1000", inner.path("tmp"), args.join(" "));
    let sidecar = format!("\n[process.nested]\nlockstep = false\ncommand = [\"sh\", \"-c\", {command:?}]\n");
    let manifest = outer.write("outer.toml", format!("include = [{hover:?}]\n{sidecar}"));
    let launch = outer.start_endless(&["run", &manifest, "--record", &outer.path("outer.mcap")]);
    let inner_id = poll("the inner run does not fly", || {
        let plan = bus::plan::Plan::load(inner.run_dirs().first()?).ok()?;
        let control = bus::lockstep::SupervisorView::open(&plan).ok()?;
        (control.completed_ticks() > 20).then_some(plan.run_id)
    });
    // It is alive until it is let go on, however long what follows takes.
    let ctl = |words: &[&str]| {
        inner.start(&[&["ctl", "--run", &inner_id][..], words].concat()).end_among_others().with_code(0)
    };
    ctl(&["pause"]);
    let outer_id = outer.run_id();
    let outer_variable = format!("HUMMINGBUS_RUN={}", outer.run_dirs()[0].display());
    for (process, _) in inner.processes() {
        let variables =
            std::fs::read(format!("/proc/{}/environ", process.as_raw_nonzero())).unwrap_or_default();
        let inherits =
            variables.split(|&byte| byte == 0).any(|variable| variable == outer_variable.as_bytes());
        assert!(!inherits, "process {process:?} of the inner run carries the outer one");
    }
    launch.kill();
    let report = clean(&place, &[]);
    assert!(remains_of(&report, &outer_id).is_some() && is_live(&report, &inner_id), "{report:#}");
    outer.await_no_process();
    assert_eq!(outer.left(), [""; 0]);
    assert!(!inner.processes().is_empty(), "the inner run is dead");
    ctl(&["pace", "free"]);
    ctl(&["resume"]);
    inner.await_no_process();
    assert_eq!(inner.run_dirs(), Vec::<PathBuf>::new(), "it took its files with it");
    let alone = place.path("alone.mcap");
    place.call(&["run", &hover, "--record", &alone, "--set", "run.duration_s=8"]).flown();
    place.call(&["diff", &inner.path("inner.mcap"), &alone]).with_code(0).prints(&["identical"]);
}

/// Things of every kind under the names of runs in shared memory; removed at the end.
struct Strange(Vec<PathBuf>);

impl Strange {
    fn new(target: &Path) -> Self {
        use rustix::fs::{CWD, FileType, makedev, mknodat};
        let name = |number: usize, rest: &str| {
            Path::new("/dev/shm").join(format!("hb_{:x}-{number:x}_{rest}", std::process::id()))
        };
        let all: Vec<PathBuf> =
            (0..9).map(|number| name(number, "run")).chain([name(9, "control")]).collect();
        mknodat(CWD, &all[0], FileType::Fifo, 0o666.into(), 0).unwrap();
        drop(std::os::unix::net::UnixListener::bind(&all[1]).unwrap());
        std::os::unix::fs::symlink(target, &all[2]).unwrap();
        std::fs::create_dir(&all[3]).unwrap();
        std::fs::write(all[3].join("kept"), "").unwrap();
        std::fs::File::create(&all[4]).unwrap().set_len(1 << 33).unwrap();
        // The null device, where one can be made.
        let _ = mknodat(CWD, &all[5], FileType::CharacterDevice, 0o666.into(), makedev(1, 3));
        let entry = |number: usize, run_dir: &Path| {
            let run_id = format!("{:x}-{number:x}", std::process::id());
            serde_json::json!({ "run_id": run_id, "run_dir": run_dir, "manifest": "/m.toml", "launcher": 1 })
                .to_string()
        };
        std::fs::write(&all[6], entry(6, target)).unwrap();
        std::fs::write(&all[7], entry(7, Path::new("/"))).unwrap();
        std::fs::write(&all[8], " ".repeat(1 << 20)).unwrap();
        mknodat(CWD, &all[9], FileType::Fifo, 0o666.into(), 0).unwrap();
        Self(all)
    }
}

impl Drop for Strange {
    fn drop(&mut self) {
        for path in &self.0 {
            let _ = std::fs::remove_file(path);
            let _ = std::fs::remove_dir_all(path);
        }
    }
}

/// Requires that no command stops at what is strange, and that what it points to is kept.
fn require_unmoved(place: &Place, target: &Path) {
    for args in [
        &["ctl", "status", "--run", "0-0"][..],
        &["swap", "imu", "--run", "0-0"],
        &["top", "--once", "--run", "0-0"],
    ] {
        place.start(args).end_among_others().with_code(2).says(&["is alive"]);
    }
    let report = clean(place, &[]);
    assert!(target.join("kept").exists(), "{report:#}");
}

#[test]
fn names_of_runs_that_are_no_files_of_runs_hinder_nobody_and_lead_nowhere() {
    let _alone = alone();
    let place = Place::new();
    let target = PathBuf::from(place.path("target"));
    std::fs::create_dir(&target).unwrap();
    std::fs::write(target.join("kept"), "").unwrap();
    let strange = Strange::new(&target);
    require_unmoved(&place, &target);
    assert!(strange.0[3].join("kept").exists(), "no folder in shared memory is a run's");
    drop(strange);
    let strange = Strange::new(&target);
    if strange.0.iter().any(|path| std::os::unix::fs::lchown(path, Some(65534), None).is_err()) {
        skip("only root can give names to another user");
        return;
    }
    require_unmoved(&place, &target);
    assert!(strange.0.iter().all(|path| path.symlink_metadata().is_ok()), "another user's are left alone");
}

#[test]
fn what_a_killed_launcher_left_in_the_place_of_a_folder_that_does_not_serve_is_removed() {
    if is_left("`cleanup::what_a_killed_launcher_left_does_not_hinder_the_next_run` kills a launcher") {
        return;
    }
    let _alone = alone();
    let (place, dead) = (Place::new(), Place::new());
    let folder = dead.path("a\n\"b");
    std::fs::create_dir(&folder).unwrap();
    let (manifest, recording) = (repository("manifests/hover.toml"), dead.path("flown.mcap"));
    let mut command = Command::new("env");
    command.args([&format!("TMPDIR={folder}"), env!("CARGO_BIN_EXE_hummingbus"), "run", &manifest]);
    command.args(["--record", &recording]).args(ENDLESS);
    let launch = dead.launch(command);
    let prefix = format!("/dev/shm/hb_{:x}-", launch.id());
    let entry: Value = poll("no entry", || {
        let mut names = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|file| file.path());
        let is_entry = |path: &PathBuf| {
            path.to_string_lossy().starts_with(&prefix) && path.to_string_lossy().ends_with("_run")
        };
        serde_json::from_slice(&std::fs::read(names.find(is_entry)?).ok()?).ok()
    });
    let run_dir = Path::new(entry["run_dir"].as_str().unwrap());
    poll("no plan", || run_dir.join("plan.json").metadata().ok());
    assert!(!run_dir.starts_with(&folder), "{run_dir:?}");
    launch.kill();
    let report = clean(&place, &[]);
    let remains = remains_of(&report, entry["run_id"].as_str().unwrap()).unwrap();
    assert_eq!(remains["paths"][0], entry["run_dir"], "{report:#}");
    assert!(!run_dir.exists() && dead.left().is_empty(), "{report:#}");
}
