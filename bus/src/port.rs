//! The two ends of a connection inside a node: the samples to read at a tick, and the samples to send.

use crate::announcement::Announcement;
use crate::error::BusError;
use crate::finite::{Floats, field_at};
use crate::local::LocalTopic;
use crate::message::{cdr_bytes, message_bytes, sample_words};
use crate::messages::Time;
use crate::plan::{InputPlan, OutputPlan, TopicPlan};
use crate::sample_memory::empty_sample;
use crate::sample_ring::SampleRing;
use crate::sample_ticks::SampleTicks;
use crate::saved_sample::SavedSample;
use crate::schema::{Extent, Schema};
use crate::transport::{IceoryxError, Loan, Received, Receiver, SampleHeader, Sender};
use std::collections::VecDeque;

/// The topics of a group, by their numbers in the plan; those that no two members share are absent. Empty for a node that
/// has a process of its own.
pub(crate) type Locals = [Option<LocalTopic>];

/// The samples of a topic from one generation of its publisher.
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) generation: u32,
    receiver: Receiver,
    /// The sequence number of the next sample.
    next_sequence: u64,
    /// True if the samples received so far may be older than the next one: they are the history that a subscriber
    /// gets when it joins later.
    has_history: bool,
}

/// Sample or error found in the place of the next sample.
#[derive(Debug, thiserror::Error)]
enum Found {
    #[error("nothing")]
    Nothing,
    #[error("{sequence} (of tick {tick})")]
    Other { sequence: u64, tick: u64 },
    #[error("{0}")]
    Failure(#[from] IceoryxError),
}

impl Source {
    /// A source whose first sample is that of the first due tick from `first_tick` on.
    pub(crate) fn new(generation: u32, receiver: Receiver, first_tick: u32, ticks: SampleTicks) -> Self {
        let next_sequence = ticks.first_sequence(first_tick);
        Self { generation, receiver, next_sequence, has_history: true }
    }

    /// A source for a process that joins at `tick`: it gets the newest sample of that tick's limit first.
    pub(crate) fn joined(
        generation: u32,
        receiver: Receiver,
        limit: Option<u32>,
        ticks: SampleTicks,
    ) -> Self {
        let next_sequence = limit.map_or(0, |limit| ticks.sequence(limit));
        Self { generation, receiver, next_sequence, has_history: true }
    }

    /// The next sample, if it is there.
    fn next(&mut self, ticks: SampleTicks) -> Result<Option<Received>, Found> {
        loop {
            let Some(sample) = self.receiver.receive()? else { return Ok(None) };
            let header = sample.header();
            if self.has_history && header.sequence < self.next_sequence {
                continue;
            }
            self.has_history = false;
            if header.sequence != self.next_sequence || header.tick != ticks.tick(header.sequence) {
                return Err(Found::Other { sequence: header.sequence, tick: header.tick });
            }
            self.next_sequence += 1;
            return Ok(Some(sample));
        }
    }
}

/// A process that shadows the publisher of an input, and whose samples count from `take_over_tick` on.
#[derive(Debug)]
struct Backup {
    source: Source,
    /// True if it sends samples before they count; false for one that is started after a crash.
    shadows: bool,
    take_over_tick: u32,
}

/// Source of the samples of an input.
#[derive(Debug)]
pub(crate) enum Feed {
    /// Another process.
    Shared(Source),
    /// A member of the same group; its topic's number is that of the plan.
    Local {
        /// The publisher's generation.
        generation: u32,
    },
    /// A member of a group, for the recorder.
    Ring(SampleRing),
}

impl Feed {
    fn generation(&self) -> u32 {
        match self {
            Self::Shared(source) => source.generation,
            Self::Local { generation } => *generation,
            // Only the first instance of a node is a member.
            Self::Ring(_) => 0,
        }
    }

    /// The next sample, which another process has sent.
    fn next(&mut self, ticks: SampleTicks) -> Result<Received, Found> {
        let Self::Shared(source) = self else { return Err(Found::Nothing) };
        source.next(ticks)?.ok_or(Found::Nothing)
    }

    /// True if the samples before number `first` were taken: those of a member are always there.
    fn has_taken(&self, first: u64) -> bool {
        match self {
            Self::Shared(source) => source.next_sequence >= first,
            Self::Local { .. } | Self::Ring(_) => true,
        }
    }
}

/// A connected input.
#[derive(Debug)]
pub(crate) struct InPort {
    // Samples before the receivers: they go back to the publisher while the connection still stands.
    current: Option<Received>,
    shadow: Option<Received>,
    active: Feed,
    /// The newest tick that a sample of a member may have.
    newest_tick: Option<u32>,
    /// Publishers that succeed it, in order: more than one if a backup died before this node turned to it.
    backups: VecDeque<Backup>,
    initial: Option<Box<[u64]>>,
    /// The newest sample from before the run went on from a checkpoint, or one that a group has left behind.
    restored: Option<(SampleHeader, Box<[u64]>)>,
    /// Samples that a group has left behind: its members have sent none by themselves when their process dies.
    pub(crate) left_behind: Option<SampleRing>,
    topic_name: String,
    size: usize,
    layout_hash: u64,
    topic_ticks: SampleTicks,
    /// True if the node reads the shadow samples too, and so waits for them.
    pub(crate) reads_shadow: bool,
    pub(crate) topic: usize,
    pub(crate) delay_ticks: u32,
}

impl InPort {
    pub(crate) fn new(
        input: &InputPlan,
        topic: &TopicPlan,
        announcement: &Announcement,
        initial: Option<Box<[u64]>>,
        active: Feed,
    ) -> Self {
        Self {
            current: None,
            shadow: None,
            active,
            newest_tick: None,
            backups: VecDeque::new(),
            initial,
            restored: None,
            left_behind: None,
            topic_name: topic.name.clone(),
            size: announcement.size,
            layout_hash: announcement.layout_hash,
            topic_ticks: topic.ticks,
            reads_shadow: false,
            topic: input.topic,
            delay_ticks: input.delay_ticks,
        }
    }

    /// Input with the last sample that another component sent to `topic`. The node goes on in its place from a
    /// checkpoint. The input holds `sample` if that has the layout of the node's own messages.
    pub(crate) fn of_predecessor(
        output: &OutputPlan,
        topic: &TopicPlan,
        announcement: &Announcement,
        sample: Option<&SavedSample>,
    ) -> Self {
        let (port, initial) = (output.port.clone(), None);
        let input = InputPlan { port, topic: output.topic, delay_ticks: 1, initial };
        let mut port = Self::new(&input, topic, announcement, None, Feed::Local { generation: 0 });
        if let Some(sample) = sample {
            // A sample of another layout is not one of the node's.
            let _ = port.restore(sample, "");
        }
        port
    }

    /// The newest generation that this input is connected to.
    pub(crate) fn newest_generation(&self) -> u32 {
        self.backups.back().map_or(self.active.generation(), |backup| backup.source.generation)
    }

    /// The tick whose sample `tick` reads, unless that lies before the run.
    pub(crate) fn limit(&self, tick: u32) -> Option<u32> {
        tick.checked_sub(self.delay_ticks)
    }

    /// Connects the publisher's backup; its samples do not count yet.
    pub(crate) fn add_backup(&mut self, source: Source, shadows: bool) {
        self.shadow = None;
        self.backups.push_back(Backup { source, shadows, take_over_tick: u32::MAX });
    }

    /// Lets go of backups that were refused: those behind `generation`, which flies.
    pub(crate) fn drop_backups_beyond(&mut self, generation: u32) {
        self.shadow = None;
        self.backups.retain(|backup| backup.source.generation <= generation);
    }

    /// Makes the backup's samples count from `tick` on.
    pub(crate) fn set_take_over_tick(&mut self, tick: u32) {
        if let Some(backup) = self.backups.back_mut() {
            backup.take_over_tick = tick;
        }
    }

    /// True if the node waits for a shadow sample that is due at `tick`.
    pub(crate) fn awaits_shadow(&self, tick: u32) -> bool {
        let is_due = |backup: &Backup| backup.shadows && tick < backup.take_over_tick;
        self.reads_shadow && self.backups.back().is_some_and(is_due)
    }

    /// Makes the newest sample stamped at or before `tick` minus the delay the current one.
    pub(crate) fn take(&mut self, tick: u32, node: &str) -> Result<(), BusError> {
        self.take_up_to(self.limit(tick), tick, node)
    }

    /// Makes the newest sample stamped before `tick` the current one, for any delay: a later tick reads it, or a
    /// newer one.
    pub(crate) fn take_before(&mut self, tick: u32, node: &str) -> Result<(), BusError> {
        self.take_up_to(tick.checked_sub(1), tick, node)
    }

    /// Makes the newest sample stamped at or before `limit` the current one, at tick `tick`.
    fn take_up_to(&mut self, limit: Option<u32>, tick: u32, node: &str) -> Result<(), BusError> {
        self.newest_tick = limit;
        let Some(limit) = limit else { return Ok(()) };
        // The samples between the current one and the newest are received too, so that gaps show.
        let newest_sequence = self.topic_ticks.sequence(limit);
        self.pass_take_over(newest_sequence);
        while let Feed::Shared(Source { next_sequence: expected, has_history, .. }) = self.active
            && expected <= newest_sequence
        {
            // A group that has died sent its newest samples to nobody outside; who succeeds a member sends newer ones.
            if !(has_history && self.take_left_behind(expected)) {
                let next = self.active.next(self.topic_ticks);
                self.current = Some(next.map_err(|found| self.gap(node, tick, expected, found))?);
            }
            self.pass_take_over(newest_sequence);
        }
        if let Feed::Ring(ring) = &self.active
            && self.topic_ticks.is_due(limit)
            && ring.at(limit).is_none()
        {
            return Err(self.gap(node, tick, newest_sequence, Found::Nothing));
        }
        self.take_shadow(newest_sequence).map_err(|(expected, found)| self.gap(node, tick, expected, found))
    }

    /// Makes sample number `sequence` the current one, if a group has left it behind; false if none has.
    fn take_left_behind(&mut self, sequence: u64) -> bool {
        let tick = self.topic_ticks.tick(sequence);
        let left =
            self.left_behind.as_ref().zip(u32::try_from(tick).ok()).and_then(|(ring, tick)| ring.at(tick));
        let (Some(words), Feed::Shared(source)) = (left, &mut self.active) else { return false };
        source.next_sequence = sequence + 1;
        self.current = None;
        self.restored = Some((SampleHeader { tick, sequence, ..SampleHeader::default() }, words.into()));
        true
    }

    /// As [`InPort::take`], without insisting on the newest sample: it may not have been sent yet.
    pub(crate) fn take_available(&mut self, tick: u32, node: &str) -> Result<(), BusError> {
        let newest_sequence = self.limit(tick).map_or(0, |limit| self.topic_ticks.sequence(limit));
        while let Feed::Shared(source) = &mut self.active
            && source.next_sequence <= newest_sequence
        {
            let expected = source.next_sequence;
            match source.next(self.topic_ticks) {
                Ok(Some(sample)) => self.current = Some(sample),
                Ok(None) => break,
                Err(found) => return Err(self.gap(node, tick, expected, found)),
            }
        }
        Ok(())
    }

    /// Turns to the backup when the next sample is one of those that count.
    fn pass_take_over(&mut self, newest_sequence: u64) {
        while let Some(next) = self.backups.front() {
            let first = self.topic_ticks.first_sequence(next.take_over_tick);
            if next.take_over_tick == u32::MAX || newest_sequence < first || !self.active.has_taken(first) {
                return;
            }
            let Some(Backup { mut source, .. }) = self.backups.pop_front() else { return };
            self.shadow = None;
            // A node that does not read the shadow may have left some of it in the queue.
            source.has_history |= source.next_sequence < first;
            source.next_sequence = source.next_sequence.max(first);
            self.active = Feed::Shared(source);
        }
    }

    /// Receives the samples that backups have sent so far, so that their queues cannot run full; the error is the
    /// sequence number that was due, and what was found.
    fn take_shadow(&mut self, newest_sequence: u64) -> Result<(), (u64, Found)> {
        for Backup { source, .. } in &mut self.backups {
            while source.next_sequence <= newest_sequence {
                let expected = source.next_sequence;
                match source.next(self.topic_ticks).map_err(|found| (expected, found))? {
                    Some(sample) => self.shadow = Some(sample),
                    None => break,
                }
            }
        }
        Ok(())
    }

    fn gap(&self, node: &str, tick: u32, expected: u64, found: Found) -> BusError {
        let found = found.to_string();
        BusError::Gap { node: node.to_owned(), topic: self.topic_name.clone(), tick, expected, found }
    }

    /// The sample that the tick reads, or the initial value, if there is one.
    pub(crate) fn newest<'a>(&'a self, locals: &'a Locals) -> Option<&'a [u64]> {
        self.sample(locals).map(|(_, words)| words).or(self.initial.as_deref())
    }

    /// The sample that the tick reads, or the initial value.
    ///
    /// # Panics
    /// If there is neither: the launcher refuses a delayed input without an initial value.
    pub(crate) fn words<'a>(&'a self, locals: &'a Locals) -> &'a [u64] {
        let words = self.newest(locals);
        words.unwrap_or_else(|| panic!("topic {} has no sample and no initial value", self.topic_name))
    }

    /// The sample that the tick reads, if there is one.
    pub(crate) fn sample<'a>(&'a self, locals: &'a Locals) -> Option<(SampleHeader, &'a [u64])> {
        self.received(locals).or_else(|| self.restored())
    }

    /// The newest sample from before the run went on from a checkpoint.
    fn restored(&self) -> Option<(SampleHeader, &[u64])> {
        self.restored.as_ref().map(|(header, words)| (*header, &**words))
    }

    /// The newest sample from before the run went on from a checkpoint, as CDR bytes.
    pub(crate) fn restored_cdr(&self) -> Option<&[u8]> {
        self.restored().map(|(_, words)| cdr_bytes(words, self.size))
    }

    /// Goes on with `sample` as the newest one.
    ///
    /// # Errors
    /// If it is not laid out as the samples of the topic are now.
    pub(crate) fn restore(&mut self, sample: &SavedSample, node: &str) -> Result<(), BusError> {
        if sample.layout_hash != self.layout_hash || sample.words.len() != sample_words(self.size) {
            let reason = format!(
                "the messages of {} are laid out otherwise than when the checkpoint was written",
                self.topic_name
            );
            return Err(BusError::Checkpoint { node: node.to_owned(), reason });
        }
        let header = SampleHeader { tick: sample.tick, sequence: sample.sequence, ..SampleHeader::default() };
        self.restored = Some((header, sample.words.clone().into_boxed_slice()));
        Ok(())
    }

    /// Makes the samples of this process up to `tick` visible to a local feed.
    pub(crate) fn look_at(&mut self, tick: u32) {
        self.newest_tick = Some(tick);
    }

    /// The newest sample that was sent before tick `before`, as far as this or a later tick may read it.
    pub(crate) fn sample_before(&self, before: u32, locals: &Locals) -> Option<SavedSample> {
        let (header, words) = match (&self.active, self.newest_tick) {
            (Feed::Ring(ring), Some(newest)) => {
                let (sequence, tick) = (self.topic_ticks.sequence(newest), self.topic_ticks.newest(newest));
                let header = SampleHeader { tick: tick.into(), sequence, ..SampleHeader::default() };
                ring.at(tick).map(|words| (header, words)).or_else(|| self.restored())
            }
            _ => self.sample(locals),
        }?;
        (header.tick < u64::from(before)).then(|| SavedSample {
            topic: self.topic_name.clone(),
            layout_hash: self.layout_hash,
            tick: header.tick,
            sequence: header.sequence,
            words: words.to_vec(),
        })
    }

    fn received<'a>(&'a self, locals: &'a Locals) -> Option<(SampleHeader, &'a [u64])> {
        match &self.active {
            Feed::Shared(_) => self.current.as_ref().map(|sample| (*sample.header(), sample.words())),
            Feed::Local { .. } => {
                let tick = self.newest_tick?;
                locals[self.topic].as_ref()?.at(tick)
            }
            Feed::Ring(ring) => {
                let tick = self.newest_tick?;
                let sequence = self.topic_ticks.sequence(tick);
                let header = SampleHeader { tick: tick.into(), sequence, ..SampleHeader::default() };
                ring.at(tick).map(|words| (header, words))
            }
        }
    }

    /// The tick at which that sample was sent, if there is one.
    pub(crate) fn sent_tick(&self, locals: &Locals) -> Option<u64> {
        self.sample(locals).map(|(header, _)| header.tick)
    }

    pub(crate) fn host_times_ns(&self, locals: &Locals) -> [u64; 3] {
        let header = self.sample(locals).map(|(header, _)| header).unwrap_or_default();
        [header.received_ns, header.done_ns, header.sent_ns]
    }

    /// The sample that the tick reads, as CDR bytes with its sequence number, if it was sent at `tick`.
    pub(crate) fn fresh<'a>(&'a self, tick: u32, locals: &'a Locals) -> Option<(&'a [u8], u64)> {
        self.cdr(self.sample(locals), tick)
    }

    /// The sample of the process that shadows the publisher, in the same form, if it was sent at `tick`.
    pub(crate) fn fresh_shadow(&self, tick: u32) -> Option<(&[u8], u64)> {
        self.cdr(self.shadow.as_ref().map(|sample| (*sample.header(), sample.words())), tick)
    }

    fn cdr<'a>(&self, sample: Option<(SampleHeader, &'a [u64])>, tick: u32) -> Option<(&'a [u8], u64)> {
        let (header, words) = sample.filter(|(header, _)| header.tick == u64::from(tick))?;
        Some((cdr_bytes(words, self.size), header.sequence))
    }

    /// True if the samples that count now come from a member of the same group.
    pub(crate) fn is_local(&self) -> bool {
        matches!(self.active, Feed::Local { .. })
    }
}

/// A connected output.
#[derive(Debug)]
pub(crate) struct OutPort {
    // The loan before the sender, for the same reason as above.
    loan: Option<Loan>,
    is_written: bool,
    /// The connection to other processes; absent as long as members of the same group alone read the topic.
    sender: Option<Sender>,
    /// Memory of the next sample where members of the same group, or the recorder of a group, read the topic.
    staging: Option<Box<[u64]>>,
    /// Ring in which the recorder of a group reads the samples.
    ring: Option<SampleRing>,
    port: String,
    topic_name: String,
    schema: &'static Schema,
    floats: Floats,
    /// The part of a message's bytes that counts.
    extent: Option<Extent>,
    stamp_offset: Option<usize>,
    /// True if a sample is taken at ticks at which none is sent: its node's steps take time, and send later.
    is_timed: bool,
    pub(crate) topic: usize,
    pub(crate) ticks: SampleTicks,
    /// The tick from which on the samples count; before it they are a shadow's.
    pub(crate) counts_from: u32,
    /// The tick from which on samples are sent at all.
    pub(crate) sends_from: u32,
    /// The inputs that read it, by their numbers among those of all slots.
    pub(crate) readers: Vec<usize>,
    /// True if a node of another process computes from it, and so waits for it.
    pub(crate) is_awaited: bool,
    /// Ticks whose samples are sent, and those of them that the control segment counts.
    pub(crate) ticks_sent: u32,
    pub(crate) ticks_told: u32,
}

impl OutPort {
    pub(crate) fn new(
        output: &OutputPlan,
        topic: &TopicPlan,
        schema: &'static Schema,
        sender: Option<Sender>,
        is_staged: bool,
    ) -> Self {
        Self {
            loan: None,
            is_written: false,
            sender,
            staging: is_staged.then(|| empty_sample(schema.size)),
            ring: None,
            port: output.port.clone(),
            topic_name: topic.name.clone(),
            schema,
            floats: Floats::of(schema),
            extent: schema.extent(),
            stamp_offset: schema.stamp_offset(),
            is_timed: false,
            topic: output.topic,
            ticks: topic.ticks,
            counts_from: 0,
            sends_from: 0,
            readers: Vec::new(),
            is_awaited: true,
            ticks_sent: 0,
            ticks_told: 0,
        }
    }

    /// This port for forwarded messages, which keep the stamps of their senders.
    pub(crate) fn keeping_stamps(self) -> Self {
        Self { stamp_offset: None, ..self }
    }

    /// Lets the recorder of a group read the samples in `ring`.
    pub(crate) fn record(&mut self, ring: SampleRing) {
        self.ring = Some(ring);
    }

    /// Makes the port take a sample at every step.
    pub(crate) fn set_timed(&mut self) {
        self.is_timed = true;
    }

    /// Bytes of its messages.
    pub(crate) fn size(&self) -> usize {
        self.schema.size
    }

    /// Words of a sample.
    pub(crate) fn sample_words(&self) -> usize {
        sample_words(self.schema.size)
    }

    pub(crate) fn is_due(&self, tick: u32) -> bool {
        self.ticks.is_due(tick)
    }

    /// True if a step at `tick` writes a sample.
    pub(crate) fn takes(&self, tick: u32) -> bool {
        self.is_timed || self.is_due(tick)
    }

    /// True if the step has taken the memory of its sample.
    pub(crate) fn is_written(&self) -> bool {
        self.is_written
    }

    /// Sample that the step at `tick` wrote.
    ///
    /// # Errors
    /// If it did not write an output that was due.
    pub(crate) fn written(&mut self, tick: u32, node: &str) -> Result<Option<&[u64]>, BusError> {
        if !self.is_written && self.is_due(tick) {
            return Err(self.unwritten(node, tick));
        }
        if !self.is_written {
            return Ok(None);
        }
        Ok(self.memory().map(|words| &*words))
    }

    /// Memory of the next sample, if it was taken.
    fn memory(&mut self) -> Option<&mut [u64]> {
        match &mut self.staging {
            Some(staging) => Some(staging),
            None => self.loan.as_mut().map(Loan::words),
        }
    }

    fn unwritten(&self, node: &str, tick: u32) -> BusError {
        BusError::UnwrittenOutput { node: node.to_owned(), port: self.port.clone(), tick }
    }

    /// True if a sample is sent at `tick`.
    pub(crate) fn is_sent(&self, tick: u32) -> bool {
        self.is_due(tick) && tick >= self.sends_from
    }

    /// The words of this tick's sample.
    pub(crate) fn words(&mut self, node: &str) -> Result<&mut [u64], BusError> {
        if self.staging.is_none() {
            self.prepare(node)?;
        }
        self.is_written = true;
        match self.memory() {
            Some(words) => Ok(words),
            None => unreachable!("a topic that neither its group nor a recorder of it reads has a sender"),
        }
    }

    /// Sees to it that a subscriber that joined gets the newest samples before the next one is sent.
    pub(crate) fn update_subscribers(&self, node: &str) -> Result<(), BusError> {
        let updated = self.sender.as_ref().map_or(Ok(()), Sender::update_subscribers);
        updated.map_err(|reason| self.error("meeting subscribers", node, &reason))
    }

    /// True if other processes are sent the samples.
    pub(crate) fn is_shared(&self) -> bool {
        self.sender.is_some()
    }

    /// Sends the samples to other processes from now on, the newest one of the group included.
    pub(crate) fn share(
        &mut self,
        sender: Sender,
        topic: Option<&LocalTopic>,
        node: &str,
    ) -> Result<(), BusError> {
        if let Some((header, words)) = topic.and_then(LocalTopic::newest).or_else(|| self.recorded()) {
            copy_out(&sender, words, header).map_err(|reason| self.error("sending", node, &reason))?;
        }
        self.sender = Some(sender);
        Ok(())
    }

    /// The newest sample in the ring.
    fn recorded(&self) -> Option<(SampleHeader, &[u64])> {
        let before = self.ticks_sent.checked_sub(1)?;
        let (tick, sequence) = (self.ticks.newest(before), self.ticks.sequence(before));
        let header = SampleHeader { tick: tick.into(), sequence, ..SampleHeader::default() };
        Some((header, self.ring.as_ref()?.at(tick)?))
    }

    /// Forgets a sample that was written at a tick at which none was due.
    pub(crate) fn forget(&mut self) {
        self.is_written = false;
    }

    /// Takes the memory of the next sample.
    pub(crate) fn prepare(&mut self, node: &str) -> Result<(), BusError> {
        if let (None, None, Some(sender)) = (&self.loan, &self.staging, &self.sender) {
            let loan = sender.loan().map_err(|reason| self.error("taking a sample", node, &reason))?;
            self.loan = Some(loan);
        }
        Ok(())
    }

    /// Sends the sample that is due at `tick`; the host times are when the node had its inputs, was done,
    /// and sent.
    pub(crate) fn send(
        &mut self,
        tick: u32,
        time_ns: u64,
        [received_ns, done_ns, sent_ns]: [u64; 3],
        node: &str,
        locals: &mut Locals,
    ) -> Result<(), BusError> {
        if !self.is_written {
            return Err(self.unwritten(node, tick));
        }
        self.is_written = false;
        let (size, stamp_offset) = (self.schema.size, self.stamp_offset);
        let words = match (&mut self.staging, &mut self.loan) {
            (Some(staging), _) => &mut **staging,
            (None, Some(loan)) => loan.words(),
            (None, None) => return Err(self.unwritten(node, tick)),
        };
        if let Some(found) = self.floats.first_not_finite(message_bytes(words, size)) {
            return Err(self.not_finite(found, tick, time_ns, node));
        }
        if let Some(found) = self.extent.and_then(|extent| extent.wrong_count(message_bytes(words, size))) {
            return Err(self.wrong_count(found, tick, time_ns, node));
        }
        if let Some(offset) = stamp_offset {
            stamp(words, offset, time_ns);
        }
        let sequence = self.ticks.sequence(tick);
        let header = SampleHeader { tick: u64::from(tick), sequence, received_ns, done_ns, sent_ns };
        let sent = match (&self.staging, self.loan.take(), &self.sender) {
            (None, Some(loan), _) => loan.send(header),
            (Some(staging), _, Some(sender)) => copy_out(sender, staging, header),
            _ => Ok(()),
        };
        sent.map_err(|reason| self.error("sending", node, &reason))?;
        if let (Some(ring), Some(staging)) = (&mut self.ring, &self.staging) {
            ring.store(tick, staging);
        }
        if let Some(staging) = &mut self.staging
            && let Some(Some(topic)) = locals.get_mut(self.topic)
        {
            topic.send(header, staging);
        }
        self.ticks_sent = self.ticks.next(tick.saturating_add(1));
        Ok(())
    }

    fn not_finite(&self, (offset, value): (usize, f64), tick: u32, time_ns: u64, node: &str) -> BusError {
        BusError::NotFinite {
            node: node.to_owned(),
            output: format!("`{}` on {}", self.port, self.topic_name),
            field: field_at(self.schema, offset),
            value,
            tick,
            time_s: time_ns as f64 * 1e-9,
        }
    }

    fn wrong_count(&self, found: usize, tick: u32, time_ns: u64, node: &str) -> BusError {
        BusError::Count {
            node: node.to_owned(),
            output: format!("`{}` on {}", self.port, self.topic_name),
            field: self.schema.fields.last().map_or("", |field| field.name).to_owned(),
            found,
            most: self.extent.map_or(0, |extent| extent.values_max),
            tick,
            time_s: time_ns as f64 * 1e-9,
        }
    }

    fn error(&self, action: &str, node: &str, reason: &IceoryxError) -> BusError {
        let action = format!("{action} on its output `{}`", self.port);
        BusError::Transport { node: node.to_owned(), action, reason: reason.to_string() }
    }
}

/// Sends a copy of a sample to other processes.
fn copy_out(sender: &Sender, words: &[u64], header: SampleHeader) -> Result<(), IceoryxError> {
    let mut loan = sender.loan()?;
    loan.words().copy_from_slice(words);
    loan.send(header)
}

fn stamp(words: &mut [u64], offset: usize, time_ns: u64) {
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words[1..]);
    let stamp = Time::from_ns(time_ns);
    bytes[offset..offset + size_of::<Time>()].copy_from_slice(bytemuck::bytes_of(&stamp));
}
