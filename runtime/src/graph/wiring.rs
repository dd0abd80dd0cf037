//! All nodes of a run, wired to each other.

use super::processes::{self, Member};
use super::{inputs, outputs};
use crate::manifest::Manifest;
use crate::problem::Problem;
use crate::program::OnExit;
use bus::plan::{NodePlan, TopicPlan};

/// Topics and nodes, wired to each other.
pub struct Wiring {
    /// In the order of their publishers.
    pub topics: Vec<TopicPlan>,
    /// In the order of the members.
    pub nodes: Vec<NodePlan>,
}

/// Wires `members`; their nodes have no parameters and no place yet. `changed` is the one that is to blame
/// for a cycle it is in.
///
/// # Errors
/// What is wrong with a port, and a cycle without a delay.
pub fn wire(manifest: &Manifest, members: &[Member<'_>], changed: Option<usize>) -> Result<Wiring, Problem> {
    let published = outputs::publish_all(manifest, members)?;
    let topics: Vec<TopicPlan> = published.iter().map(|output| output.topic.clone()).collect();
    let mut nodes = Problem::gather(members.iter().enumerate().map(|(index, member)| {
        let process = member.process;
        Ok(NodePlan {
            name: member.name.get_ref().clone(),
            period_ticks: processes::period_ticks(manifest, process)?,
            wait: process.wait.unwrap_or_default(),
            cpu: process.cpu.as_ref().map(|cpu| *cpu.get_ref()),
            inputs: inputs::inputs(manifest, member, &topics)?,
            outputs: outputs::outputs(&published, index),
            parameters: serde_json::Value::Null,
            restarts: member.program.on_exit == OnExit::Restart,
        })
    }))?;
    inputs::require_no_cycle(manifest, members, &nodes, &published, changed)?;
    inputs::order_inputs(&mut nodes, &published);
    Ok(Wiring { topics, nodes })
}
