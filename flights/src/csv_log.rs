//! Logs in CSV: a header, then rows on one clock.

use vehicles::table::Table;

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
        let time_s = table.numbers(find(&table, column)?).map(|time| time * factor).collect();
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
            let numbers = self.table.numbers(find(&self.table, name)?);
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

fn find(table: &Table, name: &str) -> Result<usize, LogError> {
    table
        .column(name)
        .ok_or_else(|| LogError::missing("column", name, &table.headers, "the name in `channels`"))
}
