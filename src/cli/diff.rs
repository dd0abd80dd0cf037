//! The command `diff`.

use super::files::open_recording;
use super::output::print_text;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `diff`.
#[derive(Args)]
pub struct DiffArguments {
    /// The first recording.
    a: PathBuf,
    /// The second recording.
    b: PathBuf,
}

/// Compares two recordings; false if they differ.
///
/// # Errors
/// If one of them cannot be read.
pub fn diff(DiffArguments { a, b }: &DiffArguments) -> Result<bool> {
    let difference = recorder::diff::first_difference(&open_recording(a)?, &open_recording(b)?)?;
    match &difference {
        None => print_text("identical")?,
        Some(difference) => print_text(&difference.to_string())?,
    }
    Ok(difference.is_none())
}
