//! A checked manifest as text and as JSON.

use crate::graph::Graph;
use crate::program::{BackupSpec, Executable, OnExit, Program, Readiness};
use bus::plan::Pace;
use diagnostics::nine_decimals;
use std::fmt;

/// Replacements between the first and the last that are listed one by one.
const REPLACEMENTS_SHOWN: usize = 4;

/// The graph of a run: nodes with their rates, edges with their delays.
impl fmt::Display for Graph {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plan = &self.plan;
        let rate_hz = 1e9 / plan.tick_ns as f64;
        let pace = match plan.pace {
            Pace::Free => "free".to_owned(),
            Pace::Factor(factor) => format!("{factor} × real time"),
        };
        writeln!(
            f,
            "{} ticks at {rate_hz} Hz ({} s), pace {pace}, window {} ticks, seed {}",
            plan.duration_ticks,
            nine_decimals(f64::from(plan.duration_ticks) * plan.tick_s()),
            plan.window_ticks,
            plan.seed
        )?;
        for group in &plan.groups {
            let members = group.members.iter().map(|member| plan.nodes[member.node].name.as_str());
            let cpu = group.cpu.map_or(String::new(), |cpu| format!(", cpu {cpu}"));
            writeln!(
                f,
                "group {}: {}, one process{cpu}",
                group.name,
                members.collect::<Vec<_>>().join(", ")
            )?;
        }
        for (index, (node, program)) in plan.nodes.iter().zip(&self.programs).enumerate() {
            let cpu = node.cpu.map_or(String::new(), |cpu| format!(", cpu {cpu}"));
            let (what, hz) = (what(program), rounded(rate_hz / f64::from(node.period_ticks)));
            let wait = serde_json::json!(node.wait);
            writeln!(f, "\n{} ({what}), {hz} Hz{cpu}, {}", node.name, wait.as_str().unwrap_or_default())?;
            for input in &node.inputs {
                let topic = &plan.topics[input.topic];
                let delay = if input.delay_ticks == 0 { "" } else { ", delayed by 1 tick" };
                // A recorder's ports are called like their topics.
                let port = if input.port == topic.name { "" } else { &input.port };
                writeln!(f, "  <- {port:<12} {} [{}]{delay}", topic.name, topic.type_name)?;
            }
            for output in &node.outputs {
                let topic = &plan.topics[output.topic];
                let hz = rounded(rate_hz / topic.ticks.mean());
                writeln!(f, "  -> {:<12} {} [{}] {hz} Hz", output.port, topic.name, topic.type_name)?;
            }
            f.write_str(&replacements(self, index))?;
        }
        self.sidecars.iter().try_for_each(|(name, program)| {
            let ready = match program.ready {
                Readiness::Started => "",
                Readiness::Notify => "; tick 0 waits until it says that it is ready",
            };
            let end = match program.on_exit {
                OnExit::Restart => "; if it ends with an error, it is started again",
                OnExit::Ignore => "; if it ends with an error, the run goes on",
                OnExit::Stop | OnExit::Standby => "; if it ends with an error, so does the run",
            };
            let after = if program.after.is_empty() {
                String::new()
            } else {
                format!("; starts when {} is ready", program.after.join(", "))
            };
            writeln!(f, "\n{name} ({}), takes no part in the ticks{after}{ready}{end}", what(program))
        })
    }
}

/// A rate with three digits behind the point at most.
fn rounded(hz: f64) -> f64 {
    (hz * 1e3).round() / 1e3
}

fn what(program: &Program) -> String {
    match &program.executable {
        Executable::Component(kind) => kind.name.to_owned(),
        Executable::Program(kind) => kind.name.to_owned(),
        Executable::Command(args) => args.join(" "),
    }
}

/// Text about the backups of a node, and about the consequence of its end.
fn replacements(graph: &Graph, node: usize) -> String {
    let mut text = match graph.programs[node].on_exit {
        OnExit::Restart => "  if it ends, it is started again\n".to_owned(),
        OnExit::Stop | OnExit::Standby | OnExit::Ignore => String::new(),
    };
    let backups = graph.backups.iter().filter(|backup| backup.node == node);
    let line = |backup: &BackupSpec| {
        let (what, join_tick) = (what(&backup.program), backup.join_tick);
        match backup.take_over_tick {
            Some(tick) => {
                format!("  succeeded by {what} at tick {tick}, shadowing from tick {join_tick} on\n")
            }
            None if backup.is_standby => format!("  if it ends, {what} is promoted, which shadows it\n"),
            None => format!("  shadowed by {what}\n"),
        }
    };
    let lines: Vec<String> = backups.map(line).collect();
    match lines.as_slice() {
        [first, between @ .., last] if between.len() > REPLACEMENTS_SHOWN => {
            text += &format!("{first}  and {} more times\n{last}", between.len());
        }
        lines => text += &lines.concat(),
    }
    text
}

impl Graph {
    /// The graph as JSON: the plan, the backups, and the sidecars.
    pub fn json(&self) -> serde_json::Value {
        let backup = |backup: &BackupSpec| {
            serde_json::json!({
                "process": self.plan.nodes[backup.node].name,
                "what": what(&backup.program),
                "join_tick": backup.join_tick,
                "take_over_tick": backup.take_over_tick,
                "is_standby": backup.is_standby,
                "plan": backup.plan,
            })
        };
        let mut value = serde_json::to_value(&self.plan).unwrap_or_default();
        for (index, program) in self.programs.iter().enumerate() {
            value["nodes"][index]["what"] = what(program).into();
        }
        value["backups"] = self.backups.iter().map(backup).collect();
        value["warnings"] = serde_json::to_value(&self.warnings).unwrap_or_default();
        value["sidecars"] = self.sidecars.iter().map(|(name, _)| name.clone()).collect();
        value
    }
}
