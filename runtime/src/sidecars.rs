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
    program: &'a Program,
    process: Process<B>,
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

    /// Starts a sidecar; `now` is the watchdogs' time, here and below.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start(
        &mut self,
        world: &mut impl World<Body = B>,
        now: Duration,
        name: &str,
        program: &'a Program,
    ) -> Result<()> {
        let role = Role::Sidecar { index: self.all.len(), generation: 0 };
        let process = Process::new(name, role, world.start(name, role, Some(program))?);
        let is_ready = program.ready == Readiness::Started;
        self.all.push(Sidecar { program, process, is_ready, was_ready: is_ready, started: now });
        Ok(())
    }

    /// Hears which are ready and looks which have ended; kills those that do not get ready in their time.
    ///
    /// # Errors
    /// If a process cannot be watched.
    pub fn look(&mut self, world: &mut impl World<Body = B>, now: Duration) -> Result<()> {
        for (index, sidecar) in self.all.iter_mut().enumerate() {
            sidecar.is_ready |= world.hears_ready(index);
            sidecar.was_ready |= sidecar.is_ready;
            sidecar.process.look()?;
            sidecar.note_early_end();
            let patience = sidecar.program.watchdog;
            if !sidecar.is_ready
                && sidecar.process.end.is_none()
                && now.saturating_sub(sidecar.started) > patience
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

    /// The processes of all.
    pub fn bodies(&self) -> impl Iterator<Item = &B> {
        self.all.iter().map(|sidecar| &sidecar.process.body)
    }

    /// True if every sidecar that the first tick waits for is ready.
    pub fn all_ready(&self) -> bool {
        self.all.iter().all(|sidecar| sidecar.was_ready)
    }

    /// The next one that has failed and is not settled; it counts as settled then.
    pub fn next_failure(&mut self, now: Duration) -> Option<Failure> {
        let has_failed = |sidecar: &Sidecar<'_, B>| !sidecar.process.is_settled && sidecar.has_failed();
        let index = self.all.iter().position(has_failed)?;
        let sidecar = &mut self.all[index];
        sidecar.process.is_settled = true;
        let lived = now.saturating_sub(sidecar.started);
        Some(Failure {
            index,
            name: sidecar.process.name.clone(),
            policy: sidecar.program.on_exit,
            is_possible: sidecar.process.role.generation() == 0 || lived >= LIFE_MIN,
            message: sidecar.process.post_mortem(),
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
        sidecar.started = now;
        sidecar.is_ready = sidecar.program.ready == Readiness::Started;
        sidecar.process.body.remove_log();
        let role = Role::Sidecar { index, generation: sidecar.process.role.generation() + 1 };
        let name = sidecar.process.name.clone();
        let body = world.start(&name, role, Some(sidecar.program))?;
        sidecar.process = Process::new(&name, role, body);
        Ok(())
    }
}

impl<B: Body> Drop for Sidecars<'_, B> {
    fn drop(&mut self) {
        self.all.iter_mut().for_each(|sidecar| sidecar.process.kill());
    }
}

impl<B: Body> Sidecar<'_, B> {
    /// Notes an end with code 0 of a sidecar that had to report that it is ready, and did not. Any other end with
    /// code 0 is in order.
    fn note_early_end(&mut self) {
        if !self.is_ready
            && self.process.verdict.is_none()
            && self.process.end.as_ref().is_some_and(|end| end.success())
        {
            let text =
                "ended with exit code 0 before it said that it is ready: READY=1 on the socket NOTIFY_SOCKET";
            self.process.verdict = Some(text.to_owned());
        }
    }

    /// True if it was killed, failed, or ended before it was ready.
    fn has_failed(&self) -> bool {
        self.process.end.as_ref().is_some_and(|end| !end.success() || !self.is_ready)
            || self.process.verdict.is_some()
    }
}
