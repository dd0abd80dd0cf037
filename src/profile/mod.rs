//! Where the host time of a run's ticks goes.
//!
//! - [`flight`]: what the processes noted, and what each of them waited for
//! - [`times`]: histograms of host times
//! - [`latency`]: wait, wake-up, computation and sending per node; transport per topic
//! - [`age`]: how old the measurements are that a command rests on
//! - [`path`]: the nodes and hops that the end of a tick waited for
//! - [`pacing`]: deadlines of a paced run
//! - [`table`]: all of it on the terminal
//! - [`trace`]: a timeline for Perfetto
//! - [`page`]: a page with histograms and the slowest ticks

mod age;
mod flight;
mod latency;
mod pacing;
mod page;
mod path;
mod table;
#[cfg(test)]
mod tests;
mod times;
mod trace;

pub use flight::Flight;

use crate::files;
use age::Age;
use anyhow::Result;
use latency::{NodeLatency, Transport};
use pacing::Pacing;
use path::CriticalPath;
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

    /// Checks that the files can lie where they were asked for, before a run is flown for them.
    ///
    /// # Errors
    /// If a folder is not there.
    pub fn check(&self) -> Result<()> {
        self.trace.iter().chain(&self.html).try_for_each(|path| files::check_folder(path))
    }

    /// Writes those that were asked for; returns a line for each that says what it holds.
    ///
    /// # Errors
    /// If one cannot be written.
    pub fn write(&self, name: &str, flight: &Flight, profile: &Profile) -> Result<Vec<String>> {
        let mut lines = Vec::new();
        if let Some(path) = &self.trace {
            let written = files::write(path, |out| trace::write(flight, &profile.critical_path, out))?;
            lines.push(format!("trace: {} ({written}); open it in ui.perfetto.dev", path.display()));
        }
        if let Some(path) = &self.html {
            files::write(path, |out| page::write(name, flight, profile, out))?;
            lines.push(format!("page: {}", path.display()));
        }
        Ok(lines)
    }
}
