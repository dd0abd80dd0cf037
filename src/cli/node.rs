//! The command `node`, with which a launcher starts the processes of its run.

use anyhow::Result;
use clap::Args;
use hummingbus::COMPONENTS;

/// Arguments of `node`.
#[derive(Args)]
pub struct NodeArguments {
    /// The kind of node.
    kind: String,
}

/// Runs a process of a run; its output goes to the launcher's log.
///
/// # Errors
/// If there is no such component, or the component's own error.
pub fn node(NodeArguments { kind }: &NodeArguments) -> Result<bool> {
    runtime::node(kind, COMPONENTS)?;
    Ok(true)
}
