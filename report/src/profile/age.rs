//! How old the samples are that a command rests on when it is sent.

use crate::profile::times::Times;
use runtime::flight::Flight;
use serde::Serialize;

/// The age of one topic's samples in the commands of another.
#[derive(Debug, Serialize)]
pub struct Age {
    /// The topic that the command depends on without a delay, directly or over other nodes.
    pub source: String,
    /// The topic that closes a feedback loop.
    pub command: String,
    /// From the stamp of the oldest sample that goes into a command to the command's own.
    pub simulated: Times,
    /// From the sending of that sample to the sending of the command.
    pub host: Times,
}

/// The ages of all topics in all commands.
pub fn ages(flight: &Flight) -> Vec<Age> {
    let mut ages = Ages::new(flight);
    (0..flight.ticks).for_each(|tick| ages.add(tick));
    ages.named()
}

struct Ages<'a> {
    flight: &'a Flight,
    order: Vec<usize>,
    closing: Vec<usize>,
    /// The oldest stamp of each topic that goes into what each node computed last.
    in_node: Vec<Vec<Option<u32>>>,
    /// The same for the newest sample of each topic.
    in_sample: Vec<Vec<Option<u32>>>,
    /// Simulated and host ages by command (an index of `closing`) and source topic.
    found: Vec<Vec<(Times, Times)>>,
}

impl<'a> Ages<'a> {
    fn new(flight: &'a Flight) -> Self {
        let (nodes, topics) = (flight.plan.nodes.len(), flight.plan.topics.len());
        let closing = flight.closing_topics();
        Self {
            flight,
            order: flight.in_order(),
            in_node: vec![vec![None; topics]; nodes],
            in_sample: vec![vec![None; topics]; topics],
            found: vec![
                vec![(Times::in_units(flight.plan.tick_ns), Times::default()); topics];
                closing.len()
            ],
            closing,
        }
    }

    fn add(&mut self, tick: u32) {
        for index in 0..self.order.len() {
            let node = self.order[index];
            if tick.is_multiple_of(self.flight.plan.nodes[node].period_ticks.max(1)) {
                self.compute(node, tick);
                self.send(node, tick);
            }
        }
        for command in 0..self.closing.len() {
            self.note(command, tick);
        }
    }

    fn compute(&mut self, node: usize, tick: u32) {
        let oldest = &mut self.in_node[node];
        oldest.fill(None);
        for input in self.flight.inputs(node, tick) {
            let Some(stamp) = self.flight.stamp(input, tick).filter(|_| input.delay_ticks == 0) else {
                continue;
            };
            keep_older(&mut oldest[input.topic], Some(stamp));
            let carried = &self.in_sample[input.topic];
            oldest.iter_mut().zip(carried).for_each(|(oldest, &carried)| keep_older(oldest, carried));
        }
    }

    fn send(&mut self, node: usize, tick: u32) {
        for output in &self.flight.plan.nodes[node].outputs {
            if self.is_sent(output.topic, tick) {
                self.in_sample[output.topic].copy_from_slice(&self.in_node[node]);
            }
        }
    }

    fn is_sent(&self, topic: usize, tick: u32) -> bool {
        tick.is_multiple_of(self.flight.plan.topics[topic].period_ticks.max(1))
    }

    fn note(&mut self, command: usize, tick: u32) {
        let topic = self.closing[command];
        if !self.is_sent(topic, tick) {
            return;
        }
        let Some(command_ns) = self.flight.sent_ns(topic, tick) else { return };
        for (source, stamp) in self.in_sample[topic].iter().enumerate() {
            let Some(stamp) = *stamp else { continue };
            let Some(sent_ns) = self.flight.sent_ns(source, stamp) else { continue };
            let (simulated, host) = &mut self.found[command][source];
            simulated.add(u64::from(tick - stamp) * self.flight.plan.tick_ns);
            host.add(command_ns.saturating_sub(sent_ns));
        }
    }

    fn named(self) -> Vec<Age> {
        let name = |topic: usize| self.flight.topic_name(topic).to_owned();
        let commands = self.closing.iter().zip(self.found);
        let ages = commands.flat_map(|(&command, sources)| {
            let sources = sources.into_iter().enumerate().filter(|(_, (_, host))| !host.is_empty());
            sources.map(move |(source, (simulated, host))| Age {
                source: name(source),
                command: name(command),
                simulated,
                host,
            })
        });
        ages.collect()
    }
}

fn keep_older(oldest: &mut Option<u32>, stamp: Option<u32>) {
    *oldest = oldest.iter().chain(&stamp).min().copied();
}
