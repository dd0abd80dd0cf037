//! What a built-in node declares about itself: known before it runs, so that a manifest can be checked.

use crate::error::BusError;
use crate::schema::Schema;
use serde::de::DeserializeOwned;
use std::cell::RefCell;

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

/// What a kind has to know of a run to check its parameters for it, and where it leaves its warnings.
#[derive(Clone, Debug)]
pub struct RunContext<'a> {
    /// The wired inputs and the outputs that the manifest names.
    pub ports: &'a [&'a str],
    /// Nanoseconds a tick.
    pub tick_ns: u64,
    /// Ticks between two computations of the node.
    pub period_ticks: u32,
    /// Length of the run.
    pub duration_ticks: u32,
    warnings: RefCell<Vec<RunWarning>>,
}

/// What is odd about a node in its run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunWarning {
    /// A parameter is named in backticks, as in an error.
    pub words: String,
    /// Whether it is odd only because the run ends so early.
    pub is_behind_end: bool,
}

impl<'a> RunContext<'a> {
    /// A node with these `ports` that computes at 1 kHz, in a run that lasts an hour.
    #[must_use]
    pub fn of_ports(ports: &'a [&'a str]) -> Self {
        Self::new(ports, 1_000_000, 1, 3_600_000)
    }

    /// A node that computes every `period_ticks` ticks of `tick_ns`, in a run of `duration_ticks`.
    #[must_use]
    pub fn new(ports: &'a [&'a str], tick_ns: u64, period_ticks: u32, duration_ticks: u32) -> Self {
        Self { ports, tick_ns, period_ticks, duration_ticks, warnings: RefCell::default() }
    }

    /// Whether an input is wired, or an output named.
    #[must_use]
    pub fn has(&self, port: &str) -> bool {
        self.ports.contains(&port)
    }

    /// Simulated time of a tick, in seconds.
    #[must_use]
    pub fn tick_s(&self) -> f64 {
        self.tick_ns as f64 * 1e-9
    }

    /// Simulated time between two computations of the node, in seconds; as `Node::period_s`.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        f64::from(self.period_ticks) * self.tick_s()
    }

    /// Simulated length of the run, in seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        f64::from(self.duration_ticks) * self.tick_s()
    }

    /// Ticks per simulated second; as `Node::rate_hz`.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "a tick is at least a nanosecond")]
    pub fn rate_hz(&self) -> u32 {
        (1_000_000_000 / self.tick_ns.max(1)) as u32
    }

    /// Leaves a warning: what is odd and flies all the same. A parameter is named in backticks, as in an error.
    pub fn warn(&self, words: impl Into<String>) {
        self.warnings.borrow_mut().push(RunWarning { words: words.into(), is_behind_end: false });
    }

    /// Leaves a warning of what a longer run would come to.
    pub fn warn_behind_end(&self, words: impl Into<String>) {
        self.warnings.borrow_mut().push(RunWarning { words: words.into(), is_behind_end: true });
    }

    /// The warnings left so far.
    #[must_use]
    pub fn into_warnings(self) -> Vec<RunWarning> {
        self.warnings.into_inner()
    }
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
    /// Checks the parameters and the files they name for the run, without running.
    pub check: fn(&serde_json::Value, &RunContext<'_>) -> Result<(), String>,
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
