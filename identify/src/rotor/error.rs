//! Errors of a stand file, of its logs, or of the folder of the results.

use diagnostics::Diagnostic;
use flights::FlightsError;
use recorder::RecordingError;
use vehicles::table::TableError;

/// Reason why a rotor could not be identified.
///
/// ```
/// use identify::rotor::RotorError;
///
/// let error = identify::rotor::run("nowhere.toml".as_ref()).unwrap_err();
/// assert!(matches!(&error, RotorError::File(_)) && error.to_string().contains("nowhere.toml"));
/// ```
#[derive(Debug, thiserror::Error)]
pub enum RotorError {
    /// A file cannot be read, is not TOML, or has an invalid key or value; also the vehicle file that the rest
    /// is taken from.
    #[error(fmt = std::fmt::Display::fmt)]
    File(#[from] Diagnostic),
    /// A flights file or one of its logs cannot be used.
    #[error(transparent)]
    Flights(#[from] FlightsError),
    /// Two files of one kind.
    #[error(
        "{first} and {second} are both {kind} files; expected one stand file, one flights file, or one of each"
    )]
    TwoOfAKind {
        /// The first.
        first: String,
        /// The second.
        second: String,
        /// Their kind.
        kind: &'static str,
    },
    /// A log is not a table.
    #[error("{file}: {cause}")]
    Table {
        /// The log.
        file: String,
        /// The place, and advice.
        #[source]
        cause: TableError,
    },
    /// A log that is to be a recording cannot be read as one.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A recording does not have a topic or a field that the stand file names.
    #[error("{file}: {cause}; choose {} from this list", if matches!(cause, RecordingError::UnknownTopic { .. }) { "`topic`" } else { "`field`" })]
    NoField {
        /// The log.
        file: String,
        /// The missing topic or field, and those that exist.
        #[source]
        cause: RecordingError,
    },
    /// A recording states another unit than the stand file.
    #[error(
        "{file}: the field `{field}` of {topic} is recorded in {recorded}, the stand file says {said}; state the unit of the \
         recording as `{key}.unit`"
    )]
    Unit {
        /// The log.
        file: String,
        /// The topic.
        topic: String,
        /// The field.
        field: String,
        /// The unit that the recording states.
        recorded: String,
        /// The unit that the stand file states.
        said: String,
        /// The column's key in the stand file.
        key: &'static str,
    },
    /// A log does not have a column that the stand file names.
    #[error("{file}: no column `{column}`; it has {}; choose from this list", known.join(", "))]
    NoColumn {
        /// The log.
        file: String,
        /// The column.
        column: String,
        /// The columns there are.
        known: Vec<String>,
    },
    /// A row or a sample without a time, or with one before that of the last.
    #[error("{file}: {place} {found}; check its unit, or cut the log")]
    Time {
        /// The log.
        file: String,
        /// The line and the column of a table, or the sample of a recording.
        place: String,
        /// Fault of its time.
        found: &'static str,
    },
    /// A log to test on holds rows that are fitted on.
    #[error(
        "{test}: this log with role \"test\" is not held out from {fit} with role \"fit\": {reason}; give another log, or hold \
         out a part of this one by `held_out`"
    )]
    NotHeldOut {
        /// The log to test on.
        test: String,
        /// The log to fit on.
        fit: String,
        /// Relation of the two logs.
        reason: String,
    },
    /// There is too little to fit, or a log's rows are too few or too far apart to show a step.
    #[error("{what}: expected {expected}, found {found}; {advice}")]
    TooLittle {
        /// Quantity to be fitted, or the log.
        what: String,
        /// Amount that is needed.
        expected: String,
        /// Amount that was found.
        found: String,
        /// Advice.
        advice: &'static str,
    },
    /// The figures could not be written as JSON.
    #[error("cannot write the figures as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

impl From<RotorError> for diagnostics::Error {
    fn from(error: RotorError) -> Self {
        Self::new(error)
    }
}

impl RotorError {
    /// The fault of a file, with its place and advice.
    ///
    /// ```
    /// let error = identify::rotor::run("nowhere.toml".as_ref()).unwrap_err();
    /// assert_eq!(error.diagnostic().unwrap().file, "nowhere.toml");
    /// ```
    #[must_use]
    pub fn diagnostic(&self) -> Option<&Diagnostic> {
        match self {
            Self::File(fault) => Some(fault),
            Self::Flights(error) => error.diagnostic(),
            Self::TwoOfAKind { .. }
            | Self::Table { .. }
            | Self::Recording(_)
            | Self::NoField { .. }
            | Self::Unit { .. }
            | Self::NoColumn { .. }
            | Self::Time { .. }
            | Self::NotHeldOut { .. }
            | Self::TooLittle { .. }
            | Self::Json(_) => None,
        }
    }

    pub(super) fn too_little(
        what: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
        advice: &'static str,
    ) -> Self {
        Self::TooLittle { what: what.into(), expected: expected.into(), found: found.to_string(), advice }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use diagnostics::Error;

    #[test]
    fn the_fault_of_a_file_is_handed_on_with_its_place() {
        let fault = Diagnostic::in_file("bird.toml", "no rotors").help("add [[rotors]]");
        for error in [RotorError::from(fault.clone()), FlightsError::from(fault.clone()).into()] {
            assert_eq!(error.diagnostic(), Some(&fault));
            let text = error.to_string();
            let error = Error::from(error);
            assert!(error.is_input() && error.diagnostic() == Some(&fault), "{error}");
            assert_eq!(error.with_causes(), text);
        }
    }
}
