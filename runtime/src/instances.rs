//! Processes that a run has started in the places of others. A checkpoint names by them the process that flies each node.

use crate::graph::Graph;
use crate::program::{BackupSpec, Origin, Program};
use anyhow::{Context as _, Result, bail};
use bus::checkpoint::Parts;
use bus::lockstep::TransferOutcome;
use bus::membership::Membership;
use bus::plan::{NodePlan, Plan};
use inputs::InputFile;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;

/// Processes of a node after which a planned one is long gone, with its parts of checkpoints.
const GONE_AFTER: u32 = 4;

/// Swap under way that was requested in flight.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Requested {
    /// Name of the node.
    pub node: String,
    /// Keys of the backup, as TOML.
    pub with: String,
    /// The tick from which on the backup flies.
    pub take_over_tick: u32,
}

/// Processes at the tick of a checkpoint.
#[derive(Debug, Default)]
pub(crate) struct Flown {
    /// Origin and program of each node.
    pub processes: Vec<(Origin, Program)>,
    /// Swaps under way that were requested in flight.
    pub requested: Vec<Requested>,
    /// Files that backups requested in flight have read.
    pub files: Vec<InputFile>,
}

/// Processes that the run has started in the places of others.
#[derive(Debug, Default)]
pub(crate) struct Instances(RefCell<Vec<Started>>);

#[derive(Debug)]
struct Started {
    generation: u32,
    spec: BackupSpec,
    /// Ticks at which it joined and takes over; `None` before it joins.
    ticks: Option<(u32, u32)>,
    /// True if it goes on from the state of its predecessor.
    has_state: bool,
    /// True if it was a backup and has left without a take-over.
    is_refused: bool,
}

impl Instances {
    /// Notes that the process `generation` of the node of `spec` is started.
    pub fn note_start(&self, generation: u32, spec: &BackupSpec) {
        let (spec, ticks) = (spec.clone(), None);
        self.0.borrow_mut().push(Started { generation, spec, ticks, has_state: false, is_refused: false });
    }

    /// Notes the ticks of the backups in `membership`, and forgets planned processes of which no part is still to be written.
    pub fn note_membership(&self, membership: &Membership) {
        let mut all = self.0.borrow_mut();
        all.retain(|Started { generation, spec, .. }| {
            spec.with.is_some() || generation + GONE_AFTER > membership.nodes[spec.node].primary.generation
        });
        for started in &mut *all {
            let node = &membership.nodes[started.spec.node];
            let backup = node.backup.as_ref().filter(|backup| backup.generation == started.generation);
            match backup {
                Some(backup) => started.ticks = Some((backup.join_tick, node.take_over_tick)),
                None => {
                    started.is_refused |=
                        started.ticks.is_some() && node.primary.generation < started.generation;
                }
            }
        }
    }

    /// Notes how the process in `slot` of the run of `plan`, which joins, was given its state.
    pub fn note_transfer(&self, plan: &Plan, slot: usize, transfer: TransferOutcome) {
        let mut all = self.0.borrow_mut();
        let is_in = |started: &&mut Started| plan.slot(started.spec.node, started.generation) == slot;
        if let Some(started) = all.iter_mut().rev().find(is_in) {
            started.has_state = transfer == TransferOutcome::State;
        }
    }

    /// The processes that have written `parts` of the run of `graph`.
    ///
    /// # Errors
    /// As [`Instances::flying`] and [`Instances::requested`].
    pub fn flown(&self, graph: &Graph, parts: &Parts) -> Result<Flown> {
        let processes = parts.nodes.iter().enumerate();
        let processes = processes.map(|(node, part)| self.flying(graph, node, part.generation, parts.tick));
        let all = self.0.borrow();
        let requested = all.iter().map(|started| &started.spec).filter(|spec| spec.with.is_some());
        let files = requested.flat_map(|spec| spec.plan.files.clone()).collect();
        Ok(Flown { processes: processes.collect::<Result<_>>()?, requested: self.requested(parts)?, files })
    }

    /// Origin and program of the process `generation` of `node`, which flies at `tick` of the run of `graph`.
    ///
    /// # Errors
    /// If no process of the manifest and of the requests is the same.
    fn flying(&self, graph: &Graph, node: usize, generation: u32, tick: u32) -> Result<(Origin, Program)> {
        let backups = || graph.backups.iter().filter(|backup| backup.node == node && !backup.is_shadow());
        let done = backups().rfind(|backup| backup.has_taken_over(tick));
        let of_first = match graph.begun.get(&node) {
            None if done.is_none() => Origin::Plan,
            None => Origin::First,
            Some(Origin::Swap(at)) if done.is_none() && *at < tick => Origin::Plan,
            Some(origin) => origin.clone(),
        };
        let (first_plan, first) = (&graph.plan.nodes[node], &graph.programs[node]);
        if generation == 0 {
            return Ok((of_first, first.clone()));
        }
        let all = self.0.borrow();
        let is_it = |started: &&Started| (started.spec.node, started.generation) == (node, generation);
        let name = &first_plan.name;
        let found = all.iter().find(is_it).with_context(|| format!("`{name}.{generation}` is unknown"))?;
        let is_same = |plan: &NodePlan, program: &Program| {
            found.spec.plan.computes_as(plan) && found.spec.program.is_same(program)
        };
        let origin = if let Some(done) = done.filter(|done| is_same(&done.plan, &done.program)) {
            if done.with.is_some() { Origin::of(done) } else { Origin::Plan }
        } else if is_same(first_plan, first) {
            of_first
        } else {
            let requested = all.iter().map(|started| &started.spec).filter(|spec| spec.with.is_some());
            let mut candidates = backups().chain(requested);
            let same = candidates.find(|backup| is_same(&backup.plan, &backup.program));
            Origin::of(same.with_context(|| format!("nothing names the process `{name}.{generation}`"))?)
        };
        Ok((origin, found.spec.program.clone()))
    }

    /// The swaps under way at the tick of `parts` that were requested in flight.
    ///
    /// # Errors
    /// If a backup on the way in does not go on from the state of its predecessor: no part holds its own.
    fn requested(&self, parts: &Parts) -> Result<Vec<Requested>> {
        let tick = parts.tick;
        let mut requested = Vec::new();
        for Started { generation, spec, ticks, has_state, is_refused } in &*self.0.borrow() {
            let Some((join_tick, take_over_tick)) = ticks.filter(|_| !is_refused) else { continue };
            let part = &parts.nodes[spec.node];
            if take_over_tick == u32::MAX || take_over_tick < tick {
                continue;
            }
            let has_written = part.generation == *generation;
            let is_under_way = join_tick < tick && !spec.is_standby && !has_written;
            if (has_written || is_under_way) && !has_state {
                bail!(
                    "another process joins `{}` at tick {join_tick} and takes over at tick {take_over_tick}, and it does not go on \
                     from the state of the process before: a checkpoint lies before the one or behind the other",
                    part.name
                );
            }
            if let (true, Some(with)) = (is_under_way, &spec.with) {
                let (node, with) = (part.name.clone(), with.clone());
                requested.push(Requested { node, with, take_over_tick });
            }
        }
        Ok(requested)
    }
}
