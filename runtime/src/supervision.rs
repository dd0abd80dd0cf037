//! Watching over a run: starts its processes, answers what happens, and takes everything down again.

use crate::ctl::control::ControlServer;
use crate::ctl::protocol::{Answer, Request};
use crate::ctl::server::Reply;
use crate::descendants::Descendants;
use crate::event::{Progress, RunEvent, StopToken};
use crate::graph::{Graph, backup_of};
use crate::manifest::Manifest;
use crate::overseer::{Abort, Death, Overseer};
use crate::processes::Processes;
use crate::program::{BackupSpec, OnExit, Readiness};
use crate::replacement::{Report, Stage, take_over_stride};
use crate::role::Role;
use crate::sidecars::Sidecars;
use crate::stall::{self, Straggler};
use crate::supervisor::{Action, Event, State};
use crate::view::{Command, View};
use crate::watch_clock::WatchClock;
use anyhow::{Result, anyhow};
use bus::host_time::monotonic_ns;
use bus::lockstep::SupervisorView;
use bus::plan::{Plan, SLOTS_PER_NODE};
use std::path::Path;
use std::time::Duration;

/// How long the supervisor sleeps at most between two looks at its processes.
const POLL: Duration = Duration::from_millis(2);

/// How often the lengths of the processes' logs are looked at.
const LOG_PERIOD: Duration = Duration::from_millis(100);
/// How often orphans that have ended are looked for.
const REAP_PERIOD: Duration = Duration::from_secs(5);

/// Ticks that a backup shadows where a request does not say.
const SHADOW_TICKS: u32 = 100;

/// What became of a swap, for who asked for it.
fn answer(report: &Report) -> Answer {
    match (&report.refused, report.take_over_tick) {
        (Some(reason), _) => Answer::refused(reason.clone()),
        (None, Some(tick)) => Answer::Done {
            text: format!(
                "`{}.{}` flies from tick {tick}; handed over: {}",
                report.process,
                report.generation,
                report.hand_over.unwrap_or("nothing")
            ),
            tick,
        },
        (None, None) => Answer::refused("the run ended before the take-over"),
    }
}

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

/// Watches over a run: what happens is told to the state machine, and what that answers is done.
pub struct Supervisor<'a> {
    /// The manifest, for backups that are asked for.
    pub manifest: &'a Manifest,
    /// What it means.
    pub graph: &'a Graph,
    /// The plan of the run.
    pub plan: &'a Plan,
    /// Its control segment.
    pub control: &'a SupervisorView,
    /// The clock and the nodes.
    pub processes: Processes,
    /// Processes beside the ticks.
    pub sidecars: Sidecars<'a>,
    /// The watchdogs' clock.
    pub clock: &'a WatchClock,
    /// Per node: processor time in nanoseconds, and deadlines missed, of the instances that have left.
    pub spent: Vec<(u64, u32)>,
    /// What follows when something ends.
    pub overseer: Overseer<'a>,
    /// Serves requests.
    pub control_server: ControlServer<'a>,
    /// Swaps that were asked for and have not come to their end: the request, and who asked.
    pub swaps: Vec<(u32, Reply)>,
    /// Requests so far.
    pub requests: u32,
    /// Whether somebody asked for a stop.
    pub stop: &'a StopToken,
    /// How often somebody had at the last look.
    pub seen_stops: usize,
    /// Hears what happens.
    pub on: &'a mut dyn FnMut(RunEvent<'_>),
    /// Where the run keeps its files.
    pub run_dir: &'a Path,
    /// What the processes started, where that is to end with the run.
    pub descendants: Option<&'a Descendants>,
    /// When things were done last.
    pub timing: Timing,
}

/// When the supervisor did what it does now and then, on the watchdogs' clock.
#[derive(Debug, Default)]
pub struct Timing {
    /// How far the run had come when it last came on, and when that was.
    last_change: (u32, Duration),
    logs_bounded: Duration,
    reaped: Duration,
}

impl Supervisor<'_> {
    /// Starts everybody and watches until all have ended. Whatever goes wrong, those that live may leave in order: the
    /// recorder finishes its file.
    ///
    /// # Errors
    /// What ended the run before its time, in words.
    pub fn fly(&mut self) -> Result<()> {
        let flown = self.start().and_then(|()| self.watch());
        if flown.is_err() && !self.control.is_aborted() {
            self.processes.take_down(self.control)?;
        }
        flown
    }

    fn start(&mut self) -> Result<()> {
        let graph = self.graph;
        let waits = graph.sidecars.iter().any(|(_, program)| program.ready == Readiness::Notify);
        self.control.set_join_tick(if waits { 0 } else { self.hold_tick() });
        let nodes = graph.programs.iter().zip(&graph.plan.nodes).enumerate();
        let nodes = nodes.map(|(node, (program, plan))| {
            (plan.name.as_str(), Role::Node { node, generation: 0 }, Some(program))
        });
        let mut all: Vec<_> = std::iter::once(("clock", Role::Clock, None)).chain(nodes).collect();
        shuffle(&mut all, self.manifest.content.run.start_order_seed);
        for (name, role, program) in all {
            self.processes.start(name, role, program, self.run_dir)?;
        }
        for (name, program) in &graph.sidecars {
            self.sidecars.start(name, program)?;
        }
        self.tell(Event::Started).map(|_| ())
    }

    /// The tick at which the clock must wait: for who joins, and for sidecars that are not ready.
    fn hold_tick(&self) -> u32 {
        if self.sidecars.all_ready() { self.overseer.replacements.hold_tick() } else { 0 }
    }

    /// Watches until all processes have ended.
    fn watch(&mut self) -> Result<()> {
        while !self.overseer.state.is_over() {
            let news = self.control.notices();
            self.clock.look();
            self.processes.look()?;
            self.sidecars.look()?;
            self.bound_logs();
            self.reap();
            self.see();
            self.settle_ends()?;
            self.settle_sidecars()?;
            self.note_interrupts()?;
            self.note_progress()?;
            self.serve_requests();
            if self.overseer.state == State::Draining {
                self.overseer.replacements.end();
                self.carry_out()?;
            }
            let ended = self.overseer.note_too_late();
            self.follow(ended)?;
            // Before it too: what is held now must stay held while somebody joins.
            self.see();
            self.control.set_join_tick(self.hold_tick());
            self.see();
            self.overseer.replacements.advance();
            self.carry_out()?;
            self.control.set_join_tick(self.hold_tick());
            self.overseer.note_laggards();
            self.carry_out()?;
            self.note_stall()?;
            self.tell_progress();
            self.control.wait_for_notice(news, POLL);
        }
        Ok(())
    }

    fn say(&mut self, text: &str) {
        (self.on)(RunEvent::Note(text));
    }

    /// Tells how far the run has come.
    pub fn tell_progress(&mut self) {
        let (start_ns, _) = self.control.host_span_ns();
        let host_ns = if start_ns > 0 { monotonic_ns().saturating_sub(start_ns) } else { 0 };
        (self.on)(RunEvent::Progress(Progress {
            ticks: self.control.completed_ticks(),
            duration_ticks: self.plan.duration_ticks,
            tick_s: self.plan.tick_s(),
            host_s: host_ns as f64 * 1e-9,
        }));
    }

    /// Looks at the run for the replacements.
    fn see(&mut self) {
        let living = self.processes.running.iter().filter(|process| process.end.is_none());
        let living = living.filter_map(|process| match process.role {
            Role::Node { node, generation } => Some((node, generation)),
            Role::Clock | Role::Sidecar { .. } => None,
        });
        let times = [self.clock.now(), Duration::from_nanos(monotonic_ns())];
        self.overseer.replacements.view = View::of(self.plan, self.control, living.collect(), times);
    }

    /// Does what the replacements want done.
    fn carry_out(&mut self) -> Result<()> {
        while !self.overseer.replacements.view.commands.is_empty() {
            for command in std::mem::take(&mut self.overseer.replacements.view.commands) {
                self.execute(command)?;
            }
        }
        Ok(())
    }

    fn execute(&mut self, command: Command) -> Result<()> {
        let (control, run_dir) = (self.control, self.run_dir);
        match command {
            Command::Spawn { node, generation, backup } => {
                let name = &self.plan.nodes[node].name;
                let stored = backup.plan.store_backup(run_dir, node, generation);
                let started = stored.map_err(anyhow::Error::from).and_then(|()| {
                    self.processes.start(
                        name,
                        Role::Node { node, generation },
                        Some(&backup.program),
                        run_dir,
                    )
                });
                if let Err(error) = started {
                    self.overseer.replacements.note_not_started(node, generation, &error)?;
                }
            }
            Command::Kill { node, generation, message } => self.processes.kill(node, generation, message),
            Command::RequestStop => control.request_stop(),
            Command::Settle { node, generation } => {
                if let Some(process) = self.processes.of(node, generation) {
                    process.is_settled = true;
                }
            }
            Command::Free { node, generation, slot } => self.free(node, generation, slot),
            Command::Clear(slot) => control.clear_slot(slot),
            Command::SetSlot(slot, state) => control.set_slot_state(slot, state),
            Command::FirstTick(slot, tick) => control.set_first_tick(slot, tick),
            Command::StartShadow(topic, tick) => control.start_shadow(topic, tick),
            Command::Store(membership) => membership.store(run_dir)?,
            Command::Publish(epoch) => control.set_epoch(epoch),
        }
        Ok(())
    }

    /// Removes what a process that has ended left behind, and frees its slot.
    fn free(&mut self, node: usize, generation: u32, slot: usize) {
        let (control, run_dir) = (self.control, self.run_dir);
        let spent = &mut self.spent[node];
        *spent = (spent.0 + control.cpu_ns(slot), spent.1 + control.late_count(slot));
        control.clear_slot(slot);
        let process = self.processes.of(node, generation);
        let end = process.and_then(|process| process.end.as_ref());
        if end.is_some_and(|end| !end.success()) {
            // Its ports would keep their places; what cannot be removed now goes with the run.
            let _ = bus::reap_dead(run_dir, &self.plan.run_id);
        }
        bus::state_transfer::remove(run_dir, self.plan, node, generation);
        let _ = std::fs::remove_file(bus::plan::backup_path(run_dir, node, generation));
        bus::claim::remove(run_dir, &self.plan.nodes[node].name, generation);
        self.processes.forget(node, generation, run_dir);
    }

    /// Processor time in nanoseconds, and deadlines missed, of all instances of `node`.
    pub fn spent_by(&self, node: usize) -> (u64, u32) {
        let slots = (0..SLOTS_PER_NODE).map(|slot| slot * self.plan.nodes.len() + node);
        slots.fold(self.spent[node], |sum, slot| {
            (sum.0 + self.control.cpu_ns(slot), sum.1 + self.control.late_count(slot))
        })
    }

    /// Takes note of the end of orphans, which would otherwise stay in the table of processes for the whole run.
    fn reap(&mut self) {
        let Some(descendants) = self.descendants else { return };
        if self.clock.since(self.timing.reaped) >= REAP_PERIOD {
            self.timing.reaped = self.clock.now();
            let own: Vec<u32> = self.processes.ids().chain(self.sidecars.ids()).collect();
            descendants.reap(&own);
        }
    }

    fn bound_logs(&mut self) {
        if self.clock.since(self.timing.logs_bounded) >= LOG_PERIOD {
            self.timing.logs_bounded = self.clock.now();
            self.processes.bound_logs(self.run_dir);
            self.sidecars.bound_logs();
        }
    }

    /// Tells the state machine what happened.
    fn tell(&mut self, event: Event) -> Result<Action> {
        let action = self.overseer.tell(event);
        self.carry_out()?;
        Ok(action)
    }

    /// Does what was decided, and ends the run if that was it.
    fn follow<T>(&mut self, decided: Result<T, Abort>) -> Result<T> {
        for note in std::mem::take(&mut self.overseer.notes) {
            self.say(&note);
        }
        self.carry_out()?;
        if std::mem::take(&mut self.overseer.has_answered) {
            self.timing.last_change.1 = self.clock.now();
        }
        decided.or_else(|Abort(message)| {
            self.processes.take_down(self.control)?;
            Err(anyhow!(message))
        })
    }

    fn abort(&mut self, words: String) -> Result<()> {
        self.processes.take_down(self.control)?;
        Err(anyhow!(words))
    }

    /// Serves what was asked of the run, and answers those whose swap has come to its end.
    fn serve_requests(&mut self) {
        while let Some((request, reply)) = self.control_server.serve() {
            let Request::Swap { process, with, shadow_ticks, at_tick } = request else { continue };
            match self.request_swap(&process, &with, shadow_ticks, at_tick) {
                Ok(request) => self.swaps.push((request, reply)),
                Err(reason) => reply.send(&Answer::refused(reason)),
            }
        }
        for (request, reply) in std::mem::take(&mut self.swaps) {
            match self.overseer.replacements.reports.iter().find(|report| report.request == Some(request)) {
                Some(report) => reply.send(&answer(report)),
                None => self.swaps.push((request, reply)),
            }
        }
    }

    /// Checks a swap that was asked for and has its backup started; the error is the reason to refuse it.
    fn request_swap(
        &mut self,
        process: &str,
        with: &str,
        shadow_ticks: Option<u32>,
        at_tick: Option<u32>,
    ) -> Result<u32, String> {
        let backup = backup_of(self.manifest, self.plan, process, with).map_err(|e| e.to_string())?;
        let node = backup.node;
        self.require_claimed_log(&backup)?;
        if self.overseer.state != State::Running {
            return Err(format!("the run does not fly: `{process}` cannot be swapped now"));
        }
        if self.overseer.replacements.is_busy(node) {
            return Err(format!("`{process}` has a backup, a standby or a shadow already; one at a time"));
        }
        let shadow_ticks = shadow_ticks.unwrap_or(SHADOW_TICKS);
        if shadow_ticks == 0 || shadow_ticks >= self.control.end_tick() {
            let end = self.control.end_tick();
            return Err(format!("shadowing for {shadow_ticks} ticks is not within the run's {end} ticks"));
        }
        let (period, stride) = (backup.plan.period_ticks, take_over_stride(self.plan, node));
        if let Some(tick) = at_tick {
            let join = tick.saturating_sub(shadow_ticks);
            if join <= self.control.granted_ticks() || tick >= self.control.end_tick() {
                return Err(format!(
                    "tick {tick} less {shadow_ticks} ticks of shadowing is not ahead of the run, which has \
                     granted {} of {} ticks",
                    self.control.granted_ticks(),
                    self.control.end_tick()
                ));
            }
            if !tick.is_multiple_of(stride) || !join.is_multiple_of(period) {
                return Err(format!(
                    "`{process}` sends every {stride} and computes every {period} ticks: let it take over at a \
                     multiple of the first and join at one of the second"
                ));
            }
        }
        self.requests += 1;
        self.overseer.replacements.request_swap(backup, shadow_ticks, at_tick, self.requests);
        Ok(self.requests)
    }

    /// Refuses a log of its own to a backup that was asked for in flight: this run has not claimed the file.
    fn require_claimed_log(&self, backup: &BackupSpec) -> Result<(), String> {
        let planned = self.graph.backups.iter().filter(|other| other.node == backup.node);
        let mut known = planned.map(|other| &other.program).chain([&self.graph.programs[backup.node]]);
        match &backup.program.log {
            Some(log) if !known.any(|program| program.log.as_ref() == Some(log)) => Err(format!(
                "`log` = {}: a run claims its logs when it starts, and cannot claim another in flight; leave it out, or \
                 write the swap into the manifest",
                log.display()
            )),
            _ => Ok(()),
        }
    }

    fn note_interrupts(&mut self) -> Result<()> {
        let count = self.stop.count();
        let seen = std::mem::replace(&mut self.seen_stops, count);
        for number in seen..count {
            let event = if number == 0 { Event::StopRequested } else { Event::Interrupted };
            if self.tell(event)? == Action::Abort {
                let ticks = self.control.completed_ticks();
                return self.abort(format!("interrupted twice: the run was aborted at tick {ticks}"));
            }
        }
        Ok(())
    }

    fn note_progress(&mut self) -> Result<()> {
        self.overseer.note_gathered();
        self.carry_out()?;
        if self.overseer.state == State::Running && self.control.granted_ticks() >= self.control.end_tick() {
            self.tell(Event::EndReached)?;
        }
        if self.processes.all_ended() && self.processes.running.iter().all(|process| process.is_settled) {
            self.tell(Event::AllEnded)?;
        }
        Ok(())
    }

    /// Draws the consequences of every end that was seen.
    fn settle_ends(&mut self) -> Result<()> {
        for index in 0..self.processes.running.len() {
            let Some(process) = self.processes.running.get_mut(index) else { break };
            let (Some(end), false) = (&process.end, process.is_settled) else { continue };
            let succeeded = end.success() && process.verdict.is_none();
            let (name, role) = (process.name.clone(), process.role);
            if succeeded && self.overseer.has_done_its_part(role) {
                self.processes.running[index].is_settled = true;
                continue;
            }
            let words = self.processes.running[index].post_mortem();
            let settled = self.overseer.settle(&Death { name, role, words });
            if self.follow(settled)?
                && let Some(process) = self.processes.running.get_mut(index)
                && process.role == role
            {
                process.is_settled = true;
            }
        }
        Ok(())
    }

    /// Draws the consequences of every sidecar that has failed.
    fn settle_sidecars(&mut self) -> Result<()> {
        while let Some(failure) = self.sidecars.next_failure() {
            let event = Event::SidecarFailed { policy: failure.policy, is_possible: failure.is_possible };
            match self.tell(event)? {
                Action::Abort => {
                    let why = match failure.policy {
                        OnExit::Restart => ": it was restarted and ended again within a second",
                        _ => "; with `on_exit = \"ignore\"` the run would go on without it",
                    };
                    let ticks = self.control.completed_ticks();
                    return self
                        .abort(format!("{}\nThe run was aborted at tick {ticks}{why}", failure.words));
                }
                Action::Restart => {
                    self.say(&format!("{}\n`{}` is restarted", failure.words, failure.name));
                    self.sidecars.restart(failure.index)?;
                }
                _ => {
                    self.say(&format!("{}\nThe run goes on without it", failure.words));
                    self.sidecars.forget(failure.index);
                }
            }
        }
        Ok(())
    }

    /// Looks whether the run stands still, and because of whom.
    fn note_stall(&mut self) -> Result<()> {
        let ticks = self.control.completed_ticks();
        // A paused run stands still because it was told to.
        let is_paused = self.control.held_at().is_some_and(|held| self.control.hold_tick() <= held);
        // A sidecar that does not get ready has a watchdog of its own.
        let is_waiting = self.control.held_at().is_some() && !self.sidecars.all_ready();
        if ticks != self.timing.last_change.0 || self.overseer.state.is_over() || is_paused || is_waiting {
            self.timing.last_change = (ticks, self.clock.now());
            return Ok(());
        }
        if let Some((node, generation, stage, since)) = self.overseer.replacements.joining() {
            return self.note_late_joiner(node, generation, stage, since.max(self.timing.last_change.1));
        }
        let stood = self.clock.since(self.timing.last_change.1);
        let straggler =
            stall::straggler(self.plan, self.control, &self.overseer.replacements, &self.processes);
        if stood <= self.patience(straggler).max(2 * stall::deadline(self.plan, self.control)) {
            return Ok(());
        }
        let words = stall::describe(self.control, self.plan, &self.overseer.replacements, straggler, stood);
        let Some(straggler) = straggler else {
            self.tell(Event::Died { policy: OnExit::Stop, is_possible: false })?;
            return self.abort(format!("{words}; it was aborted"));
        };
        self.timing.last_change.1 = self.clock.now();
        self.processes.kill_role(straggler.role(), Some(format!("was killed by the watchdog: {words}")));
        Ok(())
    }

    /// How long the run may stand still because of `straggler`: for the clock, and where nobody is to blame, as long as
    /// for the node that may take longest.
    fn patience(&self, straggler: Option<Straggler>) -> Duration {
        match straggler {
            Some(Straggler::Node(node, generation)) => {
                self.overseer.replacements.program_of(node, generation).watchdog
            }
            Some(Straggler::Clock) | None => {
                self.graph.programs.iter().map(|program| program.watchdog).max().unwrap_or_default()
            }
        }
    }

    /// A process that does not join, or a member that does not make room for it.
    fn note_late_joiner(
        &mut self,
        node: usize,
        generation: u32,
        stage: Stage,
        since: Duration,
    ) -> Result<()> {
        let disagreeing = self.overseer.replacements.disagreeing();
        let late = disagreeing.filter(|_| stage != Stage::Joining).unwrap_or((node, generation));
        let patience = self.overseer.replacements.program_of(late.0, late.1).watchdog;
        if self.clock.since(since) > patience {
            let what = if late == (node, generation) {
                "did not join".to_owned()
            } else {
                format!("did not connect to `{}.{generation}`", self.plan.nodes[node].name)
            };
            let words = format!("was killed by the watchdog: it {what} within {} ms", patience.as_millis());
            self.processes.kill(late.0, late.1, Some(words));
        }
        Ok(())
    }
}
