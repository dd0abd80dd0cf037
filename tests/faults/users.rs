//! Another user of the machine: can neither read nor write a run, nor signal its processes.

use crate::flight::{Watched, manifest};
use crate::support::Place;
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

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
        println!("NOT SHOWN with a second user, whom only root can be: modes alone were checked");
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
