//! One log, a table in CSV or a recording: its columns in SI.

use diagnostics::Diagnostic;
use diagnostics::unit::TIME;
use vehicles::table::{Table, TableError};
use vehicles::wall_clock;

use super::error::RotorError;
use super::recorded::Recorded;
use super::stand::{Column, Source, short_name};

/// First bytes of a recording (MCAP's specification, "Magic").
const RECORDING: &[u8] = b"\x89MCAP0\r\n";

/// Rows of a log at least: a speed is steady between two.
const ROWS_MIN: usize = 2;

/// The times and the numbers of a log.
pub struct LogTable {
    file: String,
    time_s: Vec<f64>,
    content: Content,
}

/// Content of a log.
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
        let table = table(source, &file)?;
        let Some(column) = source.time else { return Err(no_column(&file, "time", table.headers)) };
        let time_s = times(&file, &table, column)?;
        let place = |row: usize| format!("line {}: column `{}`", table.rows.line(row), column.name());
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

fn table(source: &Source, file: &str) -> Result<Table, RotorError> {
    let path = source.file;
    let bytes = source
        .files
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
    let columns = source.columns.iter().map(|(_, column)| *column).chain(source.time);
    let names: Vec<&str> = columns.map(Column::name).collect();
    let read = Table::parse(&bytes, &names, source.csv).and_then(|table| {
        table.check_lengths()?;
        // A file with another header is another file.
        names.iter().try_for_each(|name| table.column(name).map(drop))?;
        table.check_rows(ROWS_MIN)?;
        Ok(table)
    });
    read.map_err(|cause| unusable(file, cause))
}

fn unusable(file: &str, cause: TableError) -> RotorError {
    RotorError::Table { file: file.to_owned(), cause }
}

fn no_column(file: &str, column: &str, known: Vec<String>) -> RotorError {
    RotorError::NoColumn { file: file.to_owned(), column: column.to_owned(), known }
}

fn index(file: &str, table: &Table, column: &Column) -> Result<usize, RotorError> {
    table.column(column.name()).map_err(|cause| unusable(file, cause.into()))
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
    Ok(wall_clock::times(table.rows.iter().map(|row| row.cell(index))))
}

/// Refuses rows without a time, and times that go back; `place` describes the place of a row.
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
