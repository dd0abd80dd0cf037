//! hummingbus: launches process sets that simulate a vehicle in lockstep, and judges their recordings.
//!
//! What other programs can call: [`check()`] and [`check_text`], which check a manifest and all that it names without
//! running it.
#![forbid(unsafe_code)]

pub mod check;
pub mod cli;
#[cfg(test)]
mod extremes;
mod kinds;
#[cfg(test)]
mod properties;
#[cfg(test)]
mod successors;

pub use check::{Checked, check, check_text};
pub use kinds::COMPONENTS;
pub use runtime::problem::Problem;
