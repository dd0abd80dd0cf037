//! Requests of a run that its host cannot meet.

use crate::graph::Graph;
use crate::host::{Host, needs_process};
use crate::manifest::Manifest;
use crate::program::{OnExit, Program};
use anyhow::{Result, bail};

/// Refuses a run that `host` cannot fly.
pub(crate) fn require_host(host: &Host, manifest: &Manifest, graph: &Graph) -> Result<()> {
    if matches!(host, Host::Exe(_)) {
        return Ok(());
    }
    for (program, node) in graph.programs.iter().zip(&graph.plan.nodes) {
        host.require(&node.name, program)?;
    }
    for backup in &graph.backups {
        host.require(&backup.plan.name, &backup.program)?;
    }
    let run = &manifest.content.run;
    let core = manifest.content.process.iter().find(|(_, process)| process.cpu.is_some());
    let asked = [
        graph.sidecars.first().map(|(name, _)| format!("process `{name}`: `lockstep = false`")),
        core.map(|(name, _)| format!("process `{}`: `cpu`", name.get_ref())),
        run.clock_cpu.as_ref().map(|_| "`run.clock_cpu`".to_owned()),
        run.lock_memory.then(|| "`run.lock_memory`".to_owned()),
    ];
    match asked.into_iter().flatten().next() {
        Some(key) => Err(needs_process(&key)),
        None if *host == Host::InProcess => require_one_thread(graph),
        None => Ok(()),
    }
}

/// Refuses backups, restarts and profiles, which a run on one thread cannot have.
fn require_one_thread(graph: &Graph) -> Result<()> {
    let replaced = graph.backups.first().map(|backup| format!("another process for `{}`", backup.plan.name));
    let named = |is_asked: fn(&Program) -> bool, what: &str| {
        let node = graph.programs.iter().position(is_asked)?;
        Some(format!("process `{}`: {what}", graph.plan.nodes[node].name))
    };
    let asked = replaced
        .or_else(|| named(|program| program.on_exit == OnExit::Restart, "`on_exit = \"restart\"`"))
        .or_else(|| named(|program| program.on_exit == OnExit::Standby, "`on_exit = \"standby\"`"))
        .or_else(|| graph.plan.profile.then(|| "a profile".to_owned()));
    match asked {
        None => Ok(()),
        Some(what) => {
            bail!("{what} needs processes, and this run is one thread; fly it without `--in-process`")
        }
    }
}
