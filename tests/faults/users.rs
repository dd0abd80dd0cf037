//! Another user of the machine: can neither read nor write a run, nor signal its processes.

use crate::flight::{Watched, manifest};
use crate::skipped::{first, skip};
use crate::support::{Place, poll, repository};
use rustix::process::Signal;
use std::fs::Permissions;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// The user and group `nobody`.
const NOBODY: u32 = 65534;

/// Runs `script` with `argument` as nobody; whether it succeeded.
fn succeeds_for_nobody(script: &str, argument: &str) -> bool {
    let mut command = Command::new("sh");
    command.args(["-c", script, "sh", argument]).uid(NOBODY).gid(NOBODY).current_dir("/");
    command.stderr(std::process::Stdio::null()).status().unwrap().success()
}

/// Opens the test's own folders, so that it is the run's own modes that keep others out.
fn open_folders(place: &Place) {
    for folder in [place.path(""), place.path("tmp")] {
        std::fs::set_permissions(folder, Permissions::from_mode(0o755)).unwrap();
    }
}

#[test]
fn another_user_can_neither_read_nor_write_nor_signal_a_run() {
    let place = Place::new();
    open_folders(&place);
    let path = place.write("flight.toml", manifest());
    let launch = place.start(&["run", &path, "--record", &place.path("flight.mcap")]);
    let watched = Watched::attach(&place);
    assert_eq!(watched.hold_at(500), 500);
    let files = watched.files(&place);
    let in_memory = files.iter().filter(|path| path.starts_with("/dev/shm")).count();
    assert!(in_memory > 20 && files.len() > in_memory + 20, "{files:#?}");
    for path in &files {
        require_private(path);
    }
    if rustix::process::getuid().is_root() {
        for path in files.iter().map(|path| path.to_string_lossy()) {
            assert!(!succeeds_for_nobody("cat \"$1\" >/dev/null", &path), "nobody reads {path}");
            assert!(!succeeds_for_nobody(": >>\"$1\"", &path), "nobody writes {path}");
        }
        let run_dir = place.run_dirs()[0].display().to_string();
        assert!(!succeeds_for_nobody("ls \"$1\"", &run_dir), "nobody lists the run directory");
        assert!(!succeeds_for_nobody(": >\"$1\"/intruder", &run_dir), "nobody writes into the run directory");
        assert!(!succeeds_for_nobody("kill -TERM \"$1\"", &launch.id().to_string()), "nobody signals");
        // What the refusals above are measured against.
        assert!(succeeds_for_nobody("cat \"$1\" >/dev/null", &path), "nobody reads the manifest");
    } else {
        skip("only root can act as a second user; the modes of the files were checked");
    }
    watched.control.set_hold_tick(u32::MAX);
    launch.end().with_code(0);
}

/// Requires that the file's own mode, or that of a folder above it, keeps others out.
fn require_private(path: &Path) {
    let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
    let is_closed = |path: &Path| mode(path) & 0o077 == 0;
    let run_dir =
        path.ancestors().find(|folder| folder.parent().is_some_and(|parent| parent.ends_with("tmp")));
    let holder = run_dir.unwrap_or(path);
    assert!(is_closed(holder), "{} has mode {:o}", holder.display(), mode(holder));
}

/// Runs that start while another user tries to open whatever of them it sees.
const RACED_RUNS: usize = 30;

/// Attempts of another user.
#[derive(Debug, Default)]
struct Race {
    opened: Vec<String>,
    refused: u64,
}

/// Tries, as nobody, to open every file of the runs whose names begin with `prefix` says, until told to end.
fn race(prefix: &Mutex<String>, folder: &Path, is_over: &AtomicBool) -> Race {
    become_nobody();
    let mut race = Race::default();
    while !is_over.load(Ordering::Relaxed) {
        let prefix = prefix.lock().unwrap().clone();
        let names = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.path());
        let ours = names.filter(|path| path.to_string_lossy().starts_with(&prefix));
        let run_dirs = std::fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path());
        let inside = |path: std::path::PathBuf| [path.clone(), path.join("plan.json"), path.join("iceoryx2")];
        for path in ours.chain(run_dirs.flat_map(inside)) {
            for (reads, writes) in [(true, true), (true, false), (false, true)] {
                match std::fs::OpenOptions::new().read(reads).write(writes).open(&path) {
                    Ok(_) => race.opened.push(path.display().to_string()),
                    Err(error) if error.kind() == std::io::ErrorKind::PermissionDenied => race.refused += 1,
                    Err(_) => {}
                }
            }
        }
    }
    race
}

/// Makes this thread nobody's, to its end.
fn become_nobody() {
    rustix::thread::set_thread_res_gid(gid(NOBODY), gid(NOBODY), gid(NOBODY)).unwrap();
    rustix::thread::set_thread_res_uid(uid(NOBODY), uid(NOBODY), uid(NOBODY)).unwrap();
}

/// Ends the race where it is dropped: an assertion that fails must not leave the racer to run for ever.
struct Finish<'a>(&'a AtomicBool);

impl Drop for Finish<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn uid(number: u32) -> rustix::fs::Uid {
    rustix::fs::Uid::from_raw(number)
}

fn gid(number: u32) -> rustix::fs::Gid {
    rustix::fs::Gid::from_raw(number)
}

#[test]
fn another_user_who_tries_at_every_moment_opens_no_file_of_a_run() {
    if !rustix::process::getuid().is_root() {
        skip("only root can act as a second user");
        return;
    }
    let place = Place::new();
    open_folders(&place);
    let manifest = repository("manifests/hover.toml");
    let (prefix, is_over, folder) =
        (Mutex::new("/nowhere".to_owned()), AtomicBool::new(false), place.path("tmp"));
    let runs = first(5, "raced runs", 0..RACED_RUNS).len();
    let race = std::thread::scope(|scope| {
        let racer = scope.spawn(|| race(&prefix, Path::new(&folder), &is_over));
        let finish = Finish(&is_over);
        for _ in 0..runs {
            let recording = place.path("raced.mcap");
            let args = ["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.01"];
            // A umask that takes nothing away must not open anything.
            let mut command = Command::new("sh");
            command.args(["-c", "umask 0; exec \"$@\"", "sh", crate::support::HUMMINGBUS]).args(args);
            let launch = place.launch(command);
            *prefix.lock().unwrap() = format!("/dev/shm/hb_{:x}-", launch.id());
            launch.end().flown();
            // What the user is given is the umask's: no more is taken away than that.
            let mode = std::fs::metadata(&recording).unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o666, "the recording has mode {mode:o}");
            std::fs::remove_file(recording).unwrap();
        }
        drop(finish);
        racer.join().unwrap()
    });
    assert!(race.opened.is_empty(), "{:?}", race.opened);
    assert!(race.refused > 10 * runs as u64, "it saw too little of the runs: {}", race.refused);
}

/// The first line of the answer that nobody gets to a request for `path`.
fn answer_to_nobody(host: &str, path: &str) -> String {
    let ask = || {
        become_nobody();
        let mut stream = TcpStream::connect(host).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        String::from_utf8_lossy(&answer).lines().next().unwrap_or_default().to_owned()
    };
    std::thread::scope(|scope| scope.spawn(ask).join().unwrap())
}

#[test]
fn another_user_finds_no_token_of_the_view_and_is_refused_without_it() {
    if !rustix::process::getuid().is_root() {
        skip("only root can act as a second user");
        return;
    }
    let place = Place::new();
    open_folders(&place);
    let (recording, opened) = (place.path("hover.mcap"), place.path("opened"));
    let manifest = repository("manifests/hover.toml");
    place.call(&["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.5"]).with_code(1);
    let script = format!("#!/bin/sh\necho \"$1\" >{opened}.new && mv {opened}.new {opened}\n");
    let browser = place.write("browser", script);
    std::fs::set_permissions(&browser, Permissions::from_mode(0o755)).unwrap();
    let launch = place.start_with(&["view", &recording], &[("BROWSER", &browser)]);
    let address = poll("no address", || {
        launch.output().lines().find_map(|line| line.strip_prefix("http://").map(str::to_owned))
    });
    let (host, path) = address.split_at(address.find('/').unwrap());
    let seen = poll("no browser was opened", || std::fs::read_to_string(&opened).ok());

    let page = seen.trim().strip_prefix("file://").unwrap();
    let [arguments, environment] = ["cmdline", "environ"].map(|file| format!("/proc/{}/{file}", launch.id()));
    assert!(!succeeds_for_nobody("cat \"$1\" >/dev/null", page), "nobody reads the page that leads there");
    assert!(!succeeds_for_nobody("cat \"$1\" >/dev/null", &environment), "nobody reads the environment");
    assert!(!succeeds_for_nobody("grep -qa token= \"$1\"", &arguments), "the arguments have the token");
    for path in ["/", "/api/catalogue", "/token=00000000000000000000000000000000/api/catalogue"] {
        assert_eq!(answer_to_nobody(host, path), "HTTP/1.1 403 Forbidden", "{path}");
    }
    // What the refusals above are measured against.
    assert_eq!(answer_to_nobody(host, path), "HTTP/1.1 200 OK");
    launch.signal(Signal::TERM);
    launch.end().with_code(0);
}
