//! Age of the samples that a command rests on when it is sent.

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
    /// Simulated time from the stamp of the oldest sample that goes into a command to the command's own.
    pub simulated: Times,
    /// Host time from the sending of that sample to the sending of the command.
    pub host: Times,
}

/// The ages of all topics in all commands.
pub fn ages(flight: &Flight) -> Vec<Age> {
    let topics = flight.plan.topics.len();
    let (closing, order) = (flight.closing_topics(), flight.in_order());
    // The oldest stamp of each topic that goes into the newest sample of each topic.
    let mut stamps: Vec<Stamps> = vec![vec![None; topics]; topics];
    let none = (Times::in_units(flight.plan.tick_ns), Times::default());
    let mut found = vec![vec![none; topics]; closing.len()];
    for tick in 0..flight.ticks {
        let is_due = |period_ticks: u32| tick.is_multiple_of(period_ticks.max(1));
        let is_sent = |topic: usize| is_due(flight.plan.topics[topic].period_ticks);
        for &node in order.iter().filter(|node| is_due(flight.plan.nodes[**node].period_ticks)) {
            let oldest = oldest(flight, node, tick, &stamps);
            for output in flight.plan.nodes[node].outputs.iter().filter(|output| is_sent(output.topic)) {
                stamps[output.topic].clone_from(&oldest);
            }
        }
        for (&command, found) in closing.iter().zip(&mut found).filter(|(command, _)| is_sent(**command)) {
            let Some(command_ns) = flight.sent_ns(command, tick) else { continue };
            for (source, ((simulated, host), stamp)) in found.iter_mut().zip(&stamps[command]).enumerate() {
                let Some(stamp) = *stamp else { continue };
                let Some(sent_ns) = flight.sent_ns(source, stamp) else { continue };
                simulated.add(u64::from(tick - stamp) * flight.plan.tick_ns);
                host.add(command_ns.saturating_sub(sent_ns));
            }
        }
    }
    let name = |topic: usize| flight.topic_name(topic).to_owned();
    let commands = closing.into_iter().zip(found);
    let ages = commands.flat_map(|(command, sources)| {
        let sources = sources.into_iter().enumerate().filter(|(_, (_, host))| !host.is_empty());
        sources.map(move |(source, times)| (name(source), name(command), times))
    });
    ages.map(|(source, command, (simulated, host))| Age { source, command, simulated, host }).collect()
}

/// A stamp for each topic, where there is one.
type Stamps = Vec<Option<u32>>;

/// The oldest stamps that `node` uses at `tick`, given those in the newest samples.
fn oldest(flight: &Flight, node: usize, tick: u32, in_samples: &[Stamps]) -> Stamps {
    let mut oldest = vec![None; in_samples.len()];
    let mut keep_older =
        |topic: usize, stamp: Option<u32>| oldest[topic] = oldest[topic].iter().chain(&stamp).min().copied();
    for input in flight.inputs(node, tick).iter().filter(|input| input.delay_ticks == 0) {
        let Some(stamp) = flight.stamp(input, tick) else { continue };
        keep_older(input.topic, Some(stamp));
        in_samples[input.topic].iter().enumerate().for_each(|(topic, stamp)| keep_older(topic, *stamp));
    }
    oldest
}
