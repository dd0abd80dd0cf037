//! The command `validate`.

use super::interrupts::stop_token;
use super::output::{print_json, print_text, say};
use anyhow::{Result, bail};
use clap::Args;
use flights::FlightSet;
use hummingbus::COMPONENTS;
use report::validate::Validation;
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
    /// Keep what was flown in this folder: of each flight its data, its manifest and its recording.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

/// Flies all flights and prints the errors; every failure is an error, so that `true` means that every flight was
/// flown.
///
/// # Errors
/// If a file cannot be read, or a flight cannot be flown.
pub fn validate(arguments: &ValidateArguments) -> Result<bool> {
    let Some((file, vehicles)) = arguments.files.split_last() else { bail!("give a flights file") };
    let vehicles: Vec<&Path> = vehicles.iter().map(PathBuf::as_path).collect();
    let flights = FlightSet::load(file)?;
    let mut tell = |line: &str| {
        if !arguments.json {
            say(line);
        }
    };
    // Before there is a folder to remove, so that an interrupt leaves none.
    let validation =
        Validation { components: COMPONENTS, stop: &stop_token()?, keep: arguments.keep.as_deref() };
    let errors = validation.errors(&vehicles, &flights, &mut tell)?;
    if arguments.json { print_json(&errors.json()) } else { print_text(&errors.to_string()) }?;
    Ok(true)
}
