//! Reactions to the end of processes and sidecars, and to an interrupt.

use super::Supervisor;
use crate::program::OnExit;
use crate::supervisor::decisions::Death;
use crate::supervisor::state_machine::{Action, Event, State};
use crate::world::World;
use anyhow::{Result, anyhow};

impl<W: World> Supervisor<'_, W> {
    /// Draws the consequences of every end that was seen.
    pub(super) fn settle_ends(&mut self) -> Result<()> {
        for index in 0..self.processes.running.len() {
            let Some(process) = self.processes.running.get_mut(index) else { break };
            let (Some(end), false) = (&process.end, process.is_settled) else { continue };
            let succeeded = end.success() && process.verdict.is_none();
            let (name, role) = (process.name.clone(), process.role);
            if succeeded && self.decisions.has_done_its_part(role) {
                self.processes.running[index].is_settled = true;
                continue;
            }
            let message = self.processes.running[index].post_mortem();
            let settled = self.decisions.settle(&Death { name, role, message, is_success: succeeded });
            if self.follow(settled)?
                && let Some(process) = self.processes.running.get_mut(index)
                && process.role == role
            {
                process.is_settled = true;
            }
        }
        Ok(())
    }

    /// Draws the consequences of every sidecar that has failed.
    pub(super) fn settle_sidecars(&mut self) -> Result<()> {
        while let Some(failure) = self.sidecars.next_failure(self.clock.now()) {
            let event = Event::SidecarFailed { policy: failure.policy, is_possible: failure.is_possible };
            match self.tell(event)? {
                Action::Abort => {
                    let why = match failure.policy {
                        OnExit::Restart => ": it was restarted and ended again within a second",
                        _ => "; with `on_exit = \"ignore\"` the run would go on without it",
                    };
                    let ticks = self.decisions.replacements.view.completed_ticks();
                    let message = format!("{}\nThe run was aborted at tick {ticks}{why}", failure.message);
                    return self.fail(&failure.name, message);
                }
                Action::Restart => {
                    self.say(&format!("{}\n`{}` is restarted", failure.message, failure.name));
                    self.sidecars.restart(&mut self.world, self.clock.now(), failure.index)?;
                }
                _ => {
                    self.say(&format!("{}\nThe run goes on without it", failure.message));
                    self.sidecars.forget(failure.index);
                }
            }
        }
        Ok(())
    }

    pub(super) fn note_interrupts(&mut self) -> Result<()> {
        let count = self.stop.count();
        let seen = std::mem::replace(&mut self.stops_seen, count);
        for number in seen..count {
            let event = if number == 0 { Event::StopRequested } else { Event::Interrupted };
            if self.tell(event)? == Action::Abort {
                let ticks = self.decisions.replacements.view.completed_ticks();
                return self.abort(anyhow!("interrupted twice: the run was aborted at tick {ticks}"));
            }
        }
        Ok(())
    }

    pub(super) fn note_progress(&mut self) -> Result<()> {
        self.decisions.note_gathered();
        self.carry_out()?;
        self.see();
        let view = &self.decisions.replacements.view;
        if self.decisions.state == State::Running && view.granted >= view.end_tick {
            self.tell(Event::EndReached)?;
        }
        if self.processes.all_ended() && self.processes.running.iter().all(|process| process.is_settled) {
            self.tell(Event::AllEnded)?;
        }
        Ok(())
    }
}
