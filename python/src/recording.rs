//! Recordings as columns.

use crate::error::raised;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict};
use recorder::fields::TopicFields;
use std::path::PathBuf;

/// A recording; `hummingbus/_recordings.py` has what people use.
#[pyclass]
pub struct Recording(recorder::reader::Recording);

#[pymethods]
impl Recording {
    /// Opens the recording at `path`.
    #[new]
    fn open(path: PathBuf) -> PyResult<Self> {
        recorder::reader::Recording::open(&path).map(Self).map_err(raised)
    }

    /// Topics with the types and the numbers of their messages.
    fn topics(&self) -> Vec<(String, String, u64)> {
        let topics = self.0.topics().iter();
        topics.map(|(name, topic)| (name.clone(), topic.type_name.clone(), topic.message_count)).collect()
    }

    /// Columns of doubles of `topic`, and the units: `time_ns` (unsigned integers) and each of `fields`; all numbers of its
    /// messages where there are none.
    fn columns<'py>(
        &self,
        py: Python<'py>,
        topic: &str,
        fields: Vec<String>,
    ) -> PyResult<(Bound<'py, PyDict>, Units)> {
        let (columns, units) = py.detach(|| self.read(topic, fields)).map_err(raised)?;
        let made = PyDict::new(py);
        for (name, bytes) in columns {
            made.set_item(name, PyByteArray::new(py, &bytes))?;
        }
        Ok((made, units))
    }
}

/// Fields with their units.
type Units = Vec<(String, String)>;
/// Columns by their names, each as bytes.
type Columns = Vec<(String, Vec<u8>)>;

impl Recording {
    fn read(&self, topic: &str, mut fields: Vec<String>) -> Result<(Columns, Units), String> {
        let said = |error: recorder::RecordingError| error.to_string();
        let mut reader: TopicFields = self.0.fields_of(topic).map_err(said)?;
        let mut records =
            self.0.messages().filter(|record| record.as_ref().map_or(true, |record| record.topic == topic));
        let Some(first) = records.next().transpose().map_err(said)? else {
            return Ok((vec![("time_ns".to_owned(), Vec::new())], Vec::new()));
        };
        if fields.is_empty() {
            let leaves = self.0.decode(&first).map_err(said)?.into_iter();
            let is_number = |leaf: &recorder::definition::Leaf| leaf.value.as_f64().is_some();
            // Padding says nothing, and the stamp is the time.
            let is_meant = |path: &str| {
                !path.starts_with("stamp.") && !path.starts_with("header.stamp.") && !path.contains("pad0")
            };
            fields =
                leaves.filter(|leaf| is_number(leaf) && is_meant(&leaf.path)).map(|leaf| leaf.path).collect();
        }
        let numbers: Vec<usize> = fields.iter().map(|field| reader.add(field)).collect();
        let (mut time_ns, mut columns) = (Vec::new(), vec![Vec::new(); fields.len()]);
        for record in std::iter::once(Ok(first)).chain(records) {
            let record = record.map_err(said)?;
            reader.read(&record.cdr).map_err(said)?;
            time_ns.extend_from_slice(&record.time_ns.to_le_bytes());
            for (column, (number, field)) in columns.iter_mut().zip(numbers.iter().zip(&fields)) {
                match reader.values(*number) {
                    [value] => column.extend_from_slice(&value.to_le_bytes()),
                    values => {
                        return Err(format!(
                            "{field} of {topic} is {} numbers, name one of them",
                            values.len()
                        ));
                    }
                }
            }
        }
        let units = fields
            .iter()
            .zip(&numbers)
            .map(|(field, number)| (field.clone(), reader.unit(*number).to_owned()));
        let units = units.collect();
        let columns = fields.into_iter().zip(columns);
        Ok((std::iter::once(("time_ns".to_owned(), time_ns)).chain(columns).collect(), units))
    }
}
