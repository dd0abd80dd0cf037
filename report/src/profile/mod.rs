//! Host time of a run's ticks, part by part.
//!
//! - `times`: histograms of host times
//! - `latency`: wait, wake-up, computation and sending per node; transport per topic
//! - `age`: age of the measurements that a command rests on
//! - `path`: the nodes and hops that the end of a tick waited for
//! - `pacing`: deadlines of a paced run
//! - `figures`: the figures of all these
//! - `table`: the figures on the terminal
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
