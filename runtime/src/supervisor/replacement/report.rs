//! Reports about the backups of a run.

use bus::plan::InputPlan;
use serde::Serialize;

/// Purpose of a process that joins a run in flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Purpose {
    /// It shadows the primary for a while, then takes over.
    Swap,
    /// It shadows the primary, and takes over when that dies.
    Standby,
    /// It shadows the primary and never takes over.
    Shadow,
    /// It takes the place of a process that died.
    Restart,
}

/// Report about a backup.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The node.
    pub process: String,
    /// Number of the process among those of the node; the first is 0.
    pub generation: u32,
    /// Purpose of the backup.
    pub purpose: Purpose,
    /// True if the manifest or a request names it; false for a restart and the next standby.
    pub is_planned: bool,
    /// The request for it.
    #[serde(skip)]
    pub request: Option<u32>,
    /// The first tick it computed.
    pub join_tick: Option<u32>,
    /// The first tick whose outputs were its own.
    pub take_over_tick: Option<u32>,
    /// Origin of its state: `state` or `last output`.
    pub hand_over: Option<&'static str>,
    /// Host time from the start of its process until it was prepared to join, in milliseconds.
    pub start_ms: f64,
    /// Host time for which the clock held the tick, in milliseconds.
    pub hold_ms: f64,
    /// Reason why it did not fly, if it was to.
    pub refused: Option<String>,
    /// Its inputs, for a profile of the run.
    #[serde(skip)]
    pub inputs: Vec<InputPlan>,
}
