//! Flights on a cluster: chunks of the plan as tasks of a Slurm job array, whose rows are taken as they come.
//!
//! Slurm places the tasks, and starts those of a node that fails again. A task that has ended for another reason before its
//! flights were flown is submitted again for the rest of them. The job arrays outlive the campaign's process: the next call
//! takes the rows that came meanwhile, and waits for the arrays that are still there.

use crate::chunk::{Reader, Shared, Task};
use crate::row::Row;
use crate::slurm::{self, States, Submission, TaskState};
use crate::worker::Job;
use anyhow::{Context, Result, bail};
use bus::host_time::monotonic_ns;
use runtime::event::StopToken;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::Duration;

/// Host time between two looks at the rows.
const LOOK: Duration = Duration::from_millis(200);
/// Host time between two questions to Slurm: at first, and at most.
const QUESTION_NS: (u64, u64) = (1_000_000_000, 16_000_000_000);
/// Host time for which Slurm's controller may fail to answer, or refuse what it took before.
const SILENCE_NS: u64 = 900_000_000_000;
/// Host time within which cancelled tasks end: Slurm's KillWait is 30 s.
const END_NS: u64 = 45_000_000_000;
/// Answers in a row by which a task has ended: its last rows may come late over a network file system.
const ENDS_SEEN: usize = 2;
/// Attempts at a chunk, none of which flew a flight, before its flights are given up.
const ATTEMPTS: usize = 3;

/// A Slurm cluster.
pub struct Cluster<'a> {
    /// Folder on a file system that all nodes share; made by the first call and removed when every flight has a row.
    pub folder: &'a Path,
    /// Shell script that each task runs; it comes to [`Shared::fly`].
    pub script: &'a str,
    /// Flights of a task.
    pub chunk: usize,
    /// Inputs and limits of all tasks.
    pub task: &'a Task,
    /// Options of the user for `sbatch`.
    pub options: &'a [String],
    /// Tells a person what was submitted, and why again.
    pub tell: &'a dyn Fn(&str),
}

/// A chunk that has flights without a row.
#[derive(Debug)]
struct Chunk {
    missing: BTreeSet<u64>,
    /// The job array in which it is flown.
    array: String,
    /// Attempts so far, since the last one that flew a flight; 0 before the first.
    attempts: usize,
    has_flown: bool,
    ends_seen: usize,
}

impl Cluster<'_> {
    /// Flies `jobs`; hands each row to `take` as it comes. Cancels the tasks once `stop` is used.
    ///
    /// # Errors
    /// If Slurm refuses the tasks, they are cancelled, no task flies a flight, or `take` fails.
    pub fn fly(&self, jobs: &[Job], stop: &StopToken, mut take: impl FnMut(Row) -> Result<()>) -> Result<()> {
        let mut flights = Flights { wanted: jobs.iter().map(|job| (job.flight, job)).collect(), flown: 0 };
        let shared = Shared::new(self.folder);
        let mut array = match self.attach(&shared, &mut flights, stop, &mut take)? {
            Some(array) => array,
            None if flights.wanted.is_empty() => return Ok(()),
            None => self.begin(shared, &flights)?,
        };
        let end = array.wait(self, &mut flights, stop, &mut take);
        if end.is_err() || stop.count() > 0 {
            let cancelled = array.cancel(&mut flights, stop, &mut take);
            // The first error is the reason.
            end.and(cancelled)?;
        }
        if flights.wanted.is_empty() && !array.has_given_up {
            let _ = std::fs::remove_dir_all(self.folder);
        }
        Ok(())
    }

    /// Takes the rows of an earlier call; its job arrays if they are still flying the same flights.
    fn attach(
        &self,
        shared: &Shared,
        flights: &mut Flights<'_>,
        stop: &StopToken,
        take: &mut impl FnMut(Row) -> Result<()>,
    ) -> Result<Option<Array>> {
        if !self.folder.exists() {
            return Ok(None);
        }
        let arrays = shared.arrays();
        let states = if arrays.is_empty() { States::new() } else { slurm::states(&arrays)? };
        let is_alive = states.values().any(|state| *state == TaskState::Alive);
        // Rows of another plan or of other inputs are no rows of this campaign.
        let is_same = shared.task().is_ok_and(|task| task.order == self.task.order);
        let chunks = if is_same { shared.chunks()? } else { Vec::new() };
        let known: BTreeMap<u64, &Job> = chunks.iter().flatten().map(|job| (job.flight, job)).collect();
        let mut array = Array::new(shared.clone());
        if is_alive && flights.wanted.iter().all(|(flight, job)| known.get(flight) == Some(job)) {
            for (number, jobs) in chunks.iter().enumerate() {
                let missing: BTreeSet<u64> =
                    jobs.iter().map(|job| job.flight).filter(|it| flights.wanted.contains_key(it)).collect();
                // The newest array that has the chunk.
                let with_it = |array: &&String| states.contains_key(&((*array).clone(), number));
                let newest = arrays.iter().rev().find(with_it).or(arrays.last()).context("no job array")?;
                array.add(number, missing, newest.clone(), 1);
            }
            (self.tell)(&format!("waiting for Slurm's job {} of an earlier call", arrays.join(", ")));
            return Ok(Some(array));
        }
        let wanted_before = flights.wanted.clone();
        Reader::default().read(shared, None, |_, row: Row| {
            let is_meant = known.get(&row.flight) == wanted_before.get(&row.flight);
            // What the host ended gets another attempt.
            if is_meant && !row.is_of_host { flights.take(row, take).map(drop) } else { Ok(()) }
        })?;
        if is_alive {
            // They would write into a folder that is gone.
            cancel(&arrays, stop)?;
        }
        let shown = self.folder.display();
        std::fs::remove_dir_all(self.folder).with_context(|| format!("cannot remove {shown}"))?;
        Ok(None)
    }

    /// Submits all flights.
    fn begin(&self, shared: Shared, flights: &Flights<'_>) -> Result<Array> {
        let jobs: Vec<Job> = flights.wanted.values().map(|job| (*job).clone()).collect();
        let chunks: Vec<Vec<Job>> = jobs.chunks(self.chunk.max(1)).map(<[Job]>::to_vec).collect();
        shared.make(self.task, &chunks, self.script)?;
        let mut array = Array::new(shared);
        for (number, jobs) in chunks.iter().enumerate() {
            array.add(number, jobs.iter().map(|job| job.flight).collect(), String::new(), 0);
        }
        let all: Vec<usize> = (0..chunks.len()).collect();
        if let Err(error) = array.submit(self, &all) {
            // Nothing was submitted.
            let _ = std::fs::remove_dir_all(self.folder);
            return Err(error);
        }
        Ok(array)
    }
}

/// Flights without a row.
struct Flights<'a> {
    wanted: BTreeMap<u64, &'a Job>,
    /// Rows taken so far.
    flown: usize,
}

impl Flights<'_> {
    /// Takes a row; false if its flight has one already.
    fn take(&mut self, row: Row, take: &mut impl FnMut(Row) -> Result<()>) -> Result<bool> {
        if self.wanted.remove(&row.flight).is_none() {
            return Ok(false);
        }
        self.flown += 1;
        take(row).map(|()| true)
    }
}

/// Chunks that are being flown.
struct Array {
    shared: Shared,
    reader: Reader,
    chunks: BTreeMap<usize, Chunk>,
    /// Chunks that a person cancelled.
    cancelled: BTreeMap<usize, Chunk>,
    has_given_up: bool,
    /// Host time since which Slurm refuses to take lost chunks again.
    refused_ns: Option<u64>,
}

impl Array {
    fn new(shared: Shared) -> Self {
        let (reader, chunks, cancelled) = Default::default();
        Self { shared, reader, chunks, cancelled, has_given_up: false, refused_ns: None }
    }

    fn add(&mut self, number: usize, missing: BTreeSet<u64>, array: String, attempts: usize) {
        if !missing.is_empty() {
            let chunk = Chunk { missing, array, attempts, has_flown: false, ends_seen: 0 };
            self.chunks.insert(number, chunk);
        }
    }

    /// Submits the chunks of these numbers as one job array.
    fn submit(&mut self, cluster: &Cluster<'_>, numbers: &[usize]) -> Result<()> {
        let array = slurm::submit(&Submission {
            script: &self.shared.script(),
            logs: self.shared.folder(),
            tasks: numbers,
            processors: cluster.task.workers,
            options: cluster.options,
        })?;
        if let Err(error) = self.shared.add_array(&array) {
            // Nobody would know of it.
            return Err(match slurm::cancel(std::slice::from_ref(&array)) {
                Ok(()) => error,
                Err(too) => error.context(format!("Slurm's job {array} still flies: {too:#}")),
            });
        }
        (cluster.tell)(&format!("submitted {} tasks to Slurm as job {array}", numbers.len()));
        for number in numbers {
            if let Some(chunk) = self.chunks.get_mut(number) {
                chunk.array.clone_from(&array);
                chunk.attempts = chunk.next_attempt();
                (chunk.has_flown, chunk.ends_seen) = (false, 0);
            }
        }
        Ok(())
    }

    /// Takes rows until every flight has one, or `stop` is used.
    fn wait(
        &mut self,
        cluster: &Cluster<'_>,
        flights: &mut Flights<'_>,
        stop: &StopToken,
        take: &mut impl FnMut(Row) -> Result<()>,
    ) -> Result<()> {
        let (mut pause_ns, mut answered_ns) = (QUESTION_NS.0, monotonic_ns());
        let mut question_ns = answered_ns + pause_ns;
        loop {
            self.gather(flights, take)?;
            if self.chunks.is_empty() || stop.count() > 0 {
                return self.require_not_cancelled();
            }
            if monotonic_ns() > question_ns {
                match slurm::states(&self.arrays()) {
                    Ok(states) => {
                        answered_ns = monotonic_ns();
                        if self.look_after(cluster, &states, flights, take)? {
                            pause_ns = QUESTION_NS.0;
                        }
                    }
                    // A controller that starts anew must not cost the campaign.
                    Err(error) if monotonic_ns() - answered_ns > SILENCE_NS => return Err(error),
                    Err(_) => {}
                }
                question_ns = monotonic_ns() + pause_ns;
                // Thousands of users ask the same controller.
                pause_ns = (2 * pause_ns).min(QUESTION_NS.1);
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Takes the rows that have come.
    fn gather(&mut self, flights: &mut Flights<'_>, take: &mut impl FnMut(Row) -> Result<()>) -> Result<()> {
        let Self { reader, shared, chunks, .. } = self;
        reader.read(shared, None, |number, row: Row| {
            let flight = row.flight;
            if let Some(chunk) = chunks.get_mut(&number)
                && flights.take(row, take)?
            {
                chunk.missing.remove(&flight);
                chunk.has_flown = true;
            }
            Ok(())
        })?;
        chunks.retain(|_, chunk| !chunk.missing.is_empty());
        Ok(())
    }

    fn arrays(&self) -> Vec<String> {
        let arrays: BTreeSet<&String> = self.chunks.values().map(|chunk| &chunk.array).collect();
        arrays.into_iter().cloned().collect()
    }

    /// Submits chunks whose tasks have ended again, or gives them up; true if something was submitted.
    fn look_after(
        &mut self,
        cluster: &Cluster<'_>,
        states: &States,
        flights: &mut Flights<'_>,
        take: &mut impl FnMut(Row) -> Result<()>,
    ) -> Result<bool> {
        let mut lost = Vec::new();
        let mut cancelled = Vec::new();
        for (&number, chunk) in &mut self.chunks {
            let state = slurm::state_in(states, &chunk.array, number);
            if state == Some(&TaskState::Alive) {
                chunk.ends_seen = 0;
                continue;
            }
            chunk.ends_seen += 1;
            if chunk.ends_seen < ENDS_SEEN {
                continue;
            }
            match state {
                Some(TaskState::Cancelled) => cancelled.push(number),
                Some(TaskState::Ended(word)) => lost.push((number, word.clone())),
                _ => lost.push((number, "unknown to Slurm".to_owned())),
            }
        }
        let cancelled =
            cancelled.into_iter().filter_map(|number| Some((number, self.chunks.remove(&number)?)));
        self.cancelled.extend(cancelled.collect::<Vec<_>>());
        let mut again = Vec::new();
        for (number, word) in lost {
            let Some(chunk) = self.chunks.get(&number) else { continue };
            if chunk.next_attempt() <= ATTEMPTS {
                let left = chunk.missing.len();
                // Said once, however often Slurm refuses them.
                if chunk.ends_seen == ENDS_SEEN {
                    (cluster.tell)(&format!(
                        "task {}_{number} ended before {}: {word}",
                        chunk.array,
                        crate::report::flights(left as u64)
                    ));
                }
                again.push(number);
            } else {
                self.give_up(number, &word, flights, take)?;
            }
        }
        if again.is_empty() { Ok(false) } else { self.submit_again(cluster, &again) }
    }

    /// Submits lost chunks; true if Slurm took them. What it refuses is tried again for some time: a controller that took
    /// the first array may be busy.
    fn submit_again(&mut self, cluster: &Cluster<'_>, numbers: &[usize]) -> Result<bool> {
        let Err(error) = self.submit(cluster, numbers) else {
            self.refused_ns = None;
            return Ok(true);
        };
        let is_first = self.refused_ns.is_none();
        let since_ns = *self.refused_ns.get_or_insert_with(monotonic_ns);
        if monotonic_ns() - since_ns > SILENCE_NS {
            return Err(error);
        }
        if is_first {
            (cluster.tell)(&format!("they are submitted again later: {error:#}"));
        }
        Ok(false)
    }

    /// Gives up the flights of a chunk, or the campaign if no task has flown a flight.
    fn give_up(
        &mut self,
        number: usize,
        word: &str,
        flights: &mut Flights<'_>,
        take: &mut impl FnMut(Row) -> Result<()>,
    ) -> Result<()> {
        let Some(chunk) = self.chunks.get(&number) else { return Ok(()) };
        let words = self.shared.last_words(number, &chunk.array);
        let words =
            words.map_or_else(|| "it printed nothing".to_owned(), |words| format!("it said: {words}"));
        let why = format!(
            "Slurm's task {}_{number} ended {ATTEMPTS} times without a flight: {word}; {words}",
            chunk.array
        );
        self.has_given_up = true;
        if flights.flown == 0 {
            bail!("{why}; the tasks' output is in {}", self.shared.folder().display());
        }
        for flight in chunk.missing.clone() {
            flights.take(Row::ended(flight, why.clone()), take)?;
        }
        self.chunks.remove(&number);
        Ok(())
    }

    fn require_not_cancelled(&self) -> Result<()> {
        let Some(chunk) = self.cancelled.values().next() else { return Ok(()) };
        let left: usize = self.cancelled.values().map(|chunk| chunk.missing.len()).sum();
        bail!(
            "Slurm's job {} was cancelled before the end of {}; the same command flies the rest",
            chunk.array,
            crate::report::flights(left as u64)
        )
    }

    /// Cancels all tasks, waits for their end, and takes the rows that they have left.
    fn cancel(
        &mut self,
        flights: &mut Flights<'_>,
        stop: &StopToken,
        take: &mut impl FnMut(Row) -> Result<()>,
    ) -> Result<()> {
        // Tasks that Slurm was slow to tell of may fly in an earlier array.
        cancel(&self.shared.arrays(), stop)?;
        self.gather(flights, take)
    }
}

impl Chunk {
    /// Number of the attempt that comes.
    const fn next_attempt(&self) -> usize {
        if self.has_flown { 1 } else { self.attempts + 1 }
    }
}

/// Cancels `arrays`, and waits for the ends of their tasks, but not with a second stop.
///
/// # Errors
/// If they are not cancelled, or have not ended in time.
fn cancel(arrays: &[String], stop: &StopToken) -> Result<()> {
    if arrays.is_empty() {
        return Ok(());
    }
    slurm::cancel(arrays)?;
    let (end_ns, mut question_ns) = (monotonic_ns() + END_NS, 0);
    while stop.count() < 2 {
        let now_ns = monotonic_ns();
        if now_ns >= question_ns {
            // A controller that does not answer says nothing of the tasks.
            match slurm::states(arrays) {
                Ok(states) if states.values().all(|state| *state != TaskState::Alive) => return Ok(()),
                Err(error) if now_ns >= end_ns => return Err(error),
                Ok(_) if now_ns >= end_ns => {
                    bail!("Slurm's job {} was cancelled and its tasks still run", arrays.join(", "))
                }
                _ => question_ns = now_ns + QUESTION_NS.0,
            }
        }
        std::thread::sleep(LOOK);
    }
    Ok(())
}
