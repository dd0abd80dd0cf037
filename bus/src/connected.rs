//! A connected node: it waits for the needs of its next tick, gathers, steps and publishes, and follows the changes
//! of the run. The [executor](crate::executor) calls it. `checkpoints` has its parts of checkpoints.

mod checkpoints;

use crate::announcement::{self, Announcement, Reader};
use crate::checkpoint::Samples;
use crate::component::Transfer;
use crate::computation::Computation;
use crate::error::BusError;
use crate::hand_over::HandOver;
use crate::handles::Declared;
use crate::host_time::monotonic_ns;
use crate::links::Links;
use crate::lockstep::{Need, NodeView, Phase, SlotState, TransferOutcome, Waited};
use crate::membership::Membership;
use crate::plan::{InputPlan, NodePlan};
use crate::port::{Feed, InPort, Locals, OutPort, Source};
use crate::profile::TickWriter;
use crate::sample_ring::SampleRing;
use crate::stepper::{Stepped, Stepper};
use crate::timing::Timing;
use crate::transport::Receiver;

/// A node whose ports are connected.
#[derive(Debug)]
pub(crate) struct ConnectedNode {
    stepper: Stepper,
    announcements: Vec<Announcement>,
    /// The state that the predecessor hands over, and the state of this process.
    state: HandOver,
    /// The tick from which on this process goes on by itself, no longer as its predecessor's shadow.
    take_over_tick: u32,
    /// The tick at which it takes the place of another component that has written its part of a checkpoint.
    succeeds_at: Option<u32>,
    /// The tick from which on a backup takes this process's place.
    retirement_tick: u32,
    first_tick: u32,
    epoch: u32,
    profile: Option<TickWriter>,
    /// The next tick that it computes.
    pub(crate) tick: u32,
    /// The ticks that the control segment counts as completed.
    told_tick: u32,
    /// The ticks for which everything is known to be there, as long as the membership stays.
    known_ticks: u32,
    /// True if another process may go on from its state at any tick.
    states_every_tick: bool,
    /// The tick of the plan's checkpoint that comes next; `u32::MAX` behind the last.
    next_checkpoint: u32,
    /// Number of requested checkpoints that are written.
    asks_answered: u32,
    /// Host time of all its steps, ns.
    step_ns: u64,
    // The transport last: the ports give back their resources while it exists.
    links: Links,
}

/// Next action of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    /// It computes its next tick.
    Compute,
    /// It waits.
    Wait(Awaited),
    /// It follows a change of the membership first.
    Change,
    /// It writes its part of a checkpoint of the tick at which the run is held.
    Save,
    /// The run ends before its next tick, or its part in the run does.
    Leave,
}

/// Count or event that a node waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Awaited {
    /// A count.
    Count {
        /// Whose.
        need: Need,
        /// The count that it needs.
        count: u32,
        /// The count until which it may sleep.
        sleep_for: u32,
    },
    /// Its backup's first tick, or the refusal of that backup.
    Backup,
    /// The predecessor's end, for a shadow behind the end of the run.
    Predecessor,
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
        node.connect_inputs(declared, membership)?;
        node.connect(membership, &[])?;
        node.states_every_tick = node.must_state(membership);
        node.links.transport.reserve()?;
        node.profile = node.links.tick_writer(first_tick)?;
        node.links.lockstep.note_process();
        node.links.lockstep.acknowledge(membership.epoch);
        Ok(node)
    }

    fn unconnected(links: Links, outputs: Vec<OutPort>, epoch: u32, first_tick: u32) -> Self {
        Self {
            stepper: Stepper::new(&links.plan, &links.node, outputs),
            announcements: Vec::new(),
            state: HandOver::default(),
            take_over_tick: 0,
            succeeds_at: None,
            retirement_tick: u32::MAX,
            first_tick,
            epoch,
            profile: None,
            tick: first_tick,
            told_tick: first_tick,
            known_ticks: 0,
            states_every_tick: true,
            next_checkpoint: links.plan.checkpoint_after(links.plan.first_tick).unwrap_or(u32::MAX),
            asks_answered: 0,
            step_ns: 0,
            links,
        }
    }

    fn connect_inputs(
        &mut self,
        declared: impl Iterator<Item = Declared>,
        membership: &Membership,
    ) -> Result<(), BusError> {
        let links = &self.links;
        let restored = Samples::of_run(&links.run_dir, &links.plan)?;
        for (input, declared) in links.node.inputs.iter().zip(declared) {
            let topic = &links.plan.topics[input.topic];
            let announcement = announcement::load(&announcement::topic_path(&links.run_dir, input.topic))?;
            if let Declared::Typed(schema) = declared {
                announcement::check(
                    &announcement,
                    schema,
                    &links.plan,
                    input.topic,
                    &Reader::of(&links.node, input),
                )?;
            }
            let initial = declared.initial_value(input, &links.node.name)?;
            let generation = links.publisher(membership, input.topic).primary.generation;
            let feed = if links.is_member(links.plan.publisher(input.topic), generation) {
                Feed::Local { generation }
            } else if links.records_member(input.topic, generation) {
                Feed::Ring(SampleRing::open(&links.plan, input.topic, announcement.size)?)
            } else {
                let receiver = links.subscriber(input.topic, generation)?;
                Feed::Shared(self.source(input, generation, receiver))
            };
            let mut port = InPort::new(input, topic, &announcement, initial, feed);
            if let Some(sample) = restored.get(&topic.name) {
                port.restore(sample, &links.node.name)?;
            }
            port.reads_shadow = matches!(declared, Declared::Raw);
            port.left_behind = links.left_behind(input.topic, announcement.size)?;
            self.stepper.inputs.push(port);
            self.announcements.push(announcement);
        }
        Ok(())
    }

    /// The samples that `receiver` gets of `input`, from the first that this process reads on. Those from before a
    /// checkpoint from which the run goes on are not sent again.
    fn source(&self, input: &InputPlan, generation: u32, receiver: Receiver) -> Source {
        let ticks = self.links.plan.topics[input.topic].ticks;
        let (run_tick, limit) = (self.links.plan.first_tick, self.first_tick.checked_sub(input.delay_ticks));
        if limit.is_none_or(|limit| ticks.newest(limit) < run_tick) {
            return Source::new(generation, receiver, run_tick, ticks);
        }
        Source::joined(generation, receiver, limit, ticks)
    }

    /// Topic name and announced type of input `input`.
    pub(crate) fn announced(&self, input: usize) -> (&str, &Announcement) {
        let topic = self.links.node.inputs[input].topic;
        (&self.links.plan.topics[topic].name, &self.announcements[input])
    }

    /// Prepares the transfer of the state of `computation` as `transfer` says: to the process that takes this node's
    /// place, and from its predecessor.
    ///
    /// # Errors
    /// If shared memory cannot be had.
    pub(crate) fn open_states(
        &mut self,
        transfer: Transfer,
        computation: &dyn Computation,
    ) -> Result<(), BusError> {
        self.state = HandOver::new(transfer, computation, self.stepper.words());
        self.open_predecessor()?;
        self.state.create(&self.links)
    }

    /// Opens the state of the process that this one succeeds, or else its outputs.
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
        let more_words = if is_timed { Timing::words(&self.stepper.outputs) } else { 0 };
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
            let source = Source::joined(generation, receiver, limit, topic.ticks);
            let input =
                InputPlan { port: output.port.clone(), topic: output.topic, delay_ticks: 1, initial: None };
            let announced = announcement::load(&announcement::topic_path(&links.run_dir, output.topic))?;
            let mut port = InPort::new(&input, topic, &announced, None, Feed::Shared(source));
            port.left_behind = links.left_behind(output.topic, announced.size)?;
            self.stepper.predecessor.push(port);
        }
        links.transport.reserve()
    }

    /// Reports that this node can begin, with the state of `computation`.
    ///
    /// # Errors
    /// If its memory cannot be locked.
    pub(crate) fn begin(&mut self, computation: &dyn Computation) -> Result<(), BusError> {
        // Last, when everything that the ticks use is mapped: a mapping that exceeds the limit later fails silently.
        if self.links.plan.lock_memory {
            self.links.lockstep.place().lock_memory()?;
        }
        if self.links.generation == 0 {
            // A backup may have to begin with the first tick.
            self.publish_state(self.first_tick, computation);
        }
        self.links.lockstep.set_ready(Phase::Running);
        Ok(())
    }

    /// Waits until the ticks begin: the run's, or those of a backup.
    ///
    /// # Errors
    /// If the run is aborted.
    pub(crate) fn await_ticks(&self) -> Result<(), BusError> {
        let links = &self.links;
        let waited = match links.generation {
            0 => links.lockstep.wait_phase(Phase::Running),
            _ => links.lockstep.wait_slot(SlotState::Taken),
        };
        waited.or_aborted()
    }

    /// Reports that this node computes no more.
    pub(crate) fn complete(&mut self, cpu_ns: u64) {
        self.tell();
        self.links.lockstep.note_cpu(cpu_ns);
        // A node whose next due tick lies beyond the end has completed the run.
        self.links.lockstep.completed(u32::MAX - 1);
    }

    /// Publishes the state at the start of `tick`, for a process that takes over there.
    fn publish_state(&mut self, tick: u32, computation: &dyn Computation) {
        if self.state.publish(tick, computation) {
            // A count of zero means that there is no state.
            self.links.lockstep.state_published(tick + 1);
        }
    }

    /// Next action of this node. As a shadow, `computation` has the state of its predecessor
    /// afterwards.
    ///
    /// # Errors
    /// If the run is aborted, or the state of the predecessor is gone.
    pub(crate) fn turn(&mut self, computation: &mut dyn Computation) -> Result<Turn, BusError> {
        let (lockstep, tick) = (&self.links.lockstep, self.tick);
        if lockstep.epoch() != self.epoch {
            return Ok(Turn::Change);
        }
        if self.is_asked_at_hold() {
            return Ok(Turn::Save);
        }
        if lockstep.end_tick() <= tick {
            // A shadow at the end of the run waits until its predecessor gets there: the predecessor may die before,
            // and the samples of its last ticks are then the shadow's.
            let is_shadow = self.links.generation > 0 && self.take_over_tick >= tick;
            let awaits = is_shadow && !lockstep.has(Need::OtherDone, tick);
            return if awaits { Ok(Turn::Wait(Awaited::Predecessor)) } else { self.leave_turn() };
        }
        if tick >= self.retirement_tick {
            let has_taken_over = lockstep.has(Need::OtherDone, self.retirement_tick + 1);
            return if has_taken_over { self.leave_turn() } else { Ok(Turn::Wait(Awaited::Backup)) };
        }
        let turn = match self.missing(computation)? {
            Some(awaited) => Turn::Wait(awaited),
            None => Turn::Compute,
        };
        // Who counts a promoted process's samples as there sees the change that promoted it, too.
        Ok(if turn == Turn::Compute && self.links.lockstep.epoch() != self.epoch {
            Turn::Change
        } else {
            turn
        })
    }

    fn leave_turn(&self) -> Result<Turn, BusError> {
        if self.links.lockstep.is_aborted() { Err(BusError::Aborted) } else { Ok(Turn::Leave) }
    }

    /// The first missing need of the next tick: the predecessor, the inputs, the shadows, the grant.
    fn missing(&mut self, computation: &mut dyn Computation) -> Result<Option<Awaited>, BusError> {
        if let Some(awaited) = self.missing_predecessor(computation)? {
            return Ok(Some(awaited));
        }
        let (lockstep, tick) = (&self.links.lockstep, self.tick);
        if tick < self.known_ticks {
            return Ok(None);
        }
        for (index, input) in self.stepper.inputs.iter().enumerate().filter(|(_, input)| !input.is_local()) {
            let needed = (tick + 1).saturating_sub(input.delay_ticks);
            let need = Need::Samples { topic: input.topic, input: index };
            if !lockstep.has(need, needed) {
                let sleep_for = needed.max(self.gathered(tick).saturating_sub(input.delay_ticks));
                return Ok(Some(Awaited::Count { need, count: needed, sleep_for }));
            }
            let need = Need::Shadow { topic: input.topic, input: index };
            if input.awaits_shadow(tick) && !lockstep.has(need, tick + 1) {
                return Ok(Some(Awaited::count(need, tick + 1)));
            }
        }
        // The inputs of this tick imply its grant, except where a node has none that are due at it.
        if !lockstep.has(Need::Grant, tick + 1) {
            return Ok(Some(Awaited::count(Need::Grant, tick + 1)));
        }
        self.known_ticks = self.ticks_there();
        Ok(None)
    }

    /// Ticks for which a node that lets samples gather has everything, so that it need not look again before them; 0 for
    /// others, for which that would be one tick more at most.
    fn ticks_there(&self) -> u32 {
        let (lockstep, tick) = (&self.links.lockstep, self.tick);
        if !self.links.node.outputs.is_empty()
            || self.stepper.inputs.iter().any(|input| input.awaits_shadow(tick))
        {
            return 0;
        }
        let sent = self.stepper.inputs.iter().enumerate().map(|(index, input)| {
            let need = Need::Samples { topic: input.topic, input: index };
            lockstep.count(need).saturating_add(input.delay_ticks)
        });
        sent.fold(lockstep.granted_ticks(), u32::min)
    }

    /// Ticks whose samples a node may let gather before it wakes: no node waits for one without outputs.
    fn gathered(&self, tick: u32) -> u32 {
        let links = &self.links;
        let batch = if links.node.outputs.is_empty() { (links.plan.window_ticks / 4).max(1) } else { 1 };
        (tick + batch).min(links.lockstep.granted_ticks())
    }

    /// As a shadow, starts the tick from the state of the predecessor, if that states one: this process then sends
    /// what it would send if it took over here.
    fn missing_predecessor(
        &mut self,
        computation: &mut dyn Computation,
    ) -> Result<Option<Awaited>, BusError> {
        let (lockstep, tick) = (&self.links.lockstep, self.tick);
        if self.links.generation == 0 || tick > self.take_over_tick {
            return Ok(None);
        }
        if self.state.has_predecessor() {
            if !lockstep.has(Need::OtherState, tick + 1) {
                return Ok(Some(Awaited::count(Need::OtherState, tick + 1)));
            }
            let failed = |reason| BusError::Program { node: self.links.node.name.clone(), reason };
            self.state.load(tick, computation).map_err(failed)?;
        }
        let awaits =
            tick == self.take_over_tick && lockstep.other_computes() && !lockstep.has(Need::OtherDone, tick);
        Ok(awaits.then_some(Awaited::count(Need::OtherDone, tick)))
    }

    /// Sleeps until the `awaited` need may be met; false if it will not be: the run ends before the next tick.
    ///
    /// # Errors
    /// If the run is aborted.
    pub(crate) fn wait(&self, awaited: Awaited) -> Result<bool, BusError> {
        let (links, lockstep, tick) = (&self.links, &self.links.lockstep, self.tick);
        let has_changed = || lockstep.epoch() != self.epoch || self.is_asked_at_hold();
        let waited = match awaited {
            Awaited::Count { need, sleep_for, .. } => {
                let is_over = || lockstep.end_tick() <= tick || has_changed();
                lockstep.wait(need, sleep_for, links.node.wait, is_over)
            }
            Awaited::Backup => {
                let is_over = || lockstep.end_tick() <= self.retirement_tick || has_changed();
                lockstep.wait(Need::OtherDone, self.retirement_tick + 1, links.node.wait, is_over)
            }
            Awaited::Predecessor => {
                let is_over = || lockstep.is_aborted() || has_changed();
                lockstep.wait(Need::OtherDone, tick, links.node.wait, is_over)
            }
        };
        let is_there = waited == Waited::Reached || awaited.is_there(lockstep);
        if is_there || !lockstep.is_abandoned() {
            // A node that lets samples gather may be sent home with some of them still to be taken: all
            // that was sent before an abort is recorded.
            return Ok(true);
        }
        self.leave_turn().map(|_| false)
    }

    /// Updates the counts of the control segment: samples sent, ticks completed.
    pub(crate) fn tell(&mut self) {
        let lockstep = &self.links.lockstep;
        for output in &mut self.stepper.outputs {
            if output.ticks_told < output.ticks_sent {
                lockstep.samples_sent(output.topic, output.ticks_sent, &output.readers);
                output.ticks_told = output.ticks_sent;
            }
        }
        if self.told_tick < self.tick {
            lockstep.completed(self.tick);
            self.told_tick = self.tick;
        }
    }

    /// True once every process has taken the last samples of this one, which has completed its ticks before: also one
    /// that is started in the place of a reader that has died meanwhile.
    ///
    /// # Errors
    /// If the run is aborted.
    pub(crate) fn has_been_read(&self) -> Result<bool, BusError> {
        let lockstep = &self.links.lockstep;
        if lockstep.is_aborted() {
            return Err(BusError::Aborted);
        }
        let longest = self.links.plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
        let needed = self.tick.saturating_add(longest + 1).min(lockstep.end_tick());
        Ok(lockstep.computing().all(|slot| lockstep.done(slot) >= needed))
    }

    /// Leaves the run: no later change concerns this node, however long its process goes on.
    pub(crate) fn leave(&self) {
        self.links.lockstep.acknowledge(u32::MAX);
        self.links.lockstep.leave();
    }

    /// True if the membership has changed since this node followed it.
    pub(crate) fn is_behind(&self) -> bool {
        self.links.lockstep.epoch() != self.epoch
    }

    /// The newest membership.
    ///
    /// # Errors
    /// If its file cannot be read.
    pub(crate) fn newest_membership(&self) -> Result<Membership, BusError> {
        Membership::load(&self.links.run_dir, self.links.lockstep.epoch())
    }

    /// Reports that the connections agree with the membership that was followed.
    pub(crate) fn acknowledge(&self) -> Result<(), BusError> {
        self.links.transport.reserve()?;
        self.links.lockstep.acknowledge(self.epoch);
        Ok(())
    }

    /// The topics that members of the group read from this one, and the bytes of their messages.
    pub(crate) fn local_topics(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let outputs = self.stepper.outputs.iter().filter(|output| self.links.has_local_readers(output.topic));
        outputs.map(|output| (output.topic, output.size()))
    }

    /// Makes the outputs agree with `membership`, after the last tick.
    ///
    /// # Errors
    /// If shared memory cannot be had.
    pub(crate) fn follow_readers(
        &mut self,
        membership: &Membership,
        locals: &Locals,
    ) -> Result<(), BusError> {
        self.connect_readers(membership, locals)?;
        self.epoch = membership.epoch;
        Ok(())
    }

    /// Plan, lockstep and transport of this node.
    pub(crate) fn links(&self) -> &Links {
        &self.links
    }

    /// Host time of all its steps, ns.
    pub(crate) fn step_ns(&self) -> u64 {
        self.step_ns
    }

    /// Sends to the readers that `membership` names from now on, and the last sample to new ones.
    fn connect_readers(&mut self, membership: &Membership, locals: &Locals) -> Result<(), BusError> {
        let links = &self.links;
        for output in &mut self.stepper.outputs {
            output.readers = links.readers(membership, output.topic);
            output.is_awaited = links.is_awaited_outside(membership, output.topic);
            if !output.is_shared() && links.is_read_outside(membership, output.topic) {
                let sender = links.sender(output.topic, output.size())?;
                output.share(sender, locals.get(output.topic).and_then(Option::as_ref), &links.node.name)?;
            }
            output.update_subscribers(&links.node.name)?;
        }
        Ok(())
    }

    /// Makes the connections agree with `membership`; `computation` has the state before the next tick.
    pub(crate) fn follow(
        &mut self,
        membership: &Membership,
        locals: &Locals,
        computation: &dyn Computation,
    ) -> Result<(), BusError> {
        self.connect(membership, locals)?;
        let instances = &membership.nodes[self.links.index];
        let must_state = self.must_state(membership);
        let did_state = std::mem::replace(&mut self.states_every_tick, must_state);
        if must_state && !did_state && instances.primary.generation == self.links.generation {
            self.publish_state(self.tick, computation);
        }
        Ok(())
    }

    /// True if another process may go on from this one's state: a backup is there, or one is started when this one dies.
    fn must_state(&self, membership: &Membership) -> bool {
        self.links.generation > 0
            || self.links.node.restarts
            || membership.nodes[self.links.index].backup.is_some()
    }

    fn connect(&mut self, membership: &Membership, locals: &Locals) -> Result<(), BusError> {
        let tick = self.tick;
        self.known_ticks = 0;
        for input in &mut self.stepper.inputs {
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
        self.connect_readers(membership, locals)?;
        if is_backup {
            for (index, output) in self.stepper.outputs.iter_mut().enumerate() {
                self.links.promote(output, instances, index, tick);
            }
        }
        self.epoch = membership.epoch;
        Ok(())
    }

    /// Computes the next tick; returns the host time at which it was done. `before_ns` is the host time of a look at
    /// the clock, if no node has waited since.
    ///
    /// # Errors
    /// If a sample is lost, the step fails, or a due output stays unwritten.
    pub(crate) fn compute(
        &mut self,
        before_ns: Option<u64>,
        locals: &mut Locals,
        computation: &mut dyn Computation,
    ) -> Result<u64, BusError> {
        let tick = self.tick;
        if self.links.generation > 0 && tick <= self.take_over_tick.max(self.first_tick) {
            // It begins with the state of its predecessor, not with its own.
            self.publish_state(tick, computation);
        }
        let lockstep = &self.links.lockstep;
        let gathered = self.stepper.gather(tick);
        gathered.inspect_err(|&(topic, _)| lockstep.count_gap(topic)).map_err(|(_, error)| error)?;
        self.write_checkpoints(tick, locals, computation)?;
        let received_ns = before_ns.unwrap_or_else(monotonic_ns);
        self.step(tick, locals, computation)?;
        if self.links.lockstep.place().is_cancelled() {
            // Another instance may have been asked to go on in its place by now.
            return Err(BusError::Aborted);
        }
        let done_ns = monotonic_ns();
        self.step_ns += done_ns - received_ns;
        self.links.lockstep.count_step(done_ns - received_ns);
        if self.states_every_tick {
            // Before anything is sent: a process that sees the sample can go on from the state after it.
            self.publish_state(tick + self.links.node.period_ticks, computation);
        }
        self.publish(tick, received_ns, done_ns, locals)?;
        if tick >= self.take_over_tick {
            // The predecessor leaves; its samples are not read any more.
            self.stepper.predecessor.clear();
            self.state.leave_predecessor();
        }
        self.tick += self.links.node.period_ticks;
        Ok(done_ns)
    }

    /// Computes the component's step, which writes the due outputs.
    fn step(
        &mut self,
        tick: u32,
        locals: &Locals,
        computation: &mut dyn Computation,
    ) -> Result<(), BusError> {
        let takes_over = self.links.generation > 0 && tick == self.take_over_tick;
        let takes_over = takes_over || self.succeeds_at == Some(tick);
        let words = self.state.more_words();
        let stepped = self.stepper.step(tick, takes_over, words, locals, computation)?;
        // Until then they are its predecessor's to count.
        let counts = tick >= self.take_over_tick;
        match stepped {
            Stepped::Overran if counts => self.links.lockstep.count_overrun(),
            Stepped::Skipped if counts => self.links.lockstep.count_skipped_step(),
            Stepped::InTime | Stepped::Overran | Stepped::Skipped => {}
        }
        Ok(())
    }

    fn publish(
        &mut self,
        tick: u32,
        received_ns: u64,
        done_ns: u64,
        locals: &mut Locals,
    ) -> Result<(), BusError> {
        let (lockstep, profile) = (&self.links.lockstep, &mut self.profile);
        let mut sent_before = false;
        let times_ns = |output| {
            // The first output is sent at once: one look at the clock serves for both times.
            let sent_ns = if std::mem::replace(&mut sent_before, true) { monotonic_ns() } else { done_ns };
            if let Some(profile) = profile.as_mut() {
                profile.sent(output, sent_ns);
            }
            [received_ns, done_ns, sent_ns]
        };
        let sent = |output: &mut OutPort| {
            if tick < output.counts_from {
                output.ticks_told = output.ticks_sent;
                lockstep.shadow_sent(output.topic, output.ticks_sent, &output.readers);
            } else if output.is_awaited {
                output.ticks_told = output.ticks_sent;
                lockstep.samples_sent(output.topic, output.ticks_sent, &output.readers);
            }
        };
        self.stepper.publish(tick, locals, times_ns, sent)?;
        if let Some(profile) = &mut self.profile {
            profile.end(tick, received_ns, done_ns, monotonic_ns());
        }
        Ok(())
    }
}

impl Awaited {
    /// `count` of `need`, and no more.
    fn count(need: Need, count: u32) -> Self {
        Self::Count { need, count, sleep_for: count }
    }

    /// True if the need is met, although the count that was slept for is not reached.
    fn is_there(self, lockstep: &NodeView) -> bool {
        matches!(self, Self::Count { need, count, .. } if lockstep.has(need, count))
    }
}
