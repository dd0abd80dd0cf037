//! Supervisor of a run: starts its processes, reacts to events, and ends everything again.
//!
//! - `state_machine`: states of a run, events, actions
//! - `decisions`: consequences of the end of a process
//! - `replacement`: backups and their take-overs
//! - `requests`: swaps requested in flight
//! - `ends`: reactions to the end of processes and sidecars
//! - `standstill`: runs that stand still, and backups that do not join
//! - `straggler`: the instance on which a run waits

pub mod decisions;
mod ends;
pub mod replacement;
mod requests;
mod standstill;
pub mod state_machine;
mod straggler;

use crate::ctl::protocol::Request;
use crate::event::{Progress, RunEvent, StopToken};
use crate::graph::Graph;
use crate::processes::{Process, Processes};
use crate::program::{Program, Readiness};
use crate::role::Role;
use crate::sidecars::Sidecars;
use crate::supervisor::decisions::{Abort, Decisions};
use crate::supervisor::replacement::Replacements;
use crate::supervisor::state_machine::{Action, Event, State};
use crate::view::{Command, SegmentWrite};
use crate::watch_clock::WatchClock;
use crate::world::{Body, Spent, World};
use anyhow::Result;
use bus::lockstep::Phase;
use bus::plan::{Plan, SLOTS_PER_NODE};
use diagnostics::ComponentFailure;
use std::time::Duration;

/// Longest sleep of the supervisor between two looks at its processes.
const POLL: Duration = Duration::from_millis(2);
/// Time between two checks of the lengths of the processes' logs.
const LOG_PERIOD: Duration = Duration::from_millis(100);
/// Time between two searches for orphans that have ended.
const REAP_PERIOD: Duration = Duration::from_secs(5);

/// Fisher-Yates with the bus's own generator: the same seed gives the same order.
fn shuffle<T>(items: &mut [T], seed: Option<u64>) {
    use rand_core::Rng;
    let Some(seed) = seed else { return };
    let mut random = bus::random::stream(seed, "start-order");
    for last in (1..items.len()).rev() {
        let pick = random.next_u64() % (last as u64 + 1);
        items.swap(last, usize::try_from(pick).unwrap_or(last));
    }
}

/// Supervisor of a run: passes events to the state machine, and carries out its actions.
pub struct Supervisor<'a, W: World> {
    graph: &'a Graph,
    plan: &'a Plan,
    /// Decides the consequences of every end.
    pub decisions: Decisions<'a>,
    processes: Processes<W::Body>,
    sidecars: Sidecars<'a, W::Body>,
    // After the processes, which end first.
    world: W,
    clock: WatchClock,
    /// Processor time in nanoseconds, and deadlines missed, of each node's instances that have left.
    spent: Vec<Spent>,
    /// Swaps that were requested and have not ended: the request, the warnings of its backup, and the place of its answer.
    swaps: Vec<(u32, Vec<String>, W::Reply)>,
    /// Swaps that were requested before the run flies.
    early: Vec<(Request, W::Reply)>,
    requests: u32,
    stop: &'a StopToken,
    stops_seen: usize,
    listener: &'a mut dyn FnMut(RunEvent<'_>),
    timing: Timing,
}

/// Times of the supervisor's periodic actions, on the watchdogs' clock.
#[derive(Debug, Default)]
struct Timing {
    /// Progress of the run at its last change, and the time of that change.
    last_change: (Advance, Duration),
    logs_bounded: Duration,
    reaped: Duration,
}

/// Progress of a run. After any change of it another process has its turn, and its watchdog begins anew.
#[derive(Debug, Default, PartialEq)]
struct Advance {
    /// Progress of the first instances' joining; none before the first look.
    phase: Option<Phase>,
    /// True if every node has joined as far as the next phase asks: then it is the clock's turn.
    awaits_phase: bool,
    /// Node and generation of the backup that joins: when it has joined, the others, and the clock, have their turn.
    joining: Option<(usize, u32)>,
    /// Ticks that may be computed.
    granted: u32,
    /// Ticks that the instance in each slot has completed.
    done: Vec<u32>,
}

impl<'a, W: World> Supervisor<'a, W> {
    /// The supervisor of a run of `graph` in `world`, which ends when `stop` is used and is followed by `listener`.
    pub fn new(
        graph: &'a Graph,
        world: W,
        stop: &'a StopToken,
        listener: &'a mut dyn FnMut(RunEvent<'_>),
    ) -> Self {
        let plan = &graph.plan;
        let replacements = Replacements::new(plan, world.see(), &graph.programs, &graph.backups);
        Self {
            graph,
            plan,
            decisions: Decisions::new(plan, replacements),
            processes: Processes { running: Vec::new() },
            sidecars: Sidecars::new(),
            clock: WatchClock::new(world.now()),
            world,
            spent: vec![Spent::default(); plan.nodes.len()],
            swaps: Vec::new(),
            early: Vec::new(),
            requests: 0,
            stop,
            stops_seen: 0,
            listener,
            timing: Timing::default(),
        }
    }

    /// Starts all processes, in the order of `start_order_seed`, and watches until they have ended. After any error
    /// the live processes may still leave in order: the recorder finishes its file.
    ///
    /// # Errors
    /// The error that ended the run before its time.
    pub fn fly(&mut self, start_order_seed: Option<u64>) -> Result<()> {
        let flown = self.start(start_order_seed).and_then(|()| self.watch());
        // A changed program that cannot be started has ended the run before its warning was told.
        self.tell_warnings();
        self.see();
        if flown.is_err() && !self.decisions.replacements.view.is_aborted {
            self.take_down();
        }
        if flown.is_ok() {
            self.tell_progress();
        }
        flown
    }

    fn start(&mut self, start_order_seed: Option<u64>) -> Result<()> {
        let graph = self.graph;
        let waits = graph.sidecars.iter().any(|(_, program)| program.ready == Readiness::Notify);
        let join_tick = if waits { 0 } else { self.join_tick() };
        self.world.write(SegmentWrite::JoinTick(join_tick));
        let nodes = graph.programs.iter().zip(&graph.plan.nodes).enumerate();
        let nodes = nodes.map(|(node, (program, plan))| {
            (plan.name.as_str(), Role::Node { node, generation: 0 }, Some(program))
        });
        let mut all: Vec<_> = std::iter::once(("clock", Role::Clock, None)).chain(nodes).collect();
        shuffle(&mut all, start_order_seed);
        for (name, role, program) in all {
            self.start_process(name, role, program)?;
        }
        graph.sidecars.iter().for_each(|(name, program)| self.sidecars.add(name, program));
        self.sidecars.start(&mut self.world, self.clock.now())?;
        self.tell(Event::Started).map(|_| ())
    }

    fn start_process(&mut self, name: &str, role: Role, program: Option<&Program>) -> Result<()> {
        let body = self.world.start(name, role, program)?;
        let group = match role {
            Role::Node { node, generation: 0 } => self.plan.group_of(node).map(|group| group.name.clone()),
            _ => None,
        };
        self.processes.running.push(Process { group, ..Process::new(name, role, body) });
        Ok(())
    }

    /// The tick at which the clock must wait for joining instances, and for sidecars that are not ready.
    fn join_tick(&self) -> u32 {
        if self.sidecars.all_ready() { self.decisions.replacements.hold_tick() } else { 0 }
    }

    /// Watches until all processes have ended.
    fn watch(&mut self) -> Result<()> {
        while !self.decisions.state.is_over() {
            let notices = self.world.notices();
            self.look()?;
            self.world.wait(notices, POLL);
        }
        Ok(())
    }

    /// Looks once at everything, and carries out the consequences.
    fn look(&mut self) -> Result<()> {
        self.clock.look(self.world.now());
        self.processes.look()?;
        self.sidecars.look(&mut self.world, self.clock.now())?;
        self.tidy();
        self.see();
        self.settle_ends()?;
        self.settle_sidecars()?;
        self.note_interrupts()?;
        self.note_progress()?;
        self.serve_requests();
        if self.decisions.state == State::Draining {
            self.decisions.replacements.end();
            self.carry_out()?;
        }
        let ended = self.decisions.note_too_late();
        self.follow(ended)?;
        // Before `advance` too: a held run must stay held while a backup joins.
        self.see();
        self.world.write(SegmentWrite::JoinTick(self.join_tick()));
        self.see();
        self.decisions.replacements.advance();
        self.carry_out()?;
        self.world.write(SegmentWrite::JoinTick(self.join_tick()));
        self.decisions.note_laggards();
        self.carry_out()?;
        self.see();
        self.tell_warnings();
        self.note_stall()?;
        self.tell_progress();
        Ok(())
    }

    fn say(&mut self, text: &str) {
        (self.listener)(RunEvent::Note(text));
    }

    /// Reports what is unusual about processes that were started.
    fn tell_warnings(&mut self) {
        for warning in self.world.take_warnings() {
            self.say(&warning);
        }
    }

    /// Reports the progress of the run.
    fn tell_progress(&mut self) {
        let view = &self.decisions.replacements.view;
        let has_begun = !view.first_grant.is_zero();
        let flown = if has_begun { view.host.saturating_sub(view.first_grant) } else { Duration::ZERO };
        (self.listener)(RunEvent::Progress(Progress {
            ticks: view.completed_ticks(),
            duration_ticks: self.plan.duration_ticks,
            tick_s: self.plan.tick_s(),
            host_s: flown.as_secs_f64(),
        }));
    }

    /// Looks at the control segment.
    fn see(&mut self) {
        let mut view = self.world.see();
        view.living = self.processes.living().collect();
        (view.now, view.host) = (self.clock.now(), self.world.now());
        self.decisions.replacements.view = view;
    }

    /// Carries out the commands of the replacements.
    fn carry_out(&mut self) -> Result<()> {
        while !self.decisions.replacements.view.commands.is_empty() {
            for command in std::mem::take(&mut self.decisions.replacements.view.commands) {
                self.execute(command)?;
            }
        }
        Ok(())
    }

    fn execute(&mut self, command: Command) -> Result<()> {
        match command {
            Command::Spawn { node, generation, backup } => {
                let stored = self.world.store_backup(&backup, generation);
                let role = Role::Node { node, generation };
                let name = &self.plan.nodes[node].name;
                let started = stored
                    .map_err(anyhow::Error::from)
                    .and_then(|()| self.start_process(name, role, Some(&backup.program)));
                if let Err(error) = started {
                    self.decisions.replacements.note_not_started(node, generation, error)?;
                }
            }
            Command::Kill { node, generation, message } => {
                self.processes.kill(Role::Node { node, generation }, message);
            }
            Command::Settle { node, generation } => {
                if let Some(process) = self.processes.of(node, generation) {
                    process.is_settled = true;
                }
            }
            Command::Free { node, generation, slot } => self.free(node, generation, slot),
            Command::Store(membership) => self.world.store_membership(&membership)?,
            Command::Write(write) => self.world.write(write),
        }
        Ok(())
    }

    /// Removes the remains of a process that has ended, and frees its slot.
    fn free(&mut self, node: usize, generation: u32, slot: usize) {
        self.spent[node] = self.spent[node].plus(self.world.spent(slot));
        self.world.write(SegmentWrite::Clear(slot));
        let process = self.processes.of(node, generation);
        let end = process.and_then(|process| process.end.as_ref());
        self.world.remove_traces(node, generation, end.is_some_and(|end| !end.success()));
        self.processes.forget(node, generation);
    }

    /// Processor time, deadlines missed and steps missed of all instances of `node` together.
    pub fn spent_by(&self, node: usize) -> Spent {
        let slots = (0..SLOTS_PER_NODE).map(|slot| slot * self.plan.nodes.len() + node);
        slots.map(|slot| self.world.spent(slot)).fold(self.spent[node], Spent::plus)
    }

    /// Bounds the lengths of logs, and reaps orphans that have ended: they would stay in the table of processes for the
    /// whole run.
    fn tidy(&mut self) {
        let now = self.clock.now();
        let bodies = || {
            let processes = self.processes.running.iter().map(|process| &process.body);
            processes.chain(self.sidecars.bodies())
        };
        if now.saturating_sub(self.timing.logs_bounded) >= LOG_PERIOD {
            self.timing.logs_bounded = now;
            bodies().for_each(Body::bound_log);
        }
        if now.saturating_sub(self.timing.reaped) >= REAP_PERIOD {
            self.timing.reaped = now;
            self.world.reap(&bodies().filter_map(Body::id).collect::<Vec<u32>>());
        }
    }

    /// Passes an event to the state machine, and carries out the consequences.
    fn tell(&mut self, event: Event) -> Result<Action> {
        let action = self.decisions.tell(event);
        self.carry_out()?;
        Ok(action)
    }

    /// Carries out a decision, and ends the run if that was it.
    fn follow<T>(&mut self, decided: Result<T, Abort>) -> Result<T> {
        for note in std::mem::take(&mut self.decisions.notes) {
            self.say(&note);
        }
        self.carry_out()?;
        if std::mem::take(&mut self.decisions.has_answered) {
            self.timing.last_change.1 = self.clock.now();
        }
        decided.or_else(|Abort { process, message }| self.fail(&process, message))
    }

    /// Ends the run because `process` has failed.
    fn fail<T>(&mut self, process: &str, message: String) -> Result<T> {
        self.abort(ComponentFailure::new(Some(process), message))
    }

    fn abort<T>(&mut self, error: impl Into<anyhow::Error>) -> Result<T> {
        self.take_down();
        Err(error.into())
    }

    /// Ends all processes. A failure is only noted: the error of the run stays the one that ended it.
    fn take_down(&mut self) {
        let nodes = self.plan.nodes.iter().enumerate();
        let readers: Vec<_> =
            nodes.filter(|(_, node)| node.outputs.is_empty()).map(|(node, _)| node).collect();
        if let Err(error) = self.processes.take_down(&mut self.world, &readers) {
            self.say(&format!("cannot end all processes: {error:#}"));
        }
    }
}
