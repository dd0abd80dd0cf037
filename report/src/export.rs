//! Recordings as tables, a table for each topic, for programs that read Parquet or CSV.

use crate::columns::{Column, write_parquet};
use diagnostics::Error;
use recorder::RecordingError;
use recorder::definition::{Comment, Leaf, Value, is_padding};
use recorder::reader::Recording;
use std::io::Write;

/// First bytes of an exported CSV file.
pub const CSV_START: &str = "tick,time_ns";
/// First bytes of a CSV file that explains the columns of an exported one.
pub const COLUMNS_START: &str = "column,unit,frame,meaning";
/// Explanation of the columns that every table has.
const STAMPS: [[&str; 4]; 2] = [
    ["tick", "", "", "tick at which the message was sent"],
    ["time_ns", "ns", "", "simulated time of this tick, from 0"],
];

/// Messages of a topic: a row for each message, a column for each field.
///
/// ```
/// use bus::Message as _;
/// use bus::announcement::Announcement;
/// use bus::messages::SetPoint;
/// use recorder::{reader::Recording, writer::RecordingWriter};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("a.mcap");
/// let mut writer = RecordingWriter::create(&path)?;
/// let pilot = writer.add_channel("/pilot/set_point", &Announcement::of(SetPoint::SCHEMA))?;
/// let set_point = SetPoint { altitude: 1.5, ..SetPoint::default() };
/// writer.write(pilot, 3, 3_000_000, &[&[0, 1, 0, 0], bytemuck::bytes_of(&set_point)].concat())?;
/// writer.finish()?;
///
/// let table = report::export::table(&Recording::open(&path)?, "/pilot/set_point")?;
/// let mut text = Vec::new();
/// table.write_csv(&mut text)?;
/// assert!(String::from_utf8(text)?.ends_with("\n3,3000000,0,0,1.5,0.0,0.0,0.0\n"));
/// let mut columns = Vec::new();
/// table.write_columns(&mut columns)?;
/// assert!(String::from_utf8(columns)?.contains("\naltitude,m,"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Table {
    tick: Vec<i64>,
    time_ns: Vec<i64>,
    fields: Vec<Field>,
}

/// A column with its path and unit, and with the frame and the meaning that the definition of the message states.
#[derive(Clone, Debug)]
struct Field {
    path: String,
    unit: String,
    frame: String,
    meaning: String,
    column: Column,
}

/// Returns the table of `topic` of `recording`, whole in memory: 16 bytes for each value.
///
/// # Errors
/// If the recording is damaged, or has no such topic.
pub fn table(recording: &Recording, topic: &str) -> Result<Table, Error> {
    let definition = recording.topic(topic)?;
    let mut table = Table::default();
    recording.visit::<RecordingError>(|message| {
        if message.topic == topic {
            table.add(message.tick, message.time_ns, &recording.decode_on(topic, message.cdr)?);
        }
        Ok(())
    })?;
    for field in &mut table.fields {
        let Comment { frame, meaning, .. } = definition.about(&field.path);
        (field.frame, field.meaning) = (frame, meaning);
    }
    Ok(table)
}

impl Table {
    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.tick.len()
    }

    /// Adds a message. A field that earlier messages lack has no value there.
    fn add(&mut self, tick: u32, time_ns: u64, leaves: &[Leaf]) {
        let row = self.rows();
        // Fields come in the order of the definition, so that the next column is nearly always the one.
        let mut next = 0;
        for leaf in leaves.iter().filter(|leaf| !is_padding(&leaf.path)) {
            let place = match self.fields.get(next) {
                Some(field) if field.path == leaf.path => next,
                _ => self.place_of(leaf),
            };
            let column = &mut self.fields[place].column;
            fill(column, row);
            push(column, &leaf.value);
            next = place + 1;
        }
        self.tick.push(tick.into());
        self.time_ns.push(i64::try_from(time_ns).unwrap_or(i64::MAX));
        for field in &mut self.fields {
            fill(&mut field.column, row + 1);
        }
    }

    /// Returns the column of `leaf`, a new one if it has none.
    fn place_of(&mut self, leaf: &Leaf) -> usize {
        if let Some(place) = self.fields.iter().position(|field| field.path == leaf.path) {
            return place;
        }
        let column = match leaf.value {
            Value::Float(_) => Column::Number(Vec::new()),
            Value::Integer(_) => Column::Integer(Vec::new()),
            Value::Text(_) => Column::Text(Vec::new()),
        };
        let (path, unit) = (leaf.path.clone(), leaf.unit.clone());
        self.fields.push(Field { path, unit, frame: String::new(), meaning: String::new(), column });
        self.fields.len() - 1
    }

    /// Writes the table as Parquet. Its metadata hold the unit of each field as `unit of FIELD`.
    ///
    /// # Errors
    /// If `out` cannot be written to.
    pub fn write_parquet(&self, out: impl Write + Send) -> Result<(), Error> {
        let stamps = [("tick", &self.tick), ("time_ns", &self.time_ns)]
            .map(|(name, values)| (name, Column::Whole(values.clone())));
        let stamps = stamps.iter().map(|(name, column)| (*name, column));
        let fields = self.fields.iter().map(|field| (field.path.as_str(), &field.column));
        let columns: Vec<(&str, &Column)> = stamps.chain(fields).collect();
        let units = self.fields.iter().filter(|field| !field.unit.is_empty());
        let units: Vec<(String, String)> =
            units.map(|field| (format!("unit of {}", field.path), field.unit.clone())).collect();
        let facts: Vec<(&str, String)> =
            units.iter().map(|(key, unit)| (key.as_str(), unit.clone())).collect();
        write_parquet(out, "messages", &columns, &facts)
    }

    /// Writes the table as CSV (RFC 4180), with an empty cell for a missing value.
    ///
    /// # Errors
    /// If `out` cannot be written to.
    pub fn write_csv(&self, out: impl Write) -> Result<(), Error> {
        let mut out = csv::Writer::from_writer(out);
        let paths = self.fields.iter().map(|field| field.path.as_str());
        out.write_record(CSV_START.split(',').chain(paths)).map_err(Error::new)?;
        for row in 0..self.rows() {
            let stamps = [self.tick[row].to_string(), self.time_ns[row].to_string()];
            let cells = self.fields.iter().map(|field| cell(&field.column, row));
            out.write_record(stamps.into_iter().chain(cells)).map_err(Error::new)?;
        }
        Ok(out.flush()?)
    }

    /// Writes a table of the columns as CSV: name, unit, frame and meaning of each. A cell is empty where the definition of the message
    /// does not state it.
    ///
    /// # Errors
    /// If `out` cannot be written to.
    pub fn write_columns(&self, out: impl Write) -> Result<(), Error> {
        let mut out = csv::Writer::from_writer(out);
        out.write_record(COLUMNS_START.split(',')).map_err(Error::new)?;
        let fields = self.fields.iter();
        let fields = fields
            .map(|Field { path, unit, frame, meaning, .. }| [path, unit, frame, meaning].map(String::as_str));
        for row in STAMPS.into_iter().chain(fields) {
            out.write_record(row).map_err(Error::new)?;
        }
        Ok(out.flush()?)
    }
}

/// Adds missing values up to row `rows`.
fn fill(column: &mut Column, rows: usize) {
    match column {
        Column::Number(values) => values.resize(values.len().max(rows), None),
        Column::Integer(values) => values.resize(values.len().max(rows), None),
        Column::Text(values) => values.resize(values.len().max(rows), None),
        Column::Verdict(values) => values.resize(values.len().max(rows), None),
        Column::Whole(_) | Column::Truth(_) => {}
    }
}

/// Adds `value`. A column that cannot hold it, such as one of 64-bit integers with a sign, becomes a column of texts.
fn push(column: &mut Column, value: &Value) {
    match (&mut *column, value) {
        (Column::Number(values), Value::Float(number)) => values.push(Some(*number)),
        (Column::Text(values), Value::Text(text)) => values.push(Some(text.clone())),
        (Column::Text(values), other) => values.push(Some(other.to_string())),
        (Column::Integer(values), Value::Integer(number)) if i64::try_from(*number).is_ok() => {
            values.push(i64::try_from(*number).ok());
        }
        (other, value) => {
            let before = (0..length(other)).map(|row| Some(cell(other, row)).filter(|text| !text.is_empty()));
            *column = Column::Text(before.collect());
            push(column, value);
        }
    }
}

fn length(column: &Column) -> usize {
    match column {
        Column::Number(values) => values.len(),
        Column::Integer(values) => values.len(),
        Column::Text(values) => values.len(),
        Column::Whole(values) => values.len(),
        Column::Truth(values) => values.len(),
        Column::Verdict(values) => values.len(),
    }
}

/// Returns the text of a value; empty for a missing one. The text of a number gives the same number when it is read.
fn cell(column: &Column, row: usize) -> String {
    let text = match column {
        Column::Number(values) => values[row].map(|number| format!("{number:?}")),
        Column::Integer(values) => values[row].map(|number| number.to_string()),
        Column::Text(values) => values[row].clone(),
        Column::Whole(values) => Some(values[row].to_string()),
        Column::Truth(values) => Some(values[row].to_string()),
        Column::Verdict(values) => values[row].map(|value| value.to_string()),
    };
    text.unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::{Column, Table};
    use recorder::definition::{Leaf, Value};

    fn leaf(path: &str, value: Value) -> Leaf {
        Leaf { path: path.to_owned(), unit: "m".to_owned(), value }
    }

    #[test]
    fn messages_of_other_lengths_have_missing_values() {
        let mut table = Table::default();
        table.add(0, 0, &[leaf("range[0]", Value::Float(1.0))]);
        table.add(1, 10, &[leaf("range[0]", Value::Float(2.0)), leaf("range[1]", Value::Float(3.0))]);
        table.add(2, 20, &[]);
        assert_eq!(table.fields[0].column, Column::Number(vec![Some(1.0), Some(2.0), None]));
        assert_eq!(table.fields[1].column, Column::Number(vec![None, Some(3.0), None]));
        let mut text = Vec::new();
        table.write_csv(&mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(text, "tick,time_ns,range[0],range[1]\n0,0,1.0,\n1,10,2.0,3.0\n2,20,,\n");
    }

    #[test]
    fn integers_beyond_64_bits_with_a_sign_and_padding_are_exact() {
        let mut table = Table::default();
        let seeds = [7, i128::from(u64::MAX)];
        for (tick, seed) in seeds.into_iter().enumerate() {
            let leaves = [leaf("seed", Value::Integer(seed)), leaf("pad0", Value::Integer(0))];
            table.add(tick as u32, 0, &leaves);
        }
        let texts = seeds.map(|seed| Some(seed.to_string())).to_vec();
        assert_eq!(table.fields.len(), 1, "padding is left out");
        assert_eq!(table.fields[0].column, Column::Text(texts));
    }

    #[test]
    fn texts_with_commas_and_quotes_are_quoted() {
        let mut table = Table::default();
        table.add(0, 0, &[leaf("name", Value::Text("a \"b\", c".to_owned()))]);
        let mut text = Vec::new();
        table.write_csv(&mut text).unwrap();
        assert!(String::from_utf8(text).unwrap().ends_with("\n0,0,\"a \"\"b\"\", c\"\n"));
    }
}
