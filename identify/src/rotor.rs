//! From a thrust stand or flights to a vehicle file: thrust and torque of a rotor, and how its motor follows a command.
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
//! | `flown` | the same figures from flights that log rotor speeds |
//! | `agreement` | whether a stand and flights agree |
//! | `sources` | the files of a fit: a stand file, a flights file, or both |
//! | `report`, `flown_report` | the result, and its summary on one screen |
//! | `vehicle_file` | the result as tables of a vehicle file |
//! | `error` | what can be wrong |

mod agreement;
mod coefficient;
mod command_map;
mod dynamics;
mod error;
mod flown;
mod flown_report;
mod held_out;
mod lag;
mod plateau;
mod recorded;
mod report;
mod response;
mod score;
mod sources;
mod stand;
mod statics;
mod step;
mod table;
mod vehicle_file;

use std::path::Path;

use flights::FlightSet;
use vehicles::Vehicle;

pub use agreement::Agreement;
pub use coefficient::Coefficient;
pub use command_map::CommandLine;
pub use dynamics::{Comparison, Dynamics, Fitted, OneStep, Order};
pub use error::RotorError;
pub use flown::{
    Figure, Flown, FlownCoefficient, FlownCoefficients, FlownMotor, HeldOut, LagFigures, MotorFigures,
    RotorMotor,
};
pub use report::RotorReport;
pub use score::{LEVEL, Score};
pub use statics::{Plausibility, Statics};

use sources::Sources;
use stand::{Stand, VehicleFile, short_name};

/// Results of an identification of a rotor.
#[derive(Debug, Clone)]
pub struct Found {
    /// Everything that was found.
    pub report: RotorReport,
    /// The text of `rotor.toml`: tables of a vehicle file.
    pub tables: String,
    /// The text of `rotor.json`: all figures.
    pub figures: String,
}

/// Fits the rotor and the motor of the stand file or flights file at `path`.
///
/// # Errors
/// As [`run_files`].
pub fn run(path: &Path) -> Result<Found, RotorError> {
    run_files(&[path])
}

/// Fits the rotor and the motor of a stand file, of a flights file, or of one of each, which are then compared.
///
/// # Errors
/// If a file or a log cannot be read, has too little to fit, or two files of one kind are given.
pub fn run_files(paths: &[&Path]) -> Result<Found, RotorError> {
    let Sources { stand, flights } = Sources::read(paths)?;
    found(stand, flights.as_ref())
}

/// Fits the rotors and the motors of flights.
///
/// ```
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml").into();
/// let set = flights::FlightSet { vehicle, flights: Vec::new(), next_flight: Default::default(), files: Default::default() };
/// let error = identify::rotor::run_flights(&set).unwrap_err();
/// assert!(error.to_string().contains("no flight with role \"fit\""));
/// ```
///
/// # Errors
/// If the vehicle file cannot be read, or no flight to fit on has rotor speeds with commands or motion.
pub fn run_flights(set: &FlightSet) -> Result<Found, RotorError> {
    found(None, Some(set))
}

fn found(stand: Option<Stand>, flights: Option<&FlightSet>) -> Result<Found, RotorError> {
    let (mut statics, mut dynamics, mut vehicle, mut flown) = (None, None, None, None);
    if let Some(stand) = &stand {
        held_out::check(stand)?;
        vehicle = stand.vehicle_file()?;
        (statics, dynamics) = (statics::fitted(stand)?, dynamics::fitted(stand)?);
    }
    if let Some(set) = flights {
        let file = VehicleFile {
            name: short_name(&set.vehicle),
            vehicle: Vehicle::load_from(&set.files, &set.vehicle)?,
        };
        flown = Some(flown::fitted(set, &file.vehicle)?);
        vehicle = Some(file);
    }
    let agreement = match (&stand, &flown) {
        (Some(stand), Some(flown)) => agreement::compared(stand, statics.as_ref(), dynamics.as_ref(), flown),
        _ => Vec::new(),
    };
    let of_vehicle = || vehicle.as_ref().map(|file| file.vehicle.name.clone()).unwrap_or_default();
    let name = stand.map_or_else(of_vehicle, |stand| stand.name);
    let report = RotorReport { name, statics, dynamics, flights: flown, agreement };
    let tables = vehicle_file::text(&report, vehicle.as_ref());
    let figures = report.json()?;
    Ok(Found { report, tables, figures })
}
