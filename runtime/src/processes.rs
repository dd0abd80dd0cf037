//! The processes of a run on the host: started, watched, and taken down.

use crate::host::{Body, End, Host, Thread};
use crate::process_log::{self, last_words};
use crate::program::{Executable, Program};
use crate::role::Role;
use crate::spawn;
use crate::watch_clock::WatchClock;
use anyhow::Result;
use bus::lockstep::SupervisorView;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// How long processes have to leave by themselves after an abort.
const GRACE: Duration = Duration::from_secs(2);
const POLL: Duration = Duration::from_millis(2);

/// A process of a run.
#[derive(Debug)]
pub struct Process {
    /// The name in messages: that of its node, and for a backup its generation.
    pub name: String,
    /// What it is for.
    pub role: Role,
    log: PathBuf,
    body: Body,
    /// How it ended.
    pub end: Option<End>,
    /// Whether somebody has drawn the consequences of its end.
    pub is_settled: bool,
    /// Why the launcher killed it.
    pub verdict: Option<String>,
}

/// The processes of a run; dropping them kills those that still live.
#[derive(Debug)]
pub struct Processes {
    host: Host,
    control: Arc<SupervisorView>,
    /// Those that were started and whose end is not settled.
    pub running: Vec<Process>,
}

impl Processes {
    /// No processes yet of the run that `control` is of.
    pub fn new(host: Host, control: Arc<SupervisorView>) -> Self {
        Self { host, control, running: Vec::new() }
    }

    /// Starts a process; the clock where there is no program.
    pub fn start(&mut self, name: &str, role: Role, program: Option<&Program>, run_dir: &Path) -> Result<()> {
        let process = match &self.host {
            Host::Exe(exe) => Process::start(exe, name, role, program, run_dir, None)?,
            Host::InProcess => Process::start_thread(&self.control, name, role, program, run_dir)?,
        };
        self.running.push(process);
        Ok(())
    }

    /// The process numbers of all.
    pub fn ids(&self) -> impl Iterator<Item = u32> {
        self.running.iter().filter_map(Process::id)
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
    pub fn take_down(&mut self, control: &SupervisorView) -> Result<()> {
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
    /// Starts a process; the clock where there is no program. `notify` is the socket on which a sidecar says that
    /// it is ready.
    pub fn start(
        exe: &Path,
        name: &str,
        role: Role,
        program: Option<&Program>,
        run_dir: &Path,
        notify: Option<&Path>,
    ) -> Result<Self> {
        let (child, log) = match program {
            None => spawn::start_clock(exe, run_dir)?,
            Some(program) => spawn::start(exe, run_dir, name, role, program, notify)?,
        };
        Ok(Self::new(name, role, log, Body::Process(child)))
    }

    /// Starts a component on a thread of this process; the clock where there is no program.
    fn start_thread(
        control: &Arc<SupervisorView>,
        name: &str,
        role: Role,
        program: Option<&Program>,
        run_dir: &Path,
    ) -> Result<Self> {
        program.map_or(Ok(()), |program| Host::InProcess.require(name, program))?;
        let component = program.and_then(|program| match &program.executable {
            Executable::Component(component) => Some(*component),
            Executable::Command(_) => None,
        });
        let thread = Thread::start(component, run_dir.to_owned(), name, role.generation(), control.clone())?;
        Ok(Self::new(name, role, PathBuf::new(), Body::Thread(thread)))
    }

    fn new(name: &str, role: Role, log: PathBuf, body: Body) -> Self {
        let name = match role {
            Role::Node { generation, .. } => bus::names::process_name(name, generation),
            Role::Clock | Role::Sidecar { .. } => name.to_owned(),
        };
        Self { name, role, log, body, end: None, is_settled: false, verdict: None }
    }

    /// Its process number, if it is a process of its own.
    pub fn id(&self) -> Option<u32> {
        self.body.id()
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
            self.end = self.body.end()?;
        }
        Ok(())
    }

    /// Kills the process and its group, and waits for its end.
    pub fn kill(&mut self) {
        if self.end.is_none() {
            self.end = self.body.kill();
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
        let end = match (&self.verdict, &self.end) {
            (Some(verdict), _) => verdict.clone(),
            (None, Some(end)) => end.message(),
            (None, None) => "is still running".to_owned(),
        };
        let words: String = last_words(&self.log).iter().map(|line| format!("\n  {line}")).collect();
        format!("process `{}` {end}{words}", self.name)
    }
}
