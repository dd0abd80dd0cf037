//! A node of a plan, stepped without a run: its inputs are given as recorded bytes, and its outputs are returned as
//! such.

use crate::announcement::Announcement;
use crate::component::{StateError, StepError};
use crate::context::StepContext;
use crate::initial;
use crate::making::make_for;
use crate::message::{BODY_START, CDR_START, cdr_bytes};
use crate::messages::Time;
use crate::plan::{InputPlan, NodePlan, Plan};
use crate::ports::{InputSamples, Inputs, OutputSamples};
use crate::registration::{Instance, Registration, message_of};
use crate::sample_memory::{SampleMemory, empty_sample};
use crate::sample_ticks::SampleTicks;
use crate::schema::Schema;
use diagnostics::ParameterError;
use inputs::InputFiles;

/// A node of a plan, stepped without a run.
///
/// It reads and sends CDR bytes, as recordings hold them, so that any component can be stepped on a recording.
pub struct NodeHarness {
    instance: Box<dyn Instance>,
    tick_ns: u64,
    inputs: Vec<Option<InputWire>>,
    outputs: Vec<OutputWire>,
    /// Ticks of the samples, by output; `None` for outputs that are not wired.
    sends: Vec<Option<SampleTicks>>,
}

/// A wired input.
struct InputWire {
    topic: usize,
    delay_ticks: u32,
    initial: Option<Box<[u64]>>,
    /// Bytes of a message in memory.
    size: usize,
}

/// An output, wired or not.
struct OutputWire {
    schema: &'static Schema,
    is_forwarded: bool,
    /// Topic and the ticks of its samples.
    topic: Option<(usize, SampleTicks)>,
}

/// A message as CDR bytes, with the index of its topic.
pub type Sample = (usize, Vec<u8>);

impl NodeHarness {
    /// Node number `node` of `plan`, which is one of `component`; the messages that it forwards are those of
    /// `components`.
    ///
    /// # Errors
    /// As [`Component::new`](crate::Component::new).
    pub fn new(
        component: &Registration,
        components: &'static [Registration],
        plan: &Plan,
        node: usize,
    ) -> Result<Self, ParameterError> {
        let node = &plan.nodes[node];
        let mut made = make_for(component, plan, node, &InputFiles::default(), None)?;
        let wire = |name: &str, schema: &'static Schema, is_forwarded: bool| {
            let output = node.outputs.iter().find(|output| output.port == name);
            let topic = output.map(|output| (output.topic, plan.topics[output.topic].ticks));
            OutputWire { schema, is_forwarded, topic }
        };
        let forwarded = forwarded(component, components, plan, node)?;
        let declared = component.outputs.iter().map(|port| wire(port.name, port.schema, false));
        let outputs = declared.chain(forwarded.iter().map(|(name, schema)| wire(name, schema, true)));
        let outputs: Vec<OutputWire> = outputs.collect();
        if !forwarded.is_empty() {
            connect(&mut *made, &forwarded)?;
        }
        Ok(Self {
            instance: made,
            tick_ns: plan.tick_ns,
            inputs: inputs(component, node, &forwarded)?,
            sends: outputs.iter().map(|wire| wire.topic.map(|(_, ticks)| ticks)).collect(),
            outputs,
        })
    }

    /// Bytes of the state.
    #[must_use]
    pub fn state(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.instance.state_size()];
        self.instance.save(&mut bytes);
        bytes
    }

    /// Continues from the state of another instance of the node.
    ///
    /// # Errors
    /// It does not fit.
    pub fn restore(&mut self, state: &[u8]) -> Result<(), StateError> {
        self.instance.load(state)
    }

    /// Computes `tick`: `newest` gives the newest sample of a topic that was sent up to a tick. Returns the samples
    /// sent.
    ///
    /// # Errors
    /// As [`Component::step`](crate::Component::step).
    pub fn step<'a>(
        &mut self,
        tick: u32,
        newest: impl Fn(usize, u32) -> Option<&'a [u8]>,
    ) -> Result<Vec<Sample>, StepError> {
        let given = |wire: &Option<InputWire>| {
            let wire = wire.as_ref()?;
            let limit = tick.checked_sub(wire.delay_ticks);
            let sample = limit.and_then(|limit| newest(wire.topic, limit));
            sample.map(|cdr| words_of(cdr, wire.size)).or_else(|| wire.initial.clone())
        };
        let given = SampleMemory::given(self.inputs.iter().map(given).collect());
        let mut sent = SampleMemory::empty(self.outputs.iter().map(|wire| wire.schema));
        let time_ns = u64::from(tick) * self.tick_ns;
        let context = StepContext { tick, time_ns, sends: &self.sends, predecessor: None, given: None };
        self.instance.step(&context, InputSamples(&given), &mut OutputSamples(&mut sent))?;
        let due = self.outputs.iter().zip(sent.samples).filter_map(|(wire, words)| {
            let (topic, ticks) = wire.topic?;
            let words = words.filter(|_| ticks.is_due(tick))?;
            let time_ns = (!wire.is_forwarded).then_some(time_ns);
            Some((topic, stamped(words, wire.schema, time_ns)))
        });
        Ok(due.collect())
    }
}

impl std::fmt::Debug for NodeHarness {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NodeHarness").field("state_size", &self.instance.state_size()).finish_non_exhaustive()
    }
}

/// A name and the message that is forwarded under it.
type Forwarded<'a> = (&'a str, &'static Schema);

/// Messages that a node forwards, by name.
fn forwarded<'a>(
    component: &Registration,
    components: &'static [Registration],
    plan: &Plan,
    node: &'a NodePlan,
) -> Result<Vec<Forwarded<'a>>, ParameterError> {
    let Inputs::Forwarded { .. } = component.inputs else { return Ok(Vec::new()) };
    let of = |input: &'a InputPlan| {
        let type_name = &plan.topics[input.topic].type_name;
        let schema = message_of(components, type_name);
        let unknown = || {
            let message =
                format!("no component has a port of {type_name}, which the input `{}` forwards", input.port);
            ParameterError::conflict(&input.port, message)
                .advised("add the component that sends it to the components")
        };
        Ok((input.port.as_str(), schema.ok_or_else(unknown)?))
    };
    let mut all = node.inputs.iter().map(of).collect::<Result<Vec<_>, ParameterError>>()?;
    all.sort_unstable_by_key(|(name, _)| *name);
    Ok(all)
}

/// Announces to a component the messages that it forwards.
fn connect(instance: &mut dyn Instance, forwarded: &[Forwarded<'_>]) -> Result<(), ParameterError> {
    let all: Vec<_> = forwarded.iter().map(|(name, schema)| (*name, Announcement::of(schema))).collect();
    let all: Vec<_> = all.iter().map(|(name, announcement)| (*name, announcement)).collect();
    instance.connected(&all).map_err(|reason| ParameterError::conflict("", reason))
}

/// The inputs of the node, in the order in which the component declares them.
fn inputs(
    component: &Registration,
    node: &NodePlan,
    forwarded: &[Forwarded<'_>],
) -> Result<Vec<Option<InputWire>>, ParameterError> {
    let wire = |name: &str, schema: &Schema| {
        let Some(input) = node.inputs.iter().find(|input| input.port == name) else { return Ok(None) };
        let initial = input.initial.as_ref().map(|value| initial::sample(schema, value)).transpose();
        let initial = initial.map_err(|reason| ParameterError::conflict(name, reason))?;
        Ok(Some(InputWire { topic: input.topic, delay_ticks: input.delay_ticks, initial, size: schema.size }))
    };
    match component.inputs {
        Inputs::Ports(ports) => ports.iter().map(|port| wire(port.name, port.schema)).collect(),
        Inputs::Many(schema) => {
            let mut names: Vec<&str> = node.inputs.iter().map(|input| input.port.as_str()).collect();
            names.sort_unstable();
            names.into_iter().map(|name| wire(name, schema)).collect()
        }
        Inputs::Forwarded { .. } => forwarded.iter().map(|&(name, schema)| wire(name, schema)).collect(),
        Inputs::Any => {
            Err(ParameterError::conflict("", "what takes any messages learns their types from a run"))
        }
    }
}

/// The words of a sample whose CDR bytes are `cdr` and whose message has `size` bytes in memory.
fn words_of(cdr: &[u8], size: usize) -> Box<[u64]> {
    let mut words = empty_sample(size);
    bytemuck::cast_slice_mut(&mut words)[CDR_START..CDR_START + cdr.len()].copy_from_slice(cdr);
    words
}

/// The CDR bytes of a sample, stamped as the bus stamps it where it stamps it at all.
fn stamped(mut words: Box<[u64]>, schema: &Schema, time_ns: Option<u64>) -> Vec<u8> {
    if let (Some(offset), Some(time_ns)) = (schema.stamp_offset(), time_ns) {
        let body: &mut [u8] = bytemuck::cast_slice_mut(&mut words[1..]);
        body[offset..offset + size_of::<Time>()].copy_from_slice(bytemuck::bytes_of(&Time::from_ns(time_ns)));
    }
    let cdr = cdr_bytes(&words, schema.size);
    let (header, message) = cdr.split_at(BODY_START - CDR_START);
    [header, schema.extent().map_or(message, |extent| extent.of(message))].concat()
}
