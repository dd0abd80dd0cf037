//! The command `run` and related ones: check a manifest, fly it, judge its recording, print the results.

use super::earlier::Earlier;
use super::files::require_kind;
use super::foxglove::{self, LiveFoxglove};
use super::interrupts::stop_token;
use super::kind::Kind;
use super::live_page::LivePage;
use super::output::{message, print_json, print_text, print_warnings, say};
use super::profile::Files;
use super::progress::{self, RUN};
use super::shell::command;
use anyhow::{Context, Error, Result, anyhow, bail};
use clap::Args;
use diagnostics::Diagnostic;
use hummingbus::COMPONENTS;
use recorder::reader::Recording;
use report::profile::Profile;
use report::summary::Summary;
use runtime::checkpoint::{Checkpoint, Written};
use runtime::event::StopToken;
use runtime::graph::{self, Graph};
use runtime::host::Host;
use runtime::launcher::Launcher;
use runtime::manifest::{Composition, Manifest, NO_RECORDING, PaceSetting};
use runtime::outputs::Outputs;
use runtime::run_dir::run_of_launcher;
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

/// Arguments of `run`, and common arguments of the commands that fly a manifest.
#[derive(Args)]
pub struct RunArguments {
    /// The manifest; with --from it is that of the checkpoint.
    #[arg(required_unless_present = "from", conflicts_with = "from")]
    pub manifest: Option<PathBuf>,
    /// Go on from this checkpoint, with other values where --set gives them.
    #[arg(long, value_name = "CHECKPOINT")]
    pub from: Option<PathBuf>,
    /// Write a checkpoint at every multiple of this simulated time, such as 1s or 250ms.
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    pub checkpoint_every: Option<f64>,
    /// Newest checkpoints that are kept.
    #[arg(long, value_name = "NUMBER", requires = "checkpoint_every")]
    pub keep: Option<u32>,
    /// File to record to, or none; beside the manifest, named like it, where absent. With --from that name ends in
    /// .from-TICK.mcap, and a later run from the same tick replaces the file.
    #[arg(long, value_name = "PATH")]
    pub record: Option<PathBuf>,
    /// free, realtime, or simulated seconds per second.
    #[arg(long, value_name = "PACE")]
    pub pace: Option<PaceSetting>,
    /// Ticks that a fast process may be ahead of the slowest.
    #[arg(long, value_name = "TICKS", value_parser = clap::value_parser!(u32).range(1..=i64::from(graph::WINDOW_TICKS_MAX)))]
    pub window: Option<u32>,
    /// Nodes that share a process: none, all, vehicles, or groups such as plant+imu,ekf+controller.
    #[arg(long, value_name = "GROUPS")]
    pub compose: Option<Composition>,
    /// Step all nodes one after the other in this process: no shared memory, and a debugger sees them all.
    #[arg(long, conflicts_with_all = ["compose", "window"])]
    pub in_process: bool,
    /// Show the run in the browser while it flies, at this port of 127.0.0.1 or at any free one.
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "0")]
    pub view: Option<u16>,
    /// With --view: print the address, and open no browser.
    #[arg(long, requires = "view")]
    pub no_open: bool,
    /// Show the run in Foxglove or Lichtblick while it flies, at this address of this machine; at 127.0.0.1:8765 without
    /// one.
    #[arg(
        long,
        value_name = "ADDRESS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "127.0.0.1",
        value_parser = foxglove::address
    )]
    pub foxglove: Option<SocketAddr>,
    /// Override a key of the manifest, such as run.seed=3.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Print the summary as JSON, and no progress.
    #[arg(long)]
    pub json: bool,
    /// Print no progress, and a summary only if the run did not pass; with --fork, print no progress.
    #[arg(short, long, conflicts_with = "json")]
    pub quiet: bool,
}

/// Arguments of `profile`.
#[derive(Args)]
pub struct ProfileArguments {
    #[command(flatten)]
    run: RunArguments,
    #[command(flatten)]
    files: Files,
}

/// The command `run`.
///
/// # Errors
/// As [`run`].
pub fn fly(arguments: &RunArguments) -> Result<bool> {
    run(arguments, None, None)
}

/// The command `profile`.
///
/// # Errors
/// As [`run`].
pub fn profile(arguments: &ProfileArguments) -> Result<bool> {
    run(&arguments.run, Some(arguments.files.clone()), None)
}

/// Flies a manifest, profiled if `files` are given, with an `extra_shadow` (a process, and TOML with the differences
/// of the shadow) if one is requested; false if a condition did not hold.
pub fn run(
    arguments: &RunArguments,
    files: Option<Files>,
    extra_shadow: Option<(&str, &str)>,
) -> Result<bool> {
    // First, so that a user who stops the run early sees that it was stopped.
    let stop = stop_token()?;
    let record = arguments.record.as_deref();
    let from = arguments.from.as_deref().map(Checkpoint::read).transpose()?;
    let mut manifest = recorded(loaded(arguments, from.as_ref())?, record)?;
    if let Some(pace) = arguments.pace {
        manifest.content.run.pace = pace;
    }
    if let Some(window) = arguments.window {
        manifest.content.run.window_ticks = Some(toml::Spanned::new(0..0, window));
    }
    if let Some(composition) = &arguments.compose {
        manifest.content.run.compose = Some(toml::Spanned::new(0..0, composition.clone()));
    }
    let mut graph = Graph::build(&manifest)?;
    print_warnings(&graph.warnings);
    graph.plan.profile |= files.is_some();
    if let Some((process, with)) = extra_shadow {
        graph.add_shadow(&manifest, process, with)?;
    }
    let going_on = from.as_ref().map(Checkpoint::tick);
    if let (Some(from), Some(path)) = (from, &arguments.from) {
        let about = || format!("cannot go on from {}", path.display());
        from.resume(&manifest, &mut graph, !arguments.set.is_empty()).with_context(about)?;
    }
    let mut path = recording_path(&manifest, record)?;
    if extra_shadow.is_some() && arguments.record.is_none() {
        // The recording of the manifest itself is not replaced.
        path.set_extension("shadow.mcap");
    }
    if let Some(tick) = going_on
        && (record.is_none() || manifest.content.run.is_unrecorded())
    {
        // The recording and the checkpoints of the run before are not replaced.
        path.set_extension(format!("from-{tick}.mcap"));
    }
    let files = files.unwrap_or_else(|| Files::beside(&path));
    let pages = if graph.plan.profile { files.outputs() } else { Vec::new() };
    let mut outputs = Outputs::of(&manifest, &graph, &path, pages)?;
    let earlier = going_on.is_none().then(|| Earlier::beside(&path));
    let page = arguments.view.map(|port| page(port, arguments.no_open, &graph)).transpose()?;
    let topics = arguments.foxglove.map(|address| topics(address, &manifest, &graph)).transpose()?;
    let bar = progress::bar(RUN, arguments.json || arguments.quiet);
    let host = if arguments.in_process { Host::InProcess } else { Host::this_binary() };
    let launcher = Launcher::new(host)
        .stopped_by(&stop)
        .adopting_orphans()
        .followed_by(|event| progress::show(&bar, event));
    let flown = launcher.launch(&manifest, &mut graph, &mut outputs);
    let flown = flown.map_err(Error::from).and_then(|outcome| {
        progress::finish(&bar);
        Ok((outcome, outputs.finish()?))
    });
    if let Some(topics) = topics
        && let Err(error) = topics.close()
    {
        say(&format!("warning: Foxglove has not seen the whole run: {error:#}"));
    }
    let (mut outcome, recording) =
        flown.or_else(|error| Err(broken(&manifest, &error, outputs.left().as_deref(), arguments.json)?))?;
    let (flight, figures) = (outcome.flight.take(), outcome.figures.take());
    let recorded = recording.as_ref().map(Recording::path);
    let profile = flight.as_ref().map(|flight| Profile::of(flight, outcome.missed_deadlines, recorded));
    let mut summary = Summary::new(manifest.name(), outcome, graph.plan.tick_s());
    summary.judge_flight(recording.as_ref(), figures.as_deref(), &graph.plan, &manifest.content)?;
    if recording.is_none() {
        summary.unevaluated = report::beyond::with_envelope(&graph.plan, &|path| graph.files.text(path).ok());
    }
    summary.warnings = graph.warnings;
    let mut text = summary.to_string();
    if let (Some(flight), Some(profile)) = (&flight, &profile) {
        let lines = files.write(&summary.manifest, flight, profile)?;
        text += &format!("\n\n{profile}\n{}", lines.join("\n"));
    }
    if let Some(path) = &summary.recording {
        text += &format!("\nto plot it: {}\nto see it fly: {}", command("plot", path), command("view", path));
    }
    let from = going_on.zip(arguments.from.clone()).map(|(tick, path)| Written { tick, path });
    text += &to_go_on(&summary, from.as_ref());
    if arguments.json {
        print_json(&as_json(&summary, profile.as_ref(), &files)?)?;
    } else if !(arguments.quiet && summary.passed) {
        print_text(&text)?;
    } else {
        summary.missed_checkpoints.iter().for_each(|missed| say(&format!("warning: {missed}")));
        summary.remarks.iter().for_each(|remark| say(&format!("warning: {remark}")));
    }
    if !summary.checkpoints.is_empty()
        && let Some(warning) = earlier.as_ref().and_then(Earlier::warning)
    {
        say(&warning);
    }
    if let Some(page) = page {
        stay(page, summary.recording.as_deref(), &stop)?;
    }
    Ok(summary.passed)
}

/// The line of the summary with the command that goes on from the checkpoint to go back to; `from` is that from which
/// the run went on.
fn to_go_on(summary: &Summary, from: Option<&Written>) -> String {
    match (summary.checkpoint_to_go_back_to(from), summary.failed_at_tick()) {
        (Some(Written { tick, path }), _) => {
            format!("\nto go on from tick {tick}: {}", command("run --from", path))
        }
        (None, Some(failed_at)) if !summary.checkpoints.is_empty() => {
            format!(
                "\nno checkpoint before tick {failed_at}, at which a condition failed first, was kept: --checkpoint-every with a \
                 shorter time writes one"
            )
        }
        (None, _) => String::new(),
    }
}

/// Serves the page of the run of `graph`, which is about to start.
fn page(port: u16, no_open: bool, graph: &Graph) -> Result<LivePage> {
    require_recorder(graph, "--view")?;
    let mut page = LivePage::open(port, no_open)?;
    page.follow(|| run_of_launcher(std::process::id()));
    say(&format!("The run in the browser: {}", page.address()));
    Ok(page)
}

/// Serves the topics of the run of `graph`, which is about to start, to Foxglove.
fn topics(address: SocketAddr, manifest: &Manifest, graph: &Graph) -> Result<LiveFoxglove> {
    require_recorder(graph, "--foxglove")?;
    LiveFoxglove::open(address, &graph.plan, &manifest.name(), || run_of_launcher(std::process::id()))
}

/// Refuses an `option` that shows the samples of a recorder in a run without one.
fn require_recorder(graph: &Graph, option: &str) -> Result<()> {
    if graph.plan.nodes.iter().any(|node| node.is_recorder) {
        return Ok(());
    }
    bail!(
        "{option} shows a run by its recording, and this run records nothing: leave out {option}, or let it record"
    )
}

/// Keeps the page of a run that has ended, for as long as it is open in a browser.
fn stay(page: LivePage, recording: Option<&Path>, stop: &StopToken) -> Result<()> {
    if stop.count() == 0 {
        recording.map_or(Ok(()), |recording| page.show_whole(recording))?;
        say("The page stays until it is closed. Ctrl-C ends it.");
        page.stay(stop, true);
    }
    page.close()
}

/// Error of a run that was refused or broke, with the path `left` of the rest of its recording. It is printed as JSON
/// too if that is requested.
fn broken(manifest: &Manifest, error: &Error, left: Option<&Path>, is_json: bool) -> Result<Error> {
    let mut text = message(error);
    if let Some(path) = left {
        text += &format!("\nWhat was recorded until then is in {}", path.display());
    }
    if is_json {
        let value = json!({
            "manifest": manifest.name(),
            "passed": false,
            "error": text,
            "recording": null,
            "partial_recording": left,
        });
        print_json(&value)?;
    }
    Ok(anyhow!(text))
}

/// The summary as JSON, with the profile and its files in it.
fn as_json(summary: &Summary, profile: Option<&Profile>, files: &Files) -> Result<Value> {
    let mut value = serde_json::to_value(summary)?;
    if let Some(profile) = profile {
        value["profile"] = serde_json::to_value(profile)?;
        value["profile"]["files"] = serde_json::to_value(files)?;
    }
    Ok(value)
}

/// The manifest that `arguments` name, or that of the checkpoint `from`, with the values that they give.
fn loaded(arguments: &RunArguments, from: Option<&Checkpoint>) -> Result<Manifest> {
    let mut set = arguments.set.clone();
    if let Some(every_s) = arguments.checkpoint_every {
        set.push(format!("run.checkpoint_every_s={every_s:?}"));
    }
    if let Some(keep) = arguments.keep {
        set.push(format!("run.checkpoint_keep={keep}"));
    }
    match (from, &arguments.manifest) {
        (Some(from), _) => Ok(from.load_manifest(&set, COMPONENTS)?),
        (None, Some(path)) => {
            require_kind(path, &[Kind::Manifest], "")?;
            Ok(Manifest::load(path, &set, COMPONENTS)?)
        }
        (None, None) => bail!("name a manifest, or a checkpoint with --from"),
    }
}

/// A time such as `1s`, `250ms` or `0.5`, in seconds.
fn seconds(text: &str) -> Result<f64, String> {
    // Divided, not multiplied by a thousandth, which no binary number is: 333.3ms are 0.3333 s.
    let (number, parts) = match (text.strip_suffix("ms"), text.strip_suffix('s')) {
        (Some(number), _) => (number, 1e3),
        (None, Some(number)) => (number, 1.0),
        (None, None) => (text, 1.0),
    };
    let time_s = number.trim().parse::<f64>().ok().map(|number| number / parts);
    time_s
        .filter(|time_s| time_s.is_finite() && *time_s > 0.0)
        .ok_or_else(|| "it is no time: write a number above 0 with its unit, such as 1s or 250ms".to_owned())
}

/// The manifest with a recorder or a judge as `record` says, the file to record to or `none`.
fn recorded(manifest: Manifest, record: Option<&Path>) -> Result<Manifest, Diagnostic> {
    let Some(record) = record else { return Ok(manifest) };
    let is_none = record.as_os_str() == NO_RECORDING;
    if is_none == manifest.content.run.is_unrecorded() {
        return Ok(manifest);
    }
    // A path of any other text: the file is that of the argument, which need not be UTF-8.
    manifest.set("run.record", if is_none { NO_RECORDING } else { "--record" })
}

/// Path of the recording: `--record`, the manifest's `record`, or beside the manifest. A run without a recording has its
/// other files beside the manifest.
fn recording_path(manifest: &Manifest, argument: Option<&Path>) -> Result<PathBuf> {
    let path = match (argument, &manifest.content.run.record) {
        _ if manifest.content.run.is_unrecorded() => manifest.path.with_extension("mcap"),
        (Some(path), _) => path.to_owned(),
        (None, Some(path)) => manifest.resolve(path)?,
        (None, None) => manifest.path.with_extension("mcap"),
    };
    std::path::absolute(&path).with_context(|| format!("{} is not a path", path.display()))
}

#[cfg(test)]
mod tests {
    use super::seconds;

    #[test]
    fn a_time_has_a_unit_or_is_in_seconds() {
        assert_eq!(["1s", "250ms", "0.5"].map(seconds), [Ok(1.0), Ok(0.25), Ok(0.5)]);
        assert_eq!(seconds("333.3ms"), Ok(0.3333));
        for text in ["0s", "-1", "ms", "1m", "inf", ""] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }
}
