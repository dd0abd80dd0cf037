//! Errors about a recording.

use crate::definition::{DecodeError, Leaf};
use diagnostics::{nearest, printable_line};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// An error about a recording; its text names the file and the remedy.
///
/// ```
/// let error = recorder::reader::Recording::open("no/such.mcap".as_ref()).unwrap_err();
/// assert!(error.to_string().starts_with("cannot open the recording no/such.mcap: "));
/// ```
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be opened, created or written.
    #[error("cannot {action} the recording {path}: {source}")]
    File {
        /// Action that failed.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Cause.
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
        /// Fault of the content.
        reason: String,
    },
    /// Messages in another encoding than those of ROS 2.
    #[error(
        "{path}: expected messages of ROS 2, encoded as `cdr` with a `ros2msg` schema; topic {} has messages encoded as \
         `{}` with a `{}` schema. Leave such topics out with `mcap filter {path} -o NEW.mcap --exclude-topic-regex TOPIC`, \
         or read the file with `mcap cat --json`",
        printable_line(topic),
        printable_line(message),
        printable_line(schema)
    )]
    Encoding {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Encoding of its messages.
        message: String,
        /// Encoding of their schema.
        schema: String,
    },
    /// The MCAP writer failed.
    #[error("writing {path}: {reason}. Is the disk full?")]
    Write {
        /// The file.
        path: PathBuf,
        /// Answer of the writer.
        reason: String,
    },
    /// A message does not fit its definition.
    #[error(
        "topic {}: a message does not fit its definition {}: {reason}",
        printable_line(topic),
        printable_line(type_name)
    )]
    Decode {
        /// The topic.
        topic: String,
        /// The message type.
        type_name: String,
        /// Fault of the message.
        reason: DecodeError,
    },
    /// There is no such topic.
    #[error(
        "the recording has no topic {}{}; it has {}",
        printable_line(topic), meant(topic, known), if known.is_empty() { "none".into() } else { printable_line(known) }
    )]
    UnknownTopic {
        /// The topic requested.
        topic: String,
        /// The topics there are; empty if there is none.
        known: String,
    },
    /// There is no such field.
    #[error(
        "topic {} has no field `{}`{}; it has {}",
        printable_line(topic),
        printable_line(field),
        meant(field, known),
        printable_line(known)
    )]
    UnknownField {
        /// The topic.
        topic: String,
        /// The field requested.
        field: String,
        /// The fields there are.
        known: String,
    },
}

/// Question for the name among those in `known` that `found` was probably meant to be; empty if none is near.
fn meant(found: &str, known: &str) -> String {
    // An ellipsis stands for the further elements of an array.
    let near = nearest(found, known.split(", ").filter(|name| *name != "…"));
    near.map_or(String::new(), |near| format!(" (did you mean `{}`?)", printable_line(near)))
}

impl From<RecordingError> for diagnostics::Error {
    fn from(error: RecordingError) -> Self {
        Self::new(error)
    }
}

impl RecordingError {
    /// Error of the system, for `action` on the file at `path`.
    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::File { action, path: path.to_owned(), source }
    }

    /// The file at `path` is not as a complete MCAP file is.
    pub(crate) fn content(path: &Path, reason: impl ToString) -> Self {
        Self::Content { path: path.to_owned(), reason: reason.to_string() }
    }

    /// There is no `field` among the `leaves` of `topic`.
    #[must_use]
    pub fn unknown_field(topic: &str, field: &str, leaves: &[Leaf]) -> Self {
        let known = names(leaves.iter().map(|leaf| leaf.path.as_str()));
        Self::UnknownField { topic: topic.to_owned(), field: field.to_owned(), known }
    }
}

/// The names of fields in a list; of an array the first two elements, since how many there are depends on the vehicle.
fn names<'p>(paths: impl Iterator<Item = &'p str>) -> String {
    let mut names: Vec<&str> = Vec::new();
    for path in paths {
        let index = path.strip_suffix(']').and_then(|path| path.rsplit_once('[')?.1.parse::<usize>().ok());
        match index {
            Some(2) => names.push("…"),
            Some(3..) => {}
            _ => names.push(path),
        }
    }
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::names;

    #[test]
    fn an_array_is_listed_by_its_first_elements() {
        let speeds: Vec<String> = (0..12).map(|rotor| format!("rotor_speed[{rotor}]")).collect();
        let paths = ["tick"].into_iter().chain(speeds.iter().map(String::as_str)).chain(["position.z"]);
        assert_eq!(names(paths), "tick, rotor_speed[0], rotor_speed[1], …, position.z");
    }
}
