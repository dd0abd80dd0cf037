//! Events from outside a simulated run: faults, and requests of its users.

use super::fault::Fault::{self, Death, Hang, Interrupt, Leap, NeverReady, Pause, Steer, Stop, Swap};
use super::fault::HARMFUL;
use super::sim::{Doing, FOR_EVER, NEVER, Need, Sim};
use crate::ctl::protocol::Request;
use crate::host::End;
use crate::role::Role;
use std::collections::BTreeSet;
use std::time::Duration;

impl Sim {
    /// True if `fault` is struck now: it is drawn once in `one_in` times.
    pub(super) fn strikes(&mut self, fault: Fault, one_in: u64) -> bool {
        let strikes = self.is_drawn(fault, one_in);
        if strikes && HARMFUL.contains(&fault) {
            self.excuse(fault);
        }
        strikes
    }

    fn is_drawn(&mut self, fault: Fault, one_in: u64) -> bool {
        self.faults.contains(&fault) && self.draw.one_in(one_in)
    }

    fn excuse(&mut self, fault: Fault) {
        self.note(|_| format!("{fault:?}"));
        self.excuses.push(format!("{fault:?}"));
    }

    /// Strikes the faults that are drawn for this step.
    pub(super) fn strike(&mut self) {
        if self.faults.is_empty() || self.instances.is_empty() {
            return;
        }
        let victim = self.draw.below(self.instances.len() as u64) as usize;
        if self.instances[victim].end.is_none() {
            self.strike_at(victim);
        }
        if self.strikes(Leap, 500) {
            let jumps = [Duration::from_millis(40), Duration::from_secs(3600)];
            self.now += jumps[self.draw.below(2) as usize];
        }
        if self.strikes(Swap, 300) {
            self.ask_for_swap();
        }
        if self.strikes(Steer, 300) {
            let ticks = self.draw.below(9) as u32;
            let choice = self.draw.below(3) as usize;
            self.steer([0, self.segment.granted + ticks, NEVER][choice]);
        }
        if (self.stop.count() == 0 && self.strikes(Stop, 1000))
            || (self.stop.count() == 1 && self.strikes(Interrupt, 1000))
        {
            self.note(|_| "somebody asks for a stop".to_owned());
            self.stop.stop();
            self.stop_look.get_or_insert(self.looks);
        }
    }

    fn strike_at(&mut self, victim: usize) {
        if self.strikes(Death, 600) {
            self.note(|sim| format!("{:?} dies", sim.instances[victim]));
            self.instances[victim].end = Some(End::Signalled(9));
            self.notify();
        } else if self.is_drawn(Hang, 2000) {
            self.note(|sim| format!("{:?} hangs", sim.instances[victim]));
            // No process waits for a sidecar that is ready: its hang may not end the run.
            if self.instances[victim].doing != Doing::Idle {
                self.excuse(Hang);
            }
            self.instances[victim].frozen_until = FOR_EVER;
        } else if self.strikes(Pause, 60) && self.instances[victim].frozen_until <= self.now {
            self.instances[victim].frozen_until = self.now + self.draw.micros(10_000);
        }
    }

    fn ask_for_swap(&mut self) {
        let names = ["a", "b", "c", "nobody"];
        let process = names[self.draw.below(names.len() as u64) as usize].to_owned();
        let shadow_ticks = Some(self.draw.below(5) as u32);
        let ahead = 2 * self.draw.below(8) as u32;
        let at_tick = self.draw.one_in(2).then(|| self.segment.granted.next_multiple_of(2) + ahead);
        self.note(|_| format!("somebody asks for a swap of {process} at {at_tick:?}"));
        self.requests.push_back(Request::Swap { process, with: String::new(), shadow_ticks, at_tick });
    }

    pub(super) fn steer(&mut self, hold_tick: u32) {
        self.segment.hold_tick = hold_tick;
        self.wake(Need::Steering);
    }

    /// No more faults are struck, and a paused run is let go: from now on, the run must come to its end.
    pub(super) fn calm(&mut self) {
        self.note(|_| "the storm is over".to_owned());
        self.faults = BTreeSet::new();
        self.steer(NEVER);
        self.quiet_since = Some(self.now);
    }

    /// A watchdog expires only where something hangs: a death is answered before.
    pub(super) fn check_watchdogs(&self, text: &str) {
        let expires = ["killed by the watchdog", "stood still"].iter().any(|message| text.contains(message));
        let hangs = [Hang, NeverReady].map(|fault| format!("{fault:?}"));
        assert!(
            !expires || self.excuses.iter().any(|excuse| hangs.contains(excuse)),
            "a watchdog expired though nothing hangs: {text}"
        );
    }

    /// Checks the rules for the end of a run, after its supervisor has ended.
    pub(super) fn check_end(&self, aborted: Option<&anyhow::Error>) {
        let left = self.living().map(|instance| (instance.role, instance.doing));
        let left: Vec<(Role, Doing)> = left.collect();
        assert!(left.is_empty(), "they outlive the supervisor: {left:?}");
        if let Some(error) = aborted {
            assert!(
                !self.excuses.is_empty(),
                "it was aborted though nothing happened that may end it: {error}"
            );
            self.check_watchdogs(&error.to_string());
            return;
        }
        let end = self.segment.end_tick;
        for (topic, plan) in self.plan.topics.iter().enumerate() {
            for tick in (0..end).filter(|tick| plan.ticks.is_due(*tick)) {
                assert!(self.writers.contains_key(&(topic, tick)), "nobody wrote tick {tick} of {topic}");
            }
        }
    }

    /// Checks that a swap that was reported to take over at `tick` did so. A predecessor that died there may have
    /// sent the sample of that tick before.
    pub(super) fn check_swap(&self, node: usize, tick: u32) {
        for output in &self.plan.nodes[node].outputs {
            let ticks = self.plan.topics[output.topic].ticks;
            let generation = |tick: u32| self.writers.get(&(output.topic, tick)).copied();
            let before = tick.checked_sub(1).and_then(|before| generation(ticks.newest(before)));
            let after = [tick, ticks.next(tick + 1)].map(generation);
            let is_followed = after.iter().any(|&after| after.is_none() || after > before);
            assert!(is_followed, "{before:?} is followed by {after:?} at tick {tick}");
        }
    }
}
