//! What two looks at a run say about the time between them.

use crate::top::sample::{ProcessSample, Sample, Source};
use runtime::ctl::protocol::Status;
use serde::Serialize;

/// A run as it is shown.
#[derive(Debug, Serialize)]
pub struct View {
    /// The manifest that it flies.
    pub manifest: String,
    /// How far it has come.
    #[serde(flatten)]
    pub status: Status,
    /// Host time between the looks, in seconds.
    pub span_s: f64,
    /// Simulated time per host time.
    pub real_time_factor: f64,
    /// The clock, then the nodes.
    pub processes: Vec<ProcessRow>,
    /// The topics.
    pub topics: Vec<TopicRow>,
}

/// A process as it is shown.
#[derive(Debug, Serialize)]
pub struct ProcessRow {
    /// Name.
    pub name: String,
    /// Process number.
    pub process: Option<u32>,
    /// What it does or waits for.
    pub state: String,
    /// Ticks that it has completed.
    pub tick: u32,
    /// Processor time per host time; `None` where the process is gone.
    pub cpu_share: Option<f64>,
    /// Median of the time from inputs taken to outputs computed, in microseconds; `None` without steps.
    pub step_p50_us: Option<f64>,
    /// The time that 99 of 100 steps did not exceed.
    pub step_p99_us: Option<f64>,
    /// Deadlines at which it had not finished the tick before.
    pub late: u32,
}

/// A topic as it is shown.
#[derive(Debug, Serialize)]
pub struct TopicRow {
    /// Name.
    pub name: String,
    /// The node that sends it.
    pub publisher: String,
    /// Samples per second of host time.
    pub rate_hz: f64,
    /// Samples since the start.
    pub samples: u32,
    /// Samples that a reader missed: the first one ends the run.
    pub lost: u32,
}

impl View {
    /// What `before` and `after` say about the run of `source`.
    pub fn new(source: &Source, before: &Sample, after: &Sample) -> Self {
        let span_s = after.at_ns.saturating_sub(before.at_ns) as f64 * 1e-9;
        let per_s = |count: u32| if span_s > 0.0 { f64::from(count) / span_s } else { 0.0 };
        let clock = "clock".to_owned();
        let names = std::iter::once(&clock).chain(source.plan.nodes.iter().map(|node| &node.name));
        let processes = names.zip(before.processes.iter().zip(&after.processes));
        let topics = source.plan.topics.iter().zip(before.topics.iter().zip(&after.topics));
        Self {
            manifest: source.manifest.display().to_string(),
            status: after.status.clone(),
            span_s,
            real_time_factor: per_s(after.status.tick.saturating_sub(before.status.tick))
                * source.plan.tick_s(),
            processes: processes
                .map(|(name, (before, after))| ProcessRow::new(name.clone(), before, after, span_s))
                .collect(),
            topics: topics
                .enumerate()
                .map(|(index, (topic, (before, after)))| TopicRow {
                    name: topic.name.clone(),
                    publisher: publisher(source, index),
                    rate_hz: per_s(after.samples.saturating_sub(before.samples)),
                    samples: after.samples,
                    lost: after.lost,
                })
                .collect(),
        }
    }
}

fn publisher(source: &Source, topic: usize) -> String {
    let sends = |node: &&bus::plan::NodePlan| node.outputs.iter().any(|output| output.topic == topic);
    source.plan.nodes.iter().find(sends).map(|node| node.name.clone()).unwrap_or_default()
}

impl ProcessRow {
    fn new(name: String, before: &ProcessSample, after: &ProcessSample, span_s: f64) -> Self {
        let times = before.step_times.as_ref().zip(after.step_times.as_ref());
        let recent = times.map(|(before, after)| after.since(before));
        let percentile_us = |share| recent.as_ref()?.percentile_ns(share).map(|ns| ns * 1e-3);
        Self {
            name,
            process: after.id,
            state: after.state.clone(),
            tick: after.ticks,
            cpu_share: cpu_share(before, after, span_s),
            step_p50_us: percentile_us(0.5),
            step_p99_us: percentile_us(0.99),
            late: after.late,
        }
    }
}

/// Processor time per host time; `None` where another process has come in between.
fn cpu_share(before: &ProcessSample, after: &ProcessSample, span_s: f64) -> Option<f64> {
    let is_same = before.id == after.id && span_s > 0.0;
    let (before, after) = before.cpu_ticks.zip(after.cpu_ticks).filter(|_| is_same)?;
    let used_s = after.saturating_sub(before) as f64 / rustix::param::clock_ticks_per_second() as f64;
    Some(used_s / span_s)
}
