//! The figures of a profiled run.

use super::age::{Age, Measured, ages};
use super::latency::{NodeLatency, Transport, latencies};
use super::pacing::Pacing;
use super::path::CriticalPath;
use runtime::flight::Flight;
use serde::Serialize;
use std::path::Path;

/// Host time of a run, part by part; its text is a table for each part.
///
/// ```
/// use report::profile::Profile;
/// use runtime::launcher::Outcome;
///
/// /// What there is to say about a run that was profiled.
/// fn text(outcome: &Outcome) -> Option<String> {
///     let flight = outcome.flight.as_ref()?;
///     Some(Profile::of(flight, outcome.missed_deadlines, None).to_string())
/// }
/// ```
#[derive(Debug, Serialize)]
pub struct Profile {
    /// The first tick that was profiled: that of the checkpoint from which the run went on, also after a rewind.
    pub(super) first_tick: u32,
    /// Ticks that every node completed, from that one on.
    ticks: u32,
    /// Computations whose times were noted, over all nodes.
    noted: usize,
    /// Computations that were not noted because there were too many.
    pub(super) left_out: u64,
    pub(super) nodes: Vec<NodeLatency>,
    pub(super) transport: Vec<Transport>,
    pub(super) age: Vec<Age>,
    /// True if the ages count from the stamps of all samples: without a recording, the times of the measurements are not known.
    pub(super) age_from_stamps: bool,
    pub(super) critical_path: CriticalPath,
    /// Deadlines; `None` for a run that was not paced.
    pub(super) pacing: Option<Pacing>,
}

impl Profile {
    /// The profile of `flight`, in which the clock counted `missed_deadlines`. Its `recording` has the times of the measurements.
    pub fn of(flight: &Flight, missed_deadlines: u32, recording: Option<&Path>) -> Self {
        let (nodes, transport) = latencies(flight);
        let measured = recording.and_then(|path| Measured::read(flight, path).ok());
        Self {
            first_tick: flight.plan.first_tick,
            ticks: flight.ticks.saturating_sub(flight.plan.first_tick),
            noted: flight.noted(),
            left_out: flight.left_out(),
            nodes,
            transport,
            age_from_stamps: measured.is_none(),
            age: ages(flight, &measured.unwrap_or_default()),
            critical_path: CriticalPath::of(flight),
            pacing: Pacing::of(flight, missed_deadlines),
        }
    }
}
