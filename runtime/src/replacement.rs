//! Who replaces whom: backups are started, join, shadow the primary, take over and see it retire.
//!
//! A pure state machine: what it sees of the run is a `View`, what it wants done are `Command`s.
//! Each node has at most one backup at a time, which goes through the stages below. A change of the run is a new
//! membership: it is written, every instance acknowledges it, and only then the next one is made.

use crate::program::{BackupSpec, OnExit, Program};
use crate::view::View;
use bus::lockstep::{Phase, SlotState, TransferOutcome};
use bus::membership::{Instance, Membership};
use bus::plan::{InputPlan, OutputPlan, Plan};
use serde::Serialize;
use std::collections::VecDeque;
use std::time::Duration;

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

/// How far a backup has come.
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

/// When a backup joins.
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
    spec: BackupSpec,
    purpose: Purpose,
    is_planned: bool,
    join: Join,
    /// The request that asked for it.
    request: Option<u32>,
}

#[derive(Debug)]
struct Backup {
    pending: Pending,
    generation: u32,
    stage: Stage,
    /// When its process was started, and when the present stage began, on the clock of the watchdogs.
    started: Duration,
    stage_began: Duration,
    /// Host time at which its process was started, and since when the run waits for it: for the report.
    spawned: Duration,
    held_since: Option<Duration>,
    /// The generation that it has succeeded.
    retired: Option<u32>,
    report: Report,
}

/// A node's processes.
#[derive(Debug)]
struct Node {
    program: Program,
    backup: Option<Backup>,
    /// The highest generation that was started.
    newest_generation: u32,
    /// Whether the active process is dead and its place not taken yet.
    is_vacant: bool,
}

/// What became of a backup.
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

/// All replacements of a run.
#[derive(Debug)]
pub struct Replacements<'a> {
    plan: &'a Plan,
    /// What is seen of the run, with all that was commanded since.
    pub view: View,
    membership: Membership,
    nodes: Vec<Node>,
    pending: VecDeque<Pending>,
    /// What became of those that are through.
    pub reports: Vec<Report>,
}

/// What a process is to its node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstanceRole {
    /// Its samples count.
    Primary,
    /// It shadows the primary, or is on the way in.
    Backup,
    /// It was replaced, or is of no further interest.
    Retired,
}

impl<'a> Replacements<'a> {
    /// The replacements of a run that begins: those that are planned wait for their ticks.
    pub fn new(plan: &'a Plan, view: View, programs: &[Program], planned: &[BackupSpec]) -> Self {
        let nodes = programs.iter().map(|program| Node {
            program: program.clone(),
            backup: None,
            newest_generation: 0,
            is_vacant: false,
        });
        let pending = planned.iter().map(|spec| Pending {
            purpose: match (spec.take_over_tick, spec.is_standby) {
                (Some(_), _) => Purpose::Swap,
                (None, true) => Purpose::Standby,
                (None, false) => Purpose::Shadow,
            },
            is_planned: true,
            request: None,
            join: Join::At(spec.join_tick),
            spec: spec.clone(),
        });
        let (nodes, pending) = (nodes.collect(), pending.collect());
        let membership = Membership::first(plan);
        Self { plan, view, membership, nodes, pending, reports: Vec::new() }
    }

    /// Has `spec` join and take over after `shadow_ticks`: at `at_tick`, or as soon as its process is
    /// prepared.
    pub fn request_swap(
        &mut self,
        mut spec: BackupSpec,
        shadow_ticks: u32,
        at_tick: Option<u32>,
        request: u32,
    ) {
        let join = match at_tick {
            Some(tick) => Join::At(tick.saturating_sub(shadow_ticks)),
            None => Join::Next { shadow_ticks: Some(shadow_ticks) },
        };
        spec.take_over_tick = at_tick;
        self.pending.push_back(Pending {
            spec,
            purpose: Purpose::Swap,
            is_planned: true,
            request: Some(request),
            join,
        });
    }

    /// Whether a backup of `node` waits or is on its way.
    pub fn is_busy(&self, node: usize) -> bool {
        self.nodes[node].backup.is_some() || self.pending.iter().any(|pending| pending.spec.node == node)
    }

    /// What the process of a node's generation is to it now.
    pub fn role(&self, node: usize, generation: u32) -> InstanceRole {
        let backup = self.nodes[node].backup.as_ref();
        if self.membership.nodes[node].primary.generation == generation {
            InstanceRole::Primary
        } else if backup.is_some_and(|backup| backup.generation == generation) {
            InstanceRole::Backup
        } else {
            InstanceRole::Retired
        }
    }

    /// What follows the end of the active process of `node` by the manifest.
    pub fn program(&self, node: usize) -> &Program {
        &self.nodes[node].program
    }

    /// The program of a process of `node`.
    pub fn program_of(&self, node: usize, generation: u32) -> &Program {
        let backup = self.nodes[node].backup.as_ref().filter(|c| c.generation == generation);
        backup.map_or(&self.nodes[node].program, |backup| &backup.pending.spec.program)
    }

    fn slot(&self, node: usize, generation: u32) -> usize {
        self.plan.slot(node, generation)
    }

    /// Whether every living instance has acknowledged the newest membership.
    pub fn all_agree(&self) -> bool {
        self.disagreeing().is_none()
    }

    /// A living instance that has not acknowledged the newest membership yet: its node and generation.
    pub fn disagreeing(&self) -> Option<(usize, u32)> {
        self.members().find(|&(node, generation)| {
            let slot = self.slot(node, generation);
            self.view.slot_state(slot) == SlotState::Taken
                && self.view.lives(node, generation)
                && !self.view.has_completed(slot)
                && self.view.acknowledged_epoch(slot) < self.view.epoch()
        })
    }

    /// Node and generation of every process that may compute.
    pub fn members(&self) -> impl Iterator<Item = (usize, u32)> + '_ {
        self.membership.nodes.iter().enumerate().flat_map(|(node, membership)| {
            let backup = self.nodes[node].backup.as_ref();
            // While it retires, the predecessor still reads.
            let retired = backup.and_then(|backup| backup.retired);
            let backup = backup.map(|backup| backup.generation);
            let generations = [Some(membership.primary.generation), backup, retired];
            let mut seen: Vec<u32> = generations.into_iter().flatten().collect();
            seen.dedup();
            seen.into_iter().map(move |generation| (node, generation))
        })
    }

    /// The inputs of a process.
    pub fn inputs(&self, node: usize, generation: u32) -> &[InputPlan] {
        let backup = self.nodes[node].backup.as_ref().filter(|c| c.generation == generation);
        backup.map_or(&self.membership.nodes[node].primary.plan.inputs, |backup| {
            &backup.pending.spec.plan.inputs
        })
    }

    /// The backup on which the run waits, because it has not joined yet: node, generation, stage and when that
    /// began. One that is early for its tick, or prepares while the run flies, keeps nobody waiting.
    pub fn joining(&self) -> Option<(usize, u32, Stage, Duration)> {
        let backups = self.nodes.iter().enumerate();
        let awaited = backups.filter_map(|(node, nodes)| {
            let backup = nodes.backup.as_ref()?;
            let is_awaited = match (backup.stage, backup.pending.join) {
                (Stage::Starting, Join::At(tick)) => self.view.held_at() == Some(tick),
                (Stage::Starting, Join::Next { .. }) => false,
                (Stage::Starting, Join::AtOnce) | (Stage::Joining | Stage::Announced, _) => true,
                (Stage::Shadowing | Stage::Retiring, _) => false,
            };
            is_awaited.then_some((node, backup.generation, backup.stage, backup.stage_began))
        });
        // Those that only start wait for the one that is on the way in.
        awaited.max_by_key(|&(.., stage, _)| stage > Stage::Starting)
    }

    /// The tick at which the clock must wait for somebody to join; `u32::MAX` if nobody is awaited.
    pub fn hold_tick(&self) -> u32 {
        let backups = self.nodes.iter().filter_map(|nodes| {
            let backup = nodes.backup.as_ref().filter(|c| c.stage < Stage::Shadowing)?;
            match backup.pending.join {
                Join::At(tick) => Some(tick),
                Join::Next { .. } => self.is_prepared(backup).then(|| self.next_boundary(backup)),
                Join::AtOnce => None,
            }
        });
        let pending = self.pending.iter().filter_map(|pending| match pending.join {
            // Who took a dead process's place comes first, even if the run passes the tick.
            Join::At(_) if self.is_recovering(pending.spec.node) => None,
            Join::At(tick) => Some(tick),
            Join::Next { .. } | Join::AtOnce => None,
        });
        backups.chain(pending).min().unwrap_or(u32::MAX)
    }

    /// Whether the place of a dead process of `node` has just been taken.
    fn is_recovering(&self, node: usize) -> bool {
        self.nodes[node].backup.as_ref().is_some_and(|backup| {
            let is_recovery = matches!(backup.pending.purpose, Purpose::Restart | Purpose::Standby);
            is_recovery && (self.nodes[node].is_vacant || backup.stage == Stage::Retiring)
        })
    }

    /// Where the clock must wait for a backup: where it is, or at the node's next period.
    fn next_boundary(&self, backup: &Backup) -> u32 {
        let period = backup.pending.spec.plan.period_ticks;
        self.view.held_at().map_or(0, |held| held.next_multiple_of(period))
    }

    /// A node whose backup was to join at a tick that the run has passed.
    pub fn too_late(&self) -> Option<usize> {
        let held = self.view.held_at()?;
        self.nodes.iter().position(|nodes| {
            nodes.backup.as_ref().is_some_and(|backup| {
                backup.stage == Stage::Starting
                    && matches!(backup.pending.join, Join::At(tick) if tick < held)
            })
        })
    }

    fn is_prepared(&self, backup: &Backup) -> bool {
        let slot = self.slot(backup.pending.spec.node, backup.generation);
        self.view.is_ready(slot, Phase::Connecting)
    }

    /// Starts the processes of those whose node has a free slot, and takes every backup as far as it can
    /// go now.
    pub fn advance(&mut self) {
        self.start_pending();
        for node in 0..self.nodes.len() {
            while self.advance_backup(node) {}
        }
    }

    fn start_pending(&mut self) {
        let mut waiting = VecDeque::new();
        while let Some(pending) = self.pending.pop_front() {
            let node = pending.spec.node;
            let is_first = waiting.iter().all(|other: &Pending| other.spec.node != node);
            if self.nodes[node].backup.is_none() && is_first {
                self.start_backup(pending);
            } else {
                waiting.push_back(pending);
            }
        }
        self.pending = waiting;
    }

    fn start_backup(&mut self, pending: Pending) {
        let node = pending.spec.node;
        // A backup that failed leaves its generation unused, and its slot is the primary's other one.
        let active = self.membership.nodes[node].primary.generation;
        let next = self.nodes[node].newest_generation + 1;
        let is_other_slot = self.slot(node, next) != self.slot(node, active);
        let generation = if is_other_slot { next } else { next + 1 };
        let name = self.plan.nodes[node].name.clone();
        self.view.clear_slot(self.slot(node, generation));
        self.nodes[node].newest_generation = generation;
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
            inputs: pending.spec.plan.inputs.clone(),
        };
        self.view.spawn(node, generation, &pending.spec);
        self.nodes[node].backup = Some(Backup {
            pending,
            generation,
            stage: Stage::Starting,
            started: self.view.now(),
            stage_began: self.view.now(),
            spawned: self.view.host(),
            held_since: None,
            retired: None,
            report,
        });
    }

    /// The process of the backup of `node` could not be started. Where nobody else can go on, that is an error.
    pub fn note_not_started(
        &mut self,
        node: usize,
        generation: u32,
        error: &anyhow::Error,
    ) -> anyhow::Result<()> {
        let is_it = |backup: &mut Backup| backup.generation == generation;
        let Some(backup) = self.nodes[node].backup.take_if(is_it) else { return Ok(()) };
        if backup.pending.purpose == Purpose::Restart {
            anyhow::bail!("{error:#}");
        }
        self.free(node, generation);
        self.reports.push(Report { refused: Some(format!("{error:#}")), ..backup.report });
        Ok(())
    }

    /// Takes the backup of `node` one stage further; false where it must wait.
    fn advance_backup(&mut self, node: usize) -> bool {
        self.note_start(node);
        let Some(backup) = &self.nodes[node].backup else { return false };
        let slot = self.slot(node, backup.generation);
        let goes_on = match backup.stage {
            Stage::Starting => self.is_prepared(backup) && self.is_at_join(backup) && self.may_change(node),
            Stage::Joining => self.view.is_ready(slot, Phase::Running),
            Stage::Announced => self.all_agree(),
            // It may have completed the tick as a shadow before it was promoted there: the membership that says so is
            // replaced only when everybody has read it.
            Stage::Shadowing => self.has_flown(node) && self.all_agree(),
            Stage::Retiring => self.has_retired(node, backup),
        };
        if !goes_on {
            return false;
        }
        match backup.stage {
            Stage::Starting => self.let_join(node),
            Stage::Joining => self.announce(node),
            Stage::Announced => self.let_compute(node),
            Stage::Shadowing => self.commit(node),
            Stage::Retiring => self.close(node),
        }
        if let Some(backup) = &mut self.nodes[node].backup {
            backup.stage_began = self.view.now();
        }
        true
    }

    /// Whether the backup of `node` has completed its first tick that counts.
    fn has_flown(&self, node: usize) -> bool {
        let take_over_tick = self.membership.nodes[node].take_over_tick;
        self.nodes[node].backup.as_ref().is_some_and(|backup| {
            let done = self.view.done(self.slot(node, backup.generation));
            backup.stage == Stage::Shadowing && done > take_over_tick && take_over_tick < self.view.end_tick()
        })
    }

    /// The stage of the backup of `node`.
    pub fn stage(&self, node: usize) -> Option<Stage> {
        self.nodes[node].backup.as_ref().map(|backup| backup.stage)
    }

    /// A backup whose process has not come up in its time: node and generation.
    pub fn unprepared(&self) -> Option<(usize, u32)> {
        self.nodes.iter().enumerate().find_map(|(node, nodes)| {
            let backup = nodes.backup.as_ref().filter(|backup| backup.stage == Stage::Starting)?;
            let is_late = self.view.since(backup.started) > backup.pending.spec.program.watchdog;
            let is_up = self.view.phase() != Phase::Running || self.is_prepared(backup);
            (is_late && !is_up).then_some((node, backup.generation))
        })
    }

    /// A process that everybody has read the last samples of and that does not leave: node and generation.
    pub fn lingering(&self) -> Option<(usize, u32)> {
        self.nodes.iter().enumerate().find_map(|(node, nodes)| {
            let backup = nodes.backup.as_ref().filter(|backup| backup.stage == Stage::Retiring)?;
            let retired = backup.retired.filter(|&retired| self.view.lives(node, retired))?;
            let is_late = self.view.since(backup.stage_began) > nodes.program.watchdog;
            (is_late && self.is_read(backup)).then_some((node, retired))
        })
    }

    /// Takes back a backup that has not joined yet: its process is ended, and it waits for its turn again.
    pub fn postpone(&mut self, node: usize) {
        if self.stage(node) != Some(Stage::Starting) {
            return;
        }
        if let Some(backup) = self.nodes[node].backup.take() {
            self.view.kill(node, backup.generation);
            self.free(node, backup.generation);
            self.pending.push_front(backup.pending);
        }
    }

    /// Notes when the backup of `node` was prepared, and since when the run waits for it.
    fn note_start(&mut self, node: usize) {
        let Some(backup) = &self.nodes[node].backup else { return };
        if backup.stage != Stage::Starting {
            return;
        }
        let host = self.view.host();
        let (is_prepared, is_awaited) = (self.is_prepared(backup), self.is_at_join(backup));
        let Some(backup) = &mut self.nodes[node].backup else { return };
        if is_prepared && backup.report.start_ms == 0.0 {
            backup.report.start_ms = milliseconds(host.saturating_sub(backup.spawned));
        }
        if is_awaited {
            backup.held_since.get_or_insert(host);
        }
    }

    /// One change at a time: the one before must be agreed with, and nobody else may be on the way in.
    pub fn may_change(&self, node: usize) -> bool {
        let others = self.nodes.iter().enumerate().filter(|&(other, _)| other != node);
        let mut joining = others.filter_map(|(_, nodes)| nodes.backup.as_ref());
        !joining.any(|other| matches!(other.stage, Stage::Joining | Stage::Announced))
            && self.view.phase() == Phase::Running
            && self.all_agree()
    }

    /// Whether the dead active process of `node` can be replaced now: whoever is on the way in, its own backup
    /// included, comes to the end of that or is refused first.
    pub fn may_replace(&self, node: usize) -> bool {
        let backup = self.nodes[node].backup.as_ref();
        let is_joining =
            backup.is_some_and(|backup| matches!(backup.stage, Stage::Joining | Stage::Announced));
        !is_joining && self.may_change(node)
    }

    fn is_at_join(&self, backup: &Backup) -> bool {
        match (backup.pending.join, self.view.held_at()) {
            (Join::At(tick), Some(held)) => held == tick,
            (Join::Next { .. }, Some(held)) => held.is_multiple_of(backup.pending.spec.plan.period_ticks),
            (Join::AtOnce, _) => true,
            (_, None) => false,
        }
    }

    /// The clock waits at the tick: the backup may connect its inputs.
    fn let_join(&mut self, node: usize) {
        let Some(backup) = &mut self.nodes[node].backup else { return };
        let (plan, view) = (self.plan, &mut self.view);
        let active = plan.slot(node, self.membership.nodes[node].primary.generation);
        let spec = &backup.pending.spec;
        let outputs = &spec.plan.outputs;
        let (join_tick, take_over_tick) = match backup.pending.join {
            Join::At(tick) => (tick, spec.take_over_tick.unwrap_or(u32::MAX)),
            Join::Next { shadow_ticks } => {
                let tick = view.held_at().unwrap_or_default();
                let stride = take_over_stride(plan, node);
                let take_over = shadow_ticks
                    .and_then(|ticks| tick.checked_add(ticks.max(1))?.checked_next_multiple_of(stride));
                (tick, take_over.unwrap_or(u32::MAX))
            }
            Join::AtOnce => (view.done(active), view.done(active)),
        };
        let shadows = backup.pending.join != Join::AtOnce;
        let membership = &mut self.membership.nodes[node];
        membership.take_over_tick = take_over_tick;
        membership.take_over_ticks = if shadows {
            vec![take_over_tick; outputs.len()]
        } else {
            outputs.iter().map(|output| view.ticks_sent(output.topic)).collect()
        };
        let slot = plan.slot(node, backup.generation);
        for (output, &take_over_tick) in outputs.iter().zip(&membership.take_over_ticks) {
            // The next tick at which a shadow sample is due; one that does not shadow sends none.
            let due = join_tick.next_multiple_of(plan.topics[output.topic].period_ticks);
            view.start_shadow(output.topic, if shadows { due } else { take_over_tick });
        }
        view.set_first_tick(slot, join_tick);
        membership.backup =
            Some(Instance { generation: backup.generation, join_tick, shadows, plan: spec.plan.clone() });
        self.membership.epoch += 1;
        view.store(&self.membership);
        backup.report.join_tick = Some(join_tick);
        backup.stage = Stage::Joining;
        view.set_slot_state(slot, SlotState::Joining);
    }

    /// The backup has connected: everybody connects to it.
    fn announce(&mut self, node: usize) {
        self.view.set_epoch(self.membership.epoch);
        self.set_stage(node, Stage::Announced);
    }

    /// Everybody is connected: it computes from its tick on.
    fn let_compute(&mut self, node: usize) {
        let host = self.view.host();
        let Some(backup) = &mut self.nodes[node].backup else { return };
        let slot = self.plan.slot(node, backup.generation);
        backup.report.hold_ms =
            backup.held_since.map_or(0.0, |since| milliseconds(host.saturating_sub(since)));
        backup.report.hand_over = match self.view.transfer(slot) {
            TransferOutcome::Unknown => None,
            TransferOutcome::State => Some("state"),
            TransferOutcome::LastOutput => Some("last output"),
        };
        backup.stage = Stage::Shadowing;
        self.view.set_slot_state(slot, SlotState::Taken);
        if backup.pending.join == Join::AtOnce {
            // The clock waited for the dead process until its place was taken.
            let dead = self.plan.slot(node, self.membership.nodes[node].primary.generation);
            self.view.set_slot_state(dead, SlotState::Empty);
        }
        self.view.set_epoch(self.membership.epoch);
    }

    /// Whether the backup of `node` has sent a sample that counts. Readers may have turned to it: even if it dies
    /// now, there is no way back to its predecessor.
    pub fn has_taken_over(&self, node: usize) -> bool {
        let membership = &self.membership.nodes[node];
        let is_shadowing = self.nodes[node].backup.as_ref().is_some_and(|c| c.stage == Stage::Shadowing);
        let outputs = membership.primary.plan.outputs.iter().zip(&membership.take_over_ticks);
        let has_sent = |(output, &tick): (&OutputPlan, &u32)| {
            let period_ticks = u64::from(self.plan.topics[output.topic].period_ticks);
            let first_due = u64::from(tick).next_multiple_of(period_ticks);
            u64::from(self.view.ticks_sent(output.topic)) > first_due
        };
        is_shadowing && outputs.into_iter().any(has_sent)
    }

    /// Its first tick is done, or lost with it: from now on it is the active one.
    pub fn commit(&mut self, node: usize) {
        let membership = &mut self.membership.nodes[node];
        let take_over_tick = membership.take_over_tick;
        let retired = membership.primary.generation;
        if let Some(backup) = membership.backup.take() {
            membership.primary = backup;
        }
        membership.take_over_tick = u32::MAX;
        membership.take_over_ticks.fill(u32::MAX);
        self.nodes[node].is_vacant = false;
        if let Some(backup) = &mut self.nodes[node].backup {
            backup.report.take_over_tick = Some(take_over_tick);
            backup.retired = Some(retired);
            backup.stage = Stage::Retiring;
        }
        // Every node knows already: this is for those who look at the run from outside.
        self.view.store(&self.membership);
    }

    fn set_stage(&mut self, node: usize, stage: Stage) {
        if let Some(backup) = &mut self.nodes[node].backup {
            backup.stage = stage;
        }
    }

    /// The process has ended: if it is a predecessor that did not come to leave by itself, nobody waits for it.
    pub fn note_end_of_retired(&mut self, node: usize, generation: u32) {
        let backup = self.nodes[node].backup.as_ref();
        if backup.is_some_and(|backup| backup.retired == Some(generation)) {
            self.view.set_slot_state(self.slot(node, generation), SlotState::Empty);
            self.view.set_epoch(self.view.epoch());
        }
    }

    /// Whether the predecessor has left and everybody has read its last samples.
    fn has_retired(&self, node: usize, backup: &Backup) -> bool {
        if backup.retired.is_some_and(|retired| self.view.lives(node, retired)) {
            return false;
        }
        self.is_read(backup)
    }

    /// Whether everybody has read the last samples of the process that `backup` has succeeded.
    fn is_read(&self, backup: &Backup) -> bool {
        let longest = self.plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
        let taken = backup.report.take_over_tick.unwrap_or_default().saturating_add(longest + 1);
        let taken = taken.min(self.view.end_tick());
        self.view.computing().all(|slot| self.view.done(slot) >= taken)
    }

    /// The predecessor is gone: its slot is free, and nothing of it stays.
    fn close(&mut self, node: usize) {
        let Some(backup) = self.nodes[node].backup.take() else { return };
        if let Some(retired) = backup.retired {
            self.free(node, retired);
        }
        let on_exit = self.nodes[node].program.on_exit;
        self.nodes[node].program = Program { on_exit, ..backup.pending.spec.program.clone() };
        if on_exit == OnExit::Standby {
            // Who was promoted gets a standby of its own, as soon as a tick boundary comes.
            let pending = Pending {
                spec: backup.pending.spec,
                purpose: Purpose::Standby,
                is_planned: false,
                request: None,
                join: Join::Next { shadow_ticks: None },
            };
            self.pending.push_back(pending);
        }
        self.reports.push(backup.report);
    }

    /// The active process of `node` has died while its predecessor retired: that is over now. Nothing more comes
    /// from the predecessor, and who has not read its last samples yet holds them.
    pub fn close_early(&mut self, node: usize) {
        let Some(backup) = self.nodes[node].backup.as_ref().filter(|c| c.stage == Stage::Retiring) else {
            return;
        };
        if let Some(retired) = backup.retired {
            self.view.kill(node, retired);
        }
        self.close(node);
    }

    /// Removes what a process that has ended left behind, and frees its slot.
    fn free(&mut self, node: usize, generation: u32) {
        self.view.free(node, generation, self.slot(node, generation));
    }

    /// Whether the backup of `node` can take the place of the active process at once. One that was never to be
    /// listened to cannot.
    pub fn can_promote(&self, node: usize) -> bool {
        self.nodes[node].backup.as_ref().is_some_and(|backup| {
            backup.stage == Stage::Shadowing && backup.pending.purpose != Purpose::Shadow
        })
    }

    /// Whether the active process of `node` has completed a tick since it joined: a restart leads somewhere.
    pub fn has_come_on(&self, node: usize) -> bool {
        let active = &self.membership.nodes[node].primary;
        active.generation == 0 || self.view.done(self.slot(node, active.generation)) > active.join_tick
    }

    /// The active process of `node` is dead: the backup takes its place at the tick it did not complete.
    pub fn promote(&mut self, node: usize) {
        let active = self.slot(node, self.membership.nodes[node].primary.generation);
        let view = &self.view;
        let membership = &mut self.membership.nodes[node];
        membership.take_over_tick = view.done(active);
        let outputs = membership.primary.plan.outputs.iter();
        membership.take_over_ticks = outputs.map(|output| view.ticks_sent(output.topic)).collect();
        self.membership.epoch += 1;
        self.view.store(&self.membership);
        self.view.set_slot_state(active, SlotState::Empty);
        self.view.set_epoch(self.membership.epoch);
        self.nodes[node].is_vacant = true;
    }

    /// The active process of `node` is dead: another one of its kind is started in its place.
    pub fn restart(&mut self, node: usize) {
        let spec = BackupSpec {
            node,
            join_tick: 0,
            take_over_tick: None,
            is_standby: false,
            program: self.nodes[node].program.clone(),
            plan: self.membership.nodes[node].primary.plan.clone(),
        };
        self.nodes[node].is_vacant = true;
        let (purpose, join) = (Purpose::Restart, Join::AtOnce);
        self.start_backup(Pending { spec, purpose, is_planned: false, request: None, join });
    }

    /// Whether the active process of `node` is dead and somebody is on the way to its place.
    pub fn is_vacant(&self, node: usize) -> bool {
        self.nodes[node].is_vacant
    }

    /// Takes the backup of `node` out of the run; the active process flies on.
    pub fn refuse(&mut self, node: usize, reason: String) {
        let Some(mut backup) = self.nodes[node].backup.take() else { return };
        self.view.kill(node, backup.generation);
        let slot = self.slot(node, backup.generation);
        self.view.set_slot_state(slot, SlotState::Empty);
        let membership = &mut self.membership.nodes[node];
        if membership.backup.take().is_some() {
            membership.take_over_tick = u32::MAX;
            membership.take_over_ticks.fill(u32::MAX);
            // A membership that nobody was told of is replaced under its own number.
            if backup.stage >= Stage::Announced {
                self.membership.epoch += 1;
            }
            self.view.store(&self.membership);
            self.view.set_epoch(self.membership.epoch);
        }
        self.free(node, backup.generation);
        backup.report.refused = Some(reason);
        self.reports.push(backup.report);
    }

    /// The run ends: who has not joined does not join any more, and who shadows is reported as it is.
    pub fn end(&mut self) {
        self.pending.clear();
        for node in 0..self.nodes.len() {
            let Some(backup) = &self.nodes[node].backup else { continue };
            if backup.stage < Stage::Shadowing && backup.pending.join != Join::AtOnce {
                let generation = backup.generation;
                self.view.kill(node, generation);
                self.view.set_slot_state(self.slot(node, generation), SlotState::Empty);
                self.view.settle(node, generation);
                if let Some(mut backup) = self.nodes[node].backup.take() {
                    backup.report.refused = Some("the run ended before it could join".to_owned());
                    self.reports.push(backup.report);
                }
            }
        }
    }

    /// What became of all backups, those included that still shadow.
    pub fn into_reports(mut self) -> Vec<Report> {
        for mut backup in self.nodes.into_iter().filter_map(|nodes| nodes.backup) {
            if backup.report.purpose == Purpose::Swap && backup.report.take_over_tick.is_none() {
                backup.report.refused = Some("the run ended before it could take over".to_owned());
            }
            self.reports.push(backup.report);
        }
        self.reports
    }
}

/// What the tick of a take-over must be a multiple of: so that the backup sends on every output at once, and who
/// joins later finds its samples.
pub fn take_over_stride(plan: &Plan, node: usize) -> u32 {
    let periods = plan.nodes[node].outputs.iter().map(|output| plan.topics[output.topic].period_ticks);
    let multiple = |a: u32, b: u32| (1..=b).map(|k| a.saturating_mul(k)).find(|m| m % b == 0).unwrap_or(a);
    periods.fold(plan.nodes[node].period_ticks, multiple)
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
