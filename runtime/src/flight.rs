//! Host times noted by the processes of a run, and conclusions drawn from them and the plan.

use crate::supervisor::replacement::Report;
use bus::BusError;
use bus::plan::{InputPlan, Plan};
use bus::profile::{Grant, GrantReader, TickReader, TickTimes};
use std::path::Path;

/// A flown run with the host times of its ticks.
#[derive(Debug)]
pub struct Flight {
    /// The plan.
    pub plan: Plan,
    /// Ticks that every node completed.
    pub ticks: u32,
    nodes: Vec<Vec<Era>>,
    grants: GrantReader,
    /// The nodes that send the topics.
    publishers: Vec<usize>,
}

/// The time in which one process was a node: its samples counted.
#[derive(Debug)]
struct Era {
    /// The first tick that was its own. A backup noted ticks before, as a shadow: no node read their samples.
    first_tick: u32,
    inputs: Vec<InputPlan>,
    noted: TickReader,
}

/// The last condition that a computation waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A sample: its topic, and the tick that it is stamped with.
    Sample {
        /// The topic.
        topic: usize,
        /// The tick.
        tick: u32,
    },
    /// The clock's grant.
    Grant,
    /// The node's own computation before.
    Itself,
}

/// The last thing that a computation waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Waited {
    /// Cause of the wait.
    pub cause: Cause,
    /// Host time at which it was there.
    pub ready_ns: u64,
}

impl Flight {
    /// Opens the files that the processes of `plan` wrote in `run_dir`; `replacements` state which instance took over
    /// from which. The files may be removed while this lives.
    ///
    /// # Errors
    /// If a file cannot be read or does not have the expected content.
    pub fn open(plan: &Plan, run_dir: &Path, ticks: u32, replacements: &[Report]) -> Result<Self, BusError> {
        let nodes = (0..plan.nodes.len()).map(|node| eras(plan, run_dir, node, replacements));
        Ok(Self {
            plan: plan.clone(),
            ticks,
            nodes: nodes.collect::<Result<_, _>>()?,
            grants: GrantReader::open(run_dir)?,
            publishers: (0..plan.topics.len()).map(|topic| plan.publisher(topic)).collect(),
        })
    }

    /// Computations that were noted, over all nodes, without those of shadows.
    pub fn noted(&self) -> usize {
        (0..self.nodes.len()).map(|node| self.ticks_of(node).count()).sum()
    }

    /// Computations that were not noted because there were too many.
    pub fn left_out(&self) -> u64 {
        self.nodes.iter().flatten().map(|era| era.noted.left_out()).sum()
    }

    /// The name of a node.
    pub fn node_name(&self, node: usize) -> &str {
        &self.plan.nodes[node].name
    }

    /// The name of a topic.
    pub fn topic_name(&self, topic: usize) -> &str {
        &self.plan.topics[topic].name
    }

    /// The node that sends `topic`.
    pub fn publisher(&self, topic: usize) -> usize {
        self.publishers[topic]
    }

    /// The times of `node` at `tick`, if it was due then and noted it.
    pub fn at(&self, node: usize, tick: u32) -> Option<TickTimes<'_>> {
        let mut found = self.eras_at(node, tick).filter_map(|era| era.noted.at(tick));
        let newest = found.next()?;
        let has_sent = |times: &TickTimes<'_>| times.sent_ns.iter().any(|&ns| ns > 0);
        // A process that died may have sent the tick that its backup did again.
        if has_sent(&newest) { Some(newest) } else { found.find(has_sent).or(Some(newest)) }
    }

    /// The processes that have been `node` by `tick`, the newest first.
    fn eras_at(&self, node: usize, tick: u32) -> impl Iterator<Item = &Era> {
        self.nodes[node].iter().rev().filter(move |era| era.first_tick <= tick)
    }

    /// The inputs that `node` has at `tick`: a backup may read other topics.
    pub fn inputs(&self, node: usize, tick: u32) -> &[InputPlan] {
        self.eras_at(node, tick).next().map_or(&[], |era| &era.inputs)
    }

    /// Host times that `node` noted in the ticks of the run.
    pub fn ticks_of(&self, node: usize) -> impl Iterator<Item = TickTimes<'_>> {
        let period = self.plan.nodes[node].period_ticks.max(1) as usize;
        (0..self.ticks).step_by(period).filter_map(move |tick| self.at(node, tick))
    }

    /// The stamp of the sample that `input` reads at `tick`; `None` for an initial value.
    pub fn stamp(&self, input: &InputPlan, tick: u32) -> Option<u32> {
        let newest = tick.checked_sub(input.delay_ticks)?;
        Some(self.plan.topics[input.topic].ticks.newest(newest))
    }

    /// Host time at which the sample of `topic` stamped `tick` was sent.
    pub fn sent_ns(&self, topic: usize, tick: u32) -> Option<u64> {
        let node = self.publishers[topic];
        let output = self.plan.nodes[node].outputs.iter().position(|output| output.topic == topic)?;
        self.at(node, tick)?.sent_ns.get(output).copied().filter(|&ns| ns > 0)
    }

    /// The grants, in their order.
    pub fn grants(&self) -> impl Iterator<Item = Grant> {
        self.grants.grants()
    }

    /// The grant of `tick`.
    pub fn grant(&self, tick: u32) -> Option<Grant> {
        self.grants.of(tick)
    }

    /// The last condition that the computation `times` of `node` waited for. `None` if it was not noted.
    pub fn waited(&self, node: usize, times: &TickTimes<'_>) -> Option<Waited> {
        let itself = times.began_ns.map(|ready_ns| Waited { cause: Cause::Itself, ready_ns });
        let granted = self.grant(times.tick)?.granted_ns;
        let mut last = Waited { cause: Cause::Grant, ready_ns: granted };
        for input in self.inputs(node, times.tick) {
            let Some(tick) = self.stamp(input, times.tick) else { continue };
            let ready_ns = self.sent_ns(input.topic, tick)?;
            if ready_ns > last.ready_ns {
                last = Waited { cause: Cause::Sample { topic: input.topic, tick }, ready_ns };
            }
        }
        Some(itself.filter(|waited| waited.ready_ns >= last.ready_ns).unwrap_or(last))
    }

    /// The topics that close a feedback loop: read with a delay by a node that the publisher depends on.
    pub fn closing_topics(&self) -> Vec<usize> {
        let closes = |&topic: &usize| {
            let mut readers = self.readers_of(topic, |delay_ticks| delay_ticks > 0);
            readers.any(|reader| self.reaches(reader, self.publishers[topic]))
        };
        (0..self.plan.topics.len()).filter(closes).collect()
    }

    fn readers_of(&self, topic: usize, with: impl Fn(u32) -> bool + Copy) -> impl Iterator<Item = usize> {
        let reads = move |input: &InputPlan| input.topic == topic && with(input.delay_ticks);
        let nodes = self.nodes.iter().enumerate();
        nodes
            .filter(move |(_, eras)| eras.iter().flat_map(|era| &era.inputs).any(reads))
            .map(|(node, _)| node)
    }

    /// True if samples of `from` reach `to`, over any number of nodes; a node reaches itself.
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
        let mut nodes = self.plan.nodes.clone();
        for (node, eras) in nodes.iter_mut().zip(&self.nodes) {
            node.inputs = eras.iter().flat_map(|era| era.inputs.clone()).collect();
        }
        let depths = crate::placement::depths(&nodes, |topic| self.publishers[topic]);
        let mut order: Vec<usize> = (0..self.plan.nodes.len()).collect();
        order.sort_by_key(|&node| depths[node]);
        order
    }
}

/// The processes that were `node` one after the other.
fn eras(plan: &Plan, run_dir: &Path, node: usize, replacements: &[Report]) -> Result<Vec<Era>, BusError> {
    let first = (0, 0, &plan.nodes[node].inputs);
    let next = replacements.iter().filter(|report| report.process == plan.nodes[node].name);
    let next = next.filter_map(|report| Some((report.generation, report.take_over_tick?, &report.inputs)));
    let era = |(generation, first_tick, inputs): (u32, u32, &Vec<InputPlan>)| {
        let noted = TickReader::open(run_dir, plan, node, generation)?;
        Ok(Era { first_tick, inputs: inputs.clone(), noted })
    };
    std::iter::once(first).chain(next).map(era).collect()
}
