//! The files of a fit: a stand file, a flights file, or both.

use std::path::Path;

use diagnostics::Diagnostic;
use flights::FlightSet;
use inputs::InputFiles;

use super::error::RotorError;
use super::stand::Stand;

/// Files, read.
pub struct Sources {
    /// The stand.
    pub stand: Option<Stand>,
    /// The flights.
    pub flights: Option<FlightSet>,
}

impl Sources {
    /// Reads the files at `paths`; each shows by its tables what it is.
    pub fn read(paths: &[&Path]) -> Result<Self, RotorError> {
        let mut all = Self { stand: None, flights: None };
        let (mut stand_at, mut flights_at) = (None, None);
        for path in paths {
            let is_flights = is_flights_file(path)?;
            let (at, kind) = if is_flights { (&mut flights_at, "flights") } else { (&mut stand_at, "stand") };
            if let Some(first) = at.replace(*path) {
                let (first, second) = (first.display().to_string(), path.display().to_string());
                return Err(RotorError::TwoOfAKind { first, second, kind });
            }
            if is_flights {
                all.flights = Some(FlightSet::load(path)?);
            } else {
                all.stand = Some(Stand::read(path)?);
            }
        }
        Ok(all)
    }
}

/// True if the file has a table that only a flights file has. A file that is no TOML is left to the reader of stands to refuse.
fn is_flights_file(path: &Path) -> Result<bool, RotorError> {
    let text = InputFiles::default().text(path);
    let text = text.map_err(|cause| Diagnostic::unreadable(path.display().to_string(), &cause))?;
    let table: toml::Table = text.parse().unwrap_or_default();
    Ok(["flight", "channels", "next_flight"].iter().any(|key| table.contains_key(*key)))
}
