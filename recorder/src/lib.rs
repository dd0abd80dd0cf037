//! Recordings: the MCAP writer node, the reader, values by field path, and the comparison of two files.
//!
//! - [`node`]: the process that records a run
//! - [`writer`]: the MCAP file it writes
//! - `watched`: its samples for those who watch the run
//! - [`definition`]: the layout of a message by its ROS 2 definition
//! - `source`: the bytes of a recording, in memory or in a file
//! - `container`: the records of an MCAP file, their lengths checked before memory is taken for them
//! - [`reader`]: a recording's topics, messages and attachments
//! - [`index`]: a recording by time, read stretch by stretch
//! - [`fields`]: newest values of the fields of a topic, read message by message
//! - [`series`]: one field of one topic over time
//! - [`comparison`]: comparison of two recordings within a tolerance
//! - [`diff`]: where two recordings first differ
//!
//! A recording holds each message as ROS 2 tools expect it, stamped with simulation time and numbered by tick:
//!
//! ```
//! use bus::Message;
//! use bus::announcement::Announcement;
//! use bus::messages::SetPoint;
//! use recorder::diff::first_difference;
//! use recorder::reader::Recording;
//! use recorder::writer::RecordingWriter;
//!
//! // Three set points, a millisecond apart.
//! let folder = tempfile::tempdir()?;
//! let record = |name: &str, altitudes: [f64; 3]| {
//!     let path = folder.path().join(name);
//!     let mut writer = RecordingWriter::create(&path)?;
//!     let channel = writer.add_channel("/pilot/set_point", &Announcement::of(&SetPoint::SCHEMA))?;
//!     for (tick, altitude) in (0..).zip(altitudes) {
//!         let message = SetPoint { altitude, ..SetPoint::default() };
//!         let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&message)].concat();
//!         writer.write(channel, tick, u64::from(tick) * 1_000_000, &cdr)?;
//!     }
//!     writer.finish()?;
//!     Recording::open(&path)
//! };
//! let climb = record("climb.mcap", [1.0, 1.5, 2.0])?;
//! assert_eq!(climb.topic("/pilot/set_point")?.message_count, 3);
//!
//! let altitude = &climb.series(&[("/pilot/set_point", "altitude")])?[0];
//! assert_eq!((&altitude.value[..], altitude.unit.as_str()), (&[1.0, 1.5, 2.0][..], "m"));
//! assert_eq!(altitude.time_ns, [0, 1_000_000, 2_000_000]);
//!
//! let other = record("other.mcap", [1.0, 1.5, 2.5])?;
//! let difference = first_difference(&climb, &other)?.expect("the last altitudes differ");
//! assert_eq!(difference.to_string(), "tick 2, topic /pilot/set_point, field altitude: 2.0 against 2.5");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod comparison;
mod container;
pub mod definition;
pub mod diff;
mod error;
pub mod fields;
pub mod index;
pub mod node;
pub mod reader;
pub mod series;
mod source;
mod watched;
pub mod writer;

pub use error::RecordingError;
