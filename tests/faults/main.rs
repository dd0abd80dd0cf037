//! Faults struck at real runs, and what is promised after each: `docs/faults.md` is the list.
//!
//! - [`support`]: a folder of its own for each test, launches under a watchdog, what a run left behind
//! - [`flight`]: the run that the faults strike, and its undisturbed recording
//! - [`saboteur`]: a node that fails from the inside when it is told to
//! - [`campaign`]: many seeded cases, each of which can be repeated
//! - [`kill_points`]: seeded strikes over processes, ticks and signals, where the run is to stop
//! - [`survival`]: the same where the process is restarted or has a standby
//! - [`groups`]: the process of a group dies, and others go on in the places of its members
//! - [`backups`]: backups that fail before they fly, and strikes at whoever else is there meanwhile
//! - [`last_tick`]: processes that die behind their last tick
//! - [`silence`]: processes that neither end nor go on
//! - [`sidecars`]: sidecars that fail or are not ready
//! - [`strays`]: what the nodes of a run started themselves
//! - [`floods`]: too much output, and nowhere to write
//! - [`skipped`]: tests that cannot run here, and cases that are left to `scripts/dev thorough`
//! - [`slow`]: steps that take too long
//! - [`early`]: runs that are stopped while they start
//! - [`disk`]: a full disk under the recorder
//! - [`memory`]: a full /dev/shm, limits on the size of files
//! - [`folders`]: folders for temporary files of every kind
//! - [`intruders`]: a second clock, a second process of a node
//! - [`users`]: another user of the machine
//! - [`bad_files`]: corrupted manifests, truncated recordings
//! - [`documentation`]: the list names tests that there are

mod backups;
mod bad_files;
mod campaign;
mod disk;
mod documentation;
mod early;
mod flight;
mod floods;
mod folders;
mod groups;
mod intruders;
mod kill_points;
mod last_tick;
mod memory;
mod saboteur;
mod sidecars;
mod silence;
#[path = "../runs/skipped.rs"]
mod skipped;
mod slow;
mod strays;
#[allow(dead_code, reason = "shared with the tests of undisturbed runs, which use the rest")]
#[path = "../runs/support.rs"]
mod support;
mod survival;
mod users;
