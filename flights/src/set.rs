//! Reads a flights file and all the logs that it names.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

use diagnostics::Diagnostic;
use inputs::InputFiles;
use toml::Spanned;
use vehicles::Vehicle;
use vehicles::table::Dialect;

use crate::csv_log::Form;
use crate::declaration::{ChannelMap, Declaration, Entry, FlightEntry, Format};
use crate::document::Document;
use crate::error::{FlightsError, LogError, Spot};
use crate::flight::Flight;
use crate::formats;
use crate::held_out;
use crate::log_reader::{LogReader, ReadFile};
use crate::logs::{self, Log, Patterns};
use crate::quantity::Quantity;
use crate::reading::{OtherLogs, Part, Reading};

/// The flights of a flights file, in its order.
///
/// ```
/// use flights::FlightSet;
/// use std::path::Path;
///
/// let text = r#"
///     vehicle = "v.toml"
///     channels.time = { columns = ["t"], unit = "ms" }
///     channels.position = { columns = ["x", "y", "z"], unit = "m" }
///     flight = [{ name = "up", file = "up.csv", role = "fit", trust_units = true }]
/// "#;
/// let read = |path: &Path| {
///     let vehicle = include_bytes!("../../vehicles/hummingbird.toml").to_vec();
///     Ok(if path.ends_with("v.toml") { vehicle } else { b"t,x,y,z\n500,0,0,1\n600,0,0,1.1\n".to_vec() })
/// };
/// let set = FlightSet::parse("flights.toml".as_ref(), text.to_owned(), &read)?;
/// assert_eq!(set.flights[0].position.values[1], [0.0, 0.0, 1.1]);
/// # Ok::<(), flights::FlightsError>(())
/// ```
#[derive(Debug, Clone)]
pub struct FlightSet {
    /// The vehicle file.
    pub vehicle: PathBuf,
    /// The flights.
    pub flights: Vec<Flight>,
    /// Files that were read: the vehicle file and its base. Whoever needs them again reads these bytes.
    pub files: InputFiles,
}

impl FlightSet {
    /// Reads the flights file at `path` and its logs.
    ///
    /// # Errors
    /// As [`FlightSet::parse`], and if a file cannot be read.
    pub fn load(path: &Path) -> Result<Self, FlightsError> {
        let text = InputFiles::default().text(path);
        let text = text.map_err(|cause| Diagnostic::unreadable(path.display().to_string(), &cause))?;
        Self::read(path, text, &inputs::read_bytes, Patterns::Find)
    }

    /// Reads the flights file at `path` with this text; `read` gives the bytes of the vehicle file and of the logs. There are
    /// no folders in which a pattern would find logs: it is a name as any other.
    ///
    /// # Errors
    /// If a key or a name in a log is wrong, values contradict their units, a test flight holds what parameters are
    /// fitted on, or `read` fails.
    pub fn parse(path: &Path, text: String, read: &ReadFile<'_>) -> Result<Self, FlightsError> {
        Self::read(path, text, read, Patterns::Literal)
    }

    fn read(
        path: &Path,
        text: String,
        read: &ReadFile<'_>,
        patterns: Patterns,
    ) -> Result<Self, FlightsError> {
        let (document, files) = (Document::new(path, text), InputFiles::default());
        let declaration: Declaration = document.parse()?;
        let mut errors = check_keys(&document, &declaration.flight);
        let mut logs = Vec::new();
        for (index, entry) in declaration.flight.iter().enumerate() {
            match logs::of_entry(&document, index, entry, patterns) {
                Ok(found) => logs.extend(found),
                Err(error) => errors.push(error),
            }
        }
        errors.extend(check_names(&document, &logs));
        let vehicle = document.resolve("vehicle", &declaration.vehicle).and_then(|path| {
            let place = document.place(&declaration.vehicle.span());
            let vehicle = vehicle(&path, read, &files);
            let vehicle = vehicle.map_err(|cause| FlightsError::Vehicle { place, cause: Box::new(cause) })?;
            Ok((path, vehicle))
        });
        let (vehicle_path, vehicle) = FlightsError::gather_with(vehicle, errors)?;
        let mut reader = LogReader::of(&logs, read);
        let context = Context { document: &document, declaration: &declaration, vehicle: &vehicle };
        let (mut flights, mut parts, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        for log in &logs {
            match context.flight(log, &mut reader) {
                Ok((flight, part)) => {
                    flights.push(flight);
                    parts.push(part);
                }
                Err(error) => errors.push(error),
            }
        }
        FlightsError::gather(errors)?;
        let clashes = held_out::clashes(&flights, &parts, reader.sha256()).into_iter().map(|clash| {
            FlightsError::NotHeldOut {
                place: document.place(&logs[clash.test].entry.get_ref().file.span()),
                test: flights[clash.test].name.clone(),
                fit: flights[clash.fit].name.clone(),
                reason: clash.reason,
            }
        });
        FlightsError::gather(clashes.collect())?;
        Ok(Self { vehicle: vehicle_path, flights, files })
    }
}

/// The vehicle in the file at `path`; what is read becomes part of `files`.
fn vehicle(path: &Path, read: &ReadFile<'_>, files: &InputFiles) -> Result<Vehicle, Diagnostic> {
    let file = path.display().to_string();
    let text = |path: &Path| {
        files.keep(path, read(path)?);
        files.text(path)
    };
    let read = text(path).map_err(|cause| Diagnostic::unreadable(file.clone(), &cause))?;
    let vehicle = Vehicle::parse_with(&read, &file, &text)?;
    match vehicle.rotors.len() {
        4 => Ok(vehicle),
        count => {
            let message = format!("`rotors` has {count} rotors, expected four");
            let help = "measured flights are read for vehicles with four rotors at present; name another vehicle file";
            Err(Diagnostic::in_file(file, message).help(help))
        }
    }
}

/// What is wrong with the values of keys, before any log is read.
fn check_keys(document: &Document, flights: &[Spanned<FlightEntry>]) -> Vec<FlightsError> {
    let mut errors = Vec::new();
    if flights.is_empty() {
        let advice = "add a `[[flight]]` with name, file and role";
        errors.push(document.bad(&(0..0), "flight", "at least one flight", "none", advice));
    }
    for (index, entry) in flights.iter().enumerate() {
        let (entry, key) = (entry.get_ref(), |name: &str| format!("flight.{index}.{name}"));
        if let Some((bound, at, found)) = bad_window(entry) {
            let expected = "0 <= from_s < to_s, in seconds from the log's first sample";
            errors.push(document.bad(&at, key(bound), expected, found, "correct it"));
        }
        for (quantity, delay_s) in &entry.delay_s {
            let number = *delay_s.get_ref();
            if *quantity == Quantity::Time || !number.is_finite() {
                let expected = "a finite number of seconds for a channel other than time";
                let key = key(&format!("delay_s.{quantity}"));
                errors.push(document.bad(&delay_s.span(), key, expected, number, "correct it"));
            }
        }
    }
    errors
}

/// Names that several flights have.
fn check_names(document: &Document, logs: &[Log<'_>]) -> Vec<FlightsError> {
    let mut names = BTreeSet::new();
    let again = logs.iter().filter(|log| !names.insert(log.name.as_str()));
    let refused = |log: &Log<'_>| {
        let (key, found) = (format!("flight.{}.name", log.index), format!("\"{}\" a second time", log.name));
        document.bad(&log.name_span(), key, "the name of one flight", found, "give another")
    };
    again.map(refused).collect()
}

/// The bound of a flight's part that cannot be meant, where it stands, and its value.
fn bad_window(entry: &FlightEntry) -> Option<(&'static str, Range<usize>, f64)> {
    let from_s = entry.from_s.as_ref().map_or(0.0, |from_s| *from_s.get_ref());
    let to_s = entry.to_s.as_ref().map_or(f64::INFINITY, |to_s| *to_s.get_ref());
    match (&entry.from_s, &entry.to_s) {
        (Some(from), _) if !(from_s >= 0.0 && from_s.is_finite()) => Some(("from_s", from.span(), from_s)),
        (_, Some(to)) if to_s.is_nan() || to_s <= from_s => Some(("to_s", to.span(), to_s)),
        _ => None,
    }
}

struct Context<'a> {
    document: &'a Document,
    declaration: &'a Declaration,
    vehicle: &'a Vehicle,
}

impl Context<'_> {
    /// Reads a flight of the file.
    fn flight(&self, declared: &Log<'_>, reader: &mut LogReader<'_>) -> Result<(Flight, Part), FlightsError> {
        let (entry, file) = (declared.entry.get_ref(), &declared.file);
        let broken = |cause| FlightsError::Log {
            place: self.document.place(&entry.file.span()),
            flight: declared.name.clone(),
            file: file.clone(),
            channel: None,
            cause,
        };
        // Those of the file, overridden by those of the flight.
        let mut channels = self.declaration.channels.clone();
        channels.extend(entry.channels.clone());
        let bytes = reader.read(file).map_err(|error| broken(LogError::Unreadable(error)))?;
        let format = entry.format.or(self.declaration.format).unwrap_or_else(|| formats::guess(file, &bytes));
        if entry.csv.is_some() && format != Format::Csv {
            let expected = "a CSV file, whose form it says";
            let cause = LogError::unexpected(Spot::Key("csv"), expected, "another format", "remove it");
            return Err(broken(cause));
        }
        let time = channels.get(&Quantity::Time).map(Spanned::get_ref);
        let of_log = channels.values().map(Spanned::get_ref).filter(|channel| channel.file.is_none());
        let form = self.form(entry, time, of_log.collect());
        let clock = entry.time.or(self.declaration.time);
        let log = formats::parse(bytes, format, &form, clock).map_err(broken)?;
        let others = self.other_logs(declared, &channels, reader)?;
        Reading {
            document: self.document,
            vehicle: self.vehicle,
            name: &declared.name,
            entry,
            at: declared.entry.span(),
            format,
            file,
            channels,
            others,
        }
        .flight(log.as_ref())
    }

    /// The form of a CSV file of the flight.
    fn form<'b>(
        &'b self,
        entry: &'b FlightEntry,
        time: Option<&'b Entry>,
        channels: Vec<&'b Entry>,
    ) -> Form<'b> {
        const PLAIN: Dialect = Dialect { header_line: None, header: None, delimiter: None, decimal: None };
        let dialect = entry.csv.as_ref().or(self.declaration.csv.as_ref()).unwrap_or(&PLAIN);
        Form { dialect, recording: entry.recording, time, channels }
    }

    /// The logs of the channels that are in another file than the flight's.
    fn other_logs(
        &self,
        declared: &Log<'_>,
        channels: &ChannelMap,
        reader: &mut LogReader<'_>,
    ) -> Result<OtherLogs, FlightsError> {
        let entry = declared.entry.get_ref();
        let of_flight = channels.get(&Quantity::Time).map(Spanned::get_ref);
        let mut others = OtherLogs::new();
        for (quantity, channel) in channels {
            let (place, channel) = (channel.span(), channel.get_ref());
            let Some(file) = &channel.file else { continue };
            let path = self.document.resolve(&format!("channels.{quantity}.file"), file)?;
            let broken = |cause| FlightsError::Log {
                place: self.document.place(&place),
                flight: declared.name.clone(),
                file: path.clone(),
                channel: Some(*quantity),
                cause,
            };
            let bytes = reader.read_beside(&path).map_err(|error| broken(LogError::Unreadable(error)))?;
            let format = formats::guess(&path, &bytes);
            let form = self.form(entry, channel.time.as_deref().or(of_flight), vec![channel]);
            let form = Form { recording: None, ..form };
            let clock = entry.time.or(self.declaration.time).filter(|_| format == Format::Mcap);
            others.insert(*quantity, formats::parse(bytes, format, &form, clock).map_err(broken)?);
        }
        Ok(others)
    }
}
