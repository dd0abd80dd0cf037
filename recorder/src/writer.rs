//! The MCAP file of a run, as ROS 2 tools expect it and as a function of the run alone.
//!
//! Times are simulation times, the sequence is the tick, chunks end by content and tick: two recordings
//! of one run are the same bytes.

use crate::error::RecordingError;
use bus::announcement::Announcement;
use bus::schema::Extent;
use mcap::records::MessageHeader;
use mcap::{Attachment, Compression, WriteOptions};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

/// Bytes of messages after which a chunk is closed.
const CHUNK_BYTES: usize = 1024 * 1024;
/// Level of zstd. On the numbers of the hover run (43.5 MB) level 1 packs 407 MB/s to 24.9 MB and unpacks 1.5 GB/s; this one
/// packs 965 MB/s to 26.6 MB and unpacks 4.0 GB/s.
const ZSTD_LEVEL: i32 = -3;
/// The bytes with which every recording of ours starts, by MCAP's specification: "Magic", then the record "Header" with
/// the profile and the library that are written here.
pub const START: &[u8] = b"\x89MCAP0\r\n\x01\x16\0\0\0\0\0\0\0\x04\0\0\0ros2\x0a\0\0\0hummingbus";
/// Encoding of the schemas: definitions of ROS 2.
pub const SCHEMA_ENCODING: &str = "ros2msg";
/// Encoding of the messages.
pub const MESSAGE_ENCODING: &str = "cdr";
/// `O_NOFOLLOW` of the kernel.
const NO_LINK: i32 = rustix::fs::OFlags::NOFOLLOW.bits().cast_signed();
const FILE_BUFFER_BYTES: usize = 1024 * 1024;

/// A recording being written.
pub struct RecordingWriter {
    mcap: mcap::Writer<BufWriter<File>>,
    path: PathBuf,
    /// Bytes of messages in the open chunk.
    chunk_bytes: usize,
    /// The part of a channel's messages that is written, by channel.
    extents: BTreeMap<u16, Extent>,
}

/// A channel of a recording.
#[derive(Clone, Copy, Debug)]
pub struct ChannelId(u16);

impl RecordingWriter {
    /// Creates the file at `path`, or opens one that is there and empty: nothing is replaced.
    ///
    /// # Errors
    /// If the file cannot be created or written, or something else is there.
    pub fn create(path: &Path) -> Result<Self, RecordingError> {
        let file = open_empty(path).map_err(RecordingError::file("create", path))?;
        let mcap = WriteOptions::new()
            .profile("ros2")
            .library("hummingbus")
            .compression(Some(Compression::Zstd))
            // mcap takes a number without a sign, and hands it to zstd as one with a sign.
            .compression_level(ZSTD_LEVEL.cast_unsigned())
            // Worker threads would cost determinism nothing, but a core that the nodes need.
            .compression_threads(0)
            // Chunks are closed between ticks, by `end_tick` and `flush`: the file of a killed recorder ends with a
            // whole tick.
            .chunk_size(None)
            .create(BufWriter::with_capacity(FILE_BUFFER_BYTES, file))
            .map_err(|error| write_error(path, &error))?;
        Ok(Self { mcap, path: path.to_owned(), chunk_bytes: 0, extents: BTreeMap::new() })
    }

    /// Attaches a text file under `name`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn attach(&mut self, name: &str, text: &[u8]) -> Result<(), RecordingError> {
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: name.to_owned(),
            media_type: "application/toml".to_owned(),
            data: Cow::Borrowed(text),
        };
        self.mcap.attach(&attachment).map_err(|error| write_error(&self.path, &error))
    }

    /// Adds a channel for `topic`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn add_channel(&mut self, topic: &str, message: &Announcement) -> Result<ChannelId, RecordingError> {
        let metadata = channel_metadata(message);
        let channel = self
            .mcap
            .add_schema(&message.type_name, SCHEMA_ENCODING, message.definition.as_bytes())
            .and_then(|schema| self.mcap.add_channel(schema, topic, MESSAGE_ENCODING, &metadata))
            .map_err(|error| write_error(&self.path, &error))?;
        self.extents.extend(message.extent.map(|extent| (channel, extent)));
        Ok(ChannelId(channel))
    }

    /// Writes one message: `cdr` is its encapsulation header and body, of which only the values that count are written.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(
        &mut self,
        channel: ChannelId,
        tick: u32,
        time_ns: u64,
        cdr: &[u8],
    ) -> Result<(), RecordingError> {
        let header =
            MessageHeader { channel_id: channel.0, sequence: tick, log_time: time_ns, publish_time: time_ns };
        let cdr = self.counting(channel, cdr);
        self.chunk_bytes += cdr.len();
        self.mcap.write_to_known_channel(&header, cdr).map_err(|error| write_error(&self.path, &error))
    }

    /// The part of `cdr`, a message of `channel`, that is written: the values that count.
    #[must_use]
    pub fn counting<'a>(&self, channel: ChannelId, cdr: &'a [u8]) -> &'a [u8] {
        self.extents.get(&channel.0).map_or(cdr, |extent| extent.of_cdr(cdr))
    }

    /// Ends a tick: closes the chunk if it is full.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn end_tick(&mut self) -> Result<(), RecordingError> {
        if self.chunk_bytes < CHUNK_BYTES { Ok(()) } else { self.flush() }
    }

    /// Closes the chunk and hands it to the kernel: everything written so far survives a killed process.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.chunk_bytes = 0;
        self.mcap.flush().map_err(|error| write_error(&self.path, &error))
    }

    /// Writes the summary section and closes the file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<(), RecordingError> {
        self.mcap.finish().map(|_| ()).map_err(|error| write_error(&self.path, &error))?;
        let mut file = self.mcap.into_inner();
        std::io::Write::flush(&mut file).map_err(RecordingError::file("write", &self.path))
    }
}

/// Metadata of the channel of a topic with this message.
#[must_use]
pub fn channel_metadata(message: &Announcement) -> BTreeMap<String, String> {
    BTreeMap::from([
        ("offered_qos_profiles".to_owned(), String::new()),
        ("layout_hash".to_owned(), format!("{:016x}", message.layout_hash)),
    ])
}

/// Opens the empty file at `path`, which is created if nothing is there.
fn open_empty(path: &Path) -> std::io::Result<File> {
    let refused = |message: &str| Err(std::io::Error::other(message));
    match std::fs::symlink_metadata(path) {
        // To open a pipe or a device is to do something to it.
        Ok(old) if !old.is_file() => refused("it exists and is not a regular file"),
        Ok(old) if old.len() > 0 => refused("it exists and is not empty; name another file"),
        // A link that was put in its place meanwhile is not followed.
        Ok(_) => File::options().write(true).custom_flags(NO_LINK).open(path),
        Err(_) => File::create_new(path),
    }
}

/// The error with its deepest cause, which is the system's refusal.
fn write_error(path: &Path, error: &mcap::McapError) -> RecordingError {
    let mut cause: &dyn std::error::Error = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    RecordingError::Write { path: path.to_owned(), reason: cause.to_string() }
}
