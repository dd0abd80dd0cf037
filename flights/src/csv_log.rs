//! Logs in CSV: a header, then rows on one clock.

use vehicles::table::Table;

use crate::arrays;
use crate::declaration::Entry;
use crate::error::{LogError, Spot};
use crate::log::{Log, Samples};
use crate::quantity::Quantity;

/// A CSV file; a cell that holds no number is NaN.
pub struct CsvLog {
    table: Table,
    time_s: Vec<f64>,
}

impl CsvLog {
    /// Reads a file's bytes; `time` says which column is the time.
    pub fn parse(bytes: &[u8], time: Option<&Entry>) -> Result<Self, LogError> {
        let table = Table::parse(bytes)?;
        check_arrays(&table)?;
        let (column, unit) = match time.map(|time| (time.columns.as_deref(), time.unit.as_deref())) {
            Some((Some([column]), unit)) => (column, unit.unwrap_or("(none)")),
            found => {
                let expected = "a channel with one column, which a CSV file needs";
                let found = if found.is_some() { "no single column" } else { "no channel `time`" };
                let advice = "add `time = { columns = [\"t\"], unit = \"s\" }` to `channels`";
                return Err(LogError::unexpected(Spot::Key("time"), expected, found, advice));
            }
        };
        let dimension = Quantity::Time.dimension();
        let factor = dimension.factor(unit).ok_or_else(|| {
            LogError::unexpected(Spot::Key("time.unit"), dimension.names(" or "), unit, "correct it")
        })?;
        let time_s = numbers(&table, column)?.iter().map(|time| time * factor).collect();
        Ok(Self { table, time_s })
    }
}

impl Log for CsvLog {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, LogError> {
        if let Some(topic) = topic {
            let expected = "none, as a CSV file has no topics";
            return Err(LogError::unexpected(Spot::Key("topic"), expected, topic, "remove it"));
        }
        let mut rows = vec![Vec::with_capacity(names.len()); self.time_s.len()];
        for name in names {
            let numbers = numbers(&self.table, name)?;
            rows.iter_mut().zip(numbers).for_each(|(row, number)| row.push(number));
        }
        Ok(Samples { time_s: self.time_s.clone(), rows, notes: Vec::new() })
    }

    fn line(&self, time_s: f64) -> Option<u64> {
        let off = |row: &usize| (self.time_s[*row] - time_s).abs();
        let rows = (0..self.time_s.len()).filter(|row| self.time_s[*row].is_finite());
        Some(self.table.rows[rows.min_by(|a, b| off(a).total_cmp(&off(b)))?].line)
    }
}

/// The numbers of the column `name`, or of a part of a column of arrays.
fn numbers(table: &Table, name: &str) -> Result<Vec<f64>, LogError> {
    if let Some(column) = table.column(name) {
        return Ok(table.numbers(column).collect());
    }
    let array = arrays::indexed(name).and_then(|(array, index)| Some((table.column(array)?, index)));
    let (column, index) =
        array.ok_or_else(|| LogError::missing("column", name, &table.headers, "the name in `channels`"))?;
    table
        .rows
        .iter()
        .map(|row| {
            array_part(row.cell(column), index).ok_or_else(|| {
                let at = Spot::Cell { line: row.line, column: table.headers[column].clone() };
                let expected = format!("an array of more than {index} numbers, such as \"[0.1, 0.2, 0.3]\"");
                let found = format!("`{}`", shortened(row.cell(column)));
                let advice = "correct the line, or name a column for each number";
                LogError::unexpected(at, expected, found, advice)
            })
        })
        .collect()
}

/// A number of the array in a cell; NaN of a cell that is empty, `None` where there is none.
fn array_part(cell: &str, index: usize) -> Option<f64> {
    if cell.is_empty() { Some(f64::NAN) } else { arrays::numbers(cell)?.get(index).copied() }
}

fn shortened(cell: &str) -> String {
    const SHOWN: usize = 40;
    let rest = if cell.chars().count() > SHOWN { "..." } else { "" };
    cell.chars().take(SHOWN).collect::<String>() + rest
}

/// Refuses arrays that their own delimiters take apart: all columns behind them would hold other numbers.
fn check_arrays(table: &Table) -> Result<(), LogError> {
    let is_cut = |cell: &str| cell.starts_with('[') && !cell.contains(']');
    for row in table.rows.iter().filter(|row| row.cells.len() > table.headers.len()) {
        let cut = table.headers.iter().zip(&row.cells).find(|(_, cell)| is_cut(cell));
        if let Some((column, cell)) = cut {
            let at = Spot::Cell { line: row.line, column: column.clone() };
            let expected = "an array in quotation marks, or a file with other delimiters between its columns";
            return Err(LogError::unexpected(
                at,
                expected,
                format!("`{}`", shortened(cell)),
                "write the log so",
            ));
        }
    }
    Ok(())
}
