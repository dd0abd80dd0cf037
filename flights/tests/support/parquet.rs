//! Parquet files of made-up columns.

use std::sync::Arc;

use parquet::basic::Type;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::{ByteArray, FixedLenByteArray};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

/// A column: its declaration in the language of Parquet's schemas, such as `optional double x`, and its cells.
pub struct Column {
    pub declared: String,
    pub cells: Vec<Option<f64>>,
}

/// The columns of a CSV text, each `optional double`.
pub fn columns(csv: &str) -> Vec<Column> {
    let mut lines = csv.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<Option<f64>>> =
        lines.map(|line| line.split(',').map(|cell| cell.parse().ok()).collect()).collect();
    let column = |(index, name): (usize, &&str)| Column {
        declared: format!("optional double {name}"),
        cells: rows.iter().map(|row| row[index]).collect(),
    };
    names.iter().enumerate().map(column).collect()
}

/// A file of these columns with `group` rows in a group.
pub fn file(columns: &[Column], group: usize, properties: WriterProperties) -> Vec<u8> {
    let fields: String = columns.iter().map(|column| format!("{};\n", column.declared)).collect();
    let schema = Arc::new(parse_message_type(&format!("message log {{ {fields} }}")).unwrap());
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties)).unwrap();
    let rows = columns.first().map_or(0, |column| column.cells.len());
    for from in (0..rows).step_by(group) {
        let mut group_writer = writer.next_row_group().unwrap();
        for column in columns {
            let cells = &column.cells[from..(from + group).min(rows)];
            let mut next = group_writer.next_column().unwrap().unwrap();
            write(next.untyped(), cells);
            next.close().unwrap();
        }
        group_writer.close().unwrap();
    }
    writer.into_inner().unwrap()
}

fn write(writer: &mut ColumnWriter<'_>, cells: &[Option<f64>]) {
    let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    let numbers: Vec<f64> = cells.iter().flatten().copied().collect();
    let levels = Some(&levels[..]);
    match writer {
        ColumnWriter::BoolColumnWriter(writer) => {
            let values: Vec<bool> = numbers.iter().map(|number| *number != 0.0).collect();
            writer.write_batch(&values, levels, None)
        }
        ColumnWriter::Int32ColumnWriter(writer) => {
            let values: Vec<i32> = numbers.iter().map(|number| number.round() as i32).collect();
            writer.write_batch(&values, levels, None)
        }
        ColumnWriter::Int64ColumnWriter(writer) => {
            let values: Vec<i64> = numbers.iter().map(|number| number.round() as i64).collect();
            writer.write_batch(&values, levels, None)
        }
        ColumnWriter::FloatColumnWriter(writer) => {
            let values: Vec<f32> = numbers.iter().map(|number| *number as f32).collect();
            writer.write_batch(&values, levels, None)
        }
        ColumnWriter::DoubleColumnWriter(writer) => writer.write_batch(&numbers, levels, None),
        ColumnWriter::ByteArrayColumnWriter(writer) => {
            let values: Vec<ByteArray> =
                numbers.iter().map(|number| number.to_string().into_bytes().into()).collect();
            writer.write_batch(&values, levels, None)
        }
        ColumnWriter::FixedLenByteArrayColumnWriter(writer) => {
            let length = usize::try_from(writer.get_descriptor().type_length()).unwrap();
            let bytes = |number: &f64| match length {
                2 => half(*number).to_le_bytes().to_vec(),
                _ => (number.round() as i128).to_be_bytes()[16 - length..].to_vec(),
            };
            let values: Vec<FixedLenByteArray> =
                numbers.iter().map(|number| FixedLenByteArray::from(bytes(number))).collect();
            writer.write_batch(&values, levels, None)
        }
        ColumnWriter::Int96ColumnWriter(_) => panic!("no column of {} is written", Type::INT96),
    }
    .unwrap();
}

/// The bits of a number of two bytes, for numbers of usual size; rounded to zero.
fn half(number: f64) -> u16 {
    let size = number.abs();
    if size < 6.2e-5 {
        return 0;
    }
    let exponent = libm::floor(libm::log2(size));
    let fraction = ((size / libm::exp2(exponent) - 1.0) * 1024.0) as u16;
    let sign = if number < 0.0 { 0x8000 } else { 0 };
    sign | (((exponent as i32 + 15) as u16) << 10) | fraction
}
