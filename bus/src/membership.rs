//! Primary and backup of every node of a run, from one change to the next.
//!
//! The supervisor writes the membership and raises the epoch; every node then makes its connections agree with
//! it. A membership holds the whole state, not a change, so it does not matter which of them a node saw last.

use crate::error::BusError;
use crate::json_file;
use crate::plan::{NodePlan, Plan};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The processes of a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Membership {
    /// Counts the changes of this run.
    pub epoch: u32,
    /// The processes of each node, in the plan's order.
    pub nodes: Vec<NodeInstances>,
}

/// The processes of a node.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NodeInstances {
    /// The process whose samples count, up to the take-over.
    pub primary: Instance,
    /// The process that shadows it.
    pub backup: Option<Instance>,
    /// The tick from which on the backup goes on by itself; `u32::MAX` where it only shadows.
    pub take_over_tick: u32,
    /// The tick from which on the backup's samples count, by output. After a crash some outputs of the take-over tick
    /// may have been sent already.
    pub take_over_ticks: Vec<u32>,
}

/// A process of a node.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Instance {
    /// Counts the processes of this node, from 0.
    pub generation: u32,
    /// The first tick it computes.
    pub join_tick: u32,
    /// True if it sends samples before the take-over; false for one that is started after a crash.
    pub shadows: bool,
    /// Its inputs and parameters.
    pub plan: NodePlan,
}

impl Membership {
    /// The membership at the start of a run: generation 0 of every node.
    #[must_use]
    pub fn first(plan: &Plan) -> Self {
        let first = |node: &NodePlan| NodeInstances {
            primary: Instance {
                generation: 0,
                join_tick: plan.first_tick.next_multiple_of(node.period_ticks.max(1)),
                shadows: false,
                plan: node.clone(),
            },
            backup: None,
            take_over_tick: u32::MAX,
            take_over_ticks: vec![u32::MAX; node.outputs.len()],
        };
        Self { epoch: 0, nodes: plan.nodes.iter().map(first).collect() }
    }

    /// Reads membership number `epoch` of the run in `run_dir`.
    ///
    /// # Errors
    /// If the file is missing or is not a membership.
    pub fn load(run_dir: &Path, epoch: u32) -> Result<Self, BusError> {
        json_file::load(&path(run_dir, epoch), "the membership of a run")
    }

    /// Writes the membership into `run_dir`, and removes the one before the one before it. No node reads that one any
    /// more: every node agrees with a membership before the next is made.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn store(&self, run_dir: &Path) -> Result<(), BusError> {
        json_file::store(&path(run_dir, self.epoch), self)?;
        if let Some(old) = self.epoch.checked_sub(2) {
            let _ = std::fs::remove_file(self::path(run_dir, old));
        }
        Ok(())
    }

    /// The processes that read topic `topic`: node, generation and number of the input.
    pub(crate) fn readers(&self, topic: usize) -> impl Iterator<Item = (usize, u32, usize)> + '_ {
        self.nodes.iter().enumerate().flat_map(move |(node, membership)| {
            membership.instances().flat_map(move |instance| {
                let inputs = instance.plan.inputs.iter().enumerate();
                inputs
                    .filter(move |(_, input)| input.topic == topic)
                    .map(move |(index, _)| (node, instance.generation, index))
            })
        })
    }
}

impl NodeInstances {
    /// The process of this generation.
    pub(crate) fn of(&self, generation: u32) -> Option<&Instance> {
        self.instances().find(|instance| instance.generation == generation)
    }

    fn instances(&self) -> impl Iterator<Item = &Instance> {
        std::iter::once(&self.primary).chain(&self.backup)
    }

    /// The tick from which on the backup's samples of topic `topic` count.
    pub(crate) fn topic_take_over_tick(&self, topic: usize) -> u32 {
        let mut outputs = self.primary.plan.outputs.iter().zip(&self.take_over_ticks);
        let found = outputs.find(|(output, _)| output.topic == topic);
        *found.expect("the publisher of a topic has an output for it").1
    }
}

fn path(run_dir: &Path, epoch: u32) -> PathBuf {
    run_dir.join(format!("membership-{epoch}.json"))
}
