//! hummingbus: a vehicle simulation as independent components in deterministic lockstep, on a zero-copy bus.
//!
//! A manifest says which components fly together, and how they are wired. [`load`] reads one. [`fly`] flies it by a [`Launcher`],
//! in processes, on threads or in one thread, and returns the verdicts and the recording:
//!
//! ```
//! use hummingbus::{Host, Launcher};
//! let folder = tempfile::tempdir()?;
//! let hover = concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/hover.toml");
//! let manifest = hummingbus::load(hover)?;
//!
//! let flown = hummingbus::fly(Launcher::new(Host::InProcess), &manifest, folder.path().join("hover.mcap"))?;
//!
//! assert!(flown.summary.passed, "{}", flown.summary);
//! let altitude = &flown.recording.unwrap().series(&[("/plant/state", "position.z")])?[0];
//! assert!((altitude.value[99] - 1.0).abs() < 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Options of the command line that change the flight and not the manifest are methods of the launcher: [`Launcher::paced`],
//! [`Launcher::with_window`], [`Launcher::composed`], [`Launcher::profiled`] and [`Launcher::shadowing`]. Other keys are
//! set by [`Manifest::set`]. `docs/library.md` has a table of both.
//!
//! To look between two ticks, or to stop in a debugger, step the same components by [`simulate`]: the samples are the
//! same, bit for bit:
//!
//! ```
//! use bus::messages::PlantState;
//! # use hummingbus::bus;
//! # let hover = concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/hover.toml");
//! let mut simulation = hummingbus::simulate(&hummingbus::load(hover)?)?;
//! let state = simulation.topic::<PlantState>("/plant/state")?;
//! while simulation.time_s() < 4.0 {
//!     simulation.step()?;
//! }
//! assert!((simulation.newest(state).unwrap().position.z - 1.5).abs() < 0.05);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A run is followed with [`Launcher::followed_by`], steered from another thread with [`Launcher::remote`], and ended
//! early with a [`StopToken`]. [`check()`] and [`check_text`] check a manifest and every file that it names without
//! flying it.
//!
//! A simulation is a value: from its state saved at a tick another one of the same manifest goes on, as often as you
//! like. [`Checkpoint`] is the same in a file, for runs under any host:
//!
//! ```
//! use bus::messages::PlantState;
//! # use hummingbus::bus;
//! # let hover = concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/hover.toml");
//! let manifest = hummingbus::load(hover)?;
//! let (mut whole, mut later) = (hummingbus::simulate(&manifest)?, hummingbus::simulate(&manifest)?);
//! for _ in 0..50 {
//!     whole.step()?;
//! }
//! later.restore(&whole.save())?;
//! for _ in 0..50 {
//!     whole.step()?;
//!     later.step()?;
//! }
//! let state = whole.topic::<PlantState>("/plant/state")?;
//! assert_eq!(whole.newest(state).unwrap().position, later.newest(state).unwrap().position);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`fly`] and [`simulate`] return [`Error`]: [`Error::is_input`], [`Error::is_component`] and [`Error::is_system`] say which
//! side is at fault, [`Error::diagnostic`] has the place in a file, and [`Error::process`] names the process that failed.
//!
//! | crate | content |
//! |---|---|
//! | [`component`] | components, their ports, messages and parameters |
//! | [`bus`] | the lockstep and the transport, and all of [`component`] again |
//! | [`runtime`] | manifests, plans, the launcher |
//! | [`recorder`] | recordings, written and read |
//! | [`report`] | verdicts, figures and pages from recordings |
//! | [`plant`], [`sensors`], [`controllers`] | the components that this package brings |
//! | [`vehicles`], [`scenes`] | files that describe vehicles, and their surroundings |
//! | [`inputs`] | files that are read once, for a run or a fit |
//! | [`flights`], [`identify`] | measured flights, and the effects in them that a vehicle file lacks |
#![forbid(unsafe_code)]

pub mod agent;
#[cfg(test)]
mod backups;
mod check;
mod components;
#[cfg(test)]
mod extremes;
mod flown;
pub mod fmu_export;
pub mod operator;
#[cfg(test)]
mod properties;

pub use bus::Simulation;
pub use bus::plan::Pace;
pub use check::{check, check_text, check_with_programs, drives, meshes};
pub use components::COMPONENTS;
pub use diagnostics::{Diagnostic, Error, Result};
pub use flown::{Flown, fly};
pub use runtime::checkpoint::Checkpoint;
pub use runtime::ctl::Remote;
pub use runtime::ctl::protocol::{Answer, Request};
pub use runtime::event::{Progress, RunEvent, StopToken};
pub use runtime::graph::Graph;
pub use runtime::host::Host;
pub use runtime::launcher::{Launcher, Outcome};
pub use runtime::manifest::{Composition, Manifest, ManifestBuilder};
pub use runtime::simulate;
pub use {
    bus, component, controllers, flights, identify, inputs, plant, recorder, report, runtime, scenes,
    sensors, vehicles,
};

use std::path::Path;

/// Reads the manifest at `path`, which may name the components of this package ([`COMPONENTS`]).
///
/// # Errors
/// The faults, each with its place and advice.
///
/// ```
/// let problem = hummingbus::load("nowhere.toml").unwrap_err();
/// assert!(problem.to_string().contains("nowhere.toml"));
/// ```
pub fn load(path: impl AsRef<Path>) -> Result<Manifest, Diagnostic> {
    Manifest::load(path.as_ref(), &[], COMPONENTS)
}

/// The examples of the README, to be compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// The examples of the page on the library, to be compiled.
#[cfg(doctest)]
#[doc = include_str!("../docs/library.md")]
struct Library;
