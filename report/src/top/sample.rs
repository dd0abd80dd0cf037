//! State of a run at a moment: read from its control segment, from the kernel, and from the samples that its recorder copies for watchers.

use crate::top::vehicles::Vehicles;
use crate::top::view::{ProcessRow, TopicRow, View};
use anyhow::{Context, Result};
use bus::BusError;
use bus::host_time::monotonic_ns;
use bus::lockstep::{LiveView, Phase};
use bus::membership::{Membership, NodeInstances};
use bus::plan::{NodePlan, Plan};
use bus::step_times::StepTimes;
use runtime::ctl::protocol::{State, Status};
use runtime::run_dir::LiveRun;
use rustix::param::clock_ticks_per_second;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest time from the registration of a run to its control segment.
const START: Duration = Duration::from_secs(5);
const POLL: Duration = Duration::from_millis(5);

/// A live run that is looked at.
pub struct Source {
    plan: Plan,
    run: Arc<LiveRun>,
    control: LiveView,
    vehicles: Vehicles,
}

/// State of a run at a moment.
pub struct Sample {
    /// Time, by the host's monotonic clock.
    at_ns: u64,
    /// The run; values that need two looks, such as rates, are missing.
    view: View,
    /// Processor time in ticks of the kernel, `None` if the process is gone, and times of the steps, by process.
    used: Vec<(Option<u64>, Option<StepTimes>)>,
}

impl Source {
    /// Opens the control segment of `run`, which may just be starting.
    ///
    /// # Errors
    /// If it ends before it has one.
    pub fn open(run: &Arc<LiveRun>) -> Result<Self> {
        let open = || {
            let plan = Plan::load(&run.entry.run_dir)?;
            let (control, vehicles) = (LiveView::open(&plan)?, Vehicles::of(run, &plan));
            Ok::<_, BusError>(Self { control, vehicles, plan, run: run.clone() })
        };
        let start = Instant::now();
        let mut source = open();
        while source.is_err() && run.is_live() && start.elapsed() < START {
            std::thread::sleep(POLL);
            source = open();
        }
        source.with_context(|| {
            format!("run {} has ended, or flies on one thread (--in-process)", run.entry.run_id)
        })
    }

    /// State of the run now.
    pub fn sample(&mut self) -> Sample {
        let vehicles = self.vehicles.look();
        let mut status = Status::of(&self.plan, &self.control);
        if !self.run.is_live() {
            status.state = State::Ended;
        }
        let clock = self.clock(status.state);
        // While it is being written, or gone with the run, that of the start serves.
        let membership = Membership::load(&self.run.entry.run_dir, self.control.epoch());
        let membership = membership.unwrap_or_else(|_| Membership::first(&self.plan));
        let nodes = membership.nodes.iter().enumerate();
        let nodes = nodes.map(|(node, instances)| self.node(node, instances));
        let (processes, used) = std::iter::once(clock).chain(nodes).unzip();
        let topics = (0..self.plan.topics.len()).map(|index| self.topic(index)).collect();
        let manifest = self.run.entry.manifest.display().to_string();
        let view = View { manifest, status, span_s: 0.0, real_time_factor: 0.0, vehicles, processes, topics };
        Sample { at_ns: monotonic_ns(), view, used }
    }

    /// View of the run with the rates between `before` and `after`.
    pub fn between(&self, before: &Sample, after: &Sample) -> View {
        let mut view = after.view.clone();
        view.span_s = after.at_ns.saturating_sub(before.at_ns) as f64 * 1e-9;
        let per_s = |count: f64| if view.span_s > 0.0 { count / view.span_s } else { 0.0 };
        let ticks = after.view.status.tick.saturating_sub(before.view.status.tick);
        view.real_time_factor = per_s(f64::from(ticks)) * self.plan.tick_s();
        for (topic, before) in view.topics.iter_mut().zip(&before.view.topics) {
            topic.rate_hz = per_s(f64::from(topic.samples.saturating_sub(before.samples)));
        }
        let rows = view.processes.iter_mut().zip(&before.view.processes);
        for ((row, last), (before, after)) in rows.zip(before.used.iter().zip(&after.used)) {
            // Not where another process has come in between.
            let is_same = row.process == last.process && view.span_s > 0.0;
            let used = before.0.zip(after.0).filter(|_| is_same);
            row.cpu_share = used.map(|(before, after)| {
                per_s(after.saturating_sub(before) as f64 / clock_ticks_per_second() as f64)
            });
            let steps = before.1.as_ref().zip(after.1.as_ref()).map(|(before, after)| after.since(before));
            let percentile_us = |share| steps.as_ref()?.percentile_ns(share).map(|ns| ns * 1e-3);
            (row.step_p50_us, row.step_p99_us) = (percentile_us(0.5), percentile_us(0.99));
        }
        view
    }

    fn topic(&self, index: usize) -> TopicRow {
        let topic = &self.plan.topics[index];
        let sends = |node: &&NodePlan| node.outputs.iter().any(|output| output.topic == index);
        let publisher = self.plan.nodes.iter().find(sends).map(|node| node.name.clone());
        let samples = topic.ticks.first_sequence(self.control.ticks_sent(index));
        TopicRow {
            name: topic.name.clone(),
            publisher: publisher.unwrap_or_default(),
            rate_hz: 0.0,
            samples: u32::try_from(samples).unwrap_or(u32::MAX),
            lost: self.control.gaps(index),
        }
    }

    fn clock(&self, state: State) -> (ProcessRow, (Option<u64>, Option<StepTimes>)) {
        let state = match state {
            State::Starting => "waits for the nodes",
            State::Paused => "holds the run",
            State::Ended => "done",
            _ => "grants ticks",
        };
        let (id, tick) = (self.control.clock_process(), self.control.completed_ticks());
        let (row, cpu_ticks) = process("clock", id, tick, state.to_owned());
        (row, (cpu_ticks, None))
    }

    fn node(&self, node: usize, instances: &NodeInstances) -> (ProcessRow, (Option<u64>, Option<StepTimes>)) {
        let slot = self.plan.slot(node, instances.primary.generation);
        let (id, tick) = (self.control.process(slot), self.control.completed_by(slot));
        let name = &self.plan.nodes[node].name;
        let (mut row, cpu_ticks) = process(name, id, tick, self.node_state(slot, instances));
        // A member's successor has a process of its own.
        let group = self.plan.group_of(node).filter(|_| instances.primary.generation == 0);
        row.group = group.map(|group| group.name.clone());
        row.late = self.control.late_count(slot);
        (row, (cpu_ticks, Some(self.control.step_times(slot))))
    }

    fn node_state(&self, slot: usize, instances: &NodeInstances) -> String {
        let awaited = self.control.awaited_topic(&self.plan, slot, &instances.primary.plan.inputs);
        let state = match awaited {
            _ if self.control.phase() != Phase::Running => "connects".to_owned(),
            _ if self.control.has_completed(slot) => "done".to_owned(),
            Some(topic) => format!("waits for {}", self.plan.topics[topic].name),
            None if self.control.awaits_grant(slot) => "waits for grant".to_owned(),
            None => "computes".to_owned(),
        };
        match &instances.backup {
            Some(backup) => format!("{state}, shadowed by .{}", backup.generation),
            None => state,
        }
    }
}

/// A process and its processor time; `state` is its activity if no obstacle keeps it from computing.
fn process(name: &str, process: Option<u32>, tick: u32, state: String) -> (ProcessRow, Option<u64>) {
    let stat = process.and_then(|process| std::fs::read_to_string(format!("/proc/{process}/stat")).ok());
    let (trouble, cpu_ticks) = stat.and_then(|line| kernel_view(&line)).unzip();
    let state = trouble.flatten().map_or(state, str::to_owned);
    (ProcessRow { name: name.to_owned(), process, state, tick, ..ProcessRow::default() }, cpu_ticks)
}

/// Obstacle that keeps a process from computing, and its processor time, from the line of /proc/PID/stat. The name in
/// brackets may hold any characters, brackets and spaces too.
fn kernel_view(line: &str) -> Option<(Option<&'static str>, u64)> {
    let mut fields = line.rsplit_once(')')?.1.split_whitespace();
    let trouble = match fields.next()? {
        "T" | "t" => Some("STOPPED by a signal"),
        "Z" | "X" => Some("ended"),
        _ => None,
    };
    let mut times = fields.skip(10).map(|field| field.parse::<u64>().ok());
    Some((trouble, times.next()?? + times.next()??))
}

#[cfg(test)]
mod tests {
    use super::kernel_view;

    #[test]
    fn the_line_of_a_process_is_read_whatever_its_name() {
        let line = "7 (a) b) T 1 7 7 0 -1 4194304 100 0 0 0 12 30 0 0 20 0 1 0 5 1 1 18446744073709551615\n";
        assert_eq!(kernel_view(line), Some((Some("STOPPED by a signal"), 42)));
        assert_eq!(kernel_view("7 (a) T 1"), None);
    }
}
