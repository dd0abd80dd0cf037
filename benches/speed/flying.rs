//! A run in flight, looked at from outside.

use crate::report::Result;
use bus::lockstep::{LiveView, Phase};
use bus::names::shm_prefix;
use bus::plan::Plan;
use rustix::process::{Pid, Signal, kill_process};
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Sleep between two looks at the run: short against the measured times, and next to no load.
const POLL: Duration = Duration::from_micros(200);
const WATCHDOG: Duration = Duration::from_secs(120);

/// A run that was started and has a folder for temporary files of its own.
pub struct Flying {
    launcher: Child,
    started: Instant,
    folder: tempfile::TempDir,
}

/// Host time from the start of the launcher, in seconds.
#[derive(Clone, Copy, Debug)]
pub struct Stages {
    /// The manifest is checked, the run directory and the control segment are there.
    pub planned_s: f64,
    /// Every process is up and has created its outputs.
    pub announced_s: f64,
    /// Every process is connected, and the first grant is given.
    pub granted_s: f64,
}

/// Memory that a run takes.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    /// Private memory and the run's share of files, such as the executable's, over all its processes.
    pub processes_bytes: u64,
    /// Its files in /dev/shm, each counted once.
    pub shared_bytes: u64,
}

impl Memory {
    pub fn total_bytes(&self) -> u64 {
        self.processes_bytes + self.shared_bytes
    }
}

impl Flying {
    pub fn start(manifest: &Path, arguments: &[&str]) -> Result<Self> {
        let folder = tempfile::tempdir()?;
        let mut command = Command::new(crate::HUMMINGBUS);
        command.arg("run").arg(manifest).args(arguments).arg("--json");
        command.env("TMPDIR", folder.path()).stdout(Stdio::null()).stderr(Stdio::null());
        let started = Instant::now();
        Ok(Self { launcher: command.spawn()?, started, folder })
    }

    /// Watches the start until the first grant.
    pub fn stages(&self) -> Result<Stages> {
        let (_, control) = self.poll(|| self.control())?;
        let planned_s = self.started.elapsed().as_secs_f64();
        self.poll(|| (control.phase() >= Phase::Connecting).then_some(()))?;
        let announced_s = self.started.elapsed().as_secs_f64();
        self.poll(|| (control.granted_ticks() > 0).then_some(()))?;
        Ok(Stages { planned_s, announced_s, granted_s: self.started.elapsed().as_secs_f64() })
    }

    /// Waits until every node has completed `ticks` ticks.
    pub fn await_ticks(&self, ticks: u32) -> Result<()> {
        let (_, control) = self.poll(|| self.control())?;
        self.poll(|| (control.completed_ticks() >= ticks).then_some(()))
    }

    /// Returns the memory that the run takes now.
    pub fn memory(&self) -> Result<Memory> {
        let (plan, _) = self.control().ok_or("the run is over")?;
        let processes = std::fs::read_dir("/proc")?
            .flatten()
            .filter_map(|entry| own_bytes(&entry.path(), self.launcher.id()));
        let prefix = shm_prefix(&plan.run_id);
        let files = std::fs::read_dir("/dev/shm")?.flatten();
        let files = files.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix));
        // What is allocated, in blocks of 512 bytes: the files are larger than what was ever written to.
        let shared = files.filter_map(|file| Some(file.metadata().ok()?.blocks() * 512));
        Ok(Memory { processes_bytes: processes.sum(), shared_bytes: shared.sum() })
    }

    /// Stops the run at a tick boundary and waits for its end.
    pub fn stop(mut self) -> Result<()> {
        kill_process(Pid::from_child(&self.launcher), Signal::INT)?;
        self.launcher.wait()?;
        Ok(())
    }

    fn control(&self) -> Option<(Plan, LiveView)> {
        let run_dir = std::fs::read_dir(self.folder.path()).ok()?.flatten().next()?.path();
        let plan = Plan::load(&run_dir).ok()?;
        let control = LiveView::open(&plan).ok()?;
        Some((plan, control))
    }

    fn poll<T>(&self, mut look: impl FnMut() -> Option<T>) -> Result<T> {
        loop {
            if let Some(found) = look() {
                return Ok(found);
            }
            if self.started.elapsed() > WATCHDOG {
                return Err("the run did not come on".into());
            }
            std::thread::sleep(POLL);
        }
    }
}

impl Drop for Flying {
    fn drop(&mut self) {
        // After an error; a launcher that has ended is not there to be killed any more.
        let _ = self.launcher.kill();
        let _ = self.launcher.wait();
    }
}

/// Private memory and share of files of a process, if it is `launcher` or one that this started.
fn own_bytes(process: &Path, launcher: u32) -> Option<u64> {
    let id: u32 = process.file_name()?.to_str()?.parse().ok()?;
    let stat = std::fs::read_to_string(process.join("stat")).ok()?;
    // Behind the name, which may hold anything: the state and the parent.
    let parent: u32 = stat.rsplit_once(')')?.1.split_whitespace().nth(1)?.parse().ok()?;
    if id != launcher && parent != launcher {
        return None;
    }
    let rollup = std::fs::read_to_string(process.join("smaps_rollup")).ok()?;
    let parts = rollup.lines().filter(|line| line.starts_with("Pss_Anon:") || line.starts_with("Pss_File:"));
    let kilobytes = parts.filter_map(|line| line.split_whitespace().nth(1)?.parse::<u64>().ok());
    Some(kilobytes.sum::<u64>() * 1024)
}
