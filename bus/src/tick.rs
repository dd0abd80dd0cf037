//! One computation of a node: the inputs and outputs of a tick.

use crate::error::BusError;
use crate::handles::{Input, Output};
use crate::message::{Message, view, view_mut};
use crate::port::{InPort, Locals, OutPort};

/// One computation of a node: its inputs and outputs at one tick.
#[derive(Debug)]
pub struct Tick<'a> {
    pub(crate) tick: u32,
    pub(crate) time_ns: u64,
    pub(crate) node: &'a str,
    pub(crate) inputs: &'a [InPort],
    pub(crate) locals: &'a Locals,
    pub(crate) outputs: &'a mut [OutPort],
    /// The predecessor's last samples, by output: at the first tick whose outputs count, unless a state was
    /// transferred.
    pub(crate) predecessor: &'a [InPort],
}

impl Tick<'_> {
    /// The tick's number.
    #[must_use]
    pub fn number(&self) -> u32 {
        self.tick
    }

    /// Simulation time in nanoseconds.
    #[must_use]
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Simulation time in seconds.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_ns as f64 * 1e-9
    }

    /// The newest sample of an input that this tick may see.
    #[must_use]
    pub fn get<T: Message>(&self, input: Input<T>) -> &T {
        view(self.inputs[input.index].words(self.locals))
    }

    /// Host times of the newest sample: when its sender had its inputs, was done, and sent it. For profiling only:
    /// numbers that a node computes from them are not reproducible. Zero for an initial value.
    #[must_use]
    pub fn host_times_ns<T: Message>(&self, input: Input<T>) -> [u64; 3] {
        self.inputs[input.index].host_times_ns(self.locals)
    }

    /// Writes the sample of `output`; the bus fills in its stamp. A sample that is not due is dropped.
    ///
    /// # Errors
    /// If shared memory cannot be had.
    pub fn write<T: Message>(&mut self, output: Output<T>, message: T) -> Result<(), BusError> {
        if self.outputs[output.index].takes(self.tick) {
            *self.in_place(output)? = message;
        }
        Ok(())
    }

    /// The sample of `output` in shared memory, to be written in place: for messages too large to copy.
    ///
    /// It may hold an earlier sample's values. A node that leaves some of them standing is not
    /// reproducible.
    ///
    /// # Errors
    /// If shared memory cannot be had.
    pub fn in_place<T: Message>(&mut self, output: Output<T>) -> Result<&mut T, BusError> {
        let words = self.outputs[output.index].words(self.node)?;
        Ok(view_mut(words))
    }
}
