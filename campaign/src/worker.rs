//! A worker: a process that flies the flights that it is handed, one after the other.
//!
//! It reads one JSON value a line from standard input, first an [`Order`], then a [`Job`] for each flight, and answers each
//! with a line on standard output: a [`Greeting`], then a [`Row`] for each flight. It ends when its input ends, or with its
//! parent.

use crate::base::Base;
use crate::declaration::Campaign;
use crate::row::Row;
use anyhow::{Context, Result, bail};
use report::summary::Summary;
use runtime::registry::Registry;
use rustix::process::{Signal, set_parent_process_death_signal};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};

/// Campaign that a worker flies for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// Build of hummingbus that the rows are of.
    pub build: String,
    /// Path of the campaign file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// Digest of all inputs, as the parent read them.
    pub fingerprint: String,
    /// Folder in which each worker has a folder of its own; the parent makes and removes it.
    pub folder: PathBuf,
}

/// A flight to fly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Number of the flight.
    pub flight: u64,
    /// Its overrides.
    pub sets: Vec<String>,
}

/// First answer of a worker.
#[derive(Debug, Serialize, Deserialize)]
pub enum Greeting {
    /// It has read what it needs.
    Ready,
    /// It cannot fly; the reason.
    Refused(String),
}

/// Standard output for answers. Whatever a component prints goes to standard error from here on: the parent reads answers only.
///
/// # Errors
/// If the descriptors cannot be duplicated.
pub fn take_output() -> std::io::Result<File> {
    let output = File::from(rustix::io::dup(std::io::stdout())?);
    rustix::stdio::dup2_stdout(std::io::stderr())?;
    Ok(output)
}

/// Flies what `input` hands out, with the components of `registry`, until it ends. `build` names this program.
///
/// # Errors
/// If input or output break, or a line is not what is expected.
pub fn serve(registry: Registry, build: &str, input: impl BufRead, mut output: impl Write) -> Result<()> {
    // A flight that hangs must not outlive the campaign.
    set_parent_process_death_signal(Some(Signal::KILL)).context("cannot bind the worker to its parent")?;
    let mut lines = input.lines();
    let order = lines.next().context("expected the order, found nothing")??;
    let order: Order = serde_json::from_str(&order)?;
    let folder = tempfile::tempdir_in(&order.folder);
    let folder = folder.with_context(|| format!("cannot make a folder in {}", order.folder.display()))?;
    let base = match prepare(&order, build, registry) {
        Ok(base) => base,
        Err(error) => return answer(&mut output, &Greeting::Refused(format!("{error:#}"))),
    };
    answer(&mut output, &Greeting::Ready)?;
    for line in lines {
        let job: Job = serde_json::from_str(&line?)?;
        answer(&mut output, &fly(&base, &job, folder.path()))?;
    }
    Ok(())
}

fn answer(output: &mut impl Write, value: &impl Serialize) -> Result<()> {
    writeln!(output, "{}", serde_json::to_string(value)?)?;
    Ok(output.flush()?)
}

fn prepare(order: &Order, build: &str, registry: Registry) -> Result<Base> {
    if order.build != build {
        bail!(
            "this is hummingbus {build}, the campaign was started by hummingbus {}: rows of two builds are not mixed; install \
             the same build here and there",
            order.build
        );
    }
    let campaign = Campaign::parse(&order.path, &order.text)?;
    let base = Base::read(&campaign, registry)?;
    if base.fingerprint != order.fingerprint {
        bail!("the manifest or a file that it names changed while the campaign flew; start it again");
    }
    Ok(base)
}

/// The row of one flight; what goes wrong is in it.
fn fly(base: &Base, job: &Job, folder: &Path) -> Row {
    let flown = fly_once(base, job, folder);
    flown.unwrap_or_else(|error| Row::broken(job.flight, format!("{error:#}")))
}

fn fly_once(base: &Base, job: &Job, folder: &Path) -> Result<Row> {
    let manifest = base.of_flight(&job.sets)?;
    let mut outcome = runtime::fly_unrecorded(&manifest, base.files.branch(), folder, base.from.as_ref())?;
    let figures = outcome.figures.take().context("the judge left no figures")?;
    let tick_s = 1.0 / f64::from(*manifest.content.run.rate_hz.get_ref());
    let mut summary = Summary::new(manifest.name(), outcome, tick_s);
    summary.judge_by(&figures, &manifest.content)?;
    Ok(Row::of(job.flight, &summary, &manifest.content))
}
