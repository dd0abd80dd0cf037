//! Folders for temporary files of every kind: a run flies with each of them, or says what is wrong with it.

use crate::support::{ENDLESS, Ended, HUMMINGBUS, Launch, Place, poll};
use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::process::Command;

/// `hummingbus` with `args` and its temporary files in `folder`.
fn hummingbus(place: &Place, folder: &OsStr, args: &[&str]) -> Command {
    let mut variable = OsString::from("TMPDIR=");
    variable.push(folder);
    let mut command = Command::new("env");
    command.arg(variable).arg(HUMMINGBUS).args(args).current_dir(place.path(""));
    command
}

fn fly(place: &Place, folder: &OsStr) -> Ended {
    let (manifest, recording) =
        (crate::support::repository("manifests/hover.toml"), place.path("flown.mcap"));
    let args = ["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.02"];
    let launch = place.launch(hummingbus(place, folder, &args));
    let id = launch.id();
    let ended = launch.end();
    let left = run_dirs(id, folder);
    assert!(left.is_empty(), "left behind with TMPDIR={folder:?}: {left:?}: {ended}");
    ended
}

/// The directories of the runs of `launcher`, wherever they may be.
fn run_dirs(launcher: u32, folder: &OsStr) -> Vec<PathBuf> {
    let prefix = format!("hummingbus-{}-{launcher:x}-", bus::process::user_id());
    let folders = [Path::new("/tmp"), Path::new("/dev/shm"), Path::new(folder)];
    let entries = folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten().flatten();
    let ours = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix));
    ours.map(|entry| entry.path()).collect()
}

/// A folder below `place` whose path has `length` bytes.
fn folder_of_length(place: &Place, length: usize) -> OsString {
    let mut path = place.path("").trim_end_matches('/').to_owned();
    while path.len() < length {
        path += "/";
        path += &"x".repeat((length - path.len()).min(100));
        path.truncate(length);
    }
    let path = path.trim_end_matches('/').to_owned();
    std::fs::create_dir_all(&path).unwrap();
    path.into()
}

#[test]
fn a_run_flies_whatever_the_length_of_its_folder_for_temporary_files() {
    for length in [40, 60, 64, 70, 75, 80, 90, 100, 120, 150, 200, 255, 300, 1000] {
        let place = Place::new();
        fly(&place, &folder_of_length(&place, length)).flown();
    }
}

#[test]
fn a_run_flies_whatever_characters_its_folder_for_temporary_files_has() {
    let place = Place::new();
    let names: [&[u8]; 14] = [
        b"a b",
        b"a'b",
        b"a\"b",
        b"a\nb",
        "ä€".as_bytes(),
        b"a*?",
        b"a<b>|c",
        b"a\\b",
        b"$(x)`y`",
        b"-a",
        b"a:b",
        b"\x01",
        b"\xff",
        b"a;b&c",
    ];
    for name in names {
        let folder = Path::new(&place.path("")).join(OsStr::from_bytes(name));
        std::fs::create_dir(&folder).unwrap();
        fly(&place, folder.as_os_str()).flown();
    }
}

#[test]
fn a_relative_or_linked_or_empty_folder_for_temporary_files_serves() {
    let place = Place::new();
    std::fs::create_dir(place.path("inner")).unwrap();
    std::os::unix::fs::symlink("inner", place.path("link")).unwrap();
    for folder in ["inner", "./inner/../inner", &place.path("link"), ""] {
        fly(&place, OsStr::new(folder)).flown();
    }
}

#[test]
fn a_folder_for_temporary_files_that_does_not_serve_is_named() {
    let place = Place::new();
    let (nowhere, file) = (place.path("nowhere"), place.write("file", ""));
    for folder in [&nowhere, &file, "/proc"] {
        fly(&place, OsStr::new(folder)).with_code(2).says(&[
            "cannot create the run directory",
            folder,
            "TMPDIR",
        ]);
    }
}

/// The name of the run that `launch` flies.
fn run_id(launch: &Launch<'_>) -> String {
    let prefix = format!("hb_{:x}-", launch.id());
    poll("no entry", || {
        let names = std::fs::read_dir("/dev/shm").unwrap().flatten();
        let mut names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
        names
            .find(|name| name.starts_with(&prefix) && name.ends_with("_run"))
            .map(|name| name[3..name.len() - 4].to_owned())
    })
}

#[test]
fn a_run_whose_directory_is_elsewhere_is_found_steered_and_watched() {
    let place = Place::new();
    let folder = OsString::from_vec([place.path("").as_bytes(), "a\nä\"".as_bytes()].concat());
    std::fs::create_dir(&folder).unwrap();
    let (manifest, recording) =
        (crate::support::repository("manifests/hover.toml"), place.path("flown.mcap"));
    let args = ["run", &manifest, "--record", &recording];
    let command = hummingbus(&place, &folder, &[&args[..], &ENDLESS].concat());
    let launch = place.launch(command);
    let run_id = run_id(&launch);
    let ask =
        |args: &[&str]| place.start(&[args, &["--run", &run_id]].concat()).end_among_others().with_code(0);
    ask(&["ctl", "pause"]).prints(&["paused at tick"]);
    ask(&["top", "--once"]).prints(&["hover.toml", "paused"]);
    ask(&["ctl", "stop"]);
    let ended = launch.end().with_code(1);
    ended.prints(&["stopped before its end"]);
}
