//! A node before its first tick: it declares its ports by name and connects them.

use crate::announcement::{self, Announcement};
use crate::claim;
use crate::component::{State, StateError, Transfer};
use crate::computation::Computation;
use crate::connected::ConnectedNode;
use crate::description::{self, Description};
use crate::error::BusError;
use crate::executor::{Executor, Member};
use crate::handles::{Declared, Input, Output, Wiring};
use crate::join::Join;
use crate::links::Links;
use crate::lockstep::{NodeView, Phase, SlotState};
use crate::membership::Membership;
use crate::message::Message;
use crate::names::process_name;
use crate::place::Place;
use crate::plan::{NodePlan, OutputPlan, Pace, Plan};
use crate::port::OutPort;
use crate::ports::{Inputs, PortSpec};
use crate::registration::{Registration, message_of};
use crate::remark;
use crate::sample_ring::SampleRing;
use crate::sample_ticks::SampleTicks;
use crate::schema::Schema;
use crate::tick::Tick;
use crate::transport::Transport;
use inputs::InputFiles;
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// A node that declares its ports by name and runs a closure. It is the base of [`DynamicNode`](crate::dynamic::DynamicNode),
/// and a tool of tests and benchmarks; programs run a [`Component`](crate::Component) by
/// [`run_process`](crate::run_process()).
///
/// ```no_run
/// use bus::messages::{PlantState, SetPoint};
///
/// fn main() -> Result<(), bus::BusError> {
///     let mut node = bus::Node::join()?;
///     let state = node.input::<PlantState>("state")?;
///     let set_point = node.output::<SetPoint>("set_point")?;
///     node.run(|tick| {
///         let altitude = tick.get(state).position.z + 0.5;
///         tick.write(set_point, SetPoint { altitude, ..Default::default() })
///     })
/// }
/// ```
#[derive(Debug)]
pub struct Node {
    run_dir: PathBuf,
    plan: Plan,
    index: usize,
    generation: u32,
    place: Place,
    node: NodePlan,
    /// The message type of each input, in the plan's order; `None` until declared.
    inputs: Vec<Option<Declared>>,
    outputs: Vec<Option<DeclaredOutput>>,
    /// First error of a declaration that does not return errors; connecting returns it.
    fault: Option<BusError>,
}

/// Declaration of an output of a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DeclaredOutput {
    pub(crate) schema: &'static Schema,
    /// True if its samples are forwarded messages, which keep their stamps.
    is_forwarded: bool,
}

impl DeclaredOutput {
    /// `port` as it keeps its stamps or sets them.
    pub(crate) fn with_stamps(self, port: OutPort) -> OutPort {
        if self.is_forwarded { port.keeping_stamps() } else { port }
    }
}

impl Node {
    /// Joins the run that started this process.
    ///
    /// # Errors
    /// If the process was not started by `hummingbus run`, or the run is gone.
    pub fn join() -> Result<Self, BusError> {
        Self::open(Join::from_environment()?)
    }

    /// Opens the part of a run that `join` names.
    pub(crate) fn open(join: Join) -> Result<Self, BusError> {
        let Join { run_dir, node, generation, place } = join;
        let plan = Plan::load(&run_dir)?;
        let index = plan.node_index(&node)?;
        let node = match generation {
            0 => plan.nodes[index].clone(),
            _ => NodePlan::load_backup(&run_dir, index, generation)?,
        };
        Ok(Self { generation, place, ..Self::undeclared(run_dir, plan, index, node) })
    }

    /// Node `index` of `plan` without a run directory: the files that it reads are its host's.
    pub(crate) fn in_memory(plan: &Plan, index: usize) -> Self {
        Self::undeclared(PathBuf::new(), plan.clone(), index, plan.nodes[index].clone())
    }

    fn undeclared(run_dir: PathBuf, plan: Plan, index: usize, node: NodePlan) -> Self {
        let (inputs, outputs) = (vec![None; node.inputs.len()], vec![None; node.outputs.len()]);
        let (generation, place) = (0, Place::Process);
        Self { run_dir, plan, index, generation, place, node, inputs, outputs, fault: None }
    }

    /// Directory of the run; `None` in memory.
    pub(crate) fn run_dir(&self) -> Option<&Path> {
        Some(&*self.run_dir).filter(|run_dir| !run_dir.as_os_str().is_empty())
    }

    /// File for the remark of the component on the run; `None` in memory.
    pub(crate) fn remark_path(&self) -> Option<PathBuf> {
        self.run_dir().map(|run_dir| remark::path(run_dir, self.index, self.generation))
    }

    /// Name of its process in the run.
    pub(crate) fn process_name(&self) -> String {
        process_name(self.name(), self.generation)
    }

    /// The node's name in the run.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.node.name
    }

    /// Simulated time between two computations of this node, in seconds.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        f64::from(self.node.period_ticks) * self.plan.tick_s()
    }

    /// The seed of the run: with the node's name it makes the node's random stream (`bus::random`).
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.plan.seed
    }

    /// The node's parameters from the manifest.
    ///
    /// # Errors
    /// If they do not fit `P`; the error names the key.
    pub fn parameters<P: DeserializeOwned>(&self) -> Result<P, BusError> {
        diagnostics::read(&self.node.parameters).map_err(|error| self.error(format!("parameters: {error}")))
    }

    /// The files that the manifest names for the node, with the bytes that they had when the run began.
    #[must_use]
    pub fn files(&self) -> InputFiles {
        InputFiles::stored(&self.run_dir.join(Plan::INPUTS), &self.node.files)
    }

    /// The plan of the run, and the node's part in it.
    pub(crate) fn plan(&self) -> (&Plan, &NodePlan) {
        (&self.plan, &self.node)
    }

    /// Declares the ports of a component.
    ///
    /// # Errors
    /// If the manifest does not wire a port that must be, or states another message type.
    pub(crate) fn declare(
        &mut self,
        component: &Registration,
        components: &'static [Registration],
    ) -> Result<Wiring, BusError> {
        if let Inputs::Forwarded { .. } = component.inputs {
            return self.declare_forwarded(component, components);
        }
        let inputs = match component.inputs {
            Inputs::Ports(ports) => {
                ports.iter().map(|port| self.declare_port(port)).collect::<Result<_, _>>()?
            }
            Inputs::Many(schema) => {
                self.declare_all(Declared::Typed(schema), |node, index| node.node.inputs[index].port.clone())
            }
            Inputs::Any => self.declare_all(Declared::Raw, |node, index| {
                node.plan.topics[node.node.inputs[index].topic].name.clone()
            }),
            Inputs::Forwarded { .. } => Vec::new(),
        };
        let outputs = self.declare_outputs(component)?;
        Ok(self.wiring(inputs, outputs))
    }

    /// Wiring of the component's ports, whose indices among those of the node are `inputs` and `outputs`.
    fn wiring(&self, inputs: Vec<Option<usize>>, outputs: Vec<Option<usize>>) -> Wiring {
        // As `OutPort::takes`: a step that takes time is sent at a tick that is not known yet.
        let is_timed = self.node.computing_time.is_some();
        let ticks = |output: &OutputPlan| {
            if is_timed { SampleTicks::every(1) } else { self.plan.topics[output.topic].ticks }
        };
        let sends = outputs.iter().map(|index| index.map(|index| ticks(&self.node.outputs[index]))).collect();
        Wiring { inputs, outputs, sends }
    }

    fn declare_outputs(&mut self, component: &Registration) -> Result<Vec<Option<usize>>, BusError> {
        let declare = |port: &PortSpec| {
            let is_named = self.node.outputs.iter().any(|output| output.port == port.name);
            let is_there = port.required || is_named;
            is_there.then(|| self.declare_output(port.name, port.schema, false)).transpose()
        };
        component.outputs.iter().map(declare).collect()
    }

    /// Declares every input with the message of its topic, and an output for each behind those of `component`.
    fn declare_forwarded(
        &mut self,
        component: &Registration,
        components: &'static [Registration],
    ) -> Result<Wiring, BusError> {
        let mut indices: Vec<usize> = (0..self.inputs.len()).collect();
        indices.sort_by_key(|&index| self.node.inputs[index].port.clone());
        let (mut inputs, mut outputs) = (Vec::new(), self.declare_outputs(component)?);
        for index in indices {
            let input = self.node.inputs[index].clone();
            let type_name = &self.plan.topics[input.topic].type_name;
            let schema = message_of(components, type_name)
                .ok_or_else(|| self.error(format!("no component of this program knows {type_name}")))?;
            self.declare_input(index, Declared::Typed(schema))?;
            inputs.push(Some(index));
            outputs.push(Some(self.declare_output(&input.port, schema, true)?));
        }
        Ok(self.wiring(inputs, outputs))
    }

    fn declare_port(&mut self, port: &PortSpec) -> Result<Option<usize>, BusError> {
        let is_wired = self.node.inputs.iter().any(|input| input.port == port.name);
        if !port.required && !is_wired {
            return Ok(None);
        }
        self.declare_typed_input(port.name, port.schema).map(Some)
    }

    /// Declares the input `port`, whose messages are `T`.
    ///
    /// # Errors
    /// If the manifest does not wire it, or the node declared it before.
    pub fn input<T: Message>(&mut self, port: &str) -> Result<Input<T>, BusError> {
        self.declare_typed_input(port, T::SCHEMA).map(Input::new)
    }

    /// Declares the input `port`, whose messages have `schema`.
    ///
    /// # Errors
    /// As [`Node::input`].
    pub(crate) fn declare_typed_input(
        &mut self,
        port: &str,
        schema: &'static Schema,
    ) -> Result<usize, BusError> {
        let index = self.input_index(port)?;
        self.declare_input(index, Declared::Typed(schema))?;
        Ok(index)
    }

    /// Declares the input `port` if the manifest wires it. A port that was declared before is refused when the node
    /// connects.
    pub fn optional_input<T: Message>(&mut self, port: &str) -> Option<Input<T>> {
        let is_wired = self.node.inputs.iter().any(|input| input.port == port);
        self.keep_fault(|node| is_wired.then(|| node.input(port)).transpose()).flatten()
    }

    /// Returns the result of `declare`; keeps its error for [`Node::connect`].
    fn keep_fault<D>(&mut self, declare: impl FnOnce(&mut Self) -> Result<D, BusError>) -> Option<D> {
        let declared = declare(self);
        declared.map_err(|fault| self.fault = self.fault.take().or(Some(fault))).ok()
    }

    /// The error for a port that the node declares a second time: the first handle would read or write bytes of the
    /// second one's type. The node cannot connect any more, even if it ignores the error.
    fn declared_twice(
        &mut self,
        direction: &'static str,
        port: &str,
        first: &'static str,
        second: &'static str,
    ) -> BusError {
        let node = self.name().to_owned();
        let error = || BusError::DeclaredTwice {
            node: node.clone(),
            direction,
            port: port.to_owned(),
            first,
            second,
        };
        self.fault.get_or_insert_with(error);
        error()
    }

    /// Declares every input, in the order of their `key`s.
    fn declare_all(
        &mut self,
        declared: Declared,
        key: impl Fn(&Self, usize) -> String,
    ) -> Vec<Option<usize>> {
        let mut indices: Vec<usize> = (0..self.inputs.len()).collect();
        for &index in &indices {
            self.keep_fault(|node| node.declare_input(index, declared));
        }
        indices.sort_by_key(|&index| key(self, index));
        indices.into_iter().map(Some).collect()
    }

    fn declare_input(&mut self, index: usize, declared: Declared) -> Result<(), BusError> {
        let Some(before) = self.inputs[index] else {
            self.inputs[index] = Some(declared);
            return Ok(());
        };
        let port = self.node.inputs[index].port.clone();
        Err(self.declared_twice("input", &port, before.type_name(), declared.type_name()))
    }

    /// Declares the output `port` if the manifest names it.
    ///
    /// # Errors
    /// If the manifest states another message type.
    pub fn optional_output<T: Message>(&mut self, port: &str) -> Result<Option<Output<T>>, BusError> {
        let is_named = self.node.outputs.iter().any(|output| output.port == port);
        is_named.then(|| self.output(port)).transpose()
    }

    /// An error of this node about its own parameters or files.
    pub fn error(&self, reason: impl Display) -> BusError {
        BusError::Parameters { node: self.name().to_owned(), reason: reason.to_string() }
    }

    fn input_index(&self, port: &str) -> Result<usize, BusError> {
        let inputs = &self.node.inputs;
        inputs.iter().position(|input| input.port == port).ok_or_else(|| BusError::UnwiredPort {
            node: self.name().to_owned(),
            direction: "input",
            port: port.to_owned(),
            verb: "wire",
            known: known(inputs.iter().map(|input| input.port.as_str())),
        })
    }

    /// Declares the output `port`, whose messages are `T`.
    ///
    /// # Errors
    /// If the manifest does not name it, or states another message type, or the node declared it before.
    pub fn output<T: Message>(&mut self, port: &str) -> Result<Output<T>, BusError> {
        let index = self.declare_output(port, T::SCHEMA, false)?;
        Ok(Output::new(index))
    }

    pub(crate) fn declare_output(
        &mut self,
        port: &str,
        schema: &'static Schema,
        is_forwarded: bool,
    ) -> Result<usize, BusError> {
        let outputs = &self.node.outputs;
        let index =
            outputs.iter().position(|output| output.port == port).ok_or_else(|| BusError::UnwiredPort {
                node: self.name().to_owned(),
                direction: "output",
                port: port.to_owned(),
                verb: "name",
                known: known(outputs.iter().map(|output| output.port.as_str())),
            })?;
        let topic = &self.plan.topics[outputs[index].topic];
        if topic.type_name != schema.type_name {
            return Err(BusError::TypeMismatch {
                node: self.name().to_owned(),
                port: port.to_owned(),
                topic: topic.name.clone(),
                expected: topic.type_name.clone(),
                found: schema.type_name.to_owned(),
            });
        }
        if let Some(before) = self.outputs[index] {
            return Err(self.declared_twice("output", port, before.schema.type_name, schema.type_name));
        }
        self.outputs[index] = Some(DeclaredOutput { schema, is_forwarded });
        Ok(index)
    }

    /// Connects the declared ports; returns when every node of the run has done so. A backup connects
    /// while the clock holds the tick from which on it computes.
    ///
    /// # Errors
    /// If a port of the manifest was not declared or declared twice, two sides disagree on a layout, or the run is aborted.
    pub(crate) fn connect(self) -> Result<ConnectedNode, BusError> {
        if self.place.is_process() && description::is_asked_for() {
            return Err(self.describe().err().unwrap_or(BusError::Aborted));
        }
        self.place.stay_on(self.node.cpu);
        if self.plan.pace == Pace::Free {
            self.place.wait_for_turn();
        }
        let transport = Rc::new(Transport::new(&self.run_dir, &self.plan.run_id, self.name(), &self.place)?);
        self.announce(transport)?.connect()
    }

    /// Writes the declared ports for a check of the manifest.
    fn describe(mut self) -> Result<(), BusError> {
        let (inputs, outputs) = self.declared()?;
        let message = |declared: &Declared| match declared {
            Declared::Typed(schema) => Some(Announcement::of(schema)),
            Declared::Raw => None,
        };
        for (input, declared) in self.node.inputs.iter().zip(&inputs) {
            declared.initial_value(input, &self.node.name)?;
        }
        let outputs = outputs.iter().map(|output| Announcement::of(output.schema)).collect();
        let description = Description { inputs: inputs.iter().map(message).collect(), outputs };
        description.store(&self.run_dir, self.index, self.generation)
    }

    /// Creates the outputs, and reports that they exist: the first half of connecting.
    ///
    /// # Errors
    /// As [`Node::connect`].
    pub(crate) fn announce(mut self, transport: Rc<Transport>) -> Result<AnnouncedNode, BusError> {
        let (inputs, declared_outputs) = self.declared()?;
        let claim = claim::claim(&self.run_dir, &self.process_name())?;
        let lockstep = NodeView::open(&self.plan, self.index, self.generation, self.place.clone())?;
        if self.generation > 0 {
            // Every topic is announced by then.
            lockstep.wait_phase(Phase::Connecting).or_aborted()?;
        }
        for (output, declared) in self.node.outputs.iter().zip(&declared_outputs) {
            self.announce_topic(output.topic, declared.schema)?;
        }
        let links = Links {
            run_dir: self.run_dir,
            plan: self.plan,
            index: self.index,
            generation: self.generation,
            node: self.node,
            lockstep,
            transport,
            _claim: claim,
        };
        let outputs = connect_outputs(&links, &declared_outputs)?;
        links.transport.reserve()?;
        links.lockstep.set_ready(Phase::Connecting);
        Ok(AnnouncedNode { links, inputs, outputs })
    }

    /// The declared inputs and outputs, in the order of the plan.
    ///
    /// # Errors
    /// If a port of the manifest was not declared, or one was declared twice.
    pub(crate) fn declared(&mut self) -> Result<(Vec<Declared>, Vec<DeclaredOutput>), BusError> {
        self.fault.take().map_or(Ok(()), Err)?;
        self.require_all_declared()?;
        let inputs = self.inputs.iter().flatten().copied().collect();
        Ok((inputs, self.outputs.iter().flatten().copied().collect()))
    }

    fn require_all_declared(&self) -> Result<(), BusError> {
        let undeclared = |direction, port: &str| BusError::UndeclaredPort {
            node: self.name().to_owned(),
            direction,
            port: port.to_owned(),
        };
        if let Some(index) = self.inputs.iter().position(Option::is_none) {
            return Err(undeclared("input", &self.node.inputs[index].port));
        }
        if let Some(index) = self.outputs.iter().position(Option::is_none) {
            return Err(undeclared("output", &self.node.outputs[index].port));
        }
        Ok(())
    }

    /// Announces the type of a topic, or checks that a backup sends the announced type.
    fn announce_topic(&self, topic: usize, schema: &Schema) -> Result<(), BusError> {
        let path = announcement::topic_path(&self.run_dir, topic);
        if self.generation == 0 {
            return announcement::store(&path, &Announcement::of(schema));
        }
        let announced = announcement::load(&path)?;
        if announced.layout_hash == schema.layout_hash() {
            return Ok(());
        }
        Err(BusError::BackupLayout {
            node: self.name().to_owned(),
            topic: self.plan.topics[topic].name.clone(),
            expected: announced.layout,
            found: schema.layout(),
        })
    }

    /// Connects, then computes `step` at every due tick until the run ends.
    ///
    /// # Errors
    /// As `Node::connect` and `ConnectedNode::run`.
    pub fn run<E: Display>(self, step: impl FnMut(&mut Tick<'_>) -> Result<(), E>) -> Result<(), BusError> {
        let member = Member::new(self.connect()?, Transfer::Nothing, Box::new(Steps(step)))?;
        Executor::alone(member).run()
    }
}

/// Steps of a node that hands over no state.
struct Steps<F>(F);

impl<E: Display, F: FnMut(&mut Tick<'_>) -> Result<(), E>> Computation for Steps<F> {
    fn configuration(&self) -> u64 {
        0
    }

    fn state_size(&self) -> usize {
        0
    }

    fn save(&self, _: &mut [u8]) {}

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        ().load(bytes)
    }

    fn step(&mut self, tick: &mut Tick<'_>) -> Result<(), String> {
        (self.0)(tick).map_err(|error| error.to_string())
    }
}

/// A node whose outputs are there.
pub(crate) struct AnnouncedNode {
    links: Links,
    inputs: Vec<Declared>,
    outputs: Vec<OutPort>,
}

impl AnnouncedNode {
    /// Connects the inputs, when every node of the run has announced its outputs.
    ///
    /// # Errors
    /// As [`Node::connect`].
    pub(crate) fn connect(self) -> Result<ConnectedNode, BusError> {
        let Self { links, inputs, outputs } = self;
        let membership = if links.generation == 0 {
            links.lockstep.wait_phase(Phase::Connecting).or_aborted()?;
            Membership::first(&links.plan)
        } else {
            links.lockstep.wait_slot(SlotState::Joining).or_aborted()?;
            // It names this process already; the others follow it when this one has connected.
            Membership::load(&links.run_dir, links.lockstep.epoch() + 1)?
        };
        ConnectedNode::new(links, inputs.into_iter(), outputs, &membership)
    }
}

fn connect_outputs(links: &Links, declared: &[DeclaredOutput]) -> Result<Vec<OutPort>, BusError> {
    let membership = Membership::first(&links.plan);
    let ports = links.node.outputs.iter().zip(declared);
    ports
        .map(|(output, &declared)| {
            let schema = declared.schema;
            let topic = &links.plan.topics[output.topic];
            let is_local = links.has_local_readers(output.topic);
            let is_recorded = links.is_recorded(output.topic);
            let is_shared = !(is_local || is_recorded) || links.is_read_outside(&membership, output.topic);
            let sender = if is_shared { Some(links.sender(output.topic, schema.size)?) } else { None };
            let mut port = OutPort::new(output, topic, schema, sender, is_local || is_recorded);
            if is_recorded || links.must_outlive(output.topic) {
                port.record(SampleRing::create(&links.plan, output.topic, schema.size)?);
            }
            Ok(declared.with_stamps(port))
        })
        .collect()
}

fn known<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<_> = names.map(|name| format!("`{name}`")).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::Node;
    use crate::join::Join;
    use crate::lockstep::{ClockView, SupervisorView};
    use crate::messages::{MotorCommand, PlantState};
    use crate::place::Place;
    use crate::plan::{InputPlan, NodePlan, OutputPlan, Plan, TopicPlan};
    use crate::sample_ticks::SampleTicks;
    use crate::tick::Tick;
    use crate::{BusError, Message};
    use std::alloc::{GlobalAlloc, Layout, System};
    use std::cell::Cell;
    use std::path::Path;

    /// Counts the allocations of each thread.
    struct Counting;

    thread_local! {
        static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    }

    // SAFETY: every call goes to the system's allocator unchanged.
    unsafe impl GlobalAlloc for Counting {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            ALLOCATIONS.set(ALLOCATIONS.get() + 1);
            // SAFETY: the caller's promise is passed on.
            unsafe { System.alloc(layout) }
        }
        unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
            // SAFETY: the caller's promise is passed on.
            unsafe { System.dealloc(pointer, layout) }
        }
    }

    #[global_allocator]
    static ALLOCATOR: Counting = Counting;

    const TICKS: u32 = 2000;
    const WARM_UP_TICKS: u32 = 500;
    const LAST_TICK: u32 = TICKS - 1;

    fn source_and_sink() -> Plan {
        let topic = TopicPlan {
            name: "/source/command".to_owned(),
            type_name: MotorCommand::SCHEMA.type_name.to_owned(),
            ticks: SampleTicks::every(1),
        };
        let input = InputPlan { port: "command".to_owned(), topic: 0, delay_ticks: 0, initial: None };
        let output = OutputPlan { port: "command".to_owned(), topic: 0 };
        let source = NodePlan::for_test("source", vec![], vec![output]);
        let sink = NodePlan::for_test("sink", vec![input], vec![]);
        Plan::for_test(TICKS, vec![topic], vec![source, sink])
    }

    /// Allocations of the calling thread's node between the warm-up and the last tick.
    fn allocations(
        mut step: impl FnMut(&mut Tick<'_>) -> Result<(), BusError>,
        node: Node,
    ) -> Result<u64, BusError> {
        let (mut at_warm, mut at_last) = (0, 0);
        node.run(|tick| {
            match tick.number() {
                WARM_UP_TICKS => at_warm = ALLOCATIONS.get(),
                LAST_TICK => at_last = ALLOCATIONS.get(),
                _ => {}
            }
            step(tick)
        })?;
        Ok(at_last - at_warm)
    }

    fn first(run_dir: &Path, node: &str) -> Join {
        Join { run_dir: run_dir.to_owned(), node: node.to_owned(), generation: 0, place: Place::Process }
    }

    fn fly_source(run_dir: &Path) -> Result<u64, BusError> {
        let mut node = Node::open(first(run_dir, "source"))?;
        let output = node.output::<MotorCommand>("command")?;
        allocations(|tick| tick.write(output, MotorCommand::default()), node)
    }

    fn fly_sink(run_dir: &Path) -> Result<u64, BusError> {
        let mut node = Node::open(first(run_dir, "sink"))?;
        let input = node.input::<MotorCommand>("command")?;
        let check = |tick: &mut Tick<'_>| {
            assert_eq!(u64::from(tick.get(input).stamp.nanosec), tick.time_ns() % 1_000_000_000);
            Ok(())
        };
        allocations(check, node)
    }

    /// Shared memory of a run, removed with this as the launcher does: iceoryx2 leaves a file of its own until the last
    /// process is gone.
    struct SharedMemory<'p>(&'p Plan);

    impl Drop for SharedMemory<'_> {
        fn drop(&mut self) {
            let prefix = crate::names::shm_prefix(&self.0.run_id);
            let files = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
            let ours = files.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix));
            ours.for_each(|file| drop(std::fs::remove_file(file.path())));
        }
    }

    #[test]
    fn a_port_that_is_declared_twice_is_refused_with_both_types_and_never_takes_the_last() {
        let folder = tempfile::tempdir().unwrap();
        let plan = source_and_sink();
        let _shared_memory = SharedMemory(&plan);
        plan.store(folder.path()).unwrap();
        let open = |name| Node::open(first(folder.path(), name)).unwrap();

        let mut source = open("source");
        source.output::<MotorCommand>("command").unwrap();
        let words = source.optional_output::<MotorCommand>("command").unwrap_err().to_string();
        assert!(words.contains("node `source` declares its output `command` twice"), "{words}");

        let mut sink = open("sink");
        sink.input::<MotorCommand>("command").unwrap();
        let words = sink.input::<PlantState>("command").unwrap_err().to_string();
        let both = "as hummingbus_msgs/msg/MotorCommand and as hummingbus_msgs/msg/PlantState";
        assert!(words.contains("declares its input `command` twice") && words.contains(both), "{words}");

        // If the declaration returns no error, or the caller ignores it, connecting returns it.
        let late: [fn(&mut Node); 2] = [
            |node| drop(node.input::<PlantState>("command")),
            |node| assert!(node.optional_input::<PlantState>("command").is_none()),
        ];
        for declare in late {
            let mut sink = open("sink");
            sink.input::<MotorCommand>("command").unwrap();
            declare(&mut sink);
            let words = sink.connect().unwrap_err().to_string();
            assert!(words.contains("declares its input `command` twice"), "{words}");
        }
    }

    #[test]
    fn a_tick_allocates_nothing_but_what_iceoryx2_allocates_for_a_loan() {
        let folder = tempfile::tempdir().unwrap();
        let plan = source_and_sink();
        let _shared_memory = SharedMemory(&plan);
        plan.store(folder.path()).unwrap();
        let _segment = SupervisorView::create(&plan).unwrap();
        let clock = ClockView::open(&plan, Place::Process).unwrap();
        let (source, sink) = std::thread::scope(|scope| {
            let source = scope.spawn(|| fly_source(folder.path()));
            let sink = scope.spawn(|| fly_sink(folder.path()));
            crate::clock::serve(&plan, &clock, None).unwrap();
            (source.join().unwrap().unwrap(), sink.join().unwrap().unwrap())
        });
        assert_eq!(sink, 0, "allocations of a sink in its ticks");
        assert_eq!(source, u64::from(LAST_TICK - WARM_UP_TICKS), "iceoryx2 0.10 allocates once a loan");
    }
}
