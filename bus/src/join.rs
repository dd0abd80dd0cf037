//! The part that a process or thread takes in a run.

use crate::error::BusError;
use crate::place::Place;
use crate::process::{RUN_VARIABLE, join_run};
use std::path::PathBuf;

/// The environment variable that names the node to itself.
pub const NODE_VARIABLE: &str = "HUMMINGBUS_NODE";

/// The environment variable that counts the processes of a node: 0 for the first, backups count up.
pub const GENERATION_VARIABLE: &str = "HUMMINGBUS_GENERATION";

/// The part that a process or thread takes in a run.
#[derive(Clone, Debug)]
pub struct Join {
    /// The run directory.
    pub run_dir: PathBuf,
    /// The node's name, or the group's; the clock service has a name that no node has.
    pub node: String,
    /// Number of its instance of the node: 0 for the first; replacements count up.
    pub generation: u32,
    /// Place of its computation.
    pub place: Place,
}

impl Join {
    /// The part that the launcher gave this process, which from now on dies with its launcher.
    ///
    /// # Errors
    /// If the process was not started by a launcher.
    pub fn from_environment() -> Result<Self, BusError> {
        Self::named_by(NODE_VARIABLE)
    }

    /// As [`Join::from_environment`], where `variable` has the name.
    pub(crate) fn named_by(variable: &'static str) -> Result<Self, BusError> {
        let run_dir = run_dir()?;
        let node = std::env::var(variable).map_err(|_| BusError::NotInARun { variable })?;
        let generation = std::env::var(GENERATION_VARIABLE).ok().and_then(|text| text.parse().ok());
        Ok(Self { run_dir, node, generation: generation.unwrap_or(0), place: Place::Process })
    }

    /// The part of the clock service, which the launcher gave this process.
    ///
    /// # Errors
    /// If the process was not started by a launcher.
    pub fn clock_from_environment() -> Result<Self, BusError> {
        Ok(Self { run_dir: run_dir()?, node: "clock".to_owned(), generation: 0, place: Place::Process })
    }
}

/// The directory of the run that started this process, with which the process from now on dies.
///
/// # Errors
/// If it was not started by a launcher.
fn run_dir() -> Result<PathBuf, BusError> {
    let run_dir = std::env::var_os(RUN_VARIABLE).ok_or(BusError::NotInARun { variable: RUN_VARIABLE })?;
    join_run();
    Ok(PathBuf::from(run_dir))
}
