//! Processes that the nodes of a run started themselves: they die with the run, however they were detached.

use crate::flight::write_manifest;
use crate::saboteur;
use crate::support::{Place, poll};
use rustix::process::{Pid, Signal, kill_process, test_kill_process};

/// A saboteur whose shell starts `detached` first, which writes its process number to a file.
fn write_stray(place: &Place, detached: &str) -> String {
    let args = saboteur::command().map(|word| format!("'{word}'")).join(" ");
    // The node joins once the other has told its number, so that no run is over before.
    let script = format!("{detached} until [ -s stray ]; do sleep 0.01; done; exec {args}");
    let tables = format!(
        "[process.saboteur]\ncommand = [\"sh\", \"-c\", {script:?}]\nworking_directory = {:?}\n",
        place.path("")
    );
    write_manifest(place, &tables)
}

/// The process whose number is written to the file `stray`, once it is.
fn stray(place: &Place) -> Pid {
    poll("no process number was written", || {
        let text = std::fs::read_to_string(place.path("stray")).ok()?;
        text.strip_suffix('\n')?.parse().ok().and_then(Pid::from_raw)
    })
}

/// Flies with a node that detaches a process in this way, ends the run with `end`, and requires that it is gone.
fn require_gone(detached: &str, signal: Option<Signal>, code: i32) {
    let place = Place::new();
    let manifest = write_stray(&place, detached);
    let recording = place.path("flight.mcap");
    let args = ["run", &manifest, "--record", &recording];
    let launch = if signal.is_some() { place.start_endless(&args) } else { place.start(&args) };
    let stray = stray(&place);
    if let Some(signal) = signal {
        kill_process(place.process_of("saboteur"), signal).unwrap();
    }
    launch.end_among_others().with_code(code);
    // On a loaded machine the system may take its time with a process that was killed.
    poll(&format!("{stray:?} outlives its run: {detached}"), || test_kill_process(stray).err());
}

const SESSION: &str = "setsid sh -c 'echo $$ > stray; exec sleep 600' &";
/// Its parent is gone at once, and so is its environment.
const DAEMON: &str =
    "env -i PATH=\"$PATH\" sh -c 'setsid sh -c \"echo \\$\\$ > stray; exec sleep 600\" & exit' &";
const DEAF: &str = "setsid sh -c 'trap \"\" TERM; echo $$ > stray; while :; do sleep 0.1; done' &";

#[test]
fn what_a_node_started_ends_with_the_run() {
    require_gone(SESSION, None, 0);
    require_gone(DAEMON, None, 0);
}

#[test]
fn what_a_node_started_ends_although_it_does_not_hear() {
    require_gone(DEAF, None, 0);
}

#[test]
fn what_a_node_started_ends_with_an_aborted_run() {
    require_gone(SESSION, Some(Signal::KILL), 2);
}

/// Runs a shell that starts `others`, which write their process numbers to the file `stray`, and then becomes the
/// launcher; requires that they live on.
fn require_left_alone(others: &str) {
    let place = Place::new();
    let manifest = crate::support::repository("manifests/hover.toml");
    let script =
        format!("{others} exec '{}' run '{manifest}' --record flight.mcap", crate::support::HUMMINGBUS);
    let mut command = std::process::Command::new("sh");
    command.args(["-c", &script]).current_dir(place.path(""));
    place.launch(command).end_among_others().with_code(0);
    let other = stray(&place);
    kill_process(other, Signal::KILL).expect("it lives");
}

#[test]
fn what_the_launchers_own_parent_started_is_left_alone() {
    // A shell that becomes the launcher hands its children over to it, and what these leave in flight as well.
    require_left_alone("sleep 600 & echo $! > stray;");
    require_left_alone("(sleep 0.05; setsid sleep 600 & echo $! > stray) &");
}
