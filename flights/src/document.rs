//! The text of a flights file with its name: places for messages, and the paths written in it.

use std::fmt::Display;
use std::ops::Range;
use std::path::{Path, PathBuf};

use diagnostics::{Diagnostic, ParameterError, Place};
use serde::de::DeserializeOwned;

use crate::error::FlightsError;

/// A flights file that was read.
pub struct Document {
    path: PathBuf,
    text: String,
}

impl Document {
    /// The file at `path` with this text.
    pub fn new(path: &Path, text: String) -> Self {
        Self { path: path.to_owned(), text }
    }

    /// The text as a `T`; refuses keys that `T` does not have.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, FlightsError> {
        let read = diagnostics::read_toml(&self.path.display().to_string(), &self.text);
        read.map_err(|error| {
            let help = if error.help.is_empty() { "docs/flights.md has the format" } else { &error.help };
            FlightsError::File(error.clone().help(help))
        })
    }

    /// Returns the place at which `span` begins.
    pub fn place(&self, span: &Range<usize>) -> Place {
        Place::of(self.path.display().to_string(), &self.text, span)
    }

    /// An invalid value.
    pub fn bad(
        &self,
        span: &Range<usize>,
        key: impl Into<String>,
        expected: &str,
        found: impl Display,
        advice: &str,
    ) -> FlightsError {
        let error = ParameterError::value(key, expected, found);
        FlightsError::File(Diagnostic::at(self.place(span), error).help(advice))
    }

    /// Names of the variables in the file that are not set, so that their defaults are taken; each once.
    pub fn defaults(&self) -> Vec<String> {
        let mut names = Vec::new();
        let lines = self.text.lines().filter(|line| !line.trim_start().starts_with('#'));
        for inside in lines.flat_map(|line| line.split("${").skip(1)) {
            let name = inside.split([':', '}']).next().unwrap_or_default();
            if std::env::var_os(name).is_none() && !names.iter().any(|known| known == name) {
                names.push(name.to_owned());
            }
        }
        names
    }

    /// A path as written: `${NAME:-default}` is the environment's NAME, and a relative path starts at the folder
    /// of the flights file.
    pub fn resolve(&self, key: &str, written: &str, place: &Range<usize>) -> Result<PathBuf, FlightsError> {
        let expanded =
            vehicles::variables::expand(written, |name| std::env::var(name).ok()).map_err(|found| {
                let advice = "set the variable, or give a default: ${NAME:-path}";
                self.bad(place, key, "a path", found.to_string(), advice)
            })?;
        Ok(inputs::tidy(&self.path.parent().unwrap_or(Path::new("")).join(expanded)))
    }
}
