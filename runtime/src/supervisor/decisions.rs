//! Decisions about the end of a process: they follow from observations, and touch no process.

use crate::program::{HOW_TO_JOIN, OnExit};
use crate::role::Role;
use crate::supervisor::replacement::{InstanceRole, Replacements, Stage};
use crate::supervisor::state_machine::{Action, Event, State};
use bus::lockstep::Phase;
use bus::plan::{NodePlan, Plan};

/// A process that ended, or was found to hang.
#[derive(Clone, Debug)]
pub struct Death {
    /// Its name.
    pub name: String,
    /// Its role.
    pub role: Role,
    /// Description of its end, with the last lines that it wrote.
    pub message: String,
    /// True if it ended with exit code 0.
    pub is_success: bool,
}

/// A failure that ends the run at once.
#[derive(Clone, Debug)]
pub struct Abort {
    /// Name of the process in its manifest.
    pub process: String,
    /// Message with its end.
    pub message: String,
}

/// Decides the consequences of events: the states of the run, and those of its replacements.
#[derive(Debug)]
pub struct Decisions<'a> {
    plan: &'a Plan,
    /// State of the run.
    pub state: State,
    /// Its backups and replacements.
    pub replacements: Replacements<'a>,
    /// Notes for the user that were not reported yet.
    pub notes: Vec<String>,
    /// True if a dead process is being replaced: the run may stand still meanwhile.
    pub has_answered: bool,
}

impl<'a> Decisions<'a> {
    /// Decides for the run of `plan`, which begins.
    pub fn new(plan: &'a Plan, replacements: Replacements<'a>) -> Self {
        Self { plan, state: State::Starting, replacements, notes: Vec::new(), has_answered: false }
    }

    /// True if a process with this role may end without an error now.
    pub fn has_done_its_part(&self, role: Role) -> bool {
        match role {
            Role::Sidecar { .. } => true,
            Role::Clock => self.replacements.view.completed_ticks() >= self.replacements.view.end_tick,
            Role::Node { node, generation } => {
                let has_completed = self.replacements.view.has_completed(self.plan.slot(node, generation));
                match self.replacements.role(node, generation) {
                    InstanceRole::Retired => true,
                    InstanceRole::Primary => has_completed,
                    InstanceRole::Backup => {
                        has_completed && self.replacements.stage(node) >= Some(Stage::Shadowing)
                    }
                }
            }
        }
    }

    /// Notes that ticks are granted.
    pub fn note_gathered(&mut self) {
        if self.state == State::Gathering && self.replacements.view.phase == Phase::Running {
            self.tell(Event::Gathered);
            if self.replacements.view.is_stop_requested {
                self.tell(Event::StopRequested);
            }
        }
    }

    /// Passes an event to the state machine; an abort is left to the caller, which knows the reason.
    pub fn tell(&mut self, event: Event) -> Action {
        let (state, action) = self.state.after(event);
        self.state = state;
        if action == Action::RequestStop {
            self.replacements.view.request_stop();
        }
        action
    }

    /// The run ends: no action can answer the failure of `process`.
    fn fail(&mut self, process: &str, message: String) -> Abort {
        self.tell(Event::Died { policy: OnExit::Stop, is_possible: false });
        Abort { process: process.to_owned(), message }
    }

    /// Draws the consequences of a death; false if that must wait.
    ///
    /// # Errors
    /// If the run ends with it.
    pub fn settle(&mut self, death: &Death) -> Result<bool, Abort> {
        let Role::Node { node, generation } = death.role else {
            let ticks = self.replacements.view.completed_ticks();
            let message = format!("{}\nThe run was aborted at tick {ticks}", death.message);
            return Err(self.fail(&death.name, message));
        };
        if self.replacements.has_taken_over(node) {
            if !self.replacements.all_agree() {
                return Ok(false);
            }
            self.replacements.commit(node);
        }
        match self.replacements.role(node, generation) {
            InstanceRole::Retired => {
                self.replacements.note_end_of_retired(node, generation);
                Ok(true)
            }
            InstanceRole::Backup if self.has_died_behind_the_end(node, generation) => {
                self.say_died_behind_the_end(death);
                Ok(true)
            }
            InstanceRole::Backup => {
                if self.replacements.stage(node) > Some(Stage::Starting)
                    && !self.replacements.may_change(node)
                {
                    return Ok(false);
                }
                if self.tell(Event::BackupFailed) == Action::Refuse {
                    let tick = self.replacements.view.slots[self.plan.slot(node, generation)].done;
                    let reason = match self.replacements.stage(node) {
                        Some(Stage::Starting) => {
                            let how = self.how_to_join(node, generation, death);
                            format!("{} (it had not joined yet{how})", death.message)
                        }
                        _ => format!("{} (it had come to tick {tick})", death.message),
                    };
                    self.refuse(node, reason)?;
                }
                Ok(true)
            }
            InstanceRole::Primary => self.settle_primary(node, generation, death),
        }
    }

    /// Advice on a program that ended with exit code 0 before it joined; empty for any other end.
    fn how_to_join(&self, node: usize, generation: u32, death: &Death) -> String {
        let is_command = self.replacements.program_of(node, generation).kind().is_none();
        if death.is_success && is_command { format!("; {HOW_TO_JOIN}") } else { String::new() }
    }

    /// True if a process had completed its last tick when it died, and its node's policy allows the run to go on.
    /// Every sample that it had to send is sent, and another process could do nothing in its place.
    fn has_died_behind_the_end(&self, node: usize, generation: u32) -> bool {
        self.replacements.view.phase == Phase::Running
            && self.replacements.program(node).on_exit != OnExit::Stop
            && self.replacements.view.has_completed(self.plan.slot(node, generation))
    }

    fn say_died_behind_the_end(&mut self, death: &Death) {
        self.notes
            .push(format!("{}\nIt had completed its last tick: the run ends without it", death.message));
    }

    fn refuse(&mut self, node: usize, reason: String) -> Result<(), Abort> {
        let vacant = self.replacements.is_vacant(node);
        if !vacant {
            let name = &self.plan.nodes[node].name;
            self.notes.push(format!("the backup of `{name}` was refused: {reason}\n`{name}` flies on"));
        }
        self.replacements.refuse(node, reason.clone());
        if vacant {
            let ticks = self.replacements.completed_by_primary(node);
            let message = format!(
                "{reason}\nThe run was aborted at tick {ticks}: it came in the place of a process that had died, \
                 and completed no tick"
            );
            return Err(self.fail(&self.plan.nodes[node].name, message));
        }
        Ok(())
    }

    fn settle_primary(&mut self, node: usize, generation: u32, death: &Death) -> Result<bool, Abort> {
        if self.replacements.is_vacant(node) {
            return Ok(true);
        }
        // It may have flown for a while before anybody looked.
        self.note_gathered();
        let flies = self.replacements.view.phase == Phase::Running;
        let on_exit = self.replacements.program(node).on_exit;
        if self.has_died_behind_the_end(node, generation) {
            self.say_died_behind_the_end(death);
            return Ok(true);
        }
        if flies && on_exit != OnExit::Stop && !self.replacements.may_replace(node) {
            return Ok(false);
        }
        let policy = match on_exit {
            OnExit::Restart if self.replacements.can_promote(node) => OnExit::Standby,
            policy => policy,
        };
        let is_possible = flies
            && match policy {
                OnExit::Stop | OnExit::Ignore => false,
                OnExit::Restart => self.replacements.has_come_on(node),
                OnExit::Standby => self.replacements.can_promote(node),
            };
        let tick = self.replacements.view.completed_by(self.plan.slot(node, generation));
        match self.tell(Event::Died { policy, is_possible }) {
            Action::Restart => {
                self.replacements.close_early(node);
                self.replacements.postpone(node);
                if self.replacements.stage(node).is_some() {
                    self.refuse(node, "the process it was to succeed died first".to_owned())?;
                }
                self.notes.push(format!("{}\n`{}` is restarted at tick {tick}", death.message, death.name));
                self.replacements.restart(node);
            }
            Action::Promote => {
                self.notes.push(format!(
                    "{}\nThe standby of `{}` takes over at tick {tick}",
                    death.message, self.plan.nodes[node].name
                ));
                self.replacements.promote(node);
            }
            _ => {
                let why = match policy {
                    OnExit::Stop | OnExit::Ignore => "",
                    _ if !flies => ": the run did not fly yet",
                    OnExit::Restart => {
                        ": it was restarted and came to its end again without completing a tick"
                    }
                    OnExit::Standby => ": no standby was ready to take over",
                };
                let silent = silent_topics(&self.plan.nodes[node], self.plan);
                let how = if flies { String::new() } else { self.how_to_join(node, generation, death) };
                let message =
                    format!("{}\nThe run was aborted at tick {tick}{silent}{why}{how}", death.message);
                return Err(Abort { process: self.plan.nodes[node].name.clone(), message });
            }
        }
        self.has_answered = true;
        Ok(true)
    }

    /// Ends those that do not come up or do not leave in their time; their ends are settled like any other.
    pub fn note_laggards(&mut self) {
        if let Some((node, generation)) = self.replacements.unprepared() {
            let program = self.replacements.program_of(node, generation);
            let patience = program.watchdog.as_millis();
            let how = if program.kind().is_none() { format!("; {HOW_TO_JOIN}") } else { String::new() };
            let message = format!("was killed by the watchdog: it did not join within {patience} ms{how}");
            self.replacements.view.kill_for(node, generation, message);
        }
        if let Some((node, generation)) = self.replacements.lingering() {
            let message = "was killed by the watchdog: it did not leave".to_owned();
            self.replacements.view.kill_for(node, generation, message);
        }
    }

    /// Takes a backup out of the run that was to join at a tick which the run has passed.
    ///
    /// # Errors
    /// If no other instance of its node can go on.
    pub fn note_too_late(&mut self) -> Result<(), Abort> {
        match self.replacements.too_late() {
            Some(node) => self.refuse(node, "the run had passed the tick at which it was to join".to_owned()),
            None => Ok(()),
        }
    }
}

/// The topics on which nothing more came after the process of `node` had ended, as a part of a message.
fn silent_topics(node: &NodePlan, plan: &Plan) -> String {
    let topics: Vec<_> = node.outputs.iter().map(|output| plan.topics[output.topic].name.as_str()).collect();
    if topics.is_empty() { String::new() } else { format!("; nothing more came on {}", topics.join(", ")) }
}
