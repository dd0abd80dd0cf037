//! Writes all rows as Parquet: one row a flight, in the order of the plan.

use crate::declaration::Varied;
use crate::list::shown;
use crate::row::Row;
use anyhow::Result;
use report::columns::{Column, write_parquet};
use std::fs::File;

/// Rows with what they have in common.
#[derive(Debug)]
pub struct Table<'a> {
    /// Varied values.
    pub varied: &'a [Varied],
    /// Names of the verdicts of a row.
    pub verdicts: &'a [String],
    /// Names of the figures of a row.
    pub figures: &'a [String],
    /// Units of the figures.
    pub units: &'a [String],
    /// Indices of the figures that the table keeps.
    pub kept: &'a [usize],
    /// Build of hummingbus that flew the rows.
    pub build: &'a str,
    /// Rows in the order of the plan.
    pub rows: &'a [Row],
    /// Seed of the run of each row.
    pub seeds: Vec<Option<i64>>,
}

impl Table<'_> {
    /// Writes the table to `file`.
    ///
    /// Columns: `flight`; the drawn values by their names; `run.seed`; `passed`; `failed`, `failed_at_s`, `error`; a verdict
    /// for each condition; the figures; `version`. The metadata has the unit of each figure. Host times are in no column: the
    /// bytes depend on plan and build alone.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, file: &mut File) -> Result<()> {
        let columns = self.columns();
        let columns: Vec<(&str, &Column)> =
            columns.iter().map(|(name, column)| (name.as_str(), column)).collect();
        let unit = |&index: &usize| (format!("unit of {}", self.figures[index]), self.units[index].clone());
        let units: Vec<(String, String)> = self.kept.iter().map(unit).collect();
        let units: Vec<(&str, String)> =
            units.iter().map(|(key, unit)| (key.as_str(), unit.clone())).collect();
        Ok(write_parquet(file, "flights", &columns, &units)?)
    }

    fn columns(&self) -> Vec<(String, Column)> {
        let rows = self.rows;
        let numbers = |of: &dyn Fn(&Row) -> Option<f64>| Column::Number(rows.iter().map(of).collect());
        let texts = |of: &dyn Fn(&Row) -> Option<String>| Column::Text(rows.iter().map(of).collect());
        let verdicts = |of: &dyn Fn(&Row) -> Option<bool>| Column::Verdict(rows.iter().map(of).collect());
        let flights = rows.iter().map(|row| row.flight as i64).collect();
        let mut columns = vec![("flight".to_owned(), Column::Whole(flights))];
        for (index, Varied { name, distribution, .. }) in self.varied.iter().enumerate() {
            let drawn = |row: &Row| row.drawn.get(index).copied();
            let column = match distribution.choices() {
                None => numbers(&drawn),
                Some(_) => texts(&|row| distribution.choice(drawn(row)?).map(shown)),
            };
            columns.push((name.clone(), column));
        }
        columns.push(("run.seed".to_owned(), Column::Integer(self.seeds.clone())));
        columns.push(("passed".to_owned(), Column::Truth(rows.iter().map(|row| row.passed).collect())));
        columns.push(("failed".to_owned(), texts(&|row| row.failed.clone())));
        columns.push(("failed_at_s".to_owned(), numbers(&|row| row.failed_at_s)));
        columns.push(("error".to_owned(), texts(&|row| row.error.clone())));
        for (index, name) in self.verdicts.iter().enumerate() {
            columns.push((name.clone(), verdicts(&|row| row.verdicts.get(index).copied())));
        }
        for &index in self.kept {
            let value = |row: &Row| row.figures.get(index).copied().flatten();
            columns.push((self.figures[index].clone(), numbers(&value)));
        }
        columns.push(("version".to_owned(), texts(&|_| Some(self.build.to_owned()))));
        columns
    }
}
