//! What can be wrong with a vehicle file: which file, where, which key, what was expected and found.

use diagnostics::Place;

/// Why a vehicle file was refused.
#[derive(Debug, thiserror::Error)]
pub enum VehicleError {
    /// The file could not be read at all.
    #[error("{file}: cannot read this file: {cause}; check the path and that it is UTF-8 text")]
    Unreadable {
        /// The path as given.
        file: String,
        /// What the operating system said.
        #[source]
        cause: std::io::Error,
    },
    /// The text is not TOML.
    #[error("{place}: not valid TOML: {message}")]
    Syntax {
        /// Where the parser stopped.
        place: Place,
        /// What the parser said.
        message: String,
    },
    /// A key that no vehicle file has.
    #[error("{place}: unknown key `{key}`: expected one of {expected}; remove it, or correct its spelling")]
    UnknownKey {
        /// Where the key stands.
        place: Place,
        /// The whole dotted key.
        key: String,
        /// The keys allowed there.
        expected: String,
    },
    /// A required key is absent.
    #[error("{place}: missing key `{key}`: expected {expected}, found nothing; add it to this table")]
    MissingKey {
        /// Where the table begins that should hold the key.
        place: Place,
        /// The whole dotted key.
        key: String,
        /// What the key should hold.
        expected: String,
    },
    /// A key holds something that cannot be meant: wrong type, wrong unit or a number that is not physical.
    #[error("{place}: `{key}`: expected {expected}, found {found}; correct this value")]
    BadValue {
        /// Where the value stands.
        place: Place,
        /// The whole dotted key.
        key: String,
        /// What would be accepted.
        expected: String,
        /// What the file says.
        found: String,
    },
    /// Several faults, in the order of the file's tables.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Several(Vec<VehicleError>),
}

impl VehicleError {
    /// Where in the file the fault is, the first of several, or `None` if the file could not be read.
    pub fn place(&self) -> Option<&Place> {
        match self {
            VehicleError::Unreadable { .. } => None,
            VehicleError::Syntax { place, .. }
            | VehicleError::UnknownKey { place, .. }
            | VehicleError::MissingKey { place, .. }
            | VehicleError::BadValue { place, .. } => Some(place),
            VehicleError::Several(faults) => faults.first()?.place(),
        }
    }
}

/// The faults of a file, gathered so that one look shows all of them.
#[derive(Debug, Default)]
pub struct Faults(Vec<VehicleError>);

impl Faults {
    /// What was read; none where it is faulty, which is kept.
    pub fn keep<T>(&mut self, read: Result<T, VehicleError>) -> Option<T> {
        read.map_err(|fault| self.0.push(fault)).ok()
    }

    /// What all of `read` came to; none where some are faulty.
    pub fn keep_all<T>(&mut self, read: impl IntoIterator<Item = Result<T, VehicleError>>) -> Option<Vec<T>> {
        // All are read before the first that is faulty counts.
        let read: Vec<Option<T>> = read.into_iter().map(|one| self.keep(one)).collect();
        read.into_iter().collect()
    }

    /// `value`, which is there unless there were faults.
    ///
    /// # Errors
    /// The faults there were.
    pub fn finish<T>(mut self, value: Option<T>) -> Result<T, VehicleError> {
        match (value, self.0.len()) {
            (Some(value), 0) => Ok(value),
            (_, 1) => Err(self.0.remove(0)),
            _ => Err(VehicleError::Several(self.0)),
        }
    }
}
