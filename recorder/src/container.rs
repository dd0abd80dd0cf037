//! The records of an MCAP file (its specification, "Records"), each held against the bytes that there are.
//!
//! mcap 0.26 takes memory for a length that a file states before it sees that the file is shorter, and computes with
//! such lengths unchecked. So it gets a record only if every length in the record fits into it. A chunk is unpacked
//! as far as its bytes go, for any length in its header. The unpacked and declared sizes of a file are bounded by its
//! own length: a few bytes can be compressed from gigabytes.

pub(crate) mod blocks;
pub(crate) mod summary;

use crate::source::Source;
use mcap::read::ChannelAccumulator;
use mcap::records::{self, ChunkHeader, MessageHeader, Record, SchemaHeader, op};
use mcap::{Channel, MAGIC, Message, parse_record};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::ops::Range;
use std::sync::Arc;

/// Larger chunks are refused: writers close theirs at some megabytes.
const CHUNK_BYTES_MAX: u64 = 1 << 28;
/// Longer records are refused: no chunk, message or attachment of a flight comes near.
const RECORD_BYTES_MAX: u64 = 1 << 30;
/// Bytes that the chunks of a file may unpack to: so many, and so many for each byte of the file. Messages that differ in
/// nothing but their stamps are packed thirtyfold, zeros ten thousandfold.
const UNPACKED_BYTES: u64 = 16 << 20;
const UNPACKED_RATIO: u64 = 1024;
/// Bytes of the schemas and channels that a file may declare, the schema counted for each of its channels: so many, and so
/// many for each byte of the file.
const DECLARED_BYTES: u64 = 4 << 20;
const DECLARED_RATIO: u64 = 4;
/// Longer names of topics and types are refused: they stand beside every value that is read.
const NAME_BYTES_MAX: usize = 4096;
/// Compressors look back over 8 MiB up to their level 19, even for shorter input.
const WINDOW_LOG: u32 = 23;
/// Opcode and length, in front of every record.
const HEAD_BYTES: usize = 1 + 8;
/// The footer with its head, at the end of every file in front of the magic bytes.
const FOOTER_BYTES: usize = HEAD_BYTES + 8 + 8 + 4;

/// Fault in the bytes of an MCAP file, with its place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {reason}")]
pub struct Damage {
    place: String,
    reason: String,
    /// True if the file itself may be sound: it cannot be read there, or is beyond a limit of this reader.
    pub(crate) is_refused: bool,
}

/// Some bytes of a file, with the word for their places.
struct Bytes<'a> {
    source: Source<'a>,
    /// Owner of the bytes, such as ` of the chunk at byte 77`; empty for the file itself.
    of: &'a str,
}

/// A record whose lengths fit into it.
struct Raw<'a> {
    opcode: u8,
    body: Cow<'a, [u8]>,
    /// The byte behind it.
    end: usize,
}

impl<'a> Bytes<'a> {
    fn damage(&self, at: usize, reason: impl ToString) -> Damage {
        let place = format!("byte {at}{}", self.of);
        Damage { place, reason: reason.to_string(), is_refused: false }
    }

    fn refused(&self, at: usize, reason: impl ToString) -> Damage {
        Damage { is_refused: true, ..self.damage(at, reason) }
    }

    /// The damage of the record at `at`, which the text calls `what`.
    fn fault(&self, at: usize, what: &str, fault: &Fault) -> Damage {
        let refuse = if fault.is_limit() { Self::refused } else { Self::damage };
        refuse(self, at, format!("{what}{fault}"))
    }

    /// The record that begins at `at`.
    fn record(&self, at: usize) -> Result<Raw<'a>, Damage> {
        let head = self.read(at, HEAD_BYTES)?;
        let Some((&[opcode, ref length @ ..], [])) = head.split_first_chunk::<HEAD_BYTES>() else {
            let reason = format!("a record begins, and {} bytes are left of its head of 9", head.len());
            return Err(self.damage(at, reason));
        };
        let length = u64::from_le_bytes(*length);
        let ((kind, parts), left) = (kind(opcode), self.source.len() - at - HEAD_BYTES);
        let refused = |reason: String| Err(self.damage(at, format!("a record ({kind}) {reason}")));
        let length = match usize::try_from(length) {
            Ok(length) if length <= left => length,
            _ => return refused(format!("says that it is {length} bytes long, {left} are left")),
        };
        if length as u64 > RECORD_BYTES_MAX {
            let reason =
                format!("a record ({kind}) is {length} bytes long, expected at most {RECORD_BYTES_MAX}");
            return Err(self.refused(at, reason));
        }
        let body = self.read(at + HEAD_BYTES, length)?;
        check(parts, &body).map_err(|fault| self.damage(at, format!("a record ({kind}) {fault}")))?;
        Ok(Raw { opcode, body, end: at + HEAD_BYTES + length })
    }

    fn read(&self, at: usize, length: usize) -> Result<Cow<'a, [u8]>, Damage> {
        self.source.read(at, length).map_err(|error| self.refused(at, error))
    }

    fn parsed<'b>(&self, at: usize, raw: &'b Raw<'_>) -> Result<Record<'b>, Damage> {
        parse_record(raw.opcode, &raw.body)
            .map_err(|error| self.damage(at, format!("a record ({}): {error}", kind(raw.opcode).0)))
    }
}

/// A part of a record's body.
enum Part {
    /// A fixed number of bytes.
    Fixed(u64),
    /// A length in 32 bits and as many bytes: a text or a table of numbers.
    Long32,
    /// A length in 64 bits and as many bytes.
    Long64,
    /// A length in 32 bits and as many bytes of texts, each with its own.
    Texts,
}

/// Name of a record, and the layout of its body. Any bytes may follow behind that, and in records of other kinds.
fn kind(opcode: u8) -> (&'static str, &'static [Part]) {
    use Part::{Fixed, Long32, Long64, Texts};
    match opcode {
        op::HEADER => ("header", &[Long32, Long32]),
        op::FOOTER => ("footer", &[]),
        op::SCHEMA => ("schema", &[Fixed(2), Long32, Long32, Long32]),
        op::CHANNEL => ("channel", &[Fixed(4), Long32, Long32, Texts]),
        op::MESSAGE => ("message", &[]),
        op::CHUNK => ("chunk", &[Fixed(28), Long32, Long64]),
        op::MESSAGE_INDEX => ("message index", &[Fixed(2), Long32]),
        op::CHUNK_INDEX => ("chunk index", &[Fixed(32), Long32, Fixed(8), Long32, Fixed(16)]),
        op::ATTACHMENT => ("attachment", &[Fixed(16), Long32, Long32, Long64, Fixed(4)]),
        op::ATTACHMENT_INDEX => ("attachment index", &[Fixed(40), Long32, Long32]),
        op::STATISTICS => ("statistics", &[Fixed(42), Long32]),
        op::METADATA => ("metadata", &[Long32, Texts]),
        op::METADATA_INDEX => ("metadata index", &[Fixed(16), Long32]),
        op::SUMMARY_OFFSET => ("summary offset", &[]),
        op::DATA_END => ("end of data", &[]),
        _ => ("of a kind that is not known", &[]),
    }
}

/// Fault of a record or a chunk, whose name stands before it.
#[derive(Debug, thiserror::Error)]
enum Fault {
    #[error("says that {length} bytes follow, {left} are left in it")]
    Length { length: u64, left: usize },
    #[error("says that it unpacks to {0} bytes, expected at most {CHUNK_BYTES_MAX}")]
    Large(u64),
    #[error(
        "says that it unpacks to {stated} bytes; all chunks of this file may unpack to {limit}, {UNPACKED_RATIO} for each of \
         its bytes and {UNPACKED_BYTES} more: it was made to fill the memory, or convert it without compression"
    )]
    Bomb { stated: u64, limit: u64 },
    #[error(
        "the schemas and channels of this file take more than {limit} bytes, {DECLARED_RATIO} for each of its bytes and \
         {DECLARED_BYTES} more: it was made to fill the memory"
    )]
    Declared { limit: u64 },
    #[error("the name of a {what} is {length} bytes long, expected at most {NAME_BYTES_MAX}")]
    Name { what: &'static str, length: usize },
    #[error("{0}")]
    Contradiction(#[from] mcap::McapError),
    #[error("is compressed by `{0}`, expected zstd, lz4 or nothing; convert the file")]
    Compression(String),
    #[error("has the checksum {stored:08x}, its content {found:08x}")]
    Checksum { stored: u32, found: u32 },
    #[error("cannot be decompressed: {0}")]
    Decompression(#[from] std::io::Error),
    #[error("says that it unpacks to {stated} bytes, and unpacks to {found}")]
    Size { stated: u64, found: usize },
}

impl Fault {
    /// True if it is a limit of this reader.
    fn is_limit(&self) -> bool {
        matches!(self, Self::Large(_) | Self::Bomb { .. } | Self::Declared { .. } | Self::Name { .. })
    }
}

/// Refuses a record with a length in it that goes beyond it.
fn check(parts: &[Part], mut body: &[u8]) -> Result<(), Fault> {
    for part in parts {
        let mut texts = match part {
            Part::Fixed(length) => take(&mut body, *length)?,
            Part::Long32 | Part::Texts => long32(&mut body)?,
            Part::Long64 => number(&mut body, 8).and_then(|length| take(&mut body, length))?,
        };
        while matches!(part, Part::Texts) && !texts.is_empty() {
            long32(&mut texts)?;
        }
    }
    Ok(())
}

fn take<'a>(rest: &mut &'a [u8], length: u64) -> Result<&'a [u8], Fault> {
    let taken = usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length));
    let (taken, behind) = taken.ok_or(Fault::Length { length, left: rest.len() })?;
    *rest = behind;
    Ok(taken)
}

/// The number in the next `size` bytes, at most eight.
fn number(rest: &mut &[u8], size: u64) -> Result<u64, Fault> {
    let bytes = take(rest, size)?;
    Ok(bytes.iter().rev().fold(0, |number, byte| (number << 8) | u64::from(*byte)))
}

fn long32<'a>(rest: &mut &'a [u8]) -> Result<&'a [u8], Fault> {
    let length = number(rest, 4)?;
    take(rest, length)
}

/// The messages of an MCAP file of any writer. A damaged chunk is an error in front of any of its messages; no
/// message follows an error. The memory taken is that of the largest chunk, or message outside of chunks, as far as it was written.
///
/// ```
/// let mut messages = recorder::reader::Messages::new(b"PK\x03\x04, as archives begin");
/// let damage = messages.next().unwrap().unwrap_err();
/// assert!(damage.to_string().starts_with("byte 0: expected the magic bytes of MCAP"));
/// assert!(messages.next().is_none());
/// ```
pub struct Messages<'a> {
    source: Source<'a>,
    at: usize,
    /// The byte in front of which reading stops; `None` if it goes on to the footer.
    end: Option<usize>,
    chunk: Option<Chunk>,
    /// The memory of the chunk before, which the next one is unpacked into.
    spare: Vec<u8>,
    /// The last message that stood outside of chunks.
    loose: Vec<u8>,
    /// Bytes that further chunks may unpack to.
    unpacked_left: u64,
    channels: Declared,
    is_behind_data: bool,
    is_done: bool,
}

/// A message, and the place of its data: in the chunk that is being read, or else in the last message outside of chunks.
struct Placed {
    channel: Arc<Channel<'static>>,
    header: MessageHeader,
    data: Range<usize>,
}

impl Placed {
    /// The same, where the record's body begins at `body`.
    fn behind(self, body: usize) -> Self {
        Self { data: body + self.data.start..body + self.data.end, ..self }
    }
}

/// A message, whose data stand where they were unpacked.
pub(crate) struct InPlace<'a> {
    pub(crate) channel: Arc<Channel<'static>>,
    pub(crate) header: MessageHeader,
    pub(crate) data: &'a [u8],
}

/// A chunk that is being read.
struct Chunk {
    content: Vec<u8>,
    at: usize,
    /// Its place, for errors.
    of: String,
}

impl<'a> Messages<'a> {
    /// The messages of a file with these bytes.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Self::of(Source::Memory(bytes))
    }

    pub(crate) fn of(source: Source<'a>) -> Self {
        Self {
            source,
            at: 0,
            end: None,
            chunk: None,
            spare: Vec::new(),
            loose: Vec::new(),
            unpacked_left: limit(&source, UNPACKED_BYTES, UNPACKED_RATIO),
            channels: Declared::of(&source),
            is_behind_data: false,
            is_done: false,
        }
    }

    /// The next message, if the next record is one.
    fn step(&mut self) -> Result<Option<Placed>, Damage> {
        if let Some(chunk) = &mut self.chunk {
            if chunk.at < chunk.content.len() {
                let bytes = Bytes { source: Source::Memory(&chunk.content), of: &chunk.of };
                let (at, raw) = (chunk.at, bytes.record(chunk.at)?);
                chunk.at = raw.end;
                let body = raw.end - raw.body.len();
                let placed = linked(&mut self.channels, &bytes, at, &raw)?;
                return Ok(placed.map(|placed| placed.behind(body)));
            }
            self.spare = self.chunk.take().map_or_else(Vec::new, |chunk| chunk.content);
        }
        let (file, at) = (Bytes { source: self.source, of: "" }, self.at);
        if self.end.is_some_and(|end| at >= end) {
            self.is_done = true;
            return Ok(None);
        }
        if at == 0 {
            self.at = magic(&file, 0)?;
            return Ok(None);
        }
        let raw = file.record(at)?;
        self.at = raw.end;
        match raw.opcode {
            op::FOOTER => self.is_done = magic(&file, raw.end).map(|_| true)?,
            op::DATA_END => self.is_behind_data = true,
            op::CHUNK if !self.is_behind_data => {
                if let Record::Chunk { header, data } = file.parsed(at, &raw)? {
                    let refused = |fault: Fault| file.fault(at, "a chunk ", &fault);
                    let stated = header.uncompressed_size;
                    let left = self.unpacked_left.checked_sub(stated).filter(|_| stated <= CHUNK_BYTES_MAX);
                    let limit = limit(&self.source, UNPACKED_BYTES, UNPACKED_RATIO);
                    self.unpacked_left = left.ok_or_else(|| {
                        refused(match stated {
                            ..=CHUNK_BYTES_MAX => Fault::Bomb { stated, limit },
                            _ => Fault::Large(stated),
                        })
                    })?;
                    let mut content = std::mem::take(&mut self.spare);
                    unpack(&header, &data, &mut content).map_err(refused)?;
                    self.chunk = Some(Chunk { content, at: 0, of: format!(" of the chunk at byte {at}") });
                }
            }
            _ if !self.is_behind_data => {
                let placed = linked(&mut self.channels, &file, at, &raw)?;
                if placed.is_some() {
                    self.loose.clear();
                    self.loose.extend_from_slice(&raw.body);
                }
                return Ok(placed);
            }
            // The summary repeats schemas and channels, and need not be held against them.
            _ => file.parsed(at, &raw).map(|_| ())?,
        }
        Ok(None)
    }
}

impl Messages<'_> {
    /// The next message, without a copy.
    pub(crate) fn next_in_place(&mut self) -> Option<Result<InPlace<'_>, Damage>> {
        while !self.is_done {
            let step = self.step();
            self.is_done |= step.is_err();
            if let Some(next) = step.transpose() {
                let all = self.chunk.as_ref().map_or(&self.loose, |chunk| &chunk.content);
                return Some(next.map(|Placed { channel, header, data }| InPlace {
                    channel,
                    header,
                    data: &all[data],
                }));
            }
        }
        None
    }
}

impl Iterator for Messages<'_> {
    type Item = Result<Message<'static>, Damage>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = self.next_in_place()?;
        Some(next.map(|InPlace { channel, header, data }| Message {
            channel,
            sequence: header.sequence,
            log_time: header.log_time,
            publish_time: header.publish_time,
            data: Cow::Owned(data.to_owned()),
        }))
    }
}

/// A message with its channel, its data placed in the record's body; schemas and channels are kept for those that follow.
fn linked(
    channels: &mut Declared,
    bytes: &Bytes<'_>,
    at: usize,
    raw: &Raw<'_>,
) -> Result<Option<Placed>, Damage> {
    match bytes.parsed(at, raw)? {
        Record::Schema { header, data } => channels.add_schema(header, data.into_owned()),
        Record::Channel(channel) => channels.add_channel(channel, raw.body.len()),
        Record::Message { header, data } => {
            let id = header.channel_id;
            let unknown =
                || bytes.damage(at, format!("a message of the channel {id}, which no record declares"));
            let channel = channels.all.get(id).ok_or_else(unknown)?;
            let end = raw.body.len();
            return Ok(Some(Placed { channel, header, data: end - data.len()..end }));
        }
        _ => Ok(()),
    }
    .map_err(|fault| bytes.fault(at, "", &fault))?;
    Ok(None)
}

/// The sum of `bytes`, and of `ratio` for each byte of the file.
fn limit(source: &Source<'_>, bytes: u64, ratio: u64) -> u64 {
    bytes.saturating_add(ratio.saturating_mul(source.len() as u64))
}

/// The schemas and channels of a file, within its limit.
struct Declared {
    all: ChannelAccumulator<'static>,
    schemas: BTreeSet<u16>,
    left: u64,
    limit: u64,
}

impl Declared {
    fn of(source: &Source<'_>) -> Self {
        let limit = limit(source, DECLARED_BYTES, DECLARED_RATIO);
        Self { all: ChannelAccumulator::default(), schemas: BTreeSet::new(), left: limit, limit }
    }

    fn add_schema(&mut self, header: SchemaHeader, data: Vec<u8>) -> Result<(), Fault> {
        require_name("type", &header.name)?;
        if self.schemas.insert(header.id) {
            self.take(data.len())?;
        }
        Ok(self.all.add_schema(header, Cow::Owned(data))?)
    }

    /// Adds a channel whose record is `length` bytes long.
    fn add_channel(&mut self, channel: records::Channel, length: usize) -> Result<(), Fault> {
        require_name("topic", &channel.topic)?;
        let (id, is_new) = (channel.id, self.all.get(channel.id).is_none());
        self.all.add_channel(channel)?;
        let schema = self.all.get(id).and_then(|channel| channel.schema.clone()).filter(|_| is_new);
        self.take(if is_new { length } else { 0 } + schema.map_or(0, |schema| schema.data.len()))
    }

    fn take(&mut self, bytes: usize) -> Result<(), Fault> {
        let left = self.left.checked_sub(bytes as u64);
        self.left = left.ok_or(Fault::Declared { limit: self.limit })?;
        Ok(())
    }
}

fn require_name(what: &'static str, name: &str) -> Result<(), Fault> {
    if name.len() <= NAME_BYTES_MAX {
        return Ok(());
    }
    Err(Fault::Name { what, length: name.len() })
}

/// The byte behind the magic bytes at `at`.
fn magic(file: &Bytes<'_>, at: usize) -> Result<usize, Damage> {
    let found = file.read(at, MAGIC.len())?;
    if *found == *MAGIC {
        return Ok(at + MAGIC.len());
    }
    let what = if MAGIC.starts_with(&found) { "the file ends in front of" } else { "expected" };
    Err(file.damage(at, format!("{what} the magic bytes of MCAP, 89 4d 43 41 50 30 0d 0a")))
}

/// Puts the records of a chunk into `content`, instead of what is in it.
fn unpack(header: &ChunkHeader, data: &[u8], content: &mut Vec<u8>) -> Result<(), Fault> {
    let size = header.uncompressed_size;
    content.clear();
    match header.compression.as_str() {
        "" => content.extend_from_slice(data),
        "zstd" => read_all(zstd_decoder(data, size)?, size, content)?,
        "lz4" => read_all(lz4_flex::frame::FrameDecoder::new(data), size, content)?,
        other => return Err(Fault::Compression(other.to_owned())),
    }
    let (stored, found) = (header.uncompressed_crc, crc32fast::hash(content));
    if stored != 0 && stored != found {
        return Err(Fault::Checksum { stored, found });
    }
    Ok(())
}

/// The decoder of a chunk of `size` bytes.
fn zstd_decoder(data: &[u8], size: u64) -> Result<impl Read, Fault> {
    let mut decoder = zstd::Decoder::with_buffer(data)?;
    // A frame states how far it looks back, and the decoder takes as much: no further than the chunk is long.
    decoder.window_log_max(size.checked_ilog2().unwrap_or(0).saturating_add(1).max(WINDOW_LOG))?;
    Ok(decoder)
}

/// Puts the content of a chunk, which is `size` bytes, into `content`; the memory grows with the bytes found.
fn read_all(decoder: impl Read, size: u64, content: &mut Vec<u8>) -> Result<(), Fault> {
    // One byte more shows that there is more.
    let read = decoder.take(size.saturating_add(1)).read_to_end(content)?;
    if read as u64 == size {
        return Ok(());
    }
    Err(Fault::Size { stated: size, found: read })
}

/// Channels by their number, each with the number of its messages.
pub(crate) type Channels = BTreeMap<u16, (Arc<Channel<'static>>, u64)>;
