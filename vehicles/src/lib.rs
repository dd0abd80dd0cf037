//! Vehicle files: every physical number with its unit, source and uncertainty, read once into SI.
//!
//! | room | what it holds |
//! |---|---|
//! | [`vehicle`] | the immutable [`Vehicle`] that the physics uses |
//! | [`command`] | the map between a raw motor command and a rotor speed |
//! | [`bearing`] | the thrust of commands over the weight, and the scale with which both are equal |
//! | `envelope` | the flight envelope in which a model was validated |
//! | [`provenance`] | where each number came from, kept for reports |
//! | [`effects`] | the effects that a vehicle or scene file lists, as they are written |
//! | `bounds` | what the numbers of a vehicle can be, and why |
//! | [`command_log`], [`filled_commands`], [`held_commands`] | commands of a log beside the motion; those that an exporter filled in, or a logger held |
//! | [`from_model`] | first vehicle files from URDF and SDF |
//! | [`gaps`] | gaps of logs whose samples hold until the next |
//! | `file` | which keys a vehicle file has, and what is physical |
//! | [`foreign`] | formats that are taken for another one, by their first bytes |
//! | [`reader`] | walks the TOML tree with positions, refuses what it does not know; scene files and gains files use it too |
//! | `schedule` | parameters that are lines of times and values |
//! | [`quotes`] | quotation marks in CSV files of measurements, whose rows are lines |
//! | `dialect`, `layout`, `table_error` | delimiter, header and decimal mark of such a table: declared, found, wrong |
//! | [`lines`], [`encoding`] | lines of texts of any system; UTF-16 |
//! | [`table`] | tables of measurements in CSV, for every log that has this format |
//! | `table_rows` | their rows, in little memory |
//! | [`wall_clock`] | times of day in logs |
//! | [`mod@reference`] | the vehicle files of this crate, as text |
//!
//! ```
//! let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml")?;
//! assert_eq!(vehicle.mass_kg, 0.480);
//! # Ok::<(), diagnostics::Diagnostic>(())
//! ```
#![forbid(unsafe_code)]

pub mod bearing;
mod bounds;
pub mod command;
pub mod command_log;
mod dialect;
pub mod effects;
pub mod encoding;
mod envelope;
mod file;
pub mod filled_commands;
pub mod foreign;
pub mod from_model;
pub mod gaps;
pub mod held_commands;
mod layout;
pub mod lines;
pub mod provenance;
pub mod quotes;
pub mod reader;
pub mod reference;
mod schedule;
pub mod table;
mod table_error;
mod table_rows;
pub mod vehicle;
pub mod wall_clock;

pub use command::CommandMap;
pub use effects::EffectEntry;
pub use envelope::Envelope;
pub use file::{FILE, is_rigid};
pub use provenance::{Provenance, Stated, Uncertainty};
pub use vehicle::{MotorModel, ROTORS_MAX, Rotor, Vehicle};
