//! The two ends of an edge inside a node: what may be read at a tick, and what must be sent.

use crate::control::Edge;
use crate::error::BusError;
use crate::message::cdr_bytes;
use crate::messages::Time;
use crate::plan::{InputPlan, OutputPlan, TopicPlan};
use crate::schema::Schema;
use crate::transport::{Loan, Received, Receiver, SampleHeader, Sender};

/// A connected input.
#[derive(Debug)]
pub(crate) struct InPort {
    // The sample before the receiver: it goes back to the publisher while the connection still stands.
    current: Option<Received>,
    receiver: Receiver,
    initial: Option<Box<[u64]>>,
    expected_sequence: u64,
    topic_name: String,
    size: usize,
    topic_period_ticks: u32,
    pub(crate) topic: usize,
    pub(crate) delay_ticks: u32,
    pub(crate) edge: Edge,
}

impl InPort {
    pub(crate) fn new(
        input: &InputPlan,
        topic: &TopicPlan,
        size: usize,
        edge: Edge,
        initial: Option<Box<[u64]>>,
        receiver: Receiver,
    ) -> Self {
        Self {
            current: None,
            receiver,
            initial,
            expected_sequence: 0,
            topic_name: topic.name.clone(),
            size,
            topic_period_ticks: topic.period_ticks,
            topic: input.topic,
            delay_ticks: input.delay_ticks,
            edge,
        }
    }

    /// Makes the newest sample stamped at or before `tick` minus the delay the current one.
    pub(crate) fn take(&mut self, tick: u32, node: &str) -> Result<(), BusError> {
        let Some(limit) = tick.checked_sub(self.delay_ticks) else { return Ok(()) };
        // The samples between the current one and the newest are received too, so that gaps show.
        let newest_sequence = u64::from(limit / self.topic_period_ticks);
        while self.expected_sequence <= newest_sequence {
            let sample = self.receive(tick, node)?;
            self.current = Some(sample);
        }
        Ok(())
    }

    fn receive(&mut self, tick: u32, node: &str) -> Result<Received, BusError> {
        let gap = |expected, found| BusError::Gap {
            node: node.to_owned(),
            topic: self.topic_name.clone(),
            tick,
            expected,
            found,
        };
        let received = self.receiver.receive().map_err(|error| gap(self.expected_sequence, error))?;
        let sample = received.ok_or_else(|| gap(self.expected_sequence, "nothing".to_owned()))?;
        let header = sample.header();
        let expected_tick = self.expected_sequence * u64::from(self.topic_period_ticks);
        if header.sequence != self.expected_sequence || header.tick != expected_tick {
            let found = format!("{} (of tick {})", header.sequence, header.tick);
            return Err(gap(self.expected_sequence, found));
        }
        self.expected_sequence += 1;
        Ok(sample)
    }

    /// The current sample, or the initial value.
    ///
    /// # Panics
    /// If there is neither: the launcher refuses a delayed input without an initial value.
    pub(crate) fn words(&self) -> &[u64] {
        match (&self.current, &self.initial) {
            (Some(sample), _) => sample.words(),
            (None, Some(initial)) => initial,
            (None, None) => panic!("topic {} has no sample and no initial value", self.topic_name),
        }
    }

    pub(crate) fn host_times_ns(&self) -> [u64; 3] {
        let header = self.current.as_ref().map(|sample| *sample.header()).unwrap_or_default();
        [header.received_ns, header.done_ns, header.sent_ns]
    }

    /// The current sample as CDR bytes with its sequence number, if it was sent at `tick`.
    pub(crate) fn fresh(&self, tick: u32) -> Option<(&[u8], u64)> {
        let sample = self.current.as_ref().filter(|sample| sample.header().tick == u64::from(tick))?;
        Some((cdr_bytes(sample.words(), self.size), sample.header().sequence))
    }
}

/// A connected output.
#[derive(Debug)]
pub(crate) struct OutPort {
    // The loan before the sender, for the same reason as above.
    loan: Option<Loan>,
    is_written: bool,
    sender: Sender,
    sequence: u64,
    port: String,
    stamp_offset: Option<usize>,
    pub(crate) topic: usize,
    pub(crate) period_ticks: u32,
    pub(crate) readers: Vec<Edge>,
}

impl OutPort {
    pub(crate) fn new(
        output: &OutputPlan,
        topic: &TopicPlan,
        schema: &Schema,
        sender: Sender,
        readers: Vec<Edge>,
    ) -> Self {
        Self {
            loan: None,
            is_written: false,
            sender,
            sequence: 0,
            port: output.port.clone(),
            stamp_offset: schema.stamp_offset(),
            topic: output.topic,
            period_ticks: topic.period_ticks,
            readers,
        }
    }

    pub(crate) fn is_due(&self, tick: u32) -> bool {
        tick.is_multiple_of(self.period_ticks)
    }

    /// The words of this tick's sample.
    pub(crate) fn words(&mut self, node: &str) -> Result<&mut [u64], BusError> {
        self.prepare(node)?;
        self.is_written = true;
        match &mut self.loan {
            Some(loan) => Ok(loan.words()),
            None => unreachable!("the loan was taken above"),
        }
    }

    /// Forgets what was written at a tick at which nothing was due.
    pub(crate) fn forget(&mut self) {
        self.is_written = false;
    }

    /// Takes the memory of the next sample.
    pub(crate) fn prepare(&mut self, node: &str) -> Result<(), BusError> {
        if self.loan.is_none() {
            let loan = self.sender.loan().map_err(|reason| self.error("taking a sample", node, reason))?;
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
    ) -> Result<(), BusError> {
        let Some(mut loan) = self.loan.take().filter(|_| self.is_written) else {
            return Err(BusError::UnwrittenOutput { node: node.to_owned(), port: self.port.clone(), tick });
        };
        self.is_written = false;
        if let Some(offset) = self.stamp_offset {
            stamp(loan.words(), offset, time_ns);
        }
        let header =
            SampleHeader { tick: u64::from(tick), sequence: self.sequence, received_ns, done_ns, sent_ns };
        self.sequence += 1;
        loan.send(header).map_err(|reason| self.error("sending", node, reason))
    }

    fn error(&self, action: &str, node: &str, reason: String) -> BusError {
        let action = format!("{action} on its output `{}`", self.port);
        BusError::Transport { node: node.to_owned(), action, reason }
    }
}

fn stamp(words: &mut [u64], offset: usize, time_ns: u64) {
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words[1..]);
    let stamp = Time::from_ns(time_ns);
    bytes[offset..offset + size_of::<Time>()].copy_from_slice(bytemuck::bytes_of(&stamp));
}
