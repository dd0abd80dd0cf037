//! The processes of a run on the host: started, watched, and taken down.
#![allow(clippy::disallowed_methods, reason = "the launcher watches host time; it simulates nothing")]

use crate::output_file::LOG_START;
use crate::program::Program;
use crate::spawn;
use anyhow::{Context, Result};
use bus::control::Control;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus};
use std::time::{Duration, Instant};

/// How long processes have to leave by themselves after an abort.
const GRACE: Duration = Duration::from_secs(2);
const POLL: Duration = Duration::from_millis(2);
/// Lines of a failed process's own words that are shown.
const LOG_LINES: usize = 20;

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
    Companion,
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
    companions: Vec<Child>,
}

impl Processes {
    /// Starts a process; the clock where there is no program.
    pub fn start(&mut self, name: &str, role: Role, program: Option<&Program>, run_dir: &Path) -> Result<()> {
        let (child, log) = match program {
            None => spawn::start_clock(run_dir)?,
            Some(program) => spawn::start(run_dir, name, role, program)?,
        };
        let name = match role {
            Role::Node { generation, .. } => bus::process::process_name(name, generation),
            Role::Clock | Role::Companion => name.to_owned(),
        };
        if role == Role::Companion {
            self.companions.push(child);
        } else {
            self.running.push(Process {
                name,
                role,
                log,
                child,
                end: None,
                is_settled: false,
                verdict: None,
            });
        }
        Ok(())
    }

    /// Looks which processes have ended.
    pub fn look(&mut self) -> Result<()> {
        for process in self.running.iter_mut().filter(|process| process.end.is_none()) {
            process.end = process.child.try_wait().context("cannot watch a process")?;
        }
        Ok(())
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
        if let Some(process) = self.of(node, generation) {
            process.kill();
            process.verdict = verdict;
        }
    }

    /// Forgets the process of a node's generation, whose end is settled, and what it wrote into the run directory.
    pub fn forget(&mut self, node: usize, generation: u32, run_dir: &Path) {
        if let Some(process) = self.of(node, generation).filter(|process| process.log.starts_with(run_dir)) {
            let _ = std::fs::remove_file(&process.log);
        }
        let role = Role::Node { node, generation };
        self.running.retain(|process| process.role != role || process.end.is_none());
    }

    /// Aborts the run and gives the processes time to leave.
    pub fn take_down(&mut self, control: &Control) -> Result<()> {
        control.abort();
        let start = Instant::now();
        while !self.all_ended() && start.elapsed() < GRACE {
            self.look()?;
            std::thread::sleep(POLL);
        }
        Ok(())
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        self.running.iter_mut().for_each(Process::kill);
        for child in &mut self.companions {
            kill(child);
        }
    }
}

impl Process {
    fn kill(&mut self) {
        if self.end.is_none() {
            self.end = kill(&mut self.child);
        }
    }

    /// How the process ended before the run did, with the last lines it wrote.
    pub fn post_mortem(&self) -> String {
        let end = match (&self.verdict, self.end) {
            (Some(verdict), _) => verdict.clone(),
            (None, Some(end)) => match (end.code(), end.signal()) {
                (Some(0), _) => "ended with exit code 0 before the run did".to_owned(),
                (Some(code), _) => format!("ended with exit code {code}"),
                (None, Some(signal)) => format!("was killed by {}", bus::process::signal_name(signal)),
                (None, None) => "ended".to_owned(),
            },
            (None, None) => "is still running".to_owned(),
        };
        let words = std::fs::read_to_string(&self.log).unwrap_or_default();
        let lines: Vec<&str> = words.strip_prefix(LOG_START).unwrap_or(&words).lines().collect();
        // What a panic says stands in front of its backtrace.
        let last = lines.len().saturating_sub(LOG_LINES);
        let start = lines.iter().position(|line| line.contains("panicked at")).unwrap_or(last);
        let words =
            lines[start..].iter().take(LOG_LINES).map(|line| format!("\n  {line}")).collect::<String>();
        format!("process `{}` {end}{words}", self.name)
    }
}

/// Kills a process and its whole group, since a command may have started processes of its own.
fn kill(child: &mut Child) -> Option<ExitStatus> {
    bus::process::kill_group(child.id());
    let _ = child.kill();
    child.wait().ok()
}
