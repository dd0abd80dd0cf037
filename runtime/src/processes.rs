//! The processes of a run on the host: started, watched, and taken down.

use crate::process_log::{self, last_words};
use crate::program::Program;
use crate::spawn;
use crate::watch_clock::WatchClock;
use anyhow::{Context, Result};
use bus::control::Control;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus};
use std::time::Duration;

/// How long processes have to leave by themselves after an abort.
const GRACE: Duration = Duration::from_secs(2);
const POLL: Duration = Duration::from_millis(2);

/// What a process is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The clock service.
    Clock,
    /// A process of a node.
    Node {
        /// Index in the plan.
        node: usize,
        /// Counts the processes of this node.
        generation: u32,
    },
    /// A process that takes no part in the ticks.
    Companion {
        /// Counts the processes of this companion.
        generation: u32,
    },
}

/// A process of a run.
#[derive(Debug)]
pub struct Process {
    /// The name in messages: that of its node, and for a successor its generation.
    pub name: String,
    /// What it is for.
    pub role: Role,
    log: PathBuf,
    child: Child,
    /// How it ended.
    pub end: Option<ExitStatus>,
    /// Whether somebody has drawn the consequences of its end.
    pub is_settled: bool,
    /// Why the launcher killed it.
    pub verdict: Option<String>,
}

/// The processes of a run; dropping them kills those that still live.
#[derive(Debug, Default)]
pub struct Processes {
    /// Those that were started and whose end is not settled.
    pub running: Vec<Process>,
}

impl Processes {
    /// Starts a process; the clock where there is no program.
    pub fn start(&mut self, name: &str, role: Role, program: Option<&Program>, run_dir: &Path) -> Result<()> {
        self.running.push(Process::start(name, role, program, run_dir, None)?);
        Ok(())
    }

    /// The process numbers of all.
    pub fn ids(&self) -> impl Iterator<Item = u32> {
        self.running.iter().map(Process::id)
    }

    /// Looks which processes have ended.
    pub fn look(&mut self) -> Result<()> {
        self.running.iter_mut().try_for_each(Process::look)
    }

    /// Keeps logs in the run directory from filling its file system.
    pub fn bound_logs(&self, run_dir: &Path) {
        self.running.iter().for_each(|process| process.bound_log(run_dir));
    }

    /// Whether every process has ended.
    pub fn all_ended(&self) -> bool {
        self.running.iter().all(|process| process.end.is_some())
    }

    /// The process of a node's generation.
    pub fn of(&mut self, node: usize, generation: u32) -> Option<&mut Process> {
        self.running.iter_mut().find(|process| process.role == Role::Node { node, generation })
    }

    /// Whether the process of a node's generation lives.
    pub fn lives(&self, node: usize, generation: u32) -> bool {
        let role = Role::Node { node, generation };
        self.running.iter().any(|process| process.role == role && process.end.is_none())
    }

    /// Kills the process of a node's generation and waits for its end.
    pub fn kill(&mut self, node: usize, generation: u32, verdict: Option<String>) {
        self.kill_role(Role::Node { node, generation }, verdict);
    }

    /// Kills the process of this role and waits for its end.
    pub fn kill_role(&mut self, role: Role, verdict: Option<String>) {
        if let Some(process) = self.running.iter_mut().find(|process| process.role == role) {
            process.kill();
            process.verdict = verdict;
        }
    }

    /// Forgets the process of a node's generation, whose end is settled, and what it wrote into the run directory.
    pub fn forget(&mut self, node: usize, generation: u32, run_dir: &Path) {
        if let Some(process) = self.of(node, generation) {
            process.remove_log(run_dir);
        }
        let role = Role::Node { node, generation };
        self.running.retain(|process| process.role != role || process.end.is_none());
    }

    /// Aborts the run and gives the processes time to leave.
    pub fn take_down(&mut self, control: &Control) -> Result<()> {
        control.abort();
        let clock = WatchClock::new();
        while !self.all_ended() && clock.now() < GRACE {
            self.look()?;
            std::thread::sleep(POLL);
            clock.look();
        }
        Ok(())
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        self.running.iter_mut().for_each(Process::kill);
    }
}

impl Process {
    /// Starts a process; the clock where there is no program. `notify` is the socket on which a companion says that
    /// it is ready.
    pub fn start(
        name: &str,
        role: Role,
        program: Option<&Program>,
        run_dir: &Path,
        notify: Option<&Path>,
    ) -> Result<Self> {
        let (child, log) = match program {
            None => spawn::start_clock(run_dir)?,
            Some(program) => spawn::start(run_dir, name, role, program, notify)?,
        };
        let name = match role {
            Role::Node { generation, .. } => bus::process::process_name(name, generation),
            Role::Clock | Role::Companion { .. } => name.to_owned(),
        };
        Ok(Self { name, role, log, child, end: None, is_settled: false, verdict: None })
    }

    /// Its process number.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Removes its log, if that lies in the run directory.
    pub fn remove_log(&self, run_dir: &Path) {
        if self.log.starts_with(run_dir) {
            let _ = std::fs::remove_file(&self.log);
        }
    }

    /// Looks whether the process has ended.
    pub fn look(&mut self) -> Result<()> {
        if self.end.is_none() {
            self.end = self.child.try_wait().context("cannot watch a process")?;
        }
        Ok(())
    }

    /// Kills the process and its group, and waits for its end.
    pub fn kill(&mut self) {
        if self.end.is_none() {
            self.end = kill(&mut self.child);
        }
    }

    /// Keeps a log in the run directory from filling its file system. A log that the manifest names is its user's.
    pub fn bound_log(&self, run_dir: &Path) {
        if self.log.starts_with(run_dir) {
            process_log::bound(&self.log);
        }
    }

    /// How the process ended before the run did, with the last lines it wrote.
    pub fn post_mortem(&self) -> String {
        let end = match (&self.verdict, self.end) {
            (Some(verdict), _) => verdict.clone(),
            (None, Some(end)) => match (end.code(), end.signal()) {
                (Some(0), _) => "ended with exit code 0 before the run did".to_owned(),
                (Some(code), _) => format!("ended with exit code {code}"),
                (None, Some(signal)) => format!(
                    "was killed by {}{}",
                    bus::process::signal_name(signal),
                    bus::room::signal_message(signal)
                ),
                (None, None) => "ended".to_owned(),
            },
            (None, None) => "is still running".to_owned(),
        };
        let words: String = last_words(&self.log).iter().map(|line| format!("\n  {line}")).collect();
        format!("process `{}` {end}{words}", self.name)
    }
}

/// Kills a process and its whole group, since a command may have started processes of its own.
fn kill(child: &mut Child) -> Option<ExitStatus> {
    bus::process::kill_group(child.id());
    let _ = child.kill();
    child.wait().ok()
}
