//! What can go wrong with a recording.

use crate::definition::DecodeError;
use std::path::PathBuf;
use thiserror::Error;

/// An error about a recording; its text names the file and what to do.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be opened, created or written.
    #[error("cannot {action} the recording {path}: {source}")]
    File {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why it failed.
        source: std::io::Error,
    },
    /// The file is not a complete MCAP file.
    #[error(
        "{path} is not a complete MCAP file: {reason}. If its writer was killed, `hummingbus cat` and `diff` read what \
         is whole of it, and `mcap recover` makes a complete file of that"
    )]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The MCAP writer failed.
    #[error("writing {path}: {reason}. Is the disk full?")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the writer said.
        reason: String,
    },
    /// A message does not fit its definition.
    #[error("topic {topic}: a message does not fit its definition {type_name}: {reason}")]
    Decode {
        /// The topic.
        topic: String,
        /// The message type.
        type_name: String,
        /// What does not fit.
        reason: DecodeError,
    },
    /// There is no such topic.
    #[error("the recording has no topic {topic}; it has {known}")]
    UnknownTopic {
        /// The topic asked for.
        topic: String,
        /// The topics there are.
        known: String,
    },
    /// There is no such field.
    #[error("topic {topic} has no field `{field}`; it has {known}")]
    UnknownField {
        /// The topic.
        topic: String,
        /// The field asked for.
        field: String,
        /// The fields there are.
        known: String,
    },
}
