//! One log, a table in CSV or a recording: its columns in SI.

use std::path::Path;

use diagnostics::Diagnostic;
use diagnostics::unit::TIME;
use inputs::InputFiles;
use vehicles::table::Table;

use super::error::RotorError;
use super::recorded::Recorded;
use super::stand::{Column, Source, short_name};

/// Seconds of a day; a wall clock begins anew after them.
const DAY_S: f64 = 86_400.0;
/// How a recording begins (MCAP's specification, "Magic").
const RECORDING: &[u8] = b"\x89MCAP0\r\n";

/// The times and the numbers of a log.
pub struct LogTable {
    file: String,
    time_s: Vec<f64>,
    content: Content,
}

/// What a log is made of.
enum Content {
    /// The cells of a table.
    Table(Table),
    /// Fields of a recording.
    Recorded(Recorded),
}

impl LogTable {
    /// Reads a log. Every row has to have a time, and none may go back.
    pub fn read(source: &Source) -> Result<Self, RotorError> {
        let file = short_name(source.file);
        if let Some(topic) = source.topic {
            let recorded = Recorded::read(source.files, source.file, topic, &source.columns)?;
            let time_s = recorded.time_s.clone();
            let place = |row: usize| format!("sample {} of {topic}", row + 1);
            check_times(&file, &time_s, place)?;
            return Ok(Self { file, time_s, content: Content::Recorded(recorded) });
        }
        let table = table(source.files, source.file, &file)?;
        let Some(column) = source.time else { return Err(no_column(&file, "time", table.headers)) };
        let time_s = times(&file, &table, column)?;
        let place = |row: usize| format!("line {}: column `{}`", table.rows[row].line, column.name());
        check_times(&file, &time_s, place)?;
        Ok(Self { file, time_s, content: Content::Table(table) })
    }

    /// The times of the rows in s.
    pub fn times(&self) -> &[f64] {
        &self.time_s
    }

    /// The numbers of a column, each times `factor`; NaN where there is none.
    pub fn column(&self, column: &Column, factor: f64) -> Result<Vec<f64>, RotorError> {
        match &self.content {
            Content::Table(table) => numbers(&self.file, table, column, factor),
            Content::Recorded(recorded) => match recorded.field(column.name()) {
                Some(numbers) => Ok(numbers.iter().map(|number| number * factor).collect()),
                None => Err(no_column(&self.file, column.name(), recorded.names())),
            },
        }
    }
}

fn table(files: &InputFiles, path: &Path, file: &str) -> Result<Table, RotorError> {
    let bytes = files
        .bytes(path)
        .map_err(|cause| Diagnostic::unreadable(path.display().to_string(), &cause).help("check the path"))?;
    if bytes.starts_with(RECORDING) {
        return Err(RotorError::too_little(
            file,
            "a table",
            "a recording",
            "give its `topic`, and a `field` for each `column`",
        ));
    }
    Table::parse(&bytes).map_err(|cause| RotorError::Table { file: file.to_owned(), cause })
}

fn no_column(file: &str, column: &str, known: Vec<String>) -> RotorError {
    RotorError::NoColumn { file: file.to_owned(), column: column.to_owned(), known }
}

fn index(file: &str, table: &Table, column: &Column) -> Result<usize, RotorError> {
    let name = column.name();
    table.column(name).ok_or_else(|| no_column(file, name, table.headers.clone()))
}

fn numbers(file: &str, table: &Table, column: &Column, factor: f64) -> Result<Vec<f64>, RotorError> {
    Ok(table.numbers(index(file, table, column)?).map(|number| number * factor).collect())
}

/// The numbers of a time column in s; NaN where a cell has no time.
fn times(file: &str, table: &Table, column: &Column) -> Result<Vec<f64>, RotorError> {
    if !column.is_wall_clock() {
        return numbers(file, table, column, column.factor(TIME));
    }
    let index = index(file, table, column)?;
    let cells = table.rows.iter().map(|row| row.cell(index));
    Ok(unwrapped(cells.map(|cell| seconds_of_day(cell).unwrap_or(f64::NAN))))
}

/// Refuses rows without a time, and times that go back; `place` tells where a row stands.
fn check_times(file: &str, time_s: &[f64], place: impl Fn(usize) -> String) -> Result<(), RotorError> {
    let fault = |row: usize, found: &'static str| {
        Err(RotorError::Time { file: file.to_owned(), place: place(row), found })
    };
    if let Some(row) = time_s.iter().position(|time| !time.is_finite()) {
        return fault(row, "has no time");
    }
    match time_s.windows(2).position(|pair| pair[1] < pair[0]) {
        Some(row) => fault(row + 1, "goes back"),
        None => Ok(()),
    }
}

/// Seconds since midnight of `YYYY-MM-DD HH:MM:SS:mmm`; a point before the milliseconds will do, and more digits.
fn seconds_of_day(cell: &str) -> Option<f64> {
    let time = cell.rsplit([' ', 'T']).next()?;
    let mut parts = time.split([':', '.']);
    let mut next = || parts.next()?.parse::<f64>().ok();
    let whole = next()? * 3600.0 + next()? * 60.0 + next()?;
    let digits = parts.next().unwrap_or("0");
    Some(whole + format!("0.{digits}").parse::<f64>().ok()?)
}

/// Times that go on after midnight.
fn unwrapped(times: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut days_s = 0.0;
    let mut last = f64::NEG_INFINITY;
    times
        .map(|time| {
            if time + days_s < last - 0.5 * DAY_S {
                days_s += DAY_S;
            }
            last = time + days_s;
            last
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wall_clocks_go_on_after_midnight() {
        let cells = ["2019-11-07 23:59:59:998", "2019-11-08 00:00:00:001"];
        let times = unwrapped(cells.iter().map(|cell| seconds_of_day(cell).unwrap()));
        assert!((times[1] - times[0] - 0.003).abs() < 1e-9, "{times:?}");
    }
}
