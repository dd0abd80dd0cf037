//! The critical path of a tick: the chain of nodes and hops that its end waited for.
//!
//! It ends where the tick closes a feedback loop, or, in a run without one, with the node that ends last. From there
//! it goes back along the last wait of each node, until that lies before the tick: a sample of an earlier tick, the
//! clock's grant, or the node's own computation before.

use crate::profile::times::Times;
use runtime::flight::{Cause, Flight};
use serde::Serialize;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// A place on a critical path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// A node computes and sends.
    Node(usize),
    /// A sample of a topic is on its way to a reader.
    Hop { topic: usize, reader: usize },
    /// A node wakes up after its grant.
    Grant(usize),
    /// A node goes on after its own computation before.
    Itself(usize),
}

impl Place {
    /// The node that computes there, or is on its way to.
    pub fn node(self) -> usize {
        match self {
            Self::Node(node) | Self::Hop { reader: node, .. } | Self::Grant(node) | Self::Itself(node) => {
                node
            }
        }
    }
}

/// A stretch of a critical path, in nanoseconds of the monotonic clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stretch {
    /// Place at which the time was spent.
    pub place: Place,
    pub start_ns: u64,
    pub end_ns: u64,
}

/// The critical path of one tick; its stretches, two at least, follow each other without a gap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Path(pub Vec<Stretch>);

impl Path {
    /// The path of `tick`; `None` where no loop closes at it or something was not noted.
    pub fn of(flight: &Flight, closing: &[usize], tick: u32) -> Option<Self> {
        let (mut node, mut end_ns) = last(flight, closing, tick)?;
        let mut stretches = Vec::new();
        loop {
            let times = flight.at(node, tick)?;
            let waited = flight.waited(node, &times)?;
            stretches.push(Stretch { place: Place::Node(node), start_ns: times.received_ns, end_ns });
            let (start_ns, received_ns) = (waited.ready_ns, times.received_ns);
            let place = match waited.cause {
                Cause::Sample { topic, .. } => Place::Hop { topic, reader: node },
                Cause::Grant => Place::Grant(node),
                Cause::Itself => Place::Itself(node),
            };
            stretches.push(Stretch { place, start_ns, end_ns: received_ns });
            match waited.cause {
                Cause::Sample { topic, tick: stamp } if stamp == tick => {
                    (node, end_ns) = (flight.publisher(topic), start_ns);
                }
                _ => break,
            }
        }
        stretches.reverse();
        Some(Self(stretches))
    }

    /// Host time at which it starts and ends.
    pub fn span_ns(&self) -> (u64, u64) {
        (self.0[0].start_ns, self.0[self.0.len() - 1].end_ns)
    }

    /// Length of the path.
    pub fn length_ns(&self) -> u64 {
        let (start_ns, end_ns) = self.span_ns();
        end_ns.saturating_sub(start_ns)
    }
}

/// The node with which `tick` ends, and the host time of that end.
fn last(flight: &Flight, closing: &[usize], tick: u32) -> Option<(usize, u64)> {
    if closing.is_empty() {
        let nodes = 0..flight.plan.nodes.len();
        let ends = nodes.filter_map(|node| flight.at(node, tick).map(|times| (node, times.ended_ns)));
        return ends.max_by_key(|&(_, ended_ns)| ended_ns);
    }
    let sent = |&topic: &usize| Some((flight.publisher(topic), flight.sent_ns(topic, tick)?));
    closing.iter().filter_map(sent).max_by_key(|&(_, sent_ns)| sent_ns)
}

/// The critical paths of a run.
#[derive(Debug, Serialize)]
pub struct CriticalPath {
    /// The length of the path, tick by tick.
    pub tick_time: Times,
    /// Places along the paths, the largest share first.
    pub places: Vec<PlaceShare>,
    /// Ticks with the lengths of their paths in ns, in the order of the ticks.
    #[serde(skip)]
    pub lengths_ns: Vec<(u32, u64)>,
}

/// Contribution of one place to the critical paths.
#[derive(Debug, Serialize)]
pub struct PlaceShare {
    /// The place.
    pub place: String,
    /// Ticks on whose path it lies.
    pub ticks: u64,
    /// Its share of the time of all paths.
    pub share: f64,
    /// The time spent there.
    pub time: Times,
}

impl CriticalPath {
    /// The critical paths of `flight`.
    pub fn of(flight: &Flight) -> Self {
        let closing = flight.closing_topics();
        let (mut tick_time, mut lengths_ns) = (Times::default(), Vec::new());
        let mut places: BTreeMap<Place, (u64, Times)> = BTreeMap::new();
        for tick in 0..flight.ticks {
            let Some(path) = Path::of(flight, &closing, tick) else { continue };
            tick_time.add(path.length_ns());
            lengths_ns.push((tick, path.length_ns()));
            for stretch in &path.0 {
                let (total_ns, time) = places.entry(stretch.place).or_default();
                let ns = stretch.end_ns.saturating_sub(stretch.start_ns);
                *total_ns += ns;
                time.add(ns);
            }
        }
        Self { tick_time, places: shares(flight, places), lengths_ns }
    }

    /// The ticks with the longest paths, the longest first.
    pub fn slowest(&self, count: usize) -> Vec<u32> {
        let mut ticks = self.lengths_ns.clone();
        ticks.sort_by_key(|&(tick, ns)| (Reverse(ns), tick));
        ticks.into_iter().take(count).map(|(tick, _)| tick).collect()
    }
}

fn shares(flight: &Flight, places: BTreeMap<Place, (u64, Times)>) -> Vec<PlaceShare> {
    let total_ns: u64 = places.values().map(|(ns, _)| ns).sum();
    let mut places: Vec<_> = places.into_iter().collect();
    places.sort_by_key(|(place, (ns, _))| (Reverse(*ns), *place));
    let share = |(place, (ns, time)): (Place, (u64, Times))| PlaceShare {
        place: name(flight, place),
        ticks: time.quantiles().count,
        share: ns as f64 / total_ns.max(1) as f64,
        time,
    };
    places.into_iter().map(share).collect()
}

/// Name of a place, for reports.
pub fn name(flight: &Flight, place: Place) -> String {
    match place {
        Place::Node(node) => flight.node_name(node).to_owned(),
        Place::Hop { topic, reader } => {
            format!("{} → {}", flight.topic_name(topic), flight.node_name(reader))
        }
        Place::Grant(node) => format!("grant → {}", flight.node_name(node)),
        Place::Itself(node) => format!("{} still busy", flight.node_name(node)),
    }
}
