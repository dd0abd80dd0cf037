//! Checkpoint files: everything that another run needs to go on from a tick, written beside their place and renamed.
//!
//! A file holds the saved parts of the nodes, the manifest's path with the SHA-256 of its texts, and the values of
//! `--set`. It also holds the SHA-256 of every file that the run has read. A run that goes on from it loads the
//! manifest again and refuses texts and files that have changed since.

use crate::fork;
use crate::graph::{Graph, backup_of};
use crate::instances::{Flown, Requested};
use crate::manifest::Manifest;
use crate::output_file::{self, Kind, Mark};
use crate::program::{BackupSpec, Executable, Origin, Program};
use crate::registry::Registry;
use anyhow::{Context as _, anyhow, bail};
use bus::checkpoint::{NodePart, Parts};
use bus::plan::NodePlan;
use diagnostics::{Diagnostic, Error};
use inputs::{InputFile, sha256};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};

/// The first bytes of a checkpoint of any format: one of an earlier format may be replaced.
const MARK: &[u8] = b"hummingbus checkpoint ";
/// The first bytes of a checkpoint; the digit counts the changes of the format.
const START: &[u8] = b"hummingbus checkpoint 4\n";
/// Characters of a SHA-256 in hexadecimal, which the file ends with.
const SUM_BYTES: usize = 64;
/// Ending of the name of a file.
const ENDING: &str = "ckpt";
/// The largest file that is read.
const BYTES_MAX: u64 = 4 << 30;
/// The version of the program that goes on from a checkpoint must be that which has written it.
const VERSION: &str = env!("CARGO_PKG_VERSION");
/// The kind of the file.
pub(crate) const CHECKPOINT: Kind = Kind { name: "checkpoint", mark: Mark::Start(MARK) };

/// A checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Version of the program that has written it.
    version: String,
    /// The manifest's file, absolute.
    manifest: PathBuf,
    /// The manifest and its includes, with their SHA-256.
    texts: Vec<(PathBuf, String)>,
    /// The values of `--set`.
    overrides: Vec<String>,
    /// Processes that fly at its tick.
    processes: Vec<Process>,
    /// Swaps under way at its tick that were requested in flight.
    requested: Vec<Requested>,
    /// Files that backups requested in flight have read, with their SHA-256.
    requested_files: Vec<(PathBuf, String)>,
    /// Files that the run has read, with their SHA-256.
    files: Vec<(PathBuf, String)>,
    /// Simulated time of a tick, ns.
    tick_ns: u64,
    parts: Parts,
}

/// Process that flies a node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Process {
    node: String,
    /// Kind or command.
    kind: String,
    origin: Origin,
}

impl Checkpoint {
    /// The checkpoint with `parts` of the run of `manifest`, checked as `graph`, of whose processes `flown` are in the
    /// places of others at its tick.
    pub(crate) fn new(manifest: &Manifest, graph: &Graph, parts: Parts, flown: Flown) -> Self {
        let Flown { processes, requested, files: requested_files } = flown;
        let process = |(node, (origin, program)): (&NodePlan, (Origin, Program))| Process {
            node: node.name.clone(),
            kind: kind_of(&program),
            origin,
        };
        let file = |file: InputFile| (file.path, file.sha256);
        Self {
            version: VERSION.to_owned(),
            manifest: std::path::absolute(&manifest.path).unwrap_or_else(|_| manifest.path.clone()),
            texts: texts(manifest).collect(),
            overrides: manifest
                .overrides()
                .filter(|text| !is_of_recording(text))
                .map(str::to_owned)
                .collect(),
            processes: graph.plan.nodes.iter().zip(processes).map(process).collect(),
            requested,
            requested_files: requested_files.into_iter().map(file).collect(),
            files: files(graph).cloned().map(file).collect(),
            tick_ns: graph.plan.tick_ns,
            parts,
        }
    }

    /// Reads the checkpoint at `path`.
    ///
    /// # Errors
    /// If it cannot be read, is not a checkpoint of this version of the program, or is damaged.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let about = || format!("cannot go on from {}", path.display());
        let mut bytes = Vec::new();
        let mut file = std::fs::File::open(path).map_err(|error| missing(path, error)).with_context(about)?;
        // Of a file that is not a checkpoint only the beginning is read.
        (&mut file).take(START.len() as u64).read_to_end(&mut bytes).with_context(about)?;
        if bytes == START {
            file.take(BYTES_MAX).read_to_end(&mut bytes).with_context(about)?;
        }
        Ok(Self::from_bytes(&bytes).with_context(about)?)
    }

    /// The checkpoint whose file has these `bytes`.
    ///
    /// # Errors
    /// If it is none of this version of the program, or damaged.
    pub(crate) fn from_bytes(bytes: &[u8]) -> anyhow::Result<Self> {
        if !bytes.starts_with(MARK) {
            bail!(
                "it is no checkpoint of hummingbus; `run` writes them with --checkpoint-every or [[checkpoint]]"
            );
        }
        if !bytes.starts_with(START) {
            bail!(
                "another version of hummingbus has written it, in another format; go on from it with that version"
            );
        }
        let (content, sum) = bytes.split_at(bytes.len().saturating_sub(SUM_BYTES).max(START.len()));
        if sha256(content).as_bytes() != sum {
            bail!("it is damaged: its SHA-256 is not the one at its end");
        }
        let found: Self = postcard::from_bytes(&content[START.len()..])
            .map_err(|error| anyhow!("it is damaged: {error}"))?;
        if found.version != VERSION {
            bail!(
                "hummingbus {} has written it, and this is {VERSION}: states may mean something else; go on from it with \
                 that version",
                found.version
            );
        }
        Ok(found)
    }

    /// Writes the checkpoint to `path`, in the place of nothing or of a checkpoint.
    ///
    /// # Errors
    /// If it cannot be written, or something else would be lost.
    pub(crate) fn write(&self, path: &Path) -> Result<(), Error> {
        let bytes = self.bytes()?;
        output_file::write(path, &CHECKPOINT, |out| out.write_all(&bytes))
    }

    /// The bytes of its file.
    fn bytes(&self) -> anyhow::Result<Vec<u8>> {
        let mut bytes = START.to_vec();
        bytes.extend(postcard::to_stdvec(self).context("cannot put the checkpoint into bytes")?);
        let sum = sha256(&bytes);
        bytes.extend(sum.as_bytes());
        Ok(bytes)
    }

    /// True if it is of the run that would write `other` now.
    pub(crate) fn is_of_run_of(&self, other: &Self) -> bool {
        let simulated = |checkpoint: &Self| -> Vec<String> {
            let overrides = checkpoint.overrides.iter();
            overrides.filter(|text| Manifest::is_of_simulation(text)).cloned().collect()
        };
        (&self.manifest, &self.texts, self.tick_ns) == (&other.manifest, &other.texts, other.tick_ns)
            && simulated(self) == simulated(other)
            && self.files == other.files
    }

    /// The first tick that a run computes which goes on from here.
    #[must_use]
    pub fn tick(&self) -> u32 {
        self.parts.tick
    }

    /// Simulation time at the start of that tick, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        f64::from(self.tick()) * self.tick_ns as f64 * 1e-9
    }

    /// The manifest of the run.
    #[must_use]
    pub fn manifest_path(&self) -> &Path {
        &self.manifest
    }

    /// The nodes and the bytes of their states.
    pub fn nodes(&self) -> impl Iterator<Item = (&str, usize)> {
        self.parts.nodes.iter().map(|part| (part.name.as_str(), part.state_bytes()))
    }

    /// The manifest of the run, loaded again, with further `overrides`.
    ///
    /// # Errors
    /// If one of its files has changed, or a value does not fit.
    pub fn load_manifest(&self, overrides: &[String], registry: Registry) -> Result<Manifest, Error> {
        if !self.manifest.exists() {
            let path = self.manifest.display();
            return Err(anyhow!(
                "the manifest of the checkpoint, {path}, is no longer there: `run --from` reads it where it was; put it back there"
            )
            .into());
        }
        let all: Vec<String> = self.overrides.iter().chain(overrides).cloned().collect();
        let manifest = Manifest::load(&self.manifest, &all, registry)?;
        if !overrides.is_empty() {
            let before = Manifest::load(&self.manifest, &self.overrides, registry)?;
            fork::require_effective(&before, &manifest, self.tick())?;
        }
        for (path, found) in texts(&manifest) {
            let known = self.texts.iter().find(|(known, _)| *known == path);
            let (_, expected) = known.ok_or_else(|| {
                anyhow!(
                    "the manifest includes {}, which it did not when the checkpoint was written",
                    path.display()
                )
            })?;
            require_same(&path, expected, &found)?;
        }
        Ok(manifest)
    }

    /// The manifest `before` with further `overrides`, of a run that goes on from here.
    ///
    /// # Errors
    /// If a value does not fit, or counts at the start of a run alone.
    pub fn fork_manifest(&self, before: &Manifest, overrides: &[String]) -> Result<Manifest, Diagnostic> {
        let manifest = before.overridden(overrides)?;
        fork::require_effective(before, &manifest, self.tick()).map(|()| manifest)
    }

    /// SHA-256 of its content, without the values of `--set` that change no byte of a recording.
    ///
    /// # Panics
    /// Never: its types serialise.
    #[must_use]
    pub fn sha256(&self) -> String {
        let overrides = self.overrides.iter().filter(|text| Manifest::is_of_simulation(text));
        let bytes = postcard::to_stdvec(&Self { overrides: overrides.cloned().collect(), ..self.clone() });
        sha256(&bytes.unwrap_or_else(|error| unreachable!("its types serialise: {error}")))
    }

    /// Makes the run of `manifest`, checked as `graph`, go on from here; `is_changed` says that it has other values than the run
    /// that has written the checkpoint.
    ///
    /// # Errors
    /// If it is another run: a file has changed, a node is not in it, or its ticks are others.
    pub fn resume(&self, manifest: &Manifest, graph: &mut Graph, is_changed: bool) -> Result<(), Error> {
        let replaced = self.take_over(manifest, graph)?;
        self.require_same_run(graph, is_changed)?;
        graph.begun = replaced;
        let nodes = self.parts_for(graph)?;
        graph.plan.first_tick = self.tick();
        graph.from = Some(Parts { tick: self.tick(), nodes });
        graph.source = Some(self.bytes()?);
        Ok(())
    }

    /// The same checkpoint for the run of `manifest`, checked as `graph`, which goes on from it, perhaps with other values.
    pub(crate) fn of_run(&self, manifest: &Manifest, graph: &Graph) -> Self {
        let parts = Parts { tick: self.tick(), nodes: Vec::new() };
        let now = Self::new(manifest, graph, parts, Flown::default());
        Self { texts: now.texts, overrides: now.overrides, files: now.files, ..self.clone() }
    }

    /// Refuses the run of `graph` if it reads other files, or its ticks are others.
    fn require_same_run(&self, graph: &Graph, is_changed: bool) -> anyhow::Result<()> {
        for InputFile { path, sha256, .. } in files(graph) {
            let mut known = self.files.iter().chain(&self.requested_files);
            match known.find(|(known, _)| known == path) {
                // A copy with values of `--set` lies nowhere, and is another one by right.
                Some(_) if is_changed && !path.exists() => {}
                Some((_, expected)) => require_same(path, expected, sha256)?,
                None if is_changed => {}
                None => bail!("the run reads {}, which it did not before the checkpoint", path.display()),
            }
        }
        let (tick, plan) = (self.tick(), &graph.plan);
        if plan.tick_ns != self.tick_ns {
            bail!("a tick of the checkpoint is {} ns, and one of the run {} ns", self.tick_ns, plan.tick_ns);
        }
        if tick >= plan.duration_ticks {
            bail!(
                "the checkpoint is of tick {tick}, and the run ends at tick {}: raise run.duration_s",
                plan.duration_ticks
            );
        }
        Ok(())
    }

    /// The parts of the nodes of `graph`, in their order.
    fn parts_for(&self, graph: &Graph) -> anyhow::Result<Vec<NodePart>> {
        let plan = &graph.plan;
        let nodes =
            plan.nodes.iter().zip(&graph.programs).map(|(node, program)| self.part(&node.name, program));
        let nodes = nodes.collect::<anyhow::Result<Vec<_>>>()?;
        self.require_samples(graph)?;
        let is_flown = |name: &str| plan.nodes.iter().any(|node| node.name == name);
        if let Some(part) =
            self.parts.nodes.iter().find(|part| part.state_bytes() > 0 && !is_flown(&part.name))
        {
            bail!("the checkpoint holds the state of `{}`, which is no process of the run", part.name);
        }
        Ok(nodes)
    }

    /// Puts the processes that fly at its tick into the places of those before them, and returns their origins, by node. Backups
    /// that have joined before its tick join again at it.
    fn take_over(&self, manifest: &Manifest, graph: &mut Graph) -> anyhow::Result<BTreeMap<usize, Origin>> {
        let tick = self.tick();
        let requested = |node: &str, with: &str| {
            let backup = backup_of(manifest, &graph.plan, &graph.files, node, with);
            backup.with_context(|| format!("the swap of `{node}` that was requested in flight"))
        };
        let mut flying = BTreeMap::new();
        for Process { node, origin, .. } in &self.processes {
            if let Ok(index) = graph.plan.node_index(node) {
                let backup = match origin {
                    Origin::Request(with) => Some(requested(node, with)?),
                    _ => None,
                };
                flying.insert(index, (origin.clone(), backup));
            }
        }
        let under_way = self.requested.iter().map(|Requested { node, with, take_over_tick }| {
            let backup = requested(node, with);
            backup.map(|backup| BackupSpec { take_over_tick: Some(*take_over_tick), ..backup })
        });
        let under_way = under_way.collect::<anyhow::Result<Vec<_>>>()?;
        let (mut replaced, planned) = (BTreeMap::new(), Origin::Plan);
        let due = |backup: &BackupSpec| tick.next_multiple_of(backup.plan.period_ticks.max(1));
        for backup in std::mem::take(&mut graph.backups) {
            let (node, due) = (backup.node, due(&backup));
            let origin = flying.get(&node).map_or(&planned, |(origin, _)| origin);
            let is_origin = !backup.is_shadow() && *origin == Origin::of(&backup);
            let is_done =
                backup.take_over_tick.is_some_and(|at| at <= due) || is_origin && !backup.is_standby;
            if is_origin || is_done && *origin == Origin::Plan {
                replaced.insert(node, Origin::of(&backup));
                put(graph, backup.clone());
            }
            if !is_done {
                // It has no part of its own: it goes on from the state of the process before.
                graph.backups.push(BackupSpec { join_tick: backup.join_tick.max(due), ..backup });
            }
        }
        let join = |backup: BackupSpec| BackupSpec { join_tick: due(&backup), ..backup };
        graph.backups.extend(under_way.into_iter().map(join));
        graph.backups.sort_by_key(|backup| (backup.join_tick, backup.node));
        for (node, (origin, backup)) in flying {
            if let Some(backup) = backup {
                replaced.insert(node, origin);
                put(graph, backup);
            }
        }
        Ok(replaced)
    }

    /// Refuses a graph in which a node reads a topic without a sample before the checkpoint and without one at its
    /// tick.
    fn require_samples(&self, graph: &Graph) -> anyhow::Result<()> {
        let (tick, plan) = (self.tick(), &graph.plan);
        let is_due = |backup: &&BackupSpec| backup.join_tick < tick + backup.plan.period_ticks.max(1);
        let joining = graph.backups.iter().filter(is_due).map(|backup| (&backup.plan, &backup.program));
        for (node, program) in plan.nodes.iter().zip(&graph.programs).chain(joining) {
            for input in node.inputs.iter().filter(|_| !program.is_recorder() && !program.is_judge()) {
                let topic = &plan.topics[input.topic];
                let due = tick.next_multiple_of(node.period_ticks.max(1));
                let newest = due.checked_sub(input.delay_ticks).map(|limit| topic.ticks.newest(limit));
                let is_sent_in_time = newest.is_some_and(|newest| newest >= tick);
                if !is_sent_in_time && input.initial.is_none() && !self.parts.has_sample_of(&topic.name) {
                    bail!(
                        "`{}` reads {}, of which the checkpoint holds no sample, since nobody has read it before: record the run \
                         that writes the checkpoint",
                        node.name,
                        topic.name
                    );
                }
            }
        }
        Ok(())
    }

    /// The part of the node `name`, which is `program`; an empty one for a recorder, which begins a file of its own.
    fn part(&self, name: &str, program: &Program) -> anyhow::Result<NodePart> {
        if program.is_recorder() {
            return Ok(NodePart::stateless(name));
        }
        let part = self.parts.nodes.iter().find(|part| part.name == name).cloned();
        let kind = kind_of(program);
        if self.processes.iter().any(|process| process.node == name && process.kind != kind) {
            return part.map(NodePart::succeeded).context("it has a kind and no part");
        }
        part.ok_or_else(|| {
            if program.is_judge() {
                return anyhow!(
                    "the checkpoint holds nothing of the conditions so far, since the run before was recorded and judged after \
                     its end: fly it again with --checkpoint-every or [[checkpoint]]"
                );
            }
            let known: Vec<&str> = self.nodes().map(|(name, _)| name).collect();
            anyhow!("the checkpoint holds no state of `{name}`; it has {}", known.join(", "))
        })
    }
}

/// Kind or command of `program`.
fn kind_of(program: &Program) -> String {
    match (&program.executable, program.kind()) {
        (Executable::Command(command), _) => command.join(" "),
        (_, kind) => kind.unwrap_or_default().to_owned(),
    }
}

/// Puts `backup` into the place of the process of its node.
fn put(graph: &mut Graph, backup: BackupSpec) {
    let BackupSpec { node, plan, program, .. } = backup;
    for group in &mut graph.plan.groups {
        let place = group.members.iter().position(|member| member.node == node);
        match (place, program.component()) {
            (Some(place), Some(component)) => component.name.clone_into(&mut group.members[place].kind),
            (Some(place), None) => drop(group.members.remove(place)),
            (None, _) => {}
        }
    }
    // As after a take-over in flight, the node's answer to the end of its process stays.
    let (on_exit, restarts) = (graph.programs[node].on_exit, graph.plan.nodes[node].restarts);
    graph.programs[node] = Program { on_exit, ..program };
    graph.plan.nodes[node] = NodePlan { restarts, ..plan };
}

/// The files that the nodes of `graph` read: those of a recorder are the manifest's.
fn files(graph: &Graph) -> impl Iterator<Item = &InputFile> {
    let nodes = graph.plan.nodes.iter().filter(|node| !node.is_recorder);
    nodes.chain(graph.backups.iter().map(|backup| &backup.plan)).flat_map(|node| &node.files)
}

/// The files that `manifest` is made of, with their SHA-256.
fn texts(manifest: &Manifest) -> impl Iterator<Item = (PathBuf, String)> {
    let first = std::iter::once((manifest.path.as_path(), manifest.text()));
    let all = first.chain(manifest.included());
    all.map(|(path, text)| {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        (path, sha256(text.as_bytes()))
    })
}

fn require_same(path: &Path, expected: &str, found: &str) -> anyhow::Result<()> {
    if expected == found {
        return Ok(());
    }
    let short = |sum: &str| sum.chars().take(12).collect::<String>();
    bail!(
        "{} has changed since the checkpoint was written: expected SHA-256 {}… as in the checkpoint, found {}…; put the \
         former file in its place, or fly from the start; use --set to change values of the continued run",
        path.display(),
        short(expected),
        short(found)
    )
}

/// True for a value of `--set` that says where a run is recorded to.
fn is_of_recording(text: &str) -> bool {
    text.split('=').next().is_some_and(|key| key.trim() == "run.record")
}

/// A checkpoint that a run has written.
///
/// ```
/// let written = runtime::checkpoint::Written { tick: 6500, path: "a.6500.ckpt".into() };
/// assert_eq!(serde_json::to_value(written)?["tick"], 6500);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Written {
    /// The first tick that a run computes which goes on from it.
    pub tick: u32,
    /// The file.
    pub path: PathBuf,
}

/// The file of the checkpoint at `tick` of a run whose recording is `stem` with `.mcap`.
pub(crate) fn path(stem: &Path, tick: u32) -> PathBuf {
    let mut name = stem.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{tick}.ckpt"));
    stem.with_file_name(name)
}

/// Folder of manifests in a project, beside which their runs write.
const MANIFESTS: &str = "manifests";
/// Checkpoints that a message names at most.
const NAMED_MAX: usize = 5;

/// The error of a checkpoint at `path` that cannot be opened; if there is no such file, with the checkpoints near it.
fn missing(path: &Path, error: std::io::Error) -> std::io::Error {
    if error.kind() != std::io::ErrorKind::NotFound {
        return error;
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut known = [checkpoints_in(folder), checkpoints_in(&folder.join(MANIFESTS))].concat();
    known.sort_by_cached_key(|path| run_and_tick(path));
    let mut named: Vec<String> =
        known.iter().take(NAMED_MAX).map(|path| path.display().to_string()).collect();
    if known.len() > NAMED_MAX {
        named.push(format!("{} more", known.len() - NAMED_MAX));
    }
    let advice = match &named[..] {
        [] => "`run --checkpoint-every 1s` and `ctl checkpoint` write checkpoints".to_owned(),
        [one] => format!("the checkpoint near it is {one}"),
        [most @ .., last] => format!("the checkpoints near it are {} and {last}", most.join(", ")),
    };
    std::io::Error::new(error.kind(), format!("there is no such file; {advice}"))
}

/// The name of a checkpoint at `path` without its tick, and the tick.
fn run_and_tick(path: &Path) -> (PathBuf, Option<u32>) {
    let name = path.with_extension("");
    match name.extension().and_then(|tick| tick.to_str()?.parse().ok()) {
        Some(tick) => (name.with_extension(""), Some(tick)),
        None => (name, None),
    }
}

/// The files in `folder` that are called like checkpoints.
fn checkpoints_in(folder: &Path) -> Vec<PathBuf> {
    let read = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(read).into_iter().flatten().flatten();
    let paths = entries.map(|entry| folder.join(entry.file_name()));
    paths.filter(|path| path.extension().is_some_and(|ending| ending == ENDING)).collect()
}

#[cfg(test)]
mod tests {
    use super::{Checkpoint, START, VERSION, path, require_same, sha256};
    use bus::checkpoint::{NodePart, Parts};
    use std::path::Path;

    fn checkpoint() -> Checkpoint {
        let nodes = vec![NodePart::stateless("plant")];
        Checkpoint {
            version: VERSION.to_owned(),
            manifest: "/a/hover.toml".into(),
            texts: vec![("/a/hover.toml".into(), sha256(b"[run]"))],
            overrides: vec!["run.seed=3".to_owned()],
            processes: Vec::new(),
            requested: Vec::new(),
            requested_files: Vec::new(),
            files: Vec::new(),
            tick_ns: 1_000_000,
            parts: Parts { tick: 6500, nodes },
        }
    }

    #[test]
    fn a_checkpoint_that_is_not_there_is_refused_with_those_that_are() {
        let folder = tempfile::tempdir().unwrap();
        let error = |path: &str| Checkpoint::read(&folder.path().join(path)).unwrap_err().with_causes();
        let found = error("b.ckpt");
        assert!(found.contains("there is no such file; `run --checkpoint-every 1s`"), "{found}");
        std::fs::create_dir(folder.path().join("manifests")).unwrap();
        for name in ["a.100.ckpt", "a.mcap", "manifests/c.9.ckpt"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let found = error("b.ckpt");
        let listed = ["a.100.ckpt", "manifests/c.9.ckpt"].map(|name| folder.path().join(name));
        let listed = format!("near it are {} and {}", listed[0].display(), listed[1].display());
        assert!(found.ends_with(&listed), "{found}");
        for tick in [9, 20, 1000, 3000, 20_000, 100_000] {
            std::fs::write(folder.path().join(format!("a.{tick}.ckpt")), "").unwrap();
        }
        let found = error("b.ckpt");
        let listed = [9, 20, 100, 1000, 3000].map(|tick| folder.path().join(format!("a.{tick}.ckpt")));
        let listed = listed.map(|path| path.display().to_string()).join(", ");
        assert!(found.ends_with(&format!("near it are {listed} and 3 more")), "{found}");
    }

    #[test]
    fn the_digest_leaves_out_values_that_change_no_recording() {
        let set = |text: &str| {
            let mut changed = checkpoint();
            changed.overrides.push(text.to_owned());
            changed.sha256()
        };
        assert_eq!(set("run.checkpoint_keep=5"), checkpoint().sha256());
        assert_ne!(set("run.duration_s=5"), checkpoint().sha256());
    }

    #[test]
    fn what_was_written_is_read_and_every_changed_byte_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.6500.ckpt");
        checkpoint().write(&file).unwrap();
        let read = Checkpoint::read(&file).unwrap();
        assert_eq!((read.tick(), read.time_s()), (6500, 6.5));
        assert_eq!(read, checkpoint());
        let bytes = std::fs::read(&file).unwrap();
        for index in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[index] ^= 1;
            assert!(Checkpoint::from_bytes(&damaged).is_err(), "byte {index}");
            assert!(Checkpoint::from_bytes(&bytes[..index]).is_err(), "cut at {index}");
        }
    }

    #[test]
    fn another_version_and_another_file_are_named() {
        let mut old = checkpoint();
        old.version = "0.0.1".to_owned();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.ckpt");
        old.write(&file).unwrap();
        let error = Checkpoint::read(&file).unwrap_err().with_causes();
        assert!(error.contains("a.ckpt") && error.contains("hummingbus 0.0.1 has written it"), "{error}");
        let error = Checkpoint::from_bytes(b"a letter").unwrap_err().to_string();
        assert!(error.contains("no checkpoint"), "{error}");
        let mut future = START.to_vec();
        future[START.len() - 2] = b'9';
        let error = Checkpoint::from_bytes(&future).unwrap_err().to_string();
        assert!(error.contains("another format"), "{error}");
    }

    #[test]
    fn a_file_that_has_changed_is_refused_with_its_digest_and_that_of_the_checkpoint() {
        let require = |found| require_same(Path::new("m.toml"), "0123456789abcdef", found);
        require("0123456789abcdef").unwrap();
        let error = require("fedcba9876543210").unwrap_err().to_string();
        assert!(
            error.contains("expected SHA-256 0123456789ab… as in the checkpoint, found fedcba987654…"),
            "{error}"
        );
    }

    #[test]
    fn a_file_is_called_after_the_recording_and_the_tick() {
        assert_eq!(path(Path::new("/a/b.c"), 7), Path::new("/a/b.c.7.ckpt"));
    }
}
