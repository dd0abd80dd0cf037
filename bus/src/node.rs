//! A node: declare ports by name, connect, then compute tick by tick.

use crate::announcement::Announcement;
use crate::control::{Control, Edge, Phase, Waited, Word, monotonic_ns, process_cpu_ns};
use crate::error::BusError;
use crate::initial;
use crate::message::Message;
use crate::plan::{InputPlan, NodePlan, Pace, Plan};
use crate::port::{InPort, OutPort};
use crate::process::Claim;
use crate::schema::Schema;
use crate::transport::{Capacity, Transport};
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::marker::PhantomData;
use std::path::PathBuf;

/// The environment variable that names the node to itself.
pub const NODE_VARIABLE: &str = "HUMMINGBUS_NODE";

/// Handle of an input whose messages are `T`.
#[derive(Debug)]
pub struct Input<T> {
    index: usize,
    message: PhantomData<T>,
}

impl<T> Clone for Input<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Input<T> {}

/// Handle of an input whose messages are read as bytes.
#[derive(Clone, Copy, Debug)]
pub struct RawInput {
    index: usize,
}

/// Handle of an output whose messages are `T`.
#[derive(Debug)]
pub struct Output<T> {
    index: usize,
    message: PhantomData<T>,
}

impl<T> Clone for Output<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Output<T> {}

/// A node that declares its ports.
#[derive(Debug)]
pub struct Node {
    run_dir: PathBuf,
    plan: Plan,
    index: usize,
    /// The message type of each input, in the plan's order; `None` until declared.
    inputs: Vec<Option<Declared>>,
    outputs: Vec<Option<&'static Schema>>,
}

#[derive(Clone, Copy, Debug)]
enum Declared {
    Typed(&'static Schema),
    Raw,
}

impl Node {
    /// Joins the run that started this process.
    ///
    /// # Errors
    /// If the process was not started by `hummingbus run`, or the run is gone.
    pub fn join() -> Result<Self, BusError> {
        let run_dir = crate::process::join()?;
        let name =
            std::env::var(NODE_VARIABLE).map_err(|_| BusError::NotInARun { variable: NODE_VARIABLE })?;
        Self::open(run_dir, &name)
    }

    /// Opens the part of `name` in the run whose directory is `run_dir`.
    fn open(run_dir: PathBuf, name: &str) -> Result<Self, BusError> {
        let plan = Plan::load(&run_dir)?;
        let index = plan.node_index(name)?;
        let (inputs, outputs) = (plan.nodes[index].inputs.len(), plan.nodes[index].outputs.len());
        Ok(Self { run_dir, plan, index, inputs: vec![None; inputs], outputs: vec![None; outputs] })
    }

    fn node(&self) -> &NodePlan {
        &self.plan.nodes[self.index]
    }

    /// The node's name in the run.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.node().name
    }

    /// Simulated time between two computations of this node, in seconds.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        f64::from(self.node().period_ticks) * self.plan.tick_s()
    }

    /// Simulated time of one tick, in seconds.
    #[must_use]
    pub fn tick_s(&self) -> f64 {
        self.plan.tick_s()
    }

    /// Ticks per simulated second.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "a tick is at least a nanosecond")]
    pub fn rate_hz(&self) -> u32 {
        (1_000_000_000 / self.plan.tick_ns) as u32
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
        crate::kind::read_parameters(&self.node().parameters)
            .map_err(|error| self.error(format!("parameters: {error}")))
    }

    /// Declares the input `port`, whose messages are `T`.
    ///
    /// # Errors
    /// If the manifest does not wire it.
    pub fn input<T: Message>(&mut self, port: &str) -> Result<Input<T>, BusError> {
        let index = self.input_index(port)?;
        self.inputs[index] = Some(Declared::Typed(T::SCHEMA));
        Ok(Input { index, message: PhantomData })
    }

    /// Declares the input `port` if the manifest wires it.
    pub fn optional_input<T: Message>(&mut self, port: &str) -> Option<Input<T>> {
        self.input(port).ok()
    }

    /// Declares every input the manifest wires, to be read as bytes, in the order of their topics' names.
    pub fn raw_inputs(&mut self) -> Vec<RawInput> {
        self.inputs.fill(Some(Declared::Raw));
        let mut inputs: Vec<RawInput> = (0..self.inputs.len()).map(|index| RawInput { index }).collect();
        inputs.sort_by_key(|input| &self.plan.topics[self.node().inputs[input.index].topic].name);
        inputs
    }

    /// Declares the output `port` if the manifest names it.
    ///
    /// # Errors
    /// If the manifest states another message type.
    pub fn optional_output<T: Message>(&mut self, port: &str) -> Result<Option<Output<T>>, BusError> {
        let is_named = self.node().outputs.iter().any(|output| output.port == port);
        is_named.then(|| self.output(port)).transpose()
    }

    /// An error of this node about its own parameters or files.
    pub fn error(&self, reason: impl Display) -> BusError {
        BusError::Parameters { node: self.name().to_owned(), reason: reason.to_string() }
    }

    fn input_index(&self, port: &str) -> Result<usize, BusError> {
        let inputs = &self.node().inputs;
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
    /// If the manifest does not name it, or states another message type.
    pub fn output<T: Message>(&mut self, port: &str) -> Result<Output<T>, BusError> {
        let outputs = &self.node().outputs;
        let index =
            outputs.iter().position(|output| output.port == port).ok_or_else(|| BusError::UnwiredPort {
                node: self.name().to_owned(),
                direction: "output",
                port: port.to_owned(),
                verb: "name",
                known: known(outputs.iter().map(|output| output.port.as_str())),
            })?;
        let expected = &self.plan.topics[outputs[index].topic].type_name;
        if expected != T::SCHEMA.type_name {
            return Err(BusError::TypeMismatch {
                node: self.name().to_owned(),
                port: port.to_owned(),
                expected: expected.clone(),
                found: T::SCHEMA.type_name.to_owned(),
            });
        }
        self.outputs[index] = Some(T::SCHEMA);
        Ok(Output { index, message: PhantomData })
    }

    /// Connects the declared ports; returns when every node of the run has done so.
    ///
    /// # Errors
    /// If a port of the manifest was not declared, two sides disagree on a layout, or the run is aborted.
    pub fn connect(self) -> Result<ConnectedNode, BusError> {
        self.require_all_declared()?;
        let claim = crate::process::claim(&self.run_dir, self.name())?;
        let control = Control::open(&self.plan)?;
        crate::process::stay_on(self.node().cpu);
        if self.plan.pace == Pace::Free {
            crate::process::wait_for_turn();
        }
        let transport = Transport::new(&self.run_dir, &self.plan.run_id, self.name())?;
        let outputs = self.connect_outputs(&transport)?;
        control.set_ready(self.index, Phase::Connecting);
        go_on(control.wait_phase(Phase::Connecting))?;
        let (inputs, announcements) = self.connect_inputs(&transport)?;
        Ok(ConnectedNode {
            plan: self.plan,
            index: self.index,
            control,
            inputs,
            outputs,
            announcements,
            _claim: claim,
        })
    }

    fn require_all_declared(&self) -> Result<(), BusError> {
        let undeclared = |direction, port: &str| BusError::UndeclaredPort {
            node: self.name().to_owned(),
            direction,
            port: port.to_owned(),
        };
        if let Some(index) = self.inputs.iter().position(Option::is_none) {
            return Err(undeclared("input", &self.node().inputs[index].port));
        }
        if let Some(index) = self.outputs.iter().position(Option::is_none) {
            return Err(undeclared("output", &self.node().outputs[index].port));
        }
        Ok(())
    }

    fn connect_outputs(&self, transport: &Transport) -> Result<Vec<OutPort>, BusError> {
        let ports = self.node().outputs.iter().zip(self.outputs.iter().flatten());
        ports
            .map(|(output, schema)| {
                Announcement::of(schema).store(&self.run_dir, output.topic)?;
                let topic = &self.plan.topics[output.topic];
                let sender = transport.publisher(&topic.name, schema.size, self.capacity(output.topic))?;
                let readers = self.plan.edges_of_topic(output.topic).into_iter().map(Edge::Input).collect();
                Ok(OutPort::new(output, topic, schema, sender, readers))
            })
            .collect()
    }

    fn connect_inputs(&self, transport: &Transport) -> Result<(Vec<InPort>, Vec<Announcement>), BusError> {
        let first_edge = self.plan.edges_before(self.index);
        let (mut ports, mut announcements) = (Vec::new(), Vec::new());
        for (index, (input, declared)) in
            self.node().inputs.iter().zip(self.inputs.iter().flatten()).enumerate()
        {
            let topic = &self.plan.topics[input.topic];
            let announcement = Announcement::load(&self.run_dir, input.topic)?;
            if let Declared::Typed(schema) = declared {
                announcement.check(schema, self.name(), &input.port, &topic.name)?;
            }
            let initial = self.initial_value(input, *declared)?;
            let receiver = transport.subscriber(&topic.name, self.capacity(input.topic))?;
            let edge = Edge::Input(first_edge + index);
            ports.push(InPort::new(input, topic, announcement.size, edge, initial, receiver));
            announcements.push(announcement);
        }
        Ok((ports, announcements))
    }

    fn initial_value(&self, input: &InputPlan, declared: Declared) -> Result<Option<Box<[u64]>>, BusError> {
        let (Some(value), Declared::Typed(schema)) = (&input.initial, declared) else { return Ok(None) };
        initial::sample(schema, value).map(Some).map_err(|reason| BusError::InitialValue {
            node: self.name().to_owned(),
            port: input.port.clone(),
            type_name: schema.type_name,
            reason,
        })
    }

    /// A queue holds what a publisher can send before the slowest reader holds the grant back.
    fn capacity(&self, topic: usize) -> Capacity {
        let readers =
            self.plan.nodes.iter().filter(|node| node.inputs.iter().any(|input| input.topic == topic));
        let longest_period = readers.map(|node| node.period_ticks).max().unwrap_or(1);
        let ticks = u64::from(self.plan.window_ticks) + u64::from(longest_period);
        let samples = ticks.div_ceil(u64::from(self.plan.topics[topic].period_ticks)) + 2;
        Capacity {
            queued_samples: usize::try_from(samples).unwrap_or(usize::MAX),
            subscribers: self.plan.edges_of_topic(topic).len(),
            nodes: self.plan.nodes.len(),
        }
    }

    /// Connects, then computes `step` at every due tick until the run ends.
    ///
    /// # Errors
    /// As [`Node::connect`] and [`ConnectedNode::run`].
    pub fn run<E: Display>(self, step: impl FnMut(&mut Tick<'_>) -> Result<(), E>) -> Result<(), BusError> {
        self.connect()?.run(step)
    }
}

fn known<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<_> = names.map(|name| format!("`{name}`")).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

fn go_on(waited: Waited) -> Result<(), BusError> {
    if waited == Waited::Reached { Ok(()) } else { Err(BusError::Aborted) }
}

/// A node whose ports are connected.
#[derive(Debug)]
pub struct ConnectedNode {
    plan: Plan,
    index: usize,
    control: Control,
    inputs: Vec<InPort>,
    outputs: Vec<OutPort>,
    announcements: Vec<Announcement>,
    _claim: Claim,
}

impl ConnectedNode {
    /// Topic name and announced type of a raw input.
    #[must_use]
    pub fn announcement(&self, input: RawInput) -> (&str, &Announcement) {
        let topic = self.plan.nodes[self.index].inputs[input.index].topic;
        (&self.plan.topics[topic].name, &self.announcements[input.index])
    }

    /// Computes `step` at every due tick until the run ends.
    ///
    /// # Errors
    /// If a step fails, a due output stays unwritten, a sample is lost, or the run is aborted.
    pub fn run<E: Display>(
        mut self,
        mut step: impl FnMut(&mut Tick<'_>) -> Result<(), E>,
    ) -> Result<(), BusError> {
        self.control.set_ready(self.index, Phase::Running);
        go_on(self.control.wait_phase(Phase::Running))?;
        let cpu_start_ns = process_cpu_ns();
        let period = self.plan.nodes[self.index].period_ticks;
        let mut tick = 0;
        while self.await_tick(tick)? {
            self.compute(tick, &mut step)?;
            tick += period;
            self.control.advance(Word::Done(self.index), tick, &[Edge::Done(self.index)]);
        }
        // A node whose next due tick lies beyond the end has completed the run.
        self.control.set_cpu_ns(self.index, process_cpu_ns() - cpu_start_ns);
        self.control.advance(Word::Done(self.index), u32::MAX - 1, &[Edge::Done(self.index)]);
        Ok(())
    }

    /// Waits until `tick` may be computed; false when the run ends before it.
    fn await_tick(&self, tick: u32) -> Result<bool, BusError> {
        let node = &self.plan.nodes[self.index];
        let over = |control: &Control| control.end_tick() <= tick;
        if over(&self.control) {
            return self.end();
        }
        // A node without outputs holds nobody up, so it lets samples gather and is woken less often.
        let batch = if node.outputs.is_empty() { (self.plan.window_ticks / 4).max(1) } else { 1 };
        for input in &self.inputs {
            let needed = (tick + 1).saturating_sub(input.delay_ticks);
            let word = Word::Topic(input.topic);
            if self.control.count(word) >= needed {
                continue;
            }
            let granted = self.control.count(Word::Grant);
            let sleep_for = needed.max((tick + batch).min(granted).saturating_sub(input.delay_ticks));
            // A node that lets samples gather may be sent home with some of them still to be taken: all that was
            // sent before an abort is recorded.
            let waited = self.control.wait(word, sleep_for, input.edge, node.wait, over);
            if waited == Waited::Over && self.control.count(word) < needed {
                return self.end();
            }
        }
        // The inputs of this tick imply its grant, except where a node has none that are due at it.
        let edge = Edge::Grant(self.index);
        match self.control.wait(Word::Grant, tick + 1, edge, node.wait, over) {
            Waited::Reached => Ok(true),
            Waited::Over => self.end(),
        }
    }

    fn end(&self) -> Result<bool, BusError> {
        if self.control.is_aborted() { Err(BusError::Aborted) } else { Ok(false) }
    }

    fn compute<E: Display>(
        &mut self,
        tick: u32,
        step: &mut impl FnMut(&mut Tick<'_>) -> Result<(), E>,
    ) -> Result<(), BusError> {
        let node = &self.plan.nodes[self.index].name;
        for input in &mut self.inputs {
            input.take(tick, node)?;
        }
        let received_ns = monotonic_ns();
        let time_ns = u64::from(tick) * self.plan.tick_ns;
        let mut view = Tick { tick, time_ns, node, inputs: &self.inputs, outputs: &mut self.outputs };
        step(&mut view).map_err(|error| BusError::Step {
            node: node.clone(),
            tick,
            time_s: time_ns as f64 * 1e-9,
            reason: error.to_string(),
        })?;
        let done_ns = monotonic_ns();
        let mut sent_before = false;
        for output in self.outputs.iter_mut().filter(|output| output.is_due(tick)) {
            // The first output is sent at once: one look at the clock serves for both times.
            let sent_ns = if sent_before { monotonic_ns() } else { done_ns };
            output.send(tick, time_ns, [received_ns, done_ns, sent_ns], node)?;
            self.control.advance(Word::Topic(output.topic), tick + output.period_ticks, &output.readers);
            sent_before = true;
        }
        self.outputs.iter_mut().for_each(OutPort::forget);
        // Readers are awake by now: what the next tick needs is fetched while they compute.
        self.outputs.iter_mut().try_for_each(|output| output.prepare(node))?;
        Ok(())
    }
}

/// One computation of a node: its inputs and outputs at one tick.
#[derive(Debug)]
pub struct Tick<'a> {
    tick: u32,
    time_ns: u64,
    node: &'a str,
    inputs: &'a [InPort],
    outputs: &'a mut [OutPort],
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
        crate::message::view(self.inputs[input.index].words())
    }

    /// Host times of the newest sample: when its sender had its inputs, was done, and sent it. For
    /// profiling only: what a node computes from them is not reproducible. Zero for an initial value.
    #[must_use]
    pub fn host_times_ns<T: Message>(&self, input: Input<T>) -> [u64; 3] {
        self.inputs[input.index].host_times_ns()
    }

    /// The newest sample of a raw input as CDR bytes with its sequence number, if it was sent at this tick.
    #[must_use]
    pub fn fresh(&self, input: RawInput) -> Option<(&[u8], u64)> {
        self.inputs[input.index].fresh(self.tick)
    }

    /// Whether `output` is due at this tick.
    #[must_use]
    pub fn is_due<T>(&self, output: Output<T>) -> bool {
        self.outputs[output.index].is_due(self.tick)
    }

    /// Writes the sample of `output`; the bus fills in its stamp. A sample that is not due is dropped.
    ///
    /// # Errors
    /// If shared memory cannot be had.
    pub fn write<T: Message>(&mut self, output: Output<T>, message: T) -> Result<(), BusError> {
        if self.is_due(output) {
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
        Ok(crate::message::view_mut(words))
    }
}

#[cfg(test)]
mod tests {
    use super::Node;
    use crate::control::Control;
    use crate::messages::MotorCommand;
    use crate::plan::{InputPlan, NodePlan, OutputPlan, Pace, Plan, TopicPlan, Wait};
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

    fn node(name: &str, inputs: Vec<InputPlan>, outputs: Vec<OutputPlan>) -> NodePlan {
        let (wait, parameters) = (Wait::Block, serde_json::Value::Null);
        NodePlan { name: name.to_owned(), period_ticks: 1, wait, cpu: None, inputs, outputs, parameters }
    }

    fn source_and_sink() -> Plan {
        let topic = TopicPlan {
            name: "/source/command".to_owned(),
            type_name: MotorCommand::SCHEMA.type_name.to_owned(),
            period_ticks: 1,
        };
        let input = InputPlan { port: "command".to_owned(), topic: 0, delay_ticks: 0, initial: None };
        let output = OutputPlan { port: "command".to_owned(), topic: 0 };
        Plan {
            run_id: format!("test-{:x}-{:x}", std::process::id(), crate::control::monotonic_ns()),
            seed: 1,
            tick_ns: 1_000_000,
            duration_ticks: TICKS,
            window_ticks: 64,
            pace: Pace::Free,
            clock_cpu: None,
            profile: false,
            lock_memory: false,
            topics: vec![topic],
            nodes: vec![node("source", vec![], vec![output]), node("sink", vec![input], vec![])],
        }
    }

    /// Allocations of the calling thread's node between the warm-up and the last tick.
    fn allocations(
        mut step: impl FnMut(&mut super::Tick<'_>) -> Result<(), BusError>,
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

    fn fly_source(run_dir: &Path) -> Result<u64, BusError> {
        let mut node = Node::open(run_dir.to_owned(), "source")?;
        let output = node.output::<MotorCommand>("command")?;
        allocations(|tick| tick.write(output, MotorCommand::default()), node)
    }

    fn fly_sink(run_dir: &Path) -> Result<u64, BusError> {
        let mut node = Node::open(run_dir.to_owned(), "sink")?;
        let input = node.input::<MotorCommand>("command")?;
        let check = |tick: &mut super::Tick<'_>| {
            assert_eq!(u64::from(tick.get(input).stamp.nanosec), tick.time_ns() % 1_000_000_000);
            Ok(())
        };
        allocations(check, node)
    }

    /// As the launcher does: iceoryx2 leaves a file of its own until the last process is gone.
    fn remove_shared_memory(run_id: &str) {
        let prefix = crate::control::shm_prefix(run_id);
        for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&prefix) {
                std::fs::remove_file(entry.path()).unwrap();
            }
        }
    }

    #[test]
    fn a_tick_allocates_nothing_but_what_iceoryx2_allocates_for_a_loan() {
        let folder = tempfile::tempdir().unwrap();
        let plan = source_and_sink();
        plan.store(folder.path()).unwrap();
        let control = Control::create(&plan).unwrap();
        let (source, sink) = std::thread::scope(|scope| {
            let source = scope.spawn(|| fly_source(folder.path()));
            let sink = scope.spawn(|| fly_sink(folder.path()));
            crate::clock::serve(&plan, &control).unwrap();
            (source.join().unwrap().unwrap(), sink.join().unwrap().unwrap())
        });
        remove_shared_memory(&plan.run_id);
        assert_eq!(sink, 0, "allocations of a sink in its ticks");
        assert_eq!(source, u64::from(LAST_TICK - WARM_UP_TICKS), "iceoryx2 0.10 allocates once a loan");
    }
}
