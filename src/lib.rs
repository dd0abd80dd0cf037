//! hummingbus: launches process sets that simulate a vehicle in lockstep, and judges their recordings.
#![forbid(unsafe_code)]

mod clean;
pub mod cli;
mod ctl;
mod describe;
#[cfg(test)]
mod extremes;
mod files;
mod graph;
mod identify;
mod judge;
mod kinds;
mod launch;
mod manifest;
mod output;
mod page;
mod placement;
mod plot;
mod problem;
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
