//! The tick of a live run as it is planned, beside the tick as it goes.
//!
//! The plan of the run, as it was at its start, has hosts, cores and periods. It has the samples of a tick that each node waits for. The last second
//! is read from the control segment and the kernel, as by `hummingbus top`, which disturbs no process.

use bus::computing_time::ComputingTime;
use bus::plan::{NodePlan, Plan};
use report::top::{View, Watcher};
use runtime::run_dir::LiveRun;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex, PoisonError};

/// Looks at a run, from the first request on.
#[derive(Default)]
pub struct Schedule(Mutex<Option<Watcher>>);

impl std::fmt::Debug for Schedule {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Schedule")
    }
}

impl Schedule {
    /// Plan of `run` and the last second of its processes, as JSON; null before the run has a control segment.
    pub fn look(&self, run: &Arc<LiveRun>, plan: &Plan) -> Value {
        let mut watcher = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if watcher.is_none() {
            *watcher = Watcher::open(run).ok();
        }
        watcher.as_mut().map_or(Value::Null, |watcher| described(plan, &watcher.look()))
    }
}

fn described(plan: &Plan, seen: &View) -> Value {
    let nodes = plan.nodes.iter().enumerate().zip(seen.processes.iter().skip(1));
    let nodes = nodes.map(|((index, node), row)| {
        json!({
            "name": node.name,
            // A member's successor has a process of its own.
            "group": row.group,
            "core": plan.group_of(index).filter(|_| row.group.is_some()).map_or(node.cpu, |group| group.cpu),
            "period_ticks": node.period_ticks,
            "computing_time": node.computing_time.as_ref().map(text),
            "after": awaited(plan, node),
            "seen": row,
        })
    });
    json!({
        "tick_us": plan.tick_ns as f64 * 1e-3,
        "pace": seen.status.pace,
        "real_time_factor": seen.real_time_factor,
        "clock": { "core": plan.clock_cpu, "seen": seen.processes.first() },
        "nodes": nodes.collect::<Vec<_>>(),
    })
}

/// Nodes whose samples of the same tick `node` waits for, by their indices.
fn awaited(plan: &Plan, node: &NodePlan) -> Vec<usize> {
    let inputs = node.inputs.iter().filter(|input| input.delay_ticks == 0);
    let mut nodes: Vec<usize> = inputs.map(|input| plan.publisher(input.topic)).collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

/// A computing time in words.
fn text(time: &ComputingTime) -> String {
    match time {
        ComputingTime::Constant { us } => format!("{us} µs"),
        ComputingTime::Uniform { min_us, max_us } => format!("{min_us} to {max_us} µs"),
        ComputingTime::Lognormal { median_us, .. } => format!("median {median_us} µs"),
        ComputingTime::Measured { fraction_us } => {
            format!("measured, up to {} µs", fraction_us.last().map_or(0.0, |[_, us]| *us))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::text;
    use bus::computing_time::ComputingTime;

    #[test]
    fn a_computing_time_is_told_in_words() {
        let measured = ComputingTime::Measured { fraction_us: vec![[0.0, 100.0], [1.0, 1900.0]] };
        let times = [
            ComputingTime::Constant { us: 1500.0 },
            ComputingTime::Uniform { min_us: 1.0, max_us: 2.5 },
            measured,
        ];
        assert_eq!(times.map(|time| text(&time)), ["1500 µs", "1 to 2.5 µs", "measured, up to 1900 µs"]);
    }
}
