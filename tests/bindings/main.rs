//! Nodes in other languages, built as their users build them, in real runs.
//!
//! - [`support`]: a folder of its own for each test, launches under a watchdog, what a run left behind
//! - [`build`]: the library and the programs of the tests, built with CMake
//! - [`check`]: programs are asked for their ports
//! - [`cpp`]: controllers in C++, and pilots in C
//! - [`mod@fmu`]: controllers in FMUs
//! - [`mod@fmu_export`]: simulations exported as FMUs
//! - [`python`]: nodes, runs and recordings in Python
//! - [`pages`]: the commands of the pages about these languages
//! - [`guide`]: the commands of README, the first hour and all other pages
//! - [`shell`]: shell blocks of pages, and how they are run
//! - [`skipped`]: tests that cannot run here, and cases that are left to `scripts/dev thorough`
//! - [`headers`]: the headers are those of the messages

mod build;
mod check;
mod cpp;
mod fmu;
mod fmu_export;
mod guide;
mod headers;
mod pages;
mod python;
mod shell;
#[path = "../runs/skipped.rs"]
#[allow(dead_code, reason = "it serves other tests, too")]
mod skipped;
#[path = "../runs/support.rs"]
#[allow(dead_code, reason = "it serves other tests, too")]
mod support;
