//! A data link: messages of any type, carried as a serial radio carries them.
//!
//! Each input is a *stream*: the messages of its topic come out on the output of the same name, later, less
//! often, and not all of them. The streams share one `line`. A message that comes out is the sender's own,
//! stamp included: a consumer recognises a new one, and its age, by its stamp. A message without a stamp is new
//! whenever its topic's publisher sends. Until the first has come, the output is the input's initial value with
//! a stamp of -1 s.
//!
//! A message that is sent at tick k is queued at the time of that tick. It is out at the first tick of the link at which
//! it has arrived. The link itself adds nothing to that: its inputs are a tick late because no message arrives in the tick
//! in which it is sent.

use crate::line::{Line, LineState, NoPlace, PLACES_MIN, STREAMS};
use component::announcement::Announcement;
use component::context::{NodeContext, SampleTimes, StepContext};
use component::messages::Time;
use component::ports::{
    FORWARDED_BYTES_MAX, ForwardedInputs, InputSamples, OutputPort, OutputPorts, OutputSamples, PortSpec,
};
use component::random::stream;
use component::schema::Extent;
use component::{BusError, Component, Info, Message, State, StateError, StepError, Transfer};
use diagnostics::parameter::{positive_up_to, refuse, require, within};
use diagnostics::{ParameterError, digits};
use std::collections::BTreeMap;

/// 57 600 baud, as the thesis sets the XBee modules of its Hummingbird (§2.2).
const BAUD: f64 = 57_600.0;
/// 8 data bits, a start bit and a stop bit, no parity (thesis §2.2).
const BITS_PER_BYTE: u32 = 10;
/// Overhead of AscTec's serial protocol for a message: `>*>`, two bytes of length, one of type, two of
/// checksum, `<#<`. Source: `ASCTEC_PACKET_OVERHEAD_BYTES` of the `asctec` driver for ROS by Kushleyev and
/// Michael, University of Pennsylvania.
const OVERHEAD_BYTES: u32 = 11;
/// Serial input buffer of an XBee of the 802.15.4 series (Digi, "XBee/XBee-PRO RF Modules 802.15.4 Product
/// Manual", "DI buffer").
const QUEUE_BYTES: u32 = 202;
/// Greatest rate of a serial line; the bits of a run also have to stay countable.
const BAUD_MAX: f64 = 1e9;

/// The most messages that may be under way: 1 s of four streams at 1 kHz.
const UNDER_WAY_MAX: f64 = 4096.0;

/// The most places of a link: those under way, and as many that wait.
const PLACES_MAX: f64 = 2.0 * UNDER_WAY_MAX;

/// The stamp of an initial value: nothing was sent yet. Before the run, so that another link does not take it for a
/// message.
const NEVER: Time = Time { sec: -1, nanosec: 0 };

/// Parameters of a link.
///
/// ```
/// let parameters = serde_json::json!({ "loss": 0.1, "streams": { "set_point": { "bytes": 24, "rate_hz": 50.0 } } });
/// let parameters: sensors::link::Parameters = diagnostics::read(&parameters)?;
/// assert_eq!(parameters.baud, 57_600.0);
/// # Ok::<(), diagnostics::ParameterError>(())
/// ```
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Bits a second on the wire (thesis §2.2).
    #[parameter(default = BAUD, unit = "bit/s", check = whole_baud)]
    pub baud: f64,
    /// Bits that a byte takes: 8, start, stop (thesis §2.2).
    #[parameter(default = BITS_PER_BYTE, check = within(8.0..=16.0, "from 8 to 16: 8 data bits, start, parity, stop"))]
    pub bits_per_byte: u32,
    /// Bytes that each message takes beside its own; by default AscTec's framing.
    #[parameter(default = OVERHEAD_BYTES, check = within(0.0..=1024.0, "at most 1024"))]
    pub overhead_bytes: u32,
    /// Bytes that may wait for the wire, the overhead included; by default an XBee's input buffer.
    #[parameter(default = QUEUE_BYTES, check = within(0.0..=1_048_576.0, "at most 1048576"))]
    pub queue_bytes: u32,
    /// Time from a message's last bit to its arrival.
    #[parameter(default = 0.0, check = within(0.0..=60_000.0, "0 to 60 000 ms"))]
    pub latency_ms: f64,
    /// Greatest addition to that, evenly drawn for each message.
    #[parameter(default = 0.0, check = within(0.0..=60_000.0, "0 to 60 000 ms"))]
    pub jitter_ms: f64,
    /// Fraction of the messages that are lost on the way, each independent of the others.
    #[parameter(default = 0.0, check = within(0.0..=1.0, "a fraction from 0 to 1"))]
    pub loss: f64,
    /// Parameters of single streams, by the name of their input.
    #[parameter(default = BTreeMap::new(), table = StreamParameters, entry = "INPUT")]
    pub streams: BTreeMap<String, StreamParameters>,
}

/// Parameters of a stream.
#[derive(Clone, Debug, Default, component::Parameters)]
pub struct StreamParameters {
    /// Bytes of a message on the wire, without the overhead.
    #[parameter(shown = "as many as a recording holds")]
    bytes: Option<u32>,
    /// Messages a second that are queued at most.
    #[parameter(shown = "every new one")]
    rate_hz: Option<f64>,
    /// Priority of the stream: of several that wait, the highest goes first.
    #[parameter(default = 0)]
    priority: u32,
}

/// Statistics of a link, from its first tick on; arrays by the names of the streams.
///
/// ```
/// let statistics = sensors::link::LinkStatistics::default();
/// assert_eq!((statistics.sent_bytes, statistics.arrived), (0, 0));
/// ```
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/LinkStatistics")]
pub struct LinkStatistics {
    /// Simulation time.
    pub stamp: Time,
    /// Whole bytes that the wire has carried.
    #[field(unit = "1")]
    pub sent_bytes: u64,
    /// Bytes that wait for the wire.
    #[field(unit = "1")]
    pub queued_bytes: u32,
    /// Messages that wait for the wire.
    #[field(unit = "1")]
    pub queued: u32,
    /// Time from queueing to arrival of the message that arrived last.
    #[field(unit = "s")]
    pub delay: f64,
    /// Messages that are on the wire or behind it.
    #[field(unit = "1")]
    pub under_way: u32,
    /// Messages that have arrived.
    #[field(unit = "1")]
    pub arrived: u32,
    /// Messages that were lost on the way; counted when they would have arrived.
    #[field(unit = "1")]
    pub lost: u32,
    /// Messages that were dropped because the queue was full.
    #[field(unit = "1")]
    pub dropped: u32,
    /// Messages that have arrived, by stream.
    #[field(unit = "1")]
    pub stream_arrived: [u32; STREAMS],
    /// Messages that were lost on the way, by stream.
    #[field(unit = "1")]
    pub stream_lost: [u32; STREAMS],
    /// Messages that were dropped because the queue was full, by stream.
    #[field(unit = "1")]
    pub stream_dropped: [u32; STREAMS],
}

/// Marks of the messages that a link took last from its inputs.
#[derive(Clone, Copy, Debug, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/LinkState")]
struct Marks {
    /// The mark of the message that was taken last from each input; all bits set before the first.
    #[field(unit = "1")]
    mark: [u64; STREAMS],
    /// The period of its rate in which it was taken; all bits set before the first.
    #[field(unit = "1")]
    period: [u64; STREAMS],
}

/// Outputs of a link: its statistics, and the newest message of each stream.
///
/// ```
/// use component::ports::OutputPorts;
/// // The other outputs are called like its inputs.
/// assert_eq!(sensors::link::Outputs::DECLARED[0].name, "statistics");
/// ```
#[derive(Debug)]
pub struct Outputs {
    statistics: LinkStatistics,
    sizes: [usize; STREAMS],
    streams: usize,
    newest: [[u8; FORWARDED_BYTES_MAX]; STREAMS],
}

impl OutputPorts for Outputs {
    const DECLARED: &'static [PortSpec] = &[PortSpec {
        name: "statistics",
        doc: "What the link has carried, lost and dropped.",
        schema: <LinkStatistics as Message>::SCHEMA,
        required: true,
    }];

    fn write(&self, samples: &mut OutputSamples<'_>) -> Result<(), BusError> {
        self.statistics.write(samples, 0)?;
        let messages = self.newest.iter().zip(self.sizes).take(self.streams).enumerate();
        for (stream, (message, size)) in messages {
            samples.write_bytes(1 + stream, &message[..size])?;
        }
        Ok(())
    }

    /// A link has nothing to go on from but its state.
    fn read(_: InputSamples<'_>) -> Option<Self> {
        None
    }
}

/// A stream of a link.
#[derive(Debug)]
struct LinkStream {
    parameters: StreamParameters,
}

/// Layout of the messages of a stream, known once the link is connected.
#[derive(Debug, Clone, Copy, Default)]
struct Forwarded {
    /// Number of bytes in memory.
    size: usize,
    /// Offset of the stamp.
    stamp_offset: Option<usize>,
    /// The part of a message that counts, and takes the wire's time.
    extent: Option<Extent>,
}

/// State of a link: its line, and marks of the messages that it took last. The layouts are not transferred: a successor learns
/// them when it connects.
#[derive(Debug)]
pub struct LinkMemory {
    line: LineState,
    taken: Marks,
    forwarded: [Forwarded; STREAMS],
}

impl State for LinkMemory {
    const TRANSFER: Transfer = Transfer::Bytes(<Marks as Message>::SCHEMA.type_name);

    fn configuration(&self) -> u64 {
        LineState::configuration()
    }

    fn size(&self) -> usize {
        size_of::<Marks>() + self.line.size()
    }

    fn save(&self, bytes: &mut [u8]) {
        let (taken, line) = bytes.split_at_mut(size_of::<Marks>());
        taken.copy_from_slice(bytemuck::bytes_of(&self.taken));
        self.line.save(line);
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        StateError::check_size(<Marks as Message>::SCHEMA.type_name, self.size(), bytes)?;
        let (taken, line) = bytes.split_at(size_of::<Marks>());
        self.taken = bytemuck::pod_read_unaligned(taken);
        self.line.load(line)
    }
}

/// A data link.
///
/// ```
/// use component::Component;
/// use component::context::{InputMessage, NodeContext};
/// use sensors::link::Link;
/// # use serde_json::json;
/// let messages = [InputMessage { port: "estimate", bytes: 96, period_ticks: 1.0, initial: None }];
/// let context = NodeContext::new("down", &["estimate"]).reading(&messages);
/// Link::new(diagnostics::read(&json!({ "streams": { "estimate": { "rate_hz": 25.0 } } }))?, &context)?;
/// // 107 bytes a millisecond are more than 57 600 baud carry.
/// Link::new(diagnostics::read(&json!({}))?, &context)?;
/// let warnings = context.into_warnings();
/// assert_eq!(warnings.len(), 1);
/// assert!(warnings[0].message.contains("messages will wait and be dropped"));
/// # Ok::<(), diagnostics::ParameterError>(())
/// ```
#[derive(Debug)]
pub struct Link {
    line: Line,
    overhead_bytes: u32,
    tick_ns: u64,
    /// Places for packets.
    places: usize,
    /// By the names of the inputs.
    streams: Vec<LinkStream>,
}

impl Component for Link {
    const INFO: Info =
        Info::new("link", "carries topics as a serial radio does: by its rate, late, with losses");
    type Parameters = Parameters;
    type Inputs<'a> = ForwardedInputs<'a>;
    type Outputs = Outputs;
    type State = LinkMemory;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let period = refuse(context.period_ticks != 1, "", || {
            let ticks = context.period_ticks;
            format!(
                "it computes every {ticks} ticks, and would miss messages between: leave `period_ticks` out"
            )
        });
        let mut names = context.inputs.to_vec();
        names.sort_unstable();
        let (count, most) = (names.len(), STREAMS);
        let inputs = refuse(count > most, "", || format!("it has {count} inputs, expected at most {most}"))
            .map_err(|error| error.advised("let a second link carry the others"));
        let unknown = parameters.streams.keys().filter(|name| !names.contains(&name.as_str()));
        let unknown = unknown.map(|name| {
            Err::<(), _>(ParameterError::unknown(format!("streams.{name}"), names.iter().copied()))
        });
        let checked = ParameterError::gather([period, inputs].into_iter().chain(unknown));
        let streams = names.iter().map(|name| LinkStream::new(name, &parameters, context));
        let (_, streams) = ParameterError::both(checked, ParameterError::gather(streams))?;
        parameters.check_load(context)?;
        let delay_s = parameters.latency_ms * 1e-3;
        context.state_times(SampleTimes { delay_s, ..SampleTimes::default() });
        let places = parameters.places(context);
        let line =
            parameters.line(context, streams.iter().map(|stream| stream.parameters.priority).collect());
        let (overhead_bytes, tick_ns) = (parameters.overhead_bytes, context.tick_ns);
        Ok(Self { line, overhead_bytes, tick_ns, places, streams })
    }

    fn initial(&self) -> LinkMemory {
        let taken = Marks { mark: [u64::MAX; STREAMS], period: [u64::MAX; STREAMS] };
        LinkMemory { line: LineState::new(self.places), taken, forwarded: [Forwarded::default(); STREAMS] }
    }

    fn connected(&self, topics: &[(&str, &Announcement)], memory: &mut LinkMemory) -> Result<(), StepError> {
        for (forwarded, (_, announcement)) in memory.forwarded.iter_mut().zip(topics) {
            let Announcement { size, stamp_offset, extent, .. } = **announcement;
            *forwarded = Forwarded { size, stamp_offset, extent };
        }
        Ok(())
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: ForwardedInputs<'_>,
        LinkMemory { line, taken, forwarded }: &mut LinkMemory,
    ) -> Result<Outputs, StepError> {
        let now_ns = context.time_ns();
        let forwarded = &forwarded[..self.streams.len()];
        if context.tick() == 0 {
            // What the inputs hold is no message yet.
            for (index, (layout, newest)) in forwarded.iter().zip(&mut line.newest).enumerate() {
                newest[..layout.size].copy_from_slice(&inputs.newest(index)[..layout.size]);
                layout.mark_as_none(newest);
            }
        } else {
            let sent_ns = now_ns - self.tick_ns;
            self.line.send(line, sent_ns);
            self.take(inputs, line, taken, forwarded, sent_ns)?;
        }
        self.line.send(line, now_ns);
        Line::arrive(line, now_ns);
        Ok(self.outputs(line, forwarded, now_ns))
    }
}

impl Link {
    /// Queues the messages that are new and due.
    fn take(
        &self,
        inputs: ForwardedInputs<'_>,
        line: &mut LineState,
        taken: &mut Marks,
        forwarded: &[Forwarded],
        sent_ns: u64,
    ) -> Result<(), NoPlace> {
        for (index, (stream, layout)) in self.streams.iter().zip(forwarded).enumerate() {
            let message = &inputs.newest(index)[..layout.size];
            let mark = layout.stamp(message).or_else(|| inputs.sent_tick(index));
            let period = stream.period(sent_ns);
            let is_new = !layout.is_none(message) && mark.is_none_or(|mark| mark != taken.mark[index]);
            let is_due = period.is_none_or(|period| period != taken.period[index]);
            if is_new && is_due {
                taken.mark[index] = mark.unwrap_or(u64::MAX);
                taken.period[index] = period.unwrap_or(u64::MAX);
                let wire_bytes = stream.wire_bytes(layout.used_bytes(message), self.overhead_bytes);
                self.line.queue(line, index, message, wire_bytes, sent_ns)?;
            }
        }
        Ok(())
    }

    fn outputs(&self, line: &LineState, forwarded: &[Forwarded], now_ns: u64) -> Outputs {
        let counts = &line.counts;
        let (queued_bytes, queued) = line.waiting();
        let statistics = LinkStatistics {
            sent_bytes: self.line.sent_bytes(line, now_ns),
            queued_bytes,
            queued,
            under_way: line.under_way(),
            delay: counts.delay_ns as f64 * 1e-9,
            arrived: counts.arrived.iter().sum(),
            lost: counts.lost.iter().sum(),
            dropped: counts.dropped.iter().sum(),
            stream_arrived: counts.arrived,
            stream_lost: counts.lost,
            stream_dropped: counts.dropped,
            ..LinkStatistics::default()
        };
        let mut sizes = [0; STREAMS];
        sizes.iter_mut().zip(forwarded).for_each(|(size, layout)| *size = layout.size);
        Outputs { statistics, sizes, streams: self.streams.len(), newest: line.newest }
    }
}

impl LinkStream {
    fn new(name: &str, parameters: &Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let parameters = parameters.streams.get(name).cloned().unwrap_or_default();
        let key = |of: &str| format!("streams.{name}.{of}");
        let bytes = parameters.bytes.map_or(Ok(()), |bytes| {
            require(&key("bytes"), bytes, (1..=65_535).contains(&bytes), "from 1 to 65535")
        });
        let rate = parameters.rate_hz.map_or(Ok(()), |rate_hz| {
            let most = context.period_s().recip();
            positive_up_to(&key("rate_hz"), rate_hz, most, "Hz, the rate of the link's own steps")
        });
        ParameterError::both(bytes, rate).map(|_| Self { parameters })
    }

    /// Bytes of a message on the wire.
    #[allow(clippy::cast_possible_truncation, reason = "a message is far shorter than 4 GiB")]
    fn wire_bytes(&self, size: usize, overhead_bytes: u32) -> u32 {
        self.parameters.bytes.unwrap_or(size as u32) + overhead_bytes
    }

    /// The period of the stream's rate in which `time_ns` is, if it has a rate.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of messages")]
    fn period(&self, time_ns: u64) -> Option<u64> {
        // A time that is a period's start is in it, however its product was rounded.
        self.parameters.rate_hz.map(|rate_hz| (time_ns as f64 * rate_hz * 1e-9 + 1e-9) as u64)
    }
}

impl Forwarded {
    /// Bytes of `message` that count.
    fn used_bytes(&self, message: &[u8]) -> usize {
        self.extent.map_or(message.len(), |extent| extent.of(message).len())
    }

    /// Gives `message`, an initial value, the stamp of a message that was never sent.
    fn mark_as_none(&self, message: &mut [u8]) {
        if let Some(offset) = self.stamp_offset {
            message[offset..offset + size_of::<Time>()].copy_from_slice(bytemuck::bytes_of(&NEVER));
        }
    }

    /// True if `message` is an initial value that another link repeats.
    fn is_none(&self, message: &[u8]) -> bool {
        self.stamp_offset.is_some_and(|offset| message[offset..].starts_with(bytemuck::bytes_of(&NEVER)))
    }

    /// The stamp of `message`, as one number.
    fn stamp(&self, message: &[u8]) -> Option<u64> {
        let offset = self.stamp_offset?;
        message[offset..offset + size_of::<Time>()].try_into().ok().map(u64::from_le_bytes)
    }
}

/// Passes a whole number of bits a second.
fn whole_baud(key: &str, baud: f64) -> Result<(), ParameterError> {
    let is_good = baud.fract() == 0.0 && (1.0..=BAUD_MAX).contains(&baud);
    require(key, baud, is_good, format!("a whole number from 1 to {BAUD_MAX}"))
}

impl Parameters {
    /// Refuses a stream whose messages never fit into the queue, and more messages under way than a link may hold; warns of streams
    /// that together exceed the line.
    fn check_load(&self, context: &NodeContext<'_>) -> Result<(), ParameterError> {
        let (mut offered_bytes_s, mut offered_hz) = (0.0, 0.0);
        for message in context.messages {
            let stream = self.streams.get(message.port);
            let message_bytes =
                stream.and_then(|stream| stream.bytes).map_or(message.bytes, |bytes| bytes as usize);
            let bytes = message_bytes + self.overhead_bytes as usize;
            refuse(bytes > self.queue_bytes as usize, "queue_bytes", || {
                let (port, queue) = (message.port, self.queue_bytes);
                format!(
                    "`queue_bytes` is {queue}, and a message of `{port}` takes {bytes} bytes: it would never be sent"
                )
            })?;
            let sent_hz =
                (message.period_ticks.max(f64::from(context.period_ticks)) * context.tick_s()).recip();
            let rate_hz =
                stream.and_then(|stream| stream.rate_hz).map_or(sent_hz, |rate_hz| rate_hz.min(sent_hz));
            offered_bytes_s += rate_hz * bytes as f64;
            offered_hz += rate_hz;
        }
        let carried_bytes_s = self.baud / f64::from(self.bits_per_byte);
        // Messages keep their order: where they are dense, each waits for the latest before it.
        let sent_hz = offered_hz * (carried_bytes_s / offered_bytes_s).min(1.0);
        let under_way = sent_hz * (self.latency_ms + self.jitter_ms) * 1e-3;
        refuse(under_way > UNDER_WAY_MAX, "latency_ms", || {
            format!(
                "`latency_ms` and `jitter_ms` are {} ms together, expected at most {:.0} ms: {sent_hz:.0} messages are sent each \
                 second, and {UNDER_WAY_MAX} may be under way; shorten the latency, or send less often (`rate_hz`)",
                digits(self.latency_ms + self.jitter_ms),
                (UNDER_WAY_MAX / sent_hz * 1e3).floor()
            )
        })?;
        if offered_bytes_s > carried_bytes_s * (1.0 + 1e-9) {
            context.warn("baud", format!(
                "its streams offer {offered_bytes_s:.0} bytes/s, overhead included, and {} baud carry {carried_bytes_s:.0}: \
                 messages will wait and be dropped",
                self.baud
            ));
        }
        Ok(())
    }

    /// Places for the packets that wait or are under way, whatever the messages of the topics are: a stream without a rate sends at
    /// each tick, and a message without a stated length has one byte beside the overhead.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most `PLACES_MAX`")]
    fn places(&self, context: &NodeContext<'_>) -> usize {
        let stream = |port: &&str| self.streams.get(*port);
        let rate_hz =
            |port| stream(port).and_then(|stream| stream.rate_hz).unwrap_or(context.period_s().recip());
        let bytes =
            |port: &&str| stream(port).and_then(|stream| stream.bytes).unwrap_or(1) + self.overhead_bytes;
        let shortest = context.inputs.iter().map(bytes).min().unwrap_or(1);
        let carried_hz = self.baud / f64::from(self.bits_per_byte) / f64::from(shortest);
        let sent_hz = context.inputs.iter().map(rate_hz).sum::<f64>().min(carried_hz);
        let under_way = sent_hz * (self.latency_ms + self.jitter_ms) * 1e-3;
        let waiting = f64::from(self.queue_bytes / shortest);
        // Messages of all streams may be sent in one tick.
        let places = under_way.ceil() + waiting + 2.0 * context.inputs.len() as f64;
        places.clamp(PLACES_MIN as f64, PLACES_MAX) as usize
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "validated before")]
    fn line(&self, context: &NodeContext<'_>, priorities: Vec<u32>) -> Line {
        let ns = |ms: f64| (ms * 1e6).round() as u64;
        Line {
            bits_s: self.baud as u64,
            bits_per_byte: u64::from(self.bits_per_byte),
            queue_bytes: self.queue_bytes,
            latency_ns: ns(self.latency_ms),
            jitter_ns: ns(self.jitter_ms),
            loss: self.loss,
            priorities,
            random: stream(context.seed, context.name),
        }
    }
}
