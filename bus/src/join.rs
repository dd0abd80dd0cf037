//! The part that a process or thread takes in a run.

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
    /// The node's name.
    pub node: String,
    /// Number of its instance of the node: 0 for the first; replacements count up.
    pub generation: u32,
}
