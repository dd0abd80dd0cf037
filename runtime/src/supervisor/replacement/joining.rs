//! Backups on the way in: their processes start, and join where the clock waits.

use super::{Backup, Join, Pending, Purpose, Replacements, Report, Stage, next_take_over};
use bus::lockstep::{Phase, SlotState, TransferOutcome};
use bus::membership::Instance;
use diagnostics::Error;
use std::collections::VecDeque;
use std::time::Duration;

/// Reason to refuse a swap that was requested in flight.
const TOO_LATE: &str =
    "after so many ticks of shadowing, no tick at which it could take over is left before the end of the run";

impl Replacements<'_> {
    /// The backup on which the run waits, because it has not joined yet: node, generation, stage and when that
    /// began. One that is early for its tick, or prepares while the run flies, holds nothing up.
    pub(crate) fn joining(&self) -> Option<(usize, u32, Stage, Duration)> {
        let backups = self.nodes.iter().enumerate();
        let awaited = backups.filter_map(|(node, nodes)| {
            let backup = nodes.backup.as_ref()?;
            let is_awaited = match (backup.stage, backup.pending.join) {
                (Stage::Starting, Join::At(tick)) => self.view.held_at == Some(tick),
                (Stage::Starting, Join::Next { .. }) => false,
                (Stage::Starting, Join::AtOnce) | (Stage::Joining | Stage::Announced, _) => true,
                (Stage::Shadowing | Stage::Retiring, _) => false,
            };
            is_awaited.then_some((node, backup.generation, backup.stage, backup.stage_began))
        });
        // Those that only start wait for the one that is on the way in.
        awaited.max_by_key(|&(.., stage, _)| stage > Stage::Starting)
    }

    /// The tick at which the clock must wait for a backup to join; `u32::MAX` if none is awaited.
    pub(crate) fn hold_tick(&self) -> u32 {
        let backups = self.nodes.iter().filter_map(|nodes| {
            let backup = nodes.backup.as_ref().filter(|c| c.stage < Stage::Shadowing)?;
            match backup.pending.join {
                Join::At(tick) => Some(tick),
                Join::Next { .. } => self.is_prepared(backup).then(|| self.next_boundary(backup)),
                Join::AtOnce => None,
            }
        });
        let pending = self.pending.iter().filter_map(|pending| match pending.join {
            // The replacement of a dead process comes first, even if the run passes the tick.
            Join::At(_) if self.is_recovering(pending.spec.node) => None,
            Join::At(tick) => Some(tick),
            Join::Next { .. } | Join::AtOnce => None,
        });
        backups.chain(pending).min().unwrap_or(u32::MAX)
    }

    /// True if the place of a dead process of `node` has just been taken.
    pub(super) fn is_recovering(&self, node: usize) -> bool {
        self.nodes[node].backup.as_ref().is_some_and(|backup| {
            let is_recovery = matches!(backup.pending.purpose, Purpose::Restart | Purpose::Standby);
            is_recovery && (self.nodes[node].is_vacant || backup.stage == Stage::Retiring)
        })
    }

    /// Tick at which the clock must wait for a backup: the current hold, or the next period of the node.
    pub(super) fn next_boundary(&self, backup: &Backup) -> u32 {
        let period = backup.pending.spec.plan.period_ticks;
        self.view.held_at.map_or(0, |held| held.next_multiple_of(period))
    }

    /// A node whose backup was to join at a tick that the run has passed.
    pub(crate) fn too_late(&self) -> Option<usize> {
        let held = self.view.held_at?;
        self.nodes.iter().position(|nodes| {
            nodes.backup.as_ref().is_some_and(|backup| {
                backup.stage == Stage::Starting
                    && matches!(backup.pending.join, Join::At(tick) if tick < held)
            })
        })
    }

    pub(super) fn is_prepared(&self, backup: &Backup) -> bool {
        let slot = self.slot(backup.pending.spec.node, backup.generation);
        self.view.is_ready(slot, Phase::Connecting)
    }

    pub(super) fn start_pending(&mut self) {
        let mut waiting = VecDeque::new();
        while let Some(pending) = self.pending.pop_front() {
            let node = pending.spec.node;
            let is_first = waiting.iter().all(|other: &Pending| other.spec.node != node);
            if self.nodes[node].backup.is_none() && is_first {
                self.start_backup(pending);
            } else {
                waiting.push_back(pending);
            }
        }
        self.pending = waiting;
    }

    pub(super) fn start_backup(&mut self, pending: Pending) {
        let node = pending.spec.node;
        // A backup that failed leaves its generation unused, and its slot is the primary's other one.
        let primary = self.membership.nodes[node].primary.generation;
        let next = self.nodes[node].newest_generation + 1;
        let is_other_slot = self.slot(node, next) != self.slot(node, primary);
        let generation = if is_other_slot { next } else { next + 1 };
        let name = self.plan.nodes[node].name.clone();
        self.view.clear_slot(self.slot(node, generation));
        self.nodes[node].newest_generation = generation;
        let report = Report {
            process: name.clone(),
            generation,
            purpose: pending.purpose,
            is_planned: pending.is_planned,
            request: pending.request,
            join_tick: None,
            take_over_tick: None,
            hand_over: None,
            start_ms: 0.0,
            hold_ms: 0.0,
            refused: None,
            inputs: pending.spec.plan.inputs.clone(),
        };
        self.view.spawn(node, generation, &pending.spec);
        self.nodes[node].backup = Some(Backup {
            pending,
            generation,
            stage: Stage::Starting,
            started: self.view.now,
            stage_began: self.view.now,
            spawned: self.view.host,
            held_since: None,
            retired: None,
            report,
        });
    }

    /// The process of the backup of `node` could not be started. Where no other instance can go on, that is an error.
    pub(crate) fn note_not_started(
        &mut self,
        node: usize,
        generation: u32,
        error: anyhow::Error,
    ) -> anyhow::Result<()> {
        let is_it = |backup: &mut Backup| backup.generation == generation;
        let Some(backup) = self.nodes[node].backup.take_if(is_it) else { return Ok(()) };
        if backup.pending.purpose == Purpose::Restart {
            let name = &self.plan.nodes[node].name;
            return Err(error.context(format!("process `{name}` has ended, and cannot be started again")));
        }
        self.free(node, generation);
        let refused = Some(Error::from(error).with_causes());
        self.reports.push(Report { refused, ..backup.report });
        Ok(())
    }

    /// A backup whose process has not come up in its time: node and generation.
    pub(crate) fn unprepared(&self) -> Option<(usize, u32)> {
        self.nodes.iter().enumerate().find_map(|(node, nodes)| {
            let backup = nodes.backup.as_ref().filter(|backup| backup.stage == Stage::Starting)?;
            let is_late = self.view.since(backup.started) > backup.pending.spec.program.watchdog;
            (is_late && !self.is_prepared(backup)).then_some((node, backup.generation))
        })
    }

    /// Takes back a backup that has not joined yet: its process is ended, and it waits for its turn again.
    pub(crate) fn postpone(&mut self, node: usize) {
        if self.stage(node) != Some(Stage::Starting) {
            return;
        }
        if let Some(backup) = self.nodes[node].backup.take() {
            self.view.kill(node, backup.generation);
            self.free(node, backup.generation);
            self.pending.push_front(backup.pending);
        }
    }

    /// Notes when the backup of `node` was prepared, and since when the run waits for it.
    pub(super) fn note_start(&mut self, node: usize) {
        let Some(backup) = &self.nodes[node].backup else { return };
        if backup.stage != Stage::Starting {
            return;
        }
        let host = self.view.host;
        let (is_prepared, is_awaited) = (self.is_prepared(backup), self.is_at_join(backup));
        let Some(backup) = &mut self.nodes[node].backup else { return };
        if is_prepared && backup.report.start_ms == 0.0 {
            backup.report.start_ms = milliseconds(host.saturating_sub(backup.spawned));
        }
        if is_awaited {
            backup.held_since.get_or_insert(host);
        }
    }

    pub(super) fn is_at_join(&self, backup: &Backup) -> bool {
        match (backup.pending.join, self.view.held_at) {
            (Join::At(tick), Some(held)) => held == tick,
            (Join::Next { .. }, Some(held)) => held.is_multiple_of(backup.pending.spec.plan.period_ticks),
            (Join::AtOnce, _) => true,
            (_, None) => false,
        }
    }

    /// Ticks at which the backup of `node` joins now and takes over: `u32::MAX` for one that does not take over by the clock, and `None` if the
    /// run ends before.
    fn ticks_of(&self, node: usize, backup: &Backup) -> Option<(u32, u32)> {
        let at = self.view.held_at.unwrap_or_default();
        Some(match backup.pending.join {
            Join::At(tick) => (tick, backup.pending.spec.take_over_tick.unwrap_or(u32::MAX)),
            Join::Next { shadow_ticks: None } => (at, u32::MAX),
            Join::Next { shadow_ticks: Some(ticks) } => {
                (at, next_take_over(self.plan, node, at.checked_add(ticks.max(1))?)?)
            }
            Join::AtOnce => {
                let primary = self.slot(node, self.membership.nodes[node].primary.generation);
                (self.view.slots[primary].done, self.view.slots[primary].done)
            }
        })
    }

    /// The clock waits at the tick: the backup may connect its inputs.
    pub(super) fn let_join(&mut self, node: usize) {
        let Some(ticks) = self.nodes[node].backup.as_ref().map(|backup| self.ticks_of(node, backup)) else {
            return;
        };
        let Some((join_tick, take_over_tick)) = ticks else {
            // A checkpoint would have to name a tick for it.
            self.refuse(node, TOO_LATE.to_owned());
            return;
        };
        let Some(backup) = &mut self.nodes[node].backup else { return };
        let (plan, view) = (self.plan, &mut self.view);
        let spec = &backup.pending.spec;
        let outputs = &spec.plan.outputs;
        let shadows = backup.pending.join != Join::AtOnce;
        let membership = &mut self.membership.nodes[node];
        membership.take_over_tick = take_over_tick;
        membership.take_over_ticks = if shadows {
            vec![take_over_tick; outputs.len()]
        } else {
            outputs.iter().map(|output| view.sent[output.topic]).collect()
        };
        let slot = plan.slot(node, backup.generation);
        for (output, &take_over_tick) in outputs.iter().zip(&membership.take_over_ticks) {
            // The next tick at which a shadow sample is due; one that does not shadow sends none.
            let due = plan.topics[output.topic].ticks.next(join_tick);
            view.start_shadow(output.topic, if shadows { due } else { take_over_tick });
        }
        view.set_first_tick(slot, join_tick);
        membership.backup =
            Some(Instance { generation: backup.generation, join_tick, shadows, plan: spec.plan.clone() });
        debug_assert_eq!(self.membership.epoch, view.epoch, "a membership was not published");
        self.membership.epoch += 1;
        view.store(&self.membership);
        backup.report.join_tick = Some(join_tick);
        backup.stage = Stage::Joining;
        view.set_slot_state(slot, SlotState::Joining);
    }

    /// The backup has connected: every instance connects to it.
    pub(super) fn announce(&mut self, node: usize) {
        self.view.set_epoch(self.membership.epoch);
        if let Some(backup) = &mut self.nodes[node].backup {
            backup.stage = Stage::Announced;
        }
    }

    /// Every instance is connected: the backup computes from its tick on.
    pub(super) fn let_compute(&mut self, node: usize) {
        let host = self.view.host;
        let Some(backup) = &mut self.nodes[node].backup else { return };
        let slot = self.plan.slot(node, backup.generation);
        backup.report.hold_ms =
            backup.held_since.map_or(0.0, |since| milliseconds(host.saturating_sub(since)));
        backup.report.hand_over = match self.view.slots[slot].transfer {
            TransferOutcome::Unknown => None,
            TransferOutcome::State => Some("state"),
            TransferOutcome::LastOutput => Some("last output"),
        };
        backup.stage = Stage::Shadowing;
        self.view.set_slot_state(slot, SlotState::Taken);
        if backup.pending.join == Join::AtOnce {
            // The clock waited for the dead process until its place was taken.
            let dead = self.plan.slot(node, self.membership.nodes[node].primary.generation);
            self.view.set_slot_state(dead, SlotState::Empty);
        }
        self.view.set_epoch(self.membership.epoch);
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
