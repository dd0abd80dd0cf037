//! A problem in a manifest, for the person who wrote it: where, what, and what to do.

use diagnostics::Place;
use serde::ser::{Serialize, SerializeStruct, Serializer};
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A problem at a place in a file, and what else is wrong.
///
/// ```
/// use runtime::{manifest::Manifest, registry::Registry};
/// let text = "[run]\nduration = 2.0".to_owned();
/// let problem = Manifest::parse(text, "hover.toml".as_ref(), &[], Registry::default()).unwrap_err();
/// assert!(problem.to_string().starts_with("hover.toml:2:1: unknown field `duration`"), "{problem}");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    file: PathBuf,
    /// Line and column, counted from 1.
    place: Option<(usize, usize)>,
    message: String,
    help: String,
    /// What else is wrong with the manifest.
    others: Vec<Problem>,
}

impl Problem {
    /// A problem with the whole file.
    pub fn in_file(file: &Path, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self {
            file: file.to_owned(),
            place: None,
            message: message.into(),
            help: help.into(),
            others: Vec::new(),
        }
    }

    /// What all `checks` came to; else the problems of all of them as one, so that one look shows every fault.
    pub fn gather<T>(checks: impl IntoIterator<Item = Result<T, Self>>) -> Result<Vec<T>, Self> {
        let (mut passed, mut problems) = (Vec::new(), Vec::new());
        for check in checks {
            match check {
                Ok(value) => passed.push(value),
                Err(problem) => problems.push(problem),
            }
        }
        let mut problems = problems.into_iter();
        problems.next().map_or(Ok(passed), |first| Err(first.and(problems)))
    }

    /// This problem, and `others` beside it.
    #[must_use]
    pub fn and(mut self, others: impl IntoIterator<Item = Self>) -> Self {
        for mut other in others {
            let more = std::mem::take(&mut other.others);
            self.others.push(other);
            self.others.extend(more);
        }
        self
    }

    /// A problem at the bytes `span` of `text`.
    pub fn at(
        file: &Path,
        text: &str,
        span: &Range<usize>,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        let place = Place::of(file.display().to_string(), text, span);
        Self {
            file: file.to_owned(),
            place: Some((place.line, place.column)),
            message: message.into(),
            help: help.into(),
            others: Vec::new(),
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
        if !self.help.is_empty() {
            write!(f, "\n  help: {}", self.help)?;
        }
        self.others.iter().try_for_each(|other| write!(f, "\n{other}"))
    }
}

impl std::error::Error for Problem {}

#[cfg(test)]
mod tests {
    use super::Problem;
    use std::path::Path;

    #[test]
    fn a_problem_names_file_line_and_column() {
        let problem =
            Problem::at(Path::new("a.toml"), "x = 1\ny = 2\n", &(10..11), "bad value", "give another");
        assert_eq!(problem.to_string(), "a.toml:2:5: bad value\n  help: give another");
    }

    #[test]
    fn several_problems_are_told_at_once_each_with_its_place() {
        let at = |offset| Problem::at(Path::new("a.toml"), "x = 1\ny = 2\n", &(offset..offset), "bad", "");
        let gathered = Problem::gather([Ok(1), Err(at(4)), Ok(2), Err(at(10))]).unwrap_err();
        assert_eq!(gathered.to_string(), "a.toml:1:5: bad\na.toml:2:5: bad");
        assert_eq!(Problem::gather([Ok(1), Ok(2)]), Ok(vec![1, 2]));
    }
}
