//! Processes started by the processes of a run: they are ended with the run.
//!
//! The launcher makes itself their reaper (PR_SET_CHILD_SUBREAPER): every process that loses its parent becomes the
//! launcher's child, however it was detached. So the launcher only has to end its children until there are none left.

use crate::process_table::{children, run_dir_of};
use crate::watch_clock::WatchClock;
use anyhow::{Result, bail};
use bus::host_time::monotonic_ns;
use rustix::process::{
    Pid, Signal, WaitOptions, child_subreaper, kill_process, set_child_subreaper, waitpid,
};
use std::sync::{RwLock, RwLockReadGuard, RwLockWriteGuard, TryLockError};
use std::time::Duration;

/// Time that a process has to end when it is asked to, and then again after it was killed.
const GRACE: Duration = Duration::from_secs(1);
const POLL: Duration = Duration::from_millis(2);
/// A look goes through the processes one after another. A process whose parent ends meanwhile is missed, and only the
/// next look finds it. So many looks in a row without a find are believed.
const EMPTY_LOOKS: u32 = 2;

/// The place of a run among those of its process. An orphan does not say to which run it belongs, so a run that
/// adopts orphans flies alone.
#[derive(Debug)]
pub struct Place {
    _alone: Option<RwLockWriteGuard<'static, ()>>,
    _beside: Option<RwLockReadGuard<'static, ()>>,
}

impl Place {
    /// Takes a place, alone for a run that adopts orphans.
    ///
    /// # Errors
    /// If the runs that fly leave none.
    pub fn take(adopts_orphans: bool) -> Result<Self> {
        static RUNS: RwLock<()> = RwLock::new(());
        let alone = adopts_orphans.then(|| settled(RUNS.try_write())).flatten();
        let beside = (!adopts_orphans).then(|| settled(RUNS.try_read())).flatten();
        if alone.is_none() && beside.is_none() {
            bail!(
                "a run that adopts orphans (Launcher::adopting_orphans) has to be the only one of its process, which \
                 could not tell whose an orphan is: fly the runs one after another, or without adopting orphans"
            );
        }
        Ok(Self { _alone: alone, _beside: beside })
    }
}

/// The guard of a lock, also if a run panicked while it held the lock: no operation can be left half done.
fn settled<G>(attempt: Result<G, TryLockError<G>>) -> Option<G> {
    match attempt {
        Ok(guard) => Some(guard),
        Err(TryLockError::Poisoned(guard)) => Some(guard.into_inner()),
        Err(TryLockError::WouldBlock) => None,
    }
}

/// The descendants of a run's processes; dropping it ends those that still live. To be dropped when the processes of
/// the run have ended.
#[derive(Debug)]
pub struct Descendants {
    /// Children that this process had before the run.
    before: Vec<Pid>,
    was_reaper: bool,
}

impl Descendants {
    /// Makes this process the parent of the orphans of its run.
    pub fn of_run(_: &Place) -> Self {
        let was_reaper = child_subreaper().is_ok_and(|reaper| reaper.is_some());
        // A system that has the option does not refuse it. On one that has not, only the processes' own groups are
        // killed.
        let _ = set_child_subreaper(Some(rustix::process::getpid()));
        Self { before: children(), was_reaper }
    }

    /// True if `child` was left by this run. If the launcher had children before, those may leave some too. Then only
    /// a process that carries this run in its environment counts.
    fn is_of_this_run(&self, child: Pid) -> bool {
        self.before.is_empty() || run_dir_of(child).is_some()
    }

    /// Takes note of children that have ended, but for those in `known`, which are waited for elsewhere.
    pub fn reap(&self, known: &[u32]) {
        let is_known = |child: &Pid| known.contains(&child.as_raw_nonzero().get().cast_unsigned());
        for child in self.left().into_iter().filter(|child| !is_known(child)) {
            let _ = waitpid(Some(child), WaitOptions::NOHANG);
        }
    }

    /// The children of this process that came with the run.
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
        let mut empty_looks = 0;
        // Each that ends may leave children of its own, which are this process's then.
        while clock.now() < 2 * GRACE {
            let left = self.left();
            empty_looks = if left.is_empty() { empty_looks + 1 } else { 0 };
            if empty_looks == EMPTY_LOOKS {
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

#[cfg(test)]
mod tests {
    use super::Place;

    #[test]
    fn a_run_that_adopts_orphans_is_the_only_one_of_its_process() {
        let refused = |adopts| Place::take(adopts).unwrap_err().to_string();
        let (first, second) = (Place::take(false).unwrap(), Place::take(false).unwrap());
        assert!(refused(true).contains("the only one of its process"));
        drop((first, second));
        let alone = Place::take(true).unwrap();
        assert!(refused(true) == refused(false) && refused(false).contains("one after another"));
        drop(alone);
        let panicked = std::panic::catch_unwind(|| {
            let _alone = Place::take(true).unwrap();
            panic!("amid a run");
        });
        assert!(panicked.is_err() && Place::take(false).is_ok() && Place::take(true).is_ok());
    }
}
