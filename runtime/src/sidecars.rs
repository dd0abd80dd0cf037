//! Sidecars: processes beside the ticks, such as a viewer. They are started with the run, may say when they are ready,
//! and end with it; an end with an error has the consequences that the manifest names.

use crate::processes::Process;
use crate::program::{OnExit, Program, Readiness};
use crate::role::Role;
use crate::watch_clock::WatchClock;
use anyhow::{Context, Result};
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long a sidecar must have lived for a restart to lead somewhere.
const LIFE_MIN: Duration = Duration::from_secs(1);
/// Messages of a sidecar that are read in one look, so that one that never ends keeps nobody waiting.
const MESSAGES_MAX: usize = 32;
/// The longest message of sd_notify(3) that is looked at.
const MESSAGE_BYTES: usize = 4096;

/// The sidecars of a run; dropping them kills those that still live.
pub struct Sidecars<'a> {
    all: Vec<Sidecar<'a>>,
    exe: &'a Path,
    run_dir: &'a Path,
    clock: &'a WatchClock,
}

struct Sidecar<'a> {
    program: &'a Program,
    process: Process,
    generation: u32,
    /// Where it says that it is ready; `None` for one that need not.
    socket: Option<(UnixDatagram, PathBuf)>,
    is_ready: bool,
    /// Whether the first tick need not wait for it any more.
    was_ready: bool,
    started: Duration,
}

/// A sidecar that ended with an error, was killed, or ended before it was ready.
#[derive(Debug)]
pub struct Failure {
    /// Which.
    pub index: usize,
    /// Its name.
    pub name: String,
    /// What its manifest says.
    pub policy: OnExit,
    /// Whether a restart leads somewhere.
    pub is_possible: bool,
    /// How it ended, with its last words.
    pub words: String,
}

impl<'a> Sidecars<'a> {
    /// No sidecars yet.
    pub fn new(exe: &'a Path, run_dir: &'a Path, clock: &'a WatchClock) -> Self {
        Self { all: Vec::new(), exe, run_dir, clock }
    }

    /// Starts a sidecar.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start(&mut self, name: &str, program: &'a Program) -> Result<()> {
        let socket = match program.ready {
            Readiness::Started => None,
            Readiness::Notify => Some(open_socket(name, self.all.len(), self.run_dir)?),
        };
        let notify = socket.as_ref().map(|(_, path)| path.as_path());
        let process = Process::start(
            self.exe,
            name,
            Role::Sidecar { generation: 0 },
            Some(program),
            self.run_dir,
            notify,
        )?;
        let (is_ready, started) = (socket.is_none(), self.clock.now());
        let was_ready = is_ready;
        self.all.push(Sidecar { program, process, generation: 0, socket, is_ready, was_ready, started });
        Ok(())
    }

    /// Hears who is ready and looks who has ended; kills those that do not get ready in their time.
    ///
    /// # Errors
    /// If a process cannot be watched.
    pub fn look(&mut self) -> Result<()> {
        for sidecar in &mut self.all {
            sidecar.hear();
            sidecar.process.look()?;
            sidecar.note_early_end();
            let patience = sidecar.program.watchdog;
            if !sidecar.is_ready
                && sidecar.process.end.is_none()
                && self.clock.since(sidecar.started) > patience
            {
                let milliseconds = patience.as_millis();
                sidecar.process.kill();
                sidecar.process.verdict = Some(format!(
                    "was killed by the watchdog: it did not say within {milliseconds} ms that it is ready; \
                     `ready = \"notify\"` waits for READY=1 on the socket NOTIFY_SOCKET, as `systemd-notify \
                     --ready` sends it"
                ));
            }
        }
        Ok(())
    }

    /// The process numbers of all.
    pub fn ids(&self) -> impl Iterator<Item = u32> {
        self.all.iter().filter_map(|sidecar| sidecar.process.id())
    }

    /// Keeps logs in the run directory from filling its file system.
    pub fn bound_logs(&self) {
        self.all.iter().for_each(|sidecar| sidecar.process.bound_log(self.run_dir));
    }

    /// Whether all that the first tick waits for are ready.
    pub fn all_ready(&self) -> bool {
        self.all.iter().all(|sidecar| sidecar.was_ready)
    }

    /// The next one that has failed and of which nobody has drawn the consequences; it counts as settled then.
    pub fn next_failure(&mut self) -> Option<Failure> {
        let has_failed = |sidecar: &Sidecar<'_>| !sidecar.process.is_settled && sidecar.has_failed();
        let index = self.all.iter().position(has_failed)?;
        let sidecar = &mut self.all[index];
        sidecar.process.is_settled = true;
        let lived = self.clock.since(sidecar.started);
        Some(Failure {
            index,
            name: sidecar.process.name.clone(),
            policy: sidecar.program.on_exit,
            is_possible: sidecar.generation == 0 || lived >= LIFE_MIN,
            words: sidecar.process.post_mortem(),
        })
    }

    /// The run goes on without sidecar `index`: nobody waits for it.
    pub fn forget(&mut self, index: usize) {
        self.all[index].was_ready = true;
    }

    /// Starts sidecar `index` once more.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn restart(&mut self, index: usize) -> Result<()> {
        let sidecar = &mut self.all[index];
        sidecar.generation += 1;
        sidecar.started = self.clock.now();
        sidecar.is_ready = sidecar.socket.is_none();
        sidecar.process.remove_log(self.run_dir);
        sidecar.process = Process::start(
            self.exe,
            &sidecar.process.name,
            Role::Sidecar { generation: sidecar.generation },
            Some(sidecar.program),
            self.run_dir,
            sidecar.socket.as_ref().map(|(_, path)| path.as_path()),
        )?;
        Ok(())
    }
}

impl Drop for Sidecars<'_> {
    fn drop(&mut self) {
        self.all.iter_mut().for_each(|sidecar| sidecar.process.kill());
    }
}

impl Sidecar<'_> {
    /// Reads what it said: lines of `NAME=VALUE`, of which one is `READY=1`.
    fn hear(&mut self) {
        let Some((socket, _)) = &self.socket else { return };
        let mut message = [0; MESSAGE_BYTES];
        for _ in 0..MESSAGES_MAX {
            let Ok(length) = socket.recv(&mut message) else { break };
            self.is_ready |= message[..length].split(|&byte| byte == b'\n').any(|line| line == b"READY=1");
        }
        self.was_ready |= self.is_ready;
    }

    /// An end with code 0 is one of a sidecar that has done its part, but for one that was to say that it is ready.
    fn note_early_end(&mut self) {
        if !self.is_ready
            && self.process.verdict.is_none()
            && self.process.end.as_ref().is_some_and(|end| end.success())
        {
            let words =
                "ended with exit code 0 before it said that it is ready: READY=1 on the socket NOTIFY_SOCKET";
            self.process.verdict = Some(words.to_owned());
        }
    }

    /// Whether it has ended in another way than one that has done its part.
    fn has_failed(&self) -> bool {
        self.process.end.as_ref().is_some_and(|end| !end.success() || !self.is_ready)
            || self.process.verdict.is_some()
    }
}

/// The socket on which sidecar `name`, the one of this number, says that it is ready, and where it lies. The path of
/// a socket may have 107 bytes only, so that the name is not in it.
fn open_socket(name: &str, number: usize, run_dir: &Path) -> Result<(UnixDatagram, PathBuf)> {
    let path = run_dir.join(format!("{number}.notify"));
    let socket = UnixDatagram::bind(&path)
        .with_context(|| format!("process `{name}`: cannot open the socket {}", path.display()))?;
    socket.set_nonblocking(true).context("cannot read a socket without waiting")?;
    Ok((socket, path))
}
