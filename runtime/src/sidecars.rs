//! Sidecars: processes beside the ticks, such as a viewer. They are started with the run, may say when they are ready,
//! and end with it; an end with an error has the consequences that the manifest names.

use crate::processes::Process;
use crate::program::{OnExit, Program, Readiness};
use crate::role::Role;
use crate::world::{Body, World};
use anyhow::Result;
use std::time::Duration;

/// Shortest life of a sidecar after which a restart makes progress.
const LIFE_MIN: Duration = Duration::from_secs(1);

/// The sidecars of a run; dropping them kills those that still live.
pub struct Sidecars<'a, B: Body> {
    all: Vec<Sidecar<'a, B>>,
}

struct Sidecar<'a, B: Body> {
    name: &'a str,
    program: &'a Program,
    /// None until those have become ready after which it starts.
    process: Option<Process<B>>,
    is_ready: bool,
    /// True if the first tick need not wait for it any more.
    was_ready: bool,
    /// Time at which its process was started, on the watchdogs' clock.
    started: Duration,
}

/// A sidecar that ended with an error, was killed, or ended before it was ready.
#[derive(Debug)]
pub struct Failure {
    /// Its number.
    pub index: usize,
    /// Its name.
    pub name: String,
    /// Policy of its manifest.
    pub policy: OnExit,
    /// True if a restart makes progress.
    pub is_possible: bool,
    /// Description of its end, with the last lines that it wrote.
    pub message: String,
}

impl<'a, B: Body> Sidecars<'a, B> {
    /// An empty set of sidecars.
    pub fn new() -> Self {
        Self { all: Vec::new() }
    }

    /// Adds a sidecar.
    pub fn add(&mut self, name: &'a str, program: &'a Program) {
        let started = Duration::ZERO;
        self.all.push(Sidecar { name, program, process: None, is_ready: false, was_ready: false, started });
    }

    /// Starts those that wait for no other; `now` is the watchdogs' time, here and below.
    ///
    /// # Errors
    /// If one cannot be started.
    pub fn start(&mut self, world: &mut impl World<Body = B>, now: Duration) -> Result<()> {
        while let Some(index) = (0..self.all.len()).find(|index| self.is_due(*index)) {
            let sidecar = &mut self.all[index];
            let role = Role::Sidecar { index, generation: 0 };
            let body = world.start(sidecar.name, role, Some(sidecar.program))?;
            sidecar.process = Some(Process::new(sidecar.name, role, body));
            sidecar.is_ready = sidecar.program.ready == Readiness::Started;
            (sidecar.was_ready, sidecar.started) = (sidecar.is_ready, now);
        }
        Ok(())
    }

    /// True if sidecar `index` has not been started and those have become ready after which it starts.
    fn is_due(&self, index: usize) -> bool {
        let Sidecar { program, process, .. } = &self.all[index];
        let was_ready = |name: &String| self.all.iter().any(|other| other.name == name && other.was_ready);
        process.is_none() && program.after.iter().all(was_ready)
    }

    /// Hears which are ready and looks which have ended; kills those that do not get ready in their time, and starts those that have waited
    /// for others.
    ///
    /// # Errors
    /// If a process cannot be watched or started.
    pub fn look(&mut self, world: &mut impl World<Body = B>, now: Duration) -> Result<()> {
        for (index, sidecar) in self.all.iter_mut().enumerate() {
            let Some(process) = &mut sidecar.process else { continue };
            sidecar.is_ready |= world.hears_ready(index);
            sidecar.was_ready |= sidecar.is_ready;
            process.look()?;
            note_early_end(process, sidecar.is_ready);
            let patience = sidecar.program.watchdog;
            if !sidecar.is_ready && process.end.is_none() && now.saturating_sub(sidecar.started) > patience {
                let milliseconds = patience.as_millis();
                process.kill();
                process.verdict = Some(format!(
                    "was killed by the watchdog: it did not say within {milliseconds} ms that it is ready; \
                     `ready = \"notify\"` waits for READY=1 on the socket NOTIFY_SOCKET, as `systemd-notify \
                     --ready` sends it"
                ));
            }
        }
        self.start(world, now)
    }

    /// The processes of all that were started.
    pub fn bodies(&self) -> impl Iterator<Item = &B> {
        self.all.iter().filter_map(|sidecar| sidecar.process.as_ref()).map(|process| &process.body)
    }

    /// True if every sidecar that the first tick waits for is ready.
    pub fn all_ready(&self) -> bool {
        self.all.iter().all(|sidecar| sidecar.was_ready)
    }

    /// The next one that has failed and is not settled; it counts as settled then.
    pub fn next_failure(&mut self, now: Duration) -> Option<Failure> {
        self.all.iter_mut().enumerate().find_map(|(index, sidecar)| {
            let process = sidecar.process.as_mut()?;
            if process.is_settled || !has_failed(process, sidecar.is_ready) {
                return None;
            }
            process.is_settled = true;
            let lived = now.saturating_sub(sidecar.started);
            Some(Failure {
                index,
                name: process.name.clone(),
                policy: sidecar.program.on_exit,
                is_possible: process.role.generation() == 0 || lived >= LIFE_MIN,
                message: process.post_mortem(),
            })
        })
    }

    /// The run goes on without sidecar `index`, and does not wait for it.
    pub fn forget(&mut self, index: usize) {
        self.all[index].was_ready = true;
    }

    /// Starts sidecar `index` once more.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn restart(&mut self, world: &mut impl World<Body = B>, now: Duration, index: usize) -> Result<()> {
        let sidecar = &mut self.all[index];
        let Some(before) = &mut sidecar.process else { return Ok(()) };
        sidecar.started = now;
        sidecar.is_ready = sidecar.program.ready == Readiness::Started;
        before.body.remove_log();
        let role = Role::Sidecar { index, generation: before.role.generation() + 1 };
        let body = world.start(sidecar.name, role, Some(sidecar.program))?;
        *before = Process::new(sidecar.name, role, body);
        Ok(())
    }
}

impl<B: Body> Drop for Sidecars<'_, B> {
    fn drop(&mut self) {
        self.all.iter_mut().filter_map(|sidecar| sidecar.process.as_mut()).for_each(Process::kill);
    }
}

/// Notes an end with code 0 of a sidecar that had to report that it is ready, and did not. Any other end with code 0 is in order.
fn note_early_end<B: Body>(process: &mut Process<B>, is_ready: bool) {
    if !is_ready && process.verdict.is_none() && process.end.as_ref().is_some_and(|end| end.success()) {
        let text =
            "ended with exit code 0 before it said that it is ready: READY=1 on the socket NOTIFY_SOCKET";
        process.verdict = Some(text.to_owned());
    }
}

/// True if the sidecar of `process` was killed, failed, or ended before it was ready.
fn has_failed<B: Body>(process: &Process<B>, is_ready: bool) -> bool {
    process.end.as_ref().is_some_and(|end| !end.success() || !is_ready) || process.verdict.is_some()
}
