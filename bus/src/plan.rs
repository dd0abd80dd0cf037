//! The resolved plan of a run: the launcher writes it, and every process of the run reads it.

use crate::computing_time::ComputingTime;
use crate::error::BusError;
use crate::json_file;
use crate::sample_ticks::SampleTicks;
use inputs::InputFile;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Processes that a node can have at a time: the one that flies, and one that shadows it.
pub const SLOTS_PER_NODE: usize = 2;
/// Inputs that every process of a node may have, so that a backup may read more than its primary: their waiters are laid
/// out before the run.
pub const INPUTS_RESERVED: usize = 8;

/// Sizes of a topic's queues.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capacity {
    /// Samples that wait in a subscriber's queue at most.
    pub(crate) queued_samples: usize,
    /// Samples that a publisher keeps for a subscriber that joins later.
    pub(crate) history_samples: usize,
    /// Subscribers of the topic.
    pub(crate) subscribers: usize,
    /// Processes of the run.
    pub(crate) nodes: usize,
}

/// Pace of the clock service.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pace {
    /// As fast as the nodes can.
    Free,
    /// This many simulated seconds per second of a monotonic clock.
    Factor(f64),
}

impl Pace {
    /// One simulated second per second.
    pub const REAL_TIME: Self = Self::Factor(1.0);
}

/// Way in which a process waits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wait {
    /// Sleep in the kernel (futex) until woken.
    #[default]
    Block,
    /// Poll, yielding the core between polls.
    Spin,
    /// Poll for a short while, then sleep.
    Adaptive,
}

/// A topic: samples of one message from one publisher.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TopicPlan {
    /// Name, such as `/plant/state`.
    pub name: String,
    /// Three-part type name.
    pub type_name: String,
    /// Ticks at which its samples are sent.
    pub ticks: SampleTicks,
}

/// A node's input.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct InputPlan {
    /// The port's name in the node.
    pub port: String,
    /// Index of the topic.
    pub topic: usize,
    /// 0: the sample of this tick; 1: that of the tick before.
    pub delay_ticks: u32,
    /// Field values of the sample that is read before the first one arrives.
    pub initial: Option<serde_json::Value>,
}

/// A node's output.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct OutputPlan {
    /// The port's name in the node.
    pub port: String,
    /// Index of the topic.
    pub topic: usize,
}

/// A node: one process's part in the run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NodePlan {
    /// Name, unique in the run.
    pub name: String,
    /// Ticks between two computations.
    pub period_ticks: u32,
    /// Its way of waiting.
    pub wait: Wait,
    /// Cores it may run on; all where `None`.
    pub cpu: Option<usize>,
    /// Inputs, the one that arrives last first: waiting in this order wakes the process once a tick.
    pub inputs: Vec<InputPlan>,
    /// Outputs.
    pub outputs: Vec<OutputPlan>,
    /// The node's own parameters.
    pub parameters: serde_json::Value,
    /// Files that the node reads: their copies lie in [`Plan::INPUTS`].
    #[serde(default)]
    pub files: Vec<InputFile>,
    /// True if another process is started in its place when it dies: its publishers then keep enough history.
    #[serde(default)]
    pub restarts: bool,
    /// Computing time of its steps, if that is simulated.
    #[serde(default)]
    pub computing_time: Option<ComputingTime>,
    /// True for the recorder: it takes every sample, of a group from rings in shared memory.
    #[serde(default)]
    pub is_recorder: bool,
    /// True if its program is part of this project; false for a `command`, which its user builds.
    #[serde(default)]
    pub is_built_in: bool,
}

impl NodePlan {
    /// Reads the plan that the process of generation `generation` of node `node` has of itself.
    ///
    /// # Errors
    /// If the file is missing or holds something else.
    pub(crate) fn load_backup(run_dir: &Path, node: usize, generation: u32) -> Result<Self, BusError> {
        json_file::load(&backup_path(run_dir, node, generation), "the plan of a backup")
    }

    /// Writes the same.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn store_backup(&self, run_dir: &Path, node: usize, generation: u32) -> Result<(), BusError> {
        json_file::store(&backup_path(run_dir, node, generation), self)
    }

    /// True if a process that flies by `other` computes the same: its period, inputs, parameters and computing time are equal.
    #[must_use]
    pub fn computes_as(&self, other: &Self) -> bool {
        let text = |Self { period_ticks, inputs, parameters, computing_time, .. }: &Self| {
            let text = serde_json::to_string(&(period_ticks, inputs, parameters, computing_time));
            text.unwrap_or_else(|error| unreachable!("a plan serialises: {error}"))
        };
        text(self) == text(other)
    }

    /// Inputs that a process of this node may have.
    #[must_use]
    pub fn inputs_max(&self) -> usize {
        self.inputs.len().max(INPUTS_RESERVED)
    }
}

/// Everything that the processes of a run must agree on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Plan {
    /// Unique on this machine; part of every shared-memory name.
    pub run_id: String,
    /// Seed of every node's random stream.
    pub seed: u64,
    /// Simulated time of one tick in nanoseconds.
    pub tick_ns: u64,
    /// Ticks until the run ends.
    pub duration_ticks: u32,
    /// The first tick that is computed: that of the checkpoint from which the run goes on.
    #[serde(default)]
    pub first_tick: u32,
    /// Ticks before which the nodes write their parts of a checkpoint, ascending.
    #[serde(default)]
    pub checkpoint_ticks: Vec<u32>,
    /// Ticks between two further checkpoints.
    #[serde(default)]
    pub checkpoint_period: Option<u32>,
    /// Ticks that a fast node may be ahead of the slowest.
    pub window_ticks: u32,
    /// Pacing.
    pub pace: Pace,
    /// Core of the clock service.
    pub clock_cpu: Option<usize>,
    /// True if every process notes the host times of its ticks.
    #[serde(default)]
    pub profile: bool,
    /// True if every process keeps its memory from being paged out.
    #[serde(default)]
    pub lock_memory: bool,
    /// Topics.
    pub topics: Vec<TopicPlan>,
    /// Nodes.
    pub nodes: Vec<NodePlan>,
    /// Groups of nodes that share a process; a node of none has a process of its own.
    #[serde(default)]
    pub groups: Vec<GroupPlan>,
}

/// Nodes whose first instances share a process, which steps them one after the other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GroupPlan {
    /// Name, unique among the groups of the run.
    pub name: String,
    /// Members, by ascending index of their nodes.
    pub members: Vec<MemberPlan>,
    /// Core of the process; any where `None`.
    pub cpu: Option<usize>,
}

/// A member of a group.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MemberPlan {
    /// Index of its node.
    pub node: usize,
    /// Name of its component.
    pub kind: String,
}

impl GroupPlan {
    /// True if node `node` is a member.
    #[must_use]
    pub fn has(&self, node: usize) -> bool {
        self.members.iter().any(|member| member.node == node)
    }
}

/// Path of the plan of a backup.
#[must_use]
pub fn backup_path(run_dir: &Path, node: usize, generation: u32) -> PathBuf {
    run_dir.join(format!("node-{node}.{generation}.json"))
}

impl Plan {
    /// The name of the plan's file in the run directory.
    pub const FILE: &'static str = "plan.json";
    /// The name of the folder in the run directory with the files that the run reads, each under its SHA-256.
    pub const INPUTS: &'static str = "inputs";

    /// Reads the plan of the run in `run_dir`.
    ///
    /// # Errors
    /// If the file is missing or is not a plan.
    pub fn load(run_dir: &Path) -> Result<Self, BusError> {
        json_file::load(&run_dir.join(Self::FILE), "the plan of a run")
    }

    /// Writes the plan into `run_dir`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn store(&self, run_dir: &Path) -> Result<(), BusError> {
        json_file::store(&run_dir.join(Self::FILE), self)
    }

    /// The first checkpoint behind `tick`, if there is one. Checkpoints after which a node computes nothing more are left
    /// out: nothing would go on from them.
    #[must_use]
    pub fn checkpoint_after(&self, tick: u32) -> Option<u32> {
        let named = self.checkpoint_ticks.iter().copied().find(|&named| named > tick);
        let period = self.checkpoint_period.unwrap_or(u32::MAX).max(1);
        let next = (tick / period).checked_add(1).and_then(|number| number.checked_mul(period));
        [named, next].into_iter().flatten().min().filter(|&next| self.goes_on_from(next))
    }

    /// True if every node computes at or behind `tick`.
    #[must_use]
    pub fn goes_on_from(&self, tick: u32) -> bool {
        self.nodes.iter().all(|node| {
            let due = u64::from(tick).next_multiple_of(u64::from(node.period_ticks.max(1)));
            due < u64::from(self.duration_ticks)
        })
    }

    /// Simulated time of one tick in seconds.
    #[must_use]
    pub fn tick_s(&self) -> f64 {
        self.tick_ns as f64 * 1e-9
    }

    /// The index of the node named `name`.
    ///
    /// # Errors
    /// If there is none; the error lists those there are.
    pub fn node_index(&self, name: &str) -> Result<usize, BusError> {
        self.nodes.iter().position(|node| node.name == name).ok_or_else(|| BusError::UnknownNode {
            node: name.to_owned(),
            known: self.nodes.iter().map(|node| node.name.as_str()).collect::<Vec<_>>().join(", "),
        })
    }

    /// Inputs that the processes of all nodes before node `node` may have, one of each.
    fn inputs_before(&self, node: usize) -> usize {
        self.nodes[..node].iter().map(NodePlan::inputs_max).sum()
    }

    /// Inputs that the processes in all slots may have.
    pub(crate) fn input_count(&self) -> usize {
        SLOTS_PER_NODE * self.inputs_before(self.nodes.len())
    }

    /// The number of the first input of the process in slot `slot` among those of all slots.
    pub(crate) fn first_input(&self, slot: usize) -> usize {
        let (half, node) = (slot / self.nodes.len(), slot % self.nodes.len());
        half * self.inputs_before(self.nodes.len()) + self.inputs_before(node)
    }

    /// The slot of generation `generation` of node `node` among the slots of the run: each node has two, so that a
    /// backup can join while its primary flies.
    #[must_use]
    pub fn slot(&self, node: usize, generation: u32) -> usize {
        (generation as usize % SLOTS_PER_NODE) * self.nodes.len() + node
    }

    /// Sizes of the queues of topic `topic`. A queue holds the samples that a publisher can send before the slowest
    /// node holds the grant back. For shadows it holds twice that, since no node waits for their samples. A shadow
    /// may be a window behind a reader that takes its samples, and a window ahead before the reader takes the next.
    pub(crate) fn capacity(&self, topic: usize) -> Capacity {
        let reads = |node: &&NodePlan| node.inputs.iter().any(|input| input.topic == topic);
        let longest_period = self.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
        let ticks = u64::from(self.window_ticks) + u64::from(longest_period);
        let samples = |ticks: u64| {
            let samples = self.topics[topic].ticks.most_within(ticks) + 2;
            usize::try_from(samples).unwrap_or(usize::MAX)
        };
        // A subscriber that joins gets the history first: beside it there must be room for the samples that are sent
        // before it has taken the history.
        let queued_samples = 2 * samples(ticks);
        // A process that joins at a tick boundary needs the newest sample; one that takes the place of a crashed
        // process needs every sample since.
        let restarts = self.nodes.iter().any(|node| node.restarts);
        Capacity {
            queued_samples,
            history_samples: if restarts { samples(ticks) } else { 1 },
            // Each reader and its backup, a backup of the publisher, and backups that read more than
            // their predecessors.
            subscribers: SLOTS_PER_NODE * self.nodes.iter().filter(reads).count() + 3,
            nodes: SLOTS_PER_NODE * self.nodes.len() + 1,
        }
    }

    /// The group of node `node`, if it is in one.
    #[must_use]
    pub fn group_of(&self, node: usize) -> Option<&GroupPlan> {
        self.groups.iter().find(|group| group.has(node))
    }

    /// The node that publishes topic `topic`.
    ///
    /// # Panics
    /// If none does: a plan has topics for outputs only.
    #[must_use]
    pub fn publisher(&self, topic: usize) -> usize {
        let publishes = |node: &NodePlan| node.outputs.iter().any(|output| output.topic == topic);
        let publisher = self.nodes.iter().position(publishes);
        publisher.unwrap_or_else(|| panic!("topic {} of the plan has no publisher", self.topics[topic].name))
    }
}

#[cfg(test)]
impl NodePlan {
    /// A node for tests: it computes at every tick.
    pub(crate) fn for_test(name: &str, inputs: Vec<InputPlan>, outputs: Vec<OutputPlan>) -> Self {
        let (wait, parameters) = (Wait::Block, serde_json::Value::Null);
        let (name, restarts) = (name.to_owned(), false);
        let computing_time = None;
        Self {
            name,
            period_ticks: 1,
            wait,
            cpu: None,
            inputs,
            outputs,
            parameters,
            files: Vec::new(),
            restarts,
            computing_time,
            is_recorder: false,
            is_built_in: false,
        }
    }
}

#[cfg(test)]
impl Plan {
    /// A free-running plan for tests, whose files no other test's are called like.
    pub(crate) fn for_test(duration_ticks: u32, topics: Vec<TopicPlan>, nodes: Vec<NodePlan>) -> Self {
        Self {
            run_id: format!("test-{:x}-{:x}", std::process::id(), crate::host_time::monotonic_ns()),
            seed: 1,
            tick_ns: 1_000_000,
            duration_ticks,
            first_tick: 0,
            checkpoint_ticks: Vec::new(),
            checkpoint_period: None,
            window_ticks: 64,
            pace: Pace::Free,
            clock_cpu: None,
            profile: false,
            lock_memory: false,
            topics,
            nodes,
            groups: Vec::new(),
        }
    }
}
