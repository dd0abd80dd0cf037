//! Plan and programs of a simulated run, drawn from the seed.

use super::sim::{Draw, NODES, WINDOW};
use crate::graph::Graph;
use crate::program::{BackupSpec, Executable, OnExit, Program, Readiness};
use bus::plan::{InputPlan, NodePlan, OutputPlan, Pace, Plan, TopicPlan, Wait};
use bus::sample_ticks::SampleTicks;
use std::collections::BTreeMap;
use std::time::Duration;

const TICKS: u32 = 60;
/// Longer than all processes may be frozen for a while, and shorter than a run may take to end.
pub(super) const WATCHDOG: Duration = Duration::from_millis(500);

/// A program that is never started.
pub(super) fn program(on_exit: OnExit) -> Program {
    Program {
        executable: Executable::Command(Vec::new()),
        first_word: String::new(),
        environment: Default::default(),
        working_directory: None,
        nice: None,
        realtime_priority: None,
        on_exit,
        watchdog: WATCHDOG,
        ready: Readiness::Started,
        after: Vec::new(),
        log: None,
    }
}

/// `a` and `b` read each other's samples; `c` reads both, their shadows too, as a recorder does.
fn plan(draw: &mut Draw) -> Plan {
    let period_ticks = 1 + draw.below(2) as u32;
    Plan {
        run_id: "0-0".to_owned(),
        seed: 0,
        tick_ns: 1_000_000,
        duration_ticks: TICKS,
        first_tick: 0,
        checkpoint_ticks: Vec::new(),
        checkpoint_period: None,
        window_ticks: WINDOW,
        pace: Pace::Free,
        clock_cpu: None,
        profile: false,
        lock_memory: false,
        groups: Vec::new(),
        topics: vec![topic("/a", 1), topic("/a2", 1), topic("/b", period_ticks)],
        nodes: vec![
            node("a", 1, vec![input(2, 1)], &[0, 1]),
            node("b", period_ticks, vec![input(0, 0)], &[2]),
            node("c", 1, vec![input(0, 0), input(1, 0), input(2, 0)], &[]),
        ],
    }
}

fn topic(name: &str, period_ticks: u32) -> TopicPlan {
    TopicPlan { name: name.to_owned(), type_name: "test".to_owned(), ticks: SampleTicks::every(period_ticks) }
}

fn input(topic: usize, delay_ticks: u32) -> InputPlan {
    InputPlan { port: topic.to_string(), topic, delay_ticks, initial: None }
}

fn node(name: &str, period_ticks: u32, inputs: Vec<InputPlan>, outputs: &[usize]) -> NodePlan {
    NodePlan {
        name: name.to_owned(),
        period_ticks,
        wait: Wait::Block,
        cpu: None,
        inputs,
        outputs: outputs.iter().map(|&topic| OutputPlan { port: "out".to_owned(), topic }).collect(),
        parameters: serde_json::Value::Null,
        files: Vec::new(),
        restarts: true,
        computing_time: None,
        is_recorder: false,
        is_built_in: false,
    }
}

/// A run: its nodes restart, stand by, or end it; swaps and shadows are planned; a sidecar flies beside.
pub(super) fn graph(draw: &mut Draw) -> Graph {
    let plan = plan(draw);
    let (mut programs, mut backups) = (Vec::new(), Vec::new());
    for node in 0..NODES {
        let policies = [OnExit::Restart, OnExit::Restart, OnExit::Standby, OnExit::Stop];
        let on_exit = policies[draw.below(4) as usize];
        programs.push(program(on_exit));
        let backup = |join_tick, take_over_tick, is_standby| BackupSpec {
            node,
            join_tick,
            take_over_tick,
            is_standby,
            with: None,
            program: program(on_exit),
            plan: plan.nodes[node].clone(),
        };
        let join_tick = 2 * (1 + draw.below(20) as u32);
        match (on_exit, draw.below(4)) {
            (OnExit::Standby, _) => backups.push(backup(0, None, true)),
            (_, 0) => {}
            (_, 1) => backups.push(backup(join_tick, None, false)),
            _ => backups.push(backup(join_tick, Some(join_tick + 2 * (1 + draw.below(4) as u32)), false)),
        }
    }
    backups.sort_by_key(|backup| backup.join_tick);
    let sidecars = (0..draw.below(2)).map(|_| {
        let on_exit = [OnExit::Stop, OnExit::Restart, OnExit::Ignore][draw.below(3) as usize];
        let ready = [Readiness::Started, Readiness::Notify][draw.below(2) as usize];
        ("viewer".to_owned(), Program { ready, ..program(on_exit) })
    });
    let sidecars = sidecars.collect();
    let files = bus::InputFiles::default();
    let (models, begun, warnings) = (Vec::new(), BTreeMap::new(), Vec::new());
    Graph { plan, programs, backups, sidecars, models, files, from: None, source: None, begun, warnings }
}
