//! Campaigns on Slurm: a real cluster of one node where Slurm is installed, and scripts with the names of its commands for what a
//! cluster does seldom.

use crate::campaign::{HOVERS, rows, written};
use crate::campaign_results::other_build;
use crate::skipped::{is_left, skip};
use crate::support::{Ended, HUMMINGBUS, Launch, Place, repository};
use rustix::process::Signal;
use std::fs;
use std::io::Write as _;
use std::os::unix::fs::PermissionsExt as _;
use std::process::Command;

/// An `sbatch` that flies the tasks of an array before it returns, but for those of the file `lost`, which it empties line by
/// line: a line a submission. The word `busy` in it has the submission refused; a task with a `?` behind it is pending for ever.
const SBATCH: &str = r#"#!/bin/sh
here=$(dirname "$0")
case $(head -n 1 "$here/lost" 2>/dev/null) in
  busy) sed -i 1d "$here/lost"; echo "sbatch: error: Socket timed out on send/recv operation" >&2; exit 1 ;;
esac
number=$(($(cat "$here/arrays" 2>/dev/null || echo 0) + 1))
echo "$number" >"$here/arrays"
for word in "$@"; do
  case $word in
    --array=*) array=${word#--array=} ;;
    --output=*) logs=$(dirname "${word#--output=}") ;;
    --partition=nowhere) echo "sbatch: error: invalid partition specified: nowhere" >&2; exit 1 ;;
  esac
  script=$word
done
echo "$number $array" >>"$here/submitted"
lost=" $(head -n 1 "$here/lost" 2>/dev/null) "
sed -i 1d "$here/lost" 2>/dev/null
for range in $(echo "$array" | tr , ' '); do
  for task in $(seq "${range%-*}" "${range#*-}"); do
    case $lost in
      *" $task? "*) echo "$number $task PENDING" >>"$here/states" ;;
      *" $task "*) echo "$number $task NODE_FAIL" >>"$here/states" ;;
      *)
        SLURM_ARRAY_TASK_ID=$task SLURM_JOB_ID=$((1000 * number + task)) sh "$script" >"$logs/log-$task-$number.txt" 2>&1
        echo "$number $task COMPLETED" >>"$here/states" ;;
    esac
  done
done
echo "$number"
"#;
const SQUEUE: &str = "#!/bin/sh\ncat \"$(dirname \"$0\")/states\"\n";
/// Cancels what is pending, and notes the arrays.
const SCANCEL: &str = r#"#!/bin/sh
here=$(dirname "$0")
echo "$*" >>"$here/cancelled"
for number in "$@"; do sed -i "s/^$number \\(.*\\) PENDING/$number \\1 CANCELLED/" "$here/states"; done
"#;

/// Exit code of `scripts/slurm-check` where no cluster comes up.
const NO_CLUSTER: i32 = 77;

/// A campaign of 12 short hovers in tasks of 5, by Slurm's commands in the folder `bin`.
fn on_slurm(place: &Place, out: &str, more: &[&str]) -> Ended {
    start_on_slurm(place, out, more).end()
}

fn start_on_slurm<'a>(place: &'a Place, out: &str, more: &[&str]) -> Launch<'a> {
    let campaign = written(place, "c.toml", HOVERS);
    let path = format!("{}:/usr/bin:/bin", place.path("bin"));
    let args = ["campaign", &campaign, "--out", out, "--engine", "slurm", "--chunk", "5"];
    place.start_with(&[&args, more].concat(), &[("PATH", &path)])
}

/// Writes the scripts; `lost` has the tasks that the first submissions lose, a line each.
fn stand_in(place: &Place, lost: &str) {
    fs::create_dir(place.path("bin")).unwrap();
    for (name, text) in [("sbatch", SBATCH), ("squeue", SQUEUE), ("scancel", SCANCEL), ("lost", lost)] {
        let path = place.write(&format!("bin/{name}"), text);
        fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
    }
}

#[test]
fn a_cluster_gives_the_rows_of_this_machine_whatever_it_loses() {
    if is_left("`the_chunks_of_a_lost_node_are_submitted_again_and_no_others` has scripts in place of Slurm")
    {
        return;
    }
    let program = |name: &str| {
        let folders = ["/usr/bin", "/usr/sbin", "/bin", "/sbin"];
        folders.iter().any(|folder| fs::exists(format!("{folder}/{name}")).unwrap_or(false))
    };
    if let Some(missing) = ["munged", "slurmctld", "slurmd", "sbatch"].into_iter().find(|name| !program(name))
    {
        return skip(&format!("there is no {missing}; Debian's packages slurm-wlm and munge have it"));
    }
    if !rustix::process::geteuid().is_root() {
        return skip("a Slurm cluster of its own needs root");
    }
    let flights = 240;
    let mut command = Command::new(repository("scripts/slurm-check"));
    let output = command.args([HUMMINGBUS, &flights.to_string()]).output().unwrap();
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    if output.status.code() == Some(NO_CLUSTER) {
        // The daemons' logs, which the test runner would hide; the last line is the reason.
        let _ = std::io::stderr().write_all(&output.stderr);
        return skip(&format!(
            "Slurm is installed, but {}",
            errors.lines().last().unwrap_or("no cluster starts here")
        ));
    }
    assert!(output.status.success(), "{text}\n{errors}");
    // One for each campaign: undisturbed, disturbed, resumed, cancelled.
    let same = format!("{flights} rows, the same bytes");
    assert_eq!(text.matches(&same).count(), 4, "{text}");
}

#[test]
fn the_chunks_of_a_lost_node_are_submitted_again_and_no_others() {
    let place = Place::new();
    stand_in(&place, "0 2\n2\n");
    let (alone, out) = (place.path("alone"), place.path("out"));
    let ended = on_slurm(&place, &out, &["--workers", "2"]).with_code(0);
    ended.prints(&["12 of 12 flights passed"]);
    ended.says(&[
        "submitted 3 tasks to Slurm as job 1",
        "task 1_0 ended before 5 flights: NODE_FAIL",
        "task 1_2 ended before 2 flights: NODE_FAIL",
        "task 2_2 ended before 2 flights: NODE_FAIL",
    ]);
    assert_eq!(fs::read_to_string(place.path("bin/submitted")).unwrap(), "1 0-2\n2 0,2\n3 2\n");
    let campaign = place.path("c.toml");
    place.call(&["campaign", &campaign, "--out", &alone]).with_code(0);
    assert_eq!(rows(&out), rows(&alone));
    assert!(!fs::exists(format!("{out}/slurm")).unwrap(), "the tasks' folder was left behind");
}

#[test]
fn a_controller_that_is_busy_when_chunks_are_submitted_again_costs_nothing() {
    if is_left("`the_chunks_of_a_lost_node_are_submitted_again_and_no_others` loses chunks") {
        return;
    }
    let place = Place::new();
    stand_in(&place, "0\nbusy\nbusy\n");
    let ended = on_slurm(&place, &place.path("out"), &[]).with_code(0);
    ended.prints(&["12 of 12 flights passed"]);
    ended.says(&["they are submitted again later", "Socket timed out"]);
    assert_eq!(fs::read_to_string(place.path("bin/submitted")).unwrap(), "1 0-2\n2 0\n");
    assert_eq!(ended.error.matches("ended before 5 flights").count(), 1, "{ended}");
}

#[test]
fn a_campaign_that_is_stopped_cancels_all_its_arrays_and_is_flown_by_the_next_call() {
    let place = Place::new();
    // Chunk 2 is lost, then pending; chunk 1 stays pending in the first array.
    stand_in(&place, "1? 2\n2?\n");
    let out = place.path("out");
    let launch = start_on_slurm(&place, &out, &[]);
    launch.await_said("submitted 1 tasks to Slurm as job 2");
    launch.signal(Signal::INT);
    launch.end().with_code(2).says(&["was interrupted; the same command flies the other 7 flights"]);
    assert_eq!(fs::read_to_string(place.path("bin/cancelled")).unwrap(), "1\n2\n");
    let states = fs::read_to_string(place.path("bin/states")).unwrap();
    assert!(states.contains("1 1 CANCELLED") && states.contains("2 2 CANCELLED"), "{states}");
    on_slurm(&place, &out, &[]).with_code(0).prints(&["12 of 12 flights passed"]);
}

#[test]
fn flights_of_a_chunk_that_is_always_lost_have_the_reason_and_are_flown_by_the_next_call() {
    if is_left("`the_chunks_of_a_lost_node_are_submitted_again_and_no_others` loses chunks") {
        return;
    }
    let place = Place::new();
    stand_in(&place, "1\n1\n1\n");
    let out = place.path("out");
    let ended = on_slurm(&place, &out, &[]).with_code(2);
    ended.prints(&["7 of 12 flights passed", "ended 3 times without a flight: NODE_FAIL"]);
    ended.says(&["the host ended 5 flights, without which there is no verdict"]);
    on_slurm(&place, &out, &[]).with_code(0).prints(&["12 of 12 flights passed"]);
    assert_eq!(fs::read_to_string(place.path("bin/submitted")).unwrap(), "1 0-2\n2 1\n3 1\n4 0\n");
}

#[test]
fn tasks_that_cannot_fly_refuse_the_campaign_with_their_last_words() {
    let place = Place::new();
    stand_in(&place, "");
    let ended = on_slurm(&place, &place.path("out"), &["--node-command", "echo no such container && false"]);
    ended.with_code(2).says(&["ended 3 times without a flight", "it said: no such container"]);
}

#[test]
fn a_node_with_another_build_flies_nothing() {
    if is_left("`tasks_that_cannot_fly_refuse_the_campaign_with_their_last_words` has nodes that cannot fly")
    {
        return;
    }
    let place = Place::new();
    stand_in(&place, "");
    let ended = on_slurm(&place, &place.path("out"), &["--node-command", &other_build(&place)]);
    ended
        .with_code(2)
        .says(&["the campaign was started by hummingbus", "install the same build here and there"]);
}

#[test]
fn what_slurm_lacks_or_refuses_is_said_in_its_words() {
    let place = Place::new();
    fs::create_dir(place.path("bin")).unwrap();
    let campaign = written(&place, "c.toml", HOVERS);
    let out = place.path("out");
    let args = ["campaign", &campaign, "--out", &out, "--engine", "slurm"];
    let ended = place.start_with(&args, &[("PATH", &place.path("bin"))]).end().with_code(2);
    ended.says(&[
        "cannot start sbatch, a command of Slurm",
        "without --engine the flights are flown on this machine",
    ]);

    fs::remove_dir(place.path("bin")).unwrap();
    stand_in(&place, "");
    let ended = on_slurm(&place, &out, &["--sbatch=--partition=nowhere"]).with_code(2);
    ended.says(&["sbatch refuses the job array", "invalid partition specified: nowhere", "--partition=NAME"]);
    // Nothing of it is in the way of the next call.
    on_slurm(&place, &out, &[]).with_code(0).prints(&["12 of 12 flights passed"]);

    let ended = on_slurm(&place, &out, &["--sbatch=--array=0-1"]).with_code(2);
    ended.says(&["--sbatch=--array=0-1 cannot be given", "--chunk"]);
    for (option, value) in [("--chunk", "5"), ("--sbatch", "-Q"), ("--node-command", "x")] {
        let args = ["campaign", &campaign, "--out", &out, option, value];
        place.call(&args).with_code(2).says(&[&format!("{option} needs --engine slurm")]);
    }
    let args = ["campaign", "--task-of", &out];
    place.call(&args).with_code(2).says(&["expected SLURM_ARRAY_TASK_ID, which Slurm sets"]);
}
