//! A problem in a manifest, for the person who wrote it: where, what, and what to do.

use serde::ser::{Serialize, SerializeStruct, Serializer};
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A problem at a place in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    file: PathBuf,
    /// Line and column, counted from 1.
    place: Option<(usize, usize)>,
    message: String,
    help: String,
}

impl Problem {
    /// A problem with the whole file.
    pub fn in_file(file: &Path, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { file: file.to_owned(), place: None, message: message.into(), help: help.into() }
    }

    /// A problem at the bytes `span` of `text`.
    pub fn at(
        file: &Path,
        text: &str,
        span: &Range<usize>,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        let before = &text[..text.floor_char_boundary(span.start.min(text.len()))];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
        Self {
            file: file.to_owned(),
            place: Some((line, column)),
            message: message.into(),
            help: help.into(),
        }
    }
}

/// As an object: file, line, column, message, help.
impl Serialize for Problem {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Problem", 5)?;
        object.serialize_field("file", &self.file)?;
        object.serialize_field("line", &self.place.map(|(line, _)| line))?;
        object.serialize_field("column", &self.place.map(|(_, column)| column))?;
        object.serialize_field("message", &self.message)?;
        object.serialize_field("help", &self.help)?;
        object.end()
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some((line, column)) = self.place {
            write!(f, ":{line}:{column}")?;
        }
        write!(f, ": {}", self.message)?;
        if self.help.is_empty() { Ok(()) } else { write!(f, "\n  help: {}", self.help) }
    }
}

impl std::error::Error for Problem {}

/// The name among `known` that `found` was probably meant to be.
pub fn nearest<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let scored = known.into_iter().map(|name| (edit_distance(found, name), name));
    scored.filter(|(distance, name)| *distance <= name.len().div_ceil(3)).min().map(|(_, name)| name)
}

fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::{Problem, nearest};
    use std::path::Path;

    #[test]
    fn a_problem_names_file_line_and_column() {
        let problem =
            Problem::at(Path::new("a.toml"), "x = 1\ny = 2\n", &(10..11), "bad value", "give another");
        assert_eq!(problem.to_string(), "a.toml:2:5: bad value\n  help: give another");
    }

    #[test]
    fn a_misspelt_name_finds_its_neighbour() {
        assert_eq!(nearest("comand", ["command", "state"]), Some("command"));
        assert_eq!(nearest("xyz", ["command", "state"]), None);
    }
}
