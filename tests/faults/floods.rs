//! Processes that write too much or what no terminal should see, and a launcher that cannot write at all.

use crate::flight::write_manifest;
use crate::support::{ENDLESS, Ended, HUMMINGBUS, Place, repository};
use std::fs::File;
use std::process::{Command, Stdio};

/// Address space of the launcher, and of each process that it starts: less than a flood.
const LAUNCHER_KIB: u32 = 280_000;
/// Most bytes that the launcher prints of a run that fails.
const SAID_BYTES: usize = 16 * 1024;

/// Flies with a sidecar that writes and then fails.
fn fly(script: &str) -> Ended {
    let place = Place::new();
    let tables = format!("[process.viewer]\nlockstep = false\ncommand = [\"sh\", \"-c\", {script:?}]\n");
    let manifest = write_manifest(&place, &tables);
    let recording = place.path("flight.mcap");
    // Who read a flood whole would need more memory than this.
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -v {LAUNCHER_KIB}; exec \"$@\""), "sh", HUMMINGBUS]);
    command.args(["run", &manifest, "--record", &recording]).args(ENDLESS);
    place.launch(command).end().with_code(2)
}

#[test]
fn of_a_flood_the_end_is_shown() {
    let ended = fly("i=0; while [ $i -lt 100000 ]; do echo line $i of a flood; i=$((i+1)); done; exit 3");
    ended.says(&["process `viewer` ended with exit code 3", "line 99999 of a flood"]);
    assert!(
        ended.error.len() < SAID_BYTES && !ended.error.contains("line 1 of"),
        "{} bytes",
        ended.error.len()
    );
}

#[test]
fn a_line_without_end_is_cut() {
    let ended = fly("head -c 300000000 /dev/zero | tr '\\0' x; exit 3");
    ended.says(&["xxx … ", " characters left out … xxx"]);
    assert!(ended.error.len() < SAID_BYTES, "{} bytes", ended.error.len());
}

#[test]
fn what_a_terminal_would_obey_is_escaped() {
    let ended = fly("printf 'a\\033]0;owned\\007\\033[2Jb\\377\\376c\\n'; exit 3");
    ended.says(&["a\\u{1b}]0;owned\\u{7}\\u{1b}[2Jb\\xff\\xfec"]);
    assert!(!ended.error.contains('\u{1b}'), "{ended}");
}

/// Exit code of `hummingbus` with `args`, with nowhere to write to.
fn code_without_output(args: &[&str]) -> Option<i32> {
    let full = || Stdio::from(File::options().write(true).open("/dev/full").unwrap());
    let place = Place::new();
    let mut command = Command::new(HUMMINGBUS);
    place.mark(&mut command).args(args).stdin(Stdio::null()).stdout(full()).stderr(full());
    command.status().unwrap().code()
}

#[test]
fn a_command_that_cannot_write_at_all_fails_in_order() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("flight.mcap"));
    assert_eq!(code_without_output(&["schema"]), Some(2));
    assert_eq!(code_without_output(&["check", &manifest]), Some(2));
    assert_eq!(code_without_output(&["run", "nowhere.toml"]), Some(2));
    let short = ["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.1"];
    assert_eq!(code_without_output(&short), Some(2));
}
