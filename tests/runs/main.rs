//! Tests that launch the real binary and judge what it prints, records and leaves behind.
//!
//! - [`support`]: a folder of its own for each test, launches under a watchdog, what a run left behind
//! - [`recordings`]: recordings read back and compared
//! - [`nodes`]: the processes that the tests put into runs
//! - [`determinism`]: a run is a function of its manifest
//! - [`loss`]: every sample is recorded
//! - [`contract`]: what a node sees and sends at a tick
//! - [`failures`]: nodes that fail, in every way
//! - [`cleanup`]: runs that are stopped or killed
//! - [`refusals`]: manifests that are wrong
//! - [`manifests`]: includes, sets, settings, successors, companions
//! - [`commands`]: the other subcommands, exit codes and JSON
//! - [`replay`]: the measured flight

mod cleanup;
mod commands;
mod contract;
mod determinism;
mod documentation;
mod failures;
mod loss;
mod manifests;
mod nodes;
mod recordings;
mod refusals;
mod replay;
mod support;
