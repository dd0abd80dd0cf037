//! The command `clean`.

use super::output::print_text;
use anyhow::Result;
use clap::Args;

/// What `clean` takes.
#[derive(Args)]
pub struct CleanArguments {
    /// Only tell what would be removed.
    #[arg(long)]
    dry_run: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Removes what dead runs left; false if something of it is still there.
///
/// # Errors
/// If what is there cannot be looked at.
pub fn clean(arguments: &CleanArguments) -> Result<bool> {
    let report = runtime::clean::clean(arguments.dry_run)?;
    print_text(&if arguments.json { serde_json::to_string_pretty(&report)? } else { report.to_string() })?;
    Ok(report.is_done())
}
