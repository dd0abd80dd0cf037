//! From a thrust stand to a vehicle file: thrust and torque of a rotor, and how its motor follows a command.
//!
//! | room | what it holds |
//! |---|---|
//! | `stand` | the stand file: which logs, which columns, what is held out |
//! | `recorded` | fields of a recording over time |
//! | `table` | one log, a table or a recording: its columns in SI |
//! | `held_out` | whether logs to test on hold what is fitted on |
//! | `plateau` | where a log stands still, and what it reads there |
//! | `coefficient` | T = c_T w^2 and Q = c_Q w^2 from plateaus |
//! | `step` | steps of the command, cut out of a log |
//! | `response` | how a first- and a second-order motor answers a step |
//! | `lag` | the motor that answers all steps best |
//! | `command_map` | the line from the command to the steady speed |
//! | `score` | how well a model does on what was not fitted |
//! | `statics`, `dynamics` | all of the above for the logs of a stand, with scores and findings |
//! | `report` | the result, and its summary on one screen |
//! | `vehicle_file` | the result as tables of a vehicle file |
//! | `error` | what can be wrong |

mod coefficient;
mod command_map;
mod dynamics;
mod error;
mod held_out;
mod lag;
mod plateau;
mod recorded;
mod report;
mod response;
mod score;
mod stand;
mod statics;
mod step;
mod table;
mod vehicle_file;

use std::path::Path;

pub use coefficient::Coefficient;
pub use command_map::CommandLine;
pub use dynamics::{Comparison, Dynamics, Fitted, OneStep, Order};
pub use error::RotorError;
pub use report::RotorReport;
pub use score::{LEVEL, Score};
pub use statics::{Plausibility, Statics};

/// Results of a stand's identification.
#[derive(Debug, Clone)]
pub struct Found {
    /// Everything that was found.
    pub report: RotorReport,
    /// The text of `rotor.toml`: tables of a vehicle file.
    pub tables: String,
    /// The text of `rotor.json`: all figures.
    pub figures: String,
}

/// Fits the rotor and the motor of the stand file at `path`.
pub fn run(path: &Path) -> Result<Found, RotorError> {
    let stand = stand::Stand::read(path)?;
    held_out::check(&stand)?;
    let vehicle = stand.vehicle_file()?;
    let (statics, dynamics) = (statics::fitted(&stand)?, dynamics::fitted(&stand)?);
    let report = RotorReport { name: stand.name, statics, dynamics };
    let tables = vehicle_file::text(&report, vehicle.as_ref());
    let figures = report.json()?;
    Ok(Found { report, tables, figures })
}
