//! What the files and processes of a run are called.

use std::path::{Path, PathBuf};

/// Where shared memory lies.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// What the name of every shared-memory file of run `run_id` starts with.
#[must_use]
pub fn shm_prefix(run_id: &str) -> String {
    format!("hb_{run_id}_")
}

/// The shared-memory file `name` of run `run_id`.
pub(crate) fn shm_path(run_id: &str, name: &str) -> PathBuf {
    Path::new(SHARED_MEMORY).join(shm_prefix(run_id) + name)
}

/// What generation `generation` of node `node` is called.
#[must_use]
pub fn process_name(node: &str, generation: u32) -> String {
    if generation == 0 { node.to_owned() } else { format!("{node}.{generation}") }
}
