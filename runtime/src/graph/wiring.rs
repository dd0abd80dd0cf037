//! The nodes of a run, wired to each other.

use super::inputs::Senders;
use super::processes::{self, DeclaredNode};
use super::{computing_time, inputs, outputs};
use crate::program::OnExit;
use bus::plan::{NodePlan, TopicPlan};
use diagnostics::Diagnostic;
use std::collections::BTreeMap;

/// Topics and nodes, wired to each other.
pub struct Wiring {
    /// The topics, in the order of their publishers.
    pub topics: Vec<TopicPlan>,
    /// The nodes, in the order of the declared nodes.
    pub nodes: Vec<NodePlan>,
}

/// Wires `declared_nodes`; their nodes have no parameters and no place yet. `changed` is the one that is to blame
/// for a cycle it is in.
///
/// # Errors
/// A faulty port, or a cycle without a delay.
pub fn wire(declared_nodes: &[DeclaredNode<'_>], changed: Option<usize>) -> Result<Wiring, Diagnostic> {
    let (wiring, faulty) = wire_apart(declared_nodes, changed)?;
    Diagnostic::gather(faulty.into_values().map(Err::<(), _>))?;
    Ok(wiring)
}

/// As [`wire`], for a check that goes on: a node with a faulty port has no inputs, and its faults are returned by its index.
///
/// # Errors
/// A faulty output, which hides what others read, or a cycle without a delay.
pub fn wire_apart(
    declared_nodes: &[DeclaredNode<'_>],
    changed: Option<usize>,
) -> Result<(Wiring, BTreeMap<usize, Diagnostic>), Diagnostic> {
    let published = outputs::publish_all(declared_nodes)?;
    let topics: Vec<TopicPlan> = published.iter().map(|output| output.topic.clone()).collect();
    let mut faulty = BTreeMap::new();
    let senders = Senders { declared_nodes, published: &published };
    let mut nodes = Diagnostic::gather(declared_nodes.iter().enumerate().map(|(index, declared)| {
        let process = declared.process;
        let is_checked = !declared.is_unchecked;
        let stated = || processes::period_ticks(declared.manifest, process, declared.program.component());
        let inputs = inputs::inputs(declared, &topics, &senders);
        Ok(NodePlan {
            name: declared.name.get_ref().clone(),
            period_ticks: if is_checked { stated()? } else { 1 },
            wait: process.wait.unwrap_or_default(),
            cpu: process.cpu.as_ref().map(|cpu| *cpu.get_ref()),
            inputs: inputs.map_err(|fault| faulty.insert(index, fault)).unwrap_or_default(),
            outputs: outputs::outputs(&published, index),
            parameters: serde_json::Value::Null,
            files: Vec::new(),
            restarts: declared.program.on_exit == OnExit::Restart,
            computing_time: if is_checked { computing_time::of(declared)? } else { None },
            is_recorder: declared.program.is_recorder(),
            is_built_in: declared.program.kind().is_some(),
        })
    }))?;
    if faulty.is_empty() {
        inputs::require_no_cycle(declared_nodes, &nodes, &published, changed)?;
        inputs::order_inputs(&mut nodes, &published);
    }
    Ok((Wiring { topics, nodes }, faulty))
}
