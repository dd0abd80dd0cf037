//! Recordings: the MCAP writer node, the reader, values by field path, and the comparison of two files.
//!
//! - [`node`]: the process that records a run
//! - [`writer`]: the MCAP file it writes
//! - [`definition`]: what a ROS 2 message definition says about bytes
//! - [`reader`]: a recording's topics, messages and attachments
//! - [`series`]: one field of one topic over time
//! - [`diff`]: where two recordings first differ

pub mod definition;
pub mod diff;
mod error;
pub mod node;
pub mod reader;
pub mod series;
pub mod writer;

pub use error::RecordingError;
