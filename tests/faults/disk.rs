//! A full disk under the recorder: the run ends, says which file and why, and what was written reads back.

use crate::flight::{Reference, Watched, manifest};
use crate::skipped::skip;
use crate::support::{Ended, HUMMINGBUS, Place, partial, poll};
use std::process::Command;

/// Flies with `shell` around the launcher, which is its `"$@"`.
fn fly_in(place: &Place, shell: &str, interpreter: &[&str], recording: &str) -> Ended {
    let path = place.write("flight.toml", manifest());
    let mut command = Command::new(interpreter[0]);
    command
        .args(&interpreter[1..])
        .args(["sh", "-c", shell, "sh", HUMMINGBUS, "run", &path, "--record", recording]);
    let launch = place.launch(command);
    let watched = Watched::attach(place);
    let ended = launch.end_among_others();
    place.await_no_process();
    poll("files of a run that has ended", || watched.files(place).is_empty().then_some(()));
    ended
}

/// Requires that the file at `path` is the start of the undisturbed recording.
fn require_prefix(place: &Place, path: &str) {
    let reference = Reference::fly();
    let diff = place.call(&["diff", path, &reference.path()]).with_code(1);
    diff.prints(&[path, "is a prefix of", &reference.path(), "it ends after tick"]);
    diff.says(&["was cut off"]);
}

/// The bytes of a recording of 50 ms.
fn short_recording(place: &Place) -> Vec<u8> {
    let (path, recording) = (place.write("short.toml", manifest()), place.path("short.mcap"));
    place.call(&["run", &path, "--record", &recording, "--set", "run.duration_s=0.05"]).with_code(0);
    std::fs::read(recording).unwrap()
}

#[test]
fn a_full_disk_is_named_with_the_recorder_and_the_file() {
    if !rustix::process::getuid().is_root() {
        skip("only root can mount a small file system");
        return;
    }
    let place = Place::new();
    let (disk, kept) = (place.path("disk"), place.path("kept.mcap"));
    std::fs::create_dir(&disk).unwrap();
    let (recording, partial) = (format!("{disk}/flight.mcap"), format!("{disk}/flight.partial.mcap"));
    // The good recording of an earlier run takes little of the room.
    let (earlier, survived) =
        (place.write("earlier.mcap", short_recording(&place)), place.path("survived.mcap"));
    let shell = format!(
        "mount -t tmpfs -o size=650k none '{disk}' || exit 9; cp '{earlier}' '{recording}'; \"$@\"; code=$?; \
         cp '{partial}' '{kept}'; cp '{recording}' '{survived}'; exit $code"
    );
    let ended = fly_in(&place, &shell, &["unshare", "--mount"], &recording).with_code(2);
    ended.says(&[
        "process `recorder`",
        "node `recorder` failed at tick",
        &partial,
        "No space left on device",
        &format!("What was recorded until then is in {partial}"),
    ]);
    require_prefix(&place, &kept);
    assert!(
        std::fs::read(survived).unwrap() == std::fs::read(earlier).unwrap(),
        "the earlier recording is gone"
    );
}

#[test]
fn a_limit_on_the_size_of_files_is_named_with_the_recorder_and_the_file() {
    let place = Place::new();
    let recording = place.path("flight.mcap");
    // Blocks of 512 bytes. The signal is ignored, as daemons do: the write fails instead.
    let ended = fly_in(&place, "trap '' XFSZ; ulimit -f 2400; \"$@\"", &["env"], &recording).with_code(2);
    let partial = partial(&recording);
    ended.says(&["process `recorder`", "node `recorder` failed at tick", &partial, "File too large"]);
    require_prefix(&place, &partial);
}

#[test]
fn a_recorder_killed_for_the_size_of_its_file_is_named_with_the_signal() {
    let place = Place::new();
    let recording = place.path("flight.mcap");
    let ended = fly_in(&place, "ulimit -f 2400; \"$@\"", &["env"], &recording).with_code(2);
    ended.says(&["process `recorder` was killed by signal 25 (SIGXFSZ)", "aborted at tick"]);
    require_prefix(&place, &partial(&recording));
}

#[test]
fn a_device_is_no_place_for_a_recording_and_is_left_alone() {
    let place = Place::new();
    let path = place.write("flight.toml", manifest());
    // A pipe stands for a device: a recorder that replaced /dev/null would do it for the whole machine.
    let pipe = place.path("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let ended = place.call(&["run", &path, "--record", &pipe]).with_code(2);
    ended.says(&["cannot create the recording", &pipe, "not a regular file"]);
    assert!(!std::fs::metadata(&pipe).unwrap().is_file());
}
