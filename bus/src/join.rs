//! The part that a process or thread takes in a run.

use std::path::PathBuf;

use crate::place::Place;

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
    /// Where it runs.
    pub place: Place,
}
