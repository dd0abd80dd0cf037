//! The command `validate`: flies the measured commands of flights on the bus with one or two vehicle files, and tells
//! how far the state at the ends of windows lies from the measured one.
//!
//! | room | what it holds |
//! |---|---|
//! | [`replay`] | one flight as a run: its files, its manifest, the flight itself |
//! | [`rows`] | the rows that the player reads: at the times of the commands too |
//! | [`windows`] | errors at the ends of the windows, read from the recording |
//! | [`mod@errors`] | what came of it, as a table and as JSON |

mod errors;
mod replay;
mod rows;
mod windows;

pub use errors::Errors;

use crate::run_dir::Scratch;
use anyhow::{Context, Result, bail};
use clap::Args;
use flights::{Flight, FlightSet};
use replay::Replay;
use runtime::event::StopToken;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use vehicles::Vehicle;

/// What `--help` shows behind the options.
pub const HELP: &str = "Example: hummingbus validate vehicles/hummingbird.toml fitted.toml flights.toml\n\n\
    At the start of each window of 0.1, 0.5 and 1 s the simulated vehicle is set to the measured state; the table shows \
    the root mean square of its errors at the windows' ends. See docs/replay.md.";

/// Lengths of the windows, in milliseconds.
pub const HORIZONS_MS: [u32; 3] = [100, 500, 1000];

/// What `validate` takes.
#[derive(Args)]
pub struct ValidateArguments {
    /// One or two vehicle files, then the flights file.
    #[arg(value_name = "FILE", required = true, num_args = 2..=3)]
    pub files: Vec<PathBuf>,
    /// Print JSON, and no progress.
    #[arg(long)]
    pub json: bool,
    /// Keep what was flown in this folder: of each flight its data, its manifest and its recording.
    #[arg(long, value_name = "DIR")]
    pub keep: Option<PathBuf>,
}

/// Flies all flights and prints the errors; every error is one of flying, so that `true` says that all was flown.
///
/// # Errors
/// As [`errors()`].
pub fn validate(arguments: &ValidateArguments) -> Result<bool> {
    let Some((file, vehicles)) = arguments.files.split_last() else { bail!("give a flights file") };
    let vehicles: Vec<&Path> = vehicles.iter().map(PathBuf::as_path).collect();
    let flights = FlightSet::load(file)?;
    let mut tell = |line: &str| {
        if !arguments.json {
            crate::output::say(line);
        }
    };
    // Before there is a folder to remove, so that an interrupt leaves none.
    let stop = crate::cli::interrupts::stop_token()?;
    let errors = errors(&vehicles, &flights, arguments.keep.as_deref(), &stop, &mut tell)?;
    let text =
        if arguments.json { serde_json::to_string_pretty(&errors.json())? } else { errors.to_string() };
    crate::output::print_text(&text)?;
    Ok(true)
}

/// Flies the measured commands of every flight with each of `vehicles`, all vehicles of a flight in one run, and
/// compares. The runs' files go to `keep`, or are gone afterwards; `tell` hears a line for each flight.
///
/// # Errors
/// A file that cannot be read, a flight without what a replay needs, a run that fails or is stopped.
pub fn errors(
    vehicles: &[&Path],
    flights: &FlightSet,
    keep: Option<&Path>,
    stop: &StopToken,
    tell: &mut dyn FnMut(&str),
) -> Result<Errors> {
    for vehicle in vehicles {
        Vehicle::load(vehicle)?;
    }
    require_own_folders(flights)?;
    let scratch = if keep.is_none() { Some(Scratch::create()?) } else { None };
    let folder = keep.or(scratch.as_ref().map(Scratch::path)).context("no folder to fly in")?;
    let mut errors = Errors { vehicles: labels(vehicles), flights: Vec::new() };
    for flight in &flights.flights {
        let replay = Replay::prepare(flight, vehicles, folder)
            .with_context(|| format!("the flight `{}` cannot be replayed", flight.name))?;
        let (host_s, recording) =
            replay.fly(stop).with_context(|| not_flown(flight, keep.map(|_| replay.folder())))?;
        let flown = windows::flight_errors(flight, &replay, &recording, vehicles.len())?;
        tell(&format!("{}: {:.1} s flown in {host_s:.1} s", flight.name, replay.duration_s()));
        errors.flights.push(flown);
        if keep.is_none() {
            replay.remove()?;
        }
    }
    Ok(errors)
}

fn not_flown(flight: &Flight, kept: Option<&Path>) -> String {
    let kept = kept.map(|folder| format!(" (its files are in {})", folder.display())).unwrap_or_default();
    format!("the flight `{}` was not flown{kept}", flight.name)
}

/// Refuses two flights whose files would lie in one folder.
fn require_own_folders(set: &FlightSet) -> Result<()> {
    let mut folders = BTreeMap::new();
    for Flight { name, .. } in &set.flights {
        if let Some(other) = folders.insert(replay::file_name(name), name) {
            let folder = replay::file_name(name);
            bail!("the flights `{other}` and `{name}` would both be kept in the folder {folder}: rename one");
        }
    }
    Ok(())
}

/// What reports call the vehicles: the names of their files, or the whole paths where the names are the same.
fn labels(vehicles: &[&Path]) -> Vec<String> {
    let stems: Vec<String> = vehicles
        .iter()
        .map(|path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned())
        .collect();
    match &stems[..] {
        [one, other] if one == other => vehicles.iter().map(|path| path.display().to_string()).collect(),
        _ => stems,
    }
}

#[cfg(test)]
mod tests {
    use super::labels;
    use std::path::Path;

    #[test]
    fn vehicles_of_the_same_name_are_told_apart_by_their_paths() {
        let label = |paths: [&str; 2]| labels(&paths.map(Path::new));
        assert_eq!(label(["a/old.toml", "a/new.toml"]), ["old", "new"]);
        assert_eq!(label(["a/h.toml", "b/h.toml"]), ["a/h.toml", "b/h.toml"]);
    }
}
