//! The command `node`, with which a launcher starts the processes of its run.

use crate::COMPONENTS;
use anyhow::{Context, Result, bail};
use bus::BusError;
use clap::Args;

/// What `node` takes.
#[derive(Args)]
pub struct NodeArguments {
    /// The kind of node.
    kind: String,
}

/// Runs a process of a run; what it says goes to the launcher's log.
///
/// # Errors
/// If there is no such component, or what it says.
pub fn node(NodeArguments { kind }: &NodeArguments) -> Result<bool> {
    let result = if kind == "clock" {
        bus::clock::run()
    } else {
        let kind = COMPONENTS
            .find(kind)
            .with_context(|| format!("no kind `{kind}`; there are {}", COMPONENTS.names()))?;
        bus::Join::from_environment().and_then(|join| kind.run(join))
    };
    match result {
        // The launcher ended the run and knows why.
        Ok(()) | Err(BusError::Aborted) => Ok(true),
        Err(error) => bail!(error),
    }
}
