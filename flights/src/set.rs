//! Reads a flights file and all the logs that it names.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

use diagnostics::{Diagnostic, NotOneLine, printable_line, require_line};
use inputs::InputFiles;
use toml::Spanned;
use vehicles::Vehicle;

use crate::declaration::{Declaration, FlightEntry};
use crate::document::Document;
use crate::error::FlightsError;
use crate::flight::Flight;
use crate::held_out;
use crate::limits::NextFlight;
use crate::log_reader::{LogReader, ReadFile};
use crate::logs::{self, Log, Patterns};
use crate::opening::Opening;
use crate::quantity::Quantity;

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
    /// Limits of the flight that an identification proposes.
    pub next_flight: NextFlight,
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
    /// If a key or a name in a log is wrong, or values contradict their units. If a test flight holds samples
    /// that parameters are fitted on, or `read` fails.
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
        errors.extend(check_limits(&document, &declaration));
        let mut logs = Vec::new();
        for (index, entry) in declaration.flight.iter().enumerate() {
            match logs::of_entry(&document, index, entry, patterns) {
                Ok(found) => logs.extend(found),
                Err(error) => errors.push(error),
            }
        }
        errors.extend(check_names(&document, &logs));
        let (written, at) = (declaration.vehicle.get_ref(), declaration.vehicle.span());
        let vehicle = document.resolve("vehicle", written, &at).and_then(|path| {
            let place = document.place(&at);
            let vehicle = vehicle(&path, read, &files);
            let vehicle = vehicle.map_err(|cause| FlightsError::Vehicle { place, cause: Box::new(cause) })?;
            Ok((path, vehicle))
        });
        let (vehicle_path, vehicle) = FlightsError::gather_with(vehicle, errors)?;
        let mut reader = LogReader::of(&logs, read);
        let opening = Opening { document: &document, declaration: &declaration, vehicle: &vehicle, patterns };
        let (mut flights, mut parts, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        for log in &logs {
            match opening.flight(log, &mut reader) {
                Ok((flight, part)) => {
                    flights.push(flight);
                    parts.push(part);
                }
                Err(error) => errors.push(error),
            }
        }
        FlightsError::gather(errors)?;
        let of = |at: usize| (flights[at].name.clone(), flights[at].role.name());
        let clashes = held_out::clashes(&flights, &parts, reader.sha256()).into_iter().map(|clash| {
            FlightsError::NotHeldOut {
                place: document.place(&logs[clash.held_out].entry.get_ref().file.span()),
                flight: of(clash.held_out),
                other: of(clash.used),
                reason: clash.reason,
            }
        });
        FlightsError::gather(clashes.collect())?;
        let next_flight =
            declaration.next_flight.as_ref().map_or_else(NextFlight::default, |it| *it.get_ref());
        Ok(Self { vehicle: vehicle_path, flights, next_flight, files })
    }
}

/// The vehicle in the file at `path`; the bytes that are read become part of `files`.
fn vehicle(path: &Path, read: &ReadFile<'_>, files: &InputFiles) -> Result<Vehicle, Diagnostic> {
    let file = path.display().to_string();
    let text = |path: &Path| {
        files.keep(path, read(path)?);
        files.text(path)
    };
    let read = text(path).map_err(|cause| Diagnostic::unreadable(file.clone(), &cause))?;
    Vehicle::parse_with(&read, &file, &text)
}

/// Returns the faults in the values of keys, before any log is read.
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
            let advice = "leave both out for the whole log";
            errors.push(document.bad(&at, key(bound), expected, found, advice));
        }
        if let Some(recording) = entry.recording.filter(|_| entry.file.get_ref().are_parts()) {
            let (expected, found) =
                ("one `file`, of which it chooses a recording", format!("{recording} beside a list"));
            let advice = "remove it, or cut the recording out of its file";
            errors.push(document.bad(&entry.file.span(), key("recording"), expected, found, advice));
        }
        for (quantity, delay_s) in &entry.delay_s {
            let number = *delay_s.get_ref();
            if *quantity == Quantity::Time || !number.is_finite() {
                let expected = "a finite number of seconds for a channel other than time";
                let key = key(&format!("delay_s.{quantity}"));
                let advice = "state the delay of a channel against the log's time";
                errors.push(document.bad(&delay_s.span(), key, expected, number, advice));
            }
        }
    }
    errors
}

/// The limit of the proposed flight that no flight can keep.
fn check_limits(document: &Document, declaration: &Declaration) -> Option<FlightsError> {
    let limits = declaration.next_flight.as_ref()?;
    let (key, expected, found) = limits.get_ref().refusal()?;
    let advice = "leave it out for the limit that the flights reach";
    Some(document.bad(&limits.span(), format!("next_flight.{key}"), expected, found, advice))
}

/// Names that several flights have, or that are more than a part of a line.
fn check_names(document: &Document, logs: &[Log<'_>]) -> Vec<FlightsError> {
    let refused = |log: &Log<'_>, expected: &str, found: String, advice: &str| {
        document.bad(&log.name_span(), format!("flight.{}.name", log.index), expected, found, advice)
    };
    let with_control = logs.iter().filter_map(|log| {
        let NotOneLine { expected, found } = require_line(&log.name).err()?;
        Some(refused(
            log,
            expected,
            format!("\"{found}\""),
            "give the flight a `name`, or rename the log if it is the log's name",
        ))
    });
    let mut names = BTreeSet::new();
    let again = logs.iter().filter(|log| !names.insert(log.name.as_str()));
    let again = again.map(|log| {
        let found = format!("\"{}\" a second time", printable_line(&log.name));
        refused(log, "the name of one flight", found, "give another")
    });
    with_control.chain(again).collect()
}

/// The invalid bound of a flight's part, its place, and its value.
fn bad_window(entry: &FlightEntry) -> Option<(&'static str, Range<usize>, f64)> {
    let from_s = entry.from_s.as_ref().map_or(0.0, |from_s| *from_s.get_ref());
    let to_s = entry.to_s.as_ref().map_or(f64::INFINITY, |to_s| *to_s.get_ref());
    match (&entry.from_s, &entry.to_s) {
        (Some(from), _) if !(from_s >= 0.0 && from_s.is_finite()) => Some(("from_s", from.span(), from_s)),
        (_, Some(to)) if to_s.is_nan() || to_s <= from_s => Some(("to_s", to.span(), to_s)),
        _ => None,
    }
}
