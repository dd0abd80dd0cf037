//! Which part of which run a process or thread takes.

use std::path::PathBuf;

/// The environment variable that names the node to itself.
pub const NODE_VARIABLE: &str = "HUMMINGBUS_NODE";

/// The environment variable that counts the processes of a node: 0 for the first, backups count up.
pub const GENERATION_VARIABLE: &str = "HUMMINGBUS_GENERATION";

/// Which part of which run a process or thread takes.
#[derive(Clone, Debug)]
pub struct Join {
    /// The run directory.
    pub run_dir: PathBuf,
    /// The node's name.
    pub node: String,
    /// Which instance of the node it is: 0 for the first, those that replace it count up.
    pub generation: u32,
}
