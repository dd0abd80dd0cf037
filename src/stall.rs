//! A run that stands still: because of whom, and what the others wait for.

use crate::processes::Processes;
use crate::succession::Successions;
use bus::control::{Control, Phase, Seat};
use bus::plan::{Pace, Plan};
use std::time::Duration;

/// The living process that has all it needs for its next tick and does not come on: node and generation.
pub fn culprit(
    plan: &Plan,
    control: &Control,
    successions: &Successions<'_>,
    processes: &Processes,
) -> Option<(usize, u32)> {
    if control.phase() != Phase::Running || control.held_at().is_some() {
        return None;
    }
    let stuck = |&(node, generation): &(usize, u32)| {
        let member = plan.member(node, generation);
        control.seat(member) == Seat::Taken
            && processes.lives(node, generation)
            && control.can_compute(plan, member, successions.inputs(node, generation))
    };
    let members = successions.members().filter(stuck);
    members.min_by_key(|&(node, generation)| control.done(plan.member(node, generation)))
}

/// Host time in which a paced run must come forward: that of the slowest node's period.
pub fn deadline(plan: &Plan, control: &Control) -> Duration {
    let period_ticks = plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
    match control.pace() {
        Pace::Free => Duration::ZERO,
        Pace::Factor(factor) => {
            Duration::from_secs_f64((f64::from(period_ticks) * plan.tick_s() / factor).min(1e6))
        }
    }
}

/// Who has not come as far as the others, and what it waits for.
pub fn describe(control: &Control, plan: &Plan, successions: &Successions<'_>, stood: Duration) -> String {
    let names = |phase| {
        let late = plan.nodes.iter().enumerate().filter(|(index, _)| !control.is_ready(*index, phase));
        late.map(|(_, node)| format!("`{}`", node.name)).collect::<Vec<_>>().join(", ")
    };
    let waiting = match control.phase() {
        Phase::Announcing => format!("waiting for {} to join", names(Phase::Connecting)),
        Phase::Connecting => format!("waiting for {} to connect", names(Phase::Running)),
        Phase::Running => describe_stuck(control, plan, successions),
    };
    format!("the run stood still for {:.1} s: {waiting}", stood.as_secs_f64())
}

/// Who is awake and does not come on, and which topics the others sleep for.
fn describe_stuck(control: &Control, plan: &Plan, successions: &Successions<'_>) -> String {
    let members: Vec<(usize, u32, usize)> = successions
        .members()
        .map(|(node, generation)| (node, generation, plan.member(node, generation)))
        .filter(|&(.., member)| control.seat(member) == Seat::Taken && !control.has_completed(member))
        .collect();
    let name = |node: usize, generation: u32| match generation {
        0 => format!("`{}`", plan.nodes[node].name),
        _ => format!("`{}.{generation}`", plan.nodes[node].name),
    };
    let can_compute = |&&(node, generation, member): &&(usize, u32, usize)| {
        control.can_compute(plan, member, successions.inputs(node, generation))
    };
    let mut stuck: Vec<&(usize, u32, usize)> = members.iter().filter(can_compute).collect();
    if stuck.is_empty() {
        let fewest = members.iter().map(|&(.., member)| control.done(member)).min();
        stuck = members.iter().filter(|&&(.., member)| Some(control.done(member)) == fewest).collect();
    }
    let tick = stuck.iter().map(|&&(.., member)| control.completed_by(member)).min().unwrap_or(0);
    let waiting = members.iter().filter_map(|&(node, generation, member)| {
        let topic = control.awaited_topic(plan, member, successions.inputs(node, generation))?;
        Some(format!("; {} waits for {}", name(node, generation), plan.topics[topic].name))
    });
    let stuck: Vec<String> = stuck.iter().map(|&&(node, generation, _)| name(node, generation)).collect();
    format!("tick {tick} is not completed by {}{}", stuck.join(", "), waiting.collect::<String>())
}
