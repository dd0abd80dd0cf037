//! The parts of checkpoints that a connected node writes, and the one that it goes on from.

use super::ConnectedNode;
use crate::announcement::{self, topic_path};
use crate::checkpoint::{Cause, NodePart, Samples, store_part};
use crate::computation::Computation;
use crate::error::BusError;
use crate::port::{InPort, Locals};

impl ConnectedNode {
    /// Goes on from the checkpoint from which the run does, if it does and this is the node's first process.
    ///
    /// # Errors
    /// If the checkpoint does not fit the node.
    pub(crate) fn go_on(&mut self, computation: &mut dyn Computation) -> Result<(), BusError> {
        let links = &self.links;
        if links.plan.first_tick == 0 || links.generation > 0 {
            return Ok(());
        }
        let part = NodePart::of_run(&links.run_dir, links.index)?;
        if part.is_succeeded && !self.state.fits(&part, computation) {
            return self.succeed();
        }
        self.state.restore(&part, computation)
    }

    /// Goes on from the last sample of another component before the checkpoint.
    fn succeed(&mut self) -> Result<(), BusError> {
        let links = &self.links;
        let restored = Samples::of_run(&links.run_dir, &links.plan)?;
        for output in &links.node.outputs {
            let topic = &links.plan.topics[output.topic];
            let announced = announcement::load(&topic_path(&links.run_dir, output.topic))?;
            let sent = InPort::of_predecessor(output, topic, &announced, restored.get(&topic.name));
            self.stepper.predecessor.push(sent);
        }
        self.succeeds_at = Some(self.tick);
        Ok(())
    }

    /// Writes this node's parts of the checkpoints between its last due tick and `tick`, whose inputs it has taken.
    /// It writes none if another process is the node.
    pub(super) fn write_checkpoints(
        &mut self,
        tick: u32,
        locals: &Locals,
        computation: &dyn Computation,
    ) -> Result<(), BusError> {
        while self.next_checkpoint <= tick {
            let of = self.next_checkpoint;
            self.next_checkpoint = self.links.plan.checkpoint_after(of).unwrap_or(u32::MAX);
            self.write_checkpoint(Cause::Plan, of, tick, locals, computation)?;
        }
        let asks = self.links.lockstep.checkpoint_asks();
        let asked = self.links.lockstep.checkpoint_tick();
        if asks > self.asks_answered && asked <= tick {
            self.asks_answered = asks;
            self.write_checkpoint(Cause::Request, asked, tick, locals, computation)?;
        }
        Ok(())
    }

    /// True if a checkpoint of the tick at which the run is held was requested: every sample before it is there.
    pub(crate) fn is_asked_at_hold(&self) -> bool {
        let lockstep = &self.links.lockstep;
        lockstep.checkpoint_asks() > self.asks_answered
            && lockstep.held_at() == Some(lockstep.checkpoint_tick())
            && lockstep.checkpoint_tick() <= self.tick
    }

    /// Writes this node's part of the checkpoint of the tick at which the run is held, if one was requested.
    ///
    /// # Errors
    /// If a sample is lost, or the part cannot be written.
    pub(crate) fn write_at_hold(
        &mut self,
        locals: &Locals,
        computation: &mut dyn Computation,
    ) -> Result<(), BusError> {
        if !self.is_asked_at_hold() {
            return Ok(());
        }
        let lockstep = &self.links.lockstep;
        let (asks, of) = (lockstep.checkpoint_asks(), lockstep.checkpoint_tick());
        self.asks_answered = asks;
        let taken = self.stepper.gather_before(of);
        taken.inspect_err(|&(topic, _)| lockstep.count_gap(topic)).map_err(|(_, error)| error)?;
        if self.tick >= self.retirement_tick {
            // Its backup computes the next due tick, and writes the part.
            return Ok(());
        }
        if self.links.generation > 0 && self.tick == self.take_over_tick {
            // Every tick before is computed: the predecessor has stated the state with which this process takes over.
            let failed = |reason| BusError::Program { node: self.links.node.name.clone(), reason };
            self.state.load(self.tick, computation).map_err(failed)?;
        }
        self.write_checkpoint(Cause::Request, of, self.tick, locals, computation)
    }

    /// Writes this node's part of the checkpoint at tick `of` if `tick` is the first due tick from there on.
    fn write_checkpoint(
        &self,
        cause: Cause,
        of: u32,
        tick: u32,
        locals: &Locals,
        computation: &dyn Computation,
    ) -> Result<(), BusError> {
        let links = &self.links;
        if of + links.node.period_ticks <= tick || tick < self.take_over_tick {
            return Ok(());
        }
        let samples = self.stepper.samples_before(of, locals);
        let part = self.state.part(&links.node.name, samples, computation);
        let part = part.of_process(links.generation);
        store_part(&links.run_dir, cause, of, links.index, &part)
    }
}
