//! hummingbus: launches process sets that simulate a vehicle in lockstep, and judges their recordings.
//!
//! What other programs can call: [`check()`] and [`check_text`], which check a manifest and all that it names without
//! running it.
#![forbid(unsafe_code)]

pub mod check;
pub mod cli;
#[cfg(test)]
mod extremes;
mod identify;
mod judge;
mod kinds;
mod page;
mod plot;
mod profile;
#[cfg(test)]
mod properties;
mod shadow;
#[cfg(test)]
mod successors;
mod summary;
mod top;
mod validate;

pub use check::{Checked, check, check_text};
pub use kinds::COMPONENTS;
pub use runtime::problem::Problem;

use cli::{files, output};
use runtime::{ctl, manifest, output_file, outputs, problem, run_dir, succession};
