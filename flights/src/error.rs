//! What can be wrong with a flights file or with a log that it names.

use std::path::PathBuf;

use diagnostics::Place;
use vehicles::VehicleError;

use crate::plausible::Finding;

/// Why flights cannot be used: which file, where, what was expected and found, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum FlightsError {
    /// The flights file cannot be read at all.
    #[error("{file}: cannot read this file: {cause}; check the path and that it is UTF-8 text")]
    Unreadable {
        /// The path as given.
        file: String,
        /// What the operating system said.
        #[source]
        cause: std::io::Error,
    },
    /// The text is not TOML, or has a key or a type that no flights file has.
    #[error("{place}: {message}; correct this line (docs/flights.md has the format)")]
    Syntax {
        /// Where the parser stopped.
        place: Place,
        /// What the parser said.
        message: String,
    },
    /// A key holds something that cannot be meant.
    #[error("{place}: `{key}`: expected {expected}, found {found}; {advice}")]
    BadValue {
        /// Where the value stands.
        place: Place,
        /// The whole dotted key.
        key: String,
        /// What would be accepted.
        expected: &'static str,
        /// What the file says.
        found: String,
        /// What to do.
        advice: &'static str,
    },
    /// The vehicle file is not usable.
    #[error("{place}: `vehicle`: {cause}")]
    Vehicle {
        /// Where the flights file names it.
        place: Place,
        /// What is wrong with it.
        #[source]
        cause: Box<VehicleError>,
    },
    /// A log cannot be read, or does not have what the flights file asks of it.
    #[error("{place}: flight `{flight}`, log {file}: {reason}")]
    Log {
        /// The line of the flights file that asks.
        place: Place,
        /// The flight's name.
        flight: String,
        /// The log.
        file: PathBuf,
        /// What is wrong and what to do.
        reason: String,
    },
    /// Measured values contradict their declared units, frames or order.
    #[error(
        "{place}: flight `{flight}`, log {file}: the values contradict what the file declares:{}\n  \
         correct the unit, frame or order, or set `trust_units = true` for this flight",
        list(findings)
    )]
    Implausible {
        /// The line of the flight.
        place: Place,
        /// The flight's name.
        flight: String,
        /// The log.
        file: PathBuf,
        /// What contradicts.
        findings: Vec<Finding>,
    },
    /// A test flight holds samples of a flight that parameters are fitted on.
    #[error(
        "{place}: flight `{test}` with role \"test\" is not held out from flight `{fit}` with role \"fit\": {reason}; give \
         them parts that do not overlap by `from_s` and `to_s`, name another log, or take one of them out"
    )]
    NotHeldOut {
        /// The line that names the test flight's log.
        place: Place,
        /// The test flight's name.
        test: String,
        /// The fit flight's name.
        fit: String,
        /// What they have in common.
        reason: String,
    },
    /// A canonical file cannot be written.
    #[error("{path}: cannot write this file: {reason}; check the folder and the space left")]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A flight has too little for what is asked of it.
    #[error("flight `{flight}`: {reason}")]
    TooLittle {
        /// The flight's name.
        flight: String,
        /// What is missing and what to do.
        reason: String,
    },
}

fn list(findings: &[Finding]) -> String {
    findings.iter().map(|finding| format!("\n  - {}", finding.message)).collect()
}
