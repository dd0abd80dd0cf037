//! Files as a flights file names them: one, or the parts of a log in the order of time.

use std::fmt;
use std::ops::Range;

use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use toml::Spanned;

/// The value of a key `file`.
#[derive(Debug, Clone, PartialEq)]
pub enum Files {
    /// One file, or a pattern of files.
    One(String),
    /// Parts of one log in the order of time, each a file or a pattern of files.
    Parts(Vec<Spanned<String>>),
}

impl Files {
    /// The names as written, each with its place; `place` is that of the key's value.
    pub fn each(&self, place: Range<usize>) -> Vec<(&str, Range<usize>)> {
        match self {
            Self::One(name) => vec![(name, place)],
            Self::Parts(parts) => parts.iter().map(|part| (part.get_ref().as_str(), part.span())).collect(),
        }
    }

    /// True for a list.
    pub fn are_parts(&self) -> bool {
        matches!(self, Self::Parts(_))
    }
}

impl<'de> Deserialize<'de> for Files {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FilesVisitor)
    }
}

struct FilesVisitor;

impl<'de> Visitor<'de> for FilesVisitor {
    type Value = Files;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a file, or a list of the files of one log in the order of time")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Files, E> {
        Ok(Files::One(name.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Files, A::Error> {
        let mut parts = Vec::new();
        while let Some(part) = list.next_element::<Spanned<String>>()? {
            parts.push(part);
        }
        if parts.is_empty() {
            return Err(Error::invalid_length(0, &"at least one file"));
        }
        Ok(Files::Parts(parts))
    }
}
