//! A node whose ports and state are known at run time: the part that bindings to other languages stand on.
//!
//! A program declares its ports with [schemas](MessageDescription), and reads and writes messages as bytes. The
//! layouts are compared as for Rust. The state is a block of bytes that the program changes in place. The bus copies
//! it for a process that takes the node's place, and into checkpoints.

mod message;

use crate::component::{StateError, Transfer};
use crate::computation::Computation;
use crate::error::BusError;
use crate::executor::{Executor, Member};
use crate::message::{BODY_START, message_bytes};
use crate::node::Node;
use crate::schema::Schema;
use crate::tick::Tick;
use inputs::InputFiles;
use serde_json::Value;
use std::mem::ManuallyDrop;

pub use message::{FieldDescription, KindDescription, MessageDescription};

/// A node before its first tick.
///
/// ```no_run
/// use bus::Message;
/// use bus::dynamic::DynamicNode;
/// use bus::messages::{PlantState, SetPoint};
///
/// fn main() -> Result<(), bus::BusError> {
///     let mut node = DynamicNode::join()?;
///     let state = node.input("state", PlantState::SCHEMA)?;
///     let set_point = node.output("set_point", SetPoint::SCHEMA)?;
///     node.run(|tick| {
///         let position_z = tick.input(state)?[24..32].to_vec();
///         let Some(message) = tick.output(set_point)? else { return Ok(()) };
///         message[8..16].copy_from_slice(&position_z);
///         Ok(())
///     })
/// }
/// ```
#[derive(Debug)]
pub struct DynamicNode {
    node: Node,
    inputs: Vec<DynamicPort>,
    outputs: Vec<DynamicPort>,
    state: Option<StateMemory>,
}

/// A declared port.
#[derive(Clone, Copy, Debug)]
struct DynamicPort {
    /// Place among the ports of the node.
    index: usize,
    /// Bytes of a message.
    size: usize,
}

/// Memory of a state, which the program changes in place.
#[derive(Debug)]
struct StateMemory {
    schema: &'static Schema,
    /// A box of `words` words that is never freed: the program may keep the pointer, and a process is one node.
    start: *mut u64,
    words: usize,
}

// SAFETY: the memory is there as long as the process is.
unsafe impl Send for StateMemory {}

impl DynamicNode {
    /// Joins the run that started this process.
    ///
    /// # Errors
    /// If the process was not started by a launcher, or the run is gone.
    pub fn join() -> Result<Self, BusError> {
        Ok(Self { node: Node::join()?, inputs: Vec::new(), outputs: Vec::new(), state: None })
    }

    /// The node's name in the run.
    #[must_use]
    pub fn name(&self) -> &str {
        self.node.name()
    }

    /// Simulated time between two computations of this node, in seconds.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.node.period_s()
    }

    /// The seed of the run.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.node.seed()
    }

    /// The node's parameters from the manifest.
    #[must_use]
    pub fn parameters(&self) -> &Value {
        &self.node.plan().1.parameters
    }

    /// The files that the manifest names for the node, with the bytes that they had when the run began.
    #[must_use]
    pub fn files(&self) -> InputFiles {
        self.node.files()
    }

    /// Inputs that the manifest wires, with the types of their topics.
    pub fn wired_inputs(&self) -> impl Iterator<Item = (&str, &str)> {
        let (plan, node) = self.node.plan();
        node.inputs.iter().map(|input| (input.port.as_str(), plan.topics[input.topic].type_name.as_str()))
    }

    /// Outputs that the manifest names, with the types of their topics.
    pub fn named_outputs(&self) -> impl Iterator<Item = (&str, &str)> {
        let (plan, node) = self.node.plan();
        node.outputs.iter().map(|output| (output.port.as_str(), plan.topics[output.topic].type_name.as_str()))
    }

    /// Declares the input `port`; returns its number for [`DynamicTick::input`].
    ///
    /// # Errors
    /// If the manifest does not wire it, or the node declared it before.
    pub fn input(&mut self, port: &str, schema: &'static Schema) -> Result<usize, BusError> {
        let index = self.node.declare_typed_input(port, schema)?;
        self.inputs.push(DynamicPort { index, size: schema.size });
        Ok(self.inputs.len() - 1)
    }

    /// Declares the output `port`; returns its number for [`DynamicTick::output`].
    ///
    /// # Errors
    /// If the manifest does not name it, or states another message type, or the node declared it before.
    pub fn output(&mut self, port: &str, schema: &'static Schema) -> Result<usize, BusError> {
        let index = self.node.declare_output(port, schema, false)?;
        self.outputs.push(DynamicPort { index, size: schema.size });
        Ok(self.outputs.len() - 1)
    }

    /// Declares the state as one value of `schema`; returns its memory, zeros aligned to eight bytes, which stay
    /// where they are as long as the process lives. Everything that changes from tick to tick belongs there: a
    /// process that takes the node's place goes on from it. The bus reads and writes it between steps.
    ///
    /// # Errors
    /// If the node declared it before.
    pub fn state(&mut self, schema: &'static Schema) -> Result<*mut u8, BusError> {
        if let Some(before) = &self.state {
            let both = format!(
                "declares its state twice, as {} and as {}",
                before.schema.type_name, schema.type_name
            );
            return Err(self.node.error(both));
        }
        let memory = StateMemory::of(schema);
        let start = memory.start.cast();
        self.state = Some(memory);
        Ok(start)
    }

    /// An error of this node about its own parameters or files.
    pub fn error(&self, reason: impl std::fmt::Display) -> BusError {
        self.node.error(reason)
    }

    /// Connects, then computes `step` at every due tick until the run ends or another process has taken the node's place.
    ///
    /// # Errors
    /// If the manifest and the declarations do not fit, or two sides disagree on a layout. If a step fails or
    /// leaves a due output unwritten. If the run is aborted.
    pub fn run(
        mut self,
        step: impl FnMut(&mut DynamicTick<'_, '_>) -> Result<(), String>,
    ) -> Result<(), BusError> {
        let state = self.state.take();
        let transfer = state.as_ref().map_or(Transfer::Nothing, |state| Transfer::Message(state.schema));
        self.execute(transfer, StepsInMemory { state, step })
    }

    /// As [`run`](Self::run), for a program that saves its state itself: one that has called
    /// [`state`](Self::state) loses that memory.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_program<P: Program>(self, program: P) -> Result<(), BusError> {
        let transfer = program.state_size().map_or(Transfer::Nothing, |_| Transfer::Bytes(P::STATE_TYPE));
        self.execute(transfer, program)
    }

    fn execute(self, transfer: Transfer, program: impl Program) -> Result<(), BusError> {
        let Self { node, inputs, outputs, .. } = self;
        let steps = DynamicSteps { inputs, outputs, program };
        let member = Member::new(node.connect()?, transfer, Box::new(steps))?;
        let mut executor = ManuallyDrop::new(Executor::alone(member));
        let ended = executor.run();
        if ended.is_ok() {
            drop(ManuallyDrop::into_inner(executor));
        }
        // After an error the program may look at messages of the step that failed, until its process ends: they stay mapped.
        ended
    }
}

impl StateMemory {
    fn of(schema: &'static Schema) -> Self {
        let words = schema.size.div_ceil(8);
        let start = Box::into_raw(vec![0_u64; words].into_boxed_slice()).cast();
        Self { schema, start, words }
    }

    /// Runs `with` on the bytes of the state.
    fn bytes<R>(&self, with: impl FnOnce(&mut [u8]) -> R) -> R {
        // SAFETY: the memory is that of the box, of `words` words. The program changes it in its steps only, which this does
        // not run beside.
        let words = unsafe { std::slice::from_raw_parts_mut(self.start, self.words) };
        with(&mut bytemuck::cast_slice_mut(words)[..self.schema.size])
    }
}

/// Steps of a program that saves its state itself, as bytes whose number does not change.
pub trait Program {
    /// Type of the state, for messages.
    const STATE_TYPE: &'static str;

    /// Number that differs between two programs of which one cannot go on from the state of the other.
    fn configuration(&self) -> u64;

    /// Bytes of the state; `None` if it is not saved.
    fn state_size(&self) -> Option<usize>;

    /// Writes the state.
    fn save(&self, bytes: &mut [u8]);

    /// Goes on from a state.
    ///
    /// # Errors
    /// Its size or its contents do not fit.
    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError>;

    /// Computes a tick.
    ///
    /// # Errors
    /// A reason, with which the run ends.
    fn step(&mut self, tick: &mut DynamicTick<'_, '_>) -> Result<(), String>;
}

/// A step that keeps its state in memory which the bus reads and writes.
struct StepsInMemory<F> {
    state: Option<StateMemory>,
    step: F,
}

impl<F: FnMut(&mut DynamicTick<'_, '_>) -> Result<(), String>> Program for StepsInMemory<F> {
    const STATE_TYPE: &'static str = "state";

    fn configuration(&self) -> u64 {
        0
    }

    fn state_size(&self) -> Option<usize> {
        self.state.as_ref().map(|state| state.schema.size)
    }

    fn save(&self, bytes: &mut [u8]) {
        if let Some(state) = &self.state {
            state.bytes(|memory| bytes.copy_from_slice(memory));
        }
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        if let Some(state) = &self.state {
            StateError::check_size(state.schema.type_name, state.schema.size, bytes)?;
            state.bytes(|memory| memory.copy_from_slice(bytes));
        }
        Ok(())
    }

    fn step(&mut self, tick: &mut DynamicTick<'_, '_>) -> Result<(), String> {
        (self.step)(tick)
    }
}

/// A program with its ports.
struct DynamicSteps<P> {
    inputs: Vec<DynamicPort>,
    outputs: Vec<DynamicPort>,
    program: P,
}

impl<P: Program> Computation for DynamicSteps<P> {
    fn configuration(&self) -> u64 {
        self.program.configuration()
    }

    fn state_size(&self) -> usize {
        self.program.state_size().unwrap_or(0)
    }

    fn save(&self, bytes: &mut [u8]) {
        self.program.save(bytes);
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        self.program.load(bytes)
    }

    fn step(&mut self, tick: &mut Tick<'_>) -> Result<(), String> {
        self.program.step(&mut DynamicTick { tick, inputs: &self.inputs, outputs: &self.outputs })
    }
}

/// One computation: messages as bytes.
#[derive(Debug)]
pub struct DynamicTick<'s, 't> {
    tick: &'s mut Tick<'t>,
    inputs: &'s [DynamicPort],
    outputs: &'s [DynamicPort],
}

impl DynamicTick<'_, '_> {
    /// The tick's number.
    #[must_use]
    pub fn number(&self) -> u32 {
        self.tick.number()
    }

    /// Simulation time in nanoseconds.
    #[must_use]
    pub fn time_ns(&self) -> u64 {
        self.tick.time_ns()
    }

    /// The newest message of input `input` that this tick may see, in shared memory: aligned to eight bytes.
    ///
    /// # Errors
    /// If there is no such input.
    pub fn input(&self, input: usize) -> Result<&[u8], String> {
        let DynamicPort { index, size } = port(self.inputs, input, "input")?;
        Ok(message_bytes(self.tick.inputs[index].words(self.tick.locals), size))
    }

    /// Memory of the message of output `output`, aligned to eight bytes: zeros until the step writes them; `None` where the step
    /// sends none. The bus fills in its stamp.
    ///
    /// # Errors
    /// If there is no such output, or shared memory cannot be had.
    pub fn output(&mut self, output: usize) -> Result<Option<&mut [u8]>, String> {
        let DynamicPort { index, size } = port(self.outputs, output, "output")?;
        let port = &mut self.tick.outputs[index];
        if !port.takes(self.tick.tick) {
            return Ok(None);
        }
        let is_first = !port.is_written();
        let words = port.words(self.tick.node).map_err(|error| error.to_string())?;
        let message = &mut bytemuck::cast_slice_mut(words)[BODY_START..][..size];
        if is_first {
            // It may hold an earlier sample.
            message.fill(0);
        }
        Ok(Some(message))
    }

    /// Last message on output `output` of the process that this one replaces: the command to go on from without a
    /// jump. It is present only at the tick of the replacement, and only if no state was transferred.
    ///
    /// # Errors
    /// If there is no such output.
    pub fn predecessor(&self, output: usize) -> Result<Option<&[u8]>, String> {
        let DynamicPort { index, size } = port(self.outputs, output, "output")?;
        let sent = self.tick.predecessor.get(index).and_then(|port| port.newest(self.tick.locals));
        Ok(sent.map(|words| message_bytes(words, size)))
    }
}

/// The port of this number among those that were declared.
fn port(ports: &[DynamicPort], number: usize, direction: &str) -> Result<DynamicPort, String> {
    ports.get(number).copied().ok_or_else(|| {
        format!(
            "the step asks for {direction} number {number}; the program has declared {} (counted from 0)",
            ports.len()
        )
    })
}
