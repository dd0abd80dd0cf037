//! Slurm's commands: `sbatch` submits a job array, `squeue` reports the states of its tasks, `scancel` cancels it.

use anyhow::{Context, Result, bail};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};

/// A job array to submit.
#[derive(Debug)]
pub struct Submission<'a> {
    /// Script that each task runs.
    pub script: &'a Path,
    /// Folder of the tasks' logs: `log-TASK-ARRAY.txt`.
    pub logs: &'a Path,
    /// Numbers of the tasks, in rising order.
    pub tasks: &'a [usize],
    /// Processors of a task.
    pub processors: usize,
    /// Options of the user, handed to `sbatch` as they are.
    pub options: &'a [String],
}

/// State of a task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TaskState {
    /// It waits, runs, or ends now.
    Alive,
    /// A person cancelled it.
    Cancelled,
    /// It has ended; Slurm's word for the reason, such as `NODE_FAIL`.
    Ended(String),
}

/// States of the tasks that Slurm knows, by number of the array and of the task.
pub type States = BTreeMap<(String, usize), TaskState>;

/// Submits a job array; returns its number.
///
/// # Errors
/// If there is no `sbatch`, or it refuses the array; the message has its words.
pub fn submit(submission: &Submission<'_>) -> Result<String> {
    let mut command = Command::new("sbatch");
    // Ours stand behind the user's: the last one counts. Variables would undo what is refused as an option.
    command
        .env_remove("SBATCH_CLUSTERS")
        .env_remove("SBATCH_WAIT")
        .arg("--job-name=hummingbus")
        .args(submission.options)
        .args(["--parsable", "--requeue", "--open-mode=append"])
        .arg(format!("--array={}", ranges(submission.tasks)))
        .arg(format!("--cpus-per-task={}", submission.processors))
        .arg(format!("--output={}", submission.logs.join("log-%a-%A.txt").display()))
        .arg(submission.script);
    let output = called(&mut command)?;
    if !output.status.success() {
        bail!(
            "sbatch refuses the job array: {}; --sbatch hands it options such as --partition=NAME, and --chunk sets the flights \
             of a task",
            said(&output)
        );
    }
    let text = String::from_utf8_lossy(&output.stdout);
    // NUMBER or NUMBER;CLUSTER.
    let number = text.trim().lines().last().and_then(|line| line.split(';').next()).unwrap_or("");
    if number.is_empty() || !number.bytes().all(|byte| byte.is_ascii_digit()) {
        bail!("expected the number of a job array from sbatch --parsable, found {:?}", text.trim());
    }
    Ok(number.to_owned())
}

/// Number that stands for the tasks of an array that had not begun when it was cancelled.
const REST: usize = usize::MAX;

/// The state of a task of an array; `None` if Slurm does not know it.
pub fn state_in<'s>(states: &'s States, array: &str, task: usize) -> Option<&'s TaskState> {
    let of = |task: usize| states.get(&(array.to_owned(), task));
    of(task).or_else(|| of(REST))
}

/// States of the tasks of `arrays`. Slurm forgets a task some minutes after its end; it has no state then.
///
/// # Errors
/// If there is no `squeue`, or the controller does not answer.
pub fn states(arrays: &[String]) -> Result<States> {
    let mut command = Command::new("squeue");
    command.args(["--noheader", "--array", "--states=all", "--format=%F %K %T"]);
    command.arg(format!("--jobs={}", arrays.join(",")));
    let output = called(&mut command)?;
    if output.status.success() {
        return Ok(parsed(&String::from_utf8_lossy(&output.stdout)));
    }
    let why = said(&output);
    // It has forgotten them all.
    if why.contains("Invalid job id") { Ok(States::new()) } else { bail!("squeue: {why}") }
}

/// Cancels `arrays`, one after another: one that Slurm has forgotten must not hide that another one flies on.
///
/// # Errors
/// If there is no `scancel`, or it fails.
pub fn cancel(arrays: &[String]) -> Result<()> {
    let mut failed = None;
    for array in arrays {
        let output = called(Command::new("scancel").arg(array))?;
        // One that has ended is as good as cancelled.
        if !output.status.success() && !said(&output).contains("Invalid job id") {
            failed = failed.or(Some(format!("scancel {array}: {}", said(&output))));
        }
    }
    failed.map_or(Ok(()), |failed| bail!("{failed}"))
}

fn called(command: &mut Command) -> Result<Output> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command.stdin(std::process::Stdio::null()).output();
    output.with_context(|| {
        format!(
            "cannot start {program}, a command of Slurm; --engine slurm runs on a host that may submit jobs, and without \
             --engine the flights are flown on this machine"
        )
    })
}

/// Standard error of a command that failed, or its exit code where it said nothing.
fn said(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr);
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    if lines.is_empty() { output.status.to_string() } else { lines.join("; ") }
}

/// Task numbers as `sbatch --array` takes them: `0-4,7`.
fn ranges(tasks: &[usize]) -> String {
    let mut ranges: Vec<(usize, usize)> = Vec::new();
    for &task in tasks {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == task => *last = task,
            _ => ranges.push((task, task)),
        }
    }
    let text = |&(first, last): &(usize, usize)| {
        if first == last { first.to_string() } else { format!("{first}-{last}") }
    };
    ranges.iter().map(text).collect::<Vec<_>>().join(",")
}

/// Lines of `ARRAY TASK STATE`; others, such as jobs without tasks, are left out. One that is cancelled may stand for all tasks of an array that had not
/// begun: [`REST`].
fn parsed(text: &str) -> States {
    let line = |line: &str| {
        let mut words = line.split_whitespace();
        let (array, task, state) = (words.next()?, words.next()?, state_of(words.next()?));
        let task = match task.parse() {
            Ok(task) => task,
            Err(_) if state == TaskState::Cancelled => REST,
            Err(_) => return None,
        };
        Some(((array.to_owned(), task), state))
    };
    text.lines().filter_map(line).collect()
}

fn state_of(word: &str) -> TaskState {
    match word {
        "CANCELLED" => TaskState::Cancelled,
        "COMPLETED" | "FAILED" | "TIMEOUT" | "NODE_FAIL" | "OUT_OF_MEMORY" | "PREEMPTED" | "BOOT_FAIL"
        | "DEADLINE" | "REVOKED" => TaskState::Ended(word.to_owned()),
        // PENDING, RUNNING, COMPLETING, CONFIGURING, REQUEUED, SUSPENDED and their like.
        _ => TaskState::Alive,
    }
}

#[cfg(test)]
mod tests {
    use super::{TaskState, parsed, ranges, state_in};

    #[test]
    fn task_numbers_are_written_as_ranges() {
        assert_eq!(ranges(&[0, 1, 2, 5, 7, 8]), "0-2,5,7-8");
        assert_eq!(ranges(&[3]), "3");
    }

    #[test]
    fn states_are_read_by_array_and_task() {
        // As squeue 22.05 prints them: a job without tasks among them.
        let states = parsed(
            "1 N/A COMPLETED\n2 2 PENDING\n2 0 NODE_FAIL\n2 1 CANCELLED\n3 0 COMPLETING\n2 3 OUT_OF_MEMORY\n",
        );
        let state = |array: &str, task| states.get(&(array.to_owned(), task)).cloned();
        assert_eq!(states.len(), 5);
        assert_eq!(state("2", 2), Some(TaskState::Alive));
        assert_eq!(state("3", 0), Some(TaskState::Alive));
        assert_eq!(state("2", 0), Some(TaskState::Ended("NODE_FAIL".to_owned())));
        assert_eq!(state("2", 1), Some(TaskState::Cancelled));
        assert_eq!(state("2", 4), None);
    }

    #[test]
    fn tasks_that_had_not_begun_are_cancelled_together() {
        // As squeue 22.05 prints an array of which four tasks were pending when it was cancelled.
        let states = parsed("1 N/A CANCELLED\n1 0 COMPLETED\n1 1 COMPLETED\n");
        assert_eq!(state_in(&states, "1", 0), Some(&TaskState::Ended("COMPLETED".to_owned())));
        assert_eq!(state_in(&states, "1", 3), Some(&TaskState::Cancelled));
        assert_eq!(state_in(&states, "2", 3), None);
    }
}
