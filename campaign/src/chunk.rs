//! A chunk: the flights of one task of a job array, and the folder that tasks and the campaign share.
//!
//! | file | contents |
//! |---|---|
//! | `task.json` | what all tasks need: campaign, number of workers, limits |
//! | `task.sh` | script that each task runs |
//! | `arrays.txt` | numbers of the submitted job arrays, one a line |
//! | `jobs-CHUNK.jsonl` | flights of a chunk |
//! | `rows-CHUNK-JOB-ATTEMPT.jsonl` | rows that one attempt at a chunk has flown so far |
//! | `log-CHUNK-ARRAY.txt` | what a task printed |
//!
//! Each attempt has a file of its own. A task that Slurm started again never writes into the file of the one
//! before: that task may still run on a node that lost its network.

use crate::pool::Pool;
use crate::row::Row;
use crate::worker::{Job, Order};
use anyhow::{Context, Result};
use runtime::event::StopToken;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, OpenOptions};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Inputs and limits of all tasks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// The campaign; the folder of its workers is the node's own.
    pub order: Order,
    /// Workers of a task.
    pub workers: usize,
    /// Host time after which a flight is given up, s.
    pub timeout_s_host: f64,
}

/// The folder that tasks and the campaign share.
#[derive(Clone, Debug)]
pub struct Shared {
    folder: PathBuf,
}

/// Rows of chunks as they come: each is read once.
#[derive(Debug, Default)]
pub struct Reader {
    /// Bytes read so far, by file name.
    read: BTreeMap<String, u64>,
}

/// An attempt at a chunk: `Shared::fly` gets it from Slurm's environment variables.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// Number of the chunk.
    pub chunk: usize,
    /// Number of Slurm's job.
    pub job: String,
    /// Number of times that Slurm has started this job anew.
    pub restarts: u64,
}

impl Attempt {
    /// The attempt that this process is, by Slurm's environment variables.
    ///
    /// # Errors
    /// Outside of a job array.
    pub fn of_environment() -> Result<Self> {
        let variable = |name: &str| std::env::var(name).ok();
        let expected = |name: &str| format!("expected {name}, which Slurm sets in a task of a job array");
        let name = "SLURM_ARRAY_TASK_ID";
        let chunk = variable(name).and_then(|text| text.parse().ok()).with_context(|| expected(name))?;
        let name = "SLURM_JOB_ID";
        let is_number = |text: &String| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        let job = variable(name).filter(is_number).with_context(|| expected(name))?;
        let restarts = variable("SLURM_RESTART_COUNT").and_then(|text| text.parse().ok()).unwrap_or(0);
        Ok(Self { chunk, job, restarts })
    }
}

impl Shared {
    /// The folder at `folder`, which need not exist yet.
    #[must_use]
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    /// Path of the folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Path of the script that each task runs.
    #[must_use]
    pub fn script(&self) -> PathBuf {
        self.folder.join("task.sh")
    }

    /// Makes the folder with the flights of all `chunks`; `script` is the shell script that each task runs.
    ///
    /// # Errors
    /// If the folder cannot be written to.
    pub fn make(&self, task: &Task, chunks: &[Vec<Job>], script: &str) -> Result<()> {
        let shown = self.folder.display();
        std::fs::create_dir(&self.folder).with_context(|| format!("cannot make the folder {shown}"))?;
        for (chunk, jobs) in chunks.iter().enumerate() {
            let lines: Vec<String> = jobs.iter().map(serde_json::to_string).collect::<Result<_, _>>()?;
            self.write(&jobs_name(chunk), &format!("{}\n", lines.join("\n")))?;
        }
        self.write("task.sh", script)?;
        self.write("task.json", &serde_json::to_string(task)?)
    }

    fn write(&self, name: &str, text: &str) -> Result<()> {
        let path = self.folder.join(name);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    }

    /// Inputs and limits of all tasks.
    ///
    /// # Errors
    /// If the file is not there, or was written by another version.
    pub fn task(&self) -> Result<Task> {
        let path = self.folder.join("task.json");
        let text =
            std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        serde_json::from_str(&text).with_context(|| format!("{}: not a task", path.display()))
    }

    /// Flights of chunk number `chunk`.
    ///
    /// # Errors
    /// If the file is not there.
    pub fn jobs(&self, chunk: usize) -> Result<Vec<Job>> {
        let path = self.folder.join(jobs_name(chunk));
        let text =
            std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        text.lines().map(|line| Ok(serde_json::from_str(line)?)).collect()
    }

    /// Flights of all chunks.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn chunks(&self) -> Result<Vec<Vec<Job>>> {
        (0..)
            .take_while(|chunk| self.folder.join(jobs_name(*chunk)).exists())
            .map(|it| self.jobs(it))
            .collect()
    }

    /// Numbers of the job arrays submitted so far.
    #[must_use]
    pub fn arrays(&self) -> Vec<String> {
        let text = std::fs::read_to_string(self.folder.join("arrays.txt")).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }

    /// Adds the number of a job array.
    ///
    /// # Errors
    /// If the folder cannot be written to.
    pub fn add_array(&self, array: &str) -> Result<()> {
        let path = self.folder.join("arrays.txt");
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let written = file.and_then(|mut file| writeln!(file, "{array}"));
        written.with_context(|| format!("cannot write {}", path.display()))
    }

    /// Last line that a task of chunk `chunk` printed in `array`.
    #[must_use]
    pub fn last_words(&self, chunk: usize, array: &str) -> Option<String> {
        let text = std::fs::read(self.folder.join(format!("log-{chunk}-{array}.txt"))).ok()?;
        let text = String::from_utf8_lossy(&text).into_owned();
        text.lines().rev().map(str::trim).find(|line| !line.is_empty()).map(str::to_owned)
    }

    /// Flies the flights of a chunk that no attempt before has flown, and writes each row as it comes. `command` starts a
    /// worker.
    ///
    /// # Errors
    /// If the inputs are refused, or the folder cannot be used.
    pub fn fly(&self, attempt: &Attempt, command: &[String], stop: &StopToken) -> Result<()> {
        let Task { order, workers, timeout_s_host } = self.task()?;
        let mut flown = BTreeSet::new();
        Reader::default().read(self, Some(attempt.chunk), |_, row: Row| {
            flown.insert(row.flight);
            Ok(())
        })?;
        let jobs = self.jobs(attempt.chunk)?.into_iter().filter(|job| !flown.contains(&job.flight));
        let path = self.folder.join(rows_name(attempt));
        let shown = path.display();
        let rows = OpenOptions::new().create_new(true).append(true).open(&path);
        let mut rows = rows.with_context(|| format!("cannot make {shown}"))?;
        let folder = tempfile::tempdir().context("cannot make a folder for the workers of this node")?;
        let order = Order { folder: folder.path().to_owned(), ..order };
        let timeout = Duration::from_secs_f64(timeout_s_host);
        let pool = Pool { command, workers, order: &order, timeout };
        pool.fly(jobs, stop, |row| {
            let line = format!("{}\n", serde_json::to_string(&row)?);
            rows.write_all(line.as_bytes()).with_context(|| format!("cannot write {shown}"))
        })
    }
}

impl Reader {
    /// Hands the rows of chunk `of`, or of all, that came since the last call to `take`, with the numbers of their chunks.
    ///
    /// # Errors
    /// If a file cannot be read, or `take` fails.
    pub fn read<T: DeserializeOwned>(
        &mut self,
        shared: &Shared,
        of: Option<usize>,
        mut take: impl FnMut(usize, T) -> Result<()>,
    ) -> Result<()> {
        let folder = shared.folder();
        let entries =
            std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let Some(chunk) = chunk_of_rows(&name).filter(|chunk| of.is_none_or(|of| of == *chunk)) else {
                continue;
            };
            let start = self.read.get(&name).copied().unwrap_or(0);
            let path = entry.path();
            let text = tail(&path, start).with_context(|| format!("cannot read {}", path.display()))?;
            for line in text.lines() {
                let row =
                    serde_json::from_str(line).with_context(|| format!("{}: not a row", path.display()))?;
                take(chunk, row)?;
            }
            self.read.insert(name, start + text.len() as u64);
        }
        Ok(())
    }
}

/// Whole lines of a file from byte `start` on.
fn tail(path: &Path, start: u64) -> std::io::Result<String> {
    let mut file = File::open(path)?;
    file.seek(SeekFrom::Start(start))?;
    let mut text = Vec::new();
    file.read_to_end(&mut text)?;
    // A line that is not whole comes later, or never.
    let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
    text.truncate(whole);
    String::from_utf8(text).map_err(|error| std::io::Error::new(std::io::ErrorKind::InvalidData, error))
}

fn jobs_name(chunk: usize) -> String {
    format!("jobs-{chunk}.jsonl")
}

fn rows_name(attempt: &Attempt) -> String {
    format!("rows-{}-{}-{}.jsonl", attempt.chunk, attempt.job, attempt.restarts)
}

fn chunk_of_rows(name: &str) -> Option<usize> {
    name.strip_prefix("rows-")?.strip_suffix(".jsonl")?.split('-').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::{Reader, Shared};
    use std::fs;

    #[test]
    fn rows_are_read_once_whole_and_from_every_attempt() {
        let folder = tempfile::tempdir().unwrap();
        let shared = Shared::new(folder.path());
        let mut reader = Reader::default();
        let mut news = || {
            let mut found = Vec::new();
            let take = |chunk, value: u64| {
                found.push((chunk, value));
                Ok(())
            };
            reader.read(&shared, None, take).unwrap();
            found.sort_unstable();
            found
        };
        fs::write(folder.path().join("rows-3-17-0.jsonl"), "1\n2\n3").unwrap();
        fs::write(folder.path().join("log-3-17.txt"), "no row\n").unwrap();
        assert_eq!(news(), [(3, 1), (3, 2)]);
        fs::write(folder.path().join("rows-3-17-0.jsonl"), "1\n2\n34\n").unwrap();
        fs::write(folder.path().join("rows-12-18-1.jsonl"), "5\n").unwrap();
        assert_eq!(news(), [(3, 34), (12, 5)]);
        assert_eq!(news(), []);
        assert_eq!(shared.last_words(3, "17").as_deref(), Some("no row"));
    }
}
