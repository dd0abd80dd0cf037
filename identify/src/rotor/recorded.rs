//! Fields of a recording over time, in the units that it states.

use std::path::Path;

use diagnostics::Diagnostic;
use inputs::InputFiles;
use recorder::RecordingError;
use recorder::reader::Recording;
use recorder::series::Series;

use super::error::RotorError;
use super::stand::{Column, short_name};

/// Fields of one topic.
pub struct Recorded {
    /// When each sample was recorded, in s of simulation time.
    pub time_s: Vec<f64>,
    /// The fields by their names.
    fields: Vec<(String, Series)>,
}

impl Recorded {
    /// Reads the fields that are `columns`, each with its key in the stand file, of `topic` from the recording at `path`
    /// among `files`.
    pub fn read(
        files: &InputFiles,
        path: &Path,
        topic: &str,
        columns: &[(&'static str, &Column)],
    ) -> Result<Self, RotorError> {
        let file = short_name(path);
        let unreadable =
            |cause| Diagnostic::unreadable(path.display().to_string(), &cause).help("check the path");
        let bytes = files.bytes(path).map_err(unreadable)?;
        let recording = Recording::of_bytes(bytes, path)?;
        let fields: Vec<_> = columns.iter().map(|(_, column)| (topic, column.name())).collect();
        let series = recording.series(&fields).map_err(|cause| match cause {
            RecordingError::UnknownTopic { .. } | RecordingError::UnknownField { .. } => {
                RotorError::NoField { file: file.clone(), cause }
            }
            other => other.into(),
        })?;
        let time_s = series.first().map(seconds).unwrap_or_default();
        if time_s.is_empty() {
            let (what, advice) = (format!("{file}: {topic}"), "record a run that goes on for longer");
            return Err(RotorError::too_little(what, "samples", "none", advice));
        }
        for ((key, column), series) in columns.iter().zip(&series) {
            check_unit(&file, topic, key, column, &series.unit)?;
        }
        let names = columns.iter().map(|(_, column)| column.name().to_owned());
        Ok(Self { time_s, fields: names.zip(series).collect() })
    }

    /// The numbers of a field that was read.
    pub fn field(&self, name: &str) -> Option<&[f64]> {
        self.fields.iter().find(|(known, _)| known == name).map(|(_, series)| &series.value[..])
    }

    /// The names of the fields that were read.
    pub fn names(&self) -> Vec<String> {
        self.fields.iter().map(|(name, _)| name.clone()).collect()
    }
}

fn seconds(series: &Series) -> Vec<f64> {
    series.time_ns.iter().map(|time_ns| *time_ns as f64 * 1e-9).collect()
}

/// Refuses a unit that is not the one that is recorded; a recording of others may state none.
fn check_unit(
    file: &str,
    topic: &str,
    key: &'static str,
    column: &Column,
    recorded: &str,
) -> Result<(), RotorError> {
    if recorded.is_empty() || recorded == column.unit {
        return Ok(());
    }
    Err(RotorError::Unit {
        file: file.to_owned(),
        topic: topic.to_owned(),
        field: column.name().to_owned(),
        recorded: recorded.to_owned(),
        said: column.unit.clone(),
        key,
    })
}
