//! The command `shadow`.

use super::files::open_recording;
use super::output::print_text;
use super::run::{RunArguments, run};
use super::steer;
use anyhow::{Result, bail};
use clap::Args;
use std::path::PathBuf;

/// Arguments of `shadow`.
#[derive(Args)]
pub struct ShadowArguments {
    #[command(flatten)]
    run: RunArguments,
    /// The process to shadow; left out where a recording is read.
    #[arg(long)]
    process: Option<String>,
    /// Differences of the shadow: a TOML file, or TOML text, with the keys of a process in a manifest.
    #[arg(long, value_name = "FILE|TOML", default_value = "")]
    with: String,
}

/// Flies a manifest with an additional shadow, or reports the differences of the shadows of a recording.
///
/// # Errors
/// As `run`; or a recording cannot be read.
pub fn shadow(arguments: &ShadowArguments) -> Result<bool> {
    let is_recording = |path: &&PathBuf| path.extension().is_some_and(|extension| extension == "mcap");
    let recording = arguments.run.manifest.as_ref().filter(is_recording);
    match (&arguments.process, recording) {
        (Some(process), None) => {
            let with = steer::description(&arguments.with, process)?;
            run(&arguments.run, None, Some((process, &with)))
        }
        (None, Some(path)) => {
            let recording = open_recording(path)?;
            print_text(&report::shadow::report(&recording)?)?;
            Ok(recording.cut().is_none())
        }
        (None, None) => bail!("name the process to shadow: --process NAME; or give a recording (.mcap)"),
        (Some(_), Some(path)) => {
            bail!("{} is a recording: leave --process out, or give a manifest", path.display())
        }
    }
}
