//! Checkpoints that a run writes: those of its plan, and those requested in flight.

use crate::checkpoint::{Checkpoint, Written, path};
use crate::graph::Graph;
use crate::manifest::Manifest;
use crate::program::{BackupSpec, OnExit, unsaved};
use anyhow::{Context as _, Result, anyhow, bail};
use bus::checkpoint::{NodePart, Parts};
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Checkpoints of a run so far, each the oldest first. A run that goes back forgets those behind the tick to which it does:
/// they are of a flight that it has left.
#[derive(Default)]
pub(crate) struct WrittenFiles {
    /// Checkpoints of its plan that still exist.
    planned: RefCell<Vec<Written>>,
    /// Requested checkpoints.
    asked: RefCell<Vec<Written>>,
}

impl WrittenFiles {
    /// Forgets those behind `tick`.
    pub(crate) fn go_back(&self, tick: u32) {
        for files in [&self.planned, &self.asked] {
            files.borrow_mut().retain(|written| written.tick <= tick);
        }
    }

    /// The newest before tick `now`: that of `tick`, if it is given.
    ///
    /// # Errors
    /// If there is none.
    fn newest(&self, tick: Option<u32>, now: u32) -> Result<PathBuf> {
        let (planned, asked) = (self.planned.borrow(), self.asked.borrow());
        let mut all: Vec<&Written> = planned.iter().chain(&*asked).collect();
        all.sort_by_key(|written| written.tick);
        let fits = |written: &&&Written| tick.map_or(written.tick < now, |tick| written.tick == tick);
        if let Some(found) = all.iter().rfind(fits) {
            return Ok(found.path.clone());
        }
        let wanted = tick.map_or_else(|| format!("before tick {now}"), |tick| format!("of tick {tick}"));
        let ticks: Vec<String> = all.iter().map(|written| written.tick.to_string()).collect();
        let known = match &ticks[..] {
            [] => "it has written none".to_owned(),
            ticks => format!("it has those of {}", ticks.join(", ")),
        };
        Err(anyhow!(
            "there is no checkpoint of this run {wanted}: {known}; `run --checkpoint-every` and `ctl checkpoint` write them; \
             or name a file"
        ))
    }
}

/// Writes the checkpoints of a run.
#[derive(Clone, Copy)]
pub(crate) struct Writer<'a> {
    pub(crate) manifest: &'a Manifest,
    pub(crate) graph: &'a Graph,
    pub(crate) run_dir: &'a Path,
    /// Path of the files without `.TICK.ckpt`.
    pub(crate) stem: &'a Path,
    pub(crate) files: &'a WrittenFiles,
}

impl Writer<'_> {
    /// Writes the requested checkpoint of `tick` to `path`, or beside the recording, once its nodes have written
    /// their parts; `None` before.
    pub(crate) fn write_asked(&self, tick: u32, path: Option<&Path>) -> Result<Option<PathBuf>> {
        let written = self.write(tick, path)?;
        if let Some(path) = &written {
            self.files.asked.borrow_mut().push(Written { tick, path: path.clone() });
        }
        Ok(written)
    }

    fn write(&self, tick: u32, path: Option<&Path>) -> Result<Option<PathBuf>> {
        let Some(parts) = Parts::written(self.run_dir, tick, self.graph.plan.nodes.len())? else {
            return Ok(None);
        };
        let path = path.map_or_else(|| self::path(self.stem, tick), Path::to_owned);
        self.put(parts, &path)?;
        Parts::remove_written(self.run_dir, tick);
        Ok(Some(path))
    }

    /// The checkpoint in `file`, or that of `tick` which this run has written, or its newest one before tick `now`,
    /// which the run has reached; with the graph that goes on from it.
    ///
    /// # Errors
    /// If there is none, it belongs to another run, it lies ahead, or no run can go on from it.
    pub(crate) fn find(
        &self,
        tick: Option<u32>,
        file: Option<&Path>,
        now: u32,
    ) -> Result<(Checkpoint, Graph)> {
        let path = file.map_or_else(|| self.files.newest(tick, now), |file| Ok(file.to_owned()))?;
        let found = Checkpoint::read(&path)?;
        let of_now = Checkpoint::new(self.manifest, self.graph, Parts { tick: now, nodes: Vec::new() });
        if !found.is_of_run_of(&of_now) {
            bail!(
                "{} is a checkpoint of another run: its manifest, one of its files or a value of --set is another one; \
                 `hummingbus run --from {0}` goes on from it",
                path.display()
            );
        }
        if found.tick() >= now {
            bail!(
                "the checkpoint is of tick {}, and the run is at tick {now}: a rewind goes back",
                found.tick()
            );
        }
        let again = self.from(&found).with_context(|| format!("cannot go back to {}", path.display()))?;
        Ok((found, again))
    }

    /// The graph of the run again, from `checkpoint` on; a shadow that the manifest does not name flies again.
    fn from(&self, checkpoint: &Checkpoint) -> Result<Graph> {
        let mut again = Graph::build_from(self.manifest, self.graph.files.branch())?;
        for backup in &self.graph.backups {
            let is_named = again.backups.iter().any(|other| other.node == backup.node);
            if backup.take_over_tick.is_none() && !is_named {
                again.backups.push(backup.clone());
            }
        }
        checkpoint.resume(&mut again, true)?;
        Ok(again)
    }

    /// True if the process that has written `part` is the one that the manifest states for node `index` at `tick`.
    fn is_planned(&self, index: usize, part: &NodePart, tick: u32) -> bool {
        let Graph { plan, backups, programs, .. } = self.graph;
        let is_swap = |backup: &&BackupSpec| backup.node == index && backup.has_taken_over(tick);
        let swaps: Vec<&BackupSpec> = backups.iter().filter(is_swap).collect();
        let plan = swaps.last().map_or(&plan.nodes[index], |backup| &backup.plan);
        // A restarted process is the same as its predecessor.
        let is_restarted = programs[index].on_exit == OnExit::Restart;
        part.is_of(plan) && (is_restarted || part.generation as usize == swaps.len())
    }

    fn put(&self, parts: Parts, path: &Path) -> Result<()> {
        let (graph, tick) = (self.graph, parts.tick);
        if let Some((node, program)) = unsaved(&graph.plan, &graph.programs, &graph.backups, tick) {
            bail!(
                "no checkpoint of tick {tick}: the state of `{node}` is in {program}, which does not tell it"
            );
        }
        for (index, part) in parts.nodes.iter().enumerate() {
            if !self.is_planned(index, part, tick) {
                bail!(
                    "no checkpoint of tick {tick}: another process has taken the place of `{}`, and the manifest, by which a run \
                     goes on, does not say which",
                    part.name
                );
            }
        }
        Checkpoint::new(self.manifest, graph, parts).write(path)
    }
}

/// Collects the parts that the nodes of a run write for the checkpoints of its plan.
pub(crate) struct Collector<'a> {
    pub(crate) writer: Writer<'a>,
    /// The checkpoint that comes next.
    next: Option<u32>,
    /// Error of the checkpoint that could not be written.
    failed: Option<anyhow::Error>,
}

impl<'a> Collector<'a> {
    /// The collector of the checkpoints that `writer` writes.
    pub(crate) fn new(writer: Writer<'a>) -> Self {
        let plan = &writer.graph.plan;
        Self { writer, next: plan.checkpoint_after(plan.first_tick), failed: None }
    }

    /// Writes the files of the checkpoints that are complete.
    pub(crate) fn collect(&mut self) {
        while self.failed.is_none()
            && let Some(tick) = self.next
        {
            match self.writer.write(tick, None) {
                Ok(Some(path)) => self.note(tick, path),
                Ok(None) => return,
                Err(error) => self.failed = Some(error),
            }
        }
    }

    /// Writes the file of `parts`.
    pub(crate) fn add(&mut self, parts: Parts) {
        let (tick, path) = (parts.tick, path(self.writer.stem, parts.tick));
        match self.writer.put(parts, &path) {
            Ok(()) => self.note(tick, path),
            Err(error) => self.failed = self.failed.take().or(Some(error)),
        }
    }

    /// Notes that the checkpoint of `tick` is written to `path`, and removes the oldest where fewer are kept.
    fn note(&mut self, tick: u32, path: PathBuf) {
        let Writer { manifest, graph, files, .. } = self.writer;
        self.next = graph.plan.checkpoint_after(tick);
        let mut written = files.planned.borrow_mut();
        written.push(Written { tick, path });
        let keep = manifest.content.run.checkpoint_keep.as_ref().map_or(usize::MAX, |keep| *keep.get_ref());
        if written.len() > keep {
            // A user who has removed or replaced it meanwhile has done so on purpose.
            let _ = std::fs::remove_file(written.remove(0).path);
        }
    }

    /// The files of the plan that the run has left.
    ///
    /// # Errors
    /// If one could not be written.
    pub(crate) fn finish(mut self) -> Result<Vec<Written>> {
        self.collect();
        match self.failed.take() {
            Some(error) => {
                Err(error.context("the run was flown, but not every checkpoint of it was written"))
            }
            None => Ok(self.writer.files.planned.borrow().clone()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Written, WrittenFiles};

    fn written(tick: u32) -> Written {
        Written { tick, path: format!("a.{tick}.ckpt").into() }
    }

    #[test]
    fn a_rewind_finds_what_this_run_has_written_and_not_left() {
        let files = WrittenFiles::default();
        let error = files.newest(None, 500).unwrap_err().to_string();
        assert!(error.contains("before tick 500: it has written none"), "{error}");
        files.planned.borrow_mut().extend([100, 300, 500].map(written));
        files.asked.borrow_mut().push(written(200));
        let tick_of = |tick, now| files.newest(tick, now).unwrap();
        assert_eq!(tick_of(None, 500), written(300).path);
        assert_eq!(tick_of(None, 300), written(200).path);
        assert_eq!(tick_of(Some(100), 500), written(100).path);
        files.go_back(200);
        assert_eq!(tick_of(None, 900), written(200).path);
        let error = files.newest(Some(300), 900).unwrap_err().to_string();
        assert!(error.contains("of tick 300: it has those of 100, 200;"), "{error}");
    }
}
