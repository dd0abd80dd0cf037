//! What a built-in node declares about itself: known before it runs, so that a manifest can be checked.

use crate::context::NodeContext;
use crate::error::BusError;
use diagnostics::ParameterError;

pub use crate::ports::{Inputs, PortSpec};

/// A kind of built-in node.
#[derive(Clone, Copy, Debug)]
pub struct NodeKind {
    /// Name in manifests.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// Inputs.
    pub inputs: Inputs,
    /// Outputs.
    pub outputs: &'static [PortSpec],
    /// Checks the parameters and the files they name for the run, without running.
    pub check: fn(&serde_json::Value, &NodeContext<'_>) -> Result<(), ParameterError>,
    /// Runs the node in this process.
    pub run: fn() -> Result<(), BusError>,
}
