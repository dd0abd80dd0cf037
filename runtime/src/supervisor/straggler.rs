//! The cause of a standstill: the straggler, and the conditions that the others wait for.

use super::Supervisor;
use crate::role::Role;
use crate::world::World;
use bus::lockstep::{Phase, SlotState};
use bus::plan::Pace;
use std::time::Duration;

impl<W: World> Supervisor<'_, W> {
    /// The living process that has all it needs and does not come on.
    pub(super) fn straggler(&self) -> Option<Role> {
        let view = &self.decisions.replacements.view;
        match view.phase {
            Phase::Announcing => Some(self.not_ready(Phase::Connecting)),
            Phase::Connecting => Some(self.not_ready(Phase::Running)),
            Phase::Running if view.awaits_clock => Some(Role::Clock),
            Phase::Running if view.held_at.is_some() => None,
            Phase::Running if view.completed_ticks() >= view.end_tick => self.not_left(),
            Phase::Running => self.not_computing(),
        }
    }

    /// The first whose time is over of those that have not joined; the clock where all have.
    fn not_ready(&self, phase: Phase) -> Role {
        let view = &self.decisions.replacements.view;
        let late = (0..self.plan.nodes.len()).filter(|&node| !view.is_ready(node, phase));
        late.min_by_key(|&node| self.decisions.replacements.program_of(node, 0).watchdog)
            .map_or(Role::Clock, |node| Role::Node { node, generation: 0 })
    }

    /// The node that is furthest behind of those that have all they need.
    fn not_computing(&self) -> Option<Role> {
        let view = &self.decisions.replacements.view;
        let stuck = |&(node, generation): &(usize, u32)| {
            let slot = self.plan.slot(node, generation);
            view.slots[slot].state == SlotState::Taken
                && view.lives(node, generation)
                && self.can_compute(node, generation)
        };
        let instances = self.decisions.replacements.instances().filter(stuck);
        let slowest =
            instances.min_by_key(|&(node, generation)| view.slots[self.plan.slot(node, generation)].done);
        slowest.map(|(node, generation)| Role::Node { node, generation })
    }

    /// True if an instance has everything that its next tick needs: if it does not advance then, it is at fault
    /// itself. An instance that sleeps does not count: its sample has not been sent, or it would have been woken. A
    /// recorder sleeps until samples have gathered that the tick alone does not need.
    fn can_compute(&self, node: usize, generation: u32) -> bool {
        let slot = self.plan.slot(node, generation);
        let (view, inputs) =
            (&self.decisions.replacements.view, self.decisions.replacements.inputs(node, generation));
        view.has_needs(slot, inputs) && self.is_awake(node, generation)
    }

    /// True if an instance sleeps neither for a sample nor for the other instance of its node; of a group, none does that
    /// shares its process.
    fn is_awake(&self, node: usize, generation: u32) -> bool {
        let sleeps = |node: usize| {
            let slot = self.plan.slot(node, generation);
            let inputs = self.decisions.replacements.inputs(node, generation);
            self.world.awaited_topic(slot, inputs).is_some()
                || self.decisions.replacements.view.slots[slot].awaits_other
        };
        let lives = |node: usize| self.decisions.replacements.view.lives(node, generation);
        match self.plan.group_of(node).filter(|_| generation == 0) {
            Some(group) => !group.members.iter().any(|member| lives(member.node) && sleeps(member.node)),
            None => !sleeps(node),
        }
    }

    /// A process that has completed the run and has not ended: a node, or else the clock.
    fn not_left(&self) -> Option<Role> {
        let is_awaited = |role: Role| !matches!(role, Role::Sidecar { .. });
        let left =
            self.processes.running.iter().filter(|process| process.end.is_none() && is_awaited(process.role));
        left.map(|process| process.role).max_by_key(|role| matches!(role, Role::Node { .. }))
    }

    /// Host time in which a paced run must come forward: that of the slowest node's period.
    pub(super) fn deadline(&self) -> Duration {
        let period_ticks = self.plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
        match self.decisions.replacements.view.pace {
            Pace::Free => Duration::ZERO,
            Pace::Factor(factor) => {
                Duration::from_secs_f64((f64::from(period_ticks) * self.plan.tick_s() / factor).min(1e6))
            }
        }
    }

    /// Message: the processes that are behind the others, and the conditions that they wait for.
    pub(super) fn describe_standstill(&self, straggler: Option<Role>, stood: Duration) -> String {
        let view = &self.decisions.replacements.view;
        let names = |phase| {
            let late = self.plan.nodes.iter().enumerate().filter(|(index, _)| !view.is_ready(*index, phase));
            late.map(|(_, node)| format!("`{}`", node.name)).collect::<Vec<_>>().join(", ")
        };
        let waiting = match (view.phase, straggler) {
            (Phase::Announcing | Phase::Connecting, Some(Role::Clock)) => {
                "every node has joined, and `clock` does not let them begin".to_owned()
            }
            (Phase::Announcing, _) => format!("waiting for {} to join", names(Phase::Connecting)),
            (Phase::Connecting, _) => format!("waiting for {} to connect", names(Phase::Running)),
            (Phase::Running, _) if view.completed_ticks() >= view.end_tick => {
                "every tick is completed, and it does not end".to_owned()
            }
            (Phase::Running, Some(Role::Clock)) => {
                format!("tick {} is not granted by `clock`", view.granted)
            }
            (Phase::Running, _) => self.describe_stuck(),
        };
        format!("the run stood still for {:.1} s: {waiting}", stood.as_secs_f64())
    }

    /// Message: the instances that are awake and do not advance, and the topics that the others sleep for.
    fn describe_stuck(&self) -> String {
        let (plan, view) = (self.plan, &self.decisions.replacements.view);
        let slot = |&(node, generation): &(usize, u32)| plan.slot(node, generation);
        let done = |instance: &(usize, u32)| view.slots[slot(instance)].done;
        let computes = |instance: &(usize, u32)| {
            view.slots[slot(instance)].state == SlotState::Taken && !view.has_completed(slot(instance))
        };
        let instances: Vec<(usize, u32)> = self.decisions.replacements.instances().filter(computes).collect();
        let name = |&(node, generation): &(usize, u32)| {
            format!("`{}`", bus::names::process_name(&plan.nodes[node].name, generation))
        };
        let can_compute = |&&(node, generation): &&(usize, u32)| self.can_compute(node, generation);
        let mut stuck: Vec<&(usize, u32)> = instances.iter().filter(can_compute).collect();
        if stuck.is_empty() {
            let fewest = instances.iter().map(done).min();
            stuck = instances.iter().filter(|instance| Some(done(instance)) == fewest).collect();
        }
        let tick = stuck.iter().map(|instance| view.completed_by(slot(instance))).min().unwrap_or(0);
        let waiting = instances.iter().filter_map(|instance| {
            let inputs = self.decisions.replacements.inputs(instance.0, instance.1);
            let topic = self.world.awaited_topic(slot(instance), inputs)?;
            Some(format!("; {} waits for {}", name(instance), plan.topics[topic].name))
        });
        let stuck: Vec<String> = stuck.into_iter().map(name).collect();
        format!("tick {tick} is not completed by {}{}", stuck.join(", "), waiting.collect::<String>())
    }
}
