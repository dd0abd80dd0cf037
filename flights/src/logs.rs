//! The logs that flights are read from: the one that an entry names, in one file or several, or all that its pattern finds.

use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use glob::MatchOptions;
use toml::Spanned;

use crate::declaration::FlightEntry;
use crate::document::Document;
use crate::error::FlightsError;
use crate::files::Files;

/// Hidden files are found by no `*`: some systems write one beside each file.
const MATCHING: MatchOptions =
    MatchOptions { case_sensitive: true, require_literal_separator: true, require_literal_leading_dot: true };

/// A log that becomes a flight.
pub struct Log<'a> {
    /// Its entry in the flights file.
    pub entry: &'a Spanned<FlightEntry>,
    /// Index of that entry, from 0.
    pub index: usize,
    /// Name of the flight in reports.
    pub name: String,
    /// The files of the log, in the order of time; one at least.
    pub files: Vec<PathBuf>,
}

impl Log<'_> {
    /// Returns the place of the name.
    pub fn name_span(&self) -> Range<usize> {
        let entry = self.entry.get_ref();
        entry.name.as_ref().map_or(entry.file.span(), Spanned::span)
    }
}

/// Treatment of patterns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Patterns {
    /// A pattern is searched for in the folders of this machine.
    Find,
    /// A pattern is taken for a name, where there are no folders.
    Literal,
}

/// The logs of the entry `index`, in the order of their paths.
pub fn of_entry<'a>(
    document: &Document,
    index: usize,
    entry: &'a Spanned<FlightEntry>,
    patterns: Patterns,
) -> Result<Vec<Log<'a>>, FlightsError> {
    let (declared, key) = (entry.get_ref(), format!("flight.{index}.file"));
    let given = declared.name.as_ref().map(|name| name.get_ref().as_str());
    let log = |name: String, files: Vec<PathBuf>| Log { entry, index, name, files };
    let (written, place) = match declared.file.get_ref() {
        Files::One(written) => (written, declared.file.span()),
        Files::Parts(_) => {
            let files = parts(document, &key, &declared.file, patterns)?;
            return Ok(vec![log(given.map_or_else(|| own_name(&files[0]), str::to_owned), files)]);
        }
    };
    match found(document, &key, (written, &place), patterns)? {
        Found::File(file) => Ok(vec![log(given.map_or_else(|| own_name(&file), str::to_owned), vec![file])]),
        Found::ByPattern { files, fixed } => {
            let name = |file: &Path| {
                let found = without_ending(&plain(file).components().skip(fixed).collect::<PathBuf>());
                given.map_or(found.clone(), |given| format!("{given} {found}"))
            };
            Ok(files.into_iter().map(|file| log(name(&file), vec![file])).collect())
        }
    }
}

/// The files of one log that the value of the key names, in its order; those that a pattern in a list finds in the order of
/// their paths. A name outside a list is not a pattern.
pub fn parts(
    document: &Document,
    key: &str,
    files: &Spanned<Files>,
    patterns: Patterns,
) -> Result<Vec<PathBuf>, FlightsError> {
    let patterns = if files.get_ref().are_parts() { patterns } else { Patterns::Literal };
    let mut all = Vec::new();
    for (written, place) in files.get_ref().each(files.span()) {
        match found(document, key, (written, &place), patterns)? {
            Found::File(file) => all.push(file),
            Found::ByPattern { files, .. } => all.extend(files),
        }
    }
    Ok(all)
}

/// Files for a name in a flights file.
enum Found {
    /// The one with this name.
    File(PathBuf),
    /// Files that a pattern finds, sorted.
    ByPattern {
        /// Their paths.
        files: Vec<PathBuf>,
        /// Number of parts of their paths in front of the first wildcard.
        fixed: usize,
    },
}

/// Files of the name or pattern at a place.
fn found(
    document: &Document,
    key: &str,
    (written, place): (&str, &Range<usize>),
    patterns: Patterns,
) -> Result<Found, FlightsError> {
    let file = document.resolve(key, written, place)?;
    if patterns == Patterns::Literal || !has_wildcard(&file) || file.exists() {
        return Ok(Found::File(file));
    }
    let (folder, fixed) = fixed_folder(&file);
    let found = find(&file).and_then(|found| match found[..] {
        [] if folder.as_os_str().is_empty() || folder.is_dir() => Err("none".to_owned()),
        [] => Err("no such folder".to_owned()),
        _ => Ok(found),
    });
    let files = found.map_err(|found| {
        let expected = format!("files as `{written}` in the folder {}", shown(&folder));
        let advice = "correct the pattern, in which `*` is any part of a name and `?` a character of it";
        document.bad(place, key, &expected, found, advice)
    })?;
    Ok(Found::ByPattern { files, fixed })
}

/// Name of a flight by its log.
fn own_name(file: &Path) -> String {
    without_ending(Path::new(file.file_name().unwrap_or_default()))
}

fn has_wildcard(path: &Path) -> bool {
    path.to_string_lossy().contains(['*', '?'])
}

/// The files that a pattern finds, sorted; else a description of the fault.
fn find(pattern: &Path) -> Result<Vec<PathBuf>, String> {
    // Brackets stand in names of folders and logs, and so for themselves.
    let text = pattern.to_string_lossy().replace('[', "[[]");
    if text.contains("**") {
        return Err("`**`, which would look through all folders".to_owned());
    }
    let paths = glob::glob_with(&text, MATCHING).map_err(|error| format!("an invalid pattern: {error}"))?;
    let mut found = paths.collect::<Result<Vec<_>, _>>().map_err(|error| error.to_string())?;
    found.retain(|path| path.is_file());
    found.sort();
    Ok(found)
}

/// The folder in front of the first wildcard, and how many parts its path has.
fn fixed_folder(pattern: &Path) -> (PathBuf, usize) {
    let pattern = plain(pattern);
    let fixed = pattern.components().take_while(|part| !has_wildcard(Path::new(part.as_os_str())));
    (fixed.clone().collect(), fixed.count())
}

/// The path without `.` in it.
fn plain(path: &Path) -> PathBuf {
    path.components().filter(|part| *part != Component::CurDir).collect()
}

fn without_ending(path: &Path) -> String {
    path.with_extension("").display().to_string()
}

fn shown(folder: &Path) -> String {
    if folder.as_os_str().is_empty() { ".".to_owned() } else { folder.display().to_string() }
}
