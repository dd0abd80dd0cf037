//! `hummingbus clean`: removes the remains of dead runs, and nothing of live ones.
//!
//! Everything to be removed is claimed first: the claim is the lock of the run's entry, which a live launcher holds.
//! A run registers before it creates anything else, so files without an entry belong to a dead run.
//!
//! An inherited environment proves nothing: a process of the dead run may have started another run. A process belongs
//! to a dead run if its environment names the run and it holds a file of the run's directory open. Everything that
//! writes where the run had it write does so. No live launcher may be above or below it.
#![allow(clippy::disallowed_methods, reason = "waiting for a killed process takes host time")]

use crate::process_table::{ancestors, run_dir_of};
use crate::run_dir::{
    Entry, SHARED_MEMORY, entry_path, folders, is_own_name, is_own_run_dir, is_run_dir_of, live_runs,
    run_of_dir, run_of_shared_memory, shared_memory_of, try_claim,
};
use anyhow::{anyhow, bail};
use bus::process::user_id;
use bus::user_file;
use diagnostics::Error;
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest time until a killed process is gone.
const GRACE: Duration = Duration::from_secs(5);
/// Longest time from the start of a process to the beginning of its program.
const BEGINNING: Duration = Duration::from_secs(1);
const POLL: Duration = Duration::from_millis(2);

/// Remains that were found.
///
/// ```no_run
/// let report = runtime::clean::clean(true)?;
/// assert!(report.dry_run, "nothing was removed");
/// # Ok::<(), runtime::Error>(())
/// ```
#[derive(Debug, Serialize)]
pub struct Report {
    /// True if nothing was removed.
    pub dry_run: bool,
    /// Names of the runs that live.
    pub live: Vec<String>,
    /// The dead runs of which something was left.
    pub dead: Vec<Remains>,
}

/// Remains of a dead run.
#[derive(Debug, Default, Serialize)]
pub struct Remains {
    /// The run.
    pub run_id: String,
    /// Processes that outlived it.
    pub processes: Vec<i32>,
    /// Processes that carry its name and hold none of its files. The run may have started them for any purpose, so
    /// they live on.
    pub spared: Vec<i32>,
    /// Files and directories.
    pub paths: Vec<PathBuf>,
    /// Memory and disk space that these take.
    pub bytes: u64,
    /// Paths and processes that could not be removed, each with the reason.
    pub failures: Vec<String>,
}

/// Removes the remains of this user's dead runs; with `dry_run`, only reports them.
///
/// # Errors
/// If the machine's processes cannot be listed.
pub fn clean(dry_run: bool) -> Result<Report, Error> {
    let mut report = Report { dry_run, live: Vec::new(), dead: Vec::new() };
    for (run_id, traces) in find_traces()? {
        // Held until everything is removed: a launcher that is just registering this run waits for it.
        let Some(_claim) = claim(&run_id, &traces.run_dirs) else {
            report.live.push(run_id);
            continue;
        };
        let mut remains = look_at(run_id, traces);
        if !dry_run {
            remains.remove();
        }
        if remains.has_something_to_remove() || !remains.spared.is_empty() {
            report.dead.push(remains);
        }
    }
    Ok(report)
}

/// Claims the remains of a run; `None` if it is alive. A process that a launcher was starting when it was killed
/// holds the locks too, until it has begun as another program. The claim waits for that.
fn claim(run_id: &str, run_dirs: &BTreeSet<PathBuf>) -> Option<Vec<File>> {
    let start = Instant::now();
    loop {
        let claim = try_claim(run_id, run_dirs);
        if claim.is_some() || launcher_is_there(run_id) || start.elapsed() > BEGINNING {
            return claim;
        }
        std::thread::sleep(POLL);
    }
}

/// True if a process has the number of the run's launcher, with which the run's name begins.
fn launcher_is_there(run_id: &str) -> bool {
    let number = run_id.split_once('-').and_then(|(launcher, _)| u32::from_str_radix(launcher, 16).ok());
    number.is_some_and(|number| Path::new("/proc").join(number.to_string()).exists())
}

/// Traces of a run: its directories, in any folder for temporary files, and its processes.
#[derive(Default)]
struct Traces {
    run_dirs: BTreeSet<PathBuf>,
    processes: Vec<i32>,
    spared: Vec<i32>,
}

fn find_traces() -> anyhow::Result<BTreeMap<String, Traces>> {
    let mut found: BTreeMap<String, Traces> = BTreeMap::new();
    for path in own_files(Path::new(SHARED_MEMORY)) {
        let Some(run_id) = name_of(&path).and_then(run_of_shared_memory) else { continue };
        let traces = found.entry(run_id.to_owned()).or_default();
        if path == entry_path(run_id) {
            let entry = user_file::open(&path, false).ok().and_then(|file| Entry::read(run_id, &file));
            traces.run_dirs.extend(entry.map(|entry| entry.run_dir));
        }
    }
    for path in folders().iter().flat_map(|folder| own_files(folder)) {
        if let Some(run_id) = name_of(&path).and_then(run_of_dir) {
            found.entry(run_id.to_owned()).or_default().run_dirs.insert(path);
        }
    }
    for (process, run_dir, holds_file) in processes_of_runs()? {
        if let Some(run_id) = name_of(&run_dir).and_then(run_of_dir).map(str::to_owned) {
            let traces = found.entry(run_id).or_default();
            traces.run_dirs.extend(Some(run_dir).filter(|run_dir| run_dir.is_absolute()));
            if holds_file { &mut traces.processes } else { &mut traces.spared }.push(number(process));
        }
    }
    Ok(found)
}

fn name_of(path: &Path) -> Option<&str> {
    path.file_name()?.to_str()
}

/// This user's files in `folder`; empty if there is no such folder.
fn own_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_own = |entry: &std::fs::DirEntry| entry.metadata().is_ok_and(|file| file.uid() == user_id());
    entries.filter(is_own).map(|entry| entry.path()).collect()
}

/// This user's processes that carry a run directory, each with a flag: true if it holds a file of that directory.
/// This process and those that see another /dev/shm are left out.
fn processes_of_runs() -> anyhow::Result<Vec<(Pid, PathBuf, bool)>> {
    let (own_mounts, is_kin) = (mounts_of(Path::new("/proc/self")), kin_of_live_launchers());
    let entries = std::fs::read_dir("/proc")?.flatten();
    let process = |entry: std::fs::DirEntry| {
        let id =
            entry.file_name().to_str()?.parse().ok().filter(|&id| id != std::process::id().cast_signed())?;
        let process = Pid::from_raw(id)?;
        let is_own = entry.metadata().is_ok_and(|file| file.uid() == user_id());
        (is_own && mounts_of(&entry.path()) == own_mounts).then_some(())?;
        let run_dir = run_dir_of(process).filter(|_| !is_kin(process))?;
        let holds_file = holds_file_of(process, &run_dir);
        Some((process, run_dir, holds_file))
    };
    Ok(entries.filter_map(process).collect())
}

/// Identifier of the mounts that a process sees.
fn mounts_of(process: &Path) -> Option<PathBuf> {
    std::fs::read_link(process.join("ns/mnt")).ok()
}

/// Returns a predicate that is true for live launchers, their ancestors and their descendants.
fn kin_of_live_launchers() -> impl Fn(Pid) -> bool {
    let launchers: BTreeSet<i32> = live_runs().iter().map(|run| run.entry.launcher.cast_signed()).collect();
    let above = launchers.iter().copied().filter_map(Pid::from_raw).flat_map(ancestors).map(number);
    let above: BTreeSet<i32> = above.collect();
    move |process| {
        let mut line = std::iter::once(process).chain(ancestors(process)).map(number);
        above.contains(&number(process)) || line.any(|id| launchers.contains(&id))
    }
}

fn number(process: Pid) -> i32 {
    process.as_raw_nonzero().get()
}

/// True if a process holds a file of `run_dir` open, also one that has been removed.
fn holds_file_of(process: Pid, run_dir: &Path) -> bool {
    // The kernel reports the path of a file with all links resolved.
    let resolved = run_dir.parent().and_then(|folder| folder.canonicalize().ok());
    let resolved = resolved.zip(run_dir.file_name()).map(|(folder, name)| folder.join(name));
    let files = std::fs::read_dir(format!("/proc/{process}/fd")).into_iter().flatten().flatten();
    let mut targets = files.filter_map(|file| std::fs::read_link(file.path()).ok());
    targets.any(|target| resolved.as_ref().is_some_and(|run_dir| target.starts_with(run_dir)))
}

fn look_at(run_id: String, traces: Traces) -> Remains {
    let Traces { run_dirs, processes, spared } = traces;
    let run_dirs = run_dirs.into_iter().filter(|path| is_own_run_dir(path));
    // The entry last, as it goes when a run ends by itself.
    let entry = Some(entry_path(&run_id)).filter(|path| is_own_name(path));
    let paths: Vec<PathBuf> = run_dirs.chain(shared_memory_of(&run_id)).chain(entry).collect();
    let bytes = paths.iter().map(|path| bytes_below(path)).sum();
    Remains { run_id, processes, spared, paths, bytes, failures: Vec::new() }
}

/// The space that a file, or a folder with everything in it, takes up; it may be far less than its length.
fn bytes_below(path: &Path) -> u64 {
    let Ok(metadata) = path.symlink_metadata() else { return 0 };
    let entries = std::fs::read_dir(path).into_iter().flatten().flatten().filter(|_| metadata.is_dir());
    metadata.blocks() * 512 + entries.map(|entry| bytes_below(&entry.path())).sum::<u64>()
}

impl Remains {
    /// True if a process or a file of it is there to be removed.
    #[must_use]
    pub fn has_something_to_remove(&self) -> bool {
        !(self.processes.is_empty() && self.paths.is_empty())
    }

    /// Ends the processes, then removes the files, which they may still be writing.
    fn remove(&mut self) {
        for &process in &self.processes {
            if let Err(reason) = end_process(process, &self.run_id) {
                self.failures.push(format!("process {process}: {reason}"));
            }
        }
        for path in &self.paths {
            let removed =
                if is_own_run_dir(path) { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
            match removed {
                // Another `clean` was faster.
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                Err(error) => self.failures.push(format!("{}: {error}", path.display())),
                Ok(()) => {}
            }
        }
    }
}

/// Kills a process that carries a run directory, and waits until it is gone.
fn end_process(process: i32, run_id: &str) -> anyhow::Result<()> {
    let Some(process) = Pid::from_raw(process) else { return Ok(()) };
    // The handle stays with the process, even if another process gets its number: the signal goes to the process that
    // carries the run directory now.
    let Ok(handle) = pidfd_open(process, PidfdFlags::empty()) else { return Ok(()) };
    let is_of_run = |run_dir: &PathBuf| is_run_dir_of(run_dir, run_id) && holds_file_of(process, run_dir);
    if run_dir_of(process).filter(is_of_run).is_none() {
        return Ok(());
    }
    pidfd_send_signal(&handle, Signal::KILL).map_err(|error| anyhow!("cannot be killed: {error}"))?;
    let start = Instant::now();
    while run_dir_of(process).is_some() {
        if start.elapsed() > GRACE {
            bail!("still there {} s after it was killed", GRACE.as_secs());
        }
        std::thread::sleep(POLL);
    }
    Ok(())
}

impl Report {
    /// True if nothing of a dead run is left, or nothing was to be removed.
    pub fn is_done(&self) -> bool {
        self.dead.iter().all(|remains| remains.failures.is_empty())
    }
}
