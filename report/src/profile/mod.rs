//! Where the host time of a run's ticks goes.
//!
//! - `times`: histograms of host times
//! - `latency`: wait, wake-up, computation and sending per node; transport per topic
//! - `age`: how old the measurements are that a command rests on
//! - `path`: the nodes and hops that the end of a tick waited for
//! - `pacing`: deadlines of a paced run
//! - `figures`: all of these
//! - `table`: all of it on the terminal
//! - `trace`: a timeline for Perfetto
//! - `page`: a page with histograms and the slowest ticks

mod age;
mod figures;
mod latency;
mod pacing;
mod page;
mod path;
mod table;
#[cfg(test)]
mod tests;
mod times;
mod trace;

pub use figures::Profile;
pub use trace::START as TRACE_START;

use runtime::flight::Flight;
use std::io::{self, Write};

impl Profile {
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
