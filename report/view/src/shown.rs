//! A recording that is shown, with its index by time.

use anyhow::Result;
use recorder::index::Index;
use recorder::reader::{Record, Recording};
use std::ops::Range;

/// A recording that is open for reading at any time.
#[derive(Debug)]
pub struct Shown {
    recording: Recording,
    index: Index,
    span_ns: [u64; 2],
}

impl Shown {
    /// Opens `recording` for reading by time.
    ///
    /// # Errors
    /// If its file is damaged or it has no message.
    pub fn new(recording: Recording) -> Result<Self> {
        let index = Index::of(&recording)?;
        Self::of(recording, index)
    }

    fn of(recording: Recording, index: Index) -> Result<Self> {
        let Some(span_ns) = index.span_ns() else {
            let path = recording.path().display();
            anyhow::bail!("cannot show {path}: it has no message; expected a recording of at least one tick");
        };
        Ok(Self { recording, index, span_ns })
    }

    /// The recording with everything that its writer has added since; `None` if it has not grown.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn grown(&self) -> Result<Option<Self>> {
        let grown = self.index.grown(&self.recording)?;
        grown.map(|(recording, index)| Self::of(recording, index)).transpose()
    }

    /// True while its writer has not finished it: more may come.
    #[must_use]
    pub fn is_growing(&self) -> bool {
        self.recording.cut().is_some()
    }

    /// The recording.
    #[must_use]
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// The file's name; that which it will have, while its run flies.
    #[must_use]
    pub fn name(&self) -> String {
        let name = self.recording.path().file_name().unwrap_or_default().to_string_lossy();
        name.strip_suffix(".partial.mcap").map_or(name.clone().into_owned(), |stem| format!("{stem}.mcap"))
    }

    /// Time from the first message to the last, in ns.
    #[must_use]
    pub fn duration_ns(&self) -> u64 {
        self.span_ns[1].saturating_sub(self.span_ns[0])
    }

    /// Time of the first message, in ns of the recording's own clock.
    #[must_use]
    pub fn start_ns(&self) -> u64 {
        self.span_ns[0]
    }

    /// Number of blocks, the pieces that the recording is read by.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.index.len()
    }

    /// The blocks with messages between two times.
    #[must_use]
    pub fn blocks(&self, from_ns: u64, to_ns: u64) -> Range<usize> {
        self.index.between(self.absolute(from_ns), self.absolute(to_ns))
    }

    /// The last block in front of `block` that has a message of `topic`.
    #[must_use]
    pub fn block_before(&self, topic: &str, block: usize) -> Option<usize> {
        self.index.before(topic, block)
    }

    /// True if `block` has a message of one of these topics, or the file does not list the topics of its blocks.
    pub(crate) fn may_have<'a>(&self, block: usize, mut topics: impl Iterator<Item = &'a str>) -> bool {
        topics.any(|topic| self.index.may_have(topic, block))
    }

    /// The messages of a block, stamped with times since the first message.
    pub fn messages(&self, block: usize) -> impl Iterator<Item = Result<Record>> + use<'_> {
        let start_ns = self.span_ns[0];
        self.index.messages(&self.recording, block).map(move |record| {
            let mut record = record?;
            record.time_ns = record.time_ns.saturating_sub(start_ns);
            Ok(record)
        })
    }

    fn absolute(&self, time_ns: u64) -> u64 {
        self.span_ns[0].saturating_add(time_ns)
    }
}
