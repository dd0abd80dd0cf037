//! A run in the memory of one thread: no processes, no shared memory, no clock.

use crate::announcement::{self, Announcement, Reader};
use crate::checkpoint::{NodePart, Parts};
use crate::depths::depths;
use crate::error::BusError;
use crate::handles::Declared;
use crate::local::LocalTopic;
use crate::membership::Membership;
use crate::message::{Message, message_bytes, view};
use crate::node::{DeclaredOutput, Node};
use crate::plan::Plan;
use crate::port::{Feed, InPort, OutPort};
use crate::registration::Registration;
use crate::remark::Remark;
use crate::run_process::{Part, finish};
use crate::schema::Schema;
use crate::stepper::{Stepped, Stepper};
use inputs::InputFiles;
use std::any::Any;
use std::marker::PhantomData;

/// The nodes of a plan, stepped one after the other on the calling thread: the samples are those that processes of the
/// same plan send, bit for bit.
///
/// A debugger, a test, or a program that looks between two ticks steps it; nothing flies without a call. A run with
/// processes has a launcher.
pub struct Simulation {
    plan: Plan,
    /// Members in the order in which they step: a reader of a sample of the same tick comes behind its publisher.
    members: Vec<Member>,
    /// Samples by topic; absent if no member sends any.
    samples: Vec<Option<LocalTopic>>,
    announcements: Vec<Option<Announcement>>,
    tick: u32,
    /// Number of members that have computed the next tick already.
    begun: usize,
    /// Number of members that `begin_step` computes.
    first: usize,
}

/// A node that steps.
struct Member {
    /// Index of the node in the plan.
    node: usize,
    part: Part,
    stepper: Stepper,
    period_ticks: u32,
    /// Words of its simulated computing time.
    words: Vec<u64>,
    /// True before its first step in the place of another component that has written its part of a checkpoint.
    succeeds: bool,
    /// Steps that took longer than to the next due tick, and due ticks without a step.
    overruns: [u32; 2],
}

/// Handle of a topic whose messages are `T`.
#[derive(Debug)]
pub struct Topic<T> {
    index: usize,
    message: PhantomData<T>,
}

impl<T> Clone for Topic<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Topic<T> {}

impl Simulation {
    /// The nodes `members` of `plan`, by their indices, before tick 0, each with its component, which is one of
    /// `components` and reads `files`. Nodes that only read may be left out.
    ///
    /// # Errors
    /// If the plan and a component do not fit.
    ///
    /// # Panics
    /// If a member reads a topic of a node that is left out.
    pub fn new(
        plan: &Plan,
        members: impl IntoIterator<Item = (usize, &'static Registration)>,
        components: &'static [Registration],
        files: &InputFiles,
    ) -> Result<Self, BusError> {
        let depths = depths(plan, &Membership::first(plan));
        let mut parts = members
            .into_iter()
            .map(|(node, registration)| Declaration::new(plan, node, registration, components, files))
            .collect::<Result<Vec<_>, BusError>>()?;
        parts.sort_by_key(|part| (depths[part.node], part.node));
        let mut announcements: Vec<Option<Announcement>> = (0..plan.topics.len()).map(|_| None).collect();
        let mut samples: Vec<Option<LocalTopic>> = (0..plan.topics.len()).map(|_| None).collect();
        for (topic, schema) in parts.iter().flat_map(|part| part.sent(plan)) {
            announcements[topic] = Some(Announcement::of(schema));
            samples[topic] = Some(LocalTopic::new(schema.size));
        }
        let members = parts.into_iter().map(|part| part.connect(plan, &announcements));
        let members = members.collect::<Result<Vec<_>, BusError>>()?;
        let first = members.len();
        Ok(Self {
            plan: plan.clone(),
            members,
            samples,
            announcements,
            tick: plan.first_tick,
            begun: 0,
            first,
        })
    }

    /// The next tick.
    #[must_use]
    pub fn tick(&self) -> u32 {
        self.tick
    }

    /// Name of the node that steps next; after a step that failed or panicked, the name of its node.
    #[must_use]
    pub fn next_node(&self) -> Option<&str> {
        self.members.get(self.begun).map(|member| member.part.name())
    }

    /// Simulation time at the start of the next tick, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        f64::from(self.tick) * self.plan.tick_s()
    }

    /// Lets the node `name`, and those that read it in the same tick, step behind all others.
    /// [`Simulation::begin_step`] computes the others, so that a caller that decides the outputs of this node first
    /// sees theirs.
    ///
    /// # Errors
    /// If there is no such node.
    ///
    /// # Panics
    /// If a tick has begun.
    pub fn step_last(&mut self, name: &str) -> Result<(), BusError> {
        assert_eq!(self.begun, 0, "nodes do not change their order within a tick");
        let named = self.members.iter().find(|member| member.part.name() == name).map(|member| member.node);
        let Some(named) = named else {
            let known = self.members.iter().map(|member| member.part.name().to_owned()).collect::<Vec<_>>();
            return Err(BusError::UnknownNode { node: name.to_owned(), known: known.join(", ") });
        };
        let mut late = vec![named];
        let sent = |nodes: &[usize], topic: usize| {
            nodes.iter().any(|&node| self.plan.nodes[node].outputs.iter().any(|output| output.topic == topic))
        };
        // A reader stands behind its publisher.
        for member in &self.members {
            let inputs = &self.plan.nodes[member.node].inputs;
            if inputs.iter().any(|input| input.delay_ticks == 0 && sent(&late, input.topic)) {
                late.push(member.node);
            }
        }
        self.members.sort_by_key(|member| late.contains(&member.node));
        self.first = self.members.len() - late.len();
        Ok(())
    }

    /// Computes the next tick of the nodes that do not step last; [`Simulation::step`] computes the others.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    pub fn begin_step(&mut self) -> Result<(), BusError> {
        self.compute(self.first, None)
    }

    /// As [`Simulation::begin_step`]; components get `given` as at [`Simulation::step_given`].
    ///
    /// # Errors
    /// As [`Simulation::step`].
    pub fn begin_step_given<T: Any>(&mut self, given: &T) -> Result<(), BusError> {
        self.compute(self.first, Some(given))
    }

    /// Computes the next tick of the members up to the number `end` that have not computed it.
    fn compute(&mut self, end: usize, given: Option<&dyn Any>) -> Result<(), BusError> {
        let tick = self.tick;
        for member in self.members.iter_mut().take(end).skip(self.begun) {
            if tick.is_multiple_of(member.period_ticks) {
                member.step(tick, &mut self.samples, given)?;
            }
            self.begun += 1;
        }
        Ok(())
    }

    /// Computes the next tick of every node that is due.
    ///
    /// # Errors
    /// If a step fails, leaves a due output unwritten, or writes a value that no message may hold. Nothing more can
    /// be computed then.
    pub fn step(&mut self) -> Result<(), BusError> {
        self.end_step(None)
    }

    /// As [`Simulation::step`]. A component that steps gets `given`, a value of the caller, by
    /// [`StepContext::given`](crate::context::StepContext::given).
    ///
    /// # Errors
    /// As [`Simulation::step`].
    pub fn step_given<T: Any>(&mut self, given: &T) -> Result<(), BusError> {
        self.end_step(Some(given))
    }

    fn end_step(&mut self, given: Option<&dyn Any>) -> Result<(), BusError> {
        self.compute(self.members.len(), given)?;
        self.tick += 1;
        self.begun = 0;
        Ok(())
    }

    /// A checkpoint of the next tick, from which another simulation of the same nodes goes on.
    ///
    /// # Panics
    /// If the tick has begun ([`Simulation::begin_step`]).
    #[must_use]
    pub fn save(&mut self) -> Parts {
        assert_eq!(self.begun, 0, "a tick that has begun is not saved");
        let (tick, samples) = (self.tick, &self.samples);
        let mut nodes: Vec<_> =
            self.members.iter_mut().map(|member| (member.node, member.save(tick, samples))).collect();
        nodes.sort_by_key(|(node, _)| *node);
        Parts { tick, nodes: nodes.into_iter().map(|(_, part)| part).collect() }
    }

    /// Goes on from `parts` of a checkpoint of the same nodes.
    ///
    /// # Errors
    /// If there is no part of a node, or one that does not fit it. Nothing more can be computed then.
    pub fn restore(&mut self, parts: &Parts) -> Result<(), BusError> {
        let samples = parts.samples();
        for member in &mut self.members {
            let node = member.part.name().to_owned();
            let part = parts.nodes.iter().find(|part| part.name == node);
            let missing =
                || BusError::Checkpoint { node: node.clone(), reason: "it has no part of it".to_owned() };
            let part = part.ok_or_else(missing)?;
            member.stepper.predecessor.clear();
            member.succeeds =
                part.is_succeeded && !part.fits(member.part.transfer(), &member.part.computation());
            if member.succeeds {
                for output in &self.plan.nodes[member.node].outputs {
                    let topic = &self.plan.topics[output.topic];
                    if let Some(announced) = &self.announcements[output.topic] {
                        let sent = InPort::of_predecessor(output, topic, announced, samples.get(&topic.name));
                        member.stepper.predecessor.push(sent);
                    }
                }
            } else {
                member.restore(part)?;
            }
            for input in &mut member.stepper.inputs {
                if let Some(sample) = samples.get(&self.plan.topics[input.topic].name) {
                    input.restore(sample, &node)?;
                }
            }
        }
        self.tick = parts.tick;
        self.begun = 0;
        Ok(())
    }

    /// The topic called `name`.
    ///
    /// # Errors
    /// If no node sends it, or its messages are not `T`.
    pub fn topic<T: Message>(&self, name: &str) -> Result<Topic<T>, BusError> {
        let index = self.topic_index(name)?;
        if let Some(announcement) = &self.announcements[index] {
            let host = Reader { node: "the simulation's host", port: name, is_built_in: false };
            announcement::check(announcement, T::SCHEMA, &self.plan, index, &host)?;
        }
        Ok(Topic { index, message: PhantomData })
    }

    /// The newest sample of `topic`; `None` before the first one.
    #[must_use]
    pub fn newest<T: Message>(&self, topic: Topic<T>) -> Option<&T> {
        let (_, words) = self.samples[topic.index].as_ref()?.newest()?;
        Some(view(words))
    }

    /// The message type of the topic called `name`, and its newest message as bytes; `None` before the first one.
    ///
    /// # Errors
    /// If no node sends it.
    pub fn newest_bytes(&self, name: &str) -> Result<(&str, Option<&[u8]>), BusError> {
        let index = self.topic_index(name)?;
        let (topic, size) =
            (&self.plan.topics[index], self.announcements[index].as_ref().map_or(0, |sent| sent.size));
        let newest = self.samples[index].as_ref().and_then(LocalTopic::newest);
        Ok((&topic.type_name, newest.map(|(_, words)| message_bytes(words, size))))
    }

    /// The number of the topic called `name`, which a node sends.
    fn topic_index(&self, name: &str) -> Result<usize, BusError> {
        let topics = self.plan.topics.iter().zip(&self.announcements);
        let index = topics.clone().position(|(topic, sent)| topic.name == name && sent.is_some());
        index.ok_or_else(|| BusError::UnknownTopic {
            topic: name.to_owned(),
            known: topics.map(|(topic, _)| topic.name.clone()).collect::<Vec<_>>().join(", "),
        })
    }

    /// Each node whose steps take simulated time: its name, the steps that took longer than to its next due tick, and the
    /// due ticks without a step.
    #[must_use]
    pub fn overruns(&self) -> Vec<(String, u32, u32)> {
        let timed = self.members.iter().filter(|member| !member.words.is_empty());
        timed.map(|member| (member.part.name().to_owned(), member.overruns[0], member.overruns[1])).collect()
    }

    /// Remarks of the components on the run, as [`Component::remark`](crate::Component::remark) returns them.
    #[must_use]
    pub fn remarks(&self) -> Vec<Remark> {
        self.members.iter().filter_map(|member| member.part.remark()).collect()
    }

    /// Finishes the components, whose ticks ended with `end`: a recorder closes its file.
    ///
    /// # Errors
    /// The error of `end`, or a component's.
    pub fn finish(self, end: Result<(), BusError>) -> Result<(), BusError> {
        finish(self.members.into_iter().map(|member| member.part), end)
    }
}

impl std::fmt::Debug for Simulation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let members = self.members.len();
        f.debug_struct("Simulation")
            .field("tick", &self.tick)
            .field("members", &members)
            .finish_non_exhaustive()
    }
}

impl Member {
    fn save(&mut self, tick: u32, samples: &[Option<LocalTopic>]) -> NodePart {
        // No sample of this tick is there yet: the newest are those that were sent before it.
        self.stepper.look_at(tick);
        let samples = self.stepper.samples_before(tick, samples);
        let (name, transfer) = (self.part.name().to_owned(), self.part.transfer());
        NodePart::new(&name, transfer, &self.part.computation(), &self.words, samples)
    }

    fn restore(&mut self, part: &NodePart) -> Result<(), BusError> {
        let transfer = self.part.transfer();
        part.restore(transfer, &mut self.part.computation(), &mut self.words)
    }

    fn step(
        &mut self,
        tick: u32,
        samples: &mut [Option<LocalTopic>],
        given: Option<&dyn Any>,
    ) -> Result<(), BusError> {
        self.stepper.gather(tick).map_err(|(_, error)| error)?;
        let computation = &mut self.part.computation().given(given);
        let takes_over = std::mem::take(&mut self.succeeds);
        match self.stepper.step(tick, takes_over, &mut self.words, samples, computation)? {
            Stepped::InTime => {}
            Stepped::Overran => self.overruns[0] += 1,
            Stepped::Skipped => self.overruns[1] += 1,
        }
        self.stepper.predecessor.clear();
        self.stepper.publish(tick, samples, |_| [0; 3], |_| {})
    }
}

/// A node that has declared its ports.
struct Declaration {
    node: usize,
    part: Part,
    inputs: Vec<Declared>,
    outputs: Vec<DeclaredOutput>,
}

impl Declaration {
    fn new(
        plan: &Plan,
        node: usize,
        registration: &'static Registration,
        components: &'static [Registration],
        files: &InputFiles,
    ) -> Result<Self, BusError> {
        let mut part = Part::of(Node::in_memory(plan, node), registration, components, files)?;
        let (inputs, outputs) = part.take_node()?.declared()?;
        Ok(Self { node, part, inputs, outputs })
    }

    /// The topics that the node sends, and their messages.
    fn sent<'a>(&'a self, plan: &'a Plan) -> impl Iterator<Item = (usize, &'static Schema)> + 'a {
        let outputs = plan.nodes[self.node].outputs.iter().zip(&self.outputs);
        outputs.map(|(output, declared)| (output.topic, declared.schema))
    }

    fn connect(mut self, plan: &Plan, announcements: &[Option<Announcement>]) -> Result<Member, BusError> {
        let node = &plan.nodes[self.node];
        let announced = |topic: usize| {
            let announcement = announcements[topic].as_ref();
            announcement.unwrap_or_else(|| panic!("no member sends {}", plan.topics[topic].name))
        };
        let outputs = node.outputs.iter().zip(&self.outputs).map(|(output, declared)| {
            let topic = &plan.topics[output.topic];
            declared.with_stamps(OutPort::new(output, topic, declared.schema, None, true))
        });
        let mut stepper = Stepper::new(plan, node, outputs.collect());
        for (input, declared) in node.inputs.iter().zip(&self.inputs) {
            let topic = &plan.topics[input.topic];
            let announcement = announced(input.topic);
            if let Declared::Typed(schema) = declared {
                announcement::check(announcement, schema, plan, input.topic, &Reader::of(node, input))?;
            }
            let initial = declared.initial_value(input, &node.name)?;
            let feed = Feed::Local { generation: 0 };
            stepper.inputs.push(InPort::new(input, topic, announcement, initial, feed));
        }
        self.part.connect(|input| {
            let topic = node.inputs[input].topic;
            (plan.topics[topic].name.as_str(), announced(topic))
        })?;
        let words = vec![0; stepper.words()];
        Ok(Member {
            node: self.node,
            part: self.part,
            stepper,
            period_ticks: node.period_ticks,
            words,
            succeeds: false,
            overruns: [0; 2],
        })
    }
}
