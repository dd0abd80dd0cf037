//! Checks manifests, and launches the runs that they describe: starts the processes, watches over them, and takes
//! everything down again.
//!
//! | subject | modules |
//! |---|---|
//! | the manifest, with the place of every value | [`manifest`] |
//! | the checked plan of a run | [`graph`], `placement`, [`registry`], `program`, `describe`, `describe_programs` |
//! | a flight of processes or threads | [`launcher`], `attachment_names`, `options`, [`event`], `outcome`, [`flight`] |
//! | its supervisor, which decides | `supervisor`, `processes`, `sidecars`, `watch_clock` |
//! | what the supervisor sees and touches | `world`, `view`, `host_world`, [`host`], `spawn`, `executed`, `imported`, `role`, `instances` |
//! | the same supervisor in simulated worlds | `simulation` |
//! | a flight on one thread | `in_process` |
//! | requests to a live run | [`ctl`], [`rewind`] |
//! | checkpoints and forks | [`checkpoint`], `checkpoint_writer`, `fork` |
//! | files at the user's paths | [`outputs`], [`output_file`], `claimed_file`, `location`, `file_lock`, `process_log` |
//! | the run directory, and remains of dead runs | [`run_dir`], [`clean`], `descendants`, `process_table`, `host_limits` |

mod attachment_names;
pub mod checkpoint;
mod checkpoint_writer;
mod claimed_file;
pub mod clean;
pub mod ctl;
mod descendants;
mod describe;
mod describe_programs;
pub mod event;
mod executed;
mod file_lock;
pub mod flight;
mod fork;
pub mod graph;
pub mod host;
mod host_limits;
mod host_world;
mod imported;
mod in_process;
mod instances;
pub mod launcher;
mod location;
pub mod manifest;
mod options;
mod outcome;
pub mod output_file;
pub mod outputs;
mod placement;
mod process_log;
mod process_table;
mod processes;
mod program;
pub mod registry;
pub mod rewind;
mod role;
pub mod run_dir;
mod sidecars;
#[cfg(test)]
mod simulation;
#[cfg(test)]
#[path = "../../tests/runs/skipped.rs"]
mod skipped;
mod spawn;
mod supervisor;
mod view;
mod watch_clock;
mod world;

pub use describe_programs::check_programs;
pub use diagnostics::{Error, Result};
pub use in_process::{fly_unrecorded, require_flyable, simulate, simulate_reading};

use anyhow::anyhow;
use bus::{BusError, Join};
use registry::Registry;

/// Is the component `name` of the run that started this process; the clock for `clock`, a group of components for `group`. A program that hands the
/// arguments `node KIND` of its command line on to this may be a [`host::Host::Exe`].
///
/// ```
/// let error = runtime::node("imu", runtime::registry::Registry::default()).unwrap_err();
/// assert!(error.to_string().starts_with("no kind `imu`"));
/// ```
///
/// # Errors
/// If there is no such component, or it fails.
pub fn node(name: &str, registry: Registry) -> Result<()> {
    let ended = match (name, registry.find(name)) {
        ("clock", _) => Join::clock_from_environment().and_then(bus::clock::run),
        ("group", None) => bus::group::run_process(registry.components()),
        (_, Some(component)) => Join::from_environment()
            .and_then(|join| bus::run_component(component, join, registry.components())),
        (_, None) if let Some(program) = registry.program(name) => (program.run)(registry.components()),
        (_, None) => return Err(anyhow!("no kind `{name}`; there are {}", registry.names()).into()),
    };
    match ended {
        // The launcher ended the run and knows why.
        Ok(()) | Err(BusError::Aborted) => Ok(()),
        Err(error) => Err(error.into()),
    }
}
