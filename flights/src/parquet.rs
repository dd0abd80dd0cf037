//! Logs in Parquet: a table of columns with types.

mod bits;
mod footer;
mod kind;
mod pages;
mod thrift;
mod values;

use parquet::file::metadata::ParquetMetaData;
use parquet::schema::types::SchemaDescriptor;
use vehicles::table::{TableError, column_of, shown};
use vehicles::wall_clock;

use crate::arrays;
use crate::declaration::Entry;
use crate::error::{LogError, Spot};
use crate::form::Form;
use crate::log::{Log, Samples};
use crate::number_rows::NumberRows;
use crate::rows;

use kind::Kind;

/// A Parquet file; a cell without a number is NaN.
pub struct ParquetLog {
    bytes: Vec<u8>,
    metadata: ParquetMetaData,
    headers: Vec<String>,
    time_s: Vec<f64>,
    /// First row of the recording that is used.
    first_row: usize,
}

impl ParquetLog {
    /// Reads a file's bytes.
    pub fn parse(bytes: Vec<u8>, form: &Form<'_>) -> Result<Self, LogError> {
        let metadata = footer::read(&bytes)?;
        let headers = headers(metadata.file_metadata().schema_descr());
        let mut log = Self { bytes, metadata, headers, time_s: Vec::new(), first_row: 0 };
        log.time_s = log.times(form.time)?;
        log.choose(form)?;
        Ok(log)
    }

    /// Cuts the times to one recording.
    fn choose(&mut self, form: &Form<'_>) -> Result<(), LogError> {
        let places = rows::Places { name: "row", number: &|row| row as u64 + 1 };
        rows::check_forward(&self.time_s, form.time, &places)?;
        let part = rows::recording(&self.time_s, form, &places)?;
        self.first_row = part.start;
        self.time_s.truncate(part.end);
        self.time_s.drain(..part.start);
        Ok(())
    }

    /// The times of the rows in s, by the unit of the column's type or else as declared.
    fn times(&self, time: Option<&Entry>) -> Result<Vec<f64>, LogError> {
        let (time, name) = rows::time_column(time, "a Parquet file")?;
        let index = self.column(&name.plain)?;
        let descriptor = self.metadata.file_metadata().schema_descr().column(index);
        let factor = match (Kind::of(&descriptor), time.unit.as_deref()) {
            (Kind::Times(_), None | Some(wall_clock::UNIT)) => 1.0,
            (Kind::Times(unit), Some(declared)) if unit == declared => 1.0,
            (Kind::Times(unit), Some(declared)) => {
                let expected = format!(
                    "\"{unit}\" or no unit, as the column `{}` has a type of times",
                    shown(&name.plain)
                );
                let found = format!("\"{declared}\"");
                return Err(LogError::unexpected(
                    Spot::Key("time.unit"),
                    expected,
                    found,
                    "leave it out: the file states the unit",
                ));
            }
            (_, unit) => rows::time_factor(unit, ", as the type of the column says none")?,
        };
        let [scale, offset] = rows::time_scaling(time)?;
        let numbers = values::read(&self.bytes, &self.metadata, index)?;
        Ok(numbers.iter().map(|number| (number * name.sign() * scale + offset) * factor).collect())
    }

    fn column(&self, name: &str) -> Result<usize, LogError> {
        if let Some((list, _)) = arrays::indexed(name).filter(|(list, _)| self.is_list(list)) {
            return Err(values::not_numbers(Spot::Named("column", shown(list)), "lists"));
        }
        Ok(column_of(&self.headers, None, name).map_err(TableError::from)?)
    }

    /// True if the column `name` holds lists of numbers.
    fn is_list(&self, name: &str) -> bool {
        let columns = self.metadata.file_metadata().schema_descr().columns();
        columns.iter().any(|column| {
            column.max_rep_level() > 0 && column.path().parts().first().is_some_and(|part| part == name)
        })
    }
}

impl Log for ParquetLog {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, LogError> {
        if let Some(topic) = topic {
            let expected = "none, as a Parquet file has no topics";
            return Err(LogError::unexpected(Spot::Key("topic"), expected, topic, "remove it"));
        }
        let mut rows = NumberRows::unknown(names.len(), self.time_s.len());
        for (index, name) in names.iter().enumerate() {
            let numbers = values::read(&self.bytes, &self.metadata, self.column(name)?)?;
            if numbers.iter().all(|number| !number.is_finite()) {
                let at = Spot::Named("column", shown(name));
                return Err(LogError::unexpected(at, "numbers", "none in any row", "name another column"));
            }
            rows.set_column(index, numbers.into_iter().skip(self.first_row));
        }
        Ok(Samples { time_s: self.time_s.clone(), rows, ..Samples::default() })
    }

    fn columns(&self) -> Vec<String> {
        self.headers.clone()
    }
}

/// The names of the columns; of a column within a group, with the group's name and a point in front.
fn headers(schema: &SchemaDescriptor) -> Vec<String> {
    schema.columns().iter().map(|column| column.path().string()).collect()
}
