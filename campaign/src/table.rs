//! Writes all rows as Parquet: one row a flight, in the order of the plan.

use crate::plan::Plan;
use crate::row::Row;
use anyhow::Result;
use report::columns::{Column, write_parquet};
use std::fs::File;

/// Writes the `rows` of `plan` to `file`. `figures` names the figures of the rows.
///
/// Columns: `flight`; the drawn numbers by their names; `passed`; `failed`, `failed_at_s`, `error`; the figures; `wall_s`,
/// the host time, which alone differs between two runs of a campaign.
///
/// # Errors
/// If the file cannot be written.
pub fn write(file: &mut File, plan: &Plan, figures: &[String], rows: &[Row]) -> Result<()> {
    let columns = columns(plan, figures, rows);
    let columns: Vec<(&str, &Column)> =
        columns.iter().map(|(name, column)| (name.as_str(), column)).collect();
    write_parquet(file, "flights", &columns, &[])
}

fn columns(plan: &Plan, figures: &[String], rows: &[Row]) -> Vec<(String, Column)> {
    let numbers = |of: &dyn Fn(&Row) -> Option<f64>| Column::Number(rows.iter().map(of).collect());
    let texts = |of: &dyn Fn(&Row) -> Option<String>| Column::Text(rows.iter().map(of).collect());
    let mut columns =
        vec![("flight".to_owned(), Column::Whole(rows.iter().map(|row| row.flight as i64).collect()))];
    for (index, name) in plan.names.iter().enumerate() {
        columns.push((name.clone(), numbers(&|row| row.drawn.get(index).copied())));
    }
    columns.push(("passed".to_owned(), Column::Truth(rows.iter().map(|row| row.passed).collect())));
    columns.push(("failed".to_owned(), texts(&|row| row.failed.clone())));
    columns.push(("failed_at_s".to_owned(), numbers(&|row| row.failed_at_s)));
    columns.push(("error".to_owned(), texts(&|row| row.error.clone())));
    for (index, name) in figures.iter().enumerate() {
        columns.push((name.clone(), numbers(&|row| row.figures.get(index).copied().flatten())));
    }
    columns.push(("wall_s".to_owned(), numbers(&|row| Some(row.wall_s))));
    columns
}
