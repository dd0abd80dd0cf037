//! Replacements: backups are started, join, shadow the primary, take over, and outlive it.
//!
//! A pure state machine: its observations of the run are a `View`, its actions are `Command`s.
//! Each node has at most one backup at a time, which goes through the stages below. A change of the run is a new
//! membership: it is written, every instance acknowledges it, and only then the next one is made.
//!
//! - `joining`: from the start of its process to its first tick
//! - `take_over`: from its first tick that counts to the end of its predecessor, planned or after a death
//! - `report`: reports about the backups

mod joining;
mod report;
mod take_over;

pub use report::{Purpose, Report};

use crate::program::{BackupSpec, Program};
use crate::view::View;
use bus::lockstep::{Phase, SlotState};
use bus::membership::Membership;
use bus::plan::{InputPlan, Plan};
use std::collections::VecDeque;
use std::time::Duration;

/// Stage of a backup on its way into the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
pub(crate) enum Stage {
    /// Its process starts and prepares its outputs, while the run flies on.
    Starting,
    /// The clock holds the tick; it connects its inputs.
    Joining,
    /// The others are informed and connect to it.
    Announced,
    /// It computes every tick; its samples are a shadow's until the take-over.
    Shadowing,
    /// Its samples count. The predecessor stays until every reader has taken its last ones.
    Retiring,
}

/// Tick at which a backup joins.
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
    /// The request for it.
    request: Option<u32>,
}

#[derive(Debug)]
struct Backup {
    pending: Pending,
    generation: u32,
    stage: Stage,
    /// Times on the watchdogs' clock: when its process could begin to join, and when the present stage began.
    started: Duration,
    stage_began: Duration,
    /// Host time at which its process was started, and since when the run waits for it: for the report.
    spawned: Duration,
    held_since: Option<Duration>,
    /// The generation that it has replaced.
    retired: Option<u32>,
    report: Report,
}

impl Backup {
    /// Reason of its refusal if the run ended before it could do `what`.
    fn ended_before(&self, what: &str) -> String {
        let Report { process, generation, .. } = &self.report;
        format!("the run ended before `{process}.{generation}` could {what}")
    }
}

/// A node's processes.
#[derive(Debug)]
struct Node {
    program: Program,
    backup: Option<Backup>,
    /// The highest generation that was started.
    newest_generation: u32,
    /// True if the primary is dead and not replaced yet.
    is_vacant: bool,
}

/// The replacements of a run.
#[derive(Debug)]
pub(crate) struct Replacements<'a> {
    plan: &'a Plan,
    /// The run as it was seen, with every command since.
    pub(crate) view: View,
    membership: Membership,
    nodes: Vec<Node>,
    pending: VecDeque<Pending>,
    /// Reports of the replacements that have ended.
    pub(crate) reports: Vec<Report>,
}

/// Role of an instance in its node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InstanceRole {
    /// Its samples count.
    Primary,
    /// It shadows the primary, or is on the way in.
    Backup,
    /// It was replaced, or is of no further interest.
    Retired,
}

impl<'a> Replacements<'a> {
    /// The replacements of a run that begins: those that are planned wait for their ticks.
    pub(crate) fn new(plan: &'a Plan, view: View, programs: &[Program], planned: &[BackupSpec]) -> Self {
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
    pub(crate) fn request_swap(
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

    /// True if a backup of `node` waits or is on its way.
    pub(crate) fn is_busy(&self, node: usize) -> bool {
        self.nodes[node].backup.is_some() || self.pending.iter().any(|pending| pending.spec.node == node)
    }

    /// Current role of the instance `generation` of a node.
    pub(crate) fn role(&self, node: usize, generation: u32) -> InstanceRole {
        let backup = self.nodes[node].backup.as_ref();
        if self.membership.nodes[node].primary.generation == generation {
            InstanceRole::Primary
        } else if backup.is_some_and(|backup| backup.generation == generation) {
            InstanceRole::Backup
        } else {
            InstanceRole::Retired
        }
    }

    /// The program of the primary of `node`, with the action at its end.
    pub(crate) fn program(&self, node: usize) -> &Program {
        &self.nodes[node].program
    }

    /// The program of a process of `node`.
    pub(crate) fn program_of(&self, node: usize, generation: u32) -> &Program {
        let backup = self.nodes[node].backup.as_ref().filter(|c| c.generation == generation);
        backup.map_or(&self.nodes[node].program, |backup| &backup.pending.spec.program)
    }

    fn slot(&self, node: usize, generation: u32) -> usize {
        self.plan.slot(node, generation)
    }

    /// True if every living instance has acknowledged the newest membership.
    pub(crate) fn all_agree(&self) -> bool {
        self.disagreeing().is_none()
    }

    /// A living instance that has not acknowledged the newest membership yet: its node and generation.
    pub(crate) fn disagreeing(&self) -> Option<(usize, u32)> {
        self.instances().find(|&(node, generation)| {
            let slot = self.slot(node, generation);
            self.view.slots[slot].state == SlotState::Taken
                && self.view.lives(node, generation)
                && self.view.slots[slot].acknowledged < self.view.epoch
        })
    }

    /// Node and generation of every instance that may compute.
    pub(crate) fn instances(&self) -> impl Iterator<Item = (usize, u32)> + '_ {
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
    pub(crate) fn inputs(&self, node: usize, generation: u32) -> &[InputPlan] {
        let backup = self.nodes[node].backup.as_ref().filter(|c| c.generation == generation);
        backup.map_or(&self.membership.nodes[node].primary.plan.inputs, |backup| {
            &backup.pending.spec.plan.inputs
        })
    }

    /// Starts the processes of those whose node has a free slot, and takes every backup as far as it can
    /// go now.
    pub(crate) fn advance(&mut self) {
        self.start_pending();
        // Until the first instances have joined, a backup waits for them.
        if self.view.phase != Phase::Running {
            let now = self.view.now;
            let backups = self.nodes.iter_mut().filter_map(|node| node.backup.as_mut());
            backups.for_each(|backup| backup.started = now);
        }
        for node in 0..self.nodes.len() {
            while self.advance_backup(node) {}
        }
    }

    /// Takes the backup of `node` one stage further; false where it must wait.
    fn advance_backup(&mut self, node: usize) -> bool {
        self.note_start(node);
        let Some(backup) = &self.nodes[node].backup else { return false };
        let slot = self.slot(node, backup.generation);
        let can_advance = match backup.stage {
            Stage::Starting => self.is_prepared(backup) && self.is_at_join(backup) && self.may_change(node),
            Stage::Joining => self.view.is_ready(slot, Phase::Running),
            Stage::Announced => self.all_agree(),
            // It may have completed the tick as a shadow before it was promoted there: the membership that says so is
            // replaced only when every instance has acknowledged it.
            Stage::Shadowing => self.has_flown(node) && self.all_agree(),
            Stage::Retiring => self.has_retired(node, backup),
        };
        if !can_advance {
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
            backup.stage_began = self.view.now;
        }
        true
    }

    /// The stage of the backup of `node`.
    pub(crate) fn stage(&self, node: usize) -> Option<Stage> {
        self.nodes[node].backup.as_ref().map(|backup| backup.stage)
    }

    /// One change at a time: the one before must be acknowledged, and no backup of another node may be joining.
    pub(crate) fn may_change(&self, node: usize) -> bool {
        let others = self.nodes.iter().enumerate().filter(|&(other, _)| other != node);
        let mut joining = others.filter_map(|(_, nodes)| nodes.backup.as_ref());
        !joining.any(|other| matches!(other.stage, Stage::Joining | Stage::Announced))
            && self.view.phase == Phase::Running
            && self.all_agree()
    }

    /// True if the dead primary of `node` can be replaced now. A backup that is joining, of this node or another,
    /// must have joined or been refused first.
    pub(crate) fn may_replace(&self, node: usize) -> bool {
        let backup = self.nodes[node].backup.as_ref();
        let is_joining =
            backup.is_some_and(|backup| matches!(backup.stage, Stage::Joining | Stage::Announced));
        !is_joining && self.may_change(node)
    }

    /// Removes the remains of a process that has ended, and frees its slot.
    fn free(&mut self, node: usize, generation: u32) {
        self.view.free(node, generation, self.slot(node, generation));
    }

    /// True if the primary of `node` is dead and being replaced.
    pub(crate) fn is_vacant(&self, node: usize) -> bool {
        self.nodes[node].is_vacant
    }

    /// Takes the backup of `node` out of the run; the primary goes on.
    pub(crate) fn refuse(&mut self, node: usize, reason: String) {
        let Some(mut backup) = self.nodes[node].backup.take() else { return };
        self.view.kill(node, backup.generation);
        let slot = self.slot(node, backup.generation);
        self.view.set_slot_state(slot, SlotState::Empty);
        self.withdraw(node, backup.stage);
        self.free(node, backup.generation);
        backup.report.refused = Some(reason);
        self.reports.push(backup.report);
    }

    /// Takes the backup of `node`, which had reached `stage`, out of the membership.
    fn withdraw(&mut self, node: usize, stage: Stage) {
        let membership = &mut self.membership.nodes[node];
        if membership.backup.take().is_some() {
            membership.take_over_tick = u32::MAX;
            membership.take_over_ticks.fill(u32::MAX);
            // A membership that was not published is replaced under its own number.
            if stage >= Stage::Announced {
                self.membership.epoch += 1;
            }
            self.view.store(&self.membership);
            self.view.set_epoch(self.membership.epoch);
        }
    }

    /// The run ends: backups that have not joined do not join any more, and those that shadow are reported as they are.
    pub(crate) fn end(&mut self) {
        self.pending.clear();
        for node in 0..self.nodes.len() {
            let is_late =
                |backup: &mut Backup| backup.stage < Stage::Shadowing && backup.pending.join != Join::AtOnce;
            let Some(mut backup) = self.nodes[node].backup.take_if(is_late) else { continue };
            self.view.kill(node, backup.generation);
            self.view.set_slot_state(self.slot(node, backup.generation), SlotState::Empty);
            self.view.settle(node, backup.generation);
            // The next change follows the newest membership that was published: a restart may still come.
            if backup.stage == Stage::Joining {
                self.withdraw(node, backup.stage);
            }
            backup.report.refused = Some(backup.ended_before("join"));
            self.reports.push(backup.report);
        }
    }

    /// Reports of every backup, including those that still shadow.
    pub(crate) fn into_reports(mut self) -> Vec<Report> {
        for mut backup in self.nodes.into_iter().filter_map(|nodes| nodes.backup) {
            if backup.report.purpose == Purpose::Swap && backup.report.take_over_tick.is_none() {
                backup.report.refused = Some(backup.ended_before("take over"));
            }
            self.reports.push(backup.report);
        }
        self.reports
    }
}

/// The first tick from `tick` on at which a backup of `node` may take over; `None` if the run ends before. The backup sends on every
/// output there, and a process that joins later finds its samples.
pub(crate) fn next_take_over(plan: &Plan, node: usize, tick: u32) -> Option<u32> {
    let stride = take_over_stride(plan, node);
    let mut tick = tick.checked_next_multiple_of(stride)?;
    loop {
        let sent = plan.nodes[node].outputs.iter().map(|output| plan.topics[output.topic].ticks.next(tick));
        match sent.max().filter(|due| *due > tick) {
            None => return Some(tick),
            Some(due) if due >= plan.duration_ticks => return None,
            Some(due) => tick = due.checked_next_multiple_of(stride)?,
        }
    }
}

/// Number of which the tick of a take-over must be a multiple: of the period of the node, and of those of its outputs that have one.
/// The greatest number if it has more than 32 bits.
pub(crate) fn take_over_stride(plan: &Plan, node: usize) -> u32 {
    let periods =
        plan.nodes[node].outputs.iter().filter_map(|output| plan.topics[output.topic].ticks.period());
    periods.fold(plan.nodes[node].period_ticks, least_common_multiple)
}

fn least_common_multiple(a: u32, b: u32) -> u32 {
    (a / greatest_common_divisor(a, b).max(1)).saturating_mul(b)
}

/// Greatest number of which both are multiples.
pub(crate) fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::{next_take_over, take_over_stride};
    use bus::plan::Plan;
    use bus::sample_ticks::SampleTicks;
    use serde_json::{Value, json};

    /// A run of 1000 ticks with one node, which computes every 10 ticks and sends at these.
    pub(crate) fn plan(sent: &[SampleTicks]) -> Plan {
        let topic = |ticks: &SampleTicks| json!({ "name": "/a", "type_name": "a/msg/B", "ticks": ticks });
        let topics: Vec<Value> = sent.iter().map(topic).collect();
        let outputs: Vec<Value> =
            (0..sent.len()).map(|topic| json!({ "port": "out", "topic": topic })).collect();
        let node = json!({
            "name": "a", "period_ticks": 10, "wait": "block", "inputs": [], "outputs": outputs, "parameters": null,
        });
        let plan = json!({
            "run_id": "test", "seed": 1, "tick_ns": 1_000_000, "duration_ticks": 1000, "window_ticks": 64,
            "pace": "free", "topics": topics, "nodes": [node],
        });
        serde_json::from_value(plan).unwrap()
    }

    #[test]
    fn a_backup_takes_over_where_it_sends_on_every_output() {
        let next = |sent: &[SampleTicks], tick| next_take_over(&plan(sent), 0, tick);
        let every = SampleTicks::every;
        assert_eq!(next(&[every(20), every(50)], 101), Some(200));
        assert_eq!(next(&[every(20)], 1001), Some(1020), "a take-over behind the end is refused elsewhere");
        // At tick 80, 180, 280, …
        let late = SampleTicks::measured(10, 1_000_000, 100_000_000, 80_000_000);
        assert_eq!([0, 81, 180].map(|tick| next(&[late], tick)), [Some(0), Some(180), Some(180)]);
        assert_eq!(next(&[late, every(30)], 1), Some(180));
        assert_eq!([next(&[late, every(50)], 1), next(&[late], 981)], [None, None]);
    }

    #[test]
    fn the_stride_of_long_periods_is_found_at_once() {
        let stride = |sent: &[SampleTicks]| take_over_stride(&plan(sent), 0);
        let every = SampleTicks::every;
        assert_eq!((stride(&[]), stride(&[every(20), every(50)])), (10, 100));
        assert_eq!(stride(&[every(400_000_001)]), 4_000_000_010);
        assert_eq!(stride(&[every(4_000_000_001), every(30)]), u32::MAX, "it has more than 32 bits");
    }
}
