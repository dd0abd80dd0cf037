//! Measured flights flown again: their commands on the bus with one or two vehicle files. The distance of the state
//! from the measured one is taken at the ends of windows.
//!
//! | room | content |
//! |---|---|
//! | `replay` | one flight as a run: its files, its manifest, the flight itself |
//! | `windows` | errors at the ends of the windows, read from the recording |
//! | `mod@errors` | the results, as a table and as JSON |
//! | `steps_ahead` | errors of multi-step predictions, made in this process |
//! | `accelerations` | predicted accelerations at every sample, made in this process |
//! | `labels` | names of the vehicles in both |
//! | `notes` | notes on the flights beside their errors |

mod accelerations;
mod errors;
mod labels;
mod notes;
mod replay;
mod steps_ahead;
mod windows;

pub use accelerations::predicted_accelerations;
pub use errors::{ChannelErrors, Errors, FlightErrors, HorizonErrors};
pub use notes::Notes;
pub use steps_ahead::{FlightSteps, StepsAheadErrors};

use anyhow::{Context, bail};
use diagnostics::Error;
use flights::{Flight, FlightSet};
use labels::labels;
use replay::Replay;
use runtime::event::StopToken;
use runtime::host::Host;
use runtime::registry::Registry;
use runtime::run_dir::Scratch;
use std::collections::BTreeMap;
use std::path::Path;
use vehicles::Vehicle;

/// Replay of measured flights on the bus, with its settings.
///
/// ```
/// use report::validate::{Errors, Validation};
/// use runtime::event::StopToken;
/// use std::path::Path;
///
/// /// How well two vehicle files meet the flights, with the components that a program offers.
/// fn compare(components: runtime::registry::Registry) -> Result<Errors, Box<dyn std::error::Error>> {
///     let flights = flights::FlightSet::load(Path::new("flights.toml"))?;
///     let stop = StopToken::default();
///     let validation = Validation::new(components, &stop);
///     let vehicles = [Path::new("declared.toml"), Path::new("fitted.toml")];
///     Ok(validation.errors(&vehicles, &flights, &mut |line| println!("{line}"))?)
/// }
///
/// assert!(compare(runtime::registry::Registry::new(&[])).is_err(), "there are no such files");
/// ```
#[derive(Clone, Debug)]
pub struct Validation<'a> {
    /// Host of the runs. With [`Host::Exe`], this process is the parent of orphans during a run, as
    /// [`Launcher::adopting_orphans`](runtime::launcher::Launcher::adopting_orphans) says.
    pub host: Host,
    /// The components that a run may have; a player, a plant and a recorder are needed.
    pub components: Registry,
    /// Ends it.
    pub stop: &'a StopToken,
    /// Folder in which the runs' files are kept; they are removed afterwards where absent.
    pub keep: Option<&'a Path>,
}

impl<'a> Validation<'a> {
    /// A validation with `components` in the thread that asks for it ([`Host::InProcess`]), which `stop` ends. No files are
    /// kept.
    #[must_use]
    pub fn new(components: Registry, stop: &'a StopToken) -> Self {
        Self { host: Host::InProcess, components, stop, keep: None }
    }

    /// Flies the measured commands of every flight with each of `vehicles`, all vehicles of a flight in one run, and
    /// compares; `tell` is called with a line for each flight. Vehicle files that `flights` has read are not read
    /// again.
    ///
    /// # Errors
    /// A file that cannot be read, a flight without data that a replay needs, a run that fails or is stopped.
    pub fn errors(
        &self,
        vehicles: &[&Path],
        flights: &FlightSet,
        tell: &mut dyn FnMut(&str),
    ) -> Result<Errors, Error> {
        for vehicle in vehicles {
            Vehicle::load_from(&flights.files, vehicle)?;
        }
        require_distinct_folders(flights)?;
        let scratch = if self.keep.is_none() { Some(Scratch::create()?) } else { None };
        let folder = self.keep.or(scratch.as_ref().map(Scratch::path)).context("no folder to fly in")?;
        let mut errors = Errors { vehicles: labels(vehicles), flights: Vec::new() };
        for flight in &flights.flights {
            let replay = Replay::prepare(flight, vehicles, folder)
                .with_context(|| format!("the flight `{}` cannot be replayed", flight.name))?;
            let (host_s, recording) = replay
                .fly(&self.host, self.components, self.stop, &flights.files, tell)
                .with_context(|| not_flown(flight, self.keep.map(|_| replay.folder.as_path())))?;
            let flown = windows::flight_errors(flight, &replay, &recording, vehicles.len())?;
            tell(&format!("{}: {:.1} s flown in {host_s:.1} s", flight.name, replay.duration_s()));
            errors.flights.push(flown);
            if self.keep.is_none() {
                replay.remove()?;
            }
        }
        Ok(errors)
    }
}

fn not_flown(flight: &Flight, kept: Option<&Path>) -> String {
    let kept = kept.map(|folder| format!(" (its files are in {})", folder.display())).unwrap_or_default();
    format!("the flight `{}` was not flown{kept}", flight.name)
}

/// Refuses two flights whose files would lie in one folder.
fn require_distinct_folders(set: &FlightSet) -> anyhow::Result<()> {
    let mut folders = BTreeMap::new();
    for Flight { name, .. } in &set.flights {
        let folder = replay::file_name(name);
        if let Some(other) = folders.insert(folder.clone(), name) {
            bail!("the flights `{other}` and `{name}` would both be kept in the folder {folder}: rename one");
        }
    }
    Ok(())
}
