//! Notes on flights beside their errors: what the reader left out or doubts, and faults of channels.

use flights::FlightSet;
use identify::run::doubts;
use serde_json::{Value, json};
use std::fmt;

/// Notes on the flights of a set; their text has a line for each note.
///
/// ```
/// use report::validate::Notes;
///
/// let notes = Notes { flights: vec![("loop".to_owned(), vec!["position: 1 gaps".to_owned()])] };
/// assert_eq!(notes.to_string(), "note: loop: position: 1 gaps\n");
/// ```
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct Notes {
    /// Names of the flights, each with its notes.
    pub flights: Vec<(String, Vec<String>)>,
}

impl Notes {
    /// Notes on `set`: assumptions, the notes of the reader, and faults of channels against the vehicle of the flights file, such as
    /// motors in another order.
    #[must_use]
    pub fn of(set: &FlightSet) -> Self {
        // A vehicle file that cannot be read is told by the validation itself.
        let faults = doubts(set).unwrap_or_default();
        let of_flight = |flight: &flights::Flight| {
            let faults = faults.iter().filter(|fault| fault.flight == flight.name);
            let faults = faults.map(|fault| {
                format!("{} ({}): {}; {}", fault.channel, fault.kind, fault.finding(), fault.advice)
            });
            let notes = flight.assumed.iter().chain(&flight.notes).cloned().chain(faults);
            (flight.name.clone(), notes.collect())
        };
        Self { flights: set.flights.iter().map(of_flight).collect() }
    }

    /// Adds the notes to the flights of `errors`, which are named in its `flights`.
    pub fn add_to(&self, errors: &mut Value) {
        for (flight, notes) in &self.flights {
            if let Some(entry) = errors["flights"].get_mut(flight.as_str()) {
                entry["notes"] = json!(notes);
            }
        }
    }
}

impl fmt::Display for Notes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shared: Vec<(&str, Vec<&str>)> = Vec::new();
        for (flight, notes) in &self.flights {
            for note in notes {
                match shared.iter_mut().find(|(known, _)| known == note) {
                    Some(known) => known.1.push(flight),
                    None => shared.push((note, vec![flight])),
                }
            }
        }
        for (note, flights) in shared {
            let is_of_all = flights.len() == self.flights.len() && flights.len() > 1;
            let of = if is_of_all { "all flights".to_owned() } else { flights.join(", ") };
            writeln!(f, "note: {of}: {note}")?;
        }
        Ok(())
    }
}
