//! The command `tune`: gains that make a figure of many flights smaller.

use super::campaign_engine::{build, cores, worker_command};
use super::files::require_kind;
use super::interrupts::stop_token;
use super::kind;
use super::output::{print_json, print_text, say};
use super::progress;
use anyhow::{Context, Result, bail};
use campaign::base::Base;
use campaign::flying::with_flights;
use campaign::gains_file;
use campaign::pool::Pool;
use campaign::report::{flights as count_of, with_unit};
use campaign::search::{Change, Comparison, FigureChange, Outcome, Progress, search};
use campaign::tuning::Tuning;
use campaign::worker::Order;
use clap::Args;
use hummingbus::COMPONENTS;
use inputs::InputFiles;
use runtime::output_file::{self, Kind, Mark};
use serde_json::json;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

pub const HELP: &str = "Example: hummingbus tune manifests/tune/hover.toml --out hover-gains.toml\n\n\
                        Writes a gains file if the tuned gains cost less on flights that they were not tuned on; exit code 1 if \
                        not. docs/tuning.md has the keys of tuning files.";

/// The gains file.
const GAINS: Kind = Kind { name: "tuned gains file", mark: Mark::Start(gains_file::START.as_bytes()) };
/// Progress of a tuning.
const BAR: &str = "{bar:30} {pos}/{len} generations, {eta} left  {msg}";

/// Arguments of `tune`.
#[derive(Args)]
pub struct TuneArguments {
    /// The tuning file: a campaign file with a table [tune].
    tuning: PathBuf,
    /// The gains file to write; NAME-gains.toml in the current folder where absent.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Number of worker processes; one for each core where absent.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=1024))]
    workers: Option<u16>,
    /// Print the result as JSON, and no progress.
    #[arg(long)]
    json: bool,
    /// Print no progress.
    #[arg(short, long)]
    quiet: bool,
}

/// Advice on a file of another kind.
const TUNING_FILE: &str =
    "a tuning file is a campaign file with a table [tune], such as manifests/tune/hover.toml";

/// The command `tune`; false if the tuned gains are not better.
///
/// # Errors
/// A problem in the tuning file, its manifest or the gains file, or an interrupted tuning.
pub fn tune(arguments: &TuneArguments) -> Result<bool> {
    let path = &arguments.tuning;
    require_kind(path, &[kind::Kind::Campaign], TUNING_FILE)?;
    let text = InputFiles::default().text(path).with_context(|| format!("cannot read {}", path.display()))?;
    let tuning = Tuning::parse(path, &text)?;
    let base = Base::read(&tuning.campaign, COMPONENTS)?;
    let gains = base.manifest.file_path(&tuning.process, "gains").with_context(|| {
        let process = &tuning.process;
        format!("process `{process}` names no gains file; add process.{process}.gains=\"PATH\" to `set`")
    })?;
    let out = arguments.out.clone().unwrap_or_else(|| default_out(path));
    if [path, &gains].into_iter().any(|input| output_file::is_same(&out, input)) {
        bail!("{} is an input of the tuning; name another file with --out", out.display());
    }
    output_file::check(&out, &GAINS)?;
    let mut last = None;
    let outcome = match fly(arguments, &tuning, &base, text, &mut last) {
        // A first generation takes as long as a campaign: what it found is not to be lost.
        Err(_) if stop_token()?.count() > 0 => return interrupted(arguments, &tuning, last.as_ref()),
        outcome => outcome?,
    };
    let is_better = outcome.held_out.costs.after < outcome.held_out.costs.before;
    if is_better {
        let declared = base.files.text(&gains)?;
        let text = gains_file::text(&declared, &gains, path, tuning.seed, &build()?, &outcome)?;
        output_file::write(&out, &GAINS, |file| file.write_all(text.as_bytes()))?;
    }
    if arguments.json {
        print_json(&outcome)?;
    } else {
        print_text(&summary(&outcome, is_better.then_some(&*out))?)?;
    }
    Ok(is_better)
}

/// Prints what an interrupted search has found, and ends with the reason why no file was written.
fn interrupted(arguments: &TuneArguments, tuning: &Tuning, last: Option<&Progress>) -> Result<bool> {
    let after = last.map_or_else(
        || "before the end of its first generation".to_owned(),
        |last| format!("after generation {} of {}", last.generation, tuning.generations),
    );
    let message = format!(
        "the tuning was interrupted {after}; no file was written, since other flights have not judged its gains"
    );
    if arguments.json {
        print_json(&json!({ "error": message, "faults": [], "interrupted": last }))?;
    } else if let Some(last) = last {
        print_text(&found_so_far(last)?)?;
    }
    bail!(message)
}

/// The best gains of an interrupted search.
fn found_so_far(last: &Progress) -> Result<String> {
    let Progress { generation, candidates, costs, gains } = last;
    let mut text = format!("generation {generation}, {candidates} candidates; the best one so far:\n\n");
    for gain in gains {
        writeln!(text, "  {}: {} → {}{}", gain.name, gain.before, gain.after, with_unit(&gain.unit))?;
    }
    let percent = 100.0 * costs.relative();
    write!(
        text,
        "\n  costs on the flights that it was tuned on: {:.5} → {:.5}, {percent:+.1} %",
        costs.before, costs.after
    )?;
    Ok(text)
}

/// Flies the search; `last` gets its state after each generation.
fn fly(
    arguments: &TuneArguments,
    tuning: &Tuning,
    base: &Base,
    text: String,
    last: &mut Option<Progress>,
) -> Result<Outcome> {
    let stop = stop_token()?;
    let folder = tempfile::tempdir().context("cannot make a folder for the workers")?;
    let order = Order {
        build: build()?,
        path: arguments.tuning.clone(),
        text,
        fingerprint: base.fingerprint.clone(),
        folder: folder.path().to_owned(),
    };
    let pool = Pool {
        command: &worker_command()?,
        workers: arguments.workers.map_or_else(cores, usize::from),
        order: &order,
        timeout: Duration::from_secs_f64(tuning.campaign.timeout_s_host),
    };
    let is_quiet = arguments.json || arguments.quiet;
    let bar = progress::bar(BAR, is_quiet);
    bar.set_length(tuning.generations as u64);
    let (lines, last) = (progress::Lines::default(), Mutex::new(last));
    let tell = |progress: Progress| {
        let costs = 100.0 * progress.costs.after / progress.costs.before;
        bar.set_position(progress.generation as u64);
        bar.set_message(format!("lowest costs: {costs:.1} % of today's"));
        let line = format!(
            "tuning: generation {} of {}, lowest costs {costs:.1} % of today's",
            progress.generation, tuning.generations
        );
        if bar.is_hidden() && !is_quiet && lines.is_due(&line, bar.elapsed()) {
            say(&line);
        }
        **last.lock().unwrap_or_else(PoisonError::into_inner) = Some(progress);
    };
    let outcome = with_flights(&pool, &stop, |flying| search(tuning, base, flying, &tell));
    progress::finish(&bar);
    outcome
}

fn default_out(path: &Path) -> PathBuf {
    PathBuf::from(format!("{}-gains.toml", path.file_stem().unwrap_or_default().to_string_lossy()))
}

/// The result for people; `out` is the gains file if one was written.
fn summary(outcome: &Outcome, out: Option<&Path>) -> Result<String> {
    let mut text = format!("{} generations, {} candidates\n\n", outcome.generations, outcome.candidates);
    for gain in &outcome.gains {
        writeln!(text, "  {}: {} → {}{}", gain.name, gain.before, gain.after, with_unit(&gain.unit))?;
    }
    writeln!(text, "\n{}", compared("tuned on", &outcome.tuned_on)?)?;
    writeln!(text, "{}", compared("judged by other flights:", &outcome.held_out)?)?;
    match out {
        Some(out) => write!(text, "gains: {}", out.display())?,
        None => write!(text, "no gains were written: today's are as good or better on the other flights")?,
    }
    Ok(text)
}

fn compared(title: &str, comparison: &Comparison) -> Result<String> {
    let Comparison { flights, costs, standard_error, failed, figures, .. } = comparison;
    let percent = 100.0 * costs.relative();
    let error = 100.0 * standard_error / costs.before;
    let mut text = format!("{title} {}\n", count_of(*flights as u64));
    writeln!(
        text,
        "  costs: {:.5} → {:.5}, {percent:+.1} % (standard error {error:.1} %)",
        costs.before, costs.after
    )?;
    for (figure, FigureChange { change: Change { before, after }, unit }) in figures {
        writeln!(text, "  {figure}: {before:.5} → {after:.5}{}", with_unit(unit))?;
    }
    writeln!(text, "  flights with a condition that does not hold: {} → {}", failed.before, failed.after)?;
    Ok(text)
}
