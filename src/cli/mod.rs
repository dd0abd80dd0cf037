//! The command line: arguments, what is printed, exit codes.

mod describe;
mod files;
mod identify;
mod inherited;
mod interrupts;
mod output;
mod plot;
mod profile;
mod progress;
mod run;
mod steer;
mod top;
mod validate;

use crate::COMPONENTS;
use anyhow::{Context, Result, bail};
use bus::BusError;
use clap::{Args, Parser, Subcommand};
use files::open_recording;
use output::{gone_or_failed, print_text, print_warnings, say, words};
use profile::Files;
use recorder::reader::Recording;
use report::shadow;
use run::RunArguments;
use runtime::clean;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// A vehicle simulation as independent processes in deterministic lockstep.
#[derive(Parser)]
#[command(version, about, after_help = "Example: hummingbus run manifests/hover.toml")]
struct Cli {
    #[command(subcommand)]
    command: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Fly a manifest, record it, and judge the recording.
    #[command(after_help = "Example: hummingbus run manifests/hover.toml --pace realtime --set run.seed=7")]
    Run(RunArguments),
    /// Fly a manifest as `run` does, and tell where the host time of its ticks goes.
    #[command(
        after_help = "Example: hummingbus profile manifests/hover.toml --html profile.html --trace trace.json"
    )]
    Profile(ProfileArguments),
    /// Fly a manifest with a shadow of one of its processes, or read a recording that has one: what the shadow
    /// would have done otherwise.
    #[command(
        after_help = "Examples: hummingbus shadow manifests/hover.toml --process controller --with better.toml\n          hummingbus shadow hover.mcap"
    )]
    Shadow(ShadowArguments),
    /// Check a manifest without running it, and print its graph.
    #[command(after_help = "Example: hummingbus check manifests/hover.toml")]
    Check(CheckArguments),
    /// Compare two recordings; exit code 1 if they differ.
    #[command(after_help = "Example: hummingbus diff a.mcap b.mcap")]
    Diff {
        /// The first recording.
        a: PathBuf,
        /// The second recording.
        b: PathBuf,
    },
    /// Print a recording's messages, one JSON object a line.
    #[command(after_help = "Example: hummingbus cat hover.mcap --topic /plant/state | head")]
    Cat {
        /// The recording.
        recording: PathBuf,
        /// Only this topic.
        #[arg(long)]
        topic: Option<String>,
    },
    /// Draw a recording: a page with curves over time and the paths in space, or pictures of them.
    #[command(after_help = plot::HELP)]
    Plot(plot::PlotArguments),
    /// Print every message's fields, units, frames and layout hash.
    #[command(after_help = "Example: hummingbus schema --json")]
    Schema {
        /// Print JSON, with the ROS 2 definitions.
        #[arg(long)]
        json: bool,
    },
    /// Find what measured flights show that the declared vehicle lacks; or fit a rotor to a thrust stand.
    #[command(after_help = identify::HELP)]
    Identify(identify::IdentifyArguments),
    /// Fly the measured commands of flights with one or two vehicle files, and tell how far they go astray.
    #[command(after_help = validate::HELP)]
    Validate(validate::ValidateArguments),
    /// Watch a live run and steer it: ticks, processes, topics.
    #[command(after_help = top::HELP)]
    Top(top::TopArguments),
    /// Pause, step, pace or stop a live run; exit code 2 if it refuses.
    #[command(after_help = "Example: hummingbus ctl pause")]
    Ctl(steer::CtlArguments),
    /// Replace a process of a live run.
    #[command(after_help = "Example: hummingbus swap controller --with better.toml --shadow-ticks 500")]
    Swap(steer::SwapArguments),
    /// Remove what dead runs left, and nothing of live ones; exit code 1 if something could not be removed.
    #[command(after_help = "Example: hummingbus clean --dry-run")]
    Clean {
        /// Only tell what would be removed.
        #[arg(long)]
        dry_run: bool,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Be a process of a run; started by `run`.
    #[command(hide = true)]
    Node {
        /// The kind of node.
        kind: String,
    },
}

#[derive(Args)]
struct ProfileArguments {
    #[command(flatten)]
    run: RunArguments,
    /// Write a timeline that ui.perfetto.dev opens.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Write a page with histograms and the slowest ticks.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
}

#[derive(Args)]
struct ShadowArguments {
    #[command(flatten)]
    run: RunArguments,
    /// The process to shadow; left out where a recording is read.
    #[arg(long)]
    process: Option<String>,
    /// What the shadow has otherwise: a TOML file, or TOML text, with the keys of a process in a manifest.
    #[arg(long, value_name = "FILE|TOML", default_value = "")]
    with: String,
}

#[derive(Args)]
struct CheckArguments {
    /// The manifest.
    manifest: PathBuf,
    /// Override a key of the manifest.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print the graph as JSON.
    #[arg(long)]
    json: bool,
}

/// Parses the arguments of this process, does what they ask for, and says with which code the process ends.
pub fn main() -> ExitCode {
    let command = Cli::parse().command;
    if !matches!(command, Verb::Node { .. }) {
        inherited::forget();
    }
    let result = match command {
        Verb::Run(arguments) => run::run(&arguments, None, None),
        Verb::Profile(ProfileArguments { run: arguments, trace, html }) => {
            run::run(&arguments, Some(Files { trace, html }), None)
        }
        Verb::Shadow(arguments) => run_shadow(&arguments),
        Verb::Check(arguments) => check(&arguments),
        Verb::Diff { a, b } => diff(&a, &b),
        Verb::Cat { recording, topic } => cat(&recording, topic.as_deref()),
        Verb::Plot(arguments) => plot::plot(&arguments),
        Verb::Schema { json } => {
            print_text(&if json { describe::schemas_json() } else { describe::schemas() }).map(|()| true)
        }
        Verb::Identify(arguments) => identify::run(&arguments),
        Verb::Validate(arguments) => validate::validate(&arguments),
        Verb::Top(arguments) => top::top(&arguments).map(|()| true),
        Verb::Ctl(arguments) => steer::ctl(&arguments).map(|()| true),
        Verb::Swap(arguments) => steer::swap(&arguments).map(|()| true),
        Verb::Clean { dry_run, json } => clean(dry_run, json),
        Verb::Node { kind } => node(&kind),
    };
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            say(&format!("error: {}", words(&error)));
            ExitCode::from(2)
        }
    }
}

/// Flies a manifest with a shadow more, or tells what the shadows of a recording did otherwise.
fn run_shadow(arguments: &ShadowArguments) -> Result<bool> {
    let path = &arguments.run.manifest;
    match (&arguments.process, path.extension().is_some_and(|extension| extension == "mcap")) {
        (Some(process), false) => {
            let with = steer::description(&arguments.with)?;
            run::run(&arguments.run, None, Some((process, &with)))
        }
        (None, true) => print_text(&shadow::report(&Recording::open(path)?)?).map(|()| true),
        (None, false) => bail!("name the process to shadow: --process NAME; or give a recording (.mcap)"),
        (Some(_), true) => {
            bail!("{} is a recording: leave --process out, or give a manifest", path.display())
        }
    }
}

fn check(arguments: &CheckArguments) -> Result<bool> {
    let checked = crate::check(&arguments.manifest, &arguments.set)?;
    print_warnings(checked.warnings());
    print_text(&if arguments.json { checked.json() } else { checked.to_string() })?;
    Ok(true)
}

/// Compares two recordings; false if they differ.
fn diff(a: &Path, b: &Path) -> Result<bool> {
    let difference = recorder::diff::first_difference(&open_recording(a)?, &open_recording(b)?)?;
    match &difference {
        None => print_text("identical")?,
        Some(difference) => print_text(&difference.to_string())?,
    }
    Ok(difference.is_none())
}

/// Prints the messages of a recording: topic, tick, time and fields in the order of the definition; false if it
/// was cut off.
fn cat(path: &Path, topic: Option<&str>) -> Result<bool> {
    use std::io::Write as _;
    let recording = open_recording(path)?;
    if let Some(topic) = topic {
        recording.topic(topic)?;
    }
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for record in recording.messages() {
        let record = record?;
        if topic.is_some_and(|topic| topic != record.topic) {
            continue;
        }
        let leaves = recording.decode(&record)?;
        let fields: serde_json::Map<_, _> =
            leaves.into_iter().map(|leaf| (leaf.path, describe::json_value(&leaf.value))).collect();
        let line = serde_json::json!({
            "topic": record.topic, "tick": record.tick, "time_ns": record.time_ns, "fields": fields
        });
        if let Err(error) = writeln!(out, "{line}") {
            return gone_or_failed(error);
        }
    }
    out.flush().map_or_else(gone_or_failed, |()| Ok(recording.cut().is_none()))
}

/// Removes what dead runs left; false if something of it is still there.
fn clean(dry_run: bool, json: bool) -> Result<bool> {
    let report = clean::clean(dry_run)?;
    print_text(&if json { serde_json::to_string_pretty(&report)? } else { report.to_string() })?;
    Ok(report.is_done())
}

/// Runs a process of a run; what it says goes to the launcher's log.
fn node(kind: &str) -> Result<bool> {
    let result = if kind == "clock" {
        bus::clock::run()
    } else {
        let kind = COMPONENTS
            .find(kind)
            .with_context(|| format!("no kind `{kind}`; there are {}", COMPONENTS.names()))?;
        bus::Join::from_environment().and_then(|join| kind.run(join))
    };
    match result {
        // The launcher ended the run and knows why.
        Ok(()) | Err(BusError::Aborted) => Ok(true),
        Err(error) => bail!(error),
    }
}
