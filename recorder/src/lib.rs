//! Recordings: the MCAP writer node, the reader, values by field path, and the comparison of two files.
//!
//! - [`node`]: the process that records a run
//! - [`writer`]: the MCAP file it writes
//! - [`definition`]: what a ROS 2 message definition says about bytes
//! - `container`: the records of an MCAP file, their lengths checked before memory is taken for them
//! - [`reader`]: a recording's topics, messages and attachments
//! - [`series`]: one field of one topic over time
//! - [`diff`]: where two recordings first differ

mod container;
pub mod definition;
pub mod diff;
mod error;
pub mod node;
pub mod reader;
pub mod series;
pub mod writer;

pub use error::RecordingError;
