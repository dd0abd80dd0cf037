//! Checks manifests, and launches the runs that they describe: starts the processes, watches over them, and takes
//! everything down again.

pub mod clean;
mod companions;
pub mod ctl;
mod descendants;
pub mod describe;
pub mod event;
pub mod flight;
pub mod graph;
pub mod launch;
pub mod manifest;
pub mod output_file;
pub mod outputs;
mod placement;
pub mod problem;
mod process_log;
mod process_table;
mod processes;
pub mod program;
pub mod registry;
pub mod run_dir;
mod spawn;
mod stall;
pub mod succession;
mod supervisor;
mod watch_clock;
