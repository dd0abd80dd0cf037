//! Take-overs: planned ones, and those after a death; and the end of the predecessor.

use super::{Backup, Join, Pending, Purpose, Replacements, Stage};
use crate::program::{BackupSpec, OnExit, Program};
use bus::lockstep::SlotState;
use bus::plan::OutputPlan;

impl Replacements<'_> {
    /// True if the backup of `node` has completed its first tick that counts.
    pub(super) fn has_flown(&self, node: usize) -> bool {
        let take_over_tick = self.membership.nodes[node].take_over_tick;
        self.nodes[node].backup.as_ref().is_some_and(|backup| {
            let done = self.view.slots[self.slot(node, backup.generation)].done;
            backup.stage == Stage::Shadowing && done > take_over_tick && take_over_tick < self.view.end_tick
        })
    }

    /// A process whose last samples are read and which does not leave: node and generation.
    pub(crate) fn lingering(&self) -> Option<(usize, u32)> {
        self.nodes.iter().enumerate().find_map(|(node, nodes)| {
            let backup = nodes.backup.as_ref().filter(|backup| backup.stage == Stage::Retiring)?;
            let retired = backup.retired.filter(|&retired| self.view.lives(node, retired))?;
            let is_late = self.view.since(backup.stage_began) > nodes.program.watchdog;
            (is_late && self.is_read(backup)).then_some((node, retired))
        })
    }

    /// True if the backup of `node` has sent a sample that counts. Readers may already read it. Even if the backup
    /// dies now, its predecessor cannot return.
    pub(crate) fn has_taken_over(&self, node: usize) -> bool {
        let membership = &self.membership.nodes[node];
        let is_shadowing = self.nodes[node].backup.as_ref().is_some_and(|c| c.stage == Stage::Shadowing);
        let outputs = membership.primary.plan.outputs.iter().zip(&membership.take_over_ticks);
        let has_sent = |(output, &tick): (&OutputPlan, &u32)| {
            self.view.sent[output.topic] > self.plan.topics[output.topic].ticks.next(tick)
        };
        is_shadowing && outputs.into_iter().any(has_sent)
    }

    /// Its first tick is done, or lost with it: from now on it is the primary.
    pub(crate) fn commit(&mut self, node: usize) {
        let membership = &mut self.membership.nodes[node];
        let take_over_tick = membership.take_over_tick;
        let retired = membership.primary.generation;
        if let Some(backup) = membership.backup.take() {
            membership.primary = backup;
        }
        membership.take_over_tick = u32::MAX;
        membership.take_over_ticks.fill(u32::MAX);
        self.nodes[node].is_vacant = false;
        if let Some(backup) = &mut self.nodes[node].backup {
            backup.report.take_over_tick = Some(take_over_tick);
            backup.retired = Some(retired);
            backup.stage = Stage::Retiring;
        }
        // Every node follows it already: this is for programs that look at the run from outside.
        self.view.store(&self.membership);
    }

    /// The process has ended: if it is a predecessor that did not leave by itself, it is waited for no longer.
    pub(crate) fn note_end_of_retired(&mut self, node: usize, generation: u32) {
        let backup = self.nodes[node].backup.as_ref();
        if backup.is_some_and(|backup| backup.retired == Some(generation)) {
            self.view.set_slot_state(self.slot(node, generation), SlotState::Empty);
            self.view.set_epoch(self.view.epoch);
        }
    }

    /// True if the predecessor has left and its last samples are read.
    pub(super) fn has_retired(&self, node: usize, backup: &Backup) -> bool {
        if backup.retired.is_some_and(|retired| self.view.lives(node, retired)) {
            return false;
        }
        self.is_read(backup)
    }

    /// True if every instance has read the last samples of the process that `backup` has replaced.
    pub(super) fn is_read(&self, backup: &Backup) -> bool {
        let longest = self.plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
        let taken = backup.report.take_over_tick.unwrap_or_default().saturating_add(longest + 1);
        let taken = taken.min(self.view.end_tick);
        self.view.computing().all(|slot| self.view.slots[slot].done >= taken)
    }

    /// The predecessor is gone: its slot is freed, and everything that it left is removed.
    pub(super) fn close(&mut self, node: usize) {
        let Some(backup) = self.nodes[node].backup.take() else { return };
        if let Some(retired) = backup.retired {
            self.free(node, retired);
        }
        let on_exit = self.nodes[node].program.on_exit;
        self.nodes[node].program = Program { on_exit, ..backup.pending.spec.program.clone() };
        if on_exit == OnExit::Standby {
            // A promoted standby gets one of its own at the next tick boundary.
            let pending = Pending {
                spec: backup.pending.spec,
                purpose: Purpose::Standby,
                is_planned: false,
                request: None,
                join: Join::Next { shadow_ticks: None },
            };
            self.pending.push_back(pending);
        }
        self.reports.push(backup.report);
    }

    /// The primary of `node` has died while its predecessor retired: that is over now. Nothing more comes from the
    /// predecessor, and readers that have not taken its last samples yet hold them.
    pub(crate) fn close_early(&mut self, node: usize) {
        let Some(backup) = self.nodes[node].backup.as_ref().filter(|c| c.stage == Stage::Retiring) else {
            return;
        };
        if let Some(retired) = backup.retired {
            self.view.kill(node, retired);
        }
        self.close(node);
    }

    /// True if the backup of `node` can take the place of the primary at once. A backup that only shadows cannot.
    pub(crate) fn can_promote(&self, node: usize) -> bool {
        self.nodes[node].backup.as_ref().is_some_and(|backup| {
            backup.stage == Stage::Shadowing && backup.pending.purpose != Purpose::Shadow
        })
    }

    /// Ticks that the primary of `node` has completed, dead or alive.
    pub(crate) fn completed_by_primary(&self, node: usize) -> u32 {
        self.view.completed_by(self.slot(node, self.membership.nodes[node].primary.generation))
    }

    /// True if the primary of `node` has completed a tick since it joined: a restart makes progress.
    pub(crate) fn has_come_on(&self, node: usize) -> bool {
        let primary = &self.membership.nodes[node].primary;
        primary.generation == 0
            || self.view.slots[self.slot(node, primary.generation)].done > primary.join_tick
    }

    /// The primary of `node` is dead: the backup takes its place at the tick it did not complete.
    pub(crate) fn promote(&mut self, node: usize) {
        let primary = self.slot(node, self.membership.nodes[node].primary.generation);
        let view = &self.view;
        let membership = &mut self.membership.nodes[node];
        membership.take_over_tick = view.slots[primary].done;
        let outputs = membership.primary.plan.outputs.iter();
        membership.take_over_ticks = outputs.map(|output| view.sent[output.topic]).collect();
        self.membership.epoch += 1;
        self.view.store(&self.membership);
        self.view.set_slot_state(primary, SlotState::Empty);
        self.view.set_epoch(self.membership.epoch);
        self.nodes[node].is_vacant = true;
    }

    /// The primary of `node` is dead: another one of its kind is started in its place.
    pub(crate) fn restart(&mut self, node: usize) {
        let spec = BackupSpec {
            node,
            join_tick: 0,
            take_over_tick: None,
            is_standby: false,
            with: None,
            program: self.nodes[node].program.clone(),
            plan: self.membership.nodes[node].primary.plan.clone(),
        };
        self.nodes[node].is_vacant = true;
        let (purpose, join) = (Purpose::Restart, Join::AtOnce);
        self.start_backup(Pending { spec, purpose, is_planned: false, request: None, join });
    }
}
