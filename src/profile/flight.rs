//! What the processes of a run noted, and what follows from it with the plan.

use bus::BusError;
use bus::plan::Plan;
use bus::profile::{Grant, GrantReader, TickReader, TickTimes};
use std::path::Path;

/// A flown run with the host times of its ticks.
#[derive(Debug)]
pub struct Flight {
    /// The plan.
    pub plan: Plan,
    /// Ticks that every node completed.
    pub ticks: u32,
    nodes: Vec<TickReader>,
    grants: GrantReader,
    publishers: Vec<Publisher>,
}

/// Who sends a topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Publisher {
    /// The node.
    pub node: usize,
    /// Its output.
    pub output: usize,
}

/// What a computation had to wait for last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A sample: the node's input, and the tick that the sample is stamped with.
    Sample { input: usize, tick: u32 },
    /// The clock's grant.
    Grant,
    /// The node's own computation before.
    Itself,
}

/// The last thing that a computation waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Waited {
    /// What it was.
    pub cause: Cause,
    /// Host time at which it was there.
    pub ready_ns: u64,
}

impl Flight {
    /// Opens what the processes of `plan` noted in `run_dir`. The files may be removed while this lives.
    ///
    /// # Errors
    /// If a file cannot be read or does not hold what it should.
    pub fn open(plan: &Plan, run_dir: &Path, ticks: u32) -> Result<Self, BusError> {
        let nodes = (0..plan.nodes.len()).map(|node| TickReader::open(run_dir, plan, node));
        let mut publishers = vec![Publisher::default(); plan.topics.len()];
        for (node, plan) in plan.nodes.iter().enumerate() {
            for (output, plan) in plan.outputs.iter().enumerate() {
                publishers[plan.topic] = Publisher { node, output };
            }
        }
        Ok(Self {
            plan: plan.clone(),
            ticks,
            nodes: nodes.collect::<Result<_, _>>()?,
            grants: GrantReader::open(run_dir)?,
            publishers,
        })
    }

    /// Computations that were noted, over all nodes.
    pub fn noted(&self) -> usize {
        self.nodes.iter().map(TickReader::count).sum()
    }

    /// Computations that were not noted because there were too many.
    pub fn left_out(&self) -> u64 {
        self.nodes.iter().map(TickReader::left_out).sum()
    }

    /// The name of a node.
    pub fn node_name(&self, node: usize) -> &str {
        &self.plan.nodes[node].name
    }

    /// The name of a topic.
    pub fn topic_name(&self, topic: usize) -> &str {
        &self.plan.topics[topic].name
    }

    /// Who sends `topic`.
    pub fn publisher(&self, topic: usize) -> Publisher {
        self.publishers[topic]
    }

    /// The times of `node` at `tick`, if it was due then and noted it.
    pub fn at(&self, node: usize, tick: u32) -> Option<TickTimes<'_>> {
        self.nodes[node].at(tick)
    }

    /// All that `node` noted in the ticks of the run.
    pub fn ticks_of(&self, node: usize) -> impl Iterator<Item = TickTimes<'_>> {
        let period = self.plan.nodes[node].period_ticks.max(1) as usize;
        (0..self.ticks).step_by(period).filter_map(move |tick| self.at(node, tick))
    }

    /// The stamp of the sample that `input` of `node` reads at `tick`; `None` for an initial value.
    pub fn stamp(&self, node: usize, input: usize, tick: u32) -> Option<u32> {
        let input = &self.plan.nodes[node].inputs[input];
        let newest = tick.checked_sub(input.delay_ticks)?;
        Some(newest - newest % self.plan.topics[input.topic].period_ticks.max(1))
    }

    /// Host time at which the sample of `topic` stamped `tick` was sent.
    pub fn sent_ns(&self, topic: usize, tick: u32) -> Option<u64> {
        let publisher = self.publishers[topic];
        let times = self.at(publisher.node, tick)?;
        times.sent_ns.get(publisher.output).copied().filter(|&ns| ns > 0)
    }

    /// The grants, in their order.
    pub fn grants(&self) -> impl Iterator<Item = Grant> {
        self.grants.grants()
    }

    /// The grant of `tick`.
    pub fn grant(&self, tick: u32) -> Option<Grant> {
        self.grants.of(tick)
    }

    /// What the computation `times` of `node` waited for last. `None` where that was not noted.
    pub fn waited(&self, node: usize, times: &TickTimes<'_>) -> Option<Waited> {
        let own = times.began_ns.map(|ready_ns| Waited { cause: Cause::Itself, ready_ns });
        let granted = self.grant(times.tick)?.granted_ns;
        let mut last = Waited { cause: Cause::Grant, ready_ns: granted };
        for input in 0..self.plan.nodes[node].inputs.len() {
            let Some(tick) = self.stamp(node, input, times.tick) else { continue };
            let ready_ns = self.sent_ns(self.plan.nodes[node].inputs[input].topic, tick)?;
            if ready_ns > last.ready_ns {
                last = Waited { cause: Cause::Sample { input, tick }, ready_ns };
            }
        }
        Some(own.filter(|own| own.ready_ns >= last.ready_ns).unwrap_or(last))
    }

    /// The topics that close a feedback loop: read with a delay by a node that the publisher depends on.
    pub fn closing_topics(&self) -> Vec<usize> {
        let closes = |&topic: &usize| {
            let mut readers = self.readers_of(topic, |delay_ticks| delay_ticks > 0);
            readers.any(|reader| self.reaches(reader, self.publishers[topic].node))
        };
        (0..self.plan.topics.len()).filter(closes).collect()
    }

    fn readers_of(&self, topic: usize, with: impl Fn(u32) -> bool + Copy) -> impl Iterator<Item = usize> {
        let nodes = self.plan.nodes.iter().enumerate();
        let reads = move |node: &bus::plan::NodePlan| {
            node.inputs.iter().any(|input| input.topic == topic && with(input.delay_ticks))
        };
        nodes.filter(move |(_, node)| reads(node)).map(|(index, _)| index)
    }

    /// Whether what `from` sends comes to `to`, over any number of nodes; a node reaches itself.
    fn reaches(&self, from: usize, to: usize) -> bool {
        let mut is_reached = vec![false; self.plan.nodes.len()];
        let mut open = vec![from];
        while let Some(node) = open.pop() {
            if !std::mem::replace(&mut is_reached[node], true) {
                let outputs = self.plan.nodes[node].outputs.iter();
                open.extend(outputs.flat_map(|output| self.readers_of(output.topic, |_| true)));
            }
        }
        is_reached[to]
    }

    /// The nodes in an order in which each comes after those whose samples of the same tick it reads.
    pub fn in_order(&self) -> Vec<usize> {
        let depths = crate::placement::depths(&self.plan.nodes, |topic| self.publishers[topic].node);
        let mut order: Vec<usize> = (0..self.plan.nodes.len()).collect();
        order.sort_by_key(|&node| depths[node]);
        order
    }
}
