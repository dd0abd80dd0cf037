//! What the processes of a run started themselves: it dies with the run.
//!
//! The launcher makes itself their reaper (PR_SET_CHILD_SUBREAPER): whatever loses its parent becomes the launcher's
//! child, however it was detached. So the launcher has only to end its children until there are none left.

use crate::watch_clock::WatchClock;
use bus::process::RUN_VARIABLE;
use rustix::process::{
    Pid, Signal, WaitOptions, child_subreaper, kill_process, set_child_subreaper, waitpid,
};
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long a process may take to end when it is asked to, and then to be gone once it was killed.
const GRACE: Duration = Duration::from_secs(1);
const POLL: Duration = Duration::from_millis(2);

/// The descendants of a run's processes; dropping it ends those that still live. To be dropped when the processes of
/// the run have ended.
#[derive(Debug)]
pub struct Descendants {
    run_dir: PathBuf,
    /// Children that this process had before the run.
    before: Vec<Pid>,
    was_reaper: bool,
}

impl Descendants {
    /// Has this process inherit what the processes of the run in `run_dir` leave behind.
    pub fn of_run(run_dir: &Path) -> Self {
        let was_reaper = child_subreaper().is_ok_and(|reaper| reaper.is_some());
        // Refused by no system that has it; one that has not leaves the processes' own groups to be killed.
        let _ = set_child_subreaper(Some(rustix::process::getpid()));
        Self { run_dir: run_dir.to_owned(), before: children(), was_reaper }
    }

    /// The children of this process that came with the run, and are not of another run of this process.
    fn left(&self) -> Vec<Pid> {
        let came = children().into_iter().filter(|child| !self.before.contains(child));
        came.filter(|&child| run_dir_of(child).is_none_or(|run_dir| run_dir == self.run_dir)).collect()
    }
}

impl Drop for Descendants {
    fn drop(&mut self) {
        let clock = WatchClock::new();
        let mut asked: Vec<Pid> = Vec::new();
        // Each that ends may leave children of its own, which are this process's then.
        while clock.now() < 2 * GRACE {
            let left = self.left();
            if left.is_empty() {
                break;
            }
            for child in left {
                let has_ended = waitpid(Some(child), WaitOptions::NOHANG).is_ok_and(|end| end.is_some());
                if !has_ended && clock.now() >= GRACE {
                    let _ = kill_process(child, Signal::KILL);
                } else if !has_ended && !asked.contains(&child) {
                    asked.push(child);
                    let _ = kill_process(child, Signal::TERM);
                    // One that is stopped hears nothing.
                    let _ = kill_process(child, Signal::CONT);
                }
            }
            std::thread::sleep(POLL);
            clock.look();
        }
        if !self.was_reaper {
            let _ = set_child_subreaper(None);
        }
    }
}

/// The children of this process.
fn children() -> Vec<Pid> {
    let own = rustix::process::getpid();
    let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let processes =
        entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok().and_then(Pid::from_raw));
    processes.filter(|&process| parent_of(process) == Some(own)).collect()
}

/// The parent of a process; `None` for one that is gone.
fn parent_of(process: Pid) -> Option<Pid> {
    let stat = std::fs::read(format!("/proc/{process}/stat")).ok()?;
    // The name stands in brackets and may hold anything; behind it come the state and the parent (proc_pid_stat(5)).
    let behind = stat.iter().rposition(|&byte| byte == b')')? + 1;
    let mut fields = stat[behind..].split(u8::is_ascii_whitespace).filter(|field| !field.is_empty());
    std::str::from_utf8(fields.nth(1)?).ok()?.parse().ok().and_then(Pid::from_raw)
}

/// The run directory in the environment of a process; `None` for one that has ended or has none.
fn run_dir_of(process: Pid) -> Option<PathBuf> {
    let environment = std::fs::read(format!("/proc/{process}/environ")).ok()?;
    let mut variables = environment.split(|&byte| byte == 0);
    let value = variables.find_map(|variable| {
        variable.strip_prefix(RUN_VARIABLE.as_bytes()).and_then(|rest| rest.strip_prefix(b"="))
    })?;
    Some(PathBuf::from(OsStr::from_bytes(value)))
}
