//! Reasons why flights cannot be used for identification.

use crate::data::fault::Fault;
use diagnostics::Diagnostic;
use flights::{Flight, FlightSet, Role};

/// Reason why flights cannot be used for identification.
///
/// ```
/// let vehicle = "../vehicles/hummingbird.toml".into();
/// let set = flights::FlightSet { vehicle, flights: Vec::new(), next_flight: Default::default(), files: Default::default() };
/// let error = identify::run::identify(&set, &mut |_| ()).unwrap_err();
/// assert!(error.to_string().starts_with("no flight with role \"fit\" can be used: there is none."));
/// ```
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// The vehicle file.
    #[error(fmt = std::fmt::Display::fmt)]
    Vehicle(#[from] Diagnostic),
    /// A role that no flight has.
    #[error("no flight with role \"{role}\" can be used: {reason}")]
    NoFlight {
        /// The role.
        role: &'static str,
        /// Reasons, flight by flight.
        reason: String,
    },
}

impl IdentifyError {
    /// The fault of the vehicle file, with its place and advice.
    ///
    /// ```
    /// use diagnostics::Diagnostic;
    /// use identify::run::IdentifyError;
    ///
    /// let error = IdentifyError::from(Diagnostic::in_file("bird.toml", "no rotors"));
    /// assert_eq!(error.diagnostic().unwrap().file, "bird.toml");
    /// ```
    #[must_use]
    pub fn diagnostic(&self) -> Option<&Diagnostic> {
        match self {
            Self::Vehicle(fault) => Some(fault),
            Self::NoFlight { .. } => None,
        }
    }
}

impl From<IdentifyError> for diagnostics::Error {
    fn from(error: IdentifyError) -> Self {
        Self::new(error)
    }
}

/// The error of a role that has no flight besides those with faults; `None` if none has one.
pub fn faulty(faults: &[Fault], set: &FlightSet) -> Option<IdentifyError> {
    let of_role = |role: Role| {
        let names = set.flights.iter().filter(|flight| flight.role == role).map(|flight| &flight.name);
        names.map(|name| faults.iter().filter(|fault| fault.flight == *name).collect()).collect()
    };
    let without: Vec<(Role, Vec<Vec<&Fault>>)> =
        [Role::Fit, Role::Test].map(|role| (role, of_role(role))).into();
    let (role, faults) =
        without.into_iter().find(|(_, flights)| flights.iter().all(|faults| !faults.is_empty()))?;
    let one = |fault: &&Fault| {
        format!(
            "fault of flight `{}`: {}: {}; {}",
            fault.flight,
            fault.channel,
            fault.finding(),
            fault.advice
        )
    };
    let reason = faults.iter().flatten().map(one).collect::<Vec<_>>().join("; ");
    Some(IdentifyError::NoFlight { role: role.name(), reason })
}

/// The error of `role`, none of whose flights can be used for these reasons.
pub fn no_flight(role: Role, reasons: &[(&Flight, String)]) -> IdentifyError {
    let one = |(flight, reason): &(&Flight, String)| {
        let notes = if flight.notes.is_empty() {
            String::new()
        } else {
            format!(" (notes: {})", flight.notes.join("; "))
        };
        format!("flight `{}`: {reason}{notes}", flight.name)
    };
    let of_role = reasons.iter().filter(|(flight, _)| flight.role == role).map(one);
    let reason = of_role.collect::<Vec<_>>().join("\n  ");
    let none = "there is none. Add flights, or give one a part of another's time by `from_s` and `to_s`";
    let reason = if reason.is_empty() { none.to_owned() } else { reason };
    IdentifyError::NoFlight { role: role.name(), reason }
}
