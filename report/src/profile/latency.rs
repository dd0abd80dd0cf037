//! Host time of the parts of a node's tick, and of a sample's transport.

use crate::profile::times::Times;
use bus::profile::TickTimes;
use runtime::flight::{Cause, Flight};
use serde::Serialize;
use std::collections::BTreeMap;

/// The parts of a node's ticks.
#[derive(Debug, Serialize)]
pub struct NodeLatency {
    /// The node.
    pub name: String,
    /// Group with whose other members it shares a process.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Time from the end of the computation before until the last need was met; 0 if it was met already.
    pub wait: Times,
    /// Time from then until it had its inputs; only ticks at which it waited.
    pub wake_up: Times,
    /// Time from having its inputs to having computed.
    pub compute: Times,
    /// Time from then until its outputs were sent and the memory of the next ones was taken.
    pub publish: Times,
}

impl NodeLatency {
    /// Its name, with its group if it has one: `imu [imu+ekf]`.
    pub(crate) fn label(&self) -> String {
        self.group.as_ref().map_or(self.name.clone(), |group| format!("{} [{group}]", self.name))
    }
}

/// A topic on its way to one reader.
#[derive(Debug, Serialize)]
pub struct Transport {
    /// The topic.
    pub topic: String,
    /// The node that reads it.
    pub reader: String,
    /// Time from sending to taking a sample, for ticks at which the reader waited for this sample last.
    pub transport: Times,
}

/// The latencies of every node, and of every topic that a node waited for.
pub fn latencies(flight: &Flight) -> (Vec<NodeLatency>, Vec<Transport>) {
    let mut transport = BTreeMap::new();
    let nodes = (0..flight.plan.nodes.len()).map(|node| latency(flight, node, &mut transport)).collect();
    let named = |((topic, reader), transport): ((usize, usize), Times)| Transport {
        topic: flight.topic_name(topic).to_owned(),
        reader: flight.node_name(reader).to_owned(),
        transport,
    };
    (nodes, transport.into_iter().map(named).collect())
}

fn latency(flight: &Flight, node: usize, transport: &mut BTreeMap<(usize, usize), Times>) -> NodeLatency {
    let name = flight.node_name(node).to_owned();
    let group = flight.plan.group_of(node).map(|group| group.name.clone());
    let [mut wait, mut wake_up, mut compute, mut publish] = std::array::from_fn(|_| Times::default());
    for times in flight.ticks_of(node) {
        compute.add(times.done_ns.saturating_sub(times.received_ns));
        publish.add(times.ended_ns.saturating_sub(times.done_ns));
        let (Some(waited), Some(began_ns)) = (flight.waited(node, &times), times.began_ns) else { continue };
        wait.add(waited.ready_ns.saturating_sub(began_ns));
        if waited.cause == Cause::Itself {
            continue;
        }
        let woken_ns = times.received_ns.saturating_sub(waited.ready_ns);
        wake_up.add(woken_ns);
        if let Cause::Sample { topic, .. } = waited.cause {
            transport.entry((topic, node)).or_default().add(woken_ns);
        }
    }
    NodeLatency { name, group, wait, wake_up, compute, publish }
}

/// The parts of a tick.
pub const PARTS: [&str; 4] = ["wait", "wake-up", "compute", "publish"];

/// A part of a node's tick, in nanoseconds of the monotonic clock.
pub struct Part {
    pub start_ns: u64,
    pub end_ns: u64,
    /// Cause of the node's wait.
    pub cause: Option<Cause>,
}

/// The [`PARTS`] of the tick `times` of `node`; those that were not noted have no length.
pub fn parts(flight: &Flight, node: usize, times: &TickTimes<'_>) -> [Part; 4] {
    let began_ns = times.began_ns.unwrap_or(times.received_ns);
    let waited = flight.waited(node, times);
    let ready_ns = waited.map_or(began_ns, |waited| waited.ready_ns.clamp(began_ns, times.received_ns));
    let ends = [began_ns, ready_ns, times.received_ns, times.done_ns, times.ended_ns];
    std::array::from_fn(|part| Part {
        start_ns: ends[part],
        end_ns: ends[part + 1],
        cause: waited.map(|waited| waited.cause).filter(|_| part < 2),
    })
}

/// Name of the cause of a wait, for reports.
pub fn cause_name(flight: &Flight, cause: Cause) -> &str {
    match cause {
        Cause::Sample { topic, .. } => flight.topic_name(topic),
        Cause::Grant => "grant",
        Cause::Itself => "its own tick before",
    }
}
