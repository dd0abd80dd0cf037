//! A run that stands still: because of whom, and what the others wait for.

use crate::processes::Processes;
use crate::replacement::Replacements;
use crate::role::Role;
use bus::lockstep::{Phase, SlotState, SupervisorView};
use bus::plan::{Pace, Plan};
use std::time::Duration;

/// A living process because of which the run stands still.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Straggler {
    /// The clock service.
    Clock,
    /// A node's index, and the generation of its process.
    Node(usize, u32),
}

impl Straggler {
    /// The role of the process.
    pub fn role(self) -> Role {
        match self {
            Self::Clock => Role::Clock,
            Self::Node(node, generation) => Role::Node { node, generation },
        }
    }
}

/// The living process that has all it needs and does not come on.
pub fn straggler(
    plan: &Plan,
    control: &SupervisorView,
    replacements: &Replacements<'_>,
    processes: &Processes,
) -> Option<Straggler> {
    match control.phase() {
        Phase::Announcing => Some(not_ready(plan, control, replacements, Phase::Connecting)),
        Phase::Connecting => Some(not_ready(plan, control, replacements, Phase::Running)),
        Phase::Running if control.awaits_clock() => Some(Straggler::Clock),
        Phase::Running if control.held_at().is_some() => None,
        Phase::Running if control.completed_ticks() >= control.end_tick() => not_left(processes),
        Phase::Running => not_computing(plan, control, replacements, processes),
    }
}

/// The first whose time is over of those that have not joined; the clock where all have.
fn not_ready(
    plan: &Plan,
    control: &SupervisorView,
    replacements: &Replacements<'_>,
    phase: Phase,
) -> Straggler {
    let late = (0..plan.nodes.len()).filter(|&node| !control.is_ready(node, phase));
    late.min_by_key(|&node| replacements.program_of(node, 0).watchdog)
        .map_or(Straggler::Clock, |node| Straggler::Node(node, 0))
}

/// The node that is furthest behind of those that have all they need.
fn not_computing(
    plan: &Plan,
    control: &SupervisorView,
    replacements: &Replacements<'_>,
    processes: &Processes,
) -> Option<Straggler> {
    let stuck = |&(node, generation): &(usize, u32)| {
        let member = plan.slot(node, generation);
        control.slot_state(member) == SlotState::Taken
            && processes.lives(node, generation)
            && control.can_compute(plan, member, replacements.inputs(node, generation))
    };
    let members = replacements.members().filter(stuck);
    let slowest = members.min_by_key(|&(node, generation)| control.done(plan.slot(node, generation)));
    slowest.map(|(node, generation)| Straggler::Node(node, generation))
}

/// A process that has completed the run and has not ended: a node, or else the clock.
fn not_left(processes: &Processes) -> Option<Straggler> {
    let left = processes.running.iter().filter(|process| process.end.is_none());
    let stragglers = left.filter_map(|process| match process.role {
        Role::Node { node, generation } => Some(Straggler::Node(node, generation)),
        Role::Clock => Some(Straggler::Clock),
        Role::Sidecar { .. } => None,
    });
    stragglers.max_by_key(|straggler| matches!(straggler, Straggler::Node(..)))
}

/// Host time in which a paced run must come forward: that of the slowest node's period.
pub fn deadline(plan: &Plan, control: &SupervisorView) -> Duration {
    let period_ticks = plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
    match control.pace() {
        Pace::Free => Duration::ZERO,
        Pace::Factor(factor) => {
            Duration::from_secs_f64((f64::from(period_ticks) * plan.tick_s() / factor).min(1e6))
        }
    }
}

/// Who has not come as far as the others, and what it waits for.
pub fn describe(
    control: &SupervisorView,
    plan: &Plan,
    replacements: &Replacements<'_>,
    straggler: Option<Straggler>,
    stood: Duration,
) -> String {
    let names = |phase| {
        let late = plan.nodes.iter().enumerate().filter(|(index, _)| !control.is_ready(*index, phase));
        late.map(|(_, node)| format!("`{}`", node.name)).collect::<Vec<_>>().join(", ")
    };
    let waiting = match (control.phase(), straggler) {
        (Phase::Announcing | Phase::Connecting, Some(Straggler::Clock)) => {
            "every node has joined, and `clock` does not let them begin".to_owned()
        }
        (Phase::Announcing, _) => format!("waiting for {} to join", names(Phase::Connecting)),
        (Phase::Connecting, _) => format!("waiting for {} to connect", names(Phase::Running)),
        (Phase::Running, _) if control.completed_ticks() >= control.end_tick() => {
            "every tick is completed, and it does not end".to_owned()
        }
        (Phase::Running, Some(Straggler::Clock)) => {
            format!("tick {} is not granted by `clock`", control.granted_ticks())
        }
        (Phase::Running, _) => describe_stuck(control, plan, replacements),
    };
    format!("the run stood still for {:.1} s: {waiting}", stood.as_secs_f64())
}

/// Who is awake and does not come on, and which topics the others sleep for.
fn describe_stuck(control: &SupervisorView, plan: &Plan, replacements: &Replacements<'_>) -> String {
    let members: Vec<(usize, u32, usize)> = replacements
        .members()
        .map(|(node, generation)| (node, generation, plan.slot(node, generation)))
        .filter(|&(.., member)| {
            control.slot_state(member) == SlotState::Taken && !control.has_completed(member)
        })
        .collect();
    let name = |node: usize, generation: u32| match generation {
        0 => format!("`{}`", plan.nodes[node].name),
        _ => format!("`{}.{generation}`", plan.nodes[node].name),
    };
    let can_compute = |&&(node, generation, member): &&(usize, u32, usize)| {
        control.can_compute(plan, member, replacements.inputs(node, generation))
    };
    let mut stuck: Vec<&(usize, u32, usize)> = members.iter().filter(can_compute).collect();
    if stuck.is_empty() {
        let fewest = members.iter().map(|&(.., member)| control.done(member)).min();
        stuck = members.iter().filter(|&&(.., member)| Some(control.done(member)) == fewest).collect();
    }
    let tick = stuck.iter().map(|&&(.., member)| control.completed_by(member)).min().unwrap_or(0);
    let waiting = members.iter().filter_map(|&(node, generation, member)| {
        let topic = control.awaited_topic(plan, member, replacements.inputs(node, generation))?;
        Some(format!("; {} waits for {}", name(node, generation), plan.topics[topic].name))
    });
    let stuck: Vec<String> = stuck.iter().map(|&&(node, generation, _)| name(node, generation)).collect();
    format!("tick {tick} is not completed by {}{}", stuck.join(", "), waiting.collect::<String>())
}
