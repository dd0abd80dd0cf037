//! A recording by time: any stretch of it is read without the rest.

use crate::container::blocks::{Block, FIRST, scanned};
use crate::container::summary::summary;
use crate::container::{Channels, Messages};
use crate::error::RecordingError;
use crate::reader::{Record, Recording};
use std::ops::Range;

/// Blocks of a recording in the order of the file, and the times of their messages.
///
/// A block is a chunk of the file, or a mebibyte of messages that stand outside of chunks. A recording of ours has a block
/// for each second or each mebibyte, whichever is less.
///
/// ```
/// # use bus::{Message, announcement::Announcement, messages::SetPoint};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("climb.mcap");
/// # let mut writer = recorder::writer::RecordingWriter::create(&path)?;
/// # let channel = writer.add_channel("/pilot/set_point", &Announcement::of(SetPoint::SCHEMA))?;
/// # let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&SetPoint::default())].concat();
/// # for tick in 0..5000_u32 {
/// #     writer.write(channel, tick, u64::from(tick) * 1_000_000, &cdr)?;
/// #     if tick % 1000 == 999 { writer.flush()?; }
/// # }
/// # writer.finish()?;
/// // Five seconds, a thousand set points in each.
/// let recording = recorder::reader::Recording::open(&path)?;
/// let index = recorder::index::Index::of(&recording)?;
/// assert_eq!((index.len(), index.span_ns()), (5, Some([0, 4_999_000_000])));
///
/// let blocks = index.between(2_500_000_000, 3_500_000_000);
/// assert_eq!(blocks, 2..4);
/// assert_eq!(index.messages(&recording, 2).count(), 1000);
/// assert_eq!(index.before("/pilot/set_point", 2), Some(1));
/// assert!(index.may_have("/pilot/set_point", 2) && !index.may_have("/imu/sample", 2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Index {
    blocks: Vec<Block>,
    /// The latest time of each block and all before it: it grows even where the times of the blocks do not.
    reached_ns: Vec<u64>,
    channels: Channels,
}

impl Index {
    /// The index of a recording: from its summary, or by going through its records.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn of(recording: &Recording) -> Result<Self, RecordingError> {
        let broken = |damage| RecordingError::content(recording.path(), damage);
        let (source, is_cut) = (recording.source(), recording.cut().is_some());
        let summary = if is_cut { None } else { summary(source).map_err(broken)? };
        let mut blocks: Vec<Block> = match summary.and_then(|summary| summary.chunks) {
            Some(chunks) => chunks.iter().map(Block::listed).collect(),
            None => scanned(source, FIRST, is_cut).map_err(broken)?,
        };
        blocks.sort_by_key(|block| block.at);
        // A chunk that is listed again and again would be read as often.
        if let Some(pair) = blocks.windows(2).find(|pair| pair[1].at < pair[0].end) {
            let reason =
                format!("byte {}: expected a chunk behind the one at byte {}", pair[1].at, pair[0].at);
            return Err(RecordingError::content(recording.path(), reason));
        }
        Ok(Self::of_blocks(blocks, recording))
    }

    fn of_blocks(blocks: Vec<Block>, recording: &Recording) -> Self {
        let reached = |latest: &mut u64, block: &Block| {
            *latest = block.span_ns[1].max(*latest);
            Some(*latest)
        };
        let reached_ns = blocks.iter().scan(0, reached).collect();
        Self { blocks, reached_ns, channels: recording.channels().clone() }
    }

    /// The indexed recording, and its index, with everything that its writer has added since; `None` if nothing was
    /// added, or the writer has finished.
    ///
    /// ```
    /// # use bus::{Message, announcement::Announcement, messages::SetPoint};
    /// # use recorder::{index::Index, reader::Recording, writer::RecordingWriter};
    /// # let folder = tempfile::tempdir()?;
    /// # let path = folder.path().join("live.mcap");
    /// # let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&SetPoint::default())].concat();
    /// let mut writer = RecordingWriter::create(&path)?;
    /// let channel = writer.add_channel("/pilot/set_point", &Announcement::of(SetPoint::SCHEMA))?;
    /// writer.write(channel, 0, 0, &cdr)?;
    /// writer.flush()?;
    /// let recording = Recording::salvage(&path)?;
    /// let index = Index::of(&recording)?;
    ///
    /// writer.write(channel, 1, 1_000_000, &cdr)?;
    /// assert!(index.grown(&recording)?.is_none(), "it is not in the file yet");
    /// writer.finish()?;
    /// let (recording, index) = index.grown(&recording)?.expect("one more block");
    /// assert_eq!((index.len(), index.span_ns()), (2, Some([0, 1_000_000])));
    /// assert_eq!((recording.topic("/pilot/set_point")?.message_count, recording.cut()), (2, None));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn grown(&self, recording: &Recording) -> Result<Option<(Recording, Self)>, RecordingError> {
        if recording.cut().is_none() {
            return Ok(None);
        }
        let Some(mut longer) = recording.longer()? else { return Ok(None) };
        let broken = |damage| RecordingError::content(recording.path(), damage);
        let from = self.blocks.last().map_or(FIRST, |block| block.end);
        let mut added = scanned(longer.source(), from, true).map_err(broken)?;
        added.truncate(longer.count(&added)?);
        let is_finished = longer.cut().is_none();
        let blocks: Vec<Block> = self.blocks.iter().cloned().chain(added).collect();
        if blocks.len() == self.blocks.len() && !is_finished {
            return Ok(None);
        }
        let index = Self::of_blocks(blocks, &longer);
        Ok(Some((longer, index)))
    }

    /// Number of blocks.
    #[must_use]
    pub fn len(&self) -> usize {
        self.blocks.len()
    }

    /// True if the recording has no message.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Times of the earliest and the latest message, in ns; `None` without messages.
    #[must_use]
    pub fn span_ns(&self) -> Option<[u64; 2]> {
        let first = self.blocks.iter().map(|block| block.span_ns[0]).min()?;
        Some([first, *self.reached_ns.last()?])
    }

    /// Blocks from the first to the last one with messages between two times; others may lie between these where the file
    /// is not in the order of time.
    #[must_use]
    pub fn between(&self, from_ns: u64, to_ns: u64) -> Range<usize> {
        let first = self.reached_ns.partition_point(|reached_ns| *reached_ns < from_ns);
        let is_earlier = |block: &Block| block.span_ns[0] <= to_ns;
        let end = self.blocks[first..].iter().rposition(is_earlier).map_or(first, |last| first + last + 1);
        first..end
    }

    /// The last block in front of `block` with a message of `topic`; `None` without one. Where the file does not list the
    /// topics of its blocks, that is the one in front of it.
    #[must_use]
    pub fn before(&self, topic: &str, block: usize) -> Option<usize> {
        self.blocks.get(..block)?.iter().rposition(|block| self.lists(block, topic))
    }

    /// True if `block` has a message of `topic`, or the file does not list the topics of its blocks.
    ///
    /// # Panics
    /// If there is no such block.
    #[must_use]
    pub fn may_have(&self, topic: &str, block: usize) -> bool {
        self.lists(&self.blocks[block], topic)
    }

    fn lists(&self, block: &Block, topic: &str) -> bool {
        let is_of_topic = |id: &u16| self.channels.get(id).is_some_and(|(channel, _)| channel.topic == topic);
        block.channels.as_ref().is_none_or(|ids| ids.iter().any(is_of_topic))
    }

    /// The messages of one block, in the order of the file. A damaged chunk is an error in front of any of its messages; a
    /// recording that was cut ends in front of it.
    ///
    /// # Panics
    /// If there is no such block.
    pub fn messages<'a>(
        &self,
        recording: &'a Recording,
        block: usize,
    ) -> impl Iterator<Item = Result<Record, RecordingError>> + use<'a> {
        recording.whole(Messages::within(recording.source(), &self.blocks[block], &self.channels))
    }
}
