//! The processes of a run: watched, and taken down.

use crate::host::{self, End};
use crate::program::advice_on;
use crate::role::Role;
use crate::view::SegmentWrite;
use crate::watch_clock::WatchClock;
use crate::world::{Body, World};
use anyhow::Result;
use std::time::Duration;

/// Time that processes have to leave by themselves after an abort.
const GRACE: Duration = Duration::from_secs(2);
const POLL: Duration = Duration::from_millis(2);

/// A process of a run.
#[derive(Debug)]
pub struct Process<B: Body> {
    /// The name in messages: that of its node, and for a backup its generation.
    pub name: String,
    /// Its role.
    pub role: Role,
    /// Group whose process it shares.
    pub group: Option<String>,
    /// The process or thread itself.
    pub body: B,
    /// Its end, if it has ended.
    pub end: Option<End>,
    /// True if its end was dealt with.
    pub is_settled: bool,
    /// Reason why the launcher killed it.
    pub verdict: Option<String>,
}

/// The processes of a run; dropping them kills those that still live.
#[derive(Debug)]
pub struct Processes<B: Body> {
    /// Processes that were started and whose end is not settled.
    pub running: Vec<Process<B>>,
}

impl<B: Body> Processes<B> {
    /// Looks which processes have ended.
    pub fn look(&mut self) -> Result<()> {
        self.running.iter_mut().try_for_each(Process::look)
    }

    /// True if every process has ended.
    pub fn all_ended(&self) -> bool {
        self.running.iter().all(|process| process.end.is_some())
    }

    /// The processes of nodes that live: node and generation.
    pub fn living(&self) -> impl Iterator<Item = (usize, u32)> {
        let living = self.running.iter().filter(|process| process.end.is_none());
        living.filter_map(|process| match process.role {
            Role::Node { node, generation } => Some((node, generation)),
            Role::Clock | Role::Sidecar { .. } => None,
        })
    }

    /// The process of a node's generation.
    pub fn of(&mut self, node: usize, generation: u32) -> Option<&mut Process<B>> {
        self.running.iter_mut().find(|process| process.role == Role::Node { node, generation })
    }

    /// Kills the process of this role and waits for its end.
    pub fn kill(&mut self, role: Role, verdict: Option<String>) {
        if let Some(process) = self.running.iter_mut().find(|process| process.role == role) {
            process.kill();
            process.verdict = verdict;
        }
    }

    /// Forgets the process of a node's generation, whose end is settled, and removes its log from the run directory.
    pub fn forget(&mut self, node: usize, generation: u32) {
        if let Some(process) = self.of(node, generation) {
            process.body.remove_log();
        }
        let role = Role::Node { node, generation };
        self.running.retain(|process| process.role != role || process.end.is_none());
    }

    /// Aborts the run and gives the processes time to leave: first the senders, then those of `readers`, the nodes
    /// that only read and so record the last samples.
    pub fn take_down(&mut self, world: &mut impl World, readers: &[usize]) -> Result<()> {
        let reads = |role: Role| matches!(role, Role::Node { node, .. } if readers.contains(&node));
        world.write(SegmentWrite::Abort);
        self.await_ends(world, |role| !reads(role))?;
        world.write(SegmentWrite::Drained);
        self.await_ends(world, |_| true)
    }

    /// Waits until the processes of these roles have ended, for as long as there is patience.
    fn await_ends(&mut self, world: &mut impl World, are_meant: impl Fn(Role) -> bool) -> Result<()> {
        let mut clock = WatchClock::new(world.now());
        while clock.now() < GRACE
            && self.running.iter().any(|process| process.end.is_none() && are_meant(process.role))
        {
            let notices = world.notices();
            self.look()?;
            world.wait(notices, POLL);
            clock.look(world.now());
        }
        Ok(())
    }
}

impl<B: Body> Drop for Processes<B> {
    fn drop(&mut self) {
        // All are asked before one is waited for: those that hang share one patience.
        self.running.iter().for_each(|process| process.body.cancel());
        let mut patience = host::GRACE;
        self.running.iter_mut().for_each(|process| process.kill_within(&mut patience));
    }
}

impl<B: Body> Process<B> {
    /// The process of `body`, which is `name` in its run.
    pub fn new(name: &str, role: Role, body: B) -> Self {
        let name = match role {
            Role::Node { generation, .. } => bus::names::process_name(name, generation),
            Role::Clock | Role::Sidecar { .. } => name.to_owned(),
        };
        Self { name, role, group: None, body, end: None, is_settled: false, verdict: None }
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
        self.kill_within(&mut host::GRACE.clone());
    }

    fn kill_within(&mut self, patience: &mut Duration) {
        if self.end.is_none() {
            self.end = self.body.kill(patience);
        }
    }

    /// Description of the end of a process before that of the run, with the last lines that it wrote and advice on them.
    pub fn post_mortem(&self) -> String {
        let end = match (&self.verdict, &self.end) {
            (Some(verdict), _) => verdict.clone(),
            (None, Some(end)) => end.message(),
            (None, None) => "is still running".to_owned(),
        };
        let words = self.body.last_lines();
        let lines: String = words.iter().map(|line| format!("\n  {line}")).collect();
        let advice = advice_on(&words).map_or_else(String::new, |advice| format!("\n{advice}"));
        let group = self.group.as_ref().map_or(String::new(), |group| format!(" of group `{group}`"));
        format!("process `{}`{group} {end}{lines}{advice}", self.name)
    }
}
