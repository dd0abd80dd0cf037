//! Names of the files and processes of a run.

use std::path::{Path, PathBuf};

/// Folder of shared memory.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// Prefix of the name of every shared-memory file of run `run_id`.
#[must_use]
pub fn shm_prefix(run_id: &str) -> String {
    format!("hb_{run_id}_")
}

/// The shared-memory file `name` of run `run_id`.
pub(crate) fn shm_path(run_id: &str, name: &str) -> PathBuf {
    Path::new(SHARED_MEMORY).join(shm_prefix(run_id) + name)
}

/// Name of the process of generation `generation` of node `node`.
#[must_use]
pub fn process_name(node: &str, generation: u32) -> String {
    if generation == 0 { node.to_owned() } else { format!("{node}.{generation}") }
}
