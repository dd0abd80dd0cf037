//! What a run shows at a moment: read from its control segment and from the kernel, without disturbing it.

use anyhow::{Context, Result};
use bus::host_time::monotonic_ns;
use bus::lockstep::{LiveView, Phase};
use bus::membership::{Membership, NodeInstances};
use bus::plan::Plan;
use bus::step_times::StepTimes;
use runtime::ctl::protocol::{State, Status};
use runtime::run_dir::LiveRun;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a run may take from its registration to its control segment.
const START: Duration = Duration::from_secs(5);
const POLL: Duration = Duration::from_millis(5);

/// A live run that is looked at.
pub struct Source {
    pub plan: Plan,
    pub manifest: PathBuf,
    run: Arc<LiveRun>,
    control: LiveView,
}

/// What a run shows at a moment.
pub struct Sample {
    /// When, by the host's monotonic clock.
    pub at_ns: u64,
    pub status: Status,
    /// The clock's, then the nodes'.
    pub processes: Vec<ProcessSample>,
    pub topics: Vec<TopicSample>,
}

/// What a process shows.
pub struct ProcessSample {
    pub id: Option<u32>,
    pub state: String,
    pub ticks: u32,
    /// Processor time in ticks of the kernel; `None` where the process is gone.
    pub cpu_ticks: Option<u64>,
    pub step_times: Option<StepTimes>,
    pub late: u32,
}

/// What a topic shows.
pub struct TopicSample {
    pub samples: u32,
    pub lost: u32,
}

impl Source {
    /// Opens the control segment of `run`, which may just be starting.
    ///
    /// # Errors
    /// If it ends before it has one.
    pub fn open(run: &Arc<LiveRun>) -> Result<Self> {
        let start = Instant::now();
        loop {
            let plan = Plan::load(&run.entry.run_dir);
            match plan.and_then(|plan| Ok((LiveView::open(&plan)?, plan))) {
                Ok((control, plan)) => {
                    return Ok(Self {
                        plan,
                        manifest: run.entry.manifest.clone(),
                        run: run.clone(),
                        control,
                    });
                }
                Err(_) if run.is_live() && start.elapsed() < START => std::thread::sleep(POLL),
                Err(error) => {
                    return Err(error).with_context(|| format!("run {} has ended", run.entry.run_id));
                }
            }
        }
    }

    /// What the run shows now.
    pub fn sample(&self) -> Sample {
        let mut status = Status::of(&self.plan, &self.control);
        if !self.run.is_live() {
            status.state = State::Ended;
        }
        let clock = self.clock(status.state);
        // While it is being written, or gone with the run, that of the start serves.
        let membership = Membership::load(&self.run.entry.run_dir, self.control.epoch());
        let membership = membership.unwrap_or_else(|_| Membership::first(&self.plan));
        let nodes = membership.nodes.iter().enumerate().map(|(node, own)| self.node(node, own));
        let topics = self.plan.topics.iter().enumerate().map(|(index, topic)| TopicSample {
            samples: self.control.ticks_sent(index).div_ceil(topic.period_ticks),
            lost: self.control.gaps(index),
        });
        let processes = std::iter::once(clock).chain(nodes).collect();
        Sample { at_ns: monotonic_ns(), status, processes, topics: topics.collect() }
    }

    fn clock(&self, state: State) -> ProcessSample {
        let id = self.control.clock_process();
        let kernel = id.and_then(KernelView::of);
        let state = match state {
            State::Starting => "waits for the nodes",
            State::Paused => "holds the run",
            State::Ended => "done",
            _ => "grants ticks",
        };
        ProcessSample {
            id,
            state: kernel.as_ref().and_then(KernelView::trouble).unwrap_or(state).to_owned(),
            ticks: self.control.completed_ticks(),
            cpu_ticks: kernel.map(|kernel| kernel.cpu_ticks),
            step_times: None,
            late: 0,
        }
    }

    fn node(&self, node: usize, instances: &NodeInstances) -> ProcessSample {
        let slot = self.plan.slot(node, instances.primary.generation);
        let id = self.control.process(slot);
        let kernel = id.and_then(KernelView::of);
        let trouble = kernel.as_ref().and_then(KernelView::trouble);
        ProcessSample {
            id,
            state: trouble.map_or_else(|| self.node_state(slot, instances), str::to_owned),
            ticks: self.control.completed_by(slot),
            cpu_ticks: kernel.map(|kernel| kernel.cpu_ticks),
            step_times: Some(self.control.step_times(slot)),
            late: self.control.late_count(slot),
        }
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

/// What the kernel says about a process.
struct KernelView {
    state: char,
    cpu_ticks: u64,
}

impl KernelView {
    fn of(process: u32) -> Option<Self> {
        Self::parse(&std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?)
    }

    /// Reads the line of /proc/PID/stat: the name in brackets may hold anything, brackets and spaces too.
    fn parse(line: &str) -> Option<Self> {
        let mut words = line.rsplit_once(')')?.1.split_whitespace();
        let state = words.next()?.chars().next()?;
        let mut times = words.skip(10).map(|word| word.parse::<u64>().ok());
        Some(Self { state, cpu_ticks: times.next()?? + times.next()?? })
    }

    /// What keeps a process from computing, if the kernel knows of it.
    fn trouble(&self) -> Option<&'static str> {
        match self.state {
            'T' | 't' => Some("STOPPED by a signal"),
            'Z' | 'X' => Some("ended"),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::KernelView;

    #[test]
    fn the_line_of_a_process_is_read_whatever_its_name() {
        let line = "7 (a) b) T 1 7 7 0 -1 4194304 100 0 0 0 12 30 0 0 20 0 1 0 5 1 1 18446744073709551615\n";
        let view = KernelView::parse(line).unwrap();
        assert_eq!((view.cpu_ticks, view.trouble()), (42, Some("STOPPED by a signal")));
        assert!(KernelView::parse("7 (a) T 1").is_none());
    }
}
