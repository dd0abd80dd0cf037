//! Files that a run writes at its user's paths: checked before anything starts, claimed while the run flies.
//!
//! A second run that would write to one of them is refused at its start; the error names the first run.

use crate::checkpoint::{self, CHECKPOINT};
use crate::claimed_file::{LogClaim, Partial, partial_path, with_suffix};
use crate::graph::Graph;
use crate::manifest::Manifest;
use crate::output_file::{self, Kind, LOG, RECORDING, is_same};
use crate::program::Program;
use crate::run_dir::{self, RunDir};
use anyhow::{Context, bail};
use diagnostics::Error;
use recorder::reader::Recording;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Number of attempts to claim a file that no run lists as its own, and the pause between two attempts. Its owner may
/// be about to list it, or about to leave.
const ATTEMPTS: u32 = 100;
const POLL: Duration = Duration::from_millis(20);
/// Checkpoints whose places are looked at before the run: of a thousand more the names differ by a number only.
const CHECKPOINTS_CHECKED: usize = 100;
/// The file in a run directory that lists the files that the run writes.
const LIST: &str = "outputs.json";

/// A file that a run writes.
#[derive(Debug)]
pub struct Output {
    /// Description of the file, in messages.
    pub what: String,
    /// Path as the user spelled it.
    pub path: PathBuf,
    /// Its kind.
    pub kind: &'static Kind,
    /// Advice for choosing another path.
    pub advice: String,
}

/// The files that a run writes.
///
/// ```
/// # use bus::Registration;
/// # use runtime::{graph::Graph, manifest::ManifestBuilder, registry::Registry};
/// use runtime::outputs::Outputs;
/// # const COMPONENTS: Registry = Registry::new(&[Registration::of::<recorder::node::Recorder>()]);
/// # let folder = tempfile::tempdir()?;
/// # let recorder = ManifestBuilder::new().set("process.recorder.kind", "recorder").set("run.duration_s", 2.0);
/// # let manifest = recorder.build(&folder.path().join("a.toml"), COMPONENTS)?;
/// # let graph = Graph::build(&manifest)?;
/// let path = folder.path().join("a.mcap");
/// assert!(Outputs::of(&manifest, &graph, &path, Vec::new()).is_ok());
/// std::fs::write(&path, "a letter")?;
/// assert!(Outputs::of(&manifest, &graph, &path, Vec::new()).is_err(), "it would be lost");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Outputs {
    recording: Option<Output>,
    /// The recording's path without its ending, or that which it would have.
    pub(crate) stem: PathBuf,
    /// The logs in the order of their real paths, so that no two runs wait for each other.
    logs: Vec<Output>,
    partial: Option<Partial>,
    claimed_logs: Vec<LogClaim>,
}

impl Outputs {
    /// The recording of `graph` at `recording`, if it has a recorder, and its logs; `pages` are written behind the run.
    ///
    /// # Errors
    /// If one of them would replace a file of another kind, an input of the run, or another of them.
    pub fn of(
        manifest: &Manifest,
        graph: &Graph,
        recording: &Path,
        pages: Vec<Output>,
    ) -> Result<Self, Error> {
        let stem = recording.with_extension("");
        let has_recorder = graph.programs.iter().any(Program::is_recorder);
        let recording = has_recorder.then(|| Output {
            what: "the recording".to_owned(),
            path: recording.to_owned(),
            kind: &RECORDING,
            advice: "give this run a recording of its own with --record PATH".to_owned(),
        });
        let mut logs = logs(graph);
        logs.sort_by_key(|log| output_file::real_path(&log.path).ok());
        let inputs = inputs(manifest, graph);
        let partial = recording.as_ref().map(Output::until_complete).transpose()?;
        let plan = &graph.plan;
        let checkpoints = plan.checkpoint_after(plan.first_tick);
        let checkpoints = std::iter::successors(checkpoints, |&tick| plan.checkpoint_after(tick));
        let checkpoints = checkpoints.take(CHECKPOINTS_CHECKED).map(|tick| checkpoint(&stem, tick));
        let checkpoints: Vec<Output> = checkpoints.collect();
        let all: Vec<&Output> =
            recording.iter().chain(&partial).chain(&logs).chain(&pages).chain(&checkpoints).collect();
        require_separate(&all, &inputs)?;
        Ok(Self { recording, stem, logs, partial: None, claimed_logs: Vec::new() })
    }

    /// Claims all for the run in `run_dir`, which must be registered already, and empties the logs.
    ///
    /// # Errors
    /// If another run writes to one of them; the error names it.
    pub(crate) fn claim(&mut self, run_dir: &RunDir) -> anyhow::Result<()> {
        if let Some(recording) = &self.recording {
            let partial = recording.claimed(Partial::claim)?;
            if partial.path.to_str().is_none() {
                bail!("cannot record to {}: its name is not UTF-8", partial.path.display());
            }
            self.partial = Some(partial);
        }
        // A run that goes back goes on in its logs.
        let is_first = self.claimed_logs.is_empty();
        for log in self.logs.iter().filter(|_| is_first) {
            self.claimed_logs.push(log.claimed(LogClaim::claim)?);
        }
        self.publish(run_dir)?;
        let mut fresh = self.claimed_logs.iter_mut().filter(|_| is_first);
        fresh.try_for_each(LogClaim::begin)
    }

    /// Path to which the recording of a run is moved at rewind `number`, if it has one.
    pub(crate) fn place_aside(&self, number: usize) -> Option<PathBuf> {
        let recording = self.recording.as_ref()?;
        let real = output_file::real_path(&recording.path).ok()?;
        Some(with_suffix(&real, &aside(number)))
    }

    /// Keeps the recording of a run that goes back for the `number`th time beside its place; returns its path.
    ///
    /// # Errors
    /// If something lies there that must not be replaced.
    pub(crate) fn set_aside(&mut self, number: usize) -> anyhow::Result<Option<PathBuf>> {
        let Some(partial) = self.partial.take() else { return Ok(None) };
        partial.set_aside(&aside(number)).map(Some)
    }

    /// Lists the files that the run has claimed, for runs that find them claimed.
    fn publish(&self, run_dir: &RunDir) -> anyhow::Result<()> {
        let all = self.recording.iter().chain(&self.logs);
        let paths = all.map(|output| output_file::real_path(&output.path));
        let paths = paths.map(|path| Ok(path?.to_string_lossy().into_owned()));
        let text = serde_json::to_vec(&paths.collect::<anyhow::Result<Vec<String>>>()?)?;
        std::fs::write(run_dir.path().join(LIST), text).context("cannot write to the run directory")
    }

    /// Path to which the unfinished recording of an earlier run was moved, if there was one.
    pub(crate) fn kept(&self) -> Option<&Path> {
        self.partial.as_ref()?.kept.as_deref()
    }

    /// Path of the file that the recorder writes.
    pub(crate) fn partial(&self) -> Option<&Path> {
        self.partial.as_ref().map(|partial| &*partial.path)
    }

    /// Puts the recording of a run that has ended in order in its place. Returns it, read from the file that this run
    /// has written, even if its path has another file by now.
    ///
    /// # Errors
    /// If it is not complete, or something must not be replaced: then it stays where it was written.
    pub fn finish(&mut self) -> Result<Option<Recording>, Error> {
        let (Some(partial), Some(recording)) = (&self.partial, &self.recording) else { return Ok(None) };
        let flown = Recording::of_file(&partial.file, &recording.path)?;
        partial.finish()?;
        self.partial = None;
        Ok(Some(flown))
    }

    /// Path of the incomplete recording of a broken run, if there is one. A file without a message, of a run that
    /// never flew, is removed.
    pub fn left(&mut self) -> Option<PathBuf> {
        let is_blank = |partial: &&Partial| {
            let whole = Recording::of_file(&partial.file, &partial.path);
            partial.is_there() && whole.is_ok_and(|recording| recording.messages().next().is_none())
        };
        if let Some(blank) = self.partial.as_ref().filter(is_blank) {
            blank.remove();
            self.partial = None;
        }
        let partial = self.partial.as_ref().filter(|partial| !partial.is_empty() && partial.is_there());
        partial.map(Partial::current_path)
    }
}

/// Refuses files of which one would replace a file of another kind, one of `inputs`, or another of them.
fn require_separate(all: &[&Output], inputs: &[PathBuf]) -> anyhow::Result<()> {
    for (index, output) in all.iter().enumerate() {
        output_file::check(&output.path, output.kind)?;
        let path = output.path.display();
        if let Some(other) = all[..index].iter().find(|other| is_same(&other.path, &output.path)) {
            bail!("{path} is to be {} and {}: give each a file of its own", other.what, output.what);
        }
        if let Some(input) = inputs.iter().find(|input| is_same(input, &output.path)) {
            bail!(
                "{path} cannot be {}: the run reads it, as {}; name another file",
                output.what,
                input.display()
            );
        }
    }
    Ok(())
}

impl Output {
    /// The file that this recording is while the run flies.
    fn until_complete(&self) -> anyhow::Result<Self> {
        let path = partial_path(&output_file::real_path(&self.path)?)?;
        let what = "the recording until it is complete".to_owned();
        Ok(Self { what, path, kind: self.kind, advice: self.advice.clone() })
    }

    /// Claims its path with `claim`, and returns the result.
    fn claimed<T>(&self, claim: impl Fn(&Path) -> anyhow::Result<Option<T>>) -> anyhow::Result<T> {
        for _ in 0..ATTEMPTS {
            if let Some(claimed) = claim(&self.path)? {
                return Ok(claimed);
            }
            if let Some(run) = writer_of(&output_file::real_path(&self.path)?) {
                bail!("{}: {run} writes to it now; {}", self.refused(), self.advice);
            }
            std::thread::sleep(POLL);
        }
        bail!(
            "{}: another process writes to it now, which is no run of this user on this machine; {}",
            self.refused(),
            self.advice
        )
    }

    fn refused(&self) -> String {
        format!("{} cannot be {}", self.path.display(), self.what)
    }
}

/// End of the name of a recording that is kept at rewind `number`.
fn aside(number: usize) -> String {
    format!(".rewind-{number}")
}

/// The checkpoint of `tick`, beside the recording.
fn checkpoint(stem: &Path, tick: u32) -> Output {
    let what = format!("the checkpoint of tick {tick}");
    let advice = "name another recording with --record PATH".to_owned();
    Output { what, path: checkpoint::path(stem, tick), kind: &CHECKPOINT, advice }
}

/// The live run that writes to the file at `real`, as text for a message.
fn writer_of(real: &Path) -> Option<String> {
    let run = run_dir::live_runs().into_iter().find(|run| {
        let list = std::fs::read(run.entry.run_dir.join(LIST)).ok();
        let paths: Vec<String> = list.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default();
        paths.iter().any(|path| is_same(Path::new(path), real))
    })?;
    let entry = &run.entry;
    Some(format!("run {} of {} (launcher {})", entry.run_id, entry.manifest.display(), entry.launcher))
}

/// The logs that the processes of `graph` name, each once: a backup writes to that of its predecessor.
fn logs(graph: &Graph) -> Vec<Output> {
    let nodes = graph.programs.iter().zip(&graph.plan.nodes).map(|(program, node)| (&node.name, program));
    let sidecars = graph.sidecars.iter().map(|(name, program)| (name, program));
    let backups = graph.backups.iter().map(|other| (&other.plan.name, &other.program));
    let mut logs: Vec<Output> = Vec::new();
    for (name, program) in nodes.chain(sidecars).chain(backups) {
        let Some(path) = &program.log else { continue };
        let what = format!("the log of `{name}`");
        if !logs.iter().any(|log| log.what == what && is_same(&log.path, path)) {
            let advice = format!("give it another with --set process.{name}.log=PATH");
            logs.push(Output { what, path: path.clone(), kind: &LOG, advice });
        }
    }
    logs
}

/// The files that a run of `graph` reads.
fn inputs(manifest: &Manifest, graph: &Graph) -> Vec<PathBuf> {
    let included = manifest.included().map(|(path, _)| path.to_owned());
    let nodes = graph.plan.nodes.iter().chain(graph.backups.iter().map(|backup| &backup.plan));
    let of_nodes = nodes.flat_map(|node| node.files.clone());
    let files = of_nodes.chain(graph.files.used()).map(|file| file.path);
    std::iter::once(manifest.path.clone()).chain(included).chain(files).collect()
}
