//! Age of the samples that a command rests on when it is sent.

use crate::profile::times::Times;
use recorder::RecordingError;
use recorder::reader::Recording;
use runtime::flight::Flight;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Field of the messages that state when they were measured.
const MEASURED: &str = "measured_ns";

/// The age of one topic's samples in the commands of another.
#[derive(Debug, Serialize)]
pub struct Age {
    /// The topic that the command depends on without a delay, directly or over other nodes.
    pub source: String,
    /// The topic that closes a feedback loop.
    pub command: String,
    /// Simulated time from the oldest sample that goes into a command to the stamp of the command: from the time at which the
    /// sample was measured if its message states that, else from its stamp.
    pub simulated: Times,
    /// Host time from the sending of that sample to the sending of the command.
    pub host: Times,
}

/// Times at which the samples of a run were measured, as their messages state them: in ns of simulated time by tick, by topic.
#[derive(Debug, Default)]
pub struct Measured(BTreeMap<usize, BTreeMap<u32, u64>>);

impl Measured {
    /// Reads the times from the recording of `flight` at `path`; none of topics that are not recorded.
    ///
    /// # Errors
    /// If the recording is damaged.
    pub fn read(flight: &Flight, path: &Path) -> Result<Self, RecordingError> {
        let recording = Recording::open(path)?;
        let states_it = |topic: &&str| recording.parts(topic, MEASURED).is_ok();
        let names = (0..flight.plan.topics.len()).map(|topic| flight.topic_name(topic));
        let topics: Vec<&str> = names.filter(states_it).collect();
        if topics.is_empty() {
            return Ok(Self::default());
        }
        let fields: Vec<(&str, &str)> = topics.iter().map(|topic| (*topic, MEASURED)).collect();
        let series = recording.series(&fields)?;
        let of_topic = |(name, series): (&str, recorder::series::Series)| {
            let topic = (0..flight.plan.topics.len()).find(|topic| flight.topic_name(*topic) == name)?;
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "ticks and ns of a run"
            )]
            let at = |(time_ns, measured_ns): (u64, f64)| {
                ((time_ns / flight.plan.tick_ns) as u32, measured_ns as u64)
            };
            Some((topic, series.time_ns.into_iter().zip(series.value).map(at).collect()))
        };
        Ok(Self(topics.into_iter().zip(series).filter_map(of_topic).collect()))
    }

    #[cfg(test)]
    pub(super) fn of(topic: usize, times: &[(u32, u64)]) -> Self {
        Self(BTreeMap::from([(topic, times.iter().copied().collect())]))
    }

    /// Time at which the sample of `topic` with the stamp of `tick` was measured; that of the stamp if it is not known.
    fn at(&self, topic: usize, tick: u32, tick_ns: u64) -> u64 {
        let measured = self.0.get(&topic).and_then(|times| times.get(&tick)).copied();
        measured.unwrap_or_else(|| u64::from(tick) * tick_ns)
    }
}

/// The ages of all topics in all commands; `measured` are the times of the measurements.
pub fn ages(flight: &Flight, measured: &Measured) -> Vec<Age> {
    let topics = flight.plan.topics.len();
    let (closing, order) = (flight.closing_topics(), flight.in_order());
    // The oldest stamp of each topic that goes into the newest sample of each topic.
    let mut stamps: Vec<Stamps> = vec![vec![None; topics]; topics];
    let none = (Times::in_units(flight.plan.tick_ns), Times::default());
    let mut found = vec![vec![none; topics]; closing.len()];
    for tick in 0..flight.ticks {
        let computes = |node: usize| tick.is_multiple_of(flight.plan.nodes[node].period_ticks.max(1));
        let is_sent = |topic: usize| flight.plan.topics[topic].ticks.is_due(tick);
        for &node in order.iter().filter(|node| computes(**node)) {
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
                let (now_ns, tick_ns) = (u64::from(tick) * flight.plan.tick_ns, flight.plan.tick_ns);
                simulated.add(now_ns.saturating_sub(measured.at(source, stamp, tick_ns)));
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
