//! A recording that was written: its topics, messages and attachments.

use crate::definition::{Definition, Leaf};
use crate::error::RecordingError;
use mcap::Summary;
use mcap::sans_io::linear_reader::LinearReaderOptions;
use mcap::sans_io::{MessageReadEvent, MessageReader};
use memmap2::Mmap;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

/// A message of a recording.
#[derive(Debug)]
pub struct Record {
    /// Tick at which it was sent.
    pub tick: u32,
    /// Simulation time in nanoseconds.
    pub time_ns: u64,
    /// Topic.
    pub topic: String,
    /// Encapsulation header and body.
    pub cdr: Vec<u8>,
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

    /// All messages in the order of the file: by tick, then by topic. A damaged chunk is an error in front of any
    /// of its messages.
    pub fn messages(&self) -> impl Iterator<Item = Result<Record, RecordingError>> {
        Messages::new(&self.bytes).map(|message| {
            let message = message.map_err(|error| content(&self.path, &error))?;
            Ok(Record {
                tick: message.sequence,
                time_ns: message.log_time,
                topic: message.channel.topic.clone(),
                cdr: message.data.into_owned(),
            })
        })
    }

    /// The fields of a message.
    ///
    /// # Errors
    /// If it does not fit its definition.
    pub fn decode(&self, record: &Record) -> Result<Vec<Leaf>, RecordingError> {
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

/// Longer records are refused before memory is taken for them: a damaged length must not ask for terabytes.
const RECORD_BYTES_MAX: usize = 1 << 28;

/// Feeds the bytes of a file to the reader of its messages.
struct Messages<'a> {
    reader: MessageReader,
    rest: &'a [u8],
}

impl<'a> Messages<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(RECORD_BYTES_MAX);
        Self { reader: MessageReader::new_with_options(options), rest: bytes }
    }
}

impl Iterator for Messages<'_> {
    type Item = mcap::McapResult<mcap::Message<'static>>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.reader.next_event()? {
                Err(error) => return Some(Err(error)),
                Ok(MessageReadEvent::Message(message)) => return Some(Ok(message)),
                Ok(MessageReadEvent::ReadRequest(wanted)) => {
                    let (next, rest) = self.rest.split_at(wanted.min(self.rest.len()));
                    self.reader.insert(next.len()).copy_from_slice(next);
                    self.reader.notify_read(next.len());
                    self.rest = rest;
                }
            }
        }
    }
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
