//! The footer of a Parquet file: its sizes are checked against the file before anything is reserved for them.

use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, ParquetMetaDataReader};

use super::thrift::{Cursor, STRUCT};
use crate::error::{LogError, Spot};

/// Mark at both ends of the file.
const MARK: &[u8] = b"PAR1";
/// Length of the footer's length and the mark.
const TAIL: usize = 8;
/// Bytes of a footer for each structure in it at least: a column takes eight in the schema, and dozens in each group of rows.
const BYTES_PER_STRUCTURE: usize = 8;
/// Structures that may be smaller.
const SMALL_STRUCTURES: usize = 16;
/// Groups within groups at most.
const DEPTH_MAX: usize = 16;
/// Rows of one file at most, as in CSV.
const ROWS_MAX: usize = 10_000_000;
/// Rows that any file may have, and rows for each of its bytes: equal numbers take no bytes.
const ROWS_FREE: usize = 100_000;
const ROWS_PER_BYTE: usize = 4;

/// Way out of a file that is not read.
pub const REWRITE: &str = "copy the log again, or load it in the program that wrote it and write it as CSV";

/// A damaged or hostile place.
pub fn damaged(at: Spot, expected: impl Into<String>, found: impl Into<String>) -> LogError {
    LogError::unexpected(at, expected, found, REWRITE)
}

/// The footer of a file with these `bytes`.
pub fn read(bytes: &[u8]) -> Result<ParquetMetaData, LogError> {
    let begin = footer_begin(bytes)?;
    let footer = &bytes[begin..bytes.len() - TAIL];
    let at = || Spot::Byte(begin);
    let expected = "a footer of Parquet whose structures fit into it";
    check_sizes(footer).ok_or_else(|| damaged(at(), expected, "a damaged one"))?;
    let metadata = ParquetMetaDataReader::decode_metadata(footer)
        .map_err(|error| damaged(at(), "a footer of Parquet", format!("a damaged one ({error})")))?;
    check_rows(&metadata, bytes.len())?;
    Ok(metadata)
}

/// First byte of the footer.
fn footer_begin(bytes: &[u8]) -> Result<usize, LogError> {
    let ends = |mark: &[u8]| bytes.len() >= MARK.len() + TAIL && bytes.ends_with(mark);
    if ends(b"PARE") || bytes.starts_with(b"PARE") {
        let advice = "write it without encryption";
        return Err(LogError::unexpected(
            Spot::Whole,
            "a Parquet file that can be read",
            "an encrypted one",
            advice,
        ));
    }
    if !ends(MARK) {
        let found = "no such mark: it is cut, or was not closed by its program";
        return Err(damaged(Spot::Whole, "`PAR1` at the end of a Parquet file", found));
    }
    let tail = bytes.len() - TAIL;
    let length = bytes[tail..].first_chunk::<4>().map_or(0, |length| u32::from_le_bytes(*length));
    let begin = usize::try_from(length).ok().and_then(|length| tail.checked_sub(length));
    begin.filter(|begin| *begin >= MARK.len()).ok_or_else(|| {
        damaged(
            Spot::Byte(tail),
            format!("a footer of at most {} bytes", tail - MARK.len()),
            length.to_string(),
        )
    })
}

/// `None` if the footer is damaged, nests groups deeply, or claims more structures than it has bytes for.
fn check_sizes(footer: &[u8]) -> Option<()> {
    let mut cursor = Cursor::new(footer);
    cursor.each_field(
        |cursor, (number, kind)| if number == 2 { check_schema(cursor) } else { cursor.skip(kind) },
    )?;
    (cursor.listed <= SMALL_STRUCTURES + footer.len() / BYTES_PER_STRUCTURE).then_some(())
}

/// Passes over the schema: elements, each with the number of those below it.
fn check_schema(cursor: &mut Cursor<'_>) -> Option<()> {
    let (kind, size) = cursor.list()?;
    cursor.listed += size;
    let mut open: Vec<i64> = Vec::new();
    for _ in 0..size {
        let mut below = 0;
        (kind == STRUCT).then_some(())?;
        cursor.each_field(|cursor, (number, kind)| match number {
            5 => cursor.integer().map(|children| below = children),
            _ => cursor.skip(kind),
        })?;
        while open.last() == Some(&0) {
            open.pop();
        }
        open.last_mut().into_iter().for_each(|left| *left -= 1);
        (open.len() <= DEPTH_MAX).then_some(())?;
        if below > 0 {
            open.push(below);
        }
    }
    Some(())
}

/// Refuses more rows than are read, or than a file of `length` bytes can mean.
fn check_rows(metadata: &ParquetMetaData, length: usize) -> Result<(), LogError> {
    let most = length.saturating_mul(ROWS_PER_BYTE).saturating_add(ROWS_FREE).min(ROWS_MAX);
    let mut groups = metadata.row_groups().iter().map(|group| usize::try_from(group.num_rows()).ok());
    let rows = groups.try_fold(0_usize, |sum, rows| sum.checked_add(rows?));
    if rows.is_some_and(|rows| rows <= most) {
        return Ok(());
    }
    let found = rows.map_or("an impossible number".to_owned(), |rows| rows.to_string());
    let expected = format!(
        "at most {most} rows in a file of {length} bytes ({ROWS_FREE} and {ROWS_PER_BYTE} for each byte, {ROWS_MAX} in all)"
    );
    let advice = "cut it into several files, or write it as CSV";
    Err(LogError::unexpected(Spot::Whole, expected, found, advice))
}

/// The bytes of a column in a group of rows; `None` if they lie outside of the file.
pub fn chunk<'a>(bytes: &'a [u8], column: &ColumnChunkMetaData) -> Option<&'a [u8]> {
    let data = column.data_page_offset();
    let begin = column.dictionary_page_offset().filter(|dictionary| *dictionary > 0).unwrap_or(data);
    let begin = usize::try_from(begin).ok()?;
    let end = begin.checked_add(usize::try_from(column.compressed_size()).ok()?)?;
    bytes.get(begin..end)
}
