//! A manifest that is built in code.

use super::Manifest;
use crate::registry::Registry;
use diagnostics::Diagnostic;
use std::path::Path;
use toml::{Table, Value};

/// Builds a manifest key by key. The content is checked when it is complete, as that of a file is. The recording of
/// its run holds it as TOML, which its text is too.
///
/// ```
/// use runtime::manifest::ManifestBuilder;
/// let manifest = ManifestBuilder::new()
///     .set("run.duration_s", 2.0)
///     .set("process.recorder.kind", "recorder")
///     .add("pass", toml::toml! { topic = "/plant/state" });
/// assert!(manifest.to_string().contains("duration_s = 2.0"));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ManifestBuilder(Table);

impl ManifestBuilder {
    /// A manifest that says nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets `key`, such as `process.plant.kind`. A value on the way to it that is not a table is replaced by one.
    #[must_use]
    pub fn set(mut self, key: &str, value: impl Into<Value>) -> Self {
        let mut path: Vec<&str> = key.split('.').collect();
        let last = path.pop().unwrap_or_default();
        let table = path.into_iter().fold(&mut self.0, |table, part| {
            let below = table.entry(part).or_insert_with(|| Value::Table(Table::new()));
            if !below.is_table() {
                *below = Value::Table(Table::new());
            }
            below.as_table_mut().expect("made one above")
        });
        table.insert(last.to_owned(), value.into());
        self
    }

    /// Adds `entry` to the list `key`, such as `pass`.
    #[must_use]
    pub fn add(mut self, key: &str, entry: Table) -> Self {
        let mut entries = match self.0.remove(key) {
            Some(Value::Array(entries)) => entries,
            Some(_) | None => Vec::new(),
        };
        entries.push(Value::Table(entry));
        self.0.insert(key.to_owned(), Value::Array(entries));
        self
    }

    /// The manifest, as if it stood at `path`: relative paths in it start at the folder of that.
    ///
    /// # Errors
    /// A [`Diagnostic`] at its place in the printed manifest.
    pub fn build(&self, path: &Path, registry: Registry) -> Result<Manifest, Diagnostic> {
        Manifest::parse(self.to_string(), path, &[], registry)
    }
}

/// The manifest as TOML.
impl std::fmt::Display for ManifestBuilder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}
