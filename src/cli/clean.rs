//! The command `clean`.

use super::output::{print_json, print_text};
use anyhow::Result;
use bus::names::SHARED_MEMORY;
use clap::Args;
use indicatif::HumanBytes;
use runtime::clean::Report;
use std::path::PathBuf;

/// Arguments of `clean`.
#[derive(Args)]
pub struct CleanArguments {
    /// Only list what would be removed.
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
    if arguments.json { print_json(&report) } else { print_text(&Text(&report).to_string()) }?;
    Ok(report.is_done())
}

/// A report in words.
struct Text<'a>(&'a Report);

impl std::fmt::Display for Text<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(report) = self;
        let verb = if report.dry_run { "would remove" } else { "removed" };
        for remains in &report.dead {
            let bytes = HumanBytes(remains.bytes);
            if remains.has_something_to_remove() {
                writeln!(f, "{verb} run {}: {bytes}", remains.run_id)?;
            }
            let (shared, folders): (Vec<&PathBuf>, Vec<&PathBuf>) =
                remains.paths.iter().partition(|path| path.starts_with(SHARED_MEMORY));
            folders.iter().try_for_each(|path| writeln!(f, "  {}", path.display()))?;
            if !shared.is_empty() {
                writeln!(f, "  {} in {SHARED_MEMORY}", count(shared.len(), "file"))?;
            }
            remains.processes.iter().try_for_each(|process| writeln!(f, "  process {process}"))?;
            remains.spared.iter().try_for_each(|process| {
                writeln!(
                    f,
                    "  not killed: process {process}, which run {} started and which holds none of its files; if \
                     nobody needs it: kill {process}",
                    remains.run_id
                )
            })?;
            remains.failures.iter().try_for_each(|failure| writeln!(f, "  LEFT {failure}"))?;
        }
        let bytes = HumanBytes(report.dead.iter().map(|remains| remains.bytes).sum());
        let live = count(report.live.len(), "live run");
        match report.dead.iter().filter(|remains| remains.has_something_to_remove()).count() {
            0 => write!(f, "nothing to remove; {live} kept"),
            dead => write!(f, "{verb} {} ({bytes}); {live} kept", count(dead, "dead run")),
        }
    }
}

fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}
