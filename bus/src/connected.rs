//! A connected node: waits for what a tick needs, computes it, sends, and follows the changes of the run.

use crate::announcement::{self, Announcement};
use crate::component::Transfer;
use crate::error::BusError;
use crate::hand_over::{Computation, HandOver};
use crate::handles::Declared;
use crate::host_time::{monotonic_ns, process_cpu_ns};
use crate::links::Links;
use crate::lockstep::{Need, Phase, SlotState, TransferOutcome, Waited};
use crate::membership::Membership;
use crate::plan::{InputPlan, NodePlan};
use crate::port::{InPort, OutPort, Source};
use crate::profile::TickWriter;
use crate::tick::Tick;
use crate::timing::{Due, Timing};
use std::time::Duration;

/// How long a process that retires sleeps before it looks again who still reads its last samples.
const RETIREMENT_NAP: Duration = Duration::from_millis(1);

/// A node whose ports are connected.
#[derive(Debug)]
pub(crate) struct ConnectedNode {
    inputs: Vec<InPort>,
    outputs: Vec<OutPort>,
    announcements: Vec<Announcement>,
    /// What the predecessor sends, by output; empty where its state is handed over.
    predecessor: Vec<InPort>,
    /// The state that the predecessor hands over, and the state of this process.
    state: HandOver,
    /// The tick from which on this process goes on by itself, no longer as its predecessor's shadow.
    take_over_tick: u32,
    /// The tick from which on a backup takes this process's place.
    retirement_tick: u32,
    first_tick: u32,
    epoch: u32,
    profile: Option<TickWriter>,
    /// Simulated computing time; its words are behind the state.
    timing: Option<Timing>,
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
    /// Connects a node that has joined by `membership`.
    pub(crate) fn new(
        links: Links,
        declared: impl Iterator<Item = Declared>,
        outputs: Vec<OutPort>,
        membership: &Membership,
    ) -> Result<Self, BusError> {
        let instance = membership.nodes[links.index].of(links.generation);
        let first_tick = instance.expect("the membership by which a process joins names it").join_tick;
        let mut node = Self::unconnected(links, outputs, membership.epoch, first_tick);
        if node.timing.is_some() {
            node.outputs.iter_mut().for_each(OutPort::set_timed);
        }
        node.connect_inputs(declared, membership)?;
        node.follow(membership, first_tick)?;
        node.links.transport.reserve()?;
        node.profile = node.links.tick_writer(first_tick)?;
        node.links.lockstep.note_process();
        node.links.lockstep.acknowledge(membership.epoch);
        Ok(node)
    }

    fn unconnected(links: Links, outputs: Vec<OutPort>, epoch: u32, first_tick: u32) -> Self {
        Self {
            inputs: Vec::new(),
            outputs,
            announcements: Vec::new(),
            predecessor: Vec::new(),
            state: HandOver::default(),
            take_over_tick: 0,
            retirement_tick: u32::MAX,
            first_tick,
            epoch,
            profile: None,
            timing: Timing::of(&links.plan, &links.node),
            links,
        }
    }

    fn connect_inputs(
        &mut self,
        declared: impl Iterator<Item = Declared>,
        membership: &Membership,
    ) -> Result<(), BusError> {
        let links = &self.links;
        for (input, declared) in links.node.inputs.iter().zip(declared) {
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
            let mut port = InPort::new(input, topic, announcement.size, initial, source);
            port.reads_shadow = matches!(declared, Declared::Raw);
            self.inputs.push(port);
            self.announcements.push(announcement);
        }
        Ok(())
    }

    /// Topic name and announced type of input `input`.
    pub(crate) fn announced(&self, input: usize) -> (&str, &Announcement) {
        let topic = self.links.node.inputs[input].topic;
        (&self.links.plan.topics[topic].name, &self.announcements[input])
    }

    /// Computes the steps of `node` at every due tick until the run ends, or until another process has taken over. The state
    /// is handed over to it as `transfer` says if it has the same layout, and to one that is started after a crash.
    ///
    /// # Errors
    /// If a step fails, a due output stays unwritten, a sample is lost, or the run is aborted.
    pub(crate) fn run(mut self, transfer: Transfer, node: &mut dyn Computation) -> Result<(), BusError> {
        let more_words = self.timing_words(self.timing.is_some());
        self.state = HandOver::new(transfer, node.state_size(), more_words);
        self.open_predecessor()?;
        self.state.create(&self.links)?;
        self.fly(node)
    }

    /// Words behind the state of a process of this node whose steps take time, or do not.
    fn timing_words(&self, is_timed: bool) -> usize {
        if is_timed { Timing::words(&self.outputs) } else { 0 }
    }

    /// Opens the state of the process that this one succeeds, or else what it sends.
    fn open_predecessor(&mut self) -> Result<(), BusError> {
        let links = &self.links;
        if links.generation == 0 {
            return Ok(());
        }
        let generation = Membership::load(&links.run_dir, self.epoch)?.nodes[links.index].primary.generation;
        let (dir, plan, index) = (&links.run_dir, &links.plan, links.index);
        let is_timed = match generation {
            0 => plan.nodes[index].computing_time.is_some(),
            _ => NodePlan::load_backup(dir, index, generation)?.computing_time.is_some(),
        };
        let more_words = self.timing_words(is_timed);
        if self.state.open(&self.links, generation, more_words)? {
            self.links.lockstep.set_transfer(TransferOutcome::State);
            return Ok(());
        }
        let links = &self.links;
        links.lockstep.set_transfer(TransferOutcome::LastOutput);
        for output in &links.node.outputs {
            let topic = &links.plan.topics[output.topic];
            let receiver = links.subscriber(output.topic, generation)?;
            let limit = self.first_tick.checked_sub(1);
            let source = Source::joined(generation, receiver, limit, topic.period_ticks);
            let input =
                InputPlan { port: output.port.clone(), topic: output.topic, delay_ticks: 1, initial: None };
            let size = Announcement::load(&announcement::topic_path(&links.run_dir, output.topic))?.size;
            self.predecessor.push(InPort::new(&input, topic, size, None, source));
        }
        links.transport.reserve()
    }

    fn fly(&mut self, computation: &mut dyn Computation) -> Result<(), BusError> {
        // Last, when all that the ticks use is mapped: a mapping that exceeds the limit later fails without words.
        if self.links.plan.lock_memory {
            crate::process::lock_memory()?;
        }
        if self.links.generation == 0 {
            // A backup may have to begin with the first tick.
            self.publish_state(self.first_tick, computation);
        }
        let links = &self.links;
        links.lockstep.set_ready(Phase::Running);
        let waited = match links.generation {
            0 => links.lockstep.wait_phase(Phase::Running),
            _ => links.lockstep.wait_slot(SlotState::Taken),
        };
        waited.or_aborted()?;
        let cpu_start_ns = process_cpu_ns();
        let period = links.node.period_ticks;
        let mut tick = self.first_tick;
        while self.await_tick(tick, computation)? {
            if self.links.generation > 0 && tick <= self.take_over_tick.max(self.first_tick) {
                // What it begins with is its predecessor's, not what it came to itself.
                self.publish_state(tick, computation);
            }
            self.compute(tick, computation)?;
            tick += period;
            self.links.lockstep.completed(tick);
        }
        self.links.lockstep.note_cpu(process_cpu_ns() - cpu_start_ns);
        // A node whose next due tick lies beyond the end has completed the run.
        self.links.lockstep.completed(u32::MAX - 1);
        self.await_readers(tick)
    }

    /// Publishes the state at the start of `tick`, for whoever takes over there.
    fn publish_state(&mut self, tick: u32, computation: &dyn Computation) {
        if self.state.publish(tick, computation) {
            // A count of zero is no state.
            self.links.lockstep.state_published(tick + 1);
        }
    }

    /// Waits until `tick` may be computed; false when the run ends, or this process's part in it, before it.
    fn await_tick(&mut self, tick: u32, computation: &mut dyn Computation) -> Result<bool, BusError> {
        loop {
            let awaited = if self.links.lockstep.epoch() != self.epoch {
                Await::Change
            } else if self.links.lockstep.end_tick() <= tick {
                self.await_predecessor(tick)
            } else if tick >= self.retirement_tick {
                self.await_backup()
            } else {
                self.await_needs(tick, computation)?
            };
            match awaited {
                // Who counts a promoted process's samples as there sees the change that promoted it, too.
                Await::Tick if self.links.lockstep.epoch() != self.epoch => {}
                Await::Tick => return Ok(true),
                Await::End if self.links.lockstep.is_aborted() => return Err(BusError::Aborted),
                Await::End => return Ok(false),
                Await::Change => {
                    let epoch = self.links.lockstep.epoch();
                    self.follow(&Membership::load(&self.links.run_dir, epoch)?, tick)?;
                    self.links.transport.reserve()?;
                    self.links.lockstep.acknowledge(epoch);
                }
            }
        }
    }

    /// Waits for the predecessor, the inputs, the shadows and the grant that `tick` needs.
    fn await_needs(&mut self, tick: u32, computation: &mut dyn Computation) -> Result<Await, BusError> {
        let awaited = self.follow_predecessor(tick, computation)?;
        if awaited != Await::Tick {
            return Ok(awaited);
        }
        let links = &self.links;
        // A node without outputs holds nobody up, so it lets samples gather and is woken less often.
        let batch = if links.node.outputs.is_empty() { (links.plan.window_ticks / 4).max(1) } else { 1 };
        for (index, input) in self.inputs.iter().enumerate() {
            let needed = (tick + 1).saturating_sub(input.delay_ticks);
            if links.lockstep.ticks_sent(input.topic) < needed {
                let granted = links.lockstep.granted_ticks();
                let sleep_for = needed.max((tick + batch).min(granted).saturating_sub(input.delay_ticks));
                let awaited = self.wait(Need::Samples { topic: input.topic, input: index }, sleep_for, tick);
                // A node that lets samples gather may be sent home with some of them still to be taken: all
                // that was sent before an abort is recorded.
                let is_sent = awaited == Await::End && links.lockstep.ticks_sent(input.topic) >= needed;
                if awaited != Await::Tick && !is_sent {
                    return Ok(awaited);
                }
            }
            if input.awaits_shadow(tick) {
                let awaited = self.wait(Need::Shadow { topic: input.topic, input: index }, tick + 1, tick);
                if awaited != Await::Tick {
                    return Ok(awaited);
                }
            }
        }
        // The inputs of this tick imply its grant, except where a node has none that are due at it.
        Ok(self.wait(Need::Grant, tick + 1, tick))
    }

    /// As a shadow, starts `tick` from the state of the predecessor, if that states one: what this process
    /// sends then is what it would send if it took over here.
    fn follow_predecessor(
        &mut self,
        tick: u32,
        computation: &mut dyn Computation,
    ) -> Result<Await, BusError> {
        if self.links.generation == 0 || tick > self.take_over_tick {
            return Ok(Await::Tick);
        }
        if self.state.has_predecessor() {
            let awaited = self.wait(Need::OtherState, tick + 1, tick);
            if awaited != Await::Tick {
                return Ok(awaited);
            }
            let failed = |reason| BusError::Parameters { node: self.links.node.name.clone(), reason };
            self.state.load(tick, computation).map_err(failed)?;
        }
        if tick == self.take_over_tick && self.links.lockstep.other_computes() {
            return Ok(self.wait(Need::OtherDone, tick, tick));
        }
        Ok(Await::Tick)
    }

    /// Waits until the backup has completed its first tick, or is refused.
    fn await_backup(&self) -> Await {
        let tick = self.retirement_tick;
        match self.wait(Need::OtherDone, tick + 1, tick) {
            Await::Tick => Await::End,
            other => other,
        }
    }

    /// A shadow that has come to the end of the run waits for its predecessor to get there: until then that may die,
    /// and the samples of its last ticks are then the shadow's.
    fn await_predecessor(&self, tick: u32) -> Await {
        let (links, lockstep) = (&self.links, &self.links.lockstep);
        if links.generation == 0 || self.take_over_tick < tick {
            return Await::End;
        }
        let is_over = || lockstep.is_aborted() || lockstep.epoch() != self.epoch;
        match lockstep.wait(Need::OtherDone, tick, links.node.wait, is_over) {
            Waited::Over if !lockstep.is_aborted() => Await::Change,
            _ => Await::End,
        }
    }

    fn wait(&self, need: Need, count: u32, tick: u32) -> Await {
        let lockstep = &self.links.lockstep;
        let is_over = || lockstep.end_tick() <= tick || lockstep.epoch() != self.epoch;
        match lockstep.wait(need, count, self.links.node.wait, is_over) {
            Waited::Reached => Await::Tick,
            Waited::Over if lockstep.is_abandoned() || lockstep.end_tick() <= tick => Await::End,
            Waited::Over => Await::Change,
        }
    }

    /// Stays until every process has taken the last samples of this process: also one that is started in the place of
    /// a reader that has died meanwhile.
    fn await_readers(&mut self, tick: u32) -> Result<(), BusError> {
        let longest = self.links.plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
        let taken = tick.saturating_add(longest + 1);
        loop {
            let lockstep = &self.links.lockstep;
            if lockstep.is_aborted() {
                return Err(BusError::Aborted);
            }
            let needed = taken.min(lockstep.end_tick());
            if lockstep.computing().all(|slot| lockstep.done(slot) >= needed) {
                // No later change concerns this process, however long its program goes on.
                lockstep.acknowledge(u32::MAX);
                return Ok(());
            }
            let epoch = lockstep.epoch();
            if epoch == self.epoch {
                std::thread::sleep(RETIREMENT_NAP);
                continue;
            }
            let membership = Membership::load(&self.links.run_dir, epoch)?;
            self.connect_readers(&membership)?;
            self.epoch = epoch;
            self.links.lockstep.acknowledge(epoch);
        }
    }

    /// Sends to the readers that `membership` names from now on, and to new ones what was sent last.
    fn connect_readers(&mut self, membership: &Membership) -> Result<(), BusError> {
        for output in &mut self.outputs {
            output.readers = self.links.readers(membership, output.topic);
            output.update_subscribers(&self.links.node.name)?;
        }
        Ok(())
    }

    /// Makes the connections agree with `membership`; `tick` is the next that this node computes.
    fn follow(&mut self, membership: &Membership, tick: u32) -> Result<(), BusError> {
        for input in &mut self.inputs {
            self.links.connect_backup(input, membership, tick)?;
        }
        let instances = &membership.nodes[self.links.index];
        let generation = self.links.generation;
        let is_backup = instances.backup.as_ref().is_some_and(|backup| backup.generation == generation);
        if is_backup {
            self.take_over_tick = instances.take_over_tick;
            self.retirement_tick = u32::MAX;
        } else if instances.primary.generation == generation {
            self.retirement_tick = instances.backup.as_ref().map_or(u32::MAX, |_| instances.take_over_tick);
        }
        self.connect_readers(membership)?;
        if is_backup {
            for (index, output) in self.outputs.iter_mut().enumerate() {
                self.links.promote(output, instances, index, tick);
            }
        }
        self.epoch = membership.epoch;
        Ok(())
    }

    fn compute(&mut self, tick: u32, computation: &mut dyn Computation) -> Result<(), BusError> {
        self.take_inputs(tick)?;
        let received_ns = monotonic_ns();
        match self.timing.take() {
            None => self.step(tick, computation)?,
            Some(mut timing) => {
                self.step_in_time(&mut timing, tick, computation)?;
                self.timing = Some(timing);
            }
        }
        if crate::hosted::is_cancelled() {
            // Another instance may have been told to go on in its place by now.
            return Err(BusError::Aborted);
        }
        let done_ns = monotonic_ns();
        self.links.lockstep.count_step(done_ns - received_ns);
        // Before anything is sent: whoever sees the sample can go on from the state after it.
        self.publish_state(tick + self.links.node.period_ticks, computation);
        self.send(tick, received_ns, done_ns)?;
        if tick >= self.take_over_tick {
            // The predecessor leaves; nothing of it is read any more.
            self.predecessor.clear();
            self.state.leave_predecessor();
        }
        Ok(())
    }

    fn take_inputs(&mut self, tick: u32) -> Result<(), BusError> {
        let (lockstep, node) = (&self.links.lockstep, &self.links.node.name);
        for input in &mut self.inputs {
            input.take(tick, node).inspect_err(|_| lockstep.count_gap(input.topic))?;
        }
        self.predecessor.iter_mut().try_for_each(|port| port.take_available(tick, node))
    }

    /// Computes the component's step, which writes what is due.
    fn step(&mut self, tick: u32, computation: &mut dyn Computation) -> Result<(), BusError> {
        let links = &self.links;
        let (node, time_ns) = (&links.node.name, links.time_ns(tick));
        let takes_over = links.generation > 0 && tick == self.take_over_tick;
        let predecessor = if takes_over { self.predecessor.as_slice() } else { &[] };
        let (inputs, outputs) = (self.inputs.as_slice(), self.outputs.as_mut_slice());
        let mut view = Tick { tick, time_ns, node, inputs, outputs, predecessor };
        let time_s = time_ns as f64 * 1e-9;
        computation.step(&mut view).map_err(|reason| BusError::Step {
            node: node.clone(),
            tick,
            time_s,
            reason,
        })
    }

    /// Computes the step unless the one before is under way, and writes what is done by `tick`.
    fn step_in_time(
        &mut self,
        timing: &mut Timing,
        tick: u32,
        computation: &mut dyn Computation,
    ) -> Result<(), BusError> {
        let words = self.state.more_words();
        if tick == self.take_over_tick && !self.predecessor.is_empty() {
            // It goes on from what its predecessor sent last, not from a step of its own as a shadow.
            words.fill(0);
        }
        // Until then they are its predecessor's to count.
        let counts = tick >= self.take_over_tick;
        match timing.begin(tick, words, &self.outputs) {
            Due::Step => {
                self.step(tick, computation)?;
                let words = self.state.more_words();
                let overran = timing.end(tick, words, &mut self.outputs, &self.links.node.name)?;
                if overran && counts {
                    self.links.lockstep.count_overrun();
                }
            }
            Due::Skipped if counts => self.links.lockstep.count_skipped_step(),
            Due::Skipped => {}
        }
        Timing::write(tick, self.state.more_words(), &mut self.outputs, &self.links.node.name)
    }

    fn send(&mut self, tick: u32, received_ns: u64, done_ns: u64) -> Result<(), BusError> {
        let (lockstep, node) = (&self.links.lockstep, &self.links.node.name);
        let time_ns = self.links.time_ns(tick);
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
                lockstep.samples_sent(output.topic, next, &output.readers);
            } else {
                lockstep.shadow_sent(output.topic, next, &output.readers);
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
