//! Samples by port in a process's own memory: the inputs and outputs of a step without a run.

use crate::error::BusError;
use crate::message::{ENCAPSULATION_WORD, sample_words};
use crate::ports::{OutputPorts, OutputSamples, SampleSink, SampleSource};
use crate::schema::Schema;

/// Samples by port.
#[derive(Debug, Default, PartialEq)]
pub struct SampleMemory {
    /// Sizes in bytes of the messages that can be written, by port; empty if none is written.
    sizes: Vec<usize>,
    pub samples: Vec<Option<Box<[u64]>>>,
}

impl SampleMemory {
    /// An empty memory, to be written to ports of `schemas`.
    pub fn empty(schemas: impl Iterator<Item = &'static Schema>) -> Self {
        let sizes: Vec<usize> = schemas.map(|schema| schema.size).collect();
        Self { samples: vec![None; sizes.len()], sizes }
    }

    /// A memory with `samples`, to be read.
    pub fn given(samples: Vec<Option<Box<[u64]>>>) -> Self {
        Self { sizes: Vec::new(), samples }
    }

    /// The samples of `outputs`.
    pub fn of<O: OutputPorts>(outputs: O) -> Self {
        let mut memory = Self::empty(O::DECLARED.iter().map(|port| port.schema));
        let written = outputs.write(&mut OutputSamples(&mut memory));
        written.unwrap_or_else(|error| unreachable!("this memory is there: {error}"));
        memory
    }
}

impl SampleSource for SampleMemory {
    fn count(&self) -> usize {
        self.samples.len()
    }

    fn words(&self, port: usize) -> Option<&[u64]> {
        self.samples[port].as_deref()
    }

    fn sent_tick(&self, _: usize) -> Option<u64> {
        None
    }

    fn fresh(&self, _: usize) -> Option<&[u8]> {
        None
    }

    fn fresh_shadow(&self, _: usize) -> Option<&[u8]> {
        None
    }
}

impl SampleSink for SampleMemory {
    fn words(&mut self, port: usize) -> Result<Option<&mut [u64]>, BusError> {
        Ok(Some(self.samples[port].insert(empty_sample(self.sizes[port]))))
    }
}

/// A sample of zeros whose message has `size` bytes.
pub fn empty_sample(size: usize) -> Box<[u64]> {
    let mut words = vec![0; sample_words(size)].into_boxed_slice();
    words[0] = ENCAPSULATION_WORD;
    words
}
