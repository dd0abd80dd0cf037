//! A connected node: waits for what a tick needs, computes it, sends, and follows the changes of the run.

use crate::announcement::{self, Announcement};
use crate::control::{
    Control, Phase, Sequence, SlotState, Transfer, Waited, Waiter, monotonic_ns, process_cpu_ns,
};
use crate::error::BusError;
use crate::initial;
use crate::membership::{Membership, NodeInstances};
use crate::message::Message;
use crate::node::{Declared, RawInput, require_reached};
use crate::plan::{InputPlan, NodePlan, Plan};
use crate::port::{InPort, OutPort, Source};
use crate::process::Claim;
use crate::profile::TickWriter;
use crate::schema::Schema;
use crate::state_transfer::StateRing;
use crate::tick::Tick;
use crate::transport::Transport;
use std::fmt::Display;
use std::path::PathBuf;
use std::time::Duration;

/// How long a process that retires sleeps before it looks again who still reads its last samples.
const RETIREMENT_NAP: Duration = Duration::from_millis(1);

/// What ties a node to its run.
#[derive(Debug)]
pub(crate) struct Links {
    pub(crate) run_dir: PathBuf,
    pub(crate) plan: Plan,
    pub(crate) index: usize,
    pub(crate) generation: u32,
    pub(crate) node: NodePlan,
    pub(crate) control: Control,
    pub(crate) transport: Transport,
    pub(crate) _claim: Claim,
}

/// A node whose ports are connected.
#[derive(Debug)]
pub struct ConnectedNode {
    inputs: Vec<InPort>,
    outputs: Vec<OutPort>,
    announcements: Vec<Announcement>,
    /// What the predecessor sends, by output; empty where its state is handed over.
    predecessor: Vec<InPort>,
    /// Where the predecessor states its state, and where this process does.
    handed: Option<StateRing>,
    stated: Option<StateRing>,
    /// The tick from which on this process goes on by itself, no longer as its predecessor's shadow.
    take_over_tick: u32,
    /// The tick from which on a successor takes this process's place.
    retirement_tick: u32,
    first_tick: u32,
    epoch: u32,
    profile: Option<TickWriter>,
    // The transport last: the ports give back what they hold while it stands.
    links: Links,
}

/// What a wait for a tick came to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Await {
    /// The tick can be computed.
    Tick,
    /// The membership has changed.
    Change,
    /// The run ends before the tick.
    End,
}

impl ConnectedNode {
    pub(crate) fn new(
        links: Links,
        declared: impl Iterator<Item = Declared>,
        outputs: Vec<OutPort>,
        membership: &Membership,
    ) -> Result<Self, BusError> {
        let own = membership.nodes[links.index].of(links.generation);
        let first_tick = own.map_or(0, |instance| instance.join_tick);
        let mut node = Self {
            inputs: Vec::new(),
            outputs,
            announcements: Vec::new(),
            predecessor: Vec::new(),
            handed: None,
            stated: None,
            take_over_tick: 0,
            retirement_tick: u32::MAX,
            first_tick,
            epoch: membership.epoch,
            profile: None,
            links,
        };
        node.connect_inputs(declared, membership)?;
        node.follow(membership, first_tick)?;
        node.links.transport.reserve()?;
        if node.links.plan.profile {
            let links = &node.links;
            let (index, generation) = (links.index, links.generation);
            node.profile =
                Some(TickWriter::create(&links.run_dir, &links.plan, index, generation, first_tick)?);
        }
        node.links.control.set_process(node.links.slot());
        node.links.control.acknowledge(node.links.slot(), membership.epoch);
        Ok(node)
    }

    fn connect_inputs(
        &mut self,
        declared: impl Iterator<Item = Declared>,
        membership: &Membership,
    ) -> Result<(), BusError> {
        let links = &self.links;
        for (index, (input, declared)) in links.node.inputs.iter().zip(declared).enumerate() {
            let topic = &links.plan.topics[input.topic];
            let announcement = Announcement::load(&announcement::topic_path(&links.run_dir, input.topic))?;
            if let Declared::Typed(schema) = declared {
                announcement.check(schema, &links.node.name, &input.port, &topic.name)?;
            }
            let initial = links.initial_value(input, declared)?;
            let generation = links.publisher(membership, input.topic).primary.generation;
            let receiver = links.subscriber(input.topic, generation)?;
            let limit = self.first_tick.checked_sub(input.delay_ticks);
            let source = Source::joined(generation, receiver, limit, topic.period_ticks);
            let waiter = links.plan.input_waiter(links.slot(), index);
            let mut port = InPort::new(input, topic, announcement.size, waiter, initial, source);
            port.reads_shadow = matches!(declared, Declared::Raw);
            self.inputs.push(port);
            self.announcements.push(announcement);
        }
        Ok(())
    }

    /// Topic name and announced type of a raw input.
    #[must_use]
    pub fn announcement(&self, input: RawInput) -> (&str, &Announcement) {
        self.announced(input.index)
    }

    /// Topic name and announced type of input `input`.
    pub(crate) fn announced(&self, input: usize) -> (&str, &Announcement) {
        let topic = self.links.node.inputs[input].topic;
        (&self.links.plan.topics[topic].name, &self.announcements[input])
    }

    /// Computes `step` at every due tick until the run ends, or until a successor has taken over.
    ///
    /// # Errors
    /// If a step fails, a due output stays unwritten, a sample is lost, or the run is aborted.
    pub fn run<E: Display>(
        self,
        mut step: impl FnMut(&mut Tick<'_>) -> Result<(), E>,
    ) -> Result<(), BusError> {
        self.run_with_state_of(None, &mut [], |tick, _| step(tick))
    }

    /// As [`ConnectedNode::run`], for a node that remembers something from tick to tick: `state` is handed
    /// over to a successor that knows the same type, and to one that is started after a crash.
    ///
    /// # Errors
    /// As [`ConnectedNode::run`].
    pub fn run_with_state<S: Message, E: Display>(
        self,
        mut state: S,
        mut step: impl FnMut(&mut Tick<'_>, &mut S) -> Result<(), E>,
    ) -> Result<(), BusError> {
        self.run_with_state_of(Some(S::SCHEMA), bytemuck::bytes_of_mut(&mut state), |tick, state| {
            step(tick, bytemuck::from_bytes_mut(state))
        })
    }

    /// The same with a state that is a message of `schema`; none where that is `None`.
    pub(crate) fn run_with_state_of<E: Display>(
        mut self,
        schema: Option<&'static Schema>,
        state: &mut [u8],
        mut step: impl FnMut(&mut Tick<'_>, &mut [u8]) -> Result<(), E>,
    ) -> Result<(), BusError> {
        self.open_predecessor(schema)?;
        if let Some(schema) = schema {
            let links = &self.links;
            let (dir, plan) = (&links.run_dir, &links.plan);
            self.stated = Some(StateRing::create(dir, plan, links.index, links.generation, schema)?);
        }
        self.fly(state, |tick, state| step(tick, state).map_err(|error| error.to_string()))
    }

    /// Opens the state of the process that this one succeeds, or else what it sends.
    fn open_predecessor(&mut self, state: Option<&Schema>) -> Result<(), BusError> {
        let links = &self.links;
        if links.generation == 0 {
            return Ok(());
        }
        let generation = Membership::load(&links.run_dir, self.epoch)?.nodes[links.index].primary.generation;
        if let Some(schema) = state {
            self.handed = StateRing::open(&links.run_dir, &links.plan, links.index, generation, schema)?;
        }
        if self.handed.is_some() {
            links.control.set_transfer(links.slot(), Transfer::State);
            return Ok(());
        }
        links.control.set_transfer(links.slot(), Transfer::LastOutput);
        for output in &links.node.outputs {
            let topic = &links.plan.topics[output.topic];
            let receiver = links.subscriber(output.topic, generation)?;
            let limit = self.first_tick.checked_sub(1);
            let source = Source::joined(generation, receiver, limit, topic.period_ticks);
            let input =
                InputPlan { port: output.port.clone(), topic: output.topic, delay_ticks: 1, initial: None };
            let size = Announcement::load(&announcement::topic_path(&links.run_dir, output.topic))?.size;
            self.predecessor.push(InPort::new(&input, topic, size, 0, None, source));
        }
        links.transport.reserve()
    }

    fn fly(
        &mut self,
        state: &mut [u8],
        mut step: impl FnMut(&mut Tick<'_>, &mut [u8]) -> Result<(), String>,
    ) -> Result<(), BusError> {
        // Last, when all that the ticks use is mapped: a mapping that exceeds the limit later fails without words.
        if self.links.plan.lock_memory {
            crate::process::lock_memory()?;
        }
        let slot = self.links.slot();
        if self.links.generation == 0 {
            // Who takes its place may have to begin with the first tick.
            self.publish_state(self.first_tick, state);
        }
        self.links.control.set_ready(slot, Phase::Running);
        if self.links.generation == 0 {
            require_reached(self.links.control.wait_phase(Phase::Running))?;
        } else {
            require_reached(self.links.control.wait_slot(slot, SlotState::Taken))?;
        }
        let cpu_start_ns = process_cpu_ns();
        let period = self.links.node.period_ticks;
        let mut tick = self.first_tick;
        while self.await_tick(tick, state)? {
            if self.links.generation > 0 && tick <= self.take_over_tick.max(self.first_tick) {
                // What it begins with is its predecessor's, not what it came to itself.
                self.publish_state(tick, state);
            }
            self.compute(tick, state, &mut step)?;
            tick += period;
            self.links.control.advance(Sequence::Done(slot), tick, &self.links.done_waiters());
        }
        // A node whose next due tick lies beyond the end has completed the run.
        self.links.control.set_cpu_ns(slot, process_cpu_ns() - cpu_start_ns);
        self.links.control.advance(Sequence::Done(slot), u32::MAX - 1, &self.links.done_waiters());
        self.await_readers(tick)
    }

    /// States the state at the start of `tick`, for whoever takes over there.
    fn publish_state(&self, tick: u32, state: &[u8]) {
        if let Some(ring) = &self.stated {
            ring.store(tick, state);
            let links = &self.links;
            // A count of zero is no state.
            links.control.advance(
                Sequence::State(links.slot()),
                tick + 1,
                &[Waiter::Replacement(links.other_slot())],
            );
        }
    }

    /// Waits until `tick` may be computed; false when the run ends, or this process's part in it, before it.
    fn await_tick(&mut self, tick: u32, state: &mut [u8]) -> Result<bool, BusError> {
        loop {
            let awaited = if self.links.control.epoch() != self.epoch {
                Await::Change
            } else if self.links.control.end_tick() <= tick {
                Await::End
            } else if tick >= self.retirement_tick {
                self.await_successor()
            } else {
                self.await_needs(tick, state)?
            };
            match awaited {
                // Who counts a promoted process's samples as there sees the change that promoted it, too.
                Await::Tick if self.links.control.epoch() != self.epoch => {}
                Await::Tick => return Ok(true),
                Await::End if self.links.control.is_aborted() => return Err(BusError::Aborted),
                Await::End => return Ok(false),
                Await::Change => {
                    let epoch = self.links.control.epoch();
                    self.follow(&Membership::load(&self.links.run_dir, epoch)?, tick)?;
                    self.links.transport.reserve()?;
                    self.links.control.acknowledge(self.links.slot(), epoch);
                }
            }
        }
    }

    /// Waits for the predecessor, the inputs, the shadows and the grant that `tick` needs.
    fn await_needs(&self, tick: u32, state: &mut [u8]) -> Result<Await, BusError> {
        let awaited = self.follow_predecessor(tick, state)?;
        if awaited != Await::Tick {
            return Ok(awaited);
        }
        let links = &self.links;
        // A node without outputs holds nobody up, so it lets samples gather and is woken less often.
        let batch = if links.node.outputs.is_empty() { (links.plan.window_ticks / 4).max(1) } else { 1 };
        for input in &self.inputs {
            let needed = (tick + 1).saturating_sub(input.delay_ticks);
            let word = Sequence::Topic(input.topic);
            if links.control.count(word) < needed {
                let granted = links.control.count(Sequence::Grant);
                let sleep_for = needed.max((tick + batch).min(granted).saturating_sub(input.delay_ticks));
                let awaited = self.wait(word, sleep_for, Waiter::Input(input.waiter), tick);
                // A node that lets samples gather may be sent home with some of them still to be taken: all
                // that was sent before an abort is recorded.
                let is_sent = awaited == Await::End && links.control.count(word) >= needed;
                if awaited != Await::Tick && !is_sent {
                    return Ok(awaited);
                }
            }
            if input.awaits_shadow(tick) {
                let awaited =
                    self.wait(Sequence::Shadow(input.topic), tick + 1, Waiter::Shadow(input.waiter), tick);
                if awaited != Await::Tick {
                    return Ok(awaited);
                }
            }
        }
        // The inputs of this tick imply its grant, except where a node has none that are due at it.
        Ok(self.wait(Sequence::Grant, tick + 1, Waiter::Grant(links.slot()), tick))
    }

    /// As a shadow, starts `tick` from the state of the predecessor, if that states one: what this process
    /// sends then is what it would send if it took over here.
    fn follow_predecessor(&self, tick: u32, state: &mut [u8]) -> Result<Await, BusError> {
        if self.links.generation == 0 || tick > self.take_over_tick {
            return Ok(Await::Tick);
        }
        let (predecessor, waiter) = (self.links.other_slot(), Waiter::Replacement(self.links.slot()));
        if let Some(ring) = &self.handed {
            let awaited = self.wait(Sequence::State(predecessor), tick + 1, waiter, tick);
            if awaited != Await::Tick {
                return Ok(awaited);
            }
            if !ring.load(tick, state) {
                return Err(BusError::Parameters {
                    node: self.links.node.name.clone(),
                    reason: format!("the state that its predecessor had at tick {tick} is gone"),
                });
            }
        }
        if tick == self.take_over_tick && self.links.control.slot_state(predecessor) == SlotState::Taken {
            return Ok(self.wait(Sequence::Done(predecessor), tick, waiter, tick));
        }
        Ok(Await::Tick)
    }

    /// Waits until the successor has completed its first tick, or is refused.
    fn await_successor(&self) -> Await {
        let (slot, successor) = (self.links.slot(), self.links.other_slot());
        let tick = self.retirement_tick;
        match self.wait(Sequence::Done(successor), tick + 1, Waiter::Replacement(slot), tick) {
            Await::Tick => Await::End,
            other => other,
        }
    }

    fn wait(&self, word: Sequence, count: u32, waiter: Waiter, tick: u32) -> Await {
        let over = |control: &Control| control.end_tick() <= tick || control.epoch() != self.epoch;
        let control = &self.links.control;
        match control.wait(word, count, waiter, self.links.node.wait, over) {
            Waited::Reached => Await::Tick,
            Waited::Over if control.is_aborted() || control.end_tick() <= tick => Await::End,
            Waited::Over => Await::Change,
        }
    }

    /// Stays until every slot has taken the last samples of this process, where it leaves before the end.
    fn await_readers(&self, tick: u32) -> Result<(), BusError> {
        let (control, plan) = (&self.links.control, &self.links.plan);
        let longest = plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
        let taken = tick.saturating_add(longest + 1);
        loop {
            if control.is_aborted() {
                return Err(BusError::Aborted);
            }
            let needed = taken.min(control.end_tick());
            if control.computing().all(|slot| control.count(Sequence::Done(slot)) >= needed) {
                return Ok(());
            }
            std::thread::sleep(RETIREMENT_NAP);
        }
    }

    /// Makes the connections agree with `membership`; `tick` is the next that this node computes.
    fn follow(&mut self, membership: &Membership, tick: u32) -> Result<(), BusError> {
        for input in &mut self.inputs {
            self.links.connect_successor(input, membership, tick)?;
        }
        let own = &membership.nodes[self.links.index];
        let is_successor =
            own.backup.as_ref().is_some_and(|successor| successor.generation == self.links.generation);
        if is_successor {
            self.take_over_tick = own.take_over_tick;
            self.retirement_tick = u32::MAX;
        } else if own.primary.generation == self.links.generation {
            self.retirement_tick = own.backup.as_ref().map_or(u32::MAX, |_| own.take_over_tick);
        }
        for (index, output) in self.outputs.iter_mut().enumerate() {
            output.readers = self.links.reader_waiters(membership, output.topic).map(Waiter::Input).collect();
            output.shadow_readers =
                self.links.reader_waiters(membership, output.topic).map(Waiter::Shadow).collect();
            output.update_subscribers(&self.links.node.name)?;
            if is_successor {
                self.links.promote(output, own, index, tick);
            }
        }
        self.epoch = membership.epoch;
        Ok(())
    }

    fn compute(
        &mut self,
        tick: u32,
        state: &mut [u8],
        step: &mut impl FnMut(&mut Tick<'_>, &mut [u8]) -> Result<(), String>,
    ) -> Result<(), BusError> {
        let links = &self.links;
        let node = &links.node.name;
        for input in &mut self.inputs {
            input.take(tick, node).inspect_err(|_| links.control.count_gap(input.topic))?;
        }
        for port in &mut self.predecessor {
            port.take_available(tick, node)?;
        }
        let received_ns = monotonic_ns();
        let time_ns = u64::from(tick) * links.plan.tick_ns;
        let takes_over = links.generation > 0 && tick == self.take_over_tick;
        let predecessor = if takes_over { self.predecessor.as_slice() } else { &[] };
        let (inputs, outputs) = (&self.inputs, &mut self.outputs);
        let mut view = Tick { tick, time_ns, node, inputs, outputs, predecessor };
        step(&mut view, state).map_err(|reason| BusError::Step {
            node: node.clone(),
            tick,
            time_s: time_ns as f64 * 1e-9,
            reason,
        })?;
        let done_ns = monotonic_ns();
        links.control.count_step(links.slot(), done_ns - received_ns);
        // Before anything is sent: whoever sees the sample can go on from the state after it.
        self.publish_state(tick + self.links.node.period_ticks, state);
        self.send(tick, time_ns, received_ns, done_ns)?;
        if tick >= self.take_over_tick {
            // The predecessor leaves; nothing of it is read any more.
            self.predecessor.clear();
            self.handed = None;
        }
        Ok(())
    }

    fn send(&mut self, tick: u32, time_ns: u64, received_ns: u64, done_ns: u64) -> Result<(), BusError> {
        let (control, node) = (&self.links.control, &self.links.node.name);
        let mut sent_before = false;
        let is_sent = |(_, output): &(usize, &mut OutPort)| output.is_sent(tick);
        for (index, output) in self.outputs.iter_mut().enumerate().filter(is_sent) {
            // The first output is sent at once: one look at the clock serves for both times.
            let sent_ns = if sent_before { monotonic_ns() } else { done_ns };
            if let Some(profile) = &mut self.profile {
                profile.sent(index, sent_ns);
            }
            output.send(tick, time_ns, [received_ns, done_ns, sent_ns], node)?;
            let next = tick + output.period_ticks;
            if tick >= output.counts_from {
                control.advance(Sequence::Topic(output.topic), next, &output.readers);
            } else {
                control.advance(Sequence::Shadow(output.topic), next, &output.shadow_readers);
            }
            sent_before = true;
        }
        self.outputs.iter_mut().for_each(OutPort::forget);
        // Readers are awake by now: what the next tick needs is fetched while they compute.
        self.outputs.iter_mut().try_for_each(|output| output.prepare(node))?;
        if let Some(profile) = &mut self.profile {
            profile.end(tick, received_ns, done_ns, monotonic_ns());
        }
        Ok(())
    }
}

impl Links {
    fn slot(&self) -> usize {
        self.plan.slot(self.index, self.generation)
    }

    /// The other slot of this node: its predecessor's or its successor's.
    fn other_slot(&self) -> usize {
        self.plan.slot(self.index, self.generation + 1)
    }

    fn done_waiters(&self) -> [Waiter; 2] {
        [Waiter::Done(self.slot()), Waiter::Replacement(self.other_slot())]
    }

    fn subscriber(&self, topic: usize, generation: u32) -> Result<crate::transport::Receiver, BusError> {
        self.transport.subscriber(&self.plan.topics[topic].name, generation, self.plan.capacity(topic))
    }

    /// The processes of the node that publishes `topic`.
    fn publisher<'a>(&self, membership: &'a Membership, topic: usize) -> &'a NodeInstances {
        &membership.nodes[self.plan.publisher(topic).unwrap_or(self.index)]
    }

    fn reader_waiters(&self, membership: &Membership, topic: usize) -> impl Iterator<Item = usize> {
        membership
            .readers(topic)
            .map(|(node, generation, input)| self.plan.input_waiter(self.plan.slot(node, generation), input))
    }

    fn initial_value(&self, input: &InputPlan, declared: Declared) -> Result<Option<Box<[u64]>>, BusError> {
        let (Some(value), Declared::Typed(schema)) = (&input.initial, declared) else { return Ok(None) };
        initial::sample(schema, value).map(Some).map_err(|reason| BusError::InitialValue {
            node: self.node.name.clone(),
            port: input.port.clone(),
            type_name: schema.type_name,
            reason,
        })
    }

    /// Connects `input` to the process that shadows its publisher, and lets go of one that is gone.
    fn connect_successor(
        &self,
        input: &mut InPort,
        membership: &Membership,
        tick: u32,
    ) -> Result<(), BusError> {
        let publisher = self.publisher(membership, input.topic);
        let Some(successor) = &publisher.backup else {
            input.drop_successors_of(publisher.primary.generation);
            return Ok(());
        };
        let take_over_tick = publisher.topic_take_over_tick(input.topic);
        if input.newest_generation() != successor.generation {
            let receiver = self.subscriber(input.topic, successor.generation)?;
            let first_tick = if successor.shadows { successor.join_tick } else { take_over_tick };
            let period_ticks = self.plan.topics[input.topic].period_ticks;
            // A reader that joined later than the shadow starts with what its own first tick reads.
            let first_tick = first_tick.max(tick.saturating_sub(input.delay_ticks));
            let source = Source::new(successor.generation, receiver, first_tick, period_ticks);
            input.drop_successors_of(publisher.primary.generation);
            input.add_successor(source, successor.shadows);
        }
        input.set_take_over_tick(take_over_tick);
        Ok(())
    }

    /// Has the samples of `output` count from the take-over on, also those that were sent already.
    fn promote(&self, output: &mut OutPort, own: &NodeInstances, index: usize, tick: u32) {
        output.counts_from = own.take_over_ticks[index];
        let shadows = own.backup.as_ref().is_some_and(|successor| successor.shadows);
        output.sends_from = if shadows { 0 } else { output.counts_from };
        let next_due = tick.div_ceil(output.period_ticks) * output.period_ticks;
        if next_due > output.counts_from && self.control.count(Sequence::Topic(output.topic)) < next_due {
            self.control.advance(Sequence::Topic(output.topic), next_due, &output.readers);
        }
    }
}
