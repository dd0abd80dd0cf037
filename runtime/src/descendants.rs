//! What the processes of a run started themselves: it dies with the run.
//!
//! The launcher makes itself their reaper (PR_SET_CHILD_SUBREAPER): whatever loses its parent becomes the launcher's
//! child, however it was detached. So the launcher has only to end its children until there are none left.

use crate::process_table::{children, run_dir_of};
use crate::run_dir::run_of_dir;
use crate::watch_clock::WatchClock;
use bus::host_time::monotonic_ns;
use rustix::process::{
    Pid, Signal, WaitOptions, child_subreaper, kill_process, set_child_subreaper, waitpid,
};
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

    /// Whether a child was left by this run. Where the launcher had children before, those may leave some too: then
    /// only a process that carries this run in its environment is.
    fn is_of_this_run(&self, child: Pid) -> bool {
        match run_dir_of(child) {
            Some(run_dir) => !self.is_of_another_run(&run_dir),
            None => self.before.is_empty(),
        }
    }

    /// Takes note of children that have ended, but for those in `known`, which are waited for elsewhere.
    pub fn reap(&self, known: &[u32]) {
        let is_known = |child: &Pid| known.contains(&child.as_raw_nonzero().get().cast_unsigned());
        for child in self.left().into_iter().filter(|child| !is_known(child)) {
            let _ = waitpid(Some(child), WaitOptions::NOHANG);
        }
    }

    /// Whether `run_dir` is that of another run of this very process.
    fn is_of_another_run(&self, run_dir: &Path) -> bool {
        let run = run_dir.file_name().and_then(|name| name.to_str()).and_then(run_of_dir);
        let launcher = run.and_then(|run| run.split_once('-')).map(|(launcher, _)| launcher);
        run_dir != self.run_dir && launcher == Some(format!("{:x}", std::process::id()).as_str())
    }

    /// The children of this process that came with the run, and are not of another run of this process.
    fn left(&self) -> Vec<Pid> {
        let came = children().into_iter().filter(|child| !self.before.contains(child));
        came.filter(|&child| self.is_of_this_run(child)).collect()
    }
}

impl Drop for Descendants {
    fn drop(&mut self) {
        let now = || Duration::from_nanos(monotonic_ns());
        let mut clock = WatchClock::new(now());
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
            clock.look(now());
        }
        if !self.was_reaper {
            let _ = set_child_subreaper(None);
        }
    }
}
