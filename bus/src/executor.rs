//! The executor: the nodes of a process, each tick gathered, stepped and published in the order of the data.
//!
//! A process has one node, or those of a group. Members step one after the other, by tick and then by depth in the graph:
//! a reader of a sample of the same tick comes behind its publisher. So no member waits for another member. Groups do not
//! wait for each other in a circle either: along edges without delay the depth grows, and all groups step in its order.

use crate::component::Transfer;
use crate::computation::Computation;
use crate::connected::{Awaited, ConnectedNode, Turn};
use crate::depths::depths;
use crate::error::BusError;
use crate::local::LocalTopic;
use crate::membership::Membership;
use std::time::Duration;

/// Sleep of a process that has completed its ticks, between two looks whether its last samples were taken.
const RETIREMENT_NAP: Duration = Duration::from_millis(1);
/// Sleep of a group that waits while a member leaves, between two looks at that member. No count wakes a process for it.
const LEAVING_NAP: Duration = Duration::from_micros(100);
/// A group reports its progress this many times a window, so that the clock's window never runs out meanwhile.
const TELLS_PER_WINDOW: u32 = 8;

/// A node of this process.
pub(crate) struct Member<'c> {
    node: ConnectedNode,
    computation: Box<dyn Computation + 'c>,
}

impl<'c> Member<'c> {
    /// A node that computes the steps of `computation` at every due tick. The state is handed over as `transfer` says to the
    /// process that takes its place, if that has the same layout.
    ///
    /// # Errors
    /// If shared memory cannot be had.
    pub(crate) fn new(
        mut node: ConnectedNode,
        transfer: Transfer,
        mut computation: Box<dyn Computation + 'c>,
    ) -> Result<Self, BusError> {
        node.open_states(transfer, &*computation)?;
        node.go_on(&mut *computation)?;
        Ok(Self { node, computation })
    }

    fn turn(&mut self) -> Result<Turn, BusError> {
        self.node.turn(&mut *self.computation)
    }
}

/// The nodes of a process, on one thread.
pub(crate) struct Executor<'c> {
    /// Members that compute, in the order in which they step.
    members: Vec<Member<'c>>,
    /// Members that have completed their ticks, and whose last samples are not all taken yet.
    leaving: Vec<Member<'c>>,
    /// The topics of a group, by their numbers in the plan.
    locals: Vec<Option<LocalTopic>>,
    /// Ticks between two reports of a group's progress.
    tell_ticks: u32,
    /// Host time of the last look at the clock, if no node has waited since.
    now_ns: Option<u64>,
}

impl<'c> Executor<'c> {
    /// A process with one node.
    pub(crate) fn alone(member: Member<'c>) -> Self {
        let (members, leaving, locals) = (vec![member], Vec::new(), Vec::new());
        Self { members, leaving, locals, tell_ticks: 1, now_ns: None }
    }

    /// A process with a group of nodes.
    pub(crate) fn group(members: Vec<Member<'c>>) -> Self {
        let topics = members.first().map_or(0, |member| member.node.links().plan.topics.len());
        let mut locals: Vec<Option<LocalTopic>> = (0..topics).map(|_| None).collect();
        for (topic, size) in members.iter().flat_map(|member| member.node.local_topics()) {
            locals[topic] = Some(LocalTopic::new(size));
        }
        let window_ticks = members.first().map_or(1, |member| member.node.links().plan.window_ticks);
        let tell_ticks = (window_ticks / TELLS_PER_WINDOW).max(1);
        let mut group = Self { members, leaving: Vec::new(), locals, tell_ticks, now_ns: None };
        if let Some(first) = group.members.first() {
            let membership = Membership::first(&first.node.links().plan);
            group.put_in_order(&membership);
        }
        group
    }

    /// Computes every due tick of every node until the run ends, or until other processes have taken their places.
    ///
    /// # Errors
    /// If a step fails, a due output stays unwritten, a sample is lost, or the run is aborted.
    pub(crate) fn run(&mut self) -> Result<(), BusError> {
        for member in &mut self.members {
            member.node.begin(&*member.computation)?;
        }
        self.members.iter().try_for_each(|member| member.node.await_ticks())?;
        let cpu_start_ns = self.cpu_ns();
        while let Some(tick) = self.members.iter().map(|member| member.node.tick).min() {
            self.compute_tick(tick, cpu_start_ns)?;
            if tick.is_multiple_of(self.tell_ticks) {
                self.tell();
                self.look_at_leaving()?;
            }
        }
        while !self.leaving.is_empty() {
            self.look_at_leaving()?;
            if !self.leaving.is_empty() {
                std::thread::sleep(RETIREMENT_NAP);
            }
        }
        Ok(())
    }

    /// Processor time of this process or thread so far; 0 without members.
    fn cpu_ns(&self) -> u64 {
        self.members.first().map_or(0, |member| member.node.links().lockstep.place().cpu_ns())
    }

    /// Computes `tick` of every member for which it is the next.
    fn compute_tick(&mut self, tick: u32, cpu_start_ns: u64) -> Result<(), BusError> {
        let mut index = 0;
        while index < self.members.len() {
            if self.members[index].node.tick != tick {
                index += 1;
                continue;
            }
            match self.await_turn(index)? {
                Turn::Compute => {
                    let Member { node, computation } = &mut self.members[index];
                    let done_ns = node.compute(self.now_ns, &mut self.locals, &mut **computation)?;
                    // A profile states when inputs were there; a process of its own may have got them since.
                    let is_shared = !self.locals.is_empty() && !node.links().plan.profile;
                    self.now_ns = is_shared.then_some(done_ns);
                    index += 1;
                }
                Turn::Leave => {
                    let mut member = self.members.remove(index);
                    let is_alone = self.locals.is_empty();
                    // The members of a group share the processor time of their process: each counts the time of its
                    // steps.
                    let cpu_ns = if is_alone {
                        member.node.links().lockstep.place().cpu_ns() - cpu_start_ns
                    } else {
                        member.node.step_ns()
                    };
                    member.node.complete(cpu_ns);
                    self.leaving.push(member);
                }
                // The order may have changed; members that have computed the tick are passed over.
                Turn::Change | Turn::Wait(_) | Turn::Save => index = 0,
            }
        }
        Ok(())
    }

    /// Next action of member `index`, after all waiting.
    fn await_turn(&mut self, index: usize) -> Result<Turn, BusError> {
        loop {
            match self.members[index].turn()? {
                Turn::Wait(awaited) => {
                    self.tell();
                    self.look_at_leaving()?;
                    self.now_ns = None;
                    if !self.wait(index, awaited)? {
                        return Ok(Turn::Leave);
                    }
                }
                Turn::Change => {
                    self.tell();
                    self.follow()?;
                    return Ok(Turn::Change);
                }
                // While the run is held, this member may be the only one that waits.
                Turn::Save => {
                    for Member { node, computation } in &mut self.members {
                        node.write_at_hold(&self.locals, &mut **computation)?;
                    }
                }
                turn => return Ok(turn),
            }
        }
    }

    /// Waits for the need of member `index`; false if it will not be met. The run may be held until a member has left: then no
    /// need is met before, and the wait ends after a nap.
    fn wait(&self, index: usize, awaited: Awaited) -> Result<bool, BusError> {
        if self.leaving.is_empty() {
            return self.members[index].node.wait(awaited);
        }
        std::thread::sleep(LEAVING_NAP);
        Ok(true)
    }

    /// Updates the counts of all members in the control segment.
    fn tell(&mut self) {
        self.members.iter_mut().for_each(|member| member.node.tell());
    }

    /// Makes all connections agree with the newest membership.
    fn follow(&mut self) -> Result<(), BusError> {
        let Some(first) = self.members.first() else { return Ok(()) };
        let membership = first.node.newest_membership()?;
        for member in &mut self.members {
            member.node.follow(&membership, &self.locals, &*member.computation)?;
            member.node.acknowledge()?;
        }
        self.put_in_order(&membership);
        Ok(())
    }

    /// Sorts the members by their depth in the graph of `membership`.
    fn put_in_order(&mut self, membership: &Membership) {
        let Some(first) = self.members.first().filter(|_| self.members.len() > 1) else { return };
        let depths = depths(&first.node.links().plan, membership);
        self.members.sort_by_key(|member| {
            let node = member.node.links().index;
            (depths[node], node)
        });
    }

    /// Removes members from the run once their last samples were taken.
    fn look_at_leaving(&mut self) -> Result<(), BusError> {
        let mut index = 0;
        while index < self.leaving.len() {
            let node = &mut self.leaving[index].node;
            if node.has_been_read()? {
                node.leave();
                self.leaving.remove(index);
                continue;
            }
            if node.is_behind() {
                let membership = node.newest_membership()?;
                node.follow_readers(&membership, &self.locals)?;
                node.acknowledge()?;
            }
            index += 1;
        }
        Ok(())
    }
}
