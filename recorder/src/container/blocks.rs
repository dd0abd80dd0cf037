//! Blocks: stretches of a file that are read alone, each with the times of its messages.

use super::{Bytes, Channels, Damage, Declared, Messages, Record, UNPACKED_BYTES, UNPACKED_RATIO, limit};
use crate::source::Source;
use mcap::MAGIC;
use mcap::read::ChannelAccumulator;
use mcap::records::{ChunkIndex, op};

/// Bytes of messages outside of chunks that make a block: as many as a chunk of ours.
const LOOSE_BYTES: usize = 1 << 20;

/// A chunk, or messages that follow each other outside of chunks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Its first byte.
    pub at: usize,
    /// The byte behind it.
    pub end: usize,
    /// Times of its first and its last message, in ns.
    pub span_ns: [u64; 2],
    /// Numbers of the channels of its messages, growing; `None` where the file does not list them.
    pub channels: Option<Vec<u16>>,
}

impl Block {
    /// The chunk that a summary lists.
    pub fn listed(index: &ChunkIndex) -> Self {
        let byte = |at: u64| usize::try_from(at).unwrap_or(usize::MAX);
        let channels: Vec<u16> = index.message_index_offsets.keys().copied().collect();
        Self {
            at: byte(index.chunk_start_offset),
            end: byte(index.chunk_start_offset.saturating_add(index.chunk_length)),
            span_ns: [index.message_start_time, index.message_end_time],
            // Writers may leave the message indexes out.
            channels: Some(channels).filter(|channels| !channels.is_empty()),
        }
    }

    /// A block of the message at `at`, stamped `time_ns`, that stands outside of a chunk.
    fn loose(at: usize, end: usize, time_ns: u64) -> Self {
        Self { at, end, span_ns: [time_ns; 2], channels: None }
    }

    /// Takes the message behind this block into it.
    fn extend(&mut self, end: usize, time_ns: u64) {
        self.end = end;
        self.span_ns = [self.span_ns[0].min(time_ns), self.span_ns[1].max(time_ns)];
    }
}

/// The first record of a file.
pub const FIRST: usize = MAGIC.len();

/// The blocks of a file, found by going through its records from the one at `at` on. Chunks are not unpacked. With
/// `is_cut`, the file ends where a record is not whole.
pub fn scanned(source: Source<'_>, mut at: usize, is_cut: bool) -> Result<Vec<Block>, Damage> {
    let file = Bytes { source, of: "" };
    let (mut blocks, mut is_loose) = (Vec::<Block>::new(), false);
    loop {
        let raw = match file.record(at) {
            Ok(raw) => raw,
            Err(damage) if damage.is_refused || !is_cut => return Err(damage),
            Err(_) => return Ok(blocks),
        };
        match raw.opcode {
            op::DATA_END | op::FOOTER => return Ok(blocks),
            op::CHUNK => {
                if let Record::Chunk { header, .. } = file.parsed(at, &raw)? {
                    let span_ns = [header.message_start_time, header.message_end_time];
                    blocks.push(Block { at, end: raw.end, span_ns, channels: None });
                    is_loose = false;
                }
            }
            op::MESSAGE => {
                if let Record::Message { header, .. } = file.parsed(at, &raw)? {
                    let open = blocks.last_mut().filter(|last| is_loose && raw.end - last.at <= LOOSE_BYTES);
                    match open {
                        Some(last) => last.extend(raw.end, header.log_time),
                        None => blocks.push(Block::loose(at, raw.end, header.log_time)),
                    }
                    is_loose = true;
                }
            }
            _ => {}
        }
        at = raw.end;
    }
}

/// Names and contents of the attachments in front of the first message: those of a file whose end with their index is
/// missing. Each is a part of the file, so that all are no longer than that.
pub fn leading_attachments(source: Source<'_>) -> Result<Vec<(String, Vec<u8>)>, Damage> {
    let file = Bytes { source, of: "" };
    let (mut attachments, mut at) = (Vec::new(), MAGIC.len());
    loop {
        let raw = match file.record(at) {
            Ok(raw) => raw,
            Err(damage) if damage.is_refused => return Err(damage),
            Err(_) => return Ok(attachments),
        };
        match raw.opcode {
            op::CHUNK | op::MESSAGE | op::DATA_END | op::FOOTER => return Ok(attachments),
            op::ATTACHMENT => {
                if let Record::Attachment { header, data, .. } = file.parsed(at, &raw)? {
                    attachments.push((header.name, data.into_owned()));
                }
            }
            _ => {}
        }
        at = raw.end;
    }
}

impl<'a> Messages<'a> {
    /// The messages of one block of a file with these channels.
    pub(crate) fn within(source: Source<'a>, block: &Block, channels: &Channels) -> Self {
        let mut all = mcap::Summary::default();
        for (channel, _) in channels.values() {
            all.channels.insert(channel.id, channel.clone());
            all.schemas.extend(channel.schema.iter().map(|schema| (schema.id, schema.clone())));
        }
        let all = ChannelAccumulator::from_summary(&all);
        Self {
            source,
            at: block.at,
            end: Some(block.end),
            chunk: None,
            spare: Vec::new(),
            loose: Vec::new(),
            unpacked_left: limit(&source, UNPACKED_BYTES, UNPACKED_RATIO),
            channels: Declared { all, ..Declared::of(&source) },
            is_behind_data: false,
            is_done: false,
        }
    }
}
