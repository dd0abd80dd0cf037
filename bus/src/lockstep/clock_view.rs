//! Actions of the clock on a run: it leads the processes through the phases, grants ticks, waits and holds.

use super::live_view::LiveView;
use super::states::{Phase, Waited};
use super::{wait, wake};
use crate::error::BusError;
use crate::host_time::monotonic_ns;
use crate::place::Place;
use crate::plan::{Plan, Wait};
use std::ops::Deref;
use std::sync::atomic::Ordering::{Relaxed, Release};

/// The clock's view of a run.
#[derive(Debug)]
pub(crate) struct ClockView {
    live: LiveView,
}

impl Deref for ClockView {
    type Target = LiveView;

    fn deref(&self) -> &LiveView {
        &self.live
    }
}

impl ClockView {
    /// Opens the control segment of `plan` as its clock service, which runs at `place`.
    pub(crate) fn open(plan: &Plan, place: Place) -> Result<Self, BusError> {
        let live = LiveView::at(plan, place)?;
        live.segment.head().clock.process.store(std::process::id(), Relaxed);
        Ok(Self { live })
    }

    /// Waits until the process in `slot` is ready for `phase`.
    pub(crate) fn wait_ready(&self, slot: usize, phase: Phase) -> Waited {
        wait::wait_for_state(&self.segment, &self.segment.slots()[slot].ready, phase as u32)
    }

    /// Moves the run to `phase` and wakes the processes that wait for it.
    pub(crate) fn set_phase(&self, phase: Phase) {
        wait::set_state(&self.segment.head().run.phase, phase as u32);
    }

    /// Grants the ticks before `ticks`.
    pub(crate) fn grant(&self, ticks: u32) {
        let waiters = self.segment.slots().iter().map(|slot| &slot.grant_waiter.word);
        wake::advance(&self.segment.head().clock.granted, ticks, waiters);
    }

    /// Waits until the process in `slot` has completed `ticks` ticks, or `is_over` says that it never will.
    pub(crate) fn wait_done(&self, slot: usize, ticks: u32, is_over: impl Fn() -> bool) -> Waited {
        let cell = &self.segment.slots()[slot];
        let is_over = || self.is_aborted() || is_over();
        wait::wait_for_count(&self.segment, &cell.done, ticks, &cell.done_waiter.word, Wait::Block, is_over)
    }

    /// Waits in the hold at `tick` until it is lifted or the run `is_over`.
    pub(crate) fn hold(&self, tick: u32, is_over: impl Fn() -> bool) {
        let head = self.segment.head();
        let is_lifted = || self.boundary() > tick || self.is_aborted() || is_over();
        let tell = || self.segment.notify_supervisor();
        wake::hold(&head.clock.held_at, tick, &head.steering.changes, is_lifted, tell);
    }

    /// Ends the run at `tick`, which no process may have passed.
    pub(crate) fn set_end_tick(&self, tick: u32) {
        self.segment.head().run.end_tick.store(tick, Release);
        self.segment.wake_everybody();
    }

    /// Asks this process itself to end the run at the next tick boundary.
    pub(crate) fn request_stop(&self) {
        self.segment.request_stop();
    }

    /// Counts a missed deadline, and the slots that were late; no slots if the clock itself was late.
    pub(crate) fn count_missed_deadline(&self, late: impl Iterator<Item = usize>) {
        self.segment.head().clock.missed_deadlines.fetch_add(1, Relaxed);
        late.for_each(|slot| {
            self.segment.slots()[slot].late.fetch_add(1, Relaxed);
        });
    }

    /// Notes that the first tick is granted now.
    pub(crate) fn note_start(&self) {
        self.segment.head().clock.start_ns.store(monotonic_ns(), Relaxed);
    }

    /// Notes that the last tick is completed now, and the processor time that the clock has used.
    pub(crate) fn note_end(&self, cpu_ns: u64) {
        let clock = &self.segment.head().clock;
        clock.end_ns.store(monotonic_ns(), Relaxed);
        clock.cpu_ns.store(cpu_ns, Relaxed);
    }
}
