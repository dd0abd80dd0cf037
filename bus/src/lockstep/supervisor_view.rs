//! Actions of the supervisor on a run: it makes the segment, changes the membership, steers the clock, and ends the
//! run.

use super::live_view::LiveView;
use super::segment::Segment;
use super::states::{Abort, Phase, SlotState, TransferOutcome};
use super::wait::set_state;
use super::wake::{self, AWAKE, NEVER, Word};
use crate::error::BusError;
use crate::plan::{Pace, Plan};
use std::ops::Deref;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::Duration;

/// The supervisor's view of a run, and that of a user who steers it.
#[derive(Debug)]
pub struct SupervisorView {
    live: LiveView,
}

impl Deref for SupervisorView {
    type Target = LiveView;

    fn deref(&self) -> &LiveView {
        &self.live
    }
}

impl SupervisorView {
    /// Creates the control segment of `plan`, readable and writable by this user alone.
    ///
    /// # Errors
    /// If the segment exists already or shared memory cannot be had.
    pub fn create(plan: &Plan) -> Result<Self, BusError> {
        let segment = Segment::create(plan)?;
        let head = segment.head();
        head.run.end_tick.store(plan.duration_ticks, Relaxed);
        head.clock.held_at.store(NEVER, Relaxed);
        head.steering.hold_tick.store(NEVER, Relaxed);
        head.steering.join_tick.store(NEVER, Relaxed);
        segment.waiters().for_each(|waiter| waiter.store(AWAKE, Relaxed));
        let this = Self { live: LiveView { segment } };
        this.set_pace(plan.pace);
        this.begin_at(plan);
        // Generation 0 of every node is there from the start.
        (0..plan.nodes.len()).for_each(|slot| this.set_slot_state(slot, SlotState::Taken));
        this.segment.publish();
        Ok(this)
    }

    /// Counts the ticks before the first one of `plan` as granted, sent and completed.
    fn begin_at(&self, plan: &Plan) {
        self.segment.head().clock.granted.store(plan.first_tick, Relaxed);
        for (cell, topic) in self.segment.topics().iter().zip(&plan.topics) {
            cell.sent.store(topic.ticks.next(plan.first_tick), Relaxed);
        }
        // A node counts as far as its first due tick: the clock holds no boundary for a slower one.
        for (slot, node) in plan.nodes.iter().enumerate() {
            self.set_first_tick(slot, plan.first_tick.next_multiple_of(node.period_ticks.max(1)));
        }
    }

    /// Opens the control segment of `plan`, to steer a run that another process supervises.
    ///
    /// # Errors
    /// If it does not exist or belongs to another plan.
    pub fn open(plan: &Plan) -> Result<Self, BusError> {
        Ok(Self { live: LiveView::open(plan)? })
    }

    /// Ends the run at once: every wait returns, except those of nodes without outputs, which take the remaining
    /// samples.
    pub fn abort(&self) {
        self.end_at_once(Abort::Told);
    }

    /// Makes every wait of an aborted run return: the senders have left.
    pub fn note_drained(&self) {
        self.end_at_once(Abort::Drained);
    }

    fn end_at_once(&self, abort: Abort) {
        self.segment.head().run.abort.store(abort as u32, Release);
        self.segment.wake_everybody();
    }

    /// Asks the clock to end the run at the next tick boundary.
    pub fn request_stop(&self) {
        self.segment.request_stop();
    }

    /// Makes the clock wait at the boundary before `tick`, or at its own if that is later; `u32::MAX` lets it run.
    pub fn set_hold_tick(&self, tick: u32) {
        let steering = &self.segment.head().steering;
        wake::ask_for_hold(&steering.hold_tick, tick, &steering.changes);
    }

    /// Makes the clock wait in the same way for a process that joins.
    pub fn set_join_tick(&self, tick: u32) {
        let steering = &self.segment.head().steering;
        if steering.join_tick.load(Relaxed) != tick {
            wake::ask_for_hold(&steering.join_tick, tick, &steering.changes);
        }
    }

    /// Makes every node write its part of a checkpoint before `tick`, at which the clock holds the run: at once, or at its
    /// next step if the hold is lifted first.
    pub fn ask_for_checkpoint(&self, tick: u32) {
        let run = &self.segment.head().run;
        // A reader that sees the number sees the tick.
        run.checkpoint_tick.store(tick, Release);
        run.checkpoint_asks.fetch_add(1, Release);
        self.segment.wake_everybody();
    }

    /// Changes the pace; the clock follows at its next grant.
    pub fn set_pace(&self, pace: Pace) {
        let factor = if let Pace::Factor(factor) = pace { factor } else { 0.0 };
        self.segment.head().steering.pace.store(factor.to_bits(), Release);
    }

    /// Sets the state of a slot, and wakes the process that waits for it.
    pub fn set_slot_state(&self, slot: usize, state: SlotState) {
        set_state(&self.segment.slots()[slot].state, state as u32);
    }

    /// Empties a slot, for another process.
    pub fn clear_slot(&self, slot: usize) {
        self.set_slot_state(slot, SlotState::Empty);
        let cell = &self.segment.slots()[slot];
        cell.ready.store(Phase::Announcing as u32, Relaxed);
        cell.transfer.store(TransferOutcome::Unknown as u32, Relaxed);
        // A reader that sees a count of 0 sees that the slot is empty: the clock does not wait for an instance that
        // has left.
        for count in [
            &cell.late,
            &cell.epoch,
            &cell.done,
            &cell.published,
            &cell.overruns,
            &cell.skipped_steps,
            &cell.has_left,
        ] {
            count.store(0, Release);
        }
        cell.cpu_ns.store(0, Relaxed);
    }

    /// Makes the process in a slot begin at `tick`.
    pub fn set_first_tick(&self, slot: usize, tick: u32) {
        self.segment.slots()[slot].done.store(tick, Release);
    }

    /// Makes the shadow samples of `topic` begin at `tick`.
    pub fn start_shadow(&self, topic: usize, tick: u32) {
        self.segment.topics()[topic].shadow.word.store(tick, Release);
    }

    /// Makes the membership number `epoch` the newest one, and wakes every process to look at it.
    pub fn set_epoch(&self, epoch: u32) {
        self.segment.head().run.epoch.store(epoch, Release);
        self.segment.wake_everybody();
    }

    /// The count of the supervisor's notices: to be read before a look at the run, and waited on after it.
    #[must_use]
    pub fn notices(&self) -> u32 {
        self.segment.head().notices.count.load(Acquire)
    }

    /// Sleeps until there is something to look at since `notices`, at most `timeout`.
    pub fn wait_for_notice(&self, notices: u32, timeout: Duration) {
        self.segment.head().notices.count.sleep(notices, Some(timeout));
    }
}
