//! Writes all rows as Parquet: one row a flight, in the order of the plan.

use crate::plan::Plan;
use crate::row::Row;
use anyhow::{Context, Result};
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type, TypePtr};
use std::fs::File;
use std::sync::Arc;

/// A column with the values of all rows.
enum Column {
    Whole(Vec<i64>),
    Truth(Vec<bool>),
    Number(Vec<Option<f64>>),
    Text(Vec<Option<String>>),
}

/// Writes the `rows` of `plan` to `file`. `figures` names the figures of the rows.
///
/// Columns: `flight`; the drawn numbers by their names; `passed`; `failed`, `failed_at_s`, `error`; the figures; `wall_s`,
/// the host time, which alone differs between two runs of a campaign.
///
/// # Errors
/// If the file cannot be written.
pub fn write(file: &mut File, plan: &Plan, figures: &[String], rows: &[Row]) -> Result<()> {
    let columns = columns(plan, figures, rows);
    let fields = columns.iter().map(|(name, column)| field(name, column)).collect::<Result<_>>()?;
    let schema = Arc::new(Type::group_type_builder("flights").with_fields(fields).build()?);
    let version = KeyValue::new("hummingbus".to_owned(), env!("CARGO_PKG_VERSION").to_owned());
    let properties = WriterProperties::builder().set_key_value_metadata(Some(vec![version])).build();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for (_, column) in &columns {
        let mut open = group.next_column()?.context("more columns than fields")?;
        put(&mut open, column)?;
        open.close()?;
    }
    group.close()?;
    writer.close()?;
    Ok(())
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

fn field(name: &str, column: &Column) -> Result<TypePtr> {
    let (physical, repetition) = match column {
        Column::Whole(_) => (Physical::INT64, Repetition::REQUIRED),
        Column::Truth(_) => (Physical::BOOLEAN, Repetition::REQUIRED),
        Column::Number(_) => (Physical::DOUBLE, Repetition::OPTIONAL),
        Column::Text(_) => (Physical::BYTE_ARRAY, Repetition::OPTIONAL),
    };
    let text = matches!(column, Column::Text(_)).then_some(LogicalType::String);
    let builder = Type::primitive_type_builder(name, physical).with_repetition(repetition);
    Ok(Arc::new(builder.with_logical_type(text).build()?))
}

fn put(writer: &mut SerializedColumnWriter<'_>, column: &Column) -> Result<()> {
    match column {
        Column::Whole(values) => writer.typed::<Int64Type>().write_batch(values, None, None)?,
        Column::Truth(values) => writer.typed::<BoolType>().write_batch(values, None, None)?,
        Column::Number(values) => {
            let known: Vec<f64> = values.iter().flatten().copied().collect();
            writer.typed::<DoubleType>().write_batch(&known, Some(&levels(values)), None)?
        }
        Column::Text(values) => {
            let known: Vec<ByteArray> = values.iter().flatten().map(|text| text.as_str().into()).collect();
            writer.typed::<ByteArrayType>().write_batch(&known, Some(&levels(values)), None)?
        }
    };
    Ok(())
}

/// Definition levels: 1 where there is a value.
fn levels<T>(values: &[Option<T>]) -> Vec<i16> {
    values.iter().map(|value| i16::from(value.is_some())).collect()
}
