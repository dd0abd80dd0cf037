//! State of a run as others see it in flight.

use super::segment::Segment;
use super::states::{Phase, SlotState, TransferOutcome};
use super::wake::{AWAKE, NEVER};
use crate::error::BusError;
use crate::place::Place;
use crate::plan::{InputPlan, Pace, Plan};
use crate::step_times::StepTimes;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::{Acquire, Relaxed};

/// The view of an observer of a run.
#[derive(Debug)]
pub struct LiveView {
    pub(super) segment: Segment,
}

impl LiveView {
    /// Opens the control segment of `plan`.
    ///
    /// # Errors
    /// If it does not exist or belongs to another plan.
    pub fn open(plan: &Plan) -> Result<Self, BusError> {
        Self::at(plan, Place::Process)
    }

    /// Opens the control segment of `plan` for an instance at `place`.
    pub(super) fn at(plan: &Plan, place: Place) -> Result<Self, BusError> {
        Ok(Self { segment: Segment::open(plan, place)? })
    }

    /// Place of the instance that has this view.
    pub(crate) fn place(&self) -> &Place {
        self.segment.place()
    }

    /// The phase of the run.
    #[must_use]
    pub fn phase(&self) -> Phase {
        Phase::of(self.segment.head().run.phase.load(Acquire))
    }

    /// The tick at which the run ends; it shrinks when the run is stopped.
    #[must_use]
    pub fn end_tick(&self) -> u32 {
        self.segment.head().run.end_tick.load(Acquire)
    }

    /// True if the run was aborted.
    #[must_use]
    pub fn is_aborted(&self) -> bool {
        self.segment.is_aborted()
    }

    /// True if a stop was requested.
    #[must_use]
    pub fn is_stop_requested(&self) -> bool {
        self.segment.head().steering.is_stop_requested.load(Acquire) != 0
    }

    /// The number of the newest membership.
    #[must_use]
    pub fn epoch(&self) -> u32 {
        self.segment.head().run.epoch.load(Acquire)
    }

    /// Number of checkpoints that were requested.
    #[must_use]
    pub fn checkpoint_asks(&self) -> u32 {
        self.segment.head().run.checkpoint_asks.load(Acquire)
    }

    /// The tick before which every node writes its part of the checkpoint that was requested last; 0 if none was.
    #[must_use]
    pub fn checkpoint_tick(&self) -> u32 {
        self.segment.head().run.checkpoint_tick.load(Acquire)
    }

    /// Ticks that may be computed.
    #[must_use]
    pub fn granted_ticks(&self) -> u32 {
        self.segment.head().clock.granted.load(Acquire)
    }

    /// The pace at which the clock grants ticks.
    #[must_use]
    pub fn pace(&self) -> Pace {
        let factor = f64::from_bits(self.segment.head().steering.pace.load(Acquire));
        if factor > 0.0 { Pace::Factor(factor) } else { Pace::Free }
    }

    /// The tick boundary at which a user wants the clock to wait; `u32::MAX` for none.
    #[must_use]
    pub fn hold_tick(&self) -> u32 {
        self.segment.head().steering.hold_tick.load(Acquire)
    }

    /// The boundary beyond which no tick is granted now.
    pub(crate) fn boundary(&self) -> u32 {
        self.hold_tick().min(self.segment.head().steering.join_tick.load(Acquire))
    }

    /// The boundary at which the clock waits now: every node has completed the ticks before it, and none
    /// has begun the next.
    #[must_use]
    pub fn held_at(&self) -> Option<u32> {
        Some(self.segment.head().clock.held_at.load(Acquire)).filter(|&tick| tick != NEVER)
    }

    /// True if the clock has to act next. Every tick that it granted is completed and no hold prevents the next
    /// grant, or it is still in a hold that was lifted.
    #[must_use]
    pub fn awaits_clock(&self) -> bool {
        let granted = self.granted_ticks();
        match self.held_at() {
            Some(tick) => self.boundary() > tick,
            None => granted < self.end_tick() && self.computing().all(|slot| self.done(slot) >= granted),
        }
    }

    /// Deadlines that were missed: a node had not finished the tick before, or the clock itself was more than
    /// a tick late.
    #[must_use]
    pub fn missed_deadlines(&self) -> u32 {
        self.segment.head().clock.missed_deadlines.load(Relaxed)
    }

    /// Host time at which the first and the last tick was granted and completed, in nanoseconds of the
    /// monotonic clock; zero until then.
    #[must_use]
    pub fn host_span_ns(&self) -> (u64, u64) {
        let clock = &self.segment.head().clock;
        (clock.start_ns.load(Relaxed), clock.end_ns.load(Relaxed))
    }

    /// The process of the clock service; `None` before it has started.
    #[must_use]
    pub fn clock_process(&self) -> Option<u32> {
        process(&self.segment.head().clock.process)
    }

    /// Processor time of the clock service, in nanoseconds.
    #[must_use]
    pub fn clock_cpu_ns(&self) -> u64 {
        self.segment.head().clock.cpu_ns.load(Relaxed)
    }

    /// Ticks of `topic` whose samples are sent.
    #[must_use]
    pub fn ticks_sent(&self, topic: usize) -> u32 {
        self.segment.topics()[topic].sent.load(Acquire)
    }

    /// Gaps that readers found in `topic`: each ends the run, so there are none in one that goes on.
    #[must_use]
    pub fn gaps(&self, topic: usize) -> u32 {
        self.segment.topics()[topic].gaps.load(Relaxed)
    }

    /// State of `slot`.
    #[must_use]
    pub fn slot_state(&self, slot: usize) -> SlotState {
        SlotState::of(self.segment.slots()[slot].state.load(Acquire))
    }

    /// The slots that compute, in ascending order.
    pub fn computing(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.segment.slots().len()).filter(|&slot| self.slot_state(slot) == SlotState::Taken)
    }

    /// True if the process in `slot` has reached `phase`.
    #[must_use]
    pub fn is_ready(&self, slot: usize, phase: Phase) -> bool {
        self.segment.slots()[slot].ready.load(Acquire) >= phase as u32
    }

    /// The newest membership that the process in `slot` has acknowledged.
    #[must_use]
    pub fn acknowledged_epoch(&self, slot: usize) -> u32 {
        self.segment.slots()[slot].epoch.load(Acquire)
    }

    /// Origin of the state with which the process in `slot` goes on.
    #[must_use]
    pub fn transfer(&self, slot: usize) -> TransferOutcome {
        TransferOutcome::of(self.segment.slots()[slot].transfer.load(Acquire))
    }

    /// True if the instance in `slot` has ended although its process may go on.
    #[must_use]
    pub fn has_left(&self, slot: usize) -> bool {
        self.segment.slots()[slot].has_left.load(Acquire) != 0
    }

    /// Ticks that the process in `slot` has completed, also those after the end of the run.
    #[must_use]
    pub fn done(&self, slot: usize) -> u32 {
        self.segment.slots()[slot].done.load(Acquire)
    }

    /// Ticks that the process in `slot` has completed.
    #[must_use]
    pub fn completed_by(&self, slot: usize) -> u32 {
        self.done(slot).min(self.end_tick())
    }

    /// True if the process in `slot` has completed the run.
    #[must_use]
    pub fn has_completed(&self, slot: usize) -> bool {
        self.done(slot) >= self.end_tick()
    }

    /// Ticks that every node has completed.
    #[must_use]
    pub fn completed_ticks(&self) -> u32 {
        let fewest = self.computing().map(|slot| self.done(slot)).min();
        fewest.unwrap_or(0).min(self.end_tick())
    }

    /// Deadlines at which the process in `slot` was late.
    #[must_use]
    pub fn late_count(&self, slot: usize) -> u32 {
        self.segment.slots()[slot].late.load(Relaxed)
    }

    /// Steps of the process in `slot` that took longer, in simulated time, than to its next due tick, and due ticks
    /// without a step.
    #[must_use]
    pub fn overruns(&self, slot: usize) -> [u32; 2] {
        let cell = &self.segment.slots()[slot];
        [&cell.overruns, &cell.skipped_steps].map(|count| count.load(Relaxed))
    }

    /// Processor time that the process in `slot` used between tick 0 and its last tick, in nanoseconds.
    #[must_use]
    pub fn cpu_ns(&self, slot: usize) -> u64 {
        self.segment.slots()[slot].cpu_ns.load(Relaxed)
    }

    /// The process in `slot`; `None` before it has connected.
    #[must_use]
    pub fn process(&self, slot: usize) -> Option<u32> {
        process(&self.segment.slots()[slot].process)
    }

    /// Histogram of the durations of the steps of the process in `slot`, from taking the inputs to the computed
    /// outputs.
    #[must_use]
    pub fn step_times(&self, slot: usize) -> StepTimes {
        let counts = &self.segment.slots()[slot].steps.counts;
        StepTimes::new(std::array::from_fn(|bucket| counts[bucket].load(Relaxed)))
    }

    /// The topic for which the process in `slot`, whose inputs are `inputs`, sleeps; `None` for one that computes,
    /// spins, or waits for something else.
    #[must_use]
    pub fn awaited_topic(&self, plan: &Plan, slot: usize, inputs: &[InputPlan]) -> Option<usize> {
        let waiters = &self.segment.inputs()[plan.first_input(slot)..];
        let mut inputs = inputs.iter().zip(waiters);
        let awaited =
            inputs.find(|(_, input)| is_asleep(&input.samples.word) || is_asleep(&input.shadow.word));
        awaited.map(|(input, _)| input.topic)
    }

    /// True if the process in `slot` sleeps until the one in the other slot of its node has advanced far enough.
    #[must_use]
    pub fn awaits_other(&self, slot: usize) -> bool {
        is_asleep(&self.segment.slots()[slot].other_waiter.word)
    }

    /// True if the process in `slot` sleeps until the clock grants its next tick.
    #[must_use]
    pub fn awaits_grant(&self, slot: usize) -> bool {
        is_asleep(&self.segment.slots()[slot].grant_waiter.word)
    }
}

fn is_asleep(waiter: &AtomicU32) -> bool {
    waiter.load(Acquire) != AWAKE
}

fn process(word: &AtomicU32) -> Option<u32> {
    Some(word.load(Relaxed)).filter(|&id| id != 0)
}
