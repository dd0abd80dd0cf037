//! Faults struck at real runs, and what is promised after each: `docs/faults.md` is the list.
//!
//! - [`support`]: a folder of its own for each test, launches under a watchdog, what a run left behind
//! - [`flight`]: the run that the faults strike, and its undisturbed recording
//! - [`saboteur`]: a node that fails from the inside when it is told to
//! - [`kill_points`]: hundreds of seeded strikes over processes, ticks and signals
//! - [`silence`]: processes that neither end nor go on
//! - [`slow`]: steps that take too long
//! - [`disk`]: a full disk under the recorder
//! - [`intruders`]: a second clock, a second process of a node
//! - [`users`]: another user of the machine
//! - [`bad_files`]: corrupted manifests, truncated recordings
//! - [`documentation`]: the list names tests that there are

mod bad_files;
mod disk;
mod documentation;
mod flight;
mod intruders;
mod kill_points;
mod saboteur;
mod silence;
mod slow;
#[allow(dead_code, reason = "shared with the tests of undisturbed runs, which use the rest")]
#[path = "../runs/support.rs"]
mod support;
mod users;
