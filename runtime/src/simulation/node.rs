//! An instance of a node in a simulated run: it follows the protocol of `bus`, a store or a wake-up a step, and may die
//! between any two.

use super::fault::Fault;
use super::sim::{Bug, Doing, FOR_EVER, NEVER, NODES, Need, SLOW_START, Sim};
use crate::host::End;
use crate::role::Role;
use bus::lockstep::{Phase, SlotState, TransferOutcome};
use std::time::Duration;

const STATE_NAP: Duration = Duration::from_millis(50);
const RETIREMENT_NAP: Duration = Duration::from_millis(1);

impl Sim {
    pub(super) fn step_node(&mut self, index: usize) {
        let role = self.instances[index].role;
        let (is_first, slot) = (role.generation() == 0, self.slot(role));
        let (phase, state) = (self.segment.phase, self.segment.slots[slot].state);
        match self.instances[index].doing {
            Doing::Starting if is_first || phase >= Phase::Connecting => {
                self.get_ready(slot, Phase::Connecting);
                self.instances[index].doing = Doing::Prepared;
            }
            Doing::Prepared if is_first && phase >= Phase::Connecting => self.connect(index, 0),
            Doing::Prepared if !is_first && state != SlotState::Empty => {
                if !self.is_slow_to_join(index) {
                    self.connect(index, self.segment.epoch + 1);
                }
            }
            Doing::Connected if is_first && phase == Phase::Running => {
                self.instances[index].doing = Doing::Waiting;
            }
            Doing::Connected if !is_first && state == SlotState::Taken => {
                self.check_publishers(index);
                self.instances[index].doing = Doing::Waiting;
            }
            Doing::Waiting => self.await_tick(index),
            Doing::Sending { output, is_stored } => self.send(index, output, is_stored),
            Doing::Leaving { .. } if self.instances[index].epoch != self.segment.epoch => {
                self.turn(index, slot)
            }
            Doing::Leaving { taken } => {
                if self.slowest() >= taken.min(self.segment.end_tick) {
                    self.segment.slots[slot].acknowledged = NEVER;
                    self.notify();
                    self.instances[index].doing = Doing::Left;
                    let rest = self.draw.micros(20_000);
                    self.sleep(index, Need::Nothing, rest);
                } else {
                    self.sleep(index, Need::Nothing, RETIREMENT_NAP);
                }
            }
            Doing::Left => self.instances[index].end = Some(End::Exited(0)),
            _ => self.sleep(index, Need::State, STATE_NAP),
        }
    }

    /// Lets a backup stand still once, while the others wait for it to join.
    fn is_slow_to_join(&mut self, index: usize) -> bool {
        let instance = &mut self.instances[index];
        if !self.faults.contains(&Fault::SlowBackup) || std::mem::replace(&mut instance.was_slow, true) {
            return false;
        }
        instance.frozen_until = instance.frozen_until.max(self.now + SLOW_START);
        true
    }

    fn stop_clock_for_a_while(&mut self) {
        let clocks = self.instances.iter_mut().filter(|instance| instance.role == Role::Clock);
        clocks.for_each(|clock| clock.frozen_until = clock.frozen_until.max(self.now + SLOW_START));
    }

    fn get_ready(&mut self, slot: usize, phase: Phase) {
        self.segment.slots[slot].ready = phase;
        let all_joined = self.segment.slots[..NODES].iter().all(|slot| slot.ready >= phase);
        let is_slow_start = self.faults.contains(&Fault::SlowStart) && self.segment.phase < phase;
        let is_slow_backup = self.faults.contains(&Fault::SlowBackup) && slot >= NODES;
        if (all_joined && is_slow_start) || (is_slow_backup && phase == Phase::Running) {
            self.stop_clock_for_a_while();
        }
        self.wake(Need::State);
        self.notify();
    }

    fn connect(&mut self, index: usize, epoch: u32) {
        let role = self.instances[index].role;
        let Role::Node { node, generation } = role else { return };
        let Some(membership) = self.stored.get(&epoch) else {
            // The membership by which it was to join has been taken back: it ends with an error.
            self.instances[index].end = Some(End::Exited(1));
            return;
        };
        let instances = &membership.nodes[node];
        let instance = std::iter::once(&instances.primary).chain(&instances.backup);
        let instance = instance.into_iter().find(|instance| instance.generation == generation);
        let instance = instance.expect("the membership by which a process joins names it");
        self.instances[index].tick = instance.join_tick;
        self.follow(index, epoch);
        let (slot, tick) = (self.slot(role), self.instances[index].tick);
        self.segment.slots[slot].acknowledged = epoch;
        if generation == 0 {
            self.published[slot] = tick + 1;
        } else {
            self.segment.slots[slot].transfer = TransferOutcome::State;
        }
        self.get_ready(slot, Phase::Running);
        self.instances[index].doing = Doing::Connected;
    }

    /// A publisher of an instance that joins must have connected to it: else its first samples are lost.
    fn check_publishers(&self, index: usize) {
        let (role, epoch) = (self.instances[index].role, self.instances[index].epoch);
        let publishers = self.inputs(role).iter().map(|input| self.plan.publisher(input.topic));
        let publishers: Vec<usize> = publishers.collect();
        for other in self.living() {
            let is_publisher = matches!(other.role, Role::Node { node, .. } if publishers.contains(&node));
            let follows = other.epoch >= epoch
                || matches!(other.doing, Doing::Starting | Doing::Prepared | Doing::Left);
            assert!(!is_publisher || follows, "{:?} joins unknown to {:?}", role, other.role);
        }
    }

    /// Makes the connections agree with the membership of `epoch`.
    fn follow(&mut self, index: usize, epoch: u32) {
        self.instances[index].epoch = epoch;
        if self.bug == Some(Bug::AcknowledgesUnread) && self.segment.phase == Phase::Running {
            return;
        }
        let Some(membership) = self.stored.get(&epoch).cloned() else {
            panic!("nobody has written the membership of epoch {epoch}")
        };
        let Role::Node { node, generation } = self.instances[index].role else { return };
        let publisher = |topic: usize| &membership.nodes[self.plan.publisher(topic)];
        let shadows_until = self.inputs(self.instances[index].role).iter().map(|input| {
            let nodes = publisher(input.topic);
            let outputs = nodes.primary.plan.outputs.iter().zip(&nodes.take_over_ticks);
            let take_over = outputs.into_iter().find(|(output, _)| output.topic == input.topic);
            let shadows = nodes.backup.as_ref().is_some_and(|backup| backup.shadows);
            take_over.filter(|_| shadows).map_or(0, |(_, &tick)| tick)
        });
        let reads_shadows = self.plan.nodes[node].outputs.is_empty();
        let shadows_until = shadows_until.map(|until| if reads_shadows { until } else { 0 }).collect();
        let instances = &membership.nodes[node];
        let instance = &mut self.instances[index];
        instance.shadows_until = shadows_until;
        let backup = instances.backup.as_ref();
        if let Some(backup) = backup.filter(|backup| backup.generation == generation) {
            instance.take_over_tick = instances.take_over_tick;
            instance.retirement_tick = NEVER;
            instance.counts_from.clone_from(&instances.take_over_ticks);
            let sends_from = |&counts: &u32| if backup.shadows { 0 } else { counts };
            instance.sends_from = instances.take_over_ticks.iter().map(sends_from).collect();
            self.promote(index);
        } else if instances.primary.generation == generation {
            instance.retirement_tick = backup.map_or(NEVER, |_| instances.take_over_tick);
        }
    }

    /// Has the samples that were sent as a shadow's count from the take-over on.
    fn promote(&mut self, index: usize) {
        let instance = &self.instances[index];
        let (Role::Node { node, generation }, tick) = (instance.role, instance.tick) else { return };
        for (output, counts_from) in instance.counts_from.clone().into_iter().enumerate() {
            let topic = self.plan.nodes[node].outputs[output].topic;
            let ticks = self.plan.topics[topic].ticks;
            let next_due = ticks.next(tick);
            if next_due > counts_from && self.segment.sent[topic] < next_due {
                let first = self.segment.sent[topic];
                let due = (first..next_due).filter(|due| ticks.is_due(*due));
                due.for_each(|due| self.store(topic, due, generation));
                self.wake(Need::Samples(topic));
            }
        }
    }

    /// Stores the sample of `tick` that counts.
    fn store(&mut self, topic: usize, tick: u32, generation: u32) {
        let sent = self.segment.sent[topic];
        assert_eq!(
            sent, tick,
            "instance {generation} writes tick {tick} of topic {topic} when {sent} is due"
        );
        let other = self.writers.insert((topic, tick), generation);
        assert_eq!(other, None, "two write tick {tick} of topic {topic}");
        self.segment.sent[topic] = self.plan.topics[topic].ticks.next(tick + 1);
    }

    fn await_tick(&mut self, index: usize) {
        let (role, epoch) = (self.instances[index].role, self.segment.epoch);
        let (slot, tick) = (self.slot(role), self.instances[index].tick);
        let is_shadow = role.generation() > 0 && tick <= self.instances[index].take_over_tick;
        if self.instances[index].epoch != epoch {
            self.turn(index, slot);
        } else if self.segment.end_tick <= tick
            && is_shadow
            && self.segment.slots[self.other(slot)].done < tick
        {
            self.sleep(index, Need::Other(slot), FOR_EVER);
        } else if self.segment.end_tick <= tick {
            self.leave(index, slot);
        } else if tick >= self.instances[index].retirement_tick {
            if self.segment.slots[self.other(slot)].done > tick {
                self.leave(index, slot);
            } else {
                self.sleep(index, Need::Other(slot), FOR_EVER);
            }
        } else if let Some(need) = self.missing(index, slot, tick) {
            self.sleep(index, need, FOR_EVER);
        } else {
            let Role::Node { node, .. } = role else { return };
            self.published[slot] = tick + self.plan.nodes[node].period_ticks + 1;
            self.wake(Need::Other(self.other(slot)));
            self.instances[index].doing = Doing::Sending { output: 0, is_stored: false };
        }
    }

    /// Turns to the newest membership.
    fn turn(&mut self, index: usize, slot: usize) {
        let epoch = self.segment.epoch;
        self.follow(index, epoch);
        self.segment.slots[slot].acknowledged = epoch;
        self.notify();
    }

    fn other(&self, slot: usize) -> usize {
        let nodes = self.plan.nodes.len();
        (slot + nodes) % (2 * nodes)
    }

    /// Condition that an instance must wait for before it computes `tick`.
    fn missing(&self, index: usize, slot: usize, tick: u32) -> Option<Need> {
        let (instance, other) = (&self.instances[index], self.other(slot));
        if instance.role.generation() > 0 && tick <= instance.take_over_tick {
            let is_taking_over =
                tick == instance.take_over_tick && self.segment.slots[other].state == SlotState::Taken;
            if self.published[other] <= tick || (is_taking_over && self.segment.slots[other].done < tick) {
                return Some(Need::Other(slot));
            }
        }
        for (input, &until) in self.inputs(instance.role).iter().zip(&instance.shadows_until) {
            if self.segment.sent[input.topic] < (tick + 1).saturating_sub(input.delay_ticks) {
                return Some(Need::Samples(input.topic));
            }
            if tick < until && self.shadow[input.topic] <= tick {
                return Some(Need::Shadow(input.topic));
            }
        }
        (self.segment.granted <= tick).then_some(Need::Grant)
    }

    fn leave(&mut self, index: usize, slot: usize) {
        let longest = self.plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
        let taken = self.instances[index].tick + longest + 1;
        self.instances[index].doing = Doing::Leaving { taken };
        self.complete(slot, NEVER - 1);
    }

    fn complete(&mut self, slot: usize, done: u32) {
        self.segment.slots[slot].done = done;
        self.wake(Need::Done);
        self.wake(Need::Other(self.other(slot)));
        self.notify();
    }

    fn send(&mut self, index: usize, output: usize, is_stored: bool) {
        let instance = &self.instances[index];
        let (Role::Node { node, generation }, tick) = (instance.role, instance.tick) else { return };
        let Some(topic) = self.plan.nodes[node].outputs.get(output).map(|output| output.topic) else {
            let tick = tick + self.plan.nodes[node].period_ticks;
            self.instances[index].tick = tick;
            self.instances[index].doing = Doing::Waiting;
            return self.complete(self.plan.slot(node, generation), tick);
        };
        let ticks = self.plan.topics[topic].ticks;
        let is_sent = tick >= instance.sends_from[output] && ticks.is_due(tick);
        let counts = tick >= instance.counts_from[output];
        if is_sent && is_stored {
            self.wake(if counts { Need::Samples(topic) } else { Need::Shadow(topic) });
        } else if is_sent && counts {
            self.store(topic, tick, generation);
        } else if is_sent {
            let due = self.shadow[topic];
            assert_eq!(due, tick, "a shadow writes tick {tick} of topic {topic} when {due} is due");
            self.shadow[topic] = ticks.next(tick + 1);
        }
        self.instances[index].doing = if is_sent && !is_stored {
            Doing::Sending { output, is_stored: true }
        } else {
            Doing::Sending { output: output + 1, is_stored: false }
        };
    }
}
