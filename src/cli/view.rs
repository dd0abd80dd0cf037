//! The command `view`.

use super::files::open_recording;
use super::interrupts::stop_token;
use super::output::{print_text, say};
use anyhow::{Context, Result};
use bus::plan::Plan;
use clap::Args;
use recorder::reader::Recording;
use runtime::event::StopToken;
use runtime::run_dir::{LiveRun, find_live};
use std::path::{Path, PathBuf};
use std::time::Duration;
use view::browser::{self, Redirect};
use view::{Server, Shown};

/// Examples that `--help` shows.
pub const HELP: &str = "Examples:
  hummingbus view hover.mcap                  opens the page in the browser, and ends with Ctrl-C
  hummingbus view after.mcap before.mcap      the second recording flies as a ghost
  hummingbus view hover.mcap --no-open        prints the address only
  hummingbus view                             shows the live run, as far as it is recorded";

/// Pause between two looks for the first messages of a live run.
const LOOK: Duration = Duration::from_millis(100);

/// Arguments of `view`.
#[derive(Args)]
pub struct ViewArguments {
    /// The recording, and another one that is shown as a ghost beside it; none for the live run.
    #[arg(num_args = 0..=2, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// The live run; needed only if several are alive.
    #[arg(long, value_name = "ID", conflicts_with = "recordings")]
    run: Option<String>,
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
/// If a recording cannot be read, no run is alive, or the port is taken.
pub fn view(arguments: &ViewArguments) -> Result<bool> {
    let stop = stop_token()?;
    let recordings = match &arguments.recordings[..] {
        [] => vec![live(&find_live(arguments.run.as_deref())?, &stop)?],
        paths => paths.iter().map(|path| Shown::new(open_recording(path)?)).collect::<Result<_>>()?,
    };
    let server = Server::new(recordings, arguments.port)?;
    let address = server.address();
    print_text(&address)?;
    // It holds the file that leads the browser to the address until the server has ended.
    let redirect = if arguments.no_open { None } else { opened(&address) };
    say(if redirect.is_some() {
        "The browser shows it. Ctrl-C ends."
    } else {
        "Open this address in a browser on this machine. Ctrl-C ends."
    });
    server.serve(&|| stop.count() > 0)?;
    Ok(true)
}

/// The browser that shows `address`; `None` if there is none, or it could not be led there.
fn opened(address: &str) -> Option<Redirect> {
    browser::open(address).unwrap_or_else(|error| {
        say(&format!("warning: no browser was opened: {error:#}"));
        None
    })
}

/// The recording of a live run so far; waits for its first messages.
fn live(run: &LiveRun, stop: &StopToken) -> Result<Shown> {
    let id = &run.entry.run_id;
    let plan = Plan::load(&run.entry.run_dir)
        .with_context(|| format!("run {id} has ended, or flies on one thread (--in-process)"))?;
    let recorder = plan.nodes.iter().find(|node| node.is_recorder);
    let path = recorder.and_then(|node| node.parameters["path"].as_str()).with_context(|| {
        format!("run {id} records nothing, so that there is nothing to show: start it with --record FILE")
    })?;
    loop {
        match Recording::salvage(Path::new(path)).map_err(anyhow::Error::from).and_then(Shown::new) {
            Err(_) if run.is_live() && stop.count() == 0 => std::thread::sleep(LOOK),
            shown => return shown,
        }
    }
}
