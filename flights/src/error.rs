//! Errors of a flights file, or of a log that it names.

use std::collections::BTreeMap;
use std::fmt::{self, Display as _};
use std::io;
use std::path::{Path, PathBuf};

use diagnostics::{Diagnostic, Place, suggestion};
use vehicles::table::TableError;

use crate::finding::Finding;
use crate::quantity::Quantity;
use crate::span::Sparse;

/// Reason why flights cannot be used: the file, the place, what was expected and found, and what to do.
///
/// ```
/// use flights::{FlightSet, FlightsError};
///
/// let text = "vehicle = \"v.toml\"\n[[flight]]\nname = \"a\"\nfile = \"a.csv\"\nrole = \"fit\"\nto_s = -1.0\n";
/// let vehicle = |_: &std::path::Path| Ok(vehicles::reference::HUMMINGBIRD.as_bytes().to_vec());
/// let error = FlightSet::parse("flights.toml".as_ref(), text.to_owned(), &vehicle).unwrap_err();
/// assert!(matches!(&error, FlightsError::File(fault) if fault.key() == "flight.0.to_s"));
/// ```
#[derive(Debug, thiserror::Error)]
pub enum FlightsError {
    /// The flights file cannot be read, is not TOML, or has an invalid key or value.
    #[error(fmt = std::fmt::Display::fmt)]
    File(#[from] Diagnostic),
    /// The vehicle file is not usable.
    #[error(fmt = vehicle)]
    Vehicle {
        /// Place at which the flights file names it.
        place: Place,
        /// Its fault.
        #[source]
        cause: Box<Diagnostic>,
    },
    /// A log cannot be read, or does not have the channels that the flights file asks for.
    #[error(fmt = of_log)]
    Log {
        /// The line of the flights file that asks.
        place: Place,
        /// The flight's name.
        flight: String,
        /// The log.
        file: PathBuf,
        /// The channel, where it is about one.
        channel: Option<Quantity>,
        /// The fault, with advice.
        #[source]
        cause: LogError,
    },
    /// Measured values contradict their declared units, frames or order.
    #[error(
        "{place}: flight `{flight}`, log {}: the values contradict what the file declares:{}\n  \
         correct the unit, frame or order, or set `trust_units = true` for this flight",
        file.display(),
        list(findings)
    )]
    Implausible {
        /// The line of the flight.
        place: Place,
        /// The flight's name.
        flight: String,
        /// The log.
        file: PathBuf,
        /// Contradictions.
        findings: Vec<Finding>,
    },
    /// A flight that is to be held out holds samples of one that parameters are fitted or effects are chosen on.
    #[error(
        "{place}: flight `{}` with role \"{}\" is not held out from flight `{}` with role \"{}\": {reason}; give \
         them parts that do not overlap by `from_s` and `to_s`, name another log, or take one of them out",
        flight.0, flight.1, other.0, other.1
    )]
    NotHeldOut {
        /// The line that names the log of the flight that is to be held out.
        place: Place,
        /// Name and role of that flight.
        flight: (String, &'static str),
        /// Name and role of the other flight.
        other: (String, &'static str),
        /// Relation of the two, as text.
        reason: String,
    },
    /// A canonical file cannot be written.
    #[error("{}: cannot write this file: {cause}; check the folder and the space left", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Cause.
        #[source]
        cause: io::Error,
    },
    /// A flight has no time at which a row of a table could stand.
    #[error(
        "flight `{flight}`: expected an attitude or an angular velocity at a time at which all other channels have samples, \
         found {found}; map the missing channel, or correct the clocks"
    )]
    NoRows {
        /// The flight's name.
        flight: String,
        /// Its channels with their times.
        found: String,
    },
    /// More than one of these.
    #[error(fmt = several)]
    Several {
        /// All, in the order of the file.
        all: Vec<FlightsError>,
        /// Faults of files among them.
        #[source]
        faults: Option<Box<Diagnostic>>,
    },
}

/// The form with lines of files, `{:#}`, is handed on.
fn vehicle(place: &Place, cause: &Diagnostic, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    write!(f, "{place}: `vehicle`: ")?;
    cause.fmt(f)
}

/// With `{:#}` the line of the flights file stands below the fault, and the advice below the line.
fn of_log(
    place: &Place,
    flight: &str,
    file: &Path,
    channel: &Option<Quantity>,
    cause: &LogError,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    write!(f, "{place}: flight `{flight}`, log {}: {}", file.display(), named(*channel))?;
    cause.fmt(f)?;
    if !f.alternate() {
        return Ok(());
    }
    write!(f, "\n{place:#}")?;
    match cause.advice() {
        advice if advice.is_empty() => Ok(()),
        advice => write!(f, "\n  help: {advice}"),
    }
}

/// As [`vehicle`]. With `{:#}` a fault of a line that several flights meet is shown once.
fn several(all: &[FlightsError], _: &Option<Box<Diagnostic>>, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    // Whoever prints it has written the word before the first.
    let (between, once) = match f.alternate() {
        true => ("\nerror: ", once_each(all)),
        false => ("\n", all.iter().map(|error| (error, Vec::new())).collect()),
    };
    for (index, (error, others)) in once.iter().enumerate() {
        if index > 0 {
            f.write_str(between)?;
        }
        error.fmt(f)?;
        match &others[..] {
            [] => {}
            [other] => write!(f, "\n  also in flight `{other}`")?,
            _ => write!(f, "\n  also in {} other flights", others.len())?,
        }
    }
    Ok(())
}

/// Each error once, with the other flights that meet the same fault at the same line of the flights file.
fn once_each(all: &[FlightsError]) -> Vec<(&FlightsError, Vec<&str>)> {
    let mut once: Vec<(&FlightsError, Vec<&str>)> = Vec::new();
    let mut known = BTreeMap::new();
    for error in all {
        let FlightsError::Log { place, flight, channel, cause, .. } = error else {
            once.push((error, Vec::new()));
            continue;
        };
        let next = once.len();
        let index = *known.entry(format!("{place}: {}{cause}", named(*channel))).or_insert(next);
        match once.get_mut(index) {
            Some((_, others)) => others.push(flight.as_str()),
            None => once.push((error, Vec::new())),
        }
    }
    once
}

impl From<FlightsError> for diagnostics::Error {
    fn from(error: FlightsError) -> Self {
        Self::new(error)
    }
}

impl FlightsError {
    /// The fault of a file, with its place and advice; of several errors, those that are faults of files.
    ///
    /// ```
    /// let error = flights::FlightSet::load("nowhere.toml".as_ref()).unwrap_err();
    /// assert_eq!(error.diagnostic().unwrap().file, "nowhere.toml");
    /// ```
    #[must_use]
    pub fn diagnostic(&self) -> Option<&Diagnostic> {
        match self {
            Self::File(fault) => Some(fault),
            Self::Vehicle { cause, .. } => Some(cause),
            Self::Several { faults, .. } => faults.as_deref(),
            Self::Log { .. }
            | Self::Implausible { .. }
            | Self::NotHeldOut { .. }
            | Self::Write { .. }
            | Self::NoRows { .. } => None,
        }
    }

    /// Nothing, or all `errors` as one.
    pub(crate) fn gather(errors: Vec<Self>) -> Result<(), Self> {
        Self::gather_with(Ok(()), errors)
    }

    /// Returns the value of `result`, if there are no `errors` besides. Else returns all errors as one, that of
    /// `result` last.
    pub(crate) fn gather_with<T>(result: Result<T, Self>, mut errors: Vec<Self>) -> Result<T, Self> {
        match result {
            Ok(value) if errors.is_empty() => Ok(value),
            Err(error) if errors.is_empty() => Err(error),
            result => {
                errors.extend(result.err());
                Err(if errors.len() == 1 { errors.remove(0) } else { Self::several(errors) })
            }
        }
    }

    fn several(all: Vec<Self>) -> Self {
        let mut faults = all.iter().filter_map(Self::diagnostic).cloned();
        let faults = faults.next().map(|first| Box::new(first.and(faults)));
        Self::Several { all, faults }
    }
}

/// Fault of a log, or of a request to it. Its text ends with advice, except with `{:#}`: [`LogError::advice`] returns it.
///
/// ```
/// use flights::{LogError, Spot};
///
/// let (expected, found) = ("a whole header".to_owned(), "one that is cut".to_owned());
/// let error = LogError::Unexpected { at: Spot::Byte(7), expected, found, advice: "copy it again" };
/// assert_eq!(error.to_string(), "byte 7: expected a whole header, found one that is cut; copy it again");
/// assert_eq!(format!("{error:#}"), "byte 7: expected a whole header, found one that is cut");
/// assert_eq!(error.advice(), "copy it again");
/// ```
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file cannot be read at all.
    #[error(fmt = unreadable)]
    Unreadable {
        /// The error of the system.
        #[source]
        cause: io::Error,
        /// Advice what to do.
        advice: String,
    },
    /// It is not a table.
    #[error(transparent)]
    Table(#[from] TableError),
    /// It has no column, topic or field of a name.
    #[error(fmt = missing)]
    Missing {
        /// Kind of the item that was searched: a column, a topic.
        kind: &'static str,
        /// Its name.
        name: String,
        /// The names there are.
        known: Vec<String>,
        /// The key of the flights file that has the name.
        key: &'static str,
    },
    /// Something else than expected.
    #[error(fmt = unexpected)]
    Unexpected {
        /// Place in the log or in its entry.
        at: Spot,
        /// Values that would be accepted.
        expected: String,
        /// Value that was found.
        found: String,
        /// Advice.
        advice: &'static str,
    },
    /// Samples that are too far apart for a flight.
    #[error(transparent)]
    Sparse(#[from] Sparse),
    /// A part of a log in several files is wrong.
    #[error(fmt = part)]
    Part {
        /// The file of the part.
        file: PathBuf,
        /// Its fault.
        #[source]
        cause: Box<LogError>,
    },
}

/// Place in a log, or in its entry in the flights file.
#[derive(Debug, Clone, PartialEq)]
pub enum Spot {
    /// The whole log or channel.
    Whole,
    /// An offset in bytes.
    Byte(usize),
    /// A topic, a message, a format, by its name.
    Named(&'static str, String),
    /// A key of the channel.
    Key(&'static str),
    /// A cell of a table.
    Cell {
        /// Its line, from 1.
        line: u64,
        /// The name of its column.
        column: String,
    },
}

impl std::fmt::Display for Spot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Whole => Ok(()),
            Self::Byte(offset) => write!(f, "byte {offset}: "),
            Self::Named(kind, name) => write!(f, "{kind} `{name}`: "),
            Self::Key(key) => write!(f, "`{key}`: "),
            Self::Cell { line, column } => write!(f, "line {line}, column `{column}`: "),
        }
    }
}

impl LogError {
    pub(crate) fn unexpected(
        at: Spot,
        expected: impl Into<String>,
        found: impl Into<String>,
        advice: &'static str,
    ) -> Self {
        Self::Unexpected { at, expected: expected.into(), found: found.into(), advice }
    }

    pub(crate) fn missing<N: ToString>(
        kind: &'static str,
        name: &str,
        known: impl IntoIterator<Item = N>,
        key: &'static str,
    ) -> Self {
        let known = known.into_iter().map(|name| name.to_string()).collect();
        Self::Missing { kind, name: name.to_owned(), known, key }
    }

    /// Returns advice; empty where the text says what to do.
    #[must_use]
    pub fn advice(&self) -> String {
        match self {
            Self::Unreadable { advice, .. } => advice.clone(),
            Self::Missing { name, known, key, .. } => choose(name, known, key),
            Self::Unexpected { expected, found, advice, .. } => {
                meant(expected, found).unwrap_or_else(|| (*advice).to_owned())
            }
            Self::Part { cause, .. } => cause.advice(),
            Self::Table(_) | Self::Sparse(_) => String::new(),
        }
    }
}

fn unreadable(cause: &io::Error, advice: &str, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    write!(f, "cannot read it: {cause}")?;
    write_advice(advice, f)
}

fn missing(kind: &str, name: &str, known: &[String], key: &str, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    write!(f, "no {kind} `{name}`; it has {}", shortened(known))?;
    write_advice(&choose(name, known, key), f)
}

fn unexpected(
    at: &Spot,
    expected: &str,
    found: &str,
    advice: &str,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    write!(f, "{at}expected {expected}, found {found}")?;
    write_advice(&meant(expected, found).unwrap_or_else(|| advice.to_owned()), f)
}

fn part(file: &Path, cause: &LogError, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    write!(f, "part {}: ", file.display())?;
    cause.fmt(f)
}

/// Writes the advice behind a fault; with `{:#}` whoever prints the fault shows it elsewhere.
fn write_advice(advice: &str, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    if f.alternate() { Ok(()) } else { write!(f, "; {advice}") }
}

/// Bytes of the shortest word that may be misspelt: shorter ones, such as units, are near to all others of their length.
const SHORTEST: usize = 3;

/// Advice on the name `name`, which is none of `known`, in the key `key`.
fn choose(name: &str, known: &[String], key: &str) -> String {
    // Another element of the same array is no other spelling.
    let array = |name: &str| name.split_once('[').map(|(array, _)| array.to_owned());
    let others = known.iter().filter(|other| array(name).is_none() || array(other) != array(name));
    let question = suggestion(name, others.map(String::as_str)).filter(|_| name.len() >= SHORTEST);
    question.unwrap_or_else(|| format!("choose {key} from this list"))
}

/// The question for the word that was probably meant, if `expected` is a choice of words in quotes.
fn meant(expected: &str, found: &str) -> Option<String> {
    let word = |text: &str| Some(text.strip_prefix('"')?.strip_suffix('"')?.to_owned());
    let words: Vec<String> = expected.split(" or ").map(word).collect::<Option<_>>()?;
    let found = word(found).filter(|found| found.len() >= SHORTEST)?;
    suggestion(&found, words.iter().map(String::as_str))
}

/// The names there are; shortened where they are many.
fn shortened(names: &[String]) -> String {
    const SHOWN: usize = 60;
    let rest = if names.len() > SHOWN { format!(" and {} more", names.len() - SHOWN) } else { String::new() };
    format!("{}{rest}", names[..names.len().min(SHOWN)].join(", "))
}

fn named(channel: Option<Quantity>) -> String {
    channel.map_or(String::new(), |channel| format!("`{channel}`: "))
}

fn list(findings: &[Finding]) -> String {
    findings.iter().map(|finding| format!("\n  - {}", finding.message)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use diagnostics::Error;

    fn fault(file: &str) -> Diagnostic {
        Diagnostic::at(Place::of(file, "x = 1\ny = 2\n", &(10..11)), "too small").help("give another")
    }

    fn vehicle(file: &str) -> FlightsError {
        let place = Place::of("flights.toml", "vehicle = \"v.toml\"\n", &(10..18));
        FlightsError::Vehicle { place, cause: Box::new(fault(file)) }
    }

    fn no_rows() -> FlightsError {
        FlightsError::NoRows { flight: "a".to_owned(), found: "none".to_owned() }
    }

    #[test]
    fn the_fault_of_a_file_is_handed_on_with_its_place() {
        for error in [FlightsError::from(fault("v.toml")), vehicle("v.toml")] {
            assert_eq!(error.diagnostic(), Some(&fault("v.toml")));
            let (text, text_with_lines) = (error.to_string(), format!("{error:#}"));
            let error = Error::from(error);
            assert!(error.is_input() && error.diagnostic() == Some(&fault("v.toml")), "{error}");
            assert_eq!((error.with_causes(), format!("{error:#}")), (text, text_with_lines));
        }
        assert_eq!(no_rows().diagnostic(), None);
    }

    fn of_log(flight: &str, cause: LogError) -> FlightsError {
        let text = "[channels]\ncommand = { unit = \"counts\" }\n";
        let place = Place::of("flights.toml", text, &(21..40));
        let (flight, file) = (flight.to_owned(), PathBuf::from(format!("{flight}.csv")));
        FlightsError::Log { place, flight, file, channel: Some(Quantity::Command), cause }
    }

    fn unit(found: &str) -> LogError {
        let advice = "write one of these units";
        LogError::unexpected(Spot::Key("unit"), "\"count\" or \"%\"", format!("\"{found}\""), advice)
    }

    #[test]
    fn the_line_of_the_flights_file_is_shown_before_the_advice() {
        let error = of_log("a", unit("volt"));
        let message = "flights.toml:2:11: flight `a`, log a.csv: `command`: `unit`: expected \"count\" or \"%\", \
                       found \"volt\"";
        assert_eq!(error.to_string(), format!("{message}; write one of these units"));
        let shown = format!("{error:#}");
        assert!(shown.starts_with(&format!("{message}\n  |\n2 | command = ")), "{shown}");
        assert!(shown.ends_with("\n  help: write one of these units"), "{shown}");
        // No cause is repeated behind it.
        let chain = causes(&error);
        assert!(chain.iter().all(|cause| diagnostics::has_text_of(&shown, *cause)), "{shown}");
    }

    fn causes(error: &FlightsError) -> Vec<&(dyn std::error::Error + 'static)> {
        std::iter::successors(std::error::Error::source(error), |cause| cause.source()).collect()
    }

    #[test]
    fn a_name_that_is_nearly_right_is_asked_for() {
        assert_eq!(unit("counts").advice(), "did you mean `count`?");
        assert_eq!(unit("V").advice(), "write one of these units", "one letter is no misspelt %");
        let topics = ["/imu/imu", "/mocap/mocap"];
        let topic = LogError::missing("topic", "/mocap/mocp", topics, "`topic`");
        assert_eq!(topic.advice(), "did you mean `/mocap/mocap`?");
        assert!(topic.to_string().ends_with("it has /imu/imu, /mocap/mocap; did you mean `/mocap/mocap`?"));
        let element = LogError::missing("field", "command[9]", ["command[0]", "command[1]"], "`fields`");
        assert_eq!(element.advice(), "choose `fields` from this list");
        let parquet = LogError::unexpected(Spot::Whole, "\"us\" or no unit", "\"s\"", "leave it out");
        assert_eq!(parquet.advice(), "leave it out");
    }

    #[test]
    fn a_fault_of_a_line_that_several_flights_meet_is_shown_once() {
        fn all(names: &[&str]) -> Vec<FlightsError> {
            names.iter().map(|name| of_log(name, unit("volt"))).collect()
        }
        let two = FlightsError::gather(all(&["a", "b"])).unwrap_err();
        assert_eq!(two.to_string().lines().count(), 2);
        let shown = format!("{two:#}");
        assert_eq!(shown.matches("command = ").count(), 1, "{shown}");
        assert!(shown.ends_with("\n  also in flight `b`"), "{shown}");
        let mut more = all(&["a", "b", "c"]);
        more.push(of_log("d", unit("V")));
        let shown = format!("{:#}", FlightsError::gather(more).unwrap_err());
        assert!(
            shown.contains("\n  also in 2 other flights\nerror: flights.toml:2:11: flight `d`"),
            "{shown}"
        );
    }

    #[test]
    fn of_several_errors_all_faults_of_files_are_handed_on() {
        let all = vec![vehicle("v.toml"), no_rows(), FlightsError::from(fault("flights.toml"))];
        let error = FlightsError::gather(all).unwrap_err();
        let text = error.to_string();
        let error = Error::from(error);
        let files: Vec<String> = error.diagnostic().unwrap().all().map(|fault| fault.file).collect();
        assert_eq!(files, ["v.toml", "flights.toml"]);
        assert_eq!(error.with_causes(), text);
        let error = FlightsError::gather(vec![no_rows(), no_rows()]).unwrap_err();
        assert!(error.diagnostic().is_none() && !Error::from(error).is_input());
    }
}
