//! The text of a flights file with its name: places for messages, and the paths written in it.

use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use diagnostics::Place;
use toml::Spanned;

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
    pub fn parse<T: serde::de::DeserializeOwned>(&self) -> Result<T, FlightsError> {
        toml::from_str(&self.text).map_err(|error| FlightsError::Syntax {
            place: self.place(&error.span().unwrap_or_default()),
            message: error.message().trim().replace('\n', ", "),
        })
    }

    /// Where `span` begins.
    pub fn place(&self, span: &Range<usize>) -> Place {
        Place::of(self.path.display().to_string(), &self.text, span)
    }

    /// A value that cannot be meant.
    pub fn bad(&self, span: &Range<usize>, key: &str, texts: Bad<'_>) -> FlightsError {
        FlightsError::BadValue {
            place: self.place(span),
            key: key.to_owned(),
            expected: texts.expected,
            found: texts.found.to_owned(),
            advice: texts.advice,
        }
    }

    /// A path as written: `${NAME:-default}` is the environment's NAME, and a relative path starts at the folder
    /// of the flights file.
    pub fn resolve(&self, key: &str, written: &Spanned<String>) -> Result<PathBuf, FlightsError> {
        let expanded = vehicles::variables::expand(written.get_ref(), |name| std::env::var(name).ok())
            .map_err(|found| {
                let advice = "set the variable, or give a default: ${NAME:-path}";
                self.bad(&written.span(), key, Bad { expected: "a path", found: &found, advice })
            })?;
        Ok(tidy(&self.path.parent().unwrap_or(Path::new("")).join(expanded)))
    }
}

/// The path without ways down and up again, if it still leads to the same file.
fn tidy(path: &Path) -> PathBuf {
    let mut short = PathBuf::new();
    for part in path.components() {
        let is_way_down =
            short.components().next_back().is_some_and(|last| matches!(last, Component::Normal(_)));
        if part == Component::ParentDir && is_way_down {
            short.pop();
        } else {
            short.push(part);
        }
    }
    match (short.canonicalize(), path.canonicalize()) {
        (Ok(a), Ok(b)) if a == b => short,
        _ => path.to_owned(),
    }
}

/// What a value should have been, what it is, and what to do.
pub struct Bad<'a> {
    /// What would be accepted.
    pub expected: &'static str,
    /// What the file says.
    pub found: &'a str,
    /// What to do.
    pub advice: &'static str,
}
