//! The simulated world as its supervisor meets it.

use super::fault::Fault;
use super::settings;
use super::sim::{Bug, Doing, Need, Sim};
use crate::ctl::protocol::{Answer, Request};
use crate::host::End;
use crate::program::{BackupSpec, OnExit, Program, Readiness};
use crate::role::Role;
use crate::view::{SegmentWrite, SlotView, View};
use crate::world::{Body, Spent, World};
use anyhow::{Result, bail};
use bus::BusError;
use bus::lockstep::SlotState;
use bus::membership::Membership;
use bus::plan::InputPlan;
use diagnostics::Diagnostic;
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

/// A handle on the simulated world.
#[derive(Clone, Debug)]
pub(super) struct SimWorld(pub(super) Rc<RefCell<Sim>>);

/// A handle on a simulated process.
#[derive(Debug)]
pub(super) struct SimBody {
    sim: Rc<RefCell<Sim>>,
    index: usize,
}

/// A request, and its node.
pub(super) struct Asked {
    number: usize,
    process: String,
}

fn file_error(name: &str) -> BusError {
    let source = std::io::ErrorKind::StorageFull.into();
    BusError::File { action: "write", path: name.into(), source }
}

impl World for SimWorld {
    type Body = SimBody;
    type Reply = Asked;

    fn now(&self) -> Duration {
        self.0.borrow().now
    }

    fn see(&self) -> View {
        let sim = &mut *self.0.borrow_mut();
        sim.preempt();
        let mut view = sim.segment.clone();
        view.awaits_clock = sim.awaits_clock();
        for instance in sim.living() {
            if let (Role::Node { .. }, Some((Need::Other(_), _))) = (instance.role, instance.sleep) {
                view.slots[sim.slot(instance.role)].awaits_other = true;
            }
        }
        if sim.bug == Some(Bug::AwaitsNobody) {
            view.slots.iter_mut().for_each(|slot| slot.acknowledged = view.epoch);
        }
        view
    }

    fn awaited_topic(&self, slot: usize, _: &[InputPlan]) -> Option<usize> {
        let sim = self.0.borrow();
        let mut nodes = sim.living().filter(|instance| matches!(instance.role, Role::Node { .. }));
        let instance = nodes.find(|instance| sim.slot(instance.role) == slot)?;
        match instance.sleep {
            Some((Need::Samples(topic) | Need::Shadow(topic), _)) => Some(topic),
            _ => None,
        }
    }

    fn write(&mut self, write: SegmentWrite) {
        let sim = &mut *self.0.borrow_mut();
        sim.preempt();
        if write != SegmentWrite::JoinTick(sim.join_tick) {
            sim.note(|_| format!("{write:?}"));
        }
        sim.write(write);
    }

    fn notices(&self) -> u32 {
        let mut sim = self.0.borrow_mut();
        sim.looks += 1;
        sim.notices
    }

    fn wait(&mut self, notices: u32, timeout: Duration) {
        let sim = &mut *self.0.borrow_mut();
        let deadline = sim.now + timeout;
        sim.run_until(deadline, notices);
    }

    fn spent(&self, _: usize) -> Spent {
        Spent::default()
    }

    fn start(&mut self, name: &str, role: Role, program: Option<&Program>) -> Result<SimBody> {
        let mut sim = self.0.borrow_mut();
        sim.preempt();
        sim.note(|_| format!("start {role:?}"));
        if sim.strikes(Fault::Start, 10) {
            bail!("process `{name}`: no more processes");
        }
        let notifies = program.is_some_and(|program| program.ready == Readiness::Notify);
        Ok(SimBody { index: sim.start(role, notifies), sim: self.0.clone() })
    }

    fn hears_ready(&mut self, index: usize) -> bool {
        let is_it = |role: Role| matches!(role, Role::Sidecar { index: other, .. } if other == index);
        let mut sim = self.0.borrow_mut();
        let mut sidecars = sim.instances.iter_mut().filter(|instance| is_it(instance.role));
        sidecars.any(|sidecar| std::mem::take(&mut sidecar.says_ready))
    }

    fn reap(&self, _: &[u32]) {}

    fn store_backup(&mut self, backup: &BackupSpec, generation: u32) -> Result<(), BusError> {
        let sim = &mut *self.0.borrow_mut();
        sim.preempt();
        if sim.strikes(Fault::StoreBackup, 4) {
            return Err(file_error(&format!("backup-{}.{generation}.json", backup.node)));
        }
        Ok(())
    }

    fn store_membership(&mut self, membership: &Membership) -> Result<(), BusError> {
        let sim = &mut *self.0.borrow_mut();
        sim.preempt();
        if sim.strikes(Fault::StoreMembership, 20) {
            return Err(file_error("membership.json"));
        }
        let mut membership = membership.clone();
        if sim.bug == Some(Bug::PromotesTwo) {
            let nodes = membership.nodes.iter_mut().flat_map(|node| &mut node.take_over_ticks);
            nodes.filter(|tick| **tick != u32::MAX).for_each(|tick| *tick = tick.saturating_sub(1));
        }
        // As in the run directory, the one before the one before goes.
        sim.stored.retain(|&epoch, _| epoch + 2 > membership.epoch);
        sim.stored.insert(membership.epoch, membership);
        Ok(())
    }

    fn remove_traces(&mut self, node: usize, generation: u32, _: bool) {
        let sim = self.0.borrow();
        let role = Role::Node { node, generation };
        assert!(sim.living().all(|instance| instance.role != role), "the traces of living {role:?} go");
    }

    fn next_request(&mut self) -> Option<(Request, Asked)> {
        let sim = &mut *self.0.borrow_mut();
        let request = sim.requests.pop_front()?;
        let Request::Swap { process, .. } = &request else { unreachable!("only swaps are drawn") };
        let asked = Asked { number: sim.answers.len(), process: process.clone() };
        sim.answers.push(None);
        Some((request, asked))
    }

    fn answer(&mut self, asked: Asked, answer: &Answer) {
        let sim = &mut *self.0.borrow_mut();
        sim.note(|_| format!("answer: {answer:?}"));
        if let Answer::Done { tick, .. } = *answer {
            let node = sim.plan.nodes.iter().position(|node| node.name == asked.process);
            sim.check_swap(node.expect("a swap of a node"), tick);
        }
        let before = sim.answers[asked.number].replace(answer.clone());
        assert!(before.is_none(), "answered twice: {before:?}, {answer:?}");
    }

    fn backup_of(&self, process: &str, _: &str) -> Result<(BackupSpec, Vec<Diagnostic>), Diagnostic> {
        let sim = self.0.borrow();
        let node = sim.plan.nodes.iter().position(|node| node.name == process);
        let node = node.ok_or_else(|| Diagnostic::in_file("m.toml", "no such process"))?;
        let program = settings::program(OnExit::Stop);
        let plan = sim.plan.nodes[node].clone();
        let (take_over_tick, with) = (None, None);
        let backup =
            BackupSpec { node, join_tick: 0, take_over_tick, is_standby: false, with, program, plan };
        Ok((backup, Vec::new()))
    }
}

impl Body for SimBody {
    fn id(&self) -> Option<u32> {
        None
    }

    fn end(&mut self) -> Result<Option<End>> {
        Ok(self.sim.borrow().instances[self.index].end.clone())
    }

    fn kill(&mut self, _: &mut Duration) -> Option<End> {
        let sim = &mut *self.sim.borrow_mut();
        sim.note(|sim| format!("kill {:?}", sim.instances[self.index]));
        if sim.bug == Some(Bug::KillMisses) && !sim.segment.is_aborted {
            return Some(End::Signalled(9));
        }
        sim.instances[self.index].end.get_or_insert(End::Signalled(9)).clone().into()
    }

    fn last_lines(&self) -> Vec<String> {
        Vec::new()
    }

    fn bound_log(&self) {}

    fn remove_log(&self) {}
}

impl Sim {
    fn write(&mut self, write: SegmentWrite) {
        match write {
            SegmentWrite::Clear(slot) => {
                let mut nodes = self.living().filter(|instance| matches!(instance.role, Role::Node { .. }));
                let is_empty = nodes.all(|instance| self.slot(instance.role) != slot);
                assert!(is_empty, "slot {slot} is cleared, and somebody is in it");
                drop(nodes);
                self.segment.slots[slot] = SlotView::EMPTY;
                self.published[slot] = 0;
            }
            SegmentWrite::SetSlot(slot, state) => {
                self.segment.slots[slot].state = state;
                self.wake(Need::State);
            }
            SegmentWrite::FirstTick(slot, tick) => self.segment.slots[slot].done = tick,
            SegmentWrite::StartShadow(topic, tick) => self.shadow[topic] = tick,
            SegmentWrite::Publish(epoch) => self.publish(epoch),
            SegmentWrite::JoinTick(tick) => {
                self.join_tick = tick;
                self.wake(Need::Steering);
            }
            SegmentWrite::RequestStop => {
                self.segment.is_stop_requested = self.bug != Some(Bug::ForgetsStop);
                self.wake(Need::Steering);
            }
            SegmentWrite::Abort => {
                self.segment.is_aborted = true;
                self.wake_all();
            }
            SegmentWrite::Drained => {
                self.is_drained = true;
                self.wake_all();
            }
        }
    }

    /// One change at a time: every instance that computes has acknowledged the one before.
    fn publish(&mut self, epoch: u32) {
        let last = self.segment.epoch;
        assert!(epoch == last || epoch == last + 1, "from membership {last} to {epoch}");
        for instance in self.living().filter(|_| epoch > last) {
            let Role::Node { .. } = instance.role else { continue };
            let slot = &self.segment.slots[self.slot(instance.role)];
            let computes = matches!(instance.doing, Doing::Waiting | Doing::Sending { .. })
                && slot.state == SlotState::Taken;
            assert!(
                !computes || instance.epoch == last || slot.done >= self.segment.end_tick,
                "{:?} has not acknowledged {last}",
                instance.role
            );
        }
        self.segment.epoch = epoch;
        if self.bug != Some(Bug::LosesWakeUp) {
            self.wake_all();
        }
    }
}
