//! JSON files with which the launcher and the processes of a run exchange data that does not change every tick.

use crate::error::BusError;
use crate::user_file;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Writes `value` to `path` in one step: a reader never finds a part of it.
pub(crate) fn store(path: &Path, value: &impl Serialize) -> Result<(), BusError> {
    // The types of this crate serialise: their maps have strings as keys.
    let text = serde_json::to_string_pretty(value).unwrap_or_else(|error| unreachable!("{error}"));
    let draft = path.with_extension("draft");
    let written = std::fs::write(&draft, text).and_then(|()| std::fs::rename(&draft, path));
    written.map_err(|source| BusError::File { action: "write", path: path.to_owned(), source })
}

/// Reads the value at `path`; `expected` describes it.
pub(crate) fn load<T: DeserializeOwned>(path: &Path, expected: &'static str) -> Result<T, BusError> {
    let text = user_file::read_text(path);
    let text = text.map_err(|source| BusError::File { action: "read", path: path.to_owned(), source })?;
    serde_json::from_str(&text).map_err(|error| BusError::Content {
        path: path.to_owned(),
        expected,
        found: error.to_string(),
    })
}
