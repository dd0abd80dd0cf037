//! The command `clean`.

use super::output::{print_json, print_text};
use anyhow::Result;
use clap::Args;

/// Arguments of `clean`.
#[derive(Args)]
pub struct CleanArguments {
    /// Only tell what would be removed.
    #[arg(long)]
    dry_run: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Removes the remains of dead runs; false if something of them is still there.
///
/// # Errors
/// If the remains cannot be listed.
pub fn clean(arguments: &CleanArguments) -> Result<bool> {
    let report = runtime::clean::clean(arguments.dry_run)?;
    if arguments.json { print_json(&report) } else { print_text(&report.to_string()) }?;
    Ok(report.is_done())
}
