//! Numbers of a column of any type and encoding.

use std::borrow::Cow;

use parquet::basic::{Encoding, Type};
use parquet::file::metadata::{ParquetMetaData, RowGroupMetaData};
use parquet::schema::types::ColumnDescriptor;
use vehicles::table::shown;

use super::bits::{differences, runs};
use super::footer::{chunk, damaged};
use super::kind::Kind;
use super::pages::{Fault, Page, Pages};
use crate::error::{LogError, Spot};

/// Days from the origin of Julian days to 1970.
const JULIAN_1970: i64 = 2_440_588;

/// The numbers of the column `index`; NaN in empty cells. Times are in s.
pub fn read(bytes: &[u8], metadata: &ParquetMetaData, index: usize) -> Result<Vec<f64>, LogError> {
    let descriptor = metadata.file_metadata().schema_descr().column(index);
    let at = || Spot::Named("column", shown(&descriptor.path().string()));
    let column = Column::of(&descriptor).map_err(|found| {
        LogError::unexpected(at(), "one number in each row", found, "write a column of numbers for each")
    })?;
    let mut numbers = Vec::new();
    for group in metadata.row_groups() {
        column
            .read_group(bytes, group, index, &mut numbers)
            .map_err(|fault| damaged(at(), "a whole column", format!("another ({fault})")))?;
    }
    Ok(numbers)
}

/// Everything that reading the numbers of a column takes.
struct Column {
    physical: Type,
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
        match (descriptor.max_rep_level(), physical) {
            (1.., _) => return Err("lists"),
            (_, Type::BYTE_ARRAY) => return Err("texts"),
            (_, Type::FIXED_LEN_BYTE_ARRAY) => return Err("blocks of bytes"),
            _ => {}
        }
        let level = u32::try_from(descriptor.max_def_level()).unwrap_or(0);
        Ok(Self { physical, is_unsigned: kind == Kind::Unsigned, scale: kind.scale(), level })
    }

    /// Bytes of a number.
    fn width(&self) -> usize {
        match self.physical {
            Type::INT96 => 12,
            Type::INT64 | Type::DOUBLE => 8,
            _ => 4,
        }
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
        let mut pages = Pages::new(content, column.compression(), rows);
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
        if read == rows { Ok(()) } else { Err(format!("it ends behind {read} of {rows} rows")) }
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
                let width = self.width();
                (bytes.len() >= count * width).then_some(())?;
                let stride = bytes.len() / width;
                let number = |index: usize| {
                    // The longest number has twelve bytes.
                    let parts: [u8; 12] =
                        std::array::from_fn(|part| bytes[part.min(width - 1) * stride + index]);
                    self.number(&parts)
                };
                (0..count).map(number).collect()
            }
            _ => None,
        }
    }

    fn plain(&self, bytes: &[u8], count: usize) -> Option<Vec<f64>> {
        let numbers = bytes.chunks_exact(self.width()).take(count);
        (numbers.len() == count).then_some(())?;
        numbers.map(|number| self.number(number)).collect()
    }
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
