//! The clock service in a simulated run.

use super::sim::{Doing, FOR_EVER, NODES, Need, Sim, WINDOW};
use crate::host::End;
use bus::lockstep::Phase;
use std::time::Duration;

/// Longest sleep while it waits for a state, and in a hold.
const STATE_NAP: Duration = Duration::from_millis(50);
const HOLD_NAP: Duration = Duration::from_millis(100);

impl Sim {
    pub(super) fn step_clock(&mut self, index: usize) {
        match self.instances[index].doing {
            Doing::Gathering(phase) => {
                if !self.segment.slots[..NODES].iter().all(|slot| slot.ready >= phase) {
                    return self.sleep(index, Need::State, STATE_NAP);
                }
                self.segment.phase = phase;
                self.wake(Need::State);
                self.notify();
                self.instances[index].doing = match phase {
                    Phase::Connecting => Doing::Gathering(Phase::Running),
                    _ => Doing::Awaiting(0),
                };
            }
            Doing::Awaiting(ticks) if self.slowest() < ticks => self.sleep(index, Need::Done, FOR_EVER),
            Doing::Holding => self.hold(index),
            _ => self.grant(index),
        }
    }

    fn boundary(&self) -> u32 {
        self.join_tick.min(self.segment.hold_tick)
    }

    pub(super) fn awaits_clock(&self) -> bool {
        match self.segment.held_at {
            Some(tick) => self.boundary() > tick,
            None => self.segment.granted < self.segment.end_tick && self.slowest() >= self.segment.granted,
        }
    }

    fn hold(&mut self, index: usize) {
        let granted = self.segment.granted;
        if self.segment.held_at.is_none() {
            self.segment.held_at = Some(granted);
            self.notify();
        } else if self.boundary() > granted || self.segment.is_stop_requested {
            self.segment.held_at = None;
            self.instances[index].doing = Doing::Awaiting(0);
        } else {
            self.sleep(index, Need::Steering, HOLD_NAP);
        }
    }

    fn grant(&mut self, index: usize) {
        let granted = self.segment.granted;
        if self.segment.is_stop_requested && granted < self.segment.end_tick {
            self.segment.end_tick = granted;
            self.wake_all();
        }
        let end = self.segment.end_tick;
        if granted >= end {
            if self.slowest() >= end {
                self.instances[index].end = Some(End::Exited(0));
                return;
            }
            self.instances[index].doing = Doing::Awaiting(end);
        } else if self.boundary() <= granted {
            self.instances[index].doing =
                if self.slowest() >= granted { Doing::Holding } else { Doing::Awaiting(granted) };
        } else {
            let limit = end.min(self.boundary());
            let target = limit.min(self.slowest().saturating_add(WINDOW)).max(granted);
            self.check_stop();
            self.segment.granted = target;
            if self.segment.first_grant.is_zero() {
                self.segment.first_grant = self.now;
            }
            self.wake(Need::Grant);
            let room = (target + WINDOW / 2).saturating_sub(WINDOW);
            self.instances[index].doing = Doing::Awaiting(if target < limit { room } else { 0 });
        }
    }

    /// A requested stop comes to the clock within a few looks of the supervisor.
    fn check_stop(&self) {
        let is_due = self.stop_look.is_some_and(|look| self.looks > look + 3);
        assert!(!is_due, "ticks are granted long after a stop was asked for");
    }

    pub(super) fn sleep(&mut self, index: usize, need: Need, nap: Duration) {
        self.instances[index].sleep = Some((need, self.now.saturating_add(nap)));
    }
}
