//! The clock service: leads the processes of a run through the ready barrier and grants their ticks.

use crate::error::BusError;
use crate::host_time::monotonic_ns;
use crate::join::Join;
use crate::lockstep::{ClockView, Phase, SlotState, Waited};
use crate::plan::{Pace, Plan};
use crate::profile::GrantWriter;
use rustix::thread::clock_nanosleep_absolute;
use std::cell::RefCell;

/// Longest sleep of the clock before it checks for a request to stop.
const NAP_NS_MAX: u64 = 100_000_000;

/// Runs the clock of the run that `join` names until the run is over.
///
/// # Errors
/// If there is no such run; [`BusError::Aborted`] if the launcher ended the run early.
pub fn run(join: Join) -> Result<(), BusError> {
    let Join { run_dir, place, .. } = join;
    let plan = Plan::load(&run_dir)?;
    let _claim = crate::claim::claim(&run_dir, "clock")?;
    place.stay_on(plan.clock_cpu);
    let grants = plan.profile.then(|| GrantWriter::create(&run_dir, &plan)).transpose()?;
    let lockstep = ClockView::open(&plan, place.clone())?;
    if plan.lock_memory {
        place.lock_memory()?;
    }
    serve(&plan, &lockstep, grants)
}

/// Runs the clock of `plan` until the run is over; notes its grants in `grants`.
pub(crate) fn serve(plan: &Plan, lockstep: &ClockView, grants: Option<GrantWriter>) -> Result<(), BusError> {
    let clock = Clock { plan, lockstep, grants: grants.map(RefCell::new) };
    for phase in [Phase::Connecting, Phase::Running] {
        clock.gather(phase)?;
    }
    let cpu_start_ns = lockstep.place().cpu_ns();
    lockstep.note_start();
    // By default the kernel may be 50 µs late to save power, a twentieth of a tick at 1 kHz.
    let _ = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
    let end = clock.run()?;
    clock.await_all(end)?;
    lockstep.note_end(lockstep.place().cpu_ns() - cpu_start_ns);
    Ok(())
}

/// The deadlines of a paced stretch of the run: from its start, or from the last hold or change of pace.
struct Deadlines {
    factor: f64,
    first_tick: u32,
    start_ns: u64,
    granted_late: bool,
}

impl Deadlines {
    fn new(first_tick: u32, factor: f64) -> Self {
        Self { factor, first_tick, start_ns: monotonic_ns(), granted_late: false }
    }

    /// Host time at which `tick` is due: computed from the tick, so that it does not drift.
    fn of(&self, tick: u32, tick_ns: u64) -> u64 {
        self.start_ns.saturating_add(deadline_ns(tick - self.first_tick, tick_ns, self.factor))
    }
}

struct Clock<'a> {
    plan: &'a Plan,
    lockstep: &'a ClockView,
    grants: Option<RefCell<GrantWriter>>,
}

impl Clock<'_> {
    /// Waits until every node is ready for `phase`, then starts it.
    fn gather(&self, phase: Phase) -> Result<(), BusError> {
        for node in 0..self.plan.nodes.len() {
            self.lockstep.wait_ready(node, phase).or_aborted()?;
        }
        self.lockstep.set_phase(phase);
        Ok(())
    }

    /// Grants ticks until the run ends; returns the end tick.
    fn run(&self) -> Result<u32, BusError> {
        let mut granted = self.plan.first_tick;
        let mut deadlines: Option<Deadlines> = None;
        loop {
            let end = self.end_after(granted);
            if granted >= end {
                return Ok(end);
            }
            if self.lockstep.boundary() <= granted {
                self.await_all(granted)?;
                self.lockstep.hold(granted, || self.is_stop_asked_for());
                deadlines = None;
                continue;
            }
            granted = match self.lockstep.pace() {
                Pace::Free => {
                    deadlines = None;
                    self.grant_window(granted, end)?
                }
                Pace::Factor(factor) => {
                    let kept = deadlines.take().filter(|kept| kept.factor == factor);
                    let deadlines = deadlines.insert(kept.unwrap_or_else(|| Deadlines::new(granted, factor)));
                    self.grant_at_deadline(granted, deadlines)?
                }
            };
        }
    }

    /// Grants as far as the window reaches beyond the slowest node; returns the ticks granted then.
    fn grant_window(&self, granted: u32, end: u32) -> Result<u32, BusError> {
        let window = self.plan.window_ticks.max(1);
        // Granting half a window at a time lets fast nodes go on while the slowest catches up.
        let stride = (window / 2).max(1);
        let limit = end.min(self.lockstep.boundary());
        let target = limit.min(self.slowest().saturating_add(window)).max(granted);
        self.grant(target, None);
        if target < limit {
            self.await_all((target + stride).saturating_sub(window))?;
        }
        Ok(target)
    }

    /// Grants tick `tick` at its deadline; returns the ticks granted then: `tick` itself if a stop came first.
    fn grant_at_deadline(&self, tick: u32, deadlines: &mut Deadlines) -> Result<u32, BusError> {
        let deadline_ns = deadlines.of(tick, self.plan.tick_ns);
        if !self.sleep_until(tick, deadline_ns, deadlines.factor) {
            return Ok(tick);
        }
        // A tick that was itself granted late says nothing about the nodes.
        if !deadlines.granted_late {
            self.note_late_nodes(tick);
        }
        self.await_all((tick + 1).saturating_sub(self.plan.window_ticks.max(1)))?;
        deadlines.granted_late = monotonic_ns() > deadlines.of(tick + 1, self.plan.tick_ns);
        if deadlines.granted_late {
            self.lockstep.count_missed_deadline(std::iter::empty());
        }
        self.grant(tick + 1, Some(deadline_ns));
        Ok(tick + 1)
    }

    /// The end tick, moved to `granted` if a stop was requested.
    fn end_after(&self, granted: u32) -> u32 {
        if self.is_stop_asked_for() && granted < self.lockstep.end_tick() {
            self.lockstep.set_end_tick(granted);
        }
        self.lockstep.end_tick()
    }

    /// Sleeps until `deadline_ns`; false if a stop, a hold or another pace was requested, which at a slow pace comes
    /// long before.
    fn sleep_until(&self, tick: u32, deadline_ns: u64, factor: f64) -> bool {
        loop {
            if self.is_stop_asked_for()
                || self.lockstep.boundary() <= tick
                || self.lockstep.pace() != Pace::Factor(factor)
            {
                return false;
            }
            let now_ns = monotonic_ns();
            if now_ns >= deadline_ns {
                return true;
            }
            sleep_to(deadline_ns.min(now_ns + NAP_NS_MAX));
        }
    }

    fn is_stop_asked_for(&self) -> bool {
        if self.lockstep.place().is_terminated() {
            self.lockstep.request_stop();
        }
        self.lockstep.is_stop_requested() || self.lockstep.is_aborted()
    }

    fn grant(&self, ticks: u32, deadline_ns: Option<u64>) {
        if let Some(grants) = &self.grants {
            grants.borrow_mut().grant(ticks, deadline_ns);
        }
        self.lockstep.grant(ticks);
    }

    fn slowest(&self) -> u32 {
        self.lockstep.computing().map(|slot| self.lockstep.done(slot)).min().unwrap_or(u32::MAX)
    }

    /// Waits until every process has completed `ticks` ticks.
    fn await_all(&self, ticks: u32) -> Result<(), BusError> {
        let lockstep = self.lockstep;
        while let Some(slot) = lockstep.computing().find(|&slot| lockstep.done(slot) < ticks) {
            // A process that died is replaced, or leaves: then it is another's turn to be waited for.
            let epoch = lockstep.epoch();
            let has_left = || lockstep.epoch() != epoch || lockstep.slot_state(slot) != SlotState::Taken;
            if lockstep.wait_done(slot, ticks, has_left) == Waited::Over && lockstep.is_aborted() {
                return Err(BusError::Aborted);
            }
        }
        Ok(())
    }

    fn note_late_nodes(&self, tick: u32) {
        let late = |&slot: &usize| self.lockstep.done(slot) < tick;
        if self.lockstep.computing().any(|slot| late(&slot)) {
            self.lockstep.count_missed_deadline(self.lockstep.computing().filter(late));
        }
    }
}

/// Host time that `ticks` ticks take at `factor` simulated seconds per second.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a run lasts less than 584 years")]
#[must_use]
pub fn deadline_ns(ticks: u32, tick_ns: u64, factor: f64) -> u64 {
    ((u64::from(ticks) * tick_ns) as f64 / factor) as u64
}

#[allow(clippy::cast_possible_wrap, reason = "monotonic time fits 63 bits")]
fn sleep_to(deadline_ns: u64) {
    let deadline = rustix::time::Timespec {
        tv_sec: (deadline_ns / 1_000_000_000) as i64,
        tv_nsec: (deadline_ns % 1_000_000_000) as i64,
    };
    // A signal may end it early; the caller looks at the clock again.
    let _ = clock_nanosleep_absolute(rustix::thread::ClockId::Monotonic, &deadline);
}

#[cfg(test)]
mod tests {
    use super::deadline_ns;

    #[test]
    fn deadlines_follow_the_pace() {
        assert_eq!(deadline_ns(1000, 1_000_000, 1.0), 1_000_000_000);
        assert_eq!(deadline_ns(1000, 1_000_000, 4.0), 250_000_000);
        assert_eq!(deadline_ns(1000, 1_000_000, 0.5), 2_000_000_000);
    }
}
