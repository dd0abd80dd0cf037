//! The command `validate`.

use super::files::require_kind;
use super::interrupts::stop_token;
use super::kind::Kind;
use super::output::{print_json, print_text, say};
use anyhow::{Result, bail};
use clap::Args;
use flights::FlightSet;
use hummingbus::{COMPONENTS, Host};
use identify::steps_ahead::Between;
use report::validate::{Notes, StepsAheadErrors, Validation, predicted_accelerations};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Text of `--help` behind the options.
pub const HELP: &str = "Example: hummingbus validate vehicles/hummingbird.toml fitted.toml flights.toml\n\n\
    At the start of each window of 0.1, 0.5 and 1 s the simulated vehicle is set to the measured state; the table shows \
    the root mean square of its errors at the windows' ends. See docs/replay.md.";

/// Arguments of `validate`.
#[derive(Args)]
pub struct ValidateArguments {
    /// One or two vehicle files, then the flights file.
    #[arg(value_name = "FILE", required = true, num_args = 2..=3)]
    files: Vec<PathBuf>,
    /// Print JSON, and no progress.
    #[arg(long)]
    json: bool,
    /// Print no progress.
    #[arg(short, long)]
    quiet: bool,
    /// Keep what was flown in this folder: of each flight its data, its manifest and its recording.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Instead of flying on the bus, predict N samples ahead of every sample, driven by the measured rotor speeds where they were
    /// logged: mean errors after 1 to N samples, beside those of persistence (velocity, attitude and rates stay).
    #[arg(long, value_name = "N", conflicts_with = "keep", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    steps_ahead: Option<u32>,
    /// With --steps-ahead: rotors keep the speed of the last sample until the next; without it they follow straight lines between samples.
    #[arg(long, requires = "steps_ahead")]
    held: bool,
    /// Instead of flying on the bus, print the specific force (m/s²) and the angular acceleration (rad/s²)
    /// that each vehicle predicts. Predictions are made at every sample of the attitude, from the measured
    /// state and rotor speeds. Rotor speeds that were not logged follow from the commands. Needs --json.
    #[arg(long, requires = "json", conflicts_with_all = ["keep", "steps_ahead"])]
    accelerations: bool,
}

/// Flies all flights and prints the errors; every failure is an error, so that `true` means that every flight was
/// flown.
///
/// # Errors
/// If a file cannot be read, or a flight cannot be flown.
pub fn validate(arguments: &ValidateArguments) -> Result<bool> {
    let Some((file, vehicles)) = arguments.files.split_last() else { bail!("give a flights file") };
    let vehicles: Vec<&Path> = vehicles.iter().map(PathBuf::as_path).collect();
    let order = "the vehicle files stand first, the flights file last";
    vehicles.iter().try_for_each(|vehicle| require_kind(vehicle, &[Kind::Vehicle], order))?;
    require_kind(file, &[Kind::Flights], order)?;
    let flights = FlightSet::load(file)?;
    if let Some(steps) = arguments.steps_ahead {
        let between = if arguments.held { Between::Held } else { Between::Lines };
        let errors = StepsAheadErrors::of(&vehicles, &flights, steps as usize, between)?;
        print_with_notes(&flights, arguments.json, errors.json(), &errors.to_string())?;
        return Ok(true);
    }
    if arguments.accelerations {
        let predicted = predicted_accelerations(&vehicles, &flights)?;
        print_with_notes(&flights, true, predicted, "")?;
        return Ok(true);
    }
    let mut tell = |line: &str| {
        if !arguments.json && !arguments.quiet {
            say(line);
        }
    };
    // Before there is a folder to remove, so that an interrupt leaves none.
    let (stop, keep) = (stop_token()?, arguments.keep.as_deref());
    let validation = Validation { host: Host::this_binary(), keep, ..Validation::new(COMPONENTS, &stop) };
    let errors = validation.errors(&vehicles, &flights, &mut tell)?;
    print_with_notes(&flights, arguments.json, errors.json(), &errors.to_string())?;
    Ok(true)
}

/// Prints errors, as JSON or as a table, with the notes on the flights.
fn print_with_notes(flights: &FlightSet, is_json: bool, mut json: Value, table: &str) -> Result<()> {
    let notes = Notes::of(flights);
    if is_json {
        notes.add_to(&mut json);
        return print_json(&json);
    }
    print_text(&format!("{table}{notes}"))
}
