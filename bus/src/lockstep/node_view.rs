//! Actions of a node's process on a run: it joins, waits for the needs of its tick, and reports its progress.

use super::live_view::LiveView;
use super::states::{Phase, SlotState, TransferOutcome, Waited};
use super::wait::{set_state, wait_for_count, wait_for_state};
use super::wake;
use crate::error::BusError;
use crate::place::Place;
use crate::plan::{Plan, Wait};
use crate::step_times::bucket_of;
use std::ops::Deref;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

/// The view of a process of a node.
#[derive(Debug)]
pub(crate) struct NodeView {
    live: LiveView,
    slot: usize,
    /// The other slot of this node: its predecessor's or its backup's.
    other_slot: usize,
    first_input: usize,
    has_outputs: bool,
}

/// A count that a process waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Need {
    /// Ticks that may be computed.
    Grant,
    /// Ticks of the topic of one of its inputs whose samples are sent.
    Samples { topic: usize, input: usize },
    /// Ticks of that topic for which the publisher's backup has sent a shadow sample.
    Shadow { topic: usize, input: usize },
    /// Ticks at whose start the process in the other slot has published its state.
    OtherState,
    /// Ticks that it has completed.
    OtherDone,
}

impl Deref for NodeView {
    type Target = LiveView;

    fn deref(&self) -> &LiveView {
        &self.live
    }
}

impl NodeView {
    /// Opens the control segment of `plan` as generation `generation` of node `node`, which runs at `place`.
    pub(crate) fn open(plan: &Plan, node: usize, generation: u32, place: Place) -> Result<Self, BusError> {
        let (slot, other_slot) = (plan.slot(node, generation), plan.slot(node, generation + 1));
        let has_outputs = !plan.nodes[node].outputs.is_empty();
        Ok(Self {
            live: LiveView::at(plan, place)?,
            slot,
            other_slot,
            first_input: plan.first_input(slot),
            has_outputs,
        })
    }

    /// Notes that this process is ready for `phase`.
    pub(crate) fn set_ready(&self, phase: Phase) {
        set_state(&self.segment.slots()[self.slot].ready, phase as u32);
        self.segment.notify_supervisor();
    }

    /// Waits until the run has reached `phase`.
    pub(crate) fn wait_phase(&self, phase: Phase) -> Waited {
        wait_for_state(&self.segment, &self.segment.head().run.phase, phase as u32)
    }

    /// Waits until the slot of this process is as far as `state`.
    pub(crate) fn wait_slot(&self, state: SlotState) -> Waited {
        wait_for_state(&self.segment, &self.segment.slots()[self.slot].state, state as u32)
    }

    /// Notes which process this is.
    pub(crate) fn note_process(&self) {
        self.segment.slots()[self.slot].process.store(std::process::id(), Relaxed);
    }

    /// Notes that the connections of this process agree with the membership number `epoch`.
    pub(crate) fn acknowledge(&self, epoch: u32) {
        self.segment.slots()[self.slot].epoch.store(epoch, Release);
        self.segment.notify_supervisor();
    }

    /// Notes that the instance of this slot has ended, although its process may go on.
    pub(crate) fn leave(&self) {
        self.segment.slots()[self.slot].has_left.store(1, Release);
        self.segment.notify_supervisor();
    }

    /// Notes the origin of the state with which this process goes on.
    pub(crate) fn set_transfer(&self, transfer: TransferOutcome) {
        self.segment.slots()[self.slot].transfer.store(transfer as u32, Release);
    }

    /// True if the run was aborted and the samples that this process waits for will not come. No process waits for a
    /// node without outputs. Such a node stays until the senders have left, so that none of their samples is lost.
    pub(crate) fn is_abandoned(&self) -> bool {
        if self.has_outputs { self.is_aborted() } else { self.segment.is_drained() }
    }

    /// True if a process computes in the other slot of this node.
    pub(crate) fn other_computes(&self) -> bool {
        self.slot_state(self.other_slot) == SlotState::Taken
    }

    /// The sequence of `need`, and the word on which this process sleeps for it.
    fn sequence_and_waiter(&self, need: Need) -> (&AtomicU32, &AtomicU32) {
        let (segment, slot) = (&self.segment, &self.segment.slots()[self.slot]);
        let waiters = |input: usize| &segment.inputs()[self.first_input + input];
        match need {
            Need::Grant => (&segment.head().clock.granted, &slot.grant_waiter.word),
            Need::Samples { topic, input } => (&segment.topics()[topic].sent, &waiters(input).samples.word),
            Need::Shadow { topic, input } => {
                (&segment.topics()[topic].shadow.word, &waiters(input).shadow.word)
            }
            Need::OtherState => (&segment.slots()[self.other_slot].published, &slot.other_waiter.word),
            Need::OtherDone => (&segment.slots()[self.other_slot].done, &slot.other_waiter.word),
        }
    }

    /// The count of `need`.
    pub(crate) fn count(&self, need: Need) -> u32 {
        self.sequence_and_waiter(need).0.load(Acquire)
    }

    /// True if the count of `need` has reached `count`.
    pub(crate) fn has(&self, need: Need, count: u32) -> bool {
        self.count(need) >= count
    }

    /// Waits until the count of `need` reaches `count`, or `is_over` says that it never will.
    pub(crate) fn wait(&self, need: Need, count: u32, wait: Wait, is_over: impl Fn() -> bool) -> Waited {
        let (sequence, waiter) = self.sequence_and_waiter(need);
        let is_over = || self.is_abandoned() || is_over();
        wait_for_count(&self.segment, sequence, count, waiter, wait, is_over)
    }

    /// Reports that the ticks before `count` have their samples of `topic`: `readers` wait for them, inputs among
    /// those of all slots.
    pub(crate) fn samples_sent(&self, topic: usize, count: u32, readers: &[usize]) {
        let inputs = self.segment.inputs();
        let waiters = readers.iter().map(|&input| &inputs[input].samples.word);
        wake::advance(&self.segment.topics()[topic].sent, count, waiters);
    }

    /// Reports shadow samples in the same way.
    pub(crate) fn shadow_sent(&self, topic: usize, count: u32, readers: &[usize]) {
        let inputs = self.segment.inputs();
        let waiters = readers.iter().map(|&input| &inputs[input].shadow.word);
        wake::advance(&self.segment.topics()[topic].shadow.word, count, waiters);
    }

    /// Reports that this process has published the state at the start of the ticks before `count`.
    pub(crate) fn state_published(&self, count: u32) {
        let slots = self.segment.slots();
        wake::advance(&slots[self.slot].published, count, [&slots[self.other_slot].other_waiter.word]);
    }

    /// Reports that this process has completed the ticks before `count`.
    pub(crate) fn completed(&self, count: u32) {
        let slots = self.segment.slots();
        let waiters = [&slots[self.slot].done_waiter.word, &slots[self.other_slot].other_waiter.word];
        wake::advance(&slots[self.slot].done, count, waiters);
    }

    /// Counts a step that took `ns`. Only this process does so: a load and a store suffice.
    pub(crate) fn count_step(&self, ns: u64) {
        let count = &self.segment.slots()[self.slot].steps.counts[bucket_of(ns)];
        count.store(count.load(Relaxed).wrapping_add(1), Relaxed);
    }

    /// Counts a step that is under way beyond the next due tick.
    pub(crate) fn count_overrun(&self) {
        self.segment.slots()[self.slot].overruns.fetch_add(1, Relaxed);
    }

    /// Counts a due tick without a step.
    pub(crate) fn count_skipped_step(&self) {
        self.segment.slots()[self.slot].skipped_steps.fetch_add(1, Relaxed);
    }

    /// Counts a gap that this process found in `topic`; it ends the run.
    pub(crate) fn count_gap(&self, topic: usize) {
        self.segment.topics()[topic].gaps.fetch_add(1, Relaxed);
    }

    /// Notes the processor time that this process used in its ticks.
    pub(crate) fn note_cpu(&self, ns: u64) {
        self.segment.slots()[self.slot].cpu_ns.store(ns, Relaxed);
    }
}
