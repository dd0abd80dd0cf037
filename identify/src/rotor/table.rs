//! One log in CSV: its columns in SI.

use std::path::Path;

use diagnostics::Diagnostic;
use diagnostics::unit::TIME;
use vehicles::table::Table;

use super::error::RotorError;
use super::stand::{Column, short_name};

/// Seconds of a day; a wall clock begins anew after them.
const DAY_S: f64 = 86_400.0;

/// The cells of a log.
pub struct LogTable {
    file: String,
    table: Table,
}

impl LogTable {
    /// Reads the log at `path`.
    pub fn read(path: &Path) -> Result<Self, RotorError> {
        let bytes = vehicles::text::read_log(path).map_err(|cause| {
            Diagnostic::unreadable(path.display().to_string(), &cause).help("check the path")
        })?;
        let file = short_name(path);
        match Table::parse(&bytes) {
            Ok(table) => Ok(Self { file, table }),
            Err(cause) => Err(RotorError::Table { file, cause }),
        }
    }

    fn index(&self, column: &Column) -> Result<usize, RotorError> {
        self.table.column(&column.column).ok_or_else(|| RotorError::NoColumn {
            file: self.file.clone(),
            column: column.column.clone(),
            known: self.table.headers.clone(),
        })
    }

    /// The numbers of a column, each times `factor`; NaN where a cell has none.
    pub fn column(&self, column: &Column, factor: f64) -> Result<Vec<f64>, RotorError> {
        Ok(self.table.numbers(self.index(column)?).map(|number| number * factor).collect())
    }

    /// The numbers of a time column in s; every row needs one, and none may go back.
    pub fn times(&self, column: &Column) -> Result<Vec<f64>, RotorError> {
        let time_s = if column.is_wall_clock() {
            let index = self.index(column)?;
            let cells = self.table.rows.iter().map(|row| row.cell(index));
            unwrapped(cells.map(|cell| seconds_of_day(cell).unwrap_or(f64::NAN)))
        } else {
            self.column(column, column.factor(TIME))?
        };
        let fault = |row: usize, found: &'static str| RotorError::Time {
            file: self.file.clone(),
            line: self.table.rows[row].line,
            column: column.column.clone(),
            found,
        };
        if let Some(row) = time_s.iter().position(|time| !time.is_finite()) {
            return Err(fault(row, "has no time"));
        }
        match time_s.windows(2).position(|pair| pair[1] < pair[0]) {
            Some(row) => Err(fault(row + 1, "goes back")),
            None => Ok(time_s),
        }
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
