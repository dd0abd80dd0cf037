//! Announcement of a topic by its publisher before the run starts.

use crate::schema::{Extent, Schema};
use serde::{Deserialize, Serialize};

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
}
