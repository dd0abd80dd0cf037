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

use crate::output_file;
use crate::outputs::Output;
use age::Age;
use anyhow::Result;
use latency::{NodeLatency, Transport};
use pacing::Pacing;
use path::CriticalPath;
use runtime::flight::Flight;
use serde::Serialize;
use std::path::{Path, PathBuf};

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
}

/// Files to write beside what is printed.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Files {
    /// A timeline for Perfetto.
    pub trace: Option<PathBuf>,
    /// A page with histograms and the slowest ticks.
    pub html: Option<PathBuf>,
}

impl Files {
    /// Both, named like the recording and beside it.
    pub fn beside(recording: &Path) -> Self {
        let file = |extension| Some(recording.with_extension(extension));
        Self { trace: file("trace.json"), html: file("profile.html") }
    }

    /// Those that were asked for, to be checked before a run is flown for them.
    pub fn outputs(&self) -> Vec<Output> {
        let output = |what: &str, path: &Option<PathBuf>, kind, flag: &str| {
            let advice = format!("name another with {flag} FILE");
            path.as_ref().map(|path| Output { what: what.to_owned(), path: path.clone(), kind, advice })
        };
        let trace = output("the trace", &self.trace, &trace::KIND, "--trace");
        trace.into_iter().chain(output("the page", &self.html, &crate::page::KIND, "--html")).collect()
    }

    /// Writes those that were asked for; returns a line for each that says what it holds.
    ///
    /// # Errors
    /// If one cannot be written.
    pub fn write(&self, name: &str, flight: &Flight, profile: &Profile) -> Result<Vec<String>> {
        let mut lines = Vec::new();
        if let Some(path) = &self.trace {
            let written = output_file::write(path, &trace::KIND, |out| {
                trace::write(flight, &profile.critical_path, out)
            })?;
            lines.push(format!("trace: {} ({written}); open it in ui.perfetto.dev", path.display()));
        }
        if let Some(path) = &self.html {
            output_file::write(path, &crate::page::KIND, |out| page::write(name, flight, profile, out))?;
            lines.push(format!("page: {}", path.display()));
        }
        Ok(lines)
    }
}
