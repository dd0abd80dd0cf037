//! Requests to the system that a run has no right to are refused with the name of the right.

use crate::skipped::skip;
use crate::support::{Ended, HUMMINGBUS, Place, repository};
use std::process::Command;

/// A launch of `hummingbus` without the right to lock memory and to have a priority. `None` where this system
/// does not let go of rights: then nothing is shown, and the test says so.
fn without_rights(place: &Place, args: &[&str]) -> Option<Ended> {
    let command = |program: &str| {
        let limits = ["--memlock=65536:65536", "--rtprio=0:0"];
        // To a superuser limits are nothing: the capabilities have to go.
        let mut command = if rustix::process::geteuid().is_root() {
            let mut command = Command::new("setpriv");
            command.args(["--bounding-set=-ipc_lock,-sys_nice", "--inh-caps=-all", "prlimit"]);
            command
        } else {
            Command::new("prlimit")
        };
        command.args(limits).arg(program);
        command
    };
    if !command("true").status().is_ok_and(|status| status.success()) {
        skip("setpriv or prlimit cannot take rights away here");
        return None;
    }
    let mut command = command(HUMMINGBUS);
    command.args(args);
    Some(place.launch(command).end())
}

fn hover(place: &Place, set: &str) -> Option<Ended> {
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("hover.mcap"));
    without_rights(
        place,
        &["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.1", "--set", set],
    )
}

#[test]
fn memory_that_may_not_be_locked_is_refused_with_the_right_that_it_takes() {
    let place = Place::new();
    let Some(ended) = hover(&place, "run.lock_memory=true") else { return };
    let action = "cannot lock the memory of this process (run.lock_memory)";
    ended.with_code(2).says(&["process `", action, "CAP_IPC_LOCK", "ulimit -l"]);
}

#[test]
fn a_real_time_priority_that_may_not_be_had_is_refused_with_the_right_that_it_takes() {
    let place = Place::new();
    let Some(ended) = hover(&place, "process.imu.realtime_priority=10") else { return };
    let refused = "process `imu`: `realtime_priority = 10` is refused: ";
    ended.with_code(2).says(&[refused, "CAP_SYS_NICE", "ulimit -r"]);
}

#[test]
fn a_run_that_asks_for_no_right_flies_without_any() {
    let place = Place::new();
    if let Some(ended) = hover(&place, "run.seed=1") {
        ended.flown();
    }
}
