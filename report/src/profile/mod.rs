//! Where the host time of a run's ticks goes.
//!
//! - [`times`]: histograms of host times
//! - [`latency`]: wait, wake-up, computation and sending per node; transport per topic
//! - [`age`]: how old the measurements are that a command rests on
//! - [`path`]: the nodes and hops that the end of a tick waited for
//! - [`pacing`]: deadlines of a paced run
//! - [`table`]: all of it on the terminal
//! - [`trace`]: a timeline for Perfetto
//! - [`page`]: a page with histograms and the slowest ticks

mod age;
mod latency;
mod pacing;
mod page;
mod path;
mod table;
#[cfg(test)]
mod tests;
mod times;
mod trace;

pub use trace::START as TRACE_START;

use age::Age;
use latency::{NodeLatency, Transport};
use pacing::Pacing;
use path::CriticalPath;
use runtime::flight::Flight;
use serde::Serialize;
use std::io::{self, Write};

/// Where the host time of a run went.
#[derive(Debug, Serialize)]
pub struct Profile {
    /// Ticks of the run.
    pub ticks: u32,
    /// Computations whose times were noted, over all nodes.
    pub noted: usize,
    /// Computations that were not noted because there were too many.
    pub left_out: u64,
    nodes: Vec<NodeLatency>,
    transport: Vec<Transport>,
    age: Vec<Age>,
    critical_path: CriticalPath,
    /// Deadlines; `None` for a run that was not paced.
    pacing: Option<Pacing>,
}

impl Profile {
    /// The profile of `flight`, in which the clock counted `missed_deadlines`.
    pub fn of(flight: &Flight, missed_deadlines: u32) -> Self {
        let (nodes, transport) = latency::latencies(flight);
        Self {
            ticks: flight.ticks,
            noted: flight.noted(),
            left_out: flight.left_out(),
            nodes,
            transport,
            age: age::ages(flight),
            critical_path: CriticalPath::of(flight),
            pacing: Pacing::of(flight, missed_deadlines),
        }
    }

    /// Writes a timeline that ui.perfetto.dev opens; returns which ticks it holds, in words.
    ///
    /// # Errors
    /// If `out` fails.
    pub fn write_trace(&self, flight: &Flight, out: &mut impl Write) -> io::Result<String> {
        trace::write(flight, &self.critical_path, out)
    }

    /// A page with histograms and the slowest ticks of run `run`.
    #[must_use]
    pub fn page(&self, run: &str, flight: &Flight) -> Vec<u8> {
        page::page(run, flight, self)
    }
}
