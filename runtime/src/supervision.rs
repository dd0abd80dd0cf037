//! Watching over a run: starts its processes, answers what happens, and takes everything down again.

use crate::companions::Companions;
use crate::ctl::desk::Desk;
use crate::ctl::protocol::{Answer, Request};
use crate::ctl::server::Reply;
use crate::descendants::Descendants;
use crate::event::{Progress, RunEvent, StopToken};
use crate::graph::{Graph, successor_of};
use crate::manifest::Manifest;
use crate::processes::{Processes, Role};
use crate::program::{OnExit, Readiness, Successor};
use crate::stall::{self, Culprit};
use crate::succession::{Report, Stage, Standing, Successions, take_over_stride};
use crate::supervisor::{Action, Event, State};
use crate::watch_clock::WatchClock;
use anyhow::{Result, anyhow};
use bus::host_time::monotonic_ns;
use bus::lockstep::{Phase, SupervisorView};
use bus::plan::{NodePlan, Plan};
use std::path::Path;
use std::time::Duration;

/// How long the supervisor sleeps at most between two looks at its processes.
const POLL: Duration = Duration::from_millis(2);

/// How often the lengths of the processes' logs are looked at.
const LOG_PERIOD: Duration = Duration::from_millis(100);
/// How often orphans that have ended are looked for.
const REAP_PERIOD: Duration = Duration::from_secs(5);

/// Ticks that a successor shadows where a request does not say.
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
    /// The manifest, for successors that are asked for.
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
    pub companions: Companions<'a>,
    /// The watchdogs' clock.
    pub clock: &'a WatchClock,
    /// Who succeeds whom.
    pub successions: Successions<'a>,
    /// Where the run stands.
    pub state: State,
    /// Serves requests.
    pub desk: Desk<'a>,
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
    /// How far the run had come when it last came on, and when that was on the watchdogs' clock.
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

/// A process that ended, or was found to hang.
struct Death {
    name: String,
    role: Role,
    words: String,
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
        let waits = graph.companions.iter().any(|(_, program)| program.ready == Readiness::Notify);
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
        for (name, program) in &graph.companions {
            self.companions.start(name, program)?;
        }
        self.tell(Event::Started).map(|_| ())
    }

    /// The tick at which the clock must wait: for who joins, and for companions that are not ready.
    fn hold_tick(&self) -> u32 {
        if self.companions.all_ready() { self.successions.hold_tick() } else { 0 }
    }

    /// Watches until all processes have ended.
    fn watch(&mut self) -> Result<()> {
        while !self.state.is_over() {
            let news = self.control.notices();
            self.clock.look();
            self.processes.look()?;
            self.companions.look()?;
            self.bound_logs();
            self.reap();
            self.settle_ends()?;
            self.settle_companions()?;
            self.note_interrupts()?;
            self.note_progress()?;
            self.serve_requests();
            if self.state == State::Draining {
                self.successions.end(&mut self.processes);
            }
            if let Some(node) = self.successions.too_late() {
                self.refuse(node, "the run had passed the tick at which it was to join".to_owned())?;
            }
            // Before it too: what is held now must stay held while somebody joins.
            self.control.set_join_tick(self.hold_tick());
            self.successions.advance(&mut self.processes)?;
            self.control.set_join_tick(self.hold_tick());
            self.note_laggards();
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

    /// Takes note of the end of orphans, which would otherwise stay in the table of processes for the whole run.
    fn reap(&mut self) {
        let Some(descendants) = self.descendants else { return };
        if self.clock.since(self.timing.reaped) >= REAP_PERIOD {
            self.timing.reaped = self.clock.now();
            let own: Vec<u32> = self.processes.ids().chain(self.companions.ids()).collect();
            descendants.reap(&own);
        }
    }

    fn bound_logs(&mut self) {
        if self.clock.since(self.timing.logs_bounded) >= LOG_PERIOD {
            self.timing.logs_bounded = self.clock.now();
            self.processes.bound_logs(self.run_dir);
            self.companions.bound_logs();
        }
    }

    /// Tells the state machine what happened; an abort is left to the caller, who knows the words.
    fn tell(&mut self, event: Event) -> Result<Action> {
        let (state, action) = self.state.after(event);
        self.state = state;
        if action == Action::RequestStop {
            self.control.request_stop();
        }
        Ok(action)
    }

    fn abort(&mut self, words: String) -> Result<()> {
        self.processes.take_down(self.control)?;
        Err(anyhow!(words))
    }

    /// Serves what was asked of the run, and answers those whose swap has come to its end.
    fn serve_requests(&mut self) {
        while let Some((request, reply)) = self.desk.serve() {
            let Request::Swap { process, with, shadow_ticks, at_tick } = request else { continue };
            match self.request_swap(&process, &with, shadow_ticks, at_tick) {
                Ok(request) => self.swaps.push((request, reply)),
                Err(reason) => reply.send(&Answer::refused(reason)),
            }
        }
        for (request, reply) in std::mem::take(&mut self.swaps) {
            match self.successions.reports.iter().find(|report| report.request == Some(request)) {
                Some(report) => reply.send(&answer(report)),
                None => self.swaps.push((request, reply)),
            }
        }
    }

    /// Checks a swap that was asked for and has its successor started; the error is the reason to refuse it.
    fn request_swap(
        &mut self,
        process: &str,
        with: &str,
        shadow_ticks: Option<u32>,
        at_tick: Option<u32>,
    ) -> Result<u32, String> {
        let successor = successor_of(self.manifest, self.graph, process, with).map_err(|e| e.to_string())?;
        let node = successor.node;
        self.require_claimed_log(&successor)?;
        if self.state != State::Running {
            return Err(format!("the run does not fly: `{process}` cannot be swapped now"));
        }
        if self.successions.is_busy(node) {
            return Err(format!("`{process}` has a successor, a standby or a shadow already; one at a time"));
        }
        let shadow_ticks = shadow_ticks.unwrap_or(SHADOW_TICKS);
        if shadow_ticks == 0 || shadow_ticks >= self.control.end_tick() {
            let end = self.control.end_tick();
            return Err(format!("shadowing for {shadow_ticks} ticks is not within the run's {end} ticks"));
        }
        let (period, stride) = (successor.plan.period_ticks, take_over_stride(self.plan, node));
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
        self.successions.request_swap(successor, shadow_ticks, at_tick, self.requests);
        Ok(self.requests)
    }

    /// Refuses a log of its own to a successor that was asked for in flight: this run has not claimed the file.
    fn require_claimed_log(&self, successor: &Successor) -> Result<(), String> {
        let planned = self.graph.successors.iter().filter(|other| other.node == successor.node);
        let mut known = planned.map(|other| &other.program).chain([&self.graph.programs[successor.node]]);
        match &successor.program.log {
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

    fn note_gathered(&mut self) -> Result<()> {
        if self.state == State::Gathering && self.control.phase() == Phase::Running {
            self.tell(Event::Gathered)?;
            if self.control.is_stop_requested() {
                self.tell(Event::StopRequested)?;
            }
        }
        Ok(())
    }

    fn note_progress(&mut self) -> Result<()> {
        self.note_gathered()?;
        if self.state == State::Running && self.control.granted_ticks() >= self.control.end_tick() {
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
            if succeeded && self.has_done_its_part(role) {
                self.processes.running[index].is_settled = true;
                continue;
            }
            let words = self.processes.running[index].post_mortem();
            if self.settle(Death { name, role, words })?
                && let Some(process) = self.processes.running.get_mut(index)
                && process.role == role
            {
                process.is_settled = true;
            }
        }
        Ok(())
    }

    /// Draws the consequences of every companion that has failed.
    fn settle_companions(&mut self) -> Result<()> {
        while let Some(failure) = self.companions.next_failure() {
            let event = Event::CompanionFailed { policy: failure.policy, is_possible: failure.is_possible };
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
                    self.companions.restart(failure.index)?;
                }
                _ => {
                    self.say(&format!("{}\nThe run goes on without it", failure.words));
                    self.companions.forget(failure.index);
                }
            }
        }
        Ok(())
    }

    fn has_done_its_part(&self, role: Role) -> bool {
        match role {
            Role::Companion { .. } => true,
            Role::Clock => self.control.completed_ticks() >= self.control.end_tick(),
            Role::Node { node, generation } => {
                let has_completed = self.control.has_completed(self.plan.slot(node, generation));
                match self.successions.standing(node, generation) {
                    Standing::Former => true,
                    Standing::Active => has_completed,
                    Standing::Candidate => {
                        has_completed && self.successions.stage(node) >= Some(Stage::Shadowing)
                    }
                }
            }
        }
    }

    /// Draws the consequences of a death; false if that must wait.
    fn settle(&mut self, death: Death) -> Result<bool> {
        let Role::Node { node, generation } = death.role else {
            let ticks = self.control.completed_ticks();
            self.tell(Event::Died { policy: OnExit::Stop, is_possible: false })?;
            self.abort(format!("{}\nThe run was aborted at tick {ticks}", death.words))?;
            return Ok(true);
        };
        if self.successions.has_taken_over(node) {
            if !self.successions.all_agree(&self.processes) {
                return Ok(false);
            }
            self.successions.commit(node)?;
        }
        match self.successions.standing(node, generation) {
            Standing::Former => {
                self.successions.note_end_of_former(node, generation);
                Ok(true)
            }
            Standing::Candidate if self.has_died_behind_the_end(node, generation) => {
                self.say_died_behind_the_end(&death);
                Ok(true)
            }
            Standing::Candidate => {
                if self.successions.stage(node) > Some(Stage::Starting)
                    && !self.successions.may_change(node, &self.processes)
                {
                    return Ok(false);
                }
                if self.tell(Event::SuccessorFailed)? == Action::Refuse {
                    let tick = self.control.done(self.plan.slot(node, generation));
                    let reason = match self.successions.stage(node) {
                        Some(Stage::Starting) => format!("{} (it had not joined yet)", death.words),
                        _ => format!("{} (it had come to tick {tick})", death.words),
                    };
                    self.refuse(node, reason)?;
                }
                Ok(true)
            }
            Standing::Active => self.settle_active(node, generation, &death),
        }
    }

    /// Whether a process had completed its last tick when it died, and need not be missed by its node's policy: all that
    /// it had to send is sent, and there is nothing left that another could do in its place.
    fn has_died_behind_the_end(&self, node: usize, generation: u32) -> bool {
        self.control.phase() == Phase::Running
            && self.successions.program(node).on_exit != OnExit::Stop
            && self.control.has_completed(self.plan.slot(node, generation))
    }

    fn say_died_behind_the_end(&mut self, death: &Death) {
        self.say(&format!("{}\nIt had completed its last tick: the run ends without it", death.words));
    }

    fn refuse(&mut self, node: usize, reason: String) -> Result<()> {
        let vacant = self.successions.is_vacant(node);
        if !vacant {
            let name = &self.plan.nodes[node].name;
            self.say(&format!("the successor of `{name}` was refused: {reason}\n`{name}` flies on"));
        }
        self.successions.refuse(node, reason.clone(), &mut self.processes)?;
        if vacant {
            let ticks = self.control.completed_ticks();
            self.tell(Event::Died { policy: OnExit::Stop, is_possible: false })?;
            return self.abort(format!(
                "{reason}\nThe run was aborted at tick {ticks}: it came in the place of a process that had died, \
                 and completed no tick"
            ));
        }
        Ok(())
    }

    fn settle_active(&mut self, node: usize, generation: u32, death: &Death) -> Result<bool> {
        if self.successions.is_vacant(node) {
            return Ok(true);
        }
        // It may have flown for a while before anybody looked.
        self.note_gathered()?;
        let flies = self.control.phase() == Phase::Running;
        let on_exit = self.successions.program(node).on_exit;
        if self.has_died_behind_the_end(node, generation) {
            self.say_died_behind_the_end(death);
            return Ok(true);
        }
        if flies && on_exit != OnExit::Stop && !self.successions.may_replace(node, &self.processes) {
            return Ok(false);
        }
        let policy = match on_exit {
            OnExit::Restart if self.successions.can_promote(node) => OnExit::Standby,
            policy => policy,
        };
        let is_possible = flies
            && match policy {
                OnExit::Stop | OnExit::Ignore => false,
                OnExit::Restart => self.successions.has_come_on(node),
                OnExit::Standby => self.successions.can_promote(node),
            };
        let tick = self.control.completed_by(self.plan.slot(node, generation));
        match self.tell(Event::Died { policy, is_possible })? {
            Action::Restart => {
                self.successions.close_early(node, &mut self.processes);
                self.successions.postpone(node, &mut self.processes);
                if self.successions.stage(node).is_some() {
                    self.refuse(node, "the process it was to succeed died first".to_owned())?;
                }
                self.say(&format!("{}\n`{}` is restarted at tick {tick}", death.words, death.name));
                self.successions.restart(node, &mut self.processes)?;
            }
            Action::Promote => {
                self.say(&format!(
                    "{}\nThe standby of `{}` takes over at tick {tick}",
                    death.words, self.plan.nodes[node].name
                ));
                self.successions.promote(node)?;
            }
            _ => {
                let why = match policy {
                    OnExit::Stop | OnExit::Ignore => "",
                    _ if !flies => ": the run did not fly yet",
                    OnExit::Restart => {
                        ": it was restarted and came to its end again without completing a tick"
                    }
                    OnExit::Standby => ": no standby was ready to take over",
                };
                let silent = silent_topics(&self.plan.nodes[node], self.plan);
                self.abort(format!("{}\nThe run was aborted at tick {tick}{silent}{why}", death.words))?;
            }
        }
        self.timing.last_change.1 = self.clock.now();
        Ok(true)
    }

    /// Ends those that do not come up or do not leave in their time; their ends are settled like any other.
    fn note_laggards(&mut self) {
        if let Some((node, generation)) = self.successions.unprepared() {
            let patience = self.successions.program_of(node, generation).watchdog.as_millis();
            let words = format!(
                "was killed by the watchdog: it did not join within {patience} ms; does it link `bus` and connect?"
            );
            self.processes.kill(node, generation, Some(words));
        }
        if let Some((node, generation)) = self.successions.lingering(&self.processes) {
            self.processes.kill(
                node,
                generation,
                Some("was killed by the watchdog: it did not leave".to_owned()),
            );
        }
    }

    /// Looks whether the run stands still, and because of whom.
    fn note_stall(&mut self) -> Result<()> {
        let ticks = self.control.completed_ticks();
        // A paused run stands still because it was told to.
        let is_paused = self.control.held_at().is_some_and(|held| self.control.hold_tick() <= held);
        // A companion that does not get ready has a watchdog of its own.
        let is_waiting = self.control.held_at().is_some() && !self.companions.all_ready();
        if ticks != self.timing.last_change.0 || self.state.is_over() || is_paused || is_waiting {
            self.timing.last_change = (ticks, self.clock.now());
            return Ok(());
        }
        if let Some((node, generation, stage, since)) = self.successions.joining() {
            return self.note_late_joiner(node, generation, stage, since.max(self.timing.last_change.1));
        }
        let stood = self.clock.since(self.timing.last_change.1);
        let culprit = stall::culprit(self.plan, self.control, &self.successions, &self.processes);
        if stood <= self.patience(culprit).max(2 * stall::deadline(self.plan, self.control)) {
            return Ok(());
        }
        let words = stall::describe(self.control, self.plan, &self.successions, culprit, stood);
        let Some(culprit) = culprit else {
            self.tell(Event::Died { policy: OnExit::Stop, is_possible: false })?;
            return self.abort(format!("{words}; it was aborted"));
        };
        self.timing.last_change.1 = self.clock.now();
        self.processes.kill_role(culprit.role(), Some(format!("was killed by the watchdog: {words}")));
        Ok(())
    }

    /// How long the run may stand still because of `culprit`: for the clock, and where nobody is to blame, as long as
    /// for the node that may take longest.
    fn patience(&self, culprit: Option<Culprit>) -> Duration {
        match culprit {
            Some(Culprit::Node(node, generation)) => self.successions.program_of(node, generation).watchdog,
            Some(Culprit::Clock) | None => {
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
        let disagreeing = self.successions.disagreeing(&self.processes);
        let late = disagreeing.filter(|_| stage != Stage::Joining).unwrap_or((node, generation));
        let patience = self.successions.program_of(late.0, late.1).watchdog;
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

/// The topics on which nothing came any more once the process of `node` had ended, in words.
fn silent_topics(node: &NodePlan, plan: &Plan) -> String {
    let topics: Vec<_> = node.outputs.iter().map(|output| plan.topics[output.topic].name.as_str()).collect();
    if topics.is_empty() { String::new() } else { format!("; nothing more came on {}", topics.join(", ")) }
}
