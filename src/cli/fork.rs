//! `run --from FILE --fork N --vary …`: a campaign of flights that go on from a checkpoint.

use super::campaign::{self, Flying};
use super::campaign_engine::EngineArguments;
use super::run::{RunArguments, fly};
use ::campaign::fork::{Vary, from_folder, text};
use ::campaign::requirement::Requirement;
use anyhow::{Context, Result};
use clap::Args;
use std::path::{Path, PathBuf};

/// The campaign file in the folder.
const FILE: &str = "campaign.toml";

/// Arguments of `run`.
#[derive(Args)]
pub struct RunOrForkArguments {
    #[command(flatten)]
    run: RunArguments,
    #[command(flatten)]
    fork: ForkArguments,
}

/// Arguments of a campaign from a checkpoint.
#[derive(Args)]
struct ForkArguments {
    /// Fly this many flights from the checkpoint on, as `campaign` does, each with a seed of its own.
    #[arg(
        long,
        value_name = "FLIGHTS",
        requires = "from",
        value_parser = clap::value_parser!(u64).range(1..=::campaign::declaration::FLIGHTS_MAX),
        conflicts_with_all = [
            "record", "pace", "window", "compose", "in_process", "checkpoint_every", "view", "foxglove",
        ]
    )]
    fork: Option<u64>,
    /// Vary a value of the flights, such as process.plant.vehicle.body.mass=uniform:0.4,0.6 or run.seed=integers:1,9; with
    /// factor: or offset: before the distribution the numbers act on the declared value.
    #[arg(long, value_name = "KEY=DISTRIBUTION:VALUES", requires = "fork")]
    vary: Vec<Vary>,
    /// Folder for the plan, the flights and the report of --fork; beside the checkpoint where absent.
    #[arg(long, value_name = "FOLDER", requires = "fork")]
    out: Option<PathBuf>,
    /// Number of worker processes of --fork; one for each core where absent.
    #[arg(long, value_name = "COUNT", requires = "fork", value_parser = clap::value_parser!(u16).range(1..=1024))]
    workers: Option<u16>,
    /// Exit with code 1 unless this holds of the flights of --fork, such as "pass_rate >= 0.99 at 95 %".
    #[arg(long, value_name = "CONDITION", requires = "fork")]
    require: Option<Requirement>,
}

/// The command `run`.
///
/// # Errors
/// As [`fly`], or as `campaign`.
pub fn run(arguments: &RunOrForkArguments) -> Result<bool> {
    let RunOrForkArguments { run, fork } = arguments;
    let Some(flights) = fork.fork else { return fly(run) };
    let from = run.from.as_ref().context("--fork flies from a checkpoint on: name it with --from")?;
    let folder = fork.out.clone().unwrap_or_else(|| from.with_extension("fork"));
    let from = std::path::absolute(from).with_context(|| format!("{} is not a path", from.display()))?;
    let text = |from: &Path| text(from, flights, &run.set, &fork.vary);
    campaign::fly(Flying {
        path: folder.join(FILE),
        // The folder need not be there yet, and a relative path through a missing folder cannot be opened.
        text: text(&from)?,
        made: Some(text(&from_folder(&from, &folder))?),
        folder,
        engine: EngineArguments::local(fork.workers),
        require: fork.require,
        json: run.json,
        quiet: run.quiet,
    })
}
