//! Opens the logs of a flight: its own, and those of channels that are in other files.

use std::io;
use std::num::NonZero;
use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::Spanned;
use vehicles::Vehicle;
use vehicles::table::Dialect;

use crate::declaration::{ChannelMap, Declaration, Entry, FlightEntry, Format};
use crate::document::Document;
use crate::error::{FlightsError, LogError, Spot};
use crate::files::Files;
use crate::flight::Flight;
use crate::form::Form;
use crate::formats;
use crate::joined::{Joined, LogPart};
use crate::log::Log;
use crate::log_reader::LogReader;
use crate::logs::{self, Patterns};
use crate::quantity::Quantity;
use crate::reading::{OtherLog, OtherLogs, Part, Reading};

/// Advice where the clock of a flight's only file starts again.
const CHOOSE: &str = "cut the file there, or set the flight's `recording`, 1 for the first";
/// Advice where the clock of a channel's own file starts again.
const CHOOSE_BESIDE: &str =
    "cut the file there, or set `recording` beside the channel's `file`, 1 for the first";
/// Advice where the clock of a part starts again.
const CUT: &str = "a part of a log has one recording: cut the file there";

/// Arguments for the opening of the logs of a flights file.
pub struct Opening<'a> {
    /// The flights file.
    pub document: &'a Document,
    /// Its content.
    pub declaration: &'a Declaration,
    /// The declared vehicle.
    pub vehicle: &'a Vehicle,
    /// True if lists may hold patterns.
    pub patterns: Patterns,
}

/// Rows of a flight's own log at least: of one sample nothing can be told.
const ROWS_MIN: usize = 2;

/// A log to be opened.
struct Asked<'b> {
    /// Its files.
    files: &'b [PathBuf],
    /// The format in the flights file.
    format: Option<Format>,
    /// Its declared form.
    form: Form<'b>,
    /// The flight's declaration.
    entry: &'b FlightEntry,
    /// True for the log of one channel beside the flight's own.
    is_beside: bool,
}

impl Opening<'_> {
    /// Reads a flight of the file.
    pub fn flight(
        &self,
        declared: &logs::Log<'_>,
        reader: &mut LogReader<'_>,
    ) -> Result<(Flight, Part), FlightsError> {
        let entry = declared.entry.get_ref();
        // Those of the file, overridden by those of the flight.
        let mut channels = self.declaration.channels.clone();
        channels.extend(entry.channels.clone());
        let time = channels.get(&Quantity::Time).map(Spanned::get_ref);
        let of_log = channels.values().map(Spanned::get_ref).filter(|channel| channel.file.is_none());
        let restarts = if entry.file.get_ref().are_parts() { CUT } else { CHOOSE };
        let asked = Asked {
            files: &declared.files,
            format: entry.format.or(self.declaration.format),
            form: Form {
                // A part may end with its header.
                rows_min: if declared.files.len() == 1 { ROWS_MIN } else { 0 },
                ..self.form(entry, time, of_log.collect(), (entry.recording, restarts))
            },
            entry,
            is_beside: false,
        };
        let (format, log) = self
            .open(&asked, reader)
            .map_err(|found| self.broken(declared, &entry.file.span(), None, found))?;
        let others = self.other_logs(declared, &channels, reader)?;
        Reading {
            document: self.document,
            vehicle: self.vehicle,
            name: &declared.name,
            entry,
            at: declared.entry.span(),
            format,
            files: &declared.files,
            channels,
            others,
        }
        .flight(log)
    }

    /// The form of a table of the flight, with the recording that is used and the advice where there are several.
    fn form<'b>(
        &'b self,
        entry: &'b FlightEntry,
        time: Option<&'b Entry>,
        channels: Vec<&'b Entry>,
        (recording, restarts): (Option<NonZero<usize>>, &'static str),
    ) -> Form<'b> {
        const PLAIN: Dialect = Dialect { header_line: None, header: None, delimiter: None, decimal: None };
        let dialect = entry.csv.as_ref().or(self.declaration.csv.as_ref()).unwrap_or(&PLAIN);
        Form { dialect, rows_min: 0, recording, restarts, time, channels }
    }

    /// The logs of the channels that are in another file than the flight's.
    fn other_logs(
        &self,
        declared: &logs::Log<'_>,
        channels: &ChannelMap,
        reader: &mut LogReader<'_>,
    ) -> Result<OtherLogs, FlightsError> {
        let entry = declared.entry.get_ref();
        let of_flight = channels.get(&Quantity::Time).map(Spanned::get_ref);
        let mut others = OtherLogs::new();
        for (quantity, channel) in channels {
            let (place, channel) = (channel.span(), channel.get_ref());
            self.check_recording(*quantity, channel, &place)?;
            let Some(file) = &channel.file else { continue };
            let files =
                logs::parts(self.document, &format!("channels.{quantity}.file"), file, self.patterns)?;
            let restarts = if file.get_ref().are_parts() { CUT } else { CHOOSE_BESIDE };
            let time = channel.time.as_deref().or(of_flight);
            let form = Form {
                // A voltage may have been measured once.
                rows_min: usize::from(files.len() == 1),
                ..self.form(entry, time, vec![channel], (channel.recording, restarts))
            };
            let asked = Asked { files: &files, format: None, form, entry, is_beside: true };
            let (_, log) = self
                .open(&asked, reader)
                .map_err(|found| self.broken(declared, &place, Some(*quantity), found))?;
            others.insert(*quantity, OtherLog { files, log });
        }
        Ok(others)
    }

    /// Refuses a channel's `recording` that no file of its own has, or the parts of one.
    fn check_recording(
        &self,
        quantity: Quantity,
        channel: &Entry,
        place: &Range<usize>,
    ) -> Result<(), FlightsError> {
        let Some(recording) = channel.recording else { return Ok(()) };
        let advice = match channel.file.as_ref().map(Spanned::get_ref) {
            Some(Files::One(_)) => return Ok(()),
            Some(Files::Parts(_)) => "cut the recording out of its file, or name that file alone",
            None => "set the flight's `recording`, or name the channel's own `file` beside it",
        };
        let (key, expected) =
            (format!("channels.{quantity}.recording"), "a channel with one `file` of its own");
        Err(self.document.bad(place, key, expected, format!("recording = {recording} without"), advice))
    }

    /// The log in the asked files, and its format; else the file that is wrong.
    fn open(
        &self,
        asked: &Asked<'_>,
        reader: &mut LogReader<'_>,
    ) -> Result<(Format, Box<dyn Log>), (PathBuf, LogError)> {
        let (mut parts, mut format) = (Vec::new(), None);
        for file in asked.files {
            let log =
                self.open_file(asked, file, &mut format, reader).map_err(|cause| (file.clone(), cause))?;
            parts.push(LogPart { file: file.clone(), log });
        }
        let format = format.unwrap_or(Format::Csv);
        if parts.len() == 1 {
            return Ok((format, parts.remove(0).log));
        }
        let joined = Joined::of(parts).map_err(|cause| (asked.files[0].clone(), cause))?;
        Ok((format, Box::new(joined)))
    }

    /// One file of a log, whose parts have the format of the first.
    fn open_file(
        &self,
        asked: &Asked<'_>,
        file: &Path,
        first: &mut Option<Format>,
        reader: &mut LogReader<'_>,
    ) -> Result<Box<dyn Log>, LogError> {
        let bytes = if asked.is_beside { reader.read_beside(file) } else { reader.read(file) };
        let bytes =
            bytes.map_err(|cause| LogError::Unreadable { advice: self.unreadable_advice(&cause), cause })?;
        let format = asked.format.unwrap_or_else(|| formats::guess(file, &bytes));
        check_format(*first.get_or_insert(format), format, &asked.files[0])?;
        if !asked.is_beside && asked.entry.csv.is_some() && format != Format::Csv {
            let expected = "a CSV file: `csv` describes the form of one";
            return Err(LogError::unexpected(Spot::Key("csv"), expected, "another format", "remove it"));
        }
        let clock = asked.entry.time.or(self.declaration.time);
        let clock = clock.filter(|_| !asked.is_beside || format == Format::Mcap);
        formats::parse(bytes, format, &asked.form, clock)
    }

    /// Advice for a log that cannot be read: a variable that is not set may be why a file is not there.
    fn unreadable_advice(&self, cause: &io::Error) -> String {
        let defaults =
            if cause.kind() == io::ErrorKind::NotFound { self.document.defaults() } else { Vec::new() };
        match defaults.as_slice() {
            [] => "check the path".to_owned(),
            names => format!(
                "check the path; these variables of the file are not set, and their defaults are taken: {}",
                names.join(", ")
            ),
        }
    }

    fn broken(
        &self,
        declared: &logs::Log<'_>,
        place: &Range<usize>,
        channel: Option<Quantity>,
        (file, cause): (PathBuf, LogError),
    ) -> FlightsError {
        let place = self.document.place(place);
        FlightsError::Log { place, flight: declared.name.clone(), file, channel, cause }
    }
}

/// Refuses a part in another format than the first.
fn check_format(first: Format, other: Format, file: &Path) -> Result<(), LogError> {
    if first == other {
        return Ok(());
    }
    let expected = format!("the format {} of {}", first.name(), file.display());
    let advice = "convert one of the files, or make a flight of each";
    Err(LogError::unexpected(Spot::Whole, expected, other.name(), advice))
}
