//! Handles of declared ports, with which a node reads and writes them.

use crate::error::BusError;
use crate::initial;
use crate::plan::InputPlan;
use crate::sample_ticks::SampleTicks;
use crate::schema::Schema;
use std::marker::PhantomData;

/// Handle of an input whose messages are `T`.
#[derive(Debug)]
pub struct Input<T> {
    pub(crate) index: usize,
    message: PhantomData<T>,
}

impl<T> Input<T> {
    pub(crate) fn new(index: usize) -> Self {
        Self { index, message: PhantomData }
    }
}

impl<T> Clone for Input<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Input<T> {}

/// Handle of an output whose messages are `T`.
#[derive(Debug)]
pub struct Output<T> {
    pub(crate) index: usize,
    message: PhantomData<T>,
}

impl<T> Output<T> {
    pub(crate) fn new(index: usize) -> Self {
        Self { index, message: PhantomData }
    }
}

impl<T> Clone for Output<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Output<T> {}

/// Type with which a node reads an input.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Declared {
    Typed(&'static Schema),
    Raw,
}

impl Declared {
    /// The message type, in words where any is read.
    pub(crate) fn type_name(self) -> &'static str {
        match self {
            Self::Typed(schema) => schema.type_name,
            Self::Raw => "bytes of any type",
        }
    }

    /// The sample that `input` of `node` reads before the first one is sent, if the manifest states one.
    ///
    /// # Errors
    /// If the stated value does not fit the message.
    pub(crate) fn initial_value(self, input: &InputPlan, node: &str) -> Result<Option<Box<[u64]>>, BusError> {
        let (Some(value), Self::Typed(schema)) = (&input.initial, self) else { return Ok(None) };
        initial::sample(schema, value).map(Some).map_err(|reason| BusError::InitialValue {
            node: node.to_owned(),
            port: input.port.clone(),
            type_name: schema.type_name,
            reason: reason.to_string(),
        })
    }
}

/// Indices of a component's ports among those of its node, in the order in which the component declares them.
#[derive(Debug)]
pub(crate) struct Wiring {
    pub(crate) inputs: Vec<Option<usize>>,
    pub(crate) outputs: Vec<Option<usize>>,
    /// Ticks whose steps write a sample, by output; `None` for outputs that are not wired.
    pub(crate) sends: Vec<Option<SampleTicks>>,
}
