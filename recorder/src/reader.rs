//! A recording that was written: its topics, messages and attachments.

pub use crate::container::{Damage, Messages};

use crate::container::Channels;
use crate::container::blocks::{Block, leading_attachments};
use crate::container::summary::{attachment, summary};
use crate::definition::{Comment, Definition, Leaf};
use crate::error::RecordingError;
use crate::source::Source;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A message of a recording.
#[derive(Clone, Debug)]
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

/// A message of a recording, as [`Recording::visit`] passes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordRef<'a> {
    /// Tick at which it was sent.
    pub tick: u32,
    /// Simulation time in nanoseconds.
    pub time_ns: u64,
    /// Topic.
    pub topic: &'a str,
    /// Encapsulation header and body.
    pub cdr: &'a [u8],
}

/// A topic of a recording.
#[derive(Clone, Debug)]
pub struct Topic {
    /// Three-part type name.
    pub type_name: String,
    definition: Definition,
    /// Messages recorded on it.
    pub message_count: u64,
}

impl Topic {
    /// The definition of its messages.
    pub(crate) fn definition(&self) -> &Definition {
        &self.definition
    }

    /// Unit, frame and meaning of the field at `path`, such as `position.z`, as [`Definition::about`] finds them.
    #[must_use]
    pub fn about(&self, path: &str) -> Comment {
        self.definition.about(path)
    }
}

/// An open recording.
///
/// ```no_run
/// use recorder::reader::Recording;
///
/// let recording = Recording::open("hover.mcap".as_ref())?;
/// for record in recording.messages() {
///     let record = record?;
///     for leaf in recording.decode(&record)? {
///         println!("{} {} {} = {} {}", record.tick, record.topic, leaf.path, leaf.value, leaf.unit);
///     }
/// }
/// # Ok::<(), recorder::RecordingError>(())
/// ```
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    content: Content,
    channels: Channels,
    topics: BTreeMap<String, Topic>,
    cut: Option<Cut>,
}

/// The bytes of a recording.
#[derive(Debug)]
enum Content {
    /// Bytes of a file, read as they are needed.
    File {
        file: File,
        /// Bytes of the file when it was opened; bytes appended later do not belong to it.
        length: usize,
    },
    /// Bytes that were read before.
    Read(Arc<[u8]>),
}

impl Content {
    /// Another handle on `file`, with its present length.
    fn of_file(file: &File, path: &Path) -> Result<Self, RecordingError> {
        let opened = file.try_clone().and_then(|file| {
            let found = file.metadata()?;
            if !found.is_file() {
                return Err(std::io::Error::other("it is not a regular file"));
            }
            let length = usize::try_from(found.len()).map_err(std::io::Error::other)?;
            Ok(Self::File { file, length })
        });
        opened.map_err(RecordingError::file("open", path))
    }

    fn source(&self) -> Source<'_> {
        match self {
            Self::File { file, length } => Source::File { file, length: *length },
            Self::Read(bytes) => Source::Memory(bytes),
        }
    }
}

/// End of a recording that its writer did not finish.
///
/// ```
/// # use bus::{Message, announcement::Announcement, messages::SetPoint};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("cut.mcap");
/// # let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&SetPoint::default())].concat();
/// let mut writer = recorder::writer::RecordingWriter::create(&path)?;
/// let channel = writer.add_channel("/pilot/set_point", &Announcement::of(SetPoint::SCHEMA))?;
/// writer.write(channel, 7, 7_000_000, &cdr)?;
/// writer.flush()?;
/// // Its writer is still at work, or was killed.
/// let recording = recorder::reader::Recording::salvage(&path)?;
/// assert_eq!(recording.cut().map(|cut| cut.last_tick), Some(Some(7)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Tick of the last message that is whole; `None` where none is.
    pub last_tick: Option<u32>,
}

impl Recording {
    /// Opens the complete recording at `path`.
    ///
    /// # Errors
    /// If the file cannot be read or is not a complete MCAP file.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        Self::of_file(&inputs::open(path).map_err(RecordingError::file("open", path))?, path)
    }

    /// The complete recording in `file`, which is called `path` in messages.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn of_file(file: &File, path: &Path) -> Result<Self, RecordingError> {
        let content = Content::of_file(file, path)?;
        Self::complete(content, path)
    }

    /// The complete recording that `bytes` are, which is called `path` in messages.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn of_bytes(bytes: Arc<[u8]>, path: &Path) -> Result<Self, RecordingError> {
        Self::complete(Content::Read(bytes), path)
    }

    fn complete(content: Content, path: &Path) -> Result<Self, RecordingError> {
        let broken = |damage| RecordingError::content(path, damage);
        let channels = match summary(content.source()).map_err(broken)? {
            Some(summary) => summary.channels,
            // Writers may leave the summary out.
            None => match Scan::of(content.source()) {
                Scan { damage: Some(damage), .. } => return Err(broken(damage)),
                Scan { channels, .. } => channels,
            },
        };
        let topics = topics(&channels, path)?;
        Ok(Self { path: path.to_owned(), content, channels, topics, cut: None })
    }

    /// Opens the recording at `path`, or its whole part if its writer did not come to the end of the file: then
    /// [`Recording::cut`] is present. A complete file that is damaged is refused as by [`Recording::open`].
    ///
    /// # Errors
    /// If the file cannot be read or is not an MCAP file.
    pub fn salvage(path: &Path) -> Result<Self, RecordingError> {
        let file = inputs::open(path).map_err(RecordingError::file("open", path))?;
        let content = Content::of_file(&file, path)?;
        let source = content.source();
        let is_magic = |at: usize| {
            let found = source.read(at, mcap::MAGIC.len());
            found.map(|found| *found == *mcap::MAGIC).map_err(RecordingError::file("read", path))
        };
        let magic = mcap::MAGIC.len();
        if !is_magic(0)? || (source.len() > magic && is_magic(source.len() - magic)?) {
            return Self::of_file(&file, path);
        }
        let Scan { channels, last_tick, damage } = Scan::of(source);
        if let Some(damage) = damage.filter(|damage| damage.is_refused) {
            return Err(RecordingError::content(path, damage));
        }
        let topics = topics(&channels, path)?;
        Ok(Self { path: path.to_owned(), content, channels, topics, cut: Some(Cut { last_tick }) })
    }

    /// End of the file, if its writer did not finish it.
    #[must_use]
    pub fn cut(&self) -> Option<&Cut> {
        self.cut.as_ref()
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The bytes of the file.
    pub(crate) fn source(&self) -> Source<'_> {
        self.content.source()
    }

    /// The channels by their numbers.
    pub(crate) fn channels(&self) -> &Channels {
        &self.channels
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

    /// The same recording with all bytes that its file has by now; `None` if it has not grown.
    pub(crate) fn longer(&self) -> Result<Option<Self>, RecordingError> {
        let Content::File { file, length } = &self.content else { return Ok(None) };
        let content = Content::of_file(file, &self.path)?;
        if content.source().len() <= *length {
            return Ok(None);
        }
        let (channels, topics) = (self.channels.clone(), self.topics.clone());
        Ok(Some(Self { path: self.path.clone(), content, channels, topics, cut: self.cut.clone() }))
    }

    /// Counts the messages of `blocks`, which follow those that it has; returns how many of these blocks are whole.
    pub(crate) fn count(&mut self, blocks: &[Block]) -> Result<usize, RecordingError> {
        let (mut channels, mut whole) = (self.channels.clone(), 0);
        for block in blocks {
            let messages: Result<Vec<_>, _> = Messages::within(self.source(), block, &channels).collect();
            let Ok(messages) = messages else { break };
            for message in messages {
                self.cut = self.cut.as_ref().map(|_| Cut { last_tick: Some(message.sequence) });
                channels.entry(message.channel.id).or_insert((message.channel, 0)).1 += 1;
            }
            whole += 1;
        }
        // Its writer has finished it.
        if summary(self.source()).is_ok_and(|summary| summary.is_some()) {
            self.cut = None;
        }
        self.topics = topics(&channels, &self.path)?;
        self.channels = channels;
        Ok(whole)
    }

    /// Iterates over the messages in the order of the file: by tick, then by topic. A damaged chunk is an error in
    /// front of any of its messages; a recording that was cut ends in front of it.
    pub fn messages(&self) -> impl Iterator<Item = Result<Record, RecordingError>> {
        self.whole(Messages::of(self.source()))
    }

    /// Calls `take` with each message in the order of [`Recording::messages`], where it stands: nothing is copied.
    ///
    /// ```no_run
    /// use recorder::{RecordingError, reader::Recording};
    ///
    /// let (recording, mut bytes) = (Recording::open("hover.mcap".as_ref())?, 0);
    /// recording.visit::<RecordingError>(|message| {
    ///     bytes += message.cdr.len();
    ///     Ok(())
    /// })?;
    /// println!("{bytes} bytes of messages");
    /// # Ok::<(), RecordingError>(())
    /// ```
    ///
    /// # Errors
    /// If the file is damaged, or that of `take`, which then gets no further message.
    pub fn visit<E: From<RecordingError>>(
        &self,
        mut take: impl FnMut(RecordRef<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut messages = Messages::of(self.source());
        while let Some(message) = messages.next_in_place() {
            if !self.has_whole(&message) {
                break;
            }
            let message = message.map_err(|damage| RecordingError::content(&self.path, damage))?;
            let (header, topic) = (message.header, message.channel.topic.as_str());
            take(RecordRef { tick: header.sequence, time_ns: header.log_time, topic, cdr: message.data })?;
        }
        Ok(())
    }

    /// False from where the recording was cut on.
    fn has_whole<T>(&self, message: &Result<T, Damage>) -> bool {
        match message {
            Ok(_) => true,
            Err(damage) => self.cut.is_none() || damage.is_refused,
        }
    }

    /// The messages, as far as the recording is whole.
    pub(crate) fn whole<'a>(
        &'a self,
        messages: Messages<'a>,
    ) -> impl Iterator<Item = Result<Record, RecordingError>> + use<'a> {
        messages.take_while(|message| self.has_whole(message)).map(|message| {
            let message = message.map_err(|damage| RecordingError::content(&self.path, damage))?;
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
        self.decode_on(&record.topic, &record.cdr)
    }

    /// The fields of a message on `topic` with these bytes.
    ///
    /// # Errors
    /// As [`Recording::decode`].
    pub fn decode_on(&self, topic: &str, cdr: &[u8]) -> Result<Vec<Leaf>, RecordingError> {
        let Topic { type_name, definition, .. } = self.topic(topic)?;
        definition.decode(cdr).map_err(|reason| RecordingError::Decode {
            topic: topic.to_owned(),
            type_name: type_name.clone(),
            reason,
        })
    }

    /// The attachments: name and content. If the file has no index of them, as one that was cut, those in front of its
    /// first message: where ours are.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn attachments(&self) -> Result<Vec<(String, Vec<u8>)>, RecordingError> {
        let broken = |damage| RecordingError::content(&self.path, damage);
        let summary = if self.cut.is_some() { None } else { summary(self.source()).map_err(broken)? };
        let Some(summary) = summary else { return leading_attachments(self.source()).map_err(broken) };
        summary.attachments.iter().map(|index| attachment(self.source(), index).map_err(broken)).collect()
    }
}

/// Channels of a file without a summary, found by reading its messages.
struct Scan {
    channels: Channels,
    /// Tick of the last message that is whole.
    last_tick: Option<u32>,
    /// Damage behind that message.
    damage: Option<Damage>,
}

impl Scan {
    fn of(source: Source<'_>) -> Self {
        let mut scan = Self { channels: Channels::new(), last_tick: None, damage: None };
        for message in Messages::of(source) {
            match message {
                Ok(message) => {
                    scan.last_tick = Some(message.sequence);
                    scan.channels.entry(message.channel.id).or_insert((message.channel, 0)).1 += 1;
                }
                Err(damage) => scan.damage = Some(damage),
            }
        }
        scan
    }
}

/// Encodings of messages and schemas that are read: those of ROS 2.
const ENCODINGS: [&str; 2] = ["cdr", "ros2msg"];

/// The topics of `channels`, each given with the number of its messages.
fn topics(channels: &Channels, path: &Path) -> Result<BTreeMap<String, Topic>, RecordingError> {
    let mut topics = BTreeMap::new();
    for (channel, message_count) in channels.values() {
        let Some(schema) = &channel.schema else { continue };
        if [channel.message_encoding.as_str(), schema.encoding.as_str()] != ENCODINGS {
            return Err(RecordingError::Encoding {
                path: path.to_owned(),
                topic: channel.topic.clone(),
                message: channel.message_encoding.clone(),
                schema: schema.encoding.clone(),
            });
        }
        let definition = Definition::parse(&schema.name, &String::from_utf8_lossy(&schema.data))
            .map_err(|reason| RecordingError::content(path, format!("schema {}: {reason}", schema.name)))?;
        let (type_name, message_count) = (schema.name.clone(), *message_count);
        topics.insert(channel.topic.clone(), Topic { type_name, definition, message_count });
    }
    Ok(topics)
}
