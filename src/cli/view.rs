//! The command `view`.

use super::files::open_recording;
use super::interrupts::stop_token;
use super::output::{print_text, say};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;
use view::{Server, Shown, browser};

/// Examples that `--help` shows.
pub const HELP: &str = "Examples:
  hummingbus view hover.mcap                  opens the page in the browser, and ends with Ctrl-C
  hummingbus view after.mcap before.mcap      the second recording flies as a ghost
  hummingbus view hover.mcap --no-open        prints the address only";

/// What `view` takes.
#[derive(Args)]
pub struct ViewArguments {
    /// The recording.
    recording: PathBuf,
    /// Another recording, shown as a ghost beside the first.
    other: Option<PathBuf>,
    /// Port of 127.0.0.1; any free one if left out.
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Print the address, and open no browser.
    #[arg(long)]
    no_open: bool,
}

/// Shows recordings in the browser until Ctrl-C or SIGTERM.
///
/// # Errors
/// If a recording cannot be read, or the port is taken.
pub fn view(arguments: &ViewArguments) -> Result<bool> {
    let stop = stop_token()?;
    let paths = std::iter::once(&arguments.recording).chain(&arguments.other);
    let recordings = paths.map(|path| Shown::new(open_recording(path)?)).collect::<Result<_>>()?;
    let server = Server::new(recordings, arguments.port)?;
    let address = server.address();
    print_text(&address)?;
    let is_open = !arguments.no_open && browser::open(&address);
    say(if is_open {
        "The browser shows it. Ctrl-C ends."
    } else {
        "Open this address in a browser on this machine. Ctrl-C ends."
    });
    server.serve(&|| stop.count() > 0)?;
    Ok(true)
}
