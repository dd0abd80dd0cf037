//! Description of a node's ports, which a check of the manifest reads.
//!
//! If [`DESCRIBE_VARIABLE`] is set, a node stores its description in the run directory instead of connecting. It has read its
//! parameters and files as in a run.

use crate::announcement::Announcement;
use crate::error::BusError;
use crate::json_file;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The environment variable that asks a node for its description.
pub const DESCRIBE_VARIABLE: &str = "HUMMINGBUS_DESCRIBE";

/// Ports of a node in the order of the plan, as its program declares them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Description {
    /// Messages of the inputs; absent where the program takes any.
    pub inputs: Vec<Option<Announcement>>,
    /// Messages of the outputs.
    pub outputs: Vec<Announcement>,
}

impl Description {
    /// Reads the description of generation `generation` of node `node`; `None` if it has written none.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn load(run_dir: &Path, node: usize, generation: u32) -> Result<Option<Self>, BusError> {
        let path = path(run_dir, node, generation);
        if !path.exists() {
            return Ok(None);
        }
        json_file::load(&path, "the description of a node").map(Some)
    }

    pub(crate) fn store(&self, run_dir: &Path, node: usize, generation: u32) -> Result<(), BusError> {
        json_file::store(&path(run_dir, node, generation), self)
    }
}

/// True if this process is to describe its node instead of flying it.
pub(crate) fn is_asked_for() -> bool {
    std::env::var_os(DESCRIBE_VARIABLE).is_some()
}

fn path(run_dir: &Path, node: usize, generation: u32) -> PathBuf {
    run_dir.join(format!("description-{node}.{generation}.json"))
}
