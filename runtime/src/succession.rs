//! Who succeeds whom: successors are started, join, shadow their predecessor, take over and see it retire.
//!
//! Each node has at most one candidate at a time, which goes through the stages below. A change of the run
//! is a new roster: it is written, every member agrees with it, and only then the next one is made.
#![allow(clippy::disallowed_methods, reason = "the launcher watches host time; it simulates nothing")]

use crate::processes::{Processes, Role};
use crate::program::{OnExit, Program, Successor};
use crate::watch_clock::WatchClock;
use anyhow::Result;
use bus::lockstep::{Phase, SlotState, SupervisorView, TransferOutcome};
use bus::membership::{Instance, Membership};
use bus::plan::{InputPlan, OutputPlan, Plan, SLOTS_PER_NODE};
use serde::Serialize;
use std::collections::VecDeque;
use std::path::Path;
use std::time::{Duration, Instant};

/// Why a process joins a run that flies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Purpose {
    /// It shadows the active process for a while, then takes over.
    Swap,
    /// It shadows the active process, and takes over when that dies.
    Standby,
    /// It shadows the active process and never flies.
    Shadow,
    /// It takes the place of a process that died.
    Restart,
}

/// How far a candidate has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
pub enum Stage {
    /// Its process starts and prepares its outputs, while the run flies on.
    Starting,
    /// The clock holds the tick; it connects its inputs.
    Joining,
    /// The others are told and connect to it.
    Announced,
    /// It computes every tick; its samples are a shadow's until the take-over.
    Shadowing,
    /// Its samples count. The predecessor stays until everybody has read its last ones.
    Retiring,
}

/// When a candidate joins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Join {
    /// At this tick.
    At(u32),
    /// At the next tick boundary once its process is prepared, to take over after so many ticks.
    Next { shadow_ticks: Option<u32> },
    /// In the middle of a tick that waits for it.
    AtOnce,
}

#[derive(Debug)]
struct Pending {
    successor: Successor,
    purpose: Purpose,
    is_planned: bool,
    join: Join,
    /// The request that asked for it.
    request: Option<u32>,
}

#[derive(Debug)]
struct Candidate {
    pending: Pending,
    generation: u32,
    stage: Stage,
    /// When its process was started, and when the present stage began, on the clock of the watchdogs.
    started: Duration,
    stage_began: Duration,
    /// Host time at which its process was started, and since when the run waits for it: for the report.
    spawned: Instant,
    held_since: Option<Instant>,
    /// The generation that it has succeeded.
    former: Option<u32>,
    report: Report,
}

/// A node's processes.
#[derive(Debug)]
struct Seats {
    program: Program,
    candidate: Option<Candidate>,
    /// The highest generation that was started.
    newest_generation: u32,
    /// Whether the active process is dead and its place not taken yet.
    is_vacant: bool,
    /// Processor time in nanoseconds, and deadlines missed, of those that have left.
    spent: (u64, u32),
}

/// What became of a successor.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The node.
    pub process: String,
    /// Counts the processes of the node; the first is 0.
    pub generation: u32,
    /// Why it joined.
    pub purpose: Purpose,
    /// Whether the manifest or a request names it; a restart and the next standby come by themselves.
    pub is_planned: bool,
    /// The request that asked for it.
    #[serde(skip)]
    pub request: Option<u32>,
    /// The first tick it computed.
    pub join_tick: Option<u32>,
    /// The first tick whose outputs were its own.
    pub take_over_tick: Option<u32>,
    /// What it went on from: `state` or `last output`.
    pub hand_over: Option<&'static str>,
    /// Host time from the start of its process until that was prepared to join, in milliseconds.
    pub start_ms: f64,
    /// Host time for which the clock held the tick, in milliseconds.
    pub hold_ms: f64,
    /// Why it did not fly, if it was to.
    pub refused: Option<String>,
    /// What it reads, for a profile of the run.
    #[serde(skip)]
    pub inputs: Vec<InputPlan>,
}

/// All successions of a run.
pub struct Successions<'a> {
    plan: &'a Plan,
    control: &'a SupervisorView,
    run_dir: &'a Path,
    clock: &'a WatchClock,
    roster: Membership,
    seats: Vec<Seats>,
    pending: VecDeque<Pending>,
    /// What became of those that are through.
    pub reports: Vec<Report>,
}

/// What a process is to its node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// Its samples count.
    Active,
    /// It is to succeed the active one.
    Candidate,
    /// It was succeeded, or is of no further interest.
    Former,
}

impl<'a> Successions<'a> {
    /// The successions of a run that begins: its planned successors wait for their ticks.
    pub fn new(
        plan: &'a Plan,
        control: &'a SupervisorView,
        run_dir: &'a Path,
        clock: &'a WatchClock,
        programs: &[Program],
        successors: &[Successor],
    ) -> Self {
        let seats = programs.iter().map(|program| Seats {
            program: program.clone(),
            candidate: None,
            newest_generation: 0,
            is_vacant: false,
            spent: (0, 0),
        });
        let pending = successors.iter().map(|successor| Pending {
            purpose: match (successor.take_over_tick, successor.is_standby) {
                (Some(_), _) => Purpose::Swap,
                (None, true) => Purpose::Standby,
                (None, false) => Purpose::Shadow,
            },
            is_planned: true,
            request: None,
            join: Join::At(successor.join_tick),
            successor: successor.clone(),
        });
        let (seats, pending) = (seats.collect(), pending.collect());
        let roster = Membership::first(plan);
        Self { plan, control, run_dir, clock, roster, seats, pending, reports: Vec::new() }
    }

    /// Has `successor` join and take over after `shadow_ticks`: at `at_tick`, or as soon as its process is
    /// prepared.
    pub fn request_swap(
        &mut self,
        mut successor: Successor,
        shadow_ticks: u32,
        at_tick: Option<u32>,
        request: u32,
    ) {
        let join = match at_tick {
            Some(tick) => Join::At(tick.saturating_sub(shadow_ticks)),
            None => Join::Next { shadow_ticks: Some(shadow_ticks) },
        };
        successor.take_over_tick = at_tick;
        self.pending.push_back(Pending {
            successor,
            purpose: Purpose::Swap,
            is_planned: true,
            request: Some(request),
            join,
        });
    }

    /// Whether a successor of `node` waits or is on its way.
    pub fn is_busy(&self, node: usize) -> bool {
        self.seats[node].candidate.is_some()
            || self.pending.iter().any(|pending| pending.successor.node == node)
    }

    /// What the process of a node's generation is to it now.
    pub fn standing(&self, node: usize, generation: u32) -> Standing {
        let candidate = self.seats[node].candidate.as_ref();
        if self.roster.nodes[node].primary.generation == generation {
            Standing::Active
        } else if candidate.is_some_and(|candidate| candidate.generation == generation) {
            Standing::Candidate
        } else {
            Standing::Former
        }
    }

    /// What follows the end of the active process of `node` by the manifest.
    pub fn program(&self, node: usize) -> &Program {
        &self.seats[node].program
    }

    /// The program of a process of `node`.
    pub fn program_of(&self, node: usize, generation: u32) -> &Program {
        let candidate = self.seats[node].candidate.as_ref().filter(|c| c.generation == generation);
        candidate.map_or(&self.seats[node].program, |candidate| &candidate.pending.successor.program)
    }

    fn member(&self, node: usize, generation: u32) -> usize {
        self.plan.slot(node, generation)
    }

    /// Whether every living member agrees with the newest roster.
    pub fn all_agree(&self, processes: &Processes) -> bool {
        self.disagreeing(processes).is_none()
    }

    /// A living member that does not agree with the newest roster yet: its node and generation.
    pub fn disagreeing(&self, processes: &Processes) -> Option<(usize, u32)> {
        self.members().find(|&(node, generation)| {
            let member = self.member(node, generation);
            self.control.slot_state(member) == SlotState::Taken
                && processes.lives(node, generation)
                && !self.control.has_completed(member)
                && self.control.acknowledged_epoch(member) < self.control.epoch()
        })
    }

    /// Node and generation of every process that may compute.
    pub fn members(&self) -> impl Iterator<Item = (usize, u32)> + '_ {
        self.roster.nodes.iter().enumerate().flat_map(|(node, roster)| {
            let candidate = self.seats[node].candidate.as_ref();
            // While it retires, the predecessor still reads.
            let former = candidate.and_then(|candidate| candidate.former);
            let candidate = candidate.map(|candidate| candidate.generation);
            let generations = [Some(roster.primary.generation), candidate, former];
            let mut seen: Vec<u32> = generations.into_iter().flatten().collect();
            seen.dedup();
            seen.into_iter().map(move |generation| (node, generation))
        })
    }

    /// The inputs of a process.
    pub fn inputs(&self, node: usize, generation: u32) -> &[InputPlan] {
        let candidate = self.seats[node].candidate.as_ref().filter(|c| c.generation == generation);
        candidate.map_or(&self.roster.nodes[node].primary.plan.inputs, |candidate| {
            &candidate.pending.successor.plan.inputs
        })
    }

    /// The candidate on which the run waits, because it has not joined yet: node, generation, stage and when that
    /// began. One that is early for its tick, or prepares while the run flies, keeps nobody waiting.
    pub fn joining(&self) -> Option<(usize, u32, Stage, Duration)> {
        let candidates = self.seats.iter().enumerate();
        let awaited = candidates.filter_map(|(node, seats)| {
            let candidate = seats.candidate.as_ref()?;
            let is_awaited = match (candidate.stage, candidate.pending.join) {
                (Stage::Starting, Join::At(tick)) => self.control.held_at() == Some(tick),
                (Stage::Starting, Join::Next { .. }) => false,
                (Stage::Starting, Join::AtOnce) | (Stage::Joining | Stage::Announced, _) => true,
                (Stage::Shadowing | Stage::Retiring, _) => false,
            };
            is_awaited.then_some((node, candidate.generation, candidate.stage, candidate.stage_began))
        });
        // Those that only start wait for the one that is on the way in.
        awaited.max_by_key(|&(.., stage, _)| stage > Stage::Starting)
    }

    /// The tick at which the clock must wait for somebody to join; `u32::MAX` if nobody is awaited.
    pub fn hold_tick(&self) -> u32 {
        let candidates = self.seats.iter().filter_map(|seats| {
            let candidate = seats.candidate.as_ref().filter(|c| c.stage < Stage::Shadowing)?;
            match candidate.pending.join {
                Join::At(tick) => Some(tick),
                Join::Next { .. } => self.is_prepared(candidate).then(|| self.next_boundary(candidate)),
                Join::AtOnce => None,
            }
        });
        let pending = self.pending.iter().filter_map(|pending| match pending.join {
            // Who took a dead process's place comes first, even if the run passes the tick.
            Join::At(_) if self.is_recovering(pending.successor.node) => None,
            Join::At(tick) => Some(tick),
            Join::Next { .. } | Join::AtOnce => None,
        });
        candidates.chain(pending).min().unwrap_or(u32::MAX)
    }

    /// Whether the place of a dead process of `node` has just been taken.
    fn is_recovering(&self, node: usize) -> bool {
        self.seats[node].candidate.as_ref().is_some_and(|candidate| {
            let is_recovery = matches!(candidate.pending.purpose, Purpose::Restart | Purpose::Standby);
            is_recovery && (self.seats[node].is_vacant || candidate.stage == Stage::Retiring)
        })
    }

    /// Where the clock must wait for a candidate: where it is, or at the node's next period.
    fn next_boundary(&self, candidate: &Candidate) -> u32 {
        let period = candidate.pending.successor.plan.period_ticks;
        self.control.held_at().map_or(0, |held| held.next_multiple_of(period))
    }

    /// A node whose candidate was to join at a tick that the run has passed.
    pub fn too_late(&self) -> Option<usize> {
        let held = self.control.held_at()?;
        self.seats.iter().position(|seats| {
            seats.candidate.as_ref().is_some_and(|candidate| {
                candidate.stage == Stage::Starting
                    && matches!(candidate.pending.join, Join::At(tick) if tick < held)
            })
        })
    }

    fn is_prepared(&self, candidate: &Candidate) -> bool {
        let member = self.member(candidate.pending.successor.node, candidate.generation);
        self.control.is_ready(member, Phase::Connecting)
    }

    /// Starts the processes of those whose node has a free seat, and takes every candidate as far as it can
    /// go now.
    pub fn advance(&mut self, processes: &mut Processes) -> Result<()> {
        self.start_pending(processes)?;
        for node in 0..self.seats.len() {
            while self.advance_candidate(node, processes)? {}
        }
        Ok(())
    }

    fn start_pending(&mut self, processes: &mut Processes) -> Result<()> {
        let mut waiting = VecDeque::new();
        while let Some(pending) = self.pending.pop_front() {
            let node = pending.successor.node;
            let is_first = waiting.iter().all(|other: &Pending| other.successor.node != node);
            if self.seats[node].candidate.is_none() && is_first {
                self.start_candidate(pending, processes)?;
            } else {
                waiting.push_back(pending);
            }
        }
        self.pending = waiting;
        Ok(())
    }

    fn start_candidate(&mut self, pending: Pending, processes: &mut Processes) -> Result<()> {
        let node = pending.successor.node;
        // A candidate that failed leaves its generation unused, and its seat is the active one's other.
        let active = self.roster.nodes[node].primary.generation;
        let next = self.seats[node].newest_generation + 1;
        let is_other_seat = self.member(node, next) != self.member(node, active);
        let generation = if is_other_seat { next } else { next + 1 };
        let name = self.plan.nodes[node].name.clone();
        self.control.clear_slot(self.member(node, generation));
        self.seats[node].newest_generation = generation;
        pending.successor.plan.store_backup(self.run_dir, node, generation)?;
        let report = Report {
            process: name.clone(),
            generation,
            purpose: pending.purpose,
            is_planned: pending.is_planned,
            request: pending.request,
            join_tick: None,
            take_over_tick: None,
            hand_over: None,
            start_ms: 0.0,
            hold_ms: 0.0,
            refused: None,
            inputs: pending.successor.plan.inputs.clone(),
        };
        let spawned = Instant::now();
        let role = Role::Node { node, generation };
        let started = processes.start(&name, role, Some(&pending.successor.program), self.run_dir);
        if let Err(error) = started {
            if pending.purpose == Purpose::Restart {
                return Err(error);
            }
            self.free(node, generation, processes);
            self.reports.push(Report { refused: Some(format!("{error:#}")), ..report });
            return Ok(());
        }
        self.seats[node].candidate = Some(Candidate {
            pending,
            generation,
            stage: Stage::Starting,
            started: self.clock.now(),
            stage_began: self.clock.now(),
            spawned,
            held_since: None,
            former: None,
            report,
        });
        Ok(())
    }

    /// Takes the candidate of `node` one stage further; false where it must wait.
    fn advance_candidate(&mut self, node: usize, processes: &mut Processes) -> Result<bool> {
        self.note_start(node);
        let Some(candidate) = &self.seats[node].candidate else { return Ok(false) };
        let member = self.member(node, candidate.generation);
        let goes_on = match candidate.stage {
            Stage::Starting => {
                self.is_prepared(candidate) && self.is_at_join(candidate) && self.may_change(node, processes)
            }
            Stage::Joining => self.control.is_ready(member, Phase::Running),
            Stage::Announced => self.all_agree(processes),
            // It may have completed the tick as a shadow before it was promoted there: the roster that says so is
            // replaced only when everybody has read it.
            Stage::Shadowing => self.has_flown(node) && self.all_agree(processes),
            Stage::Retiring => self.has_retired(node, candidate, processes),
        };
        if !goes_on {
            return Ok(false);
        }
        match candidate.stage {
            Stage::Starting => self.let_join(node)?,
            Stage::Joining => self.announce(node),
            Stage::Announced => self.let_compute(node),
            Stage::Shadowing => self.commit(node)?,
            Stage::Retiring => self.close(node, processes),
        }
        if let Some(candidate) = &mut self.seats[node].candidate {
            candidate.stage_began = self.clock.now();
        }
        Ok(true)
    }

    /// Whether the candidate of `node` has completed its first tick that counts.
    fn has_flown(&self, node: usize) -> bool {
        let take_over_tick = self.roster.nodes[node].take_over_tick;
        self.seats[node].candidate.as_ref().is_some_and(|candidate| {
            let done = self.control.done(self.member(node, candidate.generation));
            candidate.stage == Stage::Shadowing
                && done > take_over_tick
                && take_over_tick < self.control.end_tick()
        })
    }

    /// The stage of the candidate of `node`.
    pub fn stage(&self, node: usize) -> Option<Stage> {
        self.seats[node].candidate.as_ref().map(|candidate| candidate.stage)
    }

    /// A candidate whose process has not come up in its time: node and generation.
    pub fn unprepared(&self) -> Option<(usize, u32)> {
        self.seats.iter().enumerate().find_map(|(node, seats)| {
            let candidate =
                seats.candidate.as_ref().filter(|candidate| candidate.stage == Stage::Starting)?;
            let is_late = self.clock.since(candidate.started) > candidate.pending.successor.program.watchdog;
            let is_up = self.control.phase() != Phase::Running || self.is_prepared(candidate);
            (is_late && !is_up).then_some((node, candidate.generation))
        })
    }

    /// A process that everybody has read the last samples of and that does not leave: node and generation.
    pub fn lingering(&self, processes: &Processes) -> Option<(usize, u32)> {
        self.seats.iter().enumerate().find_map(|(node, seats)| {
            let candidate =
                seats.candidate.as_ref().filter(|candidate| candidate.stage == Stage::Retiring)?;
            let former = candidate.former.filter(|&former| processes.lives(node, former))?;
            let is_late = self.clock.since(candidate.stage_began) > seats.program.watchdog;
            (is_late && self.is_read(candidate)).then_some((node, former))
        })
    }

    /// Takes back a candidate that has not joined yet: its process is ended, and it waits for its turn again.
    pub fn postpone(&mut self, node: usize, processes: &mut Processes) {
        if self.stage(node) != Some(Stage::Starting) {
            return;
        }
        if let Some(candidate) = self.seats[node].candidate.take() {
            processes.kill(node, candidate.generation, None);
            self.free(node, candidate.generation, processes);
            self.pending.push_front(candidate.pending);
        }
    }

    /// Notes when the candidate of `node` was prepared, and since when the run waits for it.
    fn note_start(&mut self, node: usize) {
        let Some(candidate) = &self.seats[node].candidate else { return };
        if candidate.stage != Stage::Starting {
            return;
        }
        let (is_prepared, is_awaited) = (self.is_prepared(candidate), self.is_at_join(candidate));
        let Some(candidate) = &mut self.seats[node].candidate else { return };
        if is_prepared && candidate.report.start_ms == 0.0 {
            candidate.report.start_ms = milliseconds(candidate.spawned);
        }
        if is_awaited {
            candidate.held_since.get_or_insert_with(Instant::now);
        }
    }

    /// One change at a time: the one before must be agreed with, and nobody else may be on the way in.
    pub fn may_change(&self, node: usize, processes: &Processes) -> bool {
        let others = self.seats.iter().enumerate().filter(|&(other, _)| other != node);
        let mut joining = others.filter_map(|(_, seats)| seats.candidate.as_ref());
        !joining.any(|other| matches!(other.stage, Stage::Joining | Stage::Announced))
            && self.control.phase() == Phase::Running
            && self.all_agree(processes)
    }

    /// Whether the dead active process of `node` can be replaced now: whoever is on the way in, its own successor
    /// included, comes to the end of that or is refused first.
    pub fn may_replace(&self, node: usize, processes: &Processes) -> bool {
        let candidate = self.seats[node].candidate.as_ref();
        let is_joining =
            candidate.is_some_and(|candidate| matches!(candidate.stage, Stage::Joining | Stage::Announced));
        !is_joining && self.may_change(node, processes)
    }

    fn is_at_join(&self, candidate: &Candidate) -> bool {
        match (candidate.pending.join, self.control.held_at()) {
            (Join::At(tick), Some(held)) => held == tick,
            (Join::Next { .. }, Some(held)) => {
                held.is_multiple_of(candidate.pending.successor.plan.period_ticks)
            }
            (Join::AtOnce, _) => true,
            (_, None) => false,
        }
    }

    /// The clock waits at the tick: the candidate may connect its inputs.
    fn let_join(&mut self, node: usize) -> Result<()> {
        let Some(candidate) = &mut self.seats[node].candidate else { return Ok(()) };
        let (plan, control) = (self.plan, self.control);
        let active = plan.slot(node, self.roster.nodes[node].primary.generation);
        let successor = &candidate.pending.successor;
        let sent = |topic: usize| control.ticks_sent(topic);
        let outputs = &successor.plan.outputs;
        let (join_tick, take_over_tick) = match candidate.pending.join {
            Join::At(tick) => (tick, successor.take_over_tick.unwrap_or(u32::MAX)),
            Join::Next { shadow_ticks } => {
                let tick = control.held_at().unwrap_or_default();
                let stride = take_over_stride(plan, node);
                let take_over = shadow_ticks
                    .and_then(|ticks| tick.checked_add(ticks.max(1))?.checked_next_multiple_of(stride));
                (tick, take_over.unwrap_or(u32::MAX))
            }
            Join::AtOnce => (control.done(active), control.done(active)),
        };
        let shadows = candidate.pending.join != Join::AtOnce;
        let roster = &mut self.roster.nodes[node];
        roster.take_over_tick = take_over_tick;
        roster.take_over_ticks = if shadows {
            vec![take_over_tick; outputs.len()]
        } else {
            outputs.iter().map(|output| sent(output.topic)).collect()
        };
        let member = plan.slot(node, candidate.generation);
        for (output, &take_over_tick) in outputs.iter().zip(&roster.take_over_ticks) {
            // The next tick at which a shadow sample is due; one that does not shadow sends none.
            let due = join_tick.next_multiple_of(plan.topics[output.topic].period_ticks);
            control.start_shadow(output.topic, if shadows { due } else { take_over_tick });
        }
        control.set_first_tick(member, join_tick);
        roster.backup = Some(Instance {
            generation: candidate.generation,
            join_tick,
            shadows,
            plan: successor.plan.clone(),
        });
        self.roster.epoch += 1;
        self.roster.store(self.run_dir)?;
        candidate.report.join_tick = Some(join_tick);
        candidate.stage = Stage::Joining;
        control.set_slot_state(member, SlotState::Joining);
        Ok(())
    }

    /// The candidate has connected: everybody connects to it.
    fn announce(&mut self, node: usize) {
        self.control.set_epoch(self.roster.epoch);
        self.set_stage(node, Stage::Announced);
    }

    /// Everybody is connected: it computes from its tick on.
    fn let_compute(&mut self, node: usize) {
        let Some(candidate) = &mut self.seats[node].candidate else { return };
        let member = self.plan.slot(node, candidate.generation);
        candidate.report.hold_ms = candidate.held_since.map_or(0.0, milliseconds);
        candidate.report.hand_over = match self.control.transfer(member) {
            TransferOutcome::Unknown => None,
            TransferOutcome::State => Some("state"),
            TransferOutcome::LastOutput => Some("last output"),
        };
        candidate.stage = Stage::Shadowing;
        self.control.set_slot_state(member, SlotState::Taken);
        if candidate.pending.join == Join::AtOnce {
            // The clock waited for the dead process until its place was taken.
            let dead = self.plan.slot(node, self.roster.nodes[node].primary.generation);
            self.control.set_slot_state(dead, SlotState::Empty);
        }
        self.control.set_epoch(self.roster.epoch);
    }

    /// Whether the candidate of `node` has sent a sample that counts. Readers may have turned to it: even if it dies
    /// now, there is no way back to its predecessor.
    pub fn has_taken_over(&self, node: usize) -> bool {
        let roster = &self.roster.nodes[node];
        let is_shadowing = self.seats[node].candidate.as_ref().is_some_and(|c| c.stage == Stage::Shadowing);
        let outputs = roster.primary.plan.outputs.iter().zip(&roster.take_over_ticks);
        let has_sent = |(output, &tick): (&OutputPlan, &u32)| {
            let period_ticks = u64::from(self.plan.topics[output.topic].period_ticks);
            let first_due = u64::from(tick).next_multiple_of(period_ticks);
            u64::from(self.control.ticks_sent(output.topic)) > first_due
        };
        is_shadowing && outputs.into_iter().any(has_sent)
    }

    /// Its first tick is done, or lost with it: from now on it is the active one.
    pub fn commit(&mut self, node: usize) -> Result<()> {
        let roster = &mut self.roster.nodes[node];
        let take_over_tick = roster.take_over_tick;
        let former = roster.primary.generation;
        if let Some(successor) = roster.backup.take() {
            roster.primary = successor;
        }
        roster.take_over_tick = u32::MAX;
        roster.take_over_ticks.fill(u32::MAX);
        self.seats[node].is_vacant = false;
        if let Some(candidate) = &mut self.seats[node].candidate {
            candidate.report.take_over_tick = Some(take_over_tick);
            candidate.former = Some(former);
            candidate.stage = Stage::Retiring;
        }
        // Every node knows already: this is for those who look at the run from outside.
        Ok(self.roster.store(self.run_dir)?)
    }

    fn set_stage(&mut self, node: usize, stage: Stage) {
        if let Some(candidate) = &mut self.seats[node].candidate {
            candidate.stage = stage;
        }
    }

    /// The process has ended: if it is a predecessor that did not come to leave by itself, nobody waits for it.
    pub fn note_end_of_former(&self, node: usize, generation: u32) {
        let candidate = self.seats[node].candidate.as_ref();
        if candidate.is_some_and(|candidate| candidate.former == Some(generation)) {
            self.control.set_slot_state(self.member(node, generation), SlotState::Empty);
            self.control.set_epoch(self.control.epoch());
        }
    }

    /// Whether the predecessor has left and everybody has read its last samples.
    fn has_retired(&self, node: usize, candidate: &Candidate, processes: &Processes) -> bool {
        if candidate.former.is_some_and(|former| processes.lives(node, former)) {
            return false;
        }
        self.is_read(candidate)
    }

    /// Whether everybody has read the last samples of the process that `candidate` has succeeded.
    fn is_read(&self, candidate: &Candidate) -> bool {
        let longest = self.plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
        let taken = candidate.report.take_over_tick.unwrap_or_default().saturating_add(longest + 1);
        let taken = taken.min(self.control.end_tick());
        self.control.computing().all(|member| self.control.done(member) >= taken)
    }

    /// The predecessor is gone: its seat is free, and nothing of it stays.
    fn close(&mut self, node: usize, processes: &mut Processes) {
        let Some(candidate) = self.seats[node].candidate.take() else { return };
        if let Some(former) = candidate.former {
            self.free(node, former, processes);
        }
        let on_exit = self.seats[node].program.on_exit;
        self.seats[node].program = Program { on_exit, ..candidate.pending.successor.program.clone() };
        if on_exit == OnExit::Standby {
            // Who was promoted gets a standby of its own, as soon as a tick boundary comes.
            let pending = Pending {
                successor: candidate.pending.successor,
                purpose: Purpose::Standby,
                is_planned: false,
                request: None,
                join: Join::Next { shadow_ticks: None },
            };
            self.pending.push_back(pending);
        }
        self.reports.push(candidate.report);
    }

    /// The active process of `node` has died while its predecessor retired: that is over now. Nothing more comes
    /// from the predecessor, and who has not read its last samples yet holds them.
    pub fn close_early(&mut self, node: usize, processes: &mut Processes) {
        let Some(candidate) = self.seats[node].candidate.as_ref().filter(|c| c.stage == Stage::Retiring)
        else {
            return;
        };
        if let Some(former) = candidate.former {
            processes.kill(node, former, None);
        }
        self.close(node, processes);
    }

    /// Removes what a process that has ended left behind, and frees its seat.
    fn free(&mut self, node: usize, generation: u32, processes: &mut Processes) {
        let member = self.member(node, generation);
        let spent = &mut self.seats[node].spent;
        spent.0 += self.control.cpu_ns(member);
        spent.1 += self.control.late_count(member);
        self.control.clear_slot(member);
        let crashed = processes
            .of(node, generation)
            .is_some_and(|process| process.end.as_ref().is_some_and(|end| !end.success()));
        if crashed {
            // Its ports would keep their places; what cannot be removed now goes with the run.
            let _ = bus::reap_dead(self.run_dir, &self.plan.run_id);
        }
        bus::state_transfer::remove(self.run_dir, self.plan, node, generation);
        let _ = std::fs::remove_file(bus::plan::backup_path(self.run_dir, node, generation));
        bus::claim::remove(self.run_dir, &self.plan.nodes[node].name, generation);
        processes.forget(node, generation, self.run_dir);
    }

    /// Whether the candidate of `node` can take the place of the active process at once. One that was never to be
    /// listened to cannot.
    pub fn can_promote(&self, node: usize) -> bool {
        self.seats[node].candidate.as_ref().is_some_and(|candidate| {
            candidate.stage == Stage::Shadowing && candidate.pending.purpose != Purpose::Shadow
        })
    }

    /// Whether the active process of `node` has completed a tick since it joined: a restart leads somewhere.
    pub fn has_come_on(&self, node: usize) -> bool {
        let active = &self.roster.nodes[node].primary;
        active.generation == 0 || self.control.done(self.member(node, active.generation)) > active.join_tick
    }

    /// The active process of `node` is dead: the candidate takes its place at the tick it did not complete.
    pub fn promote(&mut self, node: usize) -> Result<()> {
        let active = self.member(node, self.roster.nodes[node].primary.generation);
        let control = self.control;
        let roster = &mut self.roster.nodes[node];
        roster.take_over_tick = control.done(active);
        let outputs = roster.primary.plan.outputs.iter();
        roster.take_over_ticks = outputs.map(|output| control.ticks_sent(output.topic)).collect();
        self.roster.epoch += 1;
        self.roster.store(self.run_dir)?;
        control.set_slot_state(active, SlotState::Empty);
        control.set_epoch(self.roster.epoch);
        self.seats[node].is_vacant = true;
        Ok(())
    }

    /// The active process of `node` is dead: another one of its kind is started in its place.
    pub fn restart(&mut self, node: usize, processes: &mut Processes) -> Result<()> {
        let successor = Successor {
            node,
            join_tick: 0,
            take_over_tick: None,
            is_standby: false,
            program: self.seats[node].program.clone(),
            plan: self.roster.nodes[node].primary.plan.clone(),
        };
        self.seats[node].is_vacant = true;
        let (purpose, join) = (Purpose::Restart, Join::AtOnce);
        self.start_candidate(
            Pending { successor, purpose, is_planned: false, request: None, join },
            processes,
        )
    }

    /// Whether the active process of `node` is dead and somebody is on the way to its place.
    pub fn is_vacant(&self, node: usize) -> bool {
        self.seats[node].is_vacant
    }

    /// Takes the candidate of `node` out of the run; the active process flies on.
    pub fn refuse(&mut self, node: usize, reason: String, processes: &mut Processes) -> Result<()> {
        let Some(mut candidate) = self.seats[node].candidate.take() else { return Ok(()) };
        processes.kill(node, candidate.generation, None);
        let member = self.member(node, candidate.generation);
        self.control.set_slot_state(member, SlotState::Empty);
        let roster = &mut self.roster.nodes[node];
        if roster.backup.take().is_some() {
            roster.take_over_tick = u32::MAX;
            roster.take_over_ticks.fill(u32::MAX);
            // A roster that nobody was told of is replaced under its own number.
            if candidate.stage >= Stage::Announced {
                self.roster.epoch += 1;
            }
            self.roster.store(self.run_dir)?;
            self.control.set_epoch(self.roster.epoch);
        }
        self.free(node, candidate.generation, processes);
        candidate.report.refused = Some(reason);
        self.reports.push(candidate.report);
        Ok(())
    }

    /// The run ends: who has not joined does not join any more, and who shadows is reported as it is.
    pub fn end(&mut self, processes: &mut Processes) {
        self.pending.clear();
        for node in 0..self.seats.len() {
            let Some(candidate) = &self.seats[node].candidate else { continue };
            if candidate.stage < Stage::Shadowing && candidate.pending.join != Join::AtOnce {
                let generation = candidate.generation;
                processes.kill(node, generation, None);
                self.control.set_slot_state(self.member(node, generation), SlotState::Empty);
                if let Some(process) = processes.of(node, generation) {
                    process.is_settled = true;
                }
                if let Some(mut candidate) = self.seats[node].candidate.take() {
                    candidate.report.refused = Some("the run ended before it could join".to_owned());
                    self.reports.push(candidate.report);
                }
            }
        }
    }

    /// Processor time in nanoseconds, and deadlines missed, of all processes of `node`.
    pub fn spent(&self, node: usize) -> (u64, u32) {
        let members = (0..SLOTS_PER_NODE).map(|seat| self.control_use(seat * self.plan.nodes.len() + node));
        members.fold(self.seats[node].spent, |sum, used| (sum.0 + used.0, sum.1 + used.1))
    }

    fn control_use(&self, member: usize) -> (u64, u32) {
        (self.control.cpu_ns(member), self.control.late_count(member))
    }

    /// What became of all successors, those included that still shadow.
    pub fn into_reports(mut self) -> Vec<Report> {
        for mut candidate in self.seats.into_iter().filter_map(|seats| seats.candidate) {
            if candidate.report.purpose == Purpose::Swap && candidate.report.take_over_tick.is_none() {
                candidate.report.refused = Some("the run ended before it could take over".to_owned());
            }
            self.reports.push(candidate.report);
        }
        self.reports
    }
}

/// What the tick of a take-over must be a multiple of: so that the successor sends on every output at once, and who
/// joins later finds its samples.
pub fn take_over_stride(plan: &Plan, node: usize) -> u32 {
    let periods = plan.nodes[node].outputs.iter().map(|output| plan.topics[output.topic].period_ticks);
    let multiple = |a: u32, b: u32| (1..=b).map(|k| a.saturating_mul(k)).find(|m| m % b == 0).unwrap_or(a);
    periods.fold(plan.nodes[node].period_ticks, multiple)
}

fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
