//! Requests carried out by the launcher: it holds, steps, paces and stops the run through its control segment.

use crate::checkpoint_writer::{Found, Writer};
use crate::ctl::protocol::{Answer, Request, Status};
use crate::ctl::server::{Asked, Remote, Reply, Server};
use crate::rewind::{Rewind, Rewinds};
use anyhow::{Context as _, Result};
use bus::lockstep::SupervisorView;
use bus::membership::Membership;
use bus::plan::Plan;
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

/// The hold tick of a run that is not to be held.
const NEVER: u32 = u32::MAX;
/// Requests that are served a look at most, for the supervisor has more to look after.
const MAX_A_LOOK: usize = 16;

/// Serves requests about a run, a look at a time.
pub struct ControlServer<'a> {
    run_dir: PathBuf,
    plan: &'a Plan,
    control: &'a SupervisorView,
    server: Server<'a>,
    /// Writes checkpoints.
    checkpoints: Writer<'a>,
    /// Rewinds, which the launcher carries out.
    rewinds: &'a Rewinds,
    /// Request that has not been carried out yet: one at a time, the newest.
    wish: Option<(Goal, Reply)>,
}

enum Goal {
    /// The run is to be held.
    Pause,
    /// The run is to be held, then let go for this many ticks.
    PauseToStep(u32),
    /// The run is to be held again at the boundary before `target`, `ticks` after it was let go.
    Step { ticks: u32, target: u32 },
    /// The run is to be held, for a checkpoint; the hold before was `hold_tick`.
    PauseToSave { path: Option<PathBuf>, hold_tick: u32 },
    /// The parts of the checkpoint of `tick` are to be written.
    Save { path: Option<PathBuf>, tick: u32 },
    /// The run is to be held at `to_tick`, from whose checkpoint it starts again.
    Rewind { from_tick: u32, to_tick: u32 },
}

impl<'a> ControlServer<'a> {
    /// Opens the control socket in `run_dir`. A run that starts again after one of `rewinds` is held at its first tick.
    ///
    /// # Errors
    /// If the socket cannot be made.
    pub fn open(
        run_dir: &Path,
        plan: &'a Plan,
        control: &'a SupervisorView,
        remote: Remote,
        requests: &'a Receiver<Asked>,
        checkpoints: Writer<'a>,
        rewinds: &'a Rewinds,
    ) -> Result<Self> {
        let server = Server::start(run_dir, remote, requests)?;
        let wish = rewinds.take_begun().map(|Rewind { from_tick, to_tick, pace, reply, .. }| {
            control.set_hold_tick(to_tick);
            control.set_pace(pace);
            (Goal::Rewind { from_tick, to_tick }, reply)
        });
        let run_dir = run_dir.to_owned();
        Ok(Self { run_dir, plan, control, server, checkpoints, rewinds, wish })
    }

    /// Serves the requests since the last look; returns one that is not about the clock, a swap.
    pub fn serve(&mut self) -> Option<Asked> {
        self.grant_wish();
        for _ in 0..MAX_A_LOOK {
            let (request, reply) = self.server.poll()?;
            match request {
                Request::Status => drop(reply.send(&Answer::Status(self.status()))),
                Request::Pause => self.wish(0, Goal::Pause, reply),
                Request::Step { ticks } => self.wish(0, Goal::PauseToStep(ticks.max(1)), reply),
                Request::Resume => self.resume(reply),
                Request::Pace { pace } => {
                    self.control.set_pace(pace.0);
                    self.answer(reply, format!("pace {pace}"));
                }
                Request::Stop => {
                    self.control.request_stop();
                    self.answer(reply, "stopping at the next tick boundary".to_owned());
                }
                Request::Checkpoint { path } => {
                    // One that is overtaken has set the hold already.
                    let hold_tick = match &self.wish {
                        Some((Goal::PauseToSave { hold_tick, .. }, _)) => *hold_tick,
                        _ => self.control.hold_tick(),
                    };
                    self.wish(0, Goal::PauseToSave { path, hold_tick }, reply);
                }
                Request::Rewind { tick, path } => self.rewind(tick, path.as_deref(), reply),
                Request::Swap { .. } => return Some((request, reply)),
            }
            self.grant_wish();
        }
        None
    }

    fn status(&self) -> Status {
        let membership = Membership::load(&self.run_dir, self.control.epoch());
        let membership = membership.unwrap_or_else(|_| Membership::first(self.plan));
        Status::of(self.plan, self.control).with_groups(self.plan, &membership)
    }

    fn has_ended_at(&self, tick: u32) -> bool {
        self.control.end_tick() == tick && self.control.completed_ticks() >= tick
    }

    /// Answers a request for a checkpoint of `tick`, with the path of the file that was `written`.
    fn answer_written(&self, reply: Reply, tick: u32, written: Result<PathBuf>) {
        match written {
            Ok(path) => self.answer(reply, format!("the checkpoint of tick {tick} is {}", path.display())),
            Err(error) => drop(reply.send(&Answer::refused(format!("{error:#}")))),
        }
    }

    fn answer(&self, reply: Reply, text: String) {
        let (tick, warnings) = (self.control.completed_ticks(), Vec::new());
        reply.send(&Answer::Done { text, tick, warnings });
    }

    /// Refuses the waiting request that a later one replaces; true if there was one.
    fn overtake(&mut self) -> bool {
        let overtaken = self.wish.take();
        overtaken.map(|(_, reply)| reply.send(&Answer::refused("a later request took its place"))).is_some()
    }

    fn wish(&mut self, hold_tick: u32, goal: Goal, reply: Reply) {
        self.control.set_hold_tick(hold_tick);
        self.overtake();
        self.wish = Some((goal, reply));
    }

    fn resume(&mut self, reply: Reply) {
        let held_at = self.control.held_at();
        let was_overtaken = self.overtake();
        self.control.set_hold_tick(NEVER);
        let text = match held_at {
            Some(tick) => format!("running on from tick {tick}"),
            None if was_overtaken => "running on".to_owned(),
            None => "it was not paused".to_owned(),
        };
        self.answer(reply, text);
    }

    /// Answers the wish if it has come true; goes on to its second half if the first is done.
    fn grant_wish(&mut self) {
        let Some((goal, reply)) = self.wish.take() else { return };
        match (goal, self.control.held_at()) {
            (Goal::Pause, Some(tick)) => self.answer(reply, format!("paused at tick {tick}")),
            (Goal::PauseToStep(ticks), Some(tick)) => self.step(tick, ticks, reply),
            (Goal::Step { ticks, target }, held_at)
                if held_at == Some(target) || self.has_ended_at(target) =>
            {
                let what = if held_at == Some(target) { "paused" } else { "ended" };
                self.answer(reply, format!("{what} at tick {target}, {} on", ticks_in_words(ticks)));
            }
            (Goal::Rewind { from_tick, to_tick }, Some(tick)) if tick == to_tick => {
                self.answer(
                    reply,
                    format!("rewound from tick {from_tick} to tick {to_tick}, where it is paused"),
                );
            }
            (Goal::PauseToSave { path, hold_tick }, Some(tick)) => self.save(path, tick, hold_tick, reply),
            (Goal::Save { path, tick }, _) => {
                match self.checkpoints.write_asked(tick, path.as_deref()).transpose() {
                    Some(written) => self.answer_written(reply, tick, written),
                    None => self.wish = Some((Goal::Save { path, tick }, reply)),
                }
            }
            (goal, _) => self.wish = Some((goal, reply)),
        }
    }

    /// Makes the nodes write the checkpoint of `tick`, at which the run is held, and lets it go on to `hold_tick`; a run that
    /// was paused before stays so.
    fn save(&mut self, path: Option<PathBuf>, tick: u32, hold_tick: u32, reply: Reply) {
        let refused = if tick == 0 {
            Some("tick 0 is the start of the run: there is nothing to go on from")
        } else if !self.plan.goes_on_from(tick) {
            Some("a process has computed its last step: nothing would go on from there")
        } else {
            None
        };
        if let Some(reason) = refused {
            self.control.set_hold_tick(hold_tick);
            reply.send(&Answer::refused(reason));
            return;
        }
        if tick == self.plan.first_tick {
            self.control.set_hold_tick(hold_tick);
            return self.answer_written(reply, tick, self.checkpoints.write_source(path.as_deref()));
        }
        // Before the hold is lifted: every node sees it in the hold, or at its next tick.
        self.control.ask_for_checkpoint(tick);
        self.control.set_hold_tick(hold_tick);
        self.wish = Some((Goal::Save { path, tick }, reply));
    }

    /// Ends the run, so that the launcher starts it again from a checkpoint.
    fn rewind(&mut self, tick: Option<u32>, file: Option<&Path>, reply: Reply) {
        let paused_at = self.control.held_at().filter(|held| self.control.hold_tick() <= *held);
        let found = paused_at.context("the run is not paused: pause it first, with `hummingbus ctl pause`");
        let found = found.and_then(|now| {
            self.rewinds.require_place()?;
            Ok((now, self.checkpoints.find(tick, file, now)?))
        });
        match found {
            Ok((from_tick, Found { tick: to_tick, path, graph })) => {
                self.overtake();
                let pace = self.control.pace();
                self.rewinds.ask(Rewind { from_tick, to_tick, path, pace, reply }, graph);
                self.control.request_stop();
            }
            Err(error) => drop(reply.send(&Answer::refused(format!("{error:#}")))),
        }
    }

    /// Lets the run, held at `tick`, go for `ticks` ticks.
    fn step(&mut self, tick: u32, ticks: u32, reply: Reply) {
        let left = self.control.end_tick() - tick;
        if ticks > left {
            let end = self.control.end_tick();
            let left = ticks_in_words(left);
            let reason = format!("paused at tick {tick}: only {left} left of a run that ends at tick {end}");
            reply.send(&Answer::refused(reason));
            return;
        }
        let target = tick + ticks;
        self.wish(target, Goal::Step { ticks, target }, reply);
    }
}

fn ticks_in_words(ticks: u32) -> String {
    if ticks == 1 { "1 tick".to_owned() } else { format!("{ticks} ticks") }
}

impl Drop for ControlServer<'_> {
    fn drop(&mut self) {
        // A step may have reached the run's end since the last look.
        self.grant_wish();
    }
}
