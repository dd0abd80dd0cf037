//! One tick of a node, wherever it lives: its inputs are gathered, it steps, its outputs are published.

use crate::computation::Computation;
use crate::error::BusError;
use crate::plan::{NodePlan, Plan};
use crate::port::{InPort, Locals, OutPort};
use crate::saved_sample::SavedSample;
use crate::tick::Tick;
use crate::timing::{Due, Timing};

/// The connected ports of a node.
#[derive(Debug)]
pub(crate) struct Stepper {
    node: String,
    tick_ns: u64,
    pub(crate) inputs: Vec<InPort>,
    pub(crate) outputs: Vec<OutPort>,
    /// Outputs of the predecessor, read as inputs; empty where its state is handed over.
    pub(crate) predecessor: Vec<InPort>,
    /// Simulated computing time, if the steps take any.
    timing: Option<Timing>,
}

/// Result of a due tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stepped {
    /// The step is done before the next due tick.
    InTime,
    /// The step is under way beyond the next due tick.
    Overran,
    /// The step before was under way, and nothing was computed.
    Skipped,
}

impl Stepper {
    /// The ports of `node` with `outputs`, and no inputs yet.
    pub(crate) fn new(plan: &Plan, node: &NodePlan, mut outputs: Vec<OutPort>) -> Self {
        let timing = Timing::of(plan, node);
        if timing.is_some() {
            outputs.iter_mut().for_each(OutPort::set_timed);
        }
        let (inputs, predecessor) = (Vec::new(), Vec::new());
        Self { node: node.name.clone(), tick_ns: plan.tick_ns, inputs, outputs, predecessor, timing }
    }

    /// Words that the steps need behind the state of the node.
    pub(crate) fn words(&self) -> usize {
        if self.timing.is_some() { Timing::words(&self.outputs) } else { 0 }
    }

    /// Simulation time at the start of `tick`, ns.
    fn time_ns(&self, tick: u32) -> u64 {
        u64::from(tick) * self.tick_ns
    }

    /// Takes the inputs of `tick`.
    ///
    /// # Errors
    /// The number of a topic of which a sample is missing, and the sample that was found.
    pub(crate) fn gather(&mut self, tick: u32) -> Result<(), (usize, BusError)> {
        for input in &mut self.inputs {
            input.take(tick, &self.node).map_err(|error| (input.topic, error))?;
        }
        for input in &mut self.predecessor {
            input.take_available(tick, &self.node).map_err(|error| (input.topic, error))?;
        }
        Ok(())
    }

    /// Takes the samples that were sent before tick `before`, all of which are there.
    ///
    /// # Errors
    /// As [`Stepper::gather`].
    pub(crate) fn gather_before(&mut self, before: u32) -> Result<(), (usize, BusError)> {
        for input in &mut self.inputs {
            input.take_before(before, &self.node).map_err(|error| (input.topic, error))?;
        }
        Ok(())
    }

    /// Lets its inputs read the samples that members of the same process sent up to `tick`.
    pub(crate) fn look_at(&mut self, tick: u32) {
        self.inputs.iter_mut().for_each(|input| input.look_at(tick));
    }

    /// The newest samples of its inputs that were sent before tick `before`.
    pub(crate) fn samples_before(&self, before: u32, locals: &Locals) -> Vec<SavedSample> {
        self.inputs.iter().filter_map(|input| input.sample_before(before, locals)).collect()
    }

    /// Computes the step of `tick` unless the one before is under way, and writes the due outputs. `words` are those
    /// of [`Stepper::words`]. A node that `takes_over` goes on from its predecessor's last outputs.
    ///
    /// # Errors
    /// If the step fails, or left a due output unwritten.
    pub(crate) fn step(
        &mut self,
        tick: u32,
        takes_over: bool,
        words: &mut [u64],
        locals: &Locals,
        computation: &mut dyn Computation,
    ) -> Result<Stepped, BusError> {
        if takes_over && !self.predecessor.is_empty() {
            // It goes on from its predecessor's last outputs, not from a step of its own as a shadow.
            words.fill(0);
        }
        let due = self.timing.as_ref().map_or(Due::Step, |timing| timing.begin(tick, words, &self.outputs));
        let mut stepped = Stepped::Skipped;
        if due == Due::Step {
            stepped = Stepped::InTime;
            self.compute(tick, takes_over, locals, computation)?;
        }
        if let Some(timing) = &mut self.timing {
            if due == Due::Step && timing.end(tick, words, &mut self.outputs, &self.node)? {
                stepped = Stepped::Overran;
            }
            Timing::write(tick, words, &mut self.outputs, &self.node)?;
        }
        Ok(stepped)
    }

    fn compute(
        &mut self,
        tick: u32,
        takes_over: bool,
        locals: &Locals,
        computation: &mut dyn Computation,
    ) -> Result<(), BusError> {
        let (node, time_ns) = (&self.node, self.time_ns(tick));
        let predecessor = if takes_over { self.predecessor.as_slice() } else { &[] };
        let (inputs, outputs) = (self.inputs.as_slice(), self.outputs.as_mut_slice());
        let mut view = Tick { tick, time_ns, node, inputs, locals, outputs, predecessor };
        computation.step(&mut view).map_err(|reason| BusError::Step {
            node: node.clone(),
            tick,
            time_s: time_ns as f64 * 1e-9,
            reason,
        })
    }

    /// Sends the outputs that are due at `tick`. `times_ns` returns the host times of a sample, by the number of its
    /// output; `sent` is called for each sample that was sent.
    ///
    /// # Errors
    /// If a due output was not written, holds a value that no message may hold, or cannot be sent.
    pub(crate) fn publish(
        &mut self,
        tick: u32,
        locals: &mut Locals,
        mut times_ns: impl FnMut(usize) -> [u64; 3],
        mut sent: impl FnMut(&mut OutPort),
    ) -> Result<(), BusError> {
        let time_ns = self.time_ns(tick);
        let is_sent = |(_, output): &(usize, &mut OutPort)| output.is_sent(tick);
        for (index, output) in self.outputs.iter_mut().enumerate().filter(is_sent) {
            output.send(tick, time_ns, times_ns(index), &self.node, locals)?;
            sent(output);
        }
        self.outputs.iter_mut().for_each(OutPort::forget);
        // Readers are awake by now: the memory for the next tick is fetched while they compute.
        self.outputs.iter_mut().try_for_each(|output| output.prepare(&self.node))
    }
}
