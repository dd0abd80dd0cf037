//! What a built-in node declares about itself: known before it runs, so that a manifest can be checked.

use crate::error::BusError;
use crate::schema::Schema;
use serde::de::DeserializeOwned;

/// A port of a built-in node.
#[derive(Clone, Copy, Debug)]
pub struct PortSpec {
    /// Name in the node.
    pub name: &'static str,
    /// Message type.
    pub schema: &'static Schema,
    /// Whether the node works without it.
    pub required: bool,
}

impl PortSpec {
    /// A port that must be wired.
    #[must_use]
    pub const fn required(name: &'static str, schema: &'static Schema) -> Self {
        Self { name, schema, required: true }
    }

    /// A port that may be left out; an optional output exists only where the manifest names it.
    #[must_use]
    pub const fn optional(name: &'static str, schema: &'static Schema) -> Self {
        Self { name, schema, required: false }
    }
}

/// Which inputs a kind of node has.
#[derive(Clone, Copy, Debug)]
pub enum Inputs {
    /// These.
    Ports(&'static [PortSpec]),
    /// One or more of this message, under names that the manifest chooses.
    Many(&'static Schema),
    /// Any topics; all of the run where the manifest names none.
    Any,
}

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
    /// Checks the parameters and the files they name, without running; the words are the wired inputs
    /// and the outputs that the manifest names.
    pub check: fn(&serde_json::Value, &[&str]) -> Result<(), String>,
    /// Runs the node in this process.
    pub run: fn() -> Result<(), BusError>,
}

/// Reads the parameters of a kind; the error names the key.
///
/// # Errors
/// What does not fit `P`.
pub fn read_parameters<P: DeserializeOwned>(parameters: &serde_json::Value) -> Result<P, String> {
    serde_path_to_error::deserialize(parameters).map_err(|error| {
        let (path, words) = (error.path().to_string(), error.inner().to_string());
        // An unknown or missing key is named by the words already.
        if path == "." || words.contains("field `") { words } else { format!("`{path}`: {words}") }
    })
}
