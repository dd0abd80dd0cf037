//! A component as a node of a run: this process, or a thread of it, takes the node's part.

use crate::announcement::Announcement;
use crate::component::{Component, StateError, Transfer};
use crate::computation::Computation;
use crate::connected::ConnectedNode;
use crate::context::StepContext;
use crate::error::BusError;
use crate::executor::{Executor, Member};
use crate::handles::Wiring;
use crate::join::Join;
use crate::making;
use crate::node::Node;
use crate::port::{InPort, Locals, OutPort};
use crate::ports::{InputSamples, OutputSamples, SampleSink, SampleSource};
use crate::registration::{Instance, Registration};
use crate::remark::Remark;
use crate::tick::Tick;
use inputs::InputFiles;
use std::any::Any;
use std::path::PathBuf;

/// Runs the component `C` as the node that the launcher started this process for: the whole `main` of an executable
/// that a manifest names as a `command`.
///
/// # Errors
/// If the process was not started by a launcher, the manifest and the component do not fit, or as the component says.
pub fn run_process<C: Component + 'static>() -> Result<(), BusError> {
    run_component(&Registration::of::<C>(), Join::from_environment()?, &[])
}

/// Runs `component` as the node that `join` names, until the run ends or another process has taken its place.
/// `components` are those of the program: forwarded messages are of their types.
///
/// # Errors
/// If the manifest and the component do not fit, a step fails, or the run is aborted.
pub fn run_component(
    component: &Registration,
    join: Join,
    components: &'static [Registration],
) -> Result<(), BusError> {
    let mut part = Part::make(join, component, components)?;
    let connected = part.take_node()?.connect()?;
    let member = part.member(connected)?;
    let end = Executor::alone(member).run();
    finish([part], end)
}

/// A node of this process before its first tick.
pub(crate) struct Part {
    name: String,
    /// Name of its process: a standby or a shadow has a number.
    process: String,
    node: Option<Node>,
    wiring: Wiring,
    instance: Box<dyn Instance>,
    transfer: Transfer,
    /// File for the remark of the component; `None` in memory.
    remark_path: Option<PathBuf>,
}

impl Part {
    /// The node that `join` names, with its component.
    pub(crate) fn make(
        join: Join,
        registration: &Registration,
        components: &'static [Registration],
    ) -> Result<Self, BusError> {
        let node = Node::open(join)?;
        let files = node.files();
        Self::of(node, registration, components, &files)
    }

    /// `node` with its component, which reads `files`.
    ///
    /// # Errors
    /// If the manifest and the component do not fit.
    pub(crate) fn of(
        mut node: Node,
        registration: &Registration,
        components: &'static [Registration],
        files: &InputFiles,
    ) -> Result<Self, BusError> {
        let wiring = node.declare(registration, components)?;
        let (plan, node_plan) = node.plan();
        let made = making::make_for(registration, plan, node_plan, files, node.run_dir());
        let instance = made.map_err(|reason| node.error(reason))?;
        let (name, transfer) = (node.name().to_owned(), registration.transfer);
        let (process, remark_path) = (node.process_name(), node.remark_path());
        Ok(Self { name, process, node: Some(node), wiring, instance, transfer, remark_path })
    }

    /// Name of the node.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Transfer of the component's state.
    pub(crate) fn transfer(&self) -> Transfer {
        self.transfer
    }

    /// The node, to be connected.
    pub(crate) fn take_node(&mut self) -> Result<Node, BusError> {
        self.node.take().ok_or_else(|| BusError::Claimed { name: self.name.clone() })
    }

    /// The node as a member of this process, once it is `connected`.
    pub(crate) fn member(&mut self, connected: ConnectedNode) -> Result<Member<'_>, BusError> {
        self.connect(|input| connected.announced(input))?;
        let transfer = self.transfer;
        Member::new(connected, transfer, Box::new(self.computation()))
    }

    /// Announces to the component the names and the messages of its inputs' topics, by `announced`.
    ///
    /// # Errors
    /// The component's objection.
    pub(crate) fn connect<'t>(
        &mut self,
        announced: impl Fn(usize) -> (&'t str, &'t Announcement),
    ) -> Result<(), BusError> {
        let topics: Vec<_> = self.wiring.inputs.iter().flatten().map(|&input| announced(input)).collect();
        let told = self.instance.connected(&topics);
        told.map_err(|error| BusError::Parameters { node: self.name.clone(), reason: error.to_string() })
    }

    /// Remark of the component on the run.
    pub(crate) fn remark(&self) -> Option<Remark> {
        Some(Remark { text: self.instance.remark()?, process: self.process.clone() })
    }

    /// Leaves the remark of the component where the launcher finds it.
    fn leave_remark(&self) -> Result<(), BusError> {
        let Some(path) = &self.remark_path else { return Ok(()) };
        self.remark().map_or(Ok(()), |remark| remark.leave(path))
    }

    /// The component with its state, as the computation that steps at each tick.
    pub(crate) fn computation(&mut self) -> Wired<'_> {
        Wired { instance: &mut *self.instance, wiring: &self.wiring, given: None }
    }
}

/// Finishes the components of `parts`, whose ticks ended with `end`.
pub(crate) fn finish(
    parts: impl IntoIterator<Item = Part>,
    end: Result<(), BusError>,
) -> Result<(), BusError> {
    let mut finished = Ok(());
    for mut part in parts {
        let left = part.leave_remark();
        let Part { name: node, instance, .. } = &mut part;
        let ended = instance.finish();
        let ended =
            ended.map_err(|error| BusError::Program { node: node.clone(), reason: error.to_string() });
        finished = finished.and(ended).and(left);
    }
    match end {
        Ok(()) | Err(BusError::Aborted) => finished.and(end),
        // The cause of a failed step makes the end fail too: the first error counts.
        Err(error) => Err(error),
    }
}

/// A component whose ports are those of a node.
pub(crate) struct Wired<'a> {
    instance: &'a mut dyn Instance,
    wiring: &'a Wiring,
    given: Option<&'a dyn Any>,
}

impl<'a> Wired<'a> {
    /// The same component; its steps get the value `given` of the program that steps it.
    pub(crate) fn given(self, given: Option<&'a dyn Any>) -> Self {
        Self { given, ..self }
    }
}

impl Computation for Wired<'_> {
    fn configuration(&self) -> u64 {
        self.instance.configuration()
    }

    fn state_size(&self) -> usize {
        self.instance.state_size()
    }

    fn save(&self, bytes: &mut [u8]) {
        self.instance.save(bytes);
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        self.instance.load(bytes)
    }

    fn adopt(&mut self, bytes: &[u8]) -> Result<bool, StateError> {
        self.instance.adopt(bytes)
    }

    fn step(&mut self, tick: &mut Tick<'_>) -> Result<(), String> {
        let (number, locals, wiring) = (tick.number(), tick.locals, self.wiring);
        let inputs = Received { tick: number, ports: tick.inputs, locals, wiring: &wiring.inputs };
        let predecessor = Received { tick: number, ports: tick.predecessor, locals, wiring: &wiring.outputs };
        let context = StepContext {
            tick: number,
            time_ns: tick.time_ns,
            sends: &wiring.sends,
            predecessor: (!tick.predecessor.is_empty()).then_some(&predecessor as &dyn SampleSource),
            given: self.given,
        };
        let mut sink = Loans { tick: number, node: tick.node, ports: tick.outputs, wiring: &wiring.outputs };
        let stepped = self.instance.step(&context, InputSamples(&inputs), &mut OutputSamples(&mut sink));
        stepped.map_err(|error| error.to_string())
    }
}

/// The samples that a node has received.
struct Received<'a> {
    tick: u32,
    ports: &'a [InPort],
    locals: &'a Locals,
    wiring: &'a [Option<usize>],
}

impl Received<'_> {
    fn port(&self, port: usize) -> Option<&InPort> {
        self.ports.get(self.wiring[port]?)
    }
}

impl SampleSource for Received<'_> {
    fn count(&self) -> usize {
        self.wiring.len()
    }

    fn words(&self, port: usize) -> Option<&[u64]> {
        self.port(port)?.newest(self.locals)
    }

    fn sent_tick(&self, port: usize) -> Option<u64> {
        self.port(port)?.sent_tick(self.locals)
    }

    fn fresh(&self, port: usize) -> Option<&[u8]> {
        Some(self.port(port)?.fresh(self.tick, self.locals)?.0)
    }

    fn restored(&self, port: usize) -> Option<&[u8]> {
        self.port(port)?.restored_cdr()
    }

    fn fresh_shadow(&self, port: usize) -> Option<&[u8]> {
        Some(self.port(port)?.fresh_shadow(self.tick)?.0)
    }
}

/// The memory that a node's samples are written to.
struct Loans<'a> {
    tick: u32,
    node: &'a str,
    ports: &'a mut [OutPort],
    wiring: &'a [Option<usize>],
}

impl SampleSink for Loans<'_> {
    fn words(&mut self, port: usize) -> Result<Option<&mut [u64]>, BusError> {
        match self.wiring[port].and_then(|index| self.ports.get_mut(index)) {
            Some(output) if output.takes(self.tick) => output.words(self.node).map(Some),
            Some(_) | None => Ok(None),
        }
    }
}
