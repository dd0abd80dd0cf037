//! Logs in CSV: a header, then rows on one clock.

use vehicles::table::{ColumnError, Row, Table, TableError, shown};
use vehicles::wall_clock;

use crate::arrays;
use crate::declaration::Entry;
use crate::error::{LogError, Spot};
use crate::form::Form;
use crate::log::{Log, Samples};
use crate::number_rows::NumberRows;
use crate::rows;

/// A CSV file; a cell that holds no number is NaN.
pub struct CsvLog {
    table: Table,
    time_s: Vec<f64>,
}

impl CsvLog {
    /// Reads a file's bytes.
    pub fn parse(bytes: &[u8], form: &Form<'_>) -> Result<Self, LogError> {
        let names = form.channels.iter().copied().chain(form.time).flat_map(Entry::names);
        let names: Vec<&str> = names.map(|name| name.plain.as_str()).collect();
        let mut table = Table::parse(bytes, &names, form.dialect)?;
        check_arrays(&table)?;
        table.check_lengths()?;
        let mut time_s = times(&table, form.time)?;
        table.check_rows(form.rows_min)?;
        let places = rows::Places { name: "line", number: &|row| table.rows.line(row) };
        rows::check_forward(&time_s, form.time, &places)?;
        let part = rows::recording(&time_s, form, &places)?;
        table.rows.keep(part.clone());
        time_s.truncate(part.end);
        time_s.drain(..part.start);
        Ok(Self { table, time_s })
    }
}

/// The times of the rows in s; NaN where a cell has none.
fn times(table: &Table, time: Option<&Entry>) -> Result<Vec<f64>, LogError> {
    let (time, column) = rows::time_column(time, "a CSV file")?;
    if time.unit.as_deref() == Some(wall_clock::UNIT) {
        let index = table.column(&column.plain).map_err(TableError::from)?;
        let times = wall_clock::times(table.rows.iter().map(|row| row.cell(index)));
        check_times(table, &column.plain, &times, "times of day, as 10:00:04.25", "correct `time.unit`")?;
        return Ok(times);
    }
    let unit = time.unit.as_deref();
    let of_day = format!(", or \"{}\" for times of day", wall_clock::UNIT);
    let factor = rows::time_factor(unit, &of_day)?;
    let [scale, offset] = rows::time_scaling(time)?;
    let numbers = numbers(table, &column.plain)?;
    let advice = "name another column, or set `unit = \"wall clock\"` in the channel `time` for times of day";
    check_times(table, &column.plain, &numbers, &format!("numbers in {}", unit.unwrap_or_default()), advice)?;
    Ok(numbers.iter().map(|time| (time * column.sign() * scale + offset) * factor).collect())
}

/// Refuses a column of which most cells hold no time, with their number and the first of them. Rows without any cell do
/// not count.
fn check_times(
    table: &Table,
    name: &str,
    times: &[f64],
    expected: &str,
    advice: &'static str,
) -> Result<(), LogError> {
    let Ok(column) = table.column(name) else { return Ok(()) };
    let is_filled = |row: Row<'_>| row.cells().any(|cell| !cell.is_empty());
    let rows = || table.rows.iter().zip(times).filter(|(row, _)| is_filled(*row));
    let without = || rows().filter(|(_, time)| !time.is_finite());
    let (count, of) = (without().count(), rows().count());
    match without().next().filter(|_| 2 * count > of) {
        None => Ok(()),
        Some((row, _)) => {
            let (cell, line, name) = (shown(row.cell(column)), row.line, shown(name));
            let found =
                format!("none in {count} of {of} rows, first `{cell}` in line {line}, column `{name}`");
            Err(LogError::unexpected(Spot::Key("time"), expected, found, advice))
        }
    }
}

impl Log for CsvLog {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, LogError> {
        if let Some(topic) = topic {
            let expected = "none, as a CSV file has no topics";
            return Err(LogError::unexpected(Spot::Key("topic"), expected, topic, "remove it"));
        }
        let mut rows = NumberRows::unknown(names.len(), self.time_s.len());
        for (index, name) in names.iter().enumerate() {
            let numbers = numbers(&self.table, name)?;
            check_numbers(&self.table, name, &numbers)?;
            rows.set_column(index, numbers);
        }
        Ok(Samples { time_s: self.time_s.clone(), rows, ..Samples::default() })
    }

    fn columns(&self) -> Vec<String> {
        self.table.headers.clone()
    }

    fn line(&self, time_s: f64) -> Option<u64> {
        let off = |row: &usize| (self.time_s[*row] - time_s).abs();
        let rows = (0..self.time_s.len()).filter(|row| self.time_s[*row].is_finite());
        let nearest = rows.min_by(|a, b| off(a).total_cmp(&off(b)))?;
        Some(self.table.rows.line(nearest))
    }
}

/// The numbers of the column `name`, or of a part of a column of arrays.
fn numbers(table: &Table, name: &str) -> Result<Vec<f64>, LogError> {
    let missing = match table.column(name) {
        Ok(column) => return Ok(table.numbers(column).collect()),
        Err(missing @ ColumnError::Missing { .. }) => missing,
        Err(error) => return Err(TableError::from(error).into()),
    };
    let (column, indices) = array_of(table, name).ok_or_else(|| TableError::from(missing))?;
    table
        .rows
        .iter()
        .map(|row| {
            array_part(row.cell(column), &indices).ok_or_else(|| {
                let at = Spot::Cell { line: row.line, column: shown(&table.headers[column]) };
                let expected = expected_array(&indices);
                let found = format!("`{}`", shown(row.cell(column)));
                let advice = "correct the line, or name a column for each number";
                LogError::unexpected(at, expected, found, advice)
            })
        })
        .collect()
}

/// The column of arrays of which `name` is a part, and its indices in the arrays, the outermost first.
fn array_of(table: &Table, name: &str) -> Option<(usize, Vec<usize>)> {
    let (mut part, mut indices) = (name, Vec::new());
    while let Some((array, index)) = arrays::indexed(part) {
        indices.insert(0, index);
        if let Ok(column) = table.column(array) {
            return Some((column, indices));
        }
        part = array;
    }
    None
}

/// Returns the words for an array that has a number at `indices`.
fn expected_array(indices: &[usize]) -> String {
    match indices {
        [index] => format!("an array of more than {index} numbers, such as \"[0.1, 0.2, 0.3]\""),
        _ => {
            let part: String = indices.iter().map(|index| format!("[{index}]")).collect();
            format!("arrays in an array, such as \"[[0.1, 0.2], [0.3, 0.4]]\", with a number {part}")
        }
    }
}

/// Refuses a column in which no cell holds a number, with its first cell that holds something.
fn check_numbers(table: &Table, name: &str, numbers: &[f64]) -> Result<(), LogError> {
    let Ok(column) = table.column(name) else { return Ok(()) };
    let filled = table.rows.iter().find(|row| !row.cell(column).is_empty());
    match filled.filter(|_| numbers.iter().all(|number| !number.is_finite())) {
        None => check_digits(table, column, name, numbers),
        Some(row) => {
            let at = Spot::Cell { line: row.line, column: shown(name) };
            let advice = "no cell of the column holds one: name another column, or set `csv.decimal` or `csv.delimiter`";
            Err(LogError::unexpected(at, "a number", format!("`{}`", shown(row.cell(column))), advice))
        }
    }
}

/// Refuses a column in which more than one of twenty filled cells has digits and is no number, such as `(0.5)` or `1,234.5`.
/// If these cells were left out, the rest would be chosen by its values. Words for NaN with digits have a `#`, as `-1.#IND`.
fn check_digits(table: &Table, column: usize, name: &str, numbers: &[f64]) -> Result<(), LogError> {
    const CELLS_FOR_ONE_UNREAD: usize = 20;
    let is_unread = |cell: &str| {
        let has_digit = cell.bytes().any(|byte| byte.is_ascii_digit());
        has_digit && !cell.contains('#') && table.number(cell).is_none()
    };
    let rows = || table.rows.iter().zip(numbers);
    let unread = || rows().filter(|(row, number)| number.is_nan() && is_unread(row.cell(column)));
    let (count, of) = (unread().count(), rows().filter(|(row, _)| !row.cell(column).is_empty()).count());
    match unread().next().filter(|_| CELLS_FOR_ONE_UNREAD * count > of) {
        None => Ok(()),
        Some((row, _)) => {
            let at = Spot::Cell { line: row.line, column: shown(name) };
            let found = format!("`{}`, and the like in {count} of {of} cells", shown(row.cell(column)));
            let advice = "write the numbers without signs, marks and units of their own, such as -1234.5";
            Err(LogError::unexpected(at, "a number", found, advice))
        }
    }
}

/// A number of the array in a cell; NaN of a cell that is empty, `None` where there is none.
fn array_part(cell: &str, indices: &[usize]) -> Option<f64> {
    if cell.is_empty() { Some(f64::NAN) } else { arrays::part(cell, indices) }
}

/// Refuses arrays that their own delimiters take apart: all columns behind them would hold other numbers.
fn check_arrays(table: &Table) -> Result<(), LogError> {
    let is_cut = |cell: &str| cell.starts_with('[') && !cell.contains(']');
    for row in table.rows.iter().filter(|row| row.len() > table.headers.len()) {
        let cut = table.headers.iter().zip(row.cells()).find(|(_, cell)| is_cut(cell));
        if let Some((column, cell)) = cut {
            let at = Spot::Cell { line: row.line, column: shown(column) };
            let expected = "an array in quotation marks, or a file with other delimiters between its columns";
            return Err(LogError::unexpected(at, expected, format!("`{}`", shown(cell)), "write the log so"));
        }
    }
    Ok(())
}
