//! Meaning of the numbers of a column, according to its type.

use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use parquet::schema::types::ColumnDescriptor;

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;

/// Meaning of numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Numbers as they stand.
    Plain,
    /// Numbers from 0 up.
    Unsigned,
    /// Times in a unit, by its name.
    Times(&'static str),
    /// Days.
    Days,
    /// Decimal fractions with this number of digits behind the point.
    Decimal(i32),
    /// Fractions of two bytes.
    Half,
}

impl Kind {
    /// The meaning of the numbers of `column`, by its type or by that of older files.
    pub fn of(column: &ColumnDescriptor) -> Self {
        match column.logical_type_ref() {
            Some(LogicalType::Timestamp(time) | LogicalType::Time(time)) => Self::Times(unit(&time.unit)),
            Some(LogicalType::Date) => Self::Days,
            Some(LogicalType::Decimal(decimal)) => Self::Decimal(decimal.scale),
            Some(LogicalType::Float16) => Self::Half,
            Some(LogicalType::Integer(integer)) if !integer.is_signed => Self::Unsigned,
            Some(_) => Self::Plain,
            None => Self::of_older(column),
        }
    }

    fn of_older(column: &ColumnDescriptor) -> Self {
        match column.converted_type() {
            ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS => Self::Times("ms"),
            ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS => Self::Times("us"),
            ConvertedType::DATE => Self::Days,
            ConvertedType::DECIMAL => Self::Decimal(column.type_scale()),
            ConvertedType::UINT_8
            | ConvertedType::UINT_16
            | ConvertedType::UINT_32
            | ConvertedType::UINT_64 => Self::Unsigned,
            // Nanoseconds of older programs.
            _ if column.physical_type() == Type::INT96 => Self::Times("ns"),
            _ => Self::Plain,
        }
    }

    /// Factor of the numbers: of times and days to s.
    pub fn scale(self) -> f64 {
        match self {
            Self::Plain | Self::Unsigned | Self::Half => 1.0,
            Self::Times("ms") => 1e-3,
            Self::Times("us") => 1e-6,
            Self::Times(_) => 1e-9,
            Self::Days => DAY_S,
            Self::Decimal(digits) => libm::pow(10.0, -f64::from(digits)),
        }
    }
}

fn unit(unit: &TimeUnit) -> &'static str {
    match unit {
        TimeUnit::MILLIS => "ms",
        TimeUnit::MICROS => "us",
        TimeUnit::NANOS => "ns",
    }
}
