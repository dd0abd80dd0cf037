//! Logs in CSV: a header, then rows on one clock.

use crate::declaration::Entry;
use crate::log::{Log, Samples, known};
use crate::quantity::Quantity;

/// A CSV file, its cells as numbers; NaN where a cell has none.
pub struct CsvLog {
    headers: Vec<String>,
    time_s: Vec<f64>,
    /// As many as the row has, but for those without a header: a wide header over short rows costs no more than the file.
    rows: Vec<Vec<f64>>,
    /// The line of each row, from 1.
    lines: Vec<u64>,
}

impl CsvLog {
    /// Reads a file's bytes; `time` says which column is the time.
    pub fn parse(bytes: &[u8], time: Option<&Entry>) -> Result<Self, String> {
        let text = String::from_utf8_lossy(bytes);
        let text = text.trim_start_matches('\u{feff}');
        let delimiter = delimiter(text);
        vehicles::quotes::check(text.as_bytes(), delimiter).map_err(|stray| stray.to_string())?;
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .flexible(true)
            .delimiter(delimiter)
            .from_reader(text.as_bytes());
        let broken = |error: csv::Error| format!("it is not CSV: {error}; check `format`");
        let headers: Vec<String> = reader.headers().map_err(broken)?.iter().map(str::to_owned).collect();
        let (time_column, factor) = time_column(&headers, time)?;
        let (mut rows, mut lines) = (Vec::new(), Vec::new());
        for record in reader.records() {
            let record = record.map_err(broken)?;
            rows.push(numbers(&record, headers.len()));
            lines.push(line(text, &record));
        }
        let time_s = rows.iter().map(|row| cell(row, time_column) * factor).collect();
        Ok(Self { headers, time_s, rows, lines })
    }

    fn index(&self, name: &str) -> Result<usize, String> {
        find(&self.headers, name)
    }
}

impl Log for CsvLog {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, String> {
        if let Some(topic) = topic {
            return Err(format!("a CSV file has no topics, found `topic = \"{topic}\"`; remove it"));
        }
        let indices = names.iter().map(|name| self.index(name)).collect::<Result<Vec<_>, _>>()?;
        let pick = |row: &Vec<f64>| indices.iter().map(|&index| cell(row, index)).collect();
        let rows = self.rows.iter().map(pick).collect();
        Ok(Samples { time_s: self.time_s.clone(), rows, notes: Vec::new() })
    }

    fn line(&self, time_s: f64) -> Option<u64> {
        let off = |row: &usize| (self.time_s[*row] - time_s).abs();
        let rows = (0..self.rows.len()).filter(|row| self.time_s[*row].is_finite());
        self.lines.get(rows.min_by(|a, b| off(a).total_cmp(&off(b)))?).copied()
    }
}

/// The time column and the factor of its unit to seconds.
fn time_column(headers: &[String], time: Option<&Entry>) -> Result<(usize, f64), String> {
    let example = "add `time = { columns = [\"t\"], unit = \"s\" }` to `channels`";
    let time = time.ok_or_else(|| format!("no channel `time`, which a CSV file needs; {example}"))?;
    let [column] = time.columns.as_deref().unwrap_or_default() else {
        return Err(format!("the channel `time` names no single column; {example}"));
    };
    let unit = time.unit.as_deref().unwrap_or("(none)");
    let factor = Quantity::Time.dimension().factor(unit).ok_or_else(|| {
        let units = Quantity::Time.dimension().names(" or ");
        format!("the channel `time` has the unit {unit}, expected {units}; correct `unit`")
    })?;
    Ok((find(headers, column)?, factor))
}

fn find(headers: &[String], name: &str) -> Result<usize, String> {
    headers.iter().position(|header| header == name).ok_or_else(|| {
        let known = known(headers.iter().map(String::as_str));
        format!("no column `{name}`; it has {known}; correct the name in `channels`")
    })
}

fn numbers(record: &csv::StringRecord, length: usize) -> Vec<f64> {
    record.iter().take(length).map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()
}

/// The line of a record, from 1: the reader's place is in front of the line ends and empty lines before it.
fn line(text: &str, record: &csv::StringRecord) -> u64 {
    let Some(place) = record.position() else { return 0 };
    let from = usize::try_from(place.byte()).unwrap_or(usize::MAX);
    let before = text.as_bytes().get(from..).unwrap_or_default();
    let ends = before.iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
    place.line() + ends.filter(|byte| **byte == b'\n').count() as u64
}

/// A short row has no numbers behind its end.
fn cell(row: &[f64], index: usize) -> f64 {
    row.get(index).copied().unwrap_or(f64::NAN)
}

/// The delimiter that the header has most of.
fn delimiter(text: &str) -> u8 {
    let header = text.lines().next().unwrap_or_default();
    let count = |delimiter: u8| header.bytes().filter(|byte| *byte == delimiter).count();
    // The last of equals wins, which is the comma.
    [b'\t', b';', b','].into_iter().max_by_key(|delimiter| count(*delimiter)).unwrap_or(b',')
}
