//! A full /dev/shm and limits on the size of files: a run flies, or is refused in words and leaves nothing.

use crate::flight::{Reference, manifest};
use crate::saboteur::{AWAITED_VARIABLE, FAULT_VARIABLE, Fault, TICK_VARIABLE};
use crate::skipped::skip;
use crate::support::{Ended, HUMMINGBUS, Place, partial, poll, repository};
use rustix::process::{Signal, kill_process};
use std::process::Command;

/// Room that is too little, just enough, and plenty, in KiB.
const ROOMS_KIB: [u32; 24] = [
    4, 8, 12, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048, 2560, 2816, 3072,
    4096, 8192,
];

/// A command that runs `shell`, of which "$@" is `hummingbus` with `args`, where /dev/shm has `room_kib`; `None` where
/// this system allows no file system of one's own.
fn with_room(room_kib: u32, shell: &str, args: &[&str]) -> Option<Command> {
    let mount = format!("mount -t tmpfs -o size={room_kib}k none /dev/shm");
    let unshare = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--mount", "sh", "-c", script, "sh"]);
        command
    };
    if !unshare(&mount).status().is_ok_and(|status| status.success()) {
        skip("no file system can be mounted here, so /dev/shm cannot be made small");
        return None;
    }
    let mut command = unshare(&format!("{mount} || exit 9; {shell}"));
    command.arg(HUMMINGBUS).args(args);
    Some(command)
}

fn short_run(place: &Place, record: &str) -> [String; 6] {
    let args = ["run", &repository("manifests/hover.toml"), "--record", &place.path(record), "--set"];
    let mut args = args.map(str::to_owned).to_vec();
    args.push("run.duration_s=0.1".to_owned());
    args.try_into().unwrap()
}

#[test]
fn with_any_room_in_shared_memory_a_run_flies_or_is_refused_in_words() {
    let (mut flown, mut refused) = (0, 0);
    for room_kib in ROOMS_KIB {
        let place = Place::new();
        let left = place.path("left");
        let args = short_run(&place, "flown.mcap");
        let shell = format!("\"$@\"; code=$?; ls -A /dev/shm >'{left}'; exit $code");
        let Some(command) = with_room(room_kib, &shell, &args.each_ref().map(String::as_str)) else {
            return;
        };
        let ended = place.launch(command).end();
        let left = std::fs::read_to_string(left).unwrap();
        assert_eq!(left, "", "with {room_kib} KiB: {ended}");
        if ended.code == Some(2) {
            refused += 1;
            // The last where others have freed some by the time that it is looked at.
            let expected = [
                "no room for",
                "shared memory was full",
                "No space left on device",
                "memory that it had mapped was not there",
            ];
            assert!(expected.iter().any(|text| ended.error.contains(text)), "with {room_kib} KiB: {ended}");
            assert!(ended.error.contains("/dev/shm"), "with {room_kib} KiB: {ended}");
        } else {
            flown += 1;
            assert!(room_kib > 1024, "with {room_kib} KiB: {ended}");
            ended.flown();
        }
    }
    assert!(refused > 10 && flown >= 2, "{refused} refused, {flown} flown");
}

/// Flies in 8 MiB of shared memory of its own, which somebody else fills up in flight; `strike` is done then.
fn fly_into_full_memory(place: &Place, strike: impl FnOnce(&Place)) -> Option<Ended> {
    let path = place.write("flight.toml", manifest());
    let (full, go) = (place.path("full"), place.path("go"));
    let shell = format!(
        "\"$@\" & run=$!; until [ -e '{go}' ]; do sleep 0.01; done
         dd if=/dev/zero of=/dev/shm/filler bs=4k 2>/dev/null; touch '{full}'; wait $run"
    );
    let args = ["run", &path, "--record", &place.path("flight.mcap")];
    let mut command = with_room(8192, &shell, &args)?;
    // The run waits at this tick until memory is full.
    command.env(FAULT_VARIABLE, format!("{:?}", Fault::Await)).env(TICK_VARIABLE, "3000");
    command.env(AWAITED_VARIABLE, &full);
    let launch = place.launch(command);
    // Its control segment lies in a /dev/shm that is not ours: the recording tells that it flies, once it holds more than
    // its beginning of some kilobytes, the first chunk of half a megabyte. Before, a node that has not begun still needs room.
    let partial = partial(&place.path("flight.mcap"));
    poll("no chunk was recorded", || std::fs::metadata(&partial).ok().filter(|file| file.len() > 100_000));
    place.write("go", "");
    poll("nobody fills shared memory", || std::fs::metadata(&full).ok());
    strike(place);
    let ended = launch.end();
    Some(ended)
}

#[test]
fn shared_memory_that_others_fill_up_in_flight_disturbs_no_run() {
    let place = Place::new();
    let Some(ended) = fly_into_full_memory(&place, |_| ()) else { return };
    ended.with_code(0);
    let reference = Reference::fly();
    assert!(std::fs::read(place.path("flight.mcap")).unwrap() == reference.bytes(), "a byte differs");
}

#[test]
fn a_node_that_dies_of_full_shared_memory_is_named_with_the_room_that_there_is() {
    let place = Place::new();
    let bus = |place: &Place| {
        let imu = place.process_of("imu");
        // The first of them only takes the runtime's own handler away: a page that is missing is missing again.
        poll("the node lives", || kill_process(imu, Signal::BUS).err());
    };
    // The words are said by the launcher, which sees the same /dev/shm as the node.
    let Some(ended) = fly_into_full_memory(&place, bus) else { return };
    ended.with_code(2).says(&[
        "process `imu` was killed by signal 7 (SIGBUS)",
        "shared memory was full",
        "bytes free",
    ]);
}

#[test]
fn under_any_limit_on_the_size_of_files_a_run_flies_or_is_refused_in_words() {
    let mut refused = 0;
    // Blocks of 512 bytes.
    for limit in [8, 16, 32, 64, 128, 256, 512, 1024, 4096, 65536] {
        let place = Place::new();
        let args = short_run(&place, "flown.mcap");
        let mut command = Command::new("sh");
        command.args(["-c", &format!("ulimit -f {limit}; exec \"$@\""), "sh", HUMMINGBUS]).args(&args);
        let ended = place.launch(command).end();
        if limit == 65536 {
            ended.flown();
        } else if ended.code == Some(2) {
            refused += 1;
            let expected = ["ulimit -f", "File too large"];
            assert!(expected.iter().any(|text| ended.error.contains(text)), "limit {limit}: {ended}");
        } else {
            ended.flown();
        }
    }
    assert!(refused >= 3, "{refused}");
}
