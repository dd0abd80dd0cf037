//! Announcement of a topic by its publisher before the run starts, and the check of every reader.

use crate::error::BusError;
use crate::json_file;
use crate::schema::{Extent, Schema};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The message type of a topic, as its publisher was built with it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Announcement {
    /// Three-part type name.
    pub type_name: String,
    /// Size of a message in bytes.
    pub size: usize,
    /// Hash of the layout.
    pub layout_hash: u64,
    /// The layout as a table, for error messages.
    pub layout: String,
    /// The ROS 2 definition, for recordings.
    pub definition: String,
    /// Offset of a message's stamp in bytes, if it has one.
    pub stamp_offset: Option<usize>,
    /// The part of a message's bytes that counts; absent where it is all of them.
    #[serde(default)]
    pub extent: Option<Extent>,
}

impl Announcement {
    /// The announcement of a publisher that was built with `schema`.
    #[must_use]
    pub fn of(schema: &Schema) -> Self {
        Self {
            type_name: schema.type_name.to_owned(),
            size: schema.size,
            layout_hash: schema.layout_hash(),
            layout: schema.layout(),
            definition: schema.ros2_definition(),
            stamp_offset: schema.stamp_offset(),
            extent: schema.extent(),
        }
    }

    /// The part of `message`, the bytes of a message without its header, that counts.
    #[must_use]
    pub fn used<'a>(&self, message: &'a [u8]) -> &'a [u8] {
        self.extent.map_or(message, |extent| extent.of(message))
    }

    /// Writes the announcement to `path`.
    pub(crate) fn store(&self, path: &Path) -> Result<(), BusError> {
        json_file::store(path, self)
    }

    /// Reads the announcement at `path`.
    pub(crate) fn load(path: &Path) -> Result<Self, BusError> {
        json_file::load(path, "the announcement of a message type")
    }

    /// Checks that a reader built with `schema` reads these bytes as they are meant.
    pub(crate) fn check(&self, schema: &Schema, node: &str, port: &str, topic: &str) -> Result<(), BusError> {
        if self.layout_hash == schema.layout_hash() {
            return Ok(());
        }
        Err(BusError::LayoutMismatch {
            topic: topic.to_owned(),
            node: node.to_owned(),
            port: port.to_owned(),
            expected: schema.layout(),
            found: self.layout.clone(),
        })
    }
}

/// Path of the file that announces the type of topic number `topic`.
pub(crate) fn topic_path(run_dir: &Path, topic: usize) -> PathBuf {
    run_dir.join(format!("topic-{topic}.json"))
}
