//! Measured flights from any log: their channels in SI units and in the frames of this project.
//!
//! | room | what it holds |
//! |---|---|
//! | `flight` | a flight: channels, each at its own times |
//! | `set` | a flights file and all its logs |
//! | `declaration`, `document` | what a flights file says, and where |
//! | `quantity`, `frame` | units and frames |
//! | `files`, `joined`, `seams` | logs in several files: their names, their parts as one log, the times between them |
//! | `opening` | the logs of a flight, opened |
//! | `logs`, `log_reader` | which logs flights are read from: names and patterns; each log is read once |
//! | `log`, `number_rows` | what every log can do: samples of numbers by name |
//! | `formats` | the formats of logs: `csv_log`, `mcap_log`, `ulog` (`ulog_messages`, `ulog_format`), `crazyflie`, `dataflash`, `parquet`, `bytes`, `arrays` |
//! | `form`, `rows` | tables, CSV and Parquet: their declared form, and rows on one clock |
//! | `known_types` | messages whose fields and units need not be said |
//! | `name`, `scaling`, `matrices`, `clock` | names of numbers, their factors, rotation matrices, clocks that start again |
//! | `channels`, `clean`, `held`, `held_commands`, `jumps`, `spikes`, `glitches`, `reading` | from a log's numbers to a flight |
//! | `specific_force` | specific force and angular velocity from what logs hold in their place |
//! | `plausible`, `agreement`, `axes`, `lateness`, `force_doubt`, `rates_doubt`, `still`, `units`, `finding` | values against physics |
//! | `rig` | vehicles that a rig holds at a point |
//! | `span` | times against the number of samples |
//! | `held_out`, `twin` | whether test flights hold what parameters are fitted on: by file and time, by samples |
//! | `state` | errors of a simulated state against the measured one |
//! | `canonical` | a flight as one CSV table |
//! | `known` | stretches in which the commands determine the rotor speeds |
//! | `measured_voltage` | the voltage of the battery, as it drives the motors |
//! | `played` | a flight as it is played, and the windows that a replay counts |
//! | `error` | what can be wrong |

mod agreement;
mod arrays;
mod axes;
mod bytes;
mod canonical;
mod channels;
mod clean;
mod clock;
mod crazyflie;
mod csv_log;
mod dataflash;
mod declaration;
mod document;
mod error;
mod files;
mod finding;
mod flight;
mod force_doubt;
mod form;
mod formats;
mod frame;
mod glitches;
mod held;
mod held_commands;
mod held_out;
mod joined;
mod jumps;
mod known;
mod known_types;
mod lateness;
mod limits;
mod log;
mod log_reader;
mod logs;
mod matrices;
mod mcap_log;
mod measured_voltage;
mod name;
mod number_rows;
mod opening;
mod parquet;
mod plausible;
mod played;
mod quantity;
mod rates_doubt;
mod reading;
mod rig;
mod rows;
mod scaling;
mod seams;
mod set;
mod span;
mod specific_force;
mod spikes;
pub mod state;
mod still;
mod twin;
mod ulog;
mod ulog_format;
mod ulog_messages;
mod units;

pub use canonical::{Canonical, HEADER_START, Row, columns, csv, write_csv};
pub use error::{FlightsError, LogError, Spot};
pub use finding::Finding;
pub use flight::{Channel, Flight, Role};
pub use held_out::same_file;
pub use jumps::{leave_out_jumps, position_jumps};
pub use known::{KnownRotors, SETTLE_S};
pub use limits::NextFlight;
pub use log_reader::ReadFile;
pub use measured_voltage::MeasuredVoltage;
pub use played::Played;
pub use quantity::Quantity;
pub use rig::{Hold, hold};
pub use set::FlightSet;
pub use span::{Moment, Sparse};
pub use twin::{Comparison, Twin, twin};
