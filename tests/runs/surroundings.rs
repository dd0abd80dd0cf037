//! Hosts that lack something: a run says what, and leaves nothing behind.

use crate::refusals::{endless, good};
use crate::skipped::{quick_or, skip};
use crate::support::{Ended, HUMMINGBUS, Place, poll, repository};
use rustix::process::Signal;
use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::Command;

/// Runs `script` in a mount namespace of its own, where "$@" is `hummingbus run hover.toml`; `None` where this system
/// allows none.
fn in_namespace(place: &Place, script: &str) -> Option<Ended> {
    let unshare = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--mount", "sh", "-c", script, "sh"]);
        command
    };
    if !unshare("mount -t tmpfs none /mnt").status().is_ok_and(|status| status.success()) {
        skip("no file system can be mounted here");
        return None;
    }
    let mut command = unshare(script);
    let (hover, recording) = (repository("manifests/hover.toml"), place.path("a.mcap"));
    command.args([HUMMINGBUS, "run", &hover, "--record", &recording, "--set", "run.duration_s=0.1"]);
    Some(place.launch(command).end())
}

#[test]
fn a_host_without_proc_is_named() {
    let place = Place::new();
    let Some(ended) = in_namespace(&place, "mount -t tmpfs none /proc; exec \"$@\"") else { return };
    ended.with_code(2).says(&["/proc is not there", "mount -t proc proc /proc"]);
}

#[test]
fn a_full_folder_for_temporary_files_is_named() {
    let mut refused = 0;
    for room_kib in [16, 32, 64, 128, 4096] {
        let place = Place::new();
        let script = format!("mount -t tmpfs -o size={room_kib}k none \"$TMPDIR\"; exec \"$@\"");
        let Some(ended) = in_namespace(&place, &script) else { return };
        if ended.code == Some(2) {
            refused += 1;
            ended.says(&[
                "The folder for temporary files, ",
                " bytes free; make room there, or set TMPDIR to another folder",
            ]);
        } else {
            ended.flown();
        }
    }
    assert!((2..5).contains(&refused), "{refused} of 5 refused");
}

/// Every file that the launcher or a node opens is once the one too many.
#[test]
fn under_any_limit_on_open_files_a_run_flies_or_is_refused_and_leaves_nothing() {
    let (mut flown, mut refused) = (0, 0);
    for limit in (4..12).chain((12..64).step_by(4)).chain([256]) {
        let place = Place::new();
        let (hover, recording) = (repository("manifests/hover.toml"), place.path("a.mcap"));
        let mut command = Command::new("sh");
        command.args(["-c", &format!("ulimit -n {limit}; exec \"$@\""), "sh", HUMMINGBUS]);
        command.args(["run", &hover, "--record", &recording, "--set", "run.duration_s=0.05"]);
        let ended = place.launch(command).end();
        if ended.code == Some(2) {
            refused += 1;
            assert!(ended.error.contains("error: "), "{limit}: {ended}");
        } else {
            flown += 1;
            ended.flown();
        }
    }
    assert!(refused > 3 && flown > 3, "{refused} refused, {flown} flown");
}

#[test]
fn what_cannot_be_removed_is_named() {
    let place = Place::new();
    let script = "mkdir \"$HUMMINGBUS_RUN/busy\"; mount -t tmpfs none \"$HUMMINGBUS_RUN/busy\"; : >\"$BUSY\"; sleep 600";
    let busy = place.path("busy");
    let sidecar = format!(
        "\n[process.viewer]\nlockstep = false\ncommand = [\"sh\", \"-c\", {script:?}]\nenvironment = {{ BUSY = {busy:?} }}\n"
    );
    let text = endless(&good()) + &sidecar;
    let path = place.write("busy.toml", text);
    let mut command = Command::new("unshare");
    if !command.args(["--mount", "true"]).status().is_ok_and(|status| status.success()) {
        skip("there is no mount namespace of one's own here");
        return;
    }
    let mut command = Command::new("unshare");
    command.args(["--mount", HUMMINGBUS, "run", &path, "--record", &place.path("a.mcap")]);
    let launch = place.launch(command);
    poll("the sidecar mounts nothing", || Path::new(&busy).exists().then_some(()));
    launch.signal(Signal::INT);
    let ended = launch.end_among_others();
    // With the namespace the mount has gone.
    let left = place.run_dirs();
    left.iter().for_each(|left| fs::remove_dir_all(left).unwrap());
    let [left] = &left[..] else { panic!("{left:?}") };
    ended.says(&[&format!("cannot remove {}", left.display()), "busy", "`hummingbus clean` removes it"]);
}

#[test]
fn a_recording_whose_folder_is_renamed_in_flight_is_told_with_its_place() {
    let place = Place::new();
    fs::create_dir(place.path("before")).unwrap();
    let path = place.write("long.toml", endless(&good()));
    let mut launch = place.start(&["run", &path, "--record", &place.path("before/a.mcap"), "--json"]);
    launch.await_ticks(100);
    fs::rename(place.path("before"), place.path("after")).unwrap();
    launch.signal(Signal::INT);
    let ended = launch.end().with_code(2);
    let now = place.path("after/a.partial.mcap");
    ended.says(&["its folder was renamed or moved during the run; the whole recording is", &now]);
    assert_eq!(ended.json()["partial_recording"], now, "{ended}");
    place.call(&["cat", &now, "--topic", "/plant/state"]).with_code(0);
}

/// A process that its launcher traces is reported when it stops, and has not ended.
#[test]
fn a_process_that_stops_as_a_traced_one_has_not_ended() {
    let place = Place::new();
    let script = "import ctypes, os, signal\nctypes.CDLL(None).ptrace(0, 0, 0, 0)\nos.kill(os.getpid(), signal.SIGSTOP)";
    let sidecar =
        format!("\n[process.viewer]\nlockstep = false\ncommand = [\"python3\", \"-c\", {script:?}]\n");
    let text = endless(&good()) + &sidecar;
    let path = place.write("traced.toml", text);
    let mut launch = place.start(&["run", &path, "--record", &place.path("a.mcap")]);
    let is_traced = |id: &str| {
        let stat = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
        stat.rsplit(')').next().is_some_and(|rest| rest.trim_start().starts_with('t'))
    };
    poll("nothing stops", || {
        place.processes().into_iter().find(|(id, _)| is_traced(&id.as_raw_nonzero().to_string()))
    });
    let ticks = 2000;
    launch.await_ticks(ticks);
    launch.signal(Signal::INT);
    let ended = launch.end();
    assert!(!ended.error.contains("signal 0"), "{ended}");
    ended.with_code(1).prints(&["stopped before its end"]);
}

#[test]
fn a_folder_that_is_not_utf_8_is_named() {
    let place = Place::new();
    let folder = Path::new(&place.path("")).join(OsStr::from_bytes(b"caf\xe9"));
    fs::create_dir(&folder).unwrap();
    fs::copy(repository("vehicles/hummingbird.toml"), folder.join("bird.toml")).unwrap();
    let text = good().replace(&repository("vehicles/hummingbird.toml"), "bird.toml");
    fs::write(folder.join("hover.toml"), text).unwrap();
    for command in ["check", "run"] {
        let mut call = Command::new(HUMMINGBUS);
        call.arg(command).arg(folder.join("hover.toml"));
        let ended = place.launch(call).end().with_code(2);
        ended.says(&[
            "the path ",
            "bird.toml is not UTF-8",
            "move the files into a folder whose name is UTF-8",
        ]);
    }
    let mut call = Command::new(HUMMINGBUS);
    call.arg("urdf").arg(folder.join("bird.toml"));
    place.launch(call).end().with_code(0).prints(&["<robot"]);
}

#[test]
fn a_chain_of_includes_has_a_limit() {
    let place = Place::new();
    let count = quick_or(200, 20_000, "longer chains");
    for number in 0..count {
        place.write(&format!("{number}.toml"), format!("include = [\"{}.toml\"]\n", number + 1));
    }
    place.write(&format!("{count}.toml"), good());
    let ended = place.call(&["check", &place.path("0.toml")]).with_code(2);
    ended.says(&["63.toml:1:12: includes stand more than 64 files deep, with ", "64.toml", "side by side"]);
    place.call(&["check", &place.path(&format!("{}.toml", count - 60))]).with_code(0);
}
