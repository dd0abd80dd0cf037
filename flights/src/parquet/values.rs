//! Numbers of a column of any type and encoding.

use std::borrow::Cow;

use parquet::basic::{Encoding, Type};
use parquet::file::metadata::{ParquetMetaData, RowGroupMetaData};
use parquet::schema::types::ColumnDescriptor;
use vehicles::table::shown;

use super::bits::{differences, runs};
use super::footer::{chunk, damaged};
use super::kind::Kind;
use super::pages::{Fault, Page, Pages, is_unpacked};
use crate::error::{LogError, Spot};

/// Days from the origin of Julian days to 1970.
const JULIAN_1970: i64 = 2_440_588;
/// Bytes of the longest number: a decimal fraction of 76 digits.
const WIDTH_MAX: usize = 32;

/// The numbers of the column `index`; NaN in empty cells. Times are in s.
pub fn read(bytes: &[u8], metadata: &ParquetMetaData, index: usize) -> Result<Vec<f64>, LogError> {
    let descriptor = metadata.file_metadata().schema_descr().column(index);
    let at = || Spot::Named("column", shown(&descriptor.path().string()));
    let column = Column::of(&descriptor).map_err(|found| not_numbers(at(), found))?;
    check_packing(metadata, index, at())?;
    let mut numbers = Vec::new();
    for group in metadata.row_groups() {
        column
            .read_group(bytes, group, index, &mut numbers)
            .map_err(|fault| damaged(at(), "a whole column", format!("another ({fault})")))?;
    }
    Ok(numbers)
}

/// Refusal of a column that holds `found` in place of numbers.
pub fn not_numbers(at: Spot, found: &str) -> LogError {
    LogError::unexpected(at, "one number in each row", found, "write a column of numbers for each")
}

/// Refuses a column that is packed by a program that is not known here, by its name.
fn check_packing(metadata: &ParquetMetaData, index: usize, at: Spot) -> Result<(), LogError> {
    let columns = metadata.row_groups().iter().filter_map(|group| group.columns().get(index));
    let Some(unknown) = columns.map(|column| column.compression()).find(|packing| !is_unpacked(*packing))
    else {
        return Ok(());
    };
    let name = format!("{unknown:?}").to_lowercase();
    let found = format!("compression by {}", name.split('(').next().unwrap_or_default());
    let advice = "write the file with one of these";
    Err(LogError::unexpected(at, "compression by snappy, gzip, zstd or lz4_raw, or none", found, advice))
}

/// Everything that reading the numbers of a column takes.
struct Column {
    physical: Type,
    /// Bytes of a number.
    width: usize,
    is_half: bool,
    is_unsigned: bool,
    /// Factor of whole numbers.
    scale: f64,
    /// Level of cells that are not empty.
    level: u32,
}

impl Column {
    /// The column; else a description of the values that it holds in place of numbers.
    fn of(descriptor: &ColumnDescriptor) -> Result<Self, &'static str> {
        let kind = Kind::of(descriptor);
        let physical = descriptor.physical_type();
        if descriptor.max_rep_level() > 0 {
            return Err("lists");
        }
        let level = u32::try_from(descriptor.max_def_level()).unwrap_or(0);
        let (width, is_half) = (width(descriptor, kind)?, kind == Kind::Half);
        Ok(Self { physical, width, is_half, is_unsigned: kind == Kind::Unsigned, scale: kind.scale(), level })
    }

    /// The number in as many bytes.
    fn number(&self, bytes: &[u8]) -> Option<f64> {
        let whole = |bytes: &[u8]| bytes.first_chunk::<8>().map(|bytes| i64::from_le_bytes(*bytes));
        Some(match self.physical {
            Type::DOUBLE => f64::from_le_bytes(*bytes.first_chunk()?),
            Type::FLOAT => f64::from(f32::from_le_bytes(*bytes.first_chunk()?)),
            Type::INT32 => self.whole(i64::from(i32::from_le_bytes(*bytes.first_chunk()?))),
            Type::INT64 => self.whole(whole(bytes)?),
            // Nanoseconds of a day, and the day.
            Type::INT96 => {
                let day = i64::from(i32::from_le_bytes(*bytes.get(8..)?.first_chunk()?)) - JULIAN_1970;
                Kind::Days.scale() * day as f64 + self.scale * whole(bytes)? as f64
            }
            Type::FIXED_LEN_BYTE_ARRAY if self.is_half => half(u16::from_le_bytes(*bytes.first_chunk()?)),
            Type::FIXED_LEN_BYTE_ARRAY => self.scale * big_endian(bytes.get(..self.width)?),
            _ => return None,
        })
    }

    fn whole(&self, number: i64) -> f64 {
        let number = match (self.is_unsigned, self.physical) {
            (false, _) => number as f64,
            (true, Type::INT32) => f64::from((number as i32).cast_unsigned()),
            (true, _) => number.cast_unsigned() as f64,
        };
        number * self.scale
    }

    fn read_group(
        &self,
        bytes: &[u8],
        group: &RowGroupMetaData,
        index: usize,
        to: &mut Vec<f64>,
    ) -> Result<(), Fault> {
        let rows =
            usize::try_from(group.num_rows()).map_err(|_| "a group has an impossible number of rows")?;
        let column = group.columns().get(index).ok_or("a group of rows lacks it")?;
        let content = chunk(bytes, column).ok_or("its bytes lie outside of the file")?;
        let mut pages = Pages::new(content, column.compression(), rows, self.width);
        let (mut dictionary, before) = (Vec::new(), to.len());
        while let Some(page) = pages.next()? {
            match page {
                Page::Dictionary { values, content } => {
                    dictionary = self.plain(&content, values).ok_or("a dictionary is cut")?;
                }
                Page::Data { values, encoding, content, levels } => {
                    let (levels, rest) =
                        split(&content, levels, self.level > 0).ok_or("the marks of empty cells are cut")?;
                    let is_full = self.full(levels, values).ok_or("the marks of empty cells are damaged")?;
                    let count = is_full.iter().filter(|is_full| **is_full).count();
                    let numbers = self.decoded(rest, encoding, count, &dictionary);
                    let numbers =
                        numbers.ok_or_else(|| format!("values encoded as {encoding} are damaged, or cut"))?;
                    let mut numbers = numbers.into_iter();
                    to.extend(is_full.iter().map(|is_full| {
                        let next = if *is_full { numbers.next() } else { None };
                        next.unwrap_or(f64::NAN)
                    }));
                }
            }
        }
        let read = to.len() - before;
        if read == rows { Ok(()) } else { Err(format!("it ends after {read} of {rows} rows")) }
    }

    /// True for each row with a number.
    fn full(&self, levels: &[u8], rows: usize) -> Option<Cow<'static, [bool]>> {
        if self.level == 0 {
            return Some(vec![true; rows].into());
        }
        let width = usize::try_from(u32::BITS - self.level.leading_zeros()).ok()?;
        Some(runs(levels, width, rows)?.into_iter().map(|level| level == self.level).collect())
    }

    /// `count` numbers, however they are encoded; `None` if they are damaged.
    fn decoded(
        &self,
        bytes: &[u8],
        encoding: Encoding,
        count: usize,
        dictionary: &[f64],
    ) -> Option<Vec<f64>> {
        let is_boolean = self.physical == Type::BOOLEAN;
        match encoding {
            Encoding::PLAIN if is_boolean => {
                let bit = |index: usize| Some(f64::from(bytes.get(index / 8)? >> (index % 8) & 1));
                (0..count).map(bit).collect()
            }
            Encoding::PLAIN => self.plain(bytes, count),
            Encoding::RLE if is_boolean => {
                let (_, bytes) = bytes.split_at_checked(4)?;
                Some(runs(bytes, 1, count)?.into_iter().map(f64::from).collect())
            }
            Encoding::PLAIN_DICTIONARY | Encoding::RLE_DICTIONARY => {
                // A page of empty cells can lack the width.
                let (width, bytes) = bytes.split_first().unwrap_or((&0, &[]));
                let indices = runs(bytes, usize::from(*width), count)?;
                indices
                    .into_iter()
                    .map(|index| dictionary.get(usize::try_from(index).ok()?).copied())
                    .collect()
            }
            Encoding::DELTA_BINARY_PACKED if matches!(self.physical, Type::INT32 | Type::INT64) => {
                // Differences of short numbers wrap.
                let is_short = self.physical == Type::INT32;
                let wrapped = |number: i64| if is_short { i64::from(number as i32) } else { number };
                Some(
                    differences(bytes, count)?
                        .into_iter()
                        .map(|number| self.whole(wrapped(number)))
                        .collect(),
                )
            }
            Encoding::BYTE_STREAM_SPLIT if !is_boolean => {
                let width = self.width;
                (bytes.len() >= count * width).then_some(())?;
                let stride = bytes.len() / width;
                let number = |index: usize| {
                    let parts: [u8; WIDTH_MAX] =
                        std::array::from_fn(|part| bytes[part.min(width - 1) * stride + index]);
                    self.number(&parts)
                };
                (0..count).map(number).collect()
            }
            _ => None,
        }
    }

    fn plain(&self, bytes: &[u8], count: usize) -> Option<Vec<f64>> {
        let numbers = bytes.chunks_exact(self.width).take(count);
        (numbers.len() == count).then_some(())?;
        numbers.map(|number| self.number(number)).collect()
    }
}

/// Bytes of a number of the column; else a description of the values that it holds in place of numbers.
fn width(descriptor: &ColumnDescriptor, kind: Kind) -> Result<usize, &'static str> {
    let length = usize::try_from(descriptor.type_length()).unwrap_or(0);
    match (descriptor.physical_type(), kind) {
        (Type::BYTE_ARRAY, Kind::Decimal(_)) => Err("decimal fractions of changing length"),
        (Type::BYTE_ARRAY, _) => Err("texts"),
        (Type::FIXED_LEN_BYTE_ARRAY, Kind::Half) if length == 2 => Ok(length),
        (Type::FIXED_LEN_BYTE_ARRAY, Kind::Decimal(_)) if (1..=WIDTH_MAX).contains(&length) => Ok(length),
        (Type::FIXED_LEN_BYTE_ARRAY, _) => Err("blocks of bytes"),
        (Type::INT96, _) => Ok(12),
        (Type::INT64 | Type::DOUBLE, _) => Ok(8),
        _ => Ok(4),
    }
}

/// A number of two bytes (IEEE 754 binary16).
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    let size = match exponent {
        0 => libm::ldexp(fraction, -24),
        31 if fraction > 0.0 => f64::NAN,
        31 => f64::INFINITY,
        _ => libm::ldexp(1024.0 + fraction, exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

/// A whole number with its sign (two's complement), the byte of most weight first.
fn big_endian(bytes: &[u8]) -> f64 {
    let is_negative = bytes.first().is_some_and(|first| *first >= 0x80);
    let of = |byte: &u8| f64::from(if is_negative { !*byte } else { *byte });
    let size = bytes.iter().fold(0.0, |sum, byte| 256.0 * sum + of(byte));
    if is_negative { -size - 1.0 } else { size }
}

/// The levels of a page, whose length stands in front of them or is known, and its values.
fn split(content: &[u8], known: Option<usize>, has_levels: bool) -> Option<(&[u8], &[u8])> {
    match known {
        Some(length) => content.split_at_checked(length),
        None if has_levels => {
            let length = u32::from_le_bytes(*content.first_chunk()?);
            content[4..].split_at_checked(usize::try_from(length).ok()?)
        }
        None => Some((&[], content)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_those_of_ieee_754() {
        for (bits, number) in [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0001, 5.960_464_477_539_063e-8),
            (0x3555, 0.333_251_953_125),
            (0x8000, 0.0),
            (0xfc00, f64::NEG_INFINITY),
        ] {
            assert_eq!(half(bits), number, "{bits:x}");
        }
        assert!(half(0x7e00).is_nan());
    }

    #[test]
    fn decimal_fractions_keep_their_sign_at_any_length() {
        assert_eq!(big_endian(&[0xff; 16]), -1.0);
        assert_eq!(big_endian(&[0x01, 0x00]), 256.0);
        assert_eq!(big_endian(&[0xff, 0x85]), -123.0);
        assert_eq!(big_endian(&[0x80]), -128.0);
        assert_eq!(big_endian(&(-123_456_789_012_i128).to_be_bytes()), -123_456_789_012.0);
    }
}
