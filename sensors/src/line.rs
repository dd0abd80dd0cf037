//! A serial line with a radio at its end: a queue, a wire that carries so many bits a second, and a way on which messages
//! take time and are lost.
//!
//! Time is counted in whole nanoseconds, and within a busy stretch of the wire in bits since its start, so that no rounding
//! adds up: after any time the wire has carried as many bits as its rate says. A message is whole: it waits until the wire
//! is free, is sent without a break, and arrives behind those that were sent before it. The fate of the n-th message
//! that is sent depends on the seed, the node's name and n alone.

use component::ports::FORWARDED_BYTES_MAX;
use component::random::{self, Stream, uniform};
use component::{Message, StateError};

/// Streams that share a line at most.
pub const STREAMS: usize = 16;
/// Packets that a line has places for at least.
pub const PLACES_MIN: usize = 64;

/// States of a [`Packet`].
const FREE: u32 = 0;
const QUEUED: u32 = 1;
const UNDER_WAY: u32 = 2;

const NS_PER_S: u128 = 1_000_000_000;

/// A message on the line, waiting or under way.
#[derive(Clone, Copy, Debug, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/LinkPacket")]
pub struct Packet {
    /// Its place among those that were queued.
    #[field(unit = "1")]
    number: u64,
    /// When it was queued.
    #[field(unit = "ns")]
    queued_ns: u64,
    /// When it arrives, once it is under way.
    #[field(unit = "ns")]
    arrival_ns: u64,
    /// Its stream.
    #[field(unit = "1")]
    stream: u32,
    /// Its length on the wire.
    #[field(unit = "1")]
    wire_bytes: u32,
    /// 0: the place is free; 1: it waits; 2: it is under way.
    #[field(unit = "1")]
    stage: u32,
    /// 1 where it is lost on the way.
    #[field(unit = "1")]
    is_lost: u32,
    /// The message.
    #[field(unit = "1")]
    message: [u8; FORWARDED_BYTES_MAX],
}

/// State of a line.
#[derive(Clone, Debug)]
pub struct LineState {
    /// The messages that wait or are under way, in any order.
    packets: Vec<Packet>,
    line: LineFields,
}

/// State of a line beside its packets.
#[derive(Clone, Copy, Debug, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/LineState")]
pub struct LineFields {
    /// The newest message of each stream that has arrived.
    #[field(unit = "1")]
    pub(crate) newest: [[u8; FORWARDED_BYTES_MAX]; STREAMS],
    /// Counts so far.
    pub(crate) counts: LineCounts,
    /// Messages queued so far.
    #[field(unit = "1")]
    queued: u64,
    /// When the wire began to be busy without a break.
    #[field(unit = "ns")]
    busy_since_ns: u64,
    /// Bits that it carries from then on.
    #[field(unit = "1")]
    busy_bits: u64,
    /// When it is free again.
    #[field(unit = "ns")]
    free_ns: u64,
    /// When the message that was sent last arrives: the next does not overtake it.
    #[field(unit = "ns")]
    last_arrival_ns: u64,
}

/// Traffic that a line has carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/LineCounts")]
pub struct LineCounts {
    /// Bytes of the messages whose sending has begun.
    #[field(unit = "1")]
    pub begun_bytes: u64,
    /// Those messages.
    #[field(unit = "1")]
    pub begun: u64,
    /// Messages that have arrived, by stream.
    #[field(unit = "1")]
    pub arrived: [u32; STREAMS],
    /// Messages that were lost on the way, by stream; counted when they would have arrived.
    #[field(unit = "1")]
    pub lost: [u32; STREAMS],
    /// Messages for which the queue had no room, by stream.
    #[field(unit = "1")]
    pub dropped: [u32; STREAMS],
    /// Time from queueing to arrival of the message that arrived last.
    #[field(unit = "ns")]
    pub delay_ns: u64,
}

impl std::ops::Deref for LineState {
    type Target = LineFields;

    fn deref(&self) -> &LineFields {
        &self.line
    }
}

impl std::ops::DerefMut for LineState {
    fn deref_mut(&mut self) -> &mut LineFields {
        &mut self.line
    }
}

/// More packets than a line has places for; the number of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0} messages wait or are under way, and this link holds no more: shorten its `latency_ms`, `jitter_ms` or \
     `queue_bytes`, or send less often (`rate_hz`)"
)]
pub struct NoPlace(pub usize);

/// Settings of a line.
#[derive(Debug)]
pub struct Line {
    /// Bits a second.
    pub bits_s: u64,
    /// Bits that a byte takes.
    pub bits_per_byte: u64,
    /// Bytes that may wait.
    pub queue_bytes: u32,
    /// Time from the last bit of a message to its arrival.
    pub latency_ns: u64,
    /// Greatest addition to it, evenly drawn.
    pub jitter_ns: u64,
    /// Fraction of messages that are lost.
    pub loss: f64,
    /// Priorities of the streams: the highest goes first.
    pub priorities: Vec<u32>,
    /// The random stream that fates are drawn from.
    pub random: Stream,
}

impl Line {
    /// Queues a message of `stream` at `at_ns`, which takes `wire_bytes` on the wire; where the queue has no room for it, it
    /// is dropped whole.
    ///
    /// # Errors
    /// As many packets as the state has places for wait or are under way already.
    pub fn queue(
        &self,
        state: &mut LineState,
        stream: usize,
        message: &[u8],
        wire_bytes: u32,
        at_ns: u64,
    ) -> Result<(), NoPlace> {
        if state.waiting().0 + wire_bytes > self.queue_bytes {
            state.counts.dropped[stream] += 1;
            return Ok(());
        }
        let (number, places) = (state.queued, state.packets.len());
        let place = state.packets.iter_mut().find(|packet| packet.stage == FREE).ok_or(NoPlace(places))?;
        #[allow(clippy::cast_possible_truncation, reason = "at most STREAMS")]
        let stream = stream as u32;
        *place = Packet {
            number,
            queued_ns: at_ns,
            stream,
            wire_bytes,
            stage: QUEUED,
            ..bytemuck::Zeroable::zeroed()
        };
        place.message[..message.len()].copy_from_slice(message);
        state.queued += 1;
        Ok(())
    }

    /// Sends the messages that wait, up to `until_ns`.
    pub fn send(&self, state: &mut LineState, until_ns: u64) {
        while let Some((index, start_ns)) = self.next(state).filter(|(_, start_ns)| *start_ns < until_ns) {
            let LineState { packets, line } = &mut *state;
            if start_ns > line.free_ns {
                (line.busy_since_ns, line.busy_bits) = (start_ns, 0);
            }
            let (delay_ns, is_lost) = self.fate(line.counts.begun);
            let packet = &mut packets[index];
            line.busy_bits += u64::from(packet.wire_bytes) * self.bits_per_byte;
            line.free_ns = line.busy_since_ns + self.duration_ns(line.busy_bits);
            line.last_arrival_ns = line.last_arrival_ns.max(line.free_ns + delay_ns);
            packet.arrival_ns = line.last_arrival_ns;
            (packet.stage, packet.is_lost) = (UNDER_WAY, u32::from(is_lost));
            line.counts.begun += 1;
            line.counts.begun_bytes += u64::from(packet.wire_bytes);
        }
    }

    /// The message that is sent next, and when: of those that wait when the wire is free the one of the highest priority,
    /// of these the one that came first.
    fn next(&self, state: &LineState) -> Option<(usize, u64)> {
        let queued = || state.packets.iter().enumerate().filter(|(_, packet)| packet.stage == QUEUED);
        let start_ns = queued().map(|(_, packet)| packet.queued_ns).min()?.max(state.free_ns);
        let waits = queued().filter(|(_, packet)| packet.queued_ns <= start_ns);
        let priority = |packet: &Packet| self.priorities[packet.stream as usize];
        let first = waits.min_by_key(|(_, packet)| (u32::MAX - priority(packet), packet.number));
        first.map(|(index, _)| (index, start_ns))
    }

    /// Returns the time in ns that message `number` travels behind its last bit, and whether it is lost.
    fn fate(&self, number: u64) -> (u64, bool) {
        // Two draws of two words of 32 bits each.
        let mut random = random::at(&self.random, u128::from(number) * 4);
        let is_lost = uniform(&mut random) < self.loss;
        let jitter_ns = uniform(&mut random) * self.jitter_ns as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the jitter")]
        let jitter_ns = jitter_ns as u64;
        (self.latency_ns + jitter_ns, is_lost)
    }

    /// Time that the wire takes for `bits`, rounded up.
    #[allow(clippy::cast_possible_truncation, reason = "a busy stretch is shorter than 500 years")]
    fn duration_ns(&self, bits: u64) -> u64 {
        (u128::from(bits) * NS_PER_S).div_ceil(u128::from(self.bits_s)) as u64
    }

    /// Takes out the messages that have arrived by `now_ns`.
    pub fn arrive(state: &mut LineState, now_ns: u64) {
        let arrived = |packet: &&mut Packet| packet.stage == UNDER_WAY && packet.arrival_ns <= now_ns;
        let LineState { packets, line } = state;
        // In the order of arrival, of a stream the newest stays.
        while let Some(packet) =
            packets.iter_mut().filter(arrived).min_by_key(|packet| (packet.arrival_ns, packet.number))
        {
            packet.stage = FREE;
            let stream = packet.stream as usize;
            if packet.is_lost == 1 {
                line.counts.lost[stream] += 1;
                continue;
            }
            line.newest[stream] = packet.message;
            line.counts.arrived[stream] += 1;
            line.counts.delay_ns = packet.arrival_ns - packet.queued_ns;
        }
    }

    /// Whole bytes that the wire has carried by `now_ns`.
    #[allow(clippy::cast_possible_truncation, reason = "fewer bits than have begun")]
    pub fn sent_bytes(&self, state: &LineState, now_ns: u64) -> u64 {
        // Counted from the start of the busy stretch: its end is rounded to a nanosecond.
        let busy_ns = u128::from(now_ns.saturating_sub(state.busy_since_ns));
        let busy_bits =
            (busy_ns * u128::from(self.bits_s) / NS_PER_S).min(u128::from(state.busy_bits)) as u64;
        let earlier_bits = state.counts.begun_bytes * self.bits_per_byte - state.busy_bits;
        (earlier_bits + busy_bits) / self.bits_per_byte
    }
}

impl LineState {
    /// A line with so many `places` for packets: nothing waits, nothing was sent.
    pub fn new(places: usize) -> Self {
        Self { packets: vec![bytemuck::Zeroable::zeroed(); places], line: bytemuck::Zeroable::zeroed() }
    }

    /// Bytes that [`LineState::save`] writes.
    pub fn size(&self) -> usize {
        size_of::<LineFields>() + self.packets.len() * size_of::<Packet>()
    }

    /// Writes the state into `bytes`.
    pub fn save(&self, bytes: &mut [u8]) {
        let (line, packets) = bytes.split_at_mut(size_of::<LineFields>());
        line.copy_from_slice(bytemuck::bytes_of(&self.line));
        packets.copy_from_slice(bytemuck::cast_slice(&self.packets));
    }

    /// Goes on from `bytes` that [`LineState::save`] wrote for a line with as many places.
    ///
    /// # Errors
    /// If their number is another one.
    pub fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        StateError::check_size(LineFields::SCHEMA.type_name, self.size(), bytes)?;
        let (line, packets) = bytes.split_at(size_of::<LineFields>());
        self.line = bytemuck::pod_read_unaligned(line);
        bytemuck::cast_slice_mut(&mut self.packets).copy_from_slice(packets);
        Ok(())
    }

    /// Number that changes with the layout of the state.
    pub fn configuration() -> u64 {
        LineFields::SCHEMA.layout_hash() ^ Packet::SCHEMA.layout_hash().rotate_left(1)
    }

    /// Bytes and messages that wait.
    pub fn waiting(&self) -> (u32, u32) {
        let queued = self.packets.iter().filter(|packet| packet.stage == QUEUED);
        queued.fold((0, 0), |(bytes, count), packet| (bytes + packet.wire_bytes, count + 1))
    }

    /// Messages that are under way.
    pub fn under_way(&self) -> u32 {
        self.packets.iter().map(|packet| u32::from(packet.stage == UNDER_WAY)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::{Line, LineState, NoPlace, PLACES_MIN};
    use component::random::stream;

    const MS: u64 = 1_000_000;

    fn line(seed: u64) -> Line {
        Line {
            bits_s: 57_600,
            bits_per_byte: 10,
            queue_bytes: 202,
            latency_ns: 0,
            jitter_ns: 0,
            loss: 0.0,
            priorities: vec![0; 3],
            random: stream(seed, "link"),
        }
    }

    /// Offers a message of 35 bytes each `every_ms` for `length_ms`, and lets all arrive.
    fn carry(line: &mut Line, every_ms: u64, length_ms: u64) -> LineState {
        let mut state = LineState::new(PLACES_MIN);
        for ms in 0..length_ms {
            if ms % every_ms == 0 {
                line.queue(&mut state, 0, &[1; 24], 35, ms * MS).unwrap();
            }
            line.send(&mut state, (ms + 1) * MS);
            Line::arrive(&mut state, (ms + 1) * MS);
        }
        state
    }

    #[test]
    fn a_full_line_carries_its_rate_to_the_byte() {
        for (seconds, bits_s) in [(1, 57_600), (7, 57_600), (60, 57_600), (10, 9600), (3, 115_200), (60, 333)]
        {
            let mut line = Line { bits_s, ..line(1) };
            let state = carry(&mut line, 1, seconds * 1000);
            // The first message is there at time 0, and the queue is never empty again; 0.1 bytes are no byte.
            assert_eq!(line.sent_bytes(&state, seconds * 1000 * MS), seconds * bits_s / 10, "{bits_s} bit/s");
        }
    }

    #[test]
    fn a_message_takes_as_long_as_its_bytes_and_the_latency() {
        let mut line = Line { latency_ns: 5 * MS, ..line(1) };
        let state = carry(&mut line, 100, 1000);
        // 350 bits at 57 600 bit/s take 6.0763 ms.
        assert_eq!((state.counts.arrived[0], state.counts.delay_ns), (10, 11_076_389));
        assert_eq!(state.waiting(), (0, 0));
    }

    #[test]
    fn losses_are_as_frequent_as_stated_within_what_chance_allows() {
        let (count, loss) = (400.0, 0.2_f64);
        let deviation = (count * loss * (1.0 - loss)).sqrt();
        let lost: Vec<f64> = (0..200)
            .map(|seed| {
                let state = carry(&mut Line { loss, ..line(seed) }, 10, 4000);
                assert_eq!(state.counts.lost[0] + state.counts.arrived[0], 400);
                f64::from(state.counts.lost[0])
            })
            .collect();
        // Beyond 4 standard deviations lies one seed of 16 000, beyond 4 of their mean one set of seeds of as many.
        assert!(lost.iter().all(|lost| (lost - count * loss).abs() < 4.0 * deviation), "{lost:?}");
        let mean = lost.iter().sum::<f64>() / 200.0;
        assert!((mean - count * loss).abs() < 4.0 * deviation / 200_f64.sqrt(), "{mean}");
    }

    #[test]
    fn what_finds_no_room_is_dropped_and_counted() {
        let (line, mut state) = (line(1), LineState::new(PLACES_MIN));
        for _ in 0..7 {
            line.queue(&mut state, 1, &[1; 24], 35, 0).unwrap();
        }
        // 5 × 35 bytes are 175; a sixth would be 210.
        assert_eq!((state.counts.dropped[1], state.waiting()), (2, (175, 5)));
        line.send(&mut state, 1);
        assert_eq!((state.under_way(), state.waiting()), (1, (140, 4)));
        line.queue(&mut state, 1, &[1; 24], 62, 0).unwrap();
        assert_eq!(state.waiting(), (202, 5));
    }

    #[test]
    fn more_packets_than_there_are_places_for_are_an_error_and_not_a_full_queue() {
        let line = Line { latency_ns: 10_000 * MS, bits_s: 1_000_000, ..line(1) };
        let mut state = LineState::new(PLACES_MIN);
        for number in 0..PLACES_MIN as u64 {
            line.queue(&mut state, 0, &[1], 12, number * MS).unwrap();
            line.send(&mut state, (number + 1) * MS);
        }
        assert_eq!((state.under_way(), state.waiting()), (PLACES_MIN as u32, (0, 0)));
        assert_eq!(line.queue(&mut state, 0, &[1], 12, 100 * MS), Err(NoPlace(PLACES_MIN)));
        assert_eq!(state.counts.dropped[0], 0);
    }

    #[test]
    fn the_higher_priority_goes_first_and_interrupts_nothing() {
        let line = Line { priorities: vec![0, 9, 0], ..line(1) };
        let mut state = LineState::new(PLACES_MIN);
        for (stream, at_ns) in [(0, 0), (0, 0), (1, MS), (2, MS)] {
            line.queue(&mut state, stream, &[7], 12, at_ns).unwrap();
        }
        let mut order = Vec::new();
        for ms in 1..=10 {
            line.send(&mut state, ms * MS);
            let before = state.counts.arrived;
            Line::arrive(&mut state, ms * MS);
            order.extend((0..3).filter(|&stream| state.counts.arrived[stream] > before[stream]));
        }
        assert_eq!(order, [0, 1, 0, 2]);
    }

    #[test]
    fn messages_keep_their_order_whatever_the_jitter() {
        let line = Line { bits_s: 1_000_000, jitter_ns: 50 * MS, ..line(3) };
        let (mut state, mut newest, mut delays) = (LineState::new(PLACES_MIN), 0, Vec::new());
        for ms in 0..250_u64 {
            let message = u8::try_from(ms).unwrap();
            line.queue(&mut state, 0, &[message], 12, ms * MS).unwrap();
            line.send(&mut state, (ms + 1) * MS);
            Line::arrive(&mut state, (ms + 1) * MS);
            assert!(state.newest[0][0] >= newest);
            newest = state.newest[0][0];
            delays.push(state.counts.delay_ns);
        }
        assert!(
            delays.iter().max().unwrap() > &(40 * MS) && delays[200..].iter().min().unwrap() < &(50 * MS)
        );
    }

    #[test]
    fn a_line_goes_on_from_its_state_byte_for_byte() {
        let make = || Line { jitter_ns: 20 * MS, loss: 0.3, ..line(5) };
        let (mut first, mut second) = (make(), make());
        let mut states = [LineState::new(PLACES_MIN), LineState::new(PLACES_MIN)];
        for ms in 0..2000_u64 {
            for (line, state) in [&mut first, &mut second].into_iter().zip(&mut states) {
                line.queue(state, (ms % 3) as usize, &ms.to_le_bytes(), 13 + (ms % 7) as u32, ms * MS)
                    .unwrap();
                line.send(state, (ms + 1) * MS);
                Line::arrive(state, (ms + 1) * MS);
            }
            if ms == 777 {
                second = make();
                let mut bytes = vec![1; states[0].size()];
                states[0].save(&mut bytes);
                states[1] = LineState::new(PLACES_MIN);
                states[1].load(&bytes).unwrap();
                assert!(LineState::new(PLACES_MIN + 1).load(&bytes).is_err());
            }
        }
        let [first, second] = states.map(|state| {
            let mut bytes = vec![1; state.size()];
            state.save(&mut bytes);
            bytes
        });
        assert!(first == second);
    }
}
