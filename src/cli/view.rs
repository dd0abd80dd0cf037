//! The command `view`.

use super::files::open_recording;
use super::foxglove::{self, LiveFoxglove};
use super::interrupts::stop_token;
use super::live_page::{LOOK, LivePage, opened};
use super::output::{print_text, say};
use anyhow::{Context, Result};
use bus::plan::Plan;
use clap::Args;
use runtime::event::StopToken;
use runtime::run_dir::{LiveRun, find_live};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use view::live::recording_of;
use view::{Server, Shown};

/// Examples that `--help` shows.
pub const HELP: &str = "Examples:
  hummingbus view hover.mcap                  opens the page in the browser, and ends with Ctrl-C
  hummingbus view after.mcap before.mcap      the second recording flies as a ghost
  hummingbus view hover.mcap --no-open        prints the address only
  hummingbus view                             shows the live run, and steers it
  hummingbus view --foxglove                  shows the live run in Foxglove or Lichtblick";

/// Arguments of `view`.
#[derive(Args)]
pub struct ViewArguments {
    /// The recording, and another one that is shown as a ghost beside it; none for the live run.
    #[arg(num_args = 0..=2, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// The live run; needed only if several are alive, and not just one of them was started in this folder and on this terminal.
    #[arg(long, value_name = "ID", conflicts_with = "recordings")]
    run: Option<String>,
    /// Port of 127.0.0.1; any free one if left out.
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Print the address, and open no browser.
    #[arg(long)]
    no_open: bool,
    /// Show the live run in Foxglove or Lichtblick instead, at this address of this machine; at 127.0.0.1:8765 without one.
    #[arg(
        long,
        value_name = "ADDRESS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "127.0.0.1",
        value_parser = foxglove::address,
        conflicts_with_all = ["recordings", "port", "no_open"]
    )]
    foxglove: Option<SocketAddr>,
}

/// Shows recordings in the browser until Ctrl-C or SIGTERM.
///
/// # Errors
/// If a recording cannot be read, no run is alive, or the port is taken.
pub fn view(arguments: &ViewArguments) -> Result<bool> {
    let stop = stop_token()?;
    if arguments.recordings.is_empty() {
        return live(arguments, &stop);
    }
    let recordings = arguments.recordings.iter().map(|path| Shown::new(open_recording(path)?));
    let server = Server::new(recordings.collect::<Result<_>>()?, arguments.port)?;
    let address = server.address();
    print_text(&address)?;
    // It holds the file that leads the browser to the address until the server has ended.
    let redirect = if arguments.no_open { None } else { opened(&address) };
    say(how_to_see(redirect.is_some()));
    server.serve(&|| stop.count() > 0)?;
    Ok(true)
}

fn how_to_see(is_opened: bool) -> &'static str {
    if is_opened {
        "The browser shows it. Ctrl-C ends."
    } else {
        "Open this address in a browser on this machine. Ctrl-C ends."
    }
}

/// Shows the live run.
fn live(arguments: &ViewArguments, stop: &StopToken) -> Result<bool> {
    let run = find_live(arguments.run.as_deref())?;
    if let Some(address) = arguments.foxglove {
        return in_foxglove(&run, address, stop);
    }
    plan_of(&run)?;
    let id = run.entry.run_id;
    let mut page = LivePage::open(arguments.port, arguments.no_open)?;
    page.follow(move || find_live(Some(&id)).ok());
    print_text(page.address())?;
    say(how_to_see(page.is_opened()));
    page.stay(stop, false);
    page.close()?;
    Ok(true)
}

/// The plan of a run that flies and records.
fn plan_of(run: &LiveRun) -> Result<Plan> {
    let plan = Plan::load(&run.entry.run_dir)
        .with_context(|| format!("run {} has ended, or does not fly yet: try again", run.entry.run_id))?;
    recording_of(&plan)?;
    Ok(plan)
}

/// Shows a live run in Foxglove at this address until the run has ended, or `stop`.
///
/// # Errors
/// If the run has ended or records nothing, or the address is taken.
pub fn in_foxglove(run: &LiveRun, address: SocketAddr, stop: &StopToken) -> Result<bool> {
    let plan = plan_of(run)?;
    let id = run.entry.run_id.clone();
    let name = run.entry.manifest.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let topics = LiveFoxglove::open(address, &plan, &name, move || find_live(Some(&id)).ok())?;
    stay(topics, run.entry.launcher, stop)
}

/// Shows the run of the process `launcher` in Foxglove until the run has ended, or Ctrl-C.
fn stay(topics: LiveFoxglove, launcher: u32, stop: &StopToken) -> Result<bool> {
    say("It ends with the run, or by Ctrl-C.");
    // A run that goes back has no entry for a moment.
    let launcher = Path::new("/proc").join(launcher.to_string());
    while stop.count() == 0 && launcher.exists() && !topics.has_ended() {
        std::thread::sleep(LOOK);
    }
    topics.close().map(|()| true)
}
