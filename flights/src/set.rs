//! Reads a flights file and all the logs that it names.

use std::path::{Path, PathBuf};

use toml::Spanned;
use vehicles::{Vehicle, VehicleError};

use crate::declaration::{ChannelMap, Declaration, FlightEntry};
use crate::document::{Bad, Document};
use crate::error::FlightsError;
use crate::flight::Flight;
use crate::formats;
use crate::held_out;
use crate::reading::{Part, Reading};

/// The flights of a flights file, in its order.
#[derive(Debug, Clone)]
pub struct FlightSet {
    /// The vehicle file.
    pub vehicle: PathBuf,
    /// The flights.
    pub flights: Vec<Flight>,
}

impl FlightSet {
    /// Reads the flights file at `path` and its logs.
    ///
    /// # Errors
    /// As [`FlightSet::parse`], and if a file cannot be read.
    pub fn load(path: &Path) -> Result<Self, FlightsError> {
        let text = vehicles::text::read(path)
            .map_err(|cause| FlightsError::Unreadable { file: path.display().to_string(), cause })?;
        Self::parse(path, text, &vehicles::text::read_log)
    }

    /// Reads the flights file at `path` with this text; `read` gives the bytes of the vehicle file and of the logs.
    ///
    /// # Errors
    /// If a key or a name in a log is wrong, values contradict their units, a test flight holds what parameters are
    /// fitted on, or `read` fails.
    pub fn parse(path: &Path, text: String, read: &ReadFile<'_>) -> Result<Self, FlightsError> {
        let document = Document::new(path, text);
        let declaration: Declaration = document.parse()?;
        let vehicle_path = document.resolve("vehicle", &declaration.vehicle)?;
        let vehicle = vehicle(&vehicle_path, read).map_err(|cause| FlightsError::Vehicle {
            place: document.place(&declaration.vehicle.span()),
            cause: Box::new(cause),
        })?;
        check_names(&document, &declaration.flight)?;
        let context = Context { document: &document, declaration: &declaration, vehicle: &vehicle, read };
        let mut parts = Vec::new();
        let mut flights = Vec::new();
        for (index, entry) in declaration.flight.iter().enumerate() {
            let (flight, part) = context.flight(index, entry)?;
            flights.push(flight);
            parts.push(part);
        }
        held_out::check(&flights, &parts).map_err(|clash| FlightsError::NotHeldOut {
            place: document.place(&declaration.flight[clash.test].get_ref().file.span()),
            test: flights[clash.test].name.clone(),
            fit: flights[clash.fit].name.clone(),
            reason: clash.reason,
        })?;
        Ok(Self { vehicle: vehicle_path, flights })
    }
}

/// What gives the bytes of a file.
pub type ReadFile<'a> = dyn Fn(&Path) -> std::io::Result<Vec<u8>> + 'a;

fn vehicle(path: &Path, read: &ReadFile<'_>) -> Result<Vehicle, VehicleError> {
    let file = path.display().to_string();
    let as_text = |bytes| {
        String::from_utf8(bytes).map_err(|error| std::io::Error::new(std::io::ErrorKind::InvalidData, error))
    };
    match read(path).and_then(as_text) {
        Ok(text) => Vehicle::parse(&text, &file),
        Err(cause) => Err(VehicleError::Unreadable { file, cause }),
    }
}

/// Refuses a file without flights and a name that two flights have.
fn check_names(document: &Document, flights: &[Spanned<FlightEntry>]) -> Result<(), FlightsError> {
    if flights.is_empty() {
        let advice = "add a `[[flight]]` with name, file and role";
        return Err(document.bad(
            &(0..0),
            "flight",
            Bad { expected: "at least one flight", found: "none", advice },
        ));
    }
    for (index, entry) in flights.iter().enumerate() {
        let name = &entry.get_ref().name;
        if flights[..index].iter().any(|other| other.get_ref().name.get_ref() == name.get_ref()) {
            let found = format!("\"{}\" a second time", name.get_ref());
            let bad = Bad { expected: "a name of its own", found: &found, advice: "give another" };
            return Err(document.bad(&name.span(), &format!("flight[{index}].name"), bad));
        }
    }
    Ok(())
}

struct Context<'a> {
    document: &'a Document,
    declaration: &'a Declaration,
    vehicle: &'a Vehicle,
    read: &'a ReadFile<'a>,
}

impl Context<'_> {
    /// Reads the flight `index` of the file.
    fn flight(&self, index: usize, spanned: &Spanned<FlightEntry>) -> Result<(Flight, Part), FlightsError> {
        let entry = spanned.get_ref();
        let key = |name: &str| format!("flight[{index}].{name}");
        self.check_window(entry, &key)?;
        let file = self.document.resolve(&key("file"), &entry.file)?;
        let broken = |reason| FlightsError::Log {
            place: self.document.place(&entry.file.span()),
            flight: entry.name.get_ref().clone(),
            file: file.clone(),
            reason,
        };
        let channels = self.channels(entry);
        let bytes = (self.read)(&file)
            .map_err(|error| broken(format!("cannot read it: {error}; check the path and its variables")))?;
        let format =
            entry.format.or(self.declaration.format).unwrap_or_else(|| formats::guess(&file, &bytes));
        let time = channels.get(&crate::Quantity::Time).map(Spanned::get_ref);
        let log = formats::parse(bytes, format, time).map_err(broken)?;
        Reading {
            document: self.document,
            vehicle: self.vehicle,
            entry,
            at: spanned.span(),
            format,
            file: &file,
            channels,
        }
        .flight(log.as_ref())
    }

    /// The channels of the file, overridden by those of the flight.
    fn channels(&self, entry: &FlightEntry) -> ChannelMap {
        let mut channels = self.declaration.channels.clone();
        channels.extend(entry.channels.clone());
        channels
    }

    fn check_window(&self, entry: &FlightEntry, key: &dyn Fn(&str) -> String) -> Result<(), FlightsError> {
        let from_s = entry.from_s.as_ref().map_or(0.0, |from_s| *from_s.get_ref());
        let to_s = entry.to_s.as_ref().map_or(f64::INFINITY, |to_s| *to_s.get_ref());
        let (name, at, found) = match (&entry.from_s, &entry.to_s) {
            (Some(from), _) if !(from_s >= 0.0 && from_s.is_finite()) => ("from_s", from.span(), from_s),
            (_, Some(to)) if to_s.is_nan() || to_s <= from_s => ("to_s", to.span(), to_s),
            _ => return Ok(()),
        };
        let expected = "0 <= from_s < to_s, in seconds from the log's first sample";
        let bad = Bad { expected, found: &found.to_string(), advice: "correct it" };
        Err(self.document.bad(&at, &key(name), bad))
    }
}
