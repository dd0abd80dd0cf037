//! hummingbus: launches process sets that simulate a vehicle in lockstep, and judges their recordings.
//!
//! What other programs can call: [`check()`] and [`check_text`], which check a manifest and all that it names without
//! running it.
#![forbid(unsafe_code)]

pub mod check;
mod clean;
pub mod cli;
mod companions;
mod ctl;
mod descendants;
mod describe;
#[cfg(test)]
mod extremes;
mod files;
mod graph;
mod identify;
mod inherited;
mod judge;
mod kinds;
mod launch;
mod manifest;
mod output;
mod output_file;
mod outputs;
mod page;
mod placement;
mod plot;
mod problem;
mod process_log;
mod process_table;
mod processes;
mod profile;
mod program;
mod progress;
#[cfg(test)]
mod properties;
mod run;
mod run_dir;
mod shadow;
mod spawn;
mod stall;
mod succession;
mod summary;
mod supervisor;
mod top;
mod validate;
mod watch_clock;

pub use check::{Checked, check, check_text};
pub use problem::Problem;
