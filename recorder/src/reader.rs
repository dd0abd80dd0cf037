//! A recording that was written: its topics, messages and attachments.

use crate::definition::{Definition, Leaf};
use crate::error::RecordingError;
use mcap::Summary;
use memmap2::Mmap;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

/// A message of a recording.
#[derive(Debug)]
pub struct Record<'a> {
    /// Tick at which it was sent.
    pub tick: u32,
    /// Simulation time in nanoseconds.
    pub time_ns: u64,
    /// Topic.
    pub topic: String,
    /// Encapsulation header and body.
    pub cdr: std::borrow::Cow<'a, [u8]>,
}

/// A topic of a recording.
#[derive(Debug)]
pub struct Topic {
    /// Three-part type name.
    pub type_name: String,
    /// The parsed definition.
    pub definition: Definition,
    /// Messages recorded on it.
    pub message_count: u64,
}

/// An open recording.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    bytes: Mmap,
    topics: BTreeMap<String, Topic>,
}

impl Recording {
    /// Opens the recording at `path`.
    ///
    /// # Errors
    /// If the file cannot be read or is not a complete MCAP file.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let fail = |source| RecordingError::File { action: "open", path: path.to_owned(), source };
        let file = File::open(path).map_err(fail)?;
        // SAFETY: the mapping is read only, and our own writer never truncates a recording: it replaces the
        // file. Another program that truncates it meanwhile ends this one with SIGBUS.
        let bytes = unsafe { Mmap::map(&file) }.map_err(fail)?;
        require_sane_sizes(&bytes)
            .map_err(|reason| RecordingError::Content { path: path.to_owned(), reason })?;
        let summary = Summary::read(&bytes).map_err(|error| content(path, &error))?.ok_or_else(|| {
            RecordingError::Content { path: path.to_owned(), reason: "it has no summary section".to_owned() }
        })?;
        let topics = topics(&summary, path)?;
        Ok(Self { path: path.to_owned(), bytes, topics })
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The whole file.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The topics by name.
    #[must_use]
    pub fn topics(&self) -> &BTreeMap<String, Topic> {
        &self.topics
    }

    /// The topic named `topic`.
    ///
    /// # Errors
    /// If there is none; the error lists those there are.
    pub fn topic(&self, topic: &str) -> Result<&Topic, RecordingError> {
        self.topics.get(topic).ok_or_else(|| RecordingError::UnknownTopic {
            topic: topic.to_owned(),
            known: self.topics.keys().cloned().collect::<Vec<_>>().join(", "),
        })
    }

    /// All messages in the order of the file: by tick, then by topic.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn messages(
        &self,
    ) -> Result<impl Iterator<Item = Result<Record<'_>, RecordingError>>, RecordingError> {
        let stream = mcap::MessageStream::new(&self.bytes).map_err(|error| content(&self.path, &error))?;
        Ok(stream.map(|message| {
            let message = message.map_err(|error| content(&self.path, &error))?;
            Ok(Record {
                tick: message.sequence,
                time_ns: message.log_time,
                topic: message.channel.topic.clone(),
                cdr: message.data,
            })
        }))
    }

    /// The fields of a message.
    ///
    /// # Errors
    /// If it does not fit its definition.
    pub fn decode(&self, record: &Record<'_>) -> Result<Vec<Leaf>, RecordingError> {
        let topic = self.topic(&record.topic)?;
        topic.definition.decode(&record.cdr).map_err(|reason| RecordingError::Decode {
            topic: record.topic.clone(),
            type_name: topic.type_name.clone(),
            reason,
        })
    }

    /// The attachments: name and content.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn attachments(&self) -> Result<Vec<(String, Vec<u8>)>, RecordingError> {
        let summary =
            Summary::read(&self.bytes).map_err(|error| content(&self.path, &error))?.unwrap_or_default();
        summary
            .attachment_indexes
            .iter()
            .map(|index| {
                let attachment =
                    mcap::read::attachment(&self.bytes, index).map_err(|e| content(&self.path, &e))?;
                Ok((attachment.name.clone(), attachment.data.into_owned()))
            })
            .collect()
    }
}

/// No chunk of a recording is larger when it is unpacked.
const CHUNK_BYTES_MAX: u64 = 1 << 30;
const MAGIC_BYTES: usize = 8;
const RECORD_HEAD_BYTES: usize = 9;
const OP_FOOTER: u8 = 0x02;
const OP_CHUNK: u8 = 0x06;

/// Refuses records that claim an absurd size: reading them would ask for that much memory at once.
fn require_sane_sizes(bytes: &[u8]) -> Result<(), String> {
    let mut at = MAGIC_BYTES;
    loop {
        let (operation, content) =
            record(bytes, at).ok_or_else(|| format!("no whole record at byte {at}"))?;
        // A chunk begins with its start time, its end time and its unpacked size.
        let unpacked = content.get(16..).and_then(|content| content.first_chunk::<8>());
        match (operation, unpacked.map(|unpacked| u64::from_le_bytes(*unpacked))) {
            (OP_FOOTER, _) => return Ok(()),
            (OP_CHUNK, Some(unpacked)) if unpacked > CHUNK_BYTES_MAX => {
                return Err(format!("the chunk at byte {at} claims to unpack to {unpacked} bytes"));
            }
            _ => at += RECORD_HEAD_BYTES + content.len(),
        }
    }
}

/// The record at byte `at`: its operation code and its content.
fn record(bytes: &[u8], at: usize) -> Option<(u8, &[u8])> {
    let (&operation, rest) = bytes.get(at..)?.split_first()?;
    let (length, rest) = rest.split_first_chunk::<8>()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    Some((operation, rest.get(..length)?))
}

fn topics(summary: &Summary, path: &Path) -> Result<BTreeMap<String, Topic>, RecordingError> {
    let counts = summary.stats.as_ref().map(|stats| &stats.channel_message_counts);
    summary
        .channels
        .values()
        .filter_map(|channel| channel.schema.as_ref().map(|schema| (channel, schema)))
        .map(|(channel, schema)| {
            let definition = Definition::parse(&String::from_utf8_lossy(&schema.data)).map_err(|reason| {
                RecordingError::Content {
                    path: path.to_owned(),
                    reason: format!("schema {}: {reason}", schema.name),
                }
            })?;
            let message_count = counts.and_then(|counts| counts.get(&channel.id)).copied().unwrap_or(0);
            Ok((channel.topic.clone(), Topic { type_name: schema.name.clone(), definition, message_count }))
        })
        .collect()
}

fn content(path: &Path, error: &mcap::McapError) -> RecordingError {
    RecordingError::Content { path: path.to_owned(), reason: error.to_string() }
}
