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
}

impl VehicleError {
    /// Where in the file the fault is, or `None` if the file could not be read.
    pub fn place(&self) -> Option<&Place> {
        match self {
            VehicleError::Unreadable { .. } => None,
            VehicleError::Syntax { place, .. }
            | VehicleError::UnknownKey { place, .. }
            | VehicleError::MissingKey { place, .. }
            | VehicleError::BadValue { place, .. } => Some(place),
        }
    }
}
