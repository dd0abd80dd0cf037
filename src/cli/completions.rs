//! The commands `completions` and `man`: files for shells and for the manual, made from the table of commands.

use super::output::{gone_or_failed, print_text};
use anyhow::Result;
use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man;
use runtime::output_file::{self, Kind, Mark};
use std::io::Write as _;
use std::path::PathBuf;

/// Name of the program in the files.
const PROGRAM: &str = env!("CARGO_PKG_NAME");
/// A page of the manual. Its title stands behind a few lines of macros.
const MANUAL_PAGE: Kind =
    Kind { name: "manual page", mark: Mark::Within(concat!(".TH ", env!("CARGO_PKG_NAME")).as_bytes()) };

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
/// If the folder or a page cannot be written, or another file would be replaced.
pub fn write_manual(arguments: &ManArguments, command: Command) -> Result<bool> {
    let mut command = command.disable_help_subcommand(true);
    command.build();
    let folder = &arguments.folder;
    let located = output_file::make_folder(folder)?;
    let pages: Vec<(PathBuf, Man)> =
        pages(command).into_iter().map(|page| (located.join(page.get_filename()), page)).collect();
    // Before the first is written.
    for (path, _) in &pages {
        output_file::check(path, &MANUAL_PAGE)?;
    }
    for (path, page) in &pages {
        output_file::write(path, &MANUAL_PAGE, |out| page.render(out))?;
    }
    print_text(&format!("manual pages: {}", folder.display()))?;
    Ok(true)
}

/// The pages of the subcommands of `command`, then its own.
fn pages(command: Command) -> Vec<Man> {
    let shown = command.get_subcommands().filter(|subcommand| !subcommand.is_hide_set());
    let mut pages: Vec<Man> = shown.cloned().flat_map(pages).collect();
    pages.push(Man::new(command));
    pages
}
