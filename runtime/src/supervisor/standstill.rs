//! Runs that stand still, and backups that do not join in their time.

use super::{Advance, Supervisor};
use crate::program::OnExit;
use crate::role::Role;
use crate::supervisor::replacement::Stage;
use crate::supervisor::state_machine::Event;
use crate::world::World;
use anyhow::{Result, anyhow};
use bus::lockstep::Phase;
use std::time::Duration;

impl<W: World> Supervisor<'_, W> {
    /// Looks whether the run stands still, and because of whom.
    pub(super) fn note_stall(&mut self) -> Result<()> {
        let view = &self.decisions.replacements.view;
        // A paused run stands still on request.
        let is_paused = view.held_at.is_some_and(|held| view.hold_tick <= held);
        // A sidecar that does not get ready has a watchdog of its own.
        let is_waiting = view.held_at.is_some() && !self.sidecars.all_ready();
        let straggler = self.straggler();
        let advance = self.advance(straggler);
        if advance != self.timing.last_change.0 || self.decisions.state.is_over() || is_paused || is_waiting {
            self.timing.last_change = (advance, self.clock.now());
            return Ok(());
        }
        if let Some((node, generation, stage, since)) = self.decisions.replacements.joining() {
            self.note_late_joiner(node, generation, stage, since.max(self.timing.last_change.1));
            return Ok(());
        }
        let stood = self.clock.since(self.timing.last_change.1);
        if stood <= self.patience(straggler).max(2 * self.deadline()) {
            return Ok(());
        }
        let text = self.describe_standstill(straggler, stood);
        let Some(straggler) = straggler else {
            self.tell(Event::Died { policy: OnExit::Stop, is_possible: false })?;
            return self.abort(anyhow!("{text}; it was aborted"));
        };
        self.timing.last_change.1 = self.clock.now();
        self.processes.kill(straggler, Some(format!("was killed by the watchdog: {text}")));
        Ok(())
    }

    /// Progress of the run.
    fn advance(&self, straggler: Option<Role>) -> Advance {
        let view = &self.decisions.replacements.view;
        Advance {
            phase: Some(view.phase),
            awaits_phase: view.phase < Phase::Running && straggler == Some(Role::Clock),
            joining: self.decisions.replacements.joining().map(|(node, generation, ..)| (node, generation)),
            granted: view.granted,
            done: view.slots.iter().map(|slot| slot.done).collect(),
        }
    }

    /// Longest time that the run may stand still because of `straggler`. For the clock, and if no process is to
    /// blame, it is the longest time of all nodes.
    fn patience(&self, straggler: Option<Role>) -> Duration {
        match straggler {
            Some(Role::Node { node, generation }) => {
                self.decisions.replacements.program_of(node, generation).watchdog
            }
            Some(Role::Clock | Role::Sidecar { .. }) | None => {
                self.graph.programs.iter().map(|program| program.watchdog).max().unwrap_or_default()
            }
        }
    }

    /// Kills a process that does not join, or an instance that does not connect to it.
    fn note_late_joiner(&mut self, node: usize, generation: u32, stage: Stage, since: Duration) {
        let disagreeing = self.decisions.replacements.disagreeing();
        let late = disagreeing.filter(|_| stage != Stage::Joining).unwrap_or((node, generation));
        let patience = self.decisions.replacements.program_of(late.0, late.1).watchdog;
        if self.clock.since(since) > patience {
            let what = if late == (node, generation) {
                "did not join".to_owned()
            } else {
                format!("did not connect to `{}.{generation}`", self.plan.nodes[node].name)
            };
            let text = format!("was killed by the watchdog: it {what} within {} ms", patience.as_millis());
            self.processes.kill(Role::Node { node: late.0, generation: late.1 }, Some(text));
        }
    }
}
