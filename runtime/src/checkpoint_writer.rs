//! Checkpoints that a run writes: those of its plan, and those requested in flight.

use crate::checkpoint::{Checkpoint, Written, path};
use crate::graph::Graph;
use crate::instances::{Flown, Instances};
use crate::manifest::Manifest;
use anyhow::{Context as _, Result, anyhow, bail};
use bus::checkpoint::{Cause, Parts};
use bus::component::{Failure, Transfer};
use diagnostics::printable_line;
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
    /// Forgets those behind `tick`, to whose checkpoint in `path` the run goes back. If `path` is of another flight, all are
    /// forgotten but it: those before it are of a flight that the run no longer continues.
    pub(crate) fn go_back(&self, tick: u32, path: &Path) {
        let lists = [&self.planned, &self.asked];
        let is_known = lists.iter().any(|files| files.borrow().iter().any(|written| written.path == path));
        for files in lists {
            files.borrow_mut().retain(|written| is_known && written.tick <= tick);
        }
        if !is_known {
            self.asked.borrow_mut().push(Written { tick, path: path.to_owned() });
        }
    }

    /// Adds a checkpoint that was asked for. Another one in its file is gone.
    fn add_asked(&self, written: Written) {
        for files in [&self.planned, &self.asked] {
            files.borrow_mut().retain(|other| other.path != written.path);
        }
        self.asked.borrow_mut().push(written);
    }

    /// Adds a checkpoint of the plan, and returns the oldest if there are more than `keep` beside that of tick `pinned`. One that
    /// was also asked for stays in the other list, so that it is not removed.
    fn add_planned(&self, written: Written, keep: usize, pinned: Option<u32>) -> Option<Written> {
        if self.asked.borrow().contains(&written) {
            return None;
        }
        self.asked.borrow_mut().retain(|other| other.path != written.path);
        let mut planned = self.planned.borrow_mut();
        planned.push(written);
        let is_free = |written: &Written| pinned != Some(written.tick);
        let free = planned.iter().filter(|written| is_free(written)).count();
        let oldest = planned.iter().position(is_free).filter(|_| free > keep)?;
        Some(planned.remove(oldest))
    }

    /// The newest checkpoint of the plan up to tick `until`.
    fn newest_planned(&self, until: u32) -> Option<Written> {
        let planned = self.planned.borrow();
        let before = planned.iter().filter(|written| written.tick <= until);
        before.max_by_key(|written| written.tick).cloned()
    }

    /// The newest checkpoint of the plan or of a request up to tick `until`.
    fn newest_up_to(&self, until: u32) -> Option<Written> {
        let asked = self.asked.borrow();
        let asked = asked.iter().filter(|written| written.tick <= until).cloned();
        asked.chain(self.newest_planned(until)).max_by_key(|written| written.tick)
    }

    /// The newest before tick `now`: that of `tick`, if it is given.
    ///
    /// # Errors
    /// If there is none.
    fn newest(&self, tick: Option<u32>, now: u32) -> Result<Written> {
        let (planned, asked) = (self.planned.borrow(), self.asked.borrow());
        let mut all: Vec<&Written> = planned.iter().chain(&*asked).collect();
        all.sort_by_key(|written| written.tick);
        let fits = |written: &&&Written| tick.map_or(written.tick < now, |tick| written.tick == tick);
        if let Some(found) = all.iter().rfind(fits) {
            return Ok((**found).clone());
        }
        let wanted = tick.map_or_else(|| format!("before tick {now}"), |tick| format!("of tick {tick}"));
        all.dedup_by_key(|written| written.tick);
        let ticks: Vec<String> = all.iter().map(|written| written.tick.to_string()).collect();
        let known = match &ticks[..] {
            [] => "the run has written none".to_owned(),
            [tick] => format!("the run has one of tick {tick}"),
            ticks => format!("the run has those of the ticks {}", ticks.join(", ")),
        };
        Err(anyhow!(
            "there is no checkpoint of this run {wanted}: {known}; `run --checkpoint-every` and `ctl checkpoint` write them; \
             or name a file"
        ))
    }
}

/// Checkpoint that a run can go back to.
pub(crate) struct Found {
    /// The first tick that is computed again.
    pub tick: u32,
    /// Its file.
    pub path: PathBuf,
    /// The graph of the run that goes on from it.
    pub graph: Graph,
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
    pub(crate) instances: &'a Instances,
}

impl Writer<'_> {
    /// Writes the requested checkpoint of `tick` to `path`, or beside the recording, once its nodes have written
    /// their parts; `None` before.
    pub(crate) fn write_asked(&self, tick: u32, path: Option<&Path>) -> Result<Option<PathBuf>> {
        let path = path.map_or_else(|| self::path(self.stem, tick), Path::to_owned);
        let Some(parts) = self.parts(Cause::Request, tick)? else { return Ok(None) };
        let written = self.put(parts, &path);
        Parts::remove_written(self.run_dir, Cause::Request, tick);
        written.with_context(|| format!("no checkpoint of tick {tick}"))?;
        self.files.add_asked(Written { tick, path: path.clone() });
        Ok(Some(path))
    }

    /// Writes the checkpoint from which the run goes on to `path`, or beside the recording: at its first tick the run is what
    /// that checkpoint holds.
    pub(crate) fn write_source(&self, path: Option<&Path>) -> Result<PathBuf> {
        let source = self.graph.source.as_ref().context("the run does not go on from a checkpoint")?;
        let source = Checkpoint::from_bytes(source)?;
        let path = path.map_or_else(|| self::path(self.stem, source.tick()), Path::to_owned);
        source.of_run(self.manifest, self.graph).write(&path)?;
        self.files.add_asked(Written { tick: source.tick(), path: path.clone() });
        Ok(path)
    }

    /// The parts of the checkpoint of `tick`, once its nodes have written them.
    fn parts(&self, cause: Cause, tick: u32) -> Result<Option<Parts>> {
        Ok(Parts::written(self.run_dir, cause, tick, self.graph.plan.nodes.len())?)
    }

    /// The checkpoint in `file`, or this run's checkpoint of `tick`, or its newest one before tick `now`. The
    /// run has come to tick `now`.
    ///
    /// # Errors
    /// If there is none, it is one of another run, it lies ahead, or nothing can go on from it.
    pub(crate) fn find(&self, tick: Option<u32>, file: Option<&Path>, now: u32) -> Result<Found> {
        let (path, expected) = match file {
            Some(file) => (file.to_owned(), None),
            None => {
                let Written { tick, path } = self.files.newest(tick, now)?;
                (path, Some(tick))
            }
        };
        let found = Checkpoint::read(&path)?;
        if let Some(expected) = expected.filter(|expected| *expected != found.tick()) {
            let (path, found) = (path.display(), found.tick());
            bail!(
                "{path} was replaced since this run has written it: it is of tick {found}, and was of tick {expected}"
            );
        }
        let parts = Parts { tick: now, nodes: Vec::new() };
        let of_now = Checkpoint::new(self.manifest, self.graph, parts, Flown::default());
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
        let graph = self.from(&found).with_context(|| format!("cannot go back to {}", path.display()))?;
        Ok(Found { tick: found.tick(), path, graph })
    }

    /// The graph of the run again, from `checkpoint` on; a shadow that the manifest does not name flies again. A run that is
    /// profiled stays so.
    fn from(&self, checkpoint: &Checkpoint) -> Result<Graph> {
        let mut again = Graph::build_from(self.manifest, self.graph.files.branch())?;
        again.plan.profile = self.graph.plan.profile;
        for backup in &self.graph.backups {
            let is_named = again.backups.iter().any(|other| other.node == backup.node);
            if backup.take_over_tick.is_none() && !is_named {
                again.backups.push(backup.clone());
            }
        }
        checkpoint.resume(self.manifest, &mut again, true)?;
        Ok(again)
    }

    fn put(&self, parts: Parts, path: &Path) -> Result<()> {
        let flown = self.instances.flown(self.graph, &parts)?;
        let nodes = self.graph.plan.nodes.iter();
        for (node, (_, program)) in nodes.zip(&flown.processes) {
            if let Some(Transfer::External(what)) = program.component().map(|component| component.transfer) {
                bail!("the state of `{}` is in {what}, which does not tell it", node.name);
            }
        }
        Ok(Checkpoint::new(self.manifest, self.graph, parts, flown).write(path)?)
    }
}

/// Checkpoints that could not be written for one reason.
struct Missed {
    first: u32,
    last: u32,
    count: u32,
    /// Error of the first.
    error: anyhow::Error,
}

impl std::fmt::Display for Missed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { first, last, count, error } = self;
        match count {
            1 => write!(f, "no checkpoint of tick {first}: {error:#}"),
            _ => write!(
                f,
                "{count} checkpoints from tick {first} to tick {last} are missing; the first: {error:#}"
            ),
        }
    }
}

/// Collects the parts that the nodes of a run write for the checkpoints of its plan.
pub(crate) struct Collector<'a> {
    pub(crate) writer: Writer<'a>,
    /// The checkpoint that comes next.
    next: Option<u32>,
    /// Checkpoints that could not be written.
    missed: Vec<Missed>,
    /// True if requests can steer the run.
    is_steered: bool,
    /// True if a condition is known to fail.
    has_failed: bool,
    /// The newest checkpoint before the failure, which is kept.
    pinned: Option<u32>,
    /// Messages that the user has not seen.
    notes: Vec<String>,
}

impl<'a> Collector<'a> {
    /// The collector of the checkpoints that `writer` writes; `is_steered` says that requests can steer the run.
    pub(crate) fn new(writer: Writer<'a>, is_steered: bool) -> Self {
        let plan = &writer.graph.plan;
        Self {
            writer,
            next: plan.checkpoint_after(plan.first_tick),
            missed: Vec::new(),
            is_steered,
            has_failed: false,
            pinned: None,
            notes: Vec::new(),
        }
    }

    /// Writes the files of the checkpoints that are complete.
    pub(crate) fn collect(&mut self) {
        while let Some(tick) = self.next {
            match self.writer.parts(Cause::Plan, tick) {
                Ok(Some(parts)) => self.add(parts),
                Ok(None) if !self.is_passed(tick) => return,
                Ok(None) => self.miss(tick, anyhow!("a process that was replaced has left its part out")),
                Err(error) => self.miss(tick, error),
            }
            Parts::remove_written(self.writer.run_dir, Cause::Plan, tick);
            self.next = self.writer.graph.plan.checkpoint_after(tick);
        }
    }

    /// True if the checkpoint after that of `tick` is complete: the processes write their parts in the order of the ticks.
    fn is_passed(&self, tick: u32) -> bool {
        let Writer { graph, run_dir, .. } = self.writer;
        let next = graph.plan.checkpoint_after(tick);
        next.is_some_and(|next| Parts::are_written(run_dir, Cause::Plan, next, graph.plan.nodes.len()))
    }

    /// Writes the file of `parts`, and removes the oldest where fewer are kept.
    pub(crate) fn add(&mut self, parts: Parts) {
        let (tick, path) = (parts.tick, path(self.writer.stem, parts.tick));
        let failure = self.failure(&parts);
        if let Err(error) = self.writer.put(parts, &path) {
            return self.miss(tick, error);
        }
        let Writer { manifest, files, .. } = self.writer;
        if let (false, Some((condition, failed_at))) = (self.has_failed, failure) {
            let before = files.newest_up_to(failed_at);
            self.notes.push(self.failure_note(&condition, failed_at, before.as_ref()));
            (self.has_failed, self.pinned) =
                (true, files.newest_planned(failed_at).map(|written| written.tick));
        }
        let keep = manifest.content.run.checkpoint_keep.as_ref().map_or(usize::MAX, |keep| *keep.get_ref());
        if let Some(oldest) = files.add_planned(Written { tick, path }, keep, self.pinned) {
            // A user who has removed or replaced it meanwhile has done so on purpose.
            let _ = std::fs::remove_file(oldest.path);
        }
    }

    /// The condition that failed first and its tick, if the judge has seen one before `parts`.
    fn failure(&self, parts: &Parts) -> Option<(String, u32)> {
        let Graph { plan, programs, .. } = self.writer.graph;
        let judges = programs.iter().zip(&parts.nodes);
        let failures = judges.filter_map(|(program, part)| program.component()?.first_failure?(part.state()));
        let Failure { condition, time_ns } = failures.min_by_key(|failure| failure.time_ns)?;
        Some((condition, u32::try_from(time_ns / plan.tick_ns).ok()?))
    }

    /// The message that `condition` failed at tick `failed_at`, after the checkpoint `before`.
    fn failure_note(&self, condition: &str, failed_at: u32, before: Option<&Written>) -> String {
        let plan = &self.writer.graph.plan;
        let (condition, time_s) = (printable_line(condition), f64::from(failed_at) * plan.tick_s());
        let first = plan.first_tick;
        let advice = match before {
            Some(Written { tick, path }) => {
                let path = path.display();
                let way = match self.is_steered {
                    true => {
                        format!("`hummingbus ctl pause`, then `hummingbus ctl rewind {tick}` go back there")
                    }
                    false => "`hummingbus run --from` goes on from there".to_owned(),
                };
                format!("the checkpoint before it is {path}; {way}")
            }
            None if first == 0 => "the run has written no checkpoint before it".to_owned(),
            None if failed_at < first => {
                format!("the run goes on from a later checkpoint, of tick {first}")
            }
            None => format!("the checkpoint before it is that of tick {first}, from which the run goes on"),
        };
        format!("warning: condition `{condition}` failed at tick {failed_at} ({time_s:.3} s): {advice}")
    }

    /// The messages since the last look.
    pub(crate) fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Notes that the checkpoint of `tick` cannot be written.
    fn miss(&mut self, tick: u32, error: anyhow::Error) {
        let cause = error.root_cause().to_string();
        let is_alike = |missed: &&mut Missed| missed.error.root_cause().to_string() == cause;
        match self.missed.last_mut().filter(is_alike) {
            Some(missed) => (missed.last, missed.count) = (tick, missed.count + 1),
            None => self.missed.push(Missed { first: tick, last: tick, count: 1, error }),
        }
    }

    /// The files of the plan that the run has left, and in words those that could not be written.
    pub(crate) fn finish(mut self) -> (Vec<Written>, Vec<String>) {
        self.collect();
        let missed = self.missed.iter().map(ToString::to_string).collect();
        (self.writer.files.planned.borrow().clone(), missed)
    }
}

#[cfg(test)]
mod tests {
    use super::{Written, WrittenFiles};
    use std::path::Path;

    fn written(tick: u32) -> Written {
        Written { tick, path: format!("a.{tick}.ckpt").into() }
    }

    #[test]
    fn a_rewind_finds_what_this_run_has_written_and_not_left() {
        let files = WrittenFiles::default();
        let error = files.newest(None, 500).unwrap_err().to_string();
        assert!(error.contains("before tick 500: the run has written none"), "{error}");
        for tick in [100, 300, 500] {
            assert_eq!(files.add_planned(written(tick), 9, None), None);
        }
        files.add_asked(written(200));
        let newest = |tick, now| files.newest(tick, now).unwrap();
        assert_eq!(newest(None, 500), written(300));
        assert_eq!(newest(None, 300), written(200));
        assert_eq!(newest(Some(100), 500), written(100));
        files.go_back(200, &written(200).path);
        assert_eq!(newest(None, 900), written(200));
        let error = files.newest(Some(300), 900).unwrap_err().to_string();
        assert!(error.contains("of tick 300: the run has those of the ticks 100, 200;"), "{error}");
        // To a checkpoint that it has not written: the flight before it is another one.
        files.go_back(150, Path::new("other.ckpt"));
        assert_eq!(newest(None, 900).path, Path::new("other.ckpt"));
        assert!(files.newest(Some(100), 900).is_err());
    }

    #[test]
    fn a_file_has_one_checkpoint_and_one_that_was_asked_for_is_kept() {
        let files = WrittenFiles::default();
        let in_one_file = |tick| Written { tick, path: "x.ckpt".into() };
        files.add_asked(in_one_file(100));
        files.add_asked(in_one_file(250));
        assert!(files.newest(Some(100), 400).is_err(), "its file has that of tick 250");
        assert_eq!(files.newest(Some(250), 400).unwrap(), in_one_file(250));
        files.add_asked(written(300));
        assert_eq!(files.add_planned(written(300), 1, None), None);
        assert_eq!(files.add_planned(written(400), 1, None), None);
        assert_eq!(files.add_planned(written(500), 1, None), Some(written(400)));
        assert_eq!(files.newest(Some(300), 900).unwrap(), written(300));
    }

    #[test]
    fn the_checkpoint_before_a_failure_is_kept_beside_the_newest() {
        let files = WrittenFiles::default();
        for tick in [100, 200, 300] {
            assert_eq!(files.add_planned(written(tick), 3, None), None);
        }
        assert_eq!((files.newest_planned(250), files.newest_planned(99)), (Some(written(200)), None));
        let removed = [400, 500, 600].map(|tick| files.add_planned(written(tick), 3, Some(200)));
        assert_eq!(removed, [None, Some(written(100)), Some(written(300))]);
    }
}
