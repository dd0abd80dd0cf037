//! Tables of typed columns, written as Parquet.

use anyhow::Context as _;
use diagnostics::Error;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type, TypePtr};
use std::io::Write;
use std::sync::Arc;

/// First bytes of a Parquet file.
pub const PARQUET_START: &[u8] = b"PAR1";

/// A column with a value for each row; `None` where a row has no value.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    /// Integers, one in each row.
    Whole(Vec<i64>),
    /// Truth values, one in each row.
    Truth(Vec<bool>),
    /// Truth values.
    Verdict(Vec<Option<bool>>),
    /// Numbers.
    Number(Vec<Option<f64>>),
    /// Integers.
    Integer(Vec<Option<i64>>),
    /// Texts.
    Text(Vec<Option<String>>),
}

/// Writes `columns`, which all have the same number of rows, to `out` as a Parquet file of one row group. `facts` are its
/// metadata, beside the version of the program.
///
/// ```
/// use report::columns::{Column, PARQUET_START, write_parquet};
///
/// let height = Column::Number(vec![Some(0.0), None, Some(1.5)]);
/// let columns = [("tick", &Column::Whole(vec![0, 1, 2])), ("position.z", &height)];
/// let mut bytes = Vec::new();
/// write_parquet(&mut bytes, "flight", &columns, &[("unit of position.z", "m".to_owned())])?;
/// assert!(bytes.starts_with(PARQUET_START));
/// # Ok::<(), diagnostics::Error>(())
/// ```
///
/// # Errors
/// If `out` cannot be written to.
pub fn write_parquet(
    out: impl Write + Send,
    name: &str,
    columns: &[(&str, &Column)],
    facts: &[(&str, String)],
) -> Result<(), Error> {
    Ok(write(out, name, columns, facts)?)
}

fn write(
    out: impl Write + Send,
    name: &str,
    columns: &[(&str, &Column)],
    facts: &[(&str, String)],
) -> anyhow::Result<()> {
    let fields = columns.iter().map(|(name, column)| field(name, column)).collect::<anyhow::Result<_>>()?;
    let schema = Arc::new(Type::group_type_builder(name).with_fields(fields).build()?);
    let version = ("hummingbus", env!("CARGO_PKG_VERSION").to_owned());
    let facts = std::iter::once(&version).chain(facts);
    let facts = facts.map(|(key, value)| KeyValue::new((*key).to_owned(), value.clone())).collect();
    let properties = WriterProperties::builder().set_key_value_metadata(Some(facts)).build();
    let mut writer = SerializedFileWriter::new(out, schema, Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for (_, column) in columns {
        let mut open = group.next_column()?.context("more columns than fields")?;
        put(&mut open, column)?;
        open.close()?;
    }
    group.close()?;
    writer.close()?;
    Ok(())
}

fn field(name: &str, column: &Column) -> anyhow::Result<TypePtr> {
    let (physical, repetition) = match column {
        Column::Whole(_) => (Physical::INT64, Repetition::REQUIRED),
        Column::Truth(_) => (Physical::BOOLEAN, Repetition::REQUIRED),
        Column::Verdict(_) => (Physical::BOOLEAN, Repetition::OPTIONAL),
        Column::Number(_) => (Physical::DOUBLE, Repetition::OPTIONAL),
        Column::Integer(_) => (Physical::INT64, Repetition::OPTIONAL),
        Column::Text(_) => (Physical::BYTE_ARRAY, Repetition::OPTIONAL),
    };
    let text = matches!(column, Column::Text(_)).then_some(LogicalType::String);
    let builder = Type::primitive_type_builder(name, physical).with_repetition(repetition);
    Ok(Arc::new(builder.with_logical_type(text).build()?))
}

fn put(writer: &mut SerializedColumnWriter<'_>, column: &Column) -> anyhow::Result<()> {
    match column {
        Column::Whole(values) => writer.typed::<Int64Type>().write_batch(values, None, None)?,
        Column::Truth(values) => writer.typed::<BoolType>().write_batch(values, None, None)?,
        Column::Verdict(values) => {
            let known: Vec<bool> = values.iter().flatten().copied().collect();
            writer.typed::<BoolType>().write_batch(&known, Some(&levels(values)), None)?
        }
        Column::Number(values) => {
            let known: Vec<f64> = values.iter().flatten().copied().collect();
            writer.typed::<DoubleType>().write_batch(&known, Some(&levels(values)), None)?
        }
        Column::Integer(values) => {
            let known: Vec<i64> = values.iter().flatten().copied().collect();
            writer.typed::<Int64Type>().write_batch(&known, Some(&levels(values)), None)?
        }
        Column::Text(values) => {
            let known: Vec<ByteArray> = values.iter().flatten().map(|text| text.as_str().into()).collect();
            writer.typed::<ByteArrayType>().write_batch(&known, Some(&levels(values)), None)?
        }
    };
    Ok(())
}

/// Definition levels: 1 for a row with a value.
fn levels<T>(values: &[Option<T>]) -> Vec<i16> {
    values.iter().map(|value| i16::from(value.is_some())).collect()
}
