//! The commands `completions` and `man`: files for shells and for the manual, made from the table of commands.

use super::output::{gone_or_failed, print_text};
use anyhow::{Context, Result};
use clap::{Args, Command};
use clap_complete::Shell;
use std::io::Write as _;
use std::path::PathBuf;

/// Name of the program in the files.
const PROGRAM: &str = env!("CARGO_PKG_NAME");

/// Arguments of `completions`.
#[derive(Args)]
pub struct CompletionsArguments {
    /// The shell.
    shell: Shell,
}

/// Arguments of `man`.
#[derive(Args)]
pub struct ManArguments {
    /// Folder for the pages; made if it does not exist.
    folder: PathBuf,
}

/// Prints the completions of `command` for a shell.
///
/// # Errors
/// If standard output cannot be written.
pub fn print(arguments: &CompletionsArguments, mut command: Command) -> Result<bool> {
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, PROGRAM, &mut text);
    std::io::stdout().write_all(&text).map_or_else(gone_or_failed, |()| Ok(true))
}

/// Writes a manual page for `command` and one for each of its subcommands.
///
/// # Errors
/// If the folder or a page cannot be written.
pub fn write_manual(arguments: &ManArguments, command: Command) -> Result<bool> {
    let folder = arguments.folder.display();
    std::fs::create_dir_all(&arguments.folder)
        .and_then(|()| clap_mangen::generate_to(command, &arguments.folder))
        .with_context(|| format!("cannot write the manual to {folder}"))?;
    print_text(&format!("manual pages: {folder}"))?;
    Ok(true)
}
