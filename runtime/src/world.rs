//! Interface of a supervisor to the world outside it: the control segment, processes, files, the host's clock, and
//! requests. `host_world.rs` is the real one; the simulation draws another from a seed.

use crate::ctl::protocol::{Answer, Request};
use crate::host::End;
use crate::program::{BackupSpec, Program};
use crate::role::Role;
use crate::view::{SegmentWrite, View};
use anyhow::Result;
use bus::BusError;
use bus::membership::Membership;
use bus::plan::InputPlan;
use diagnostics::Diagnostic;
use std::time::Duration;

/// Processor time and delays of an instance of a node.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spent {
    /// Processor time.
    pub cpu_ns: u64,
    /// Deadlines at which it was late.
    pub late: u32,
    /// Steps that took longer, in simulated time, than to its next due tick.
    pub overruns: u32,
    /// Due ticks without a step.
    pub skipped_steps: u32,
}

impl Spent {
    /// The sum of two.
    pub fn plus(self, other: Self) -> Self {
        Self {
            cpu_ns: self.cpu_ns + other.cpu_ns,
            late: self.late + other.late,
            overruns: self.overruns + other.overruns,
            skipped_steps: self.skipped_steps + other.skipped_steps,
        }
    }
}

/// The world outside a supervisor.
pub trait World {
    /// A started process.
    type Body: Body;
    /// Destination of the answer to a request.
    type Reply;

    /// The host's monotonic clock.
    fn now(&self) -> Duration;

    /// Observation of the control segment; the living instances and the time are left out.
    fn see(&self) -> View;
    /// The topic for which the instance in `slot`, whose inputs are `inputs`, sleeps.
    fn awaited_topic(&self, slot: usize, inputs: &[InputPlan]) -> Option<usize>;
    /// Writes to the control segment, and wakes the processes that wait for it.
    fn write(&mut self, write: SegmentWrite);
    /// The count of the supervisor's notices: to be read before a look at the run, and waited on after it.
    fn notices(&self) -> u32;
    /// Sleeps until there is something to look at since `notices`, at most `timeout`.
    fn wait(&mut self, notices: u32, timeout: Duration);
    /// Processor time and delays of the instance in `slot`.
    fn spent(&self, slot: usize) -> Spent;

    /// Starts a process; the clock if `program` is `None`.
    ///
    /// # Errors
    /// If it cannot be started.
    fn start(&mut self, name: &str, role: Role, program: Option<&Program>) -> Result<Self::Body>;
    /// Warnings about processes that were started since the last call.
    fn take_warnings(&mut self) -> Vec<String> {
        Vec::new()
    }
    /// True if sidecar `index` has reported that it is ready since the last call.
    fn hears_ready(&mut self, index: usize) -> bool;
    /// Takes note of orphans that have ended, except for the processes `known`, which are waited for elsewhere.
    fn reap(&self, known: &[u32]);

    /// Writes the plan that the `backup`, as process `generation` of its node, reads about itself.
    ///
    /// # Errors
    /// If the file cannot be written.
    fn store_backup(&mut self, backup: &BackupSpec, generation: u32) -> Result<(), BusError>;
    /// Writes a membership.
    ///
    /// # Errors
    /// If the file cannot be written.
    fn store_membership(&mut self, membership: &Membership) -> Result<(), BusError>;
    /// Removes the remains of an instance that has ended; one that was killed has removed nothing itself.
    fn remove_traces(&mut self, node: usize, generation: u32, was_killed: bool);

    /// Serves the requests to the run; returns one that is for the supervisor, a swap.
    fn next_request(&mut self) -> Option<(Request, Self::Reply)>;
    /// Answers a request.
    fn answer(&mut self, reply: Self::Reply, answer: &Answer);
    /// The backup of `process` that a request describes as `with`, and its legal but unusual values.
    ///
    /// # Errors
    /// If there is no such process, or the backup cannot replace it.
    fn backup_of(&self, process: &str, with: &str) -> Result<(BackupSpec, Vec<Diagnostic>), Diagnostic>;
}

/// A started process.
pub trait Body {
    /// Its process number, if it is a process of its own.
    fn id(&self) -> Option<u32>;
    /// Its end, if it has ended.
    ///
    /// # Errors
    /// If it cannot be watched.
    fn end(&mut self) -> Result<Option<End>>;
    /// Asks a thread to end; a process is not asked.
    fn cancel(&self) {}
    /// Kills it and its group, and waits for its end. `patience` is the longest time that a thread may take; the time
    /// taken is subtracted from it.
    fn kill(&mut self, patience: &mut Duration) -> Option<End>;
    /// The last lines that it wrote.
    fn last_lines(&self) -> Vec<String>;
    /// Keeps its log from filling the file system of the run directory. A log that the manifest names is its user's.
    fn bound_log(&self);
    /// Removes its log, if that lies in the run directory.
    fn remove_log(&self);
}
