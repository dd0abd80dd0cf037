//! Observations of a run by the supervisor, and its commands.

use crate::program::BackupSpec;
use bus::lockstep::{LiveView, Phase, SlotState, TransferOutcome};
use bus::membership::Membership;
use bus::plan::{InputPlan, Pace, Plan, SLOTS_PER_NODE};
use std::collections::BTreeSet;
use std::time::Duration;

/// Command of the supervisor.
#[derive(Clone, Debug)]
pub enum Command {
    /// Start an instance of a node.
    Spawn {
        /// The node.
        node: usize,
        /// Generation of the instance.
        generation: u32,
        /// Program to start, and the plan that it reads about itself.
        backup: Box<BackupSpec>,
    },
    /// Kill an instance, if it lives.
    Kill {
        /// The node.
        node: usize,
        /// Generation of the instance.
        generation: u32,
        /// Reason, for the user; `None` if it is not a failure.
        message: Option<String>,
    },
    /// The end of an instance needs no answer.
    Settle {
        /// The node.
        node: usize,
        /// Generation of the instance.
        generation: u32,
    },
    /// Remove the remains of an instance that has ended, and clear its slot.
    Free {
        /// The node.
        node: usize,
        /// Generation of the instance.
        generation: u32,
        /// Its slot.
        slot: usize,
    },
    /// Write a membership.
    Store(Box<Membership>),
    /// Write to the control segment.
    Write(SegmentWrite),
}

/// Write to the control segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SegmentWrite {
    /// Clear a slot for another instance.
    Clear(usize),
    /// Set the state of a slot.
    SetSlot(usize, SlotState),
    /// Have the instance in a slot begin at a tick.
    FirstTick(usize, u32),
    /// Have the shadow samples of a topic begin at a tick.
    StartShadow(usize, u32),
    /// Make this membership the newest one.
    Publish(u32),
    /// Have the clock wait at this tick for joining instances; `u32::MAX` for none.
    JoinTick(u32),
    /// Have the clock end the run at the next tick boundary.
    RequestStop,
    /// End the run at once: every wait returns, but those of nodes without outputs.
    Abort,
    /// The senders have left: every wait returns.
    Drained,
}

/// Observation of a slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlotView {
    /// State of the slot.
    pub state: SlotState,
    /// Progress of its instance in joining.
    pub ready: Phase,
    /// Ticks that it has completed.
    pub done: u32,
    /// The membership that it has acknowledged.
    pub acknowledged: u32,
    /// Origin of the state with which it goes on.
    pub transfer: TransferOutcome,
    /// True if it sleeps until the other instance of its node has advanced far enough.
    pub awaits_other: bool,
}

impl SlotView {
    /// A slot without an instance.
    pub const EMPTY: Self = Self {
        state: SlotState::Empty,
        ready: Phase::Announcing,
        done: 0,
        acknowledged: 0,
        transfer: TransferOutcome::Unknown,
        awaits_other: false,
    };
}

/// Observation of a run at a moment; later commands count as done already.
#[derive(Clone, Debug)]
pub struct View {
    /// Time on the watchdogs' clock.
    pub now: Duration,
    /// Host time.
    pub host: Duration,
    /// Host time of the first grant; zero until then.
    pub first_grant: Duration,
    /// Progress of the first instances in joining.
    pub phase: Phase,
    /// The pace at which the clock grants ticks.
    pub pace: Pace,
    /// Ticks that may be computed.
    pub granted: u32,
    /// The tick at which the clock waits.
    pub held_at: Option<u32>,
    /// The tick at which a user wants the clock to wait; `u32::MAX` for none.
    pub hold_tick: u32,
    /// True if the clock has to act next.
    pub awaits_clock: bool,
    /// The tick at which the run ends.
    pub end_tick: u32,
    /// True if a stop was requested.
    pub is_stop_requested: bool,
    /// True if the run was aborted.
    pub is_aborted: bool,
    /// The number of the newest membership.
    pub epoch: u32,
    /// Ticks whose sample has been sent, by topic.
    pub sent: Vec<u32>,
    /// The slots.
    pub slots: Vec<SlotView>,
    /// Instances that live: node and generation.
    pub living: BTreeSet<(usize, u32)>,
    /// Commands since the observation.
    pub commands: Vec<Command>,
}

impl View {
    /// Observation of the run of `plan` through `control`; the living instances and the times are left out.
    pub fn of(plan: &Plan, control: &LiveView) -> Self {
        let phase = |slot| {
            let phases = [Phase::Running, Phase::Connecting];
            phases.into_iter().find(|&phase| control.is_ready(slot, phase)).unwrap_or(Phase::Announcing)
        };
        let slot = |slot| SlotView {
            state: control.slot_state(slot),
            ready: phase(slot),
            done: control.done(slot),
            acknowledged: control.acknowledged_epoch(slot),
            transfer: control.transfer(slot),
            awaits_other: control.awaits_other(slot),
        };
        Self {
            now: Duration::ZERO,
            host: Duration::ZERO,
            first_grant: Duration::from_nanos(control.host_span_ns().0),
            phase: control.phase(),
            pace: control.pace(),
            granted: control.granted_ticks(),
            held_at: control.held_at(),
            hold_tick: control.hold_tick(),
            awaits_clock: control.awaits_clock(),
            end_tick: control.end_tick(),
            is_stop_requested: control.is_stop_requested(),
            is_aborted: control.is_aborted(),
            epoch: control.epoch(),
            sent: (0..plan.topics.len()).map(|topic| control.ticks_sent(topic)).collect(),
            slots: (0..SLOTS_PER_NODE * plan.nodes.len()).map(slot).collect(),
            living: BTreeSet::new(),
            commands: Vec::new(),
        }
    }

    /// Watchdogs' time since `then`.
    pub fn since(&self, then: Duration) -> Duration {
        self.now.saturating_sub(then)
    }

    /// True if the instance of a slot is ready for `phase`.
    pub fn is_ready(&self, slot: usize, phase: Phase) -> bool {
        self.slots[slot].ready >= phase
    }

    /// True if the instance of a slot has completed the run.
    pub fn has_completed(&self, slot: usize) -> bool {
        self.slots[slot].done >= self.end_tick
    }

    /// The slots that compute.
    pub fn computing(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.slots.len()).filter(|&slot| self.slots[slot].state == SlotState::Taken)
    }

    /// True if an instance lives.
    pub fn lives(&self, node: usize, generation: u32) -> bool {
        self.living.contains(&(node, generation))
    }

    /// True if the instance of a slot has every sample and the grant that its next tick needs.
    pub fn has_needs(&self, slot: usize, inputs: &[InputPlan]) -> bool {
        let tick = self.slots[slot].done;
        let is_sent = |input: &InputPlan| {
            self.sent[input.topic] >= tick.saturating_add(1).saturating_sub(input.delay_ticks)
        };
        tick < self.end_tick && self.granted > tick && inputs.iter().all(is_sent)
    }

    fn write(&mut self, write: SegmentWrite) {
        self.commands.push(Command::Write(write));
    }

    /// Commands a start.
    pub fn spawn(&mut self, node: usize, generation: u32, backup: &BackupSpec) {
        self.living.insert((node, generation));
        self.commands.push(Command::Spawn { node, generation, backup: Box::new(backup.clone()) });
    }

    /// Commands the end of an instance.
    pub fn kill(&mut self, node: usize, generation: u32) {
        self.living.remove(&(node, generation));
        self.commands.push(Command::Kill { node, generation, message: None });
    }

    /// Commands the end of an instance that has failed: it is answered as any other end.
    pub fn kill_for(&mut self, node: usize, generation: u32, message: String) {
        self.commands.push(Command::Kill { node, generation, message: Some(message) });
    }

    /// Commands the end of the run at the next tick boundary.
    pub fn request_stop(&mut self) {
        self.is_stop_requested = true;
        self.write(SegmentWrite::RequestStop);
    }

    /// Ticks that every node has completed.
    pub fn completed_ticks(&self) -> u32 {
        self.computing().map(|slot| self.slots[slot].done).min().unwrap_or(0).min(self.end_tick)
    }

    /// Ticks of the run that the instance of a slot has completed.
    pub fn completed_by(&self, slot: usize) -> u32 {
        self.slots[slot].done.min(self.end_tick)
    }

    /// Commands that the end of an instance is not answered.
    pub fn settle(&mut self, node: usize, generation: u32) {
        self.commands.push(Command::Settle { node, generation });
    }

    /// Commands that nothing of an instance stays.
    pub fn free(&mut self, node: usize, generation: u32, slot: usize) {
        self.slots[slot] = SlotView::EMPTY;
        self.commands.push(Command::Free { node, generation, slot });
    }

    /// Commands that a slot is cleared.
    pub fn clear_slot(&mut self, slot: usize) {
        self.slots[slot] = SlotView::EMPTY;
        self.write(SegmentWrite::Clear(slot));
    }

    /// Commands a new state of a slot.
    pub fn set_slot_state(&mut self, slot: usize, state: SlotState) {
        self.slots[slot].state = state;
        self.write(SegmentWrite::SetSlot(slot, state));
    }

    /// Commands the first tick of an instance.
    pub fn set_first_tick(&mut self, slot: usize, tick: u32) {
        self.slots[slot].done = tick;
        self.write(SegmentWrite::FirstTick(slot, tick));
    }

    /// Commands the first tick of shadow samples.
    pub fn start_shadow(&mut self, topic: usize, tick: u32) {
        self.write(SegmentWrite::StartShadow(topic, tick));
    }

    /// Commands that a membership is written.
    pub fn store(&mut self, membership: &Membership) {
        self.commands.push(Command::Store(Box::new(membership.clone())));
    }

    /// Commands that a membership is the newest one.
    pub fn set_epoch(&mut self, epoch: u32) {
        self.epoch = epoch;
        self.write(SegmentWrite::Publish(epoch));
    }
}
