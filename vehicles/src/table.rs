//! Tables of measurements in CSV: a header, then rows that are lines.

use crate::foreign::{self, Foreign};
use crate::quotes::{self, StrayQuote};

/// Rows of one file at most: three hours at 1 kHz. Each takes some hundred bytes of memory, however short its line is.
const ROWS_MAX: usize = 10_000_000;

/// A file in CSV. Its delimiter is the one of tab, semicolon and comma that the header has most of.
///
/// ```
/// let table = vehicles::table::Table::parse(b"t; a\n0.1; 2\n\n0.2; x\n")?;
/// let a = table.column("a").unwrap();
/// assert_eq!(table.numbers(a).next(), Some(2.0));
/// assert!(table.numbers(a).last().unwrap().is_nan(), "no number");
/// assert_eq!((table.rows[1].line, table.rows[1].cell(a)), (4, "x"));
/// # Ok::<(), vehicles::table::TableError>(())
/// ```
pub struct Table {
    /// The names of the columns.
    pub headers: Vec<String>,
    /// The rows below the header.
    pub rows: Vec<Row>,
}

/// A row of a table. It may have fewer or more cells than the header.
pub struct Row {
    /// The line, from 1.
    pub line: u64,
    /// The cells, without blanks around them.
    pub cells: csv::StringRecord,
}

/// Why a file is no table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// It is of another format.
    #[error(transparent)]
    Foreign(#[from] Foreign),
    /// A quotation mark makes one cell of what are many.
    #[error(transparent)]
    Quote(#[from] StrayQuote),
    /// It cannot be taken apart into cells.
    #[error("it is not CSV: {0}; check the path and the format")]
    Csv(#[from] csv::Error),
    /// It has more rows than are read.
    #[error("it has more than {0} rows; cut it into several files, or leave out rows")]
    Rows(usize),
}

impl Table {
    /// The table that a file's `bytes` hold; what is no UTF-8 in them is no number either.
    ///
    /// # Errors
    /// A file of another format, a cell that is opened by a quotation mark and not closed on its line, and millions of rows.
    pub fn parse(bytes: &[u8]) -> Result<Self, TableError> {
        Self::parse_within(bytes, ROWS_MAX)
    }

    fn parse_within(bytes: &[u8], rows_max: usize) -> Result<Self, TableError> {
        foreign::of(bytes).map_or(Ok(()), Err)?;
        let text = String::from_utf8_lossy(bytes);
        // Programs for other systems put a byte order mark before the first name.
        let text = text.trim_start_matches('\u{feff}');
        let delimiter = delimiter(text);
        quotes::check(text.as_bytes(), delimiter)?;
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .flexible(true)
            .delimiter(delimiter)
            .from_reader(text.as_bytes());
        let headers = reader.headers()?.iter().map(str::to_owned).collect();
        let mut rows = Vec::new();
        for cells in reader.into_records() {
            let cells = cells?;
            if rows.len() == rows_max {
                return Err(TableError::Rows(rows_max));
            }
            rows.push(Row { line: line(text, &cells), cells });
        }
        Ok(Self { headers, rows })
    }

    /// The index of the column `name`.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<usize> {
        self.headers.iter().position(|header| header == name)
    }

    /// The numbers of a column; NaN where a cell has none.
    pub fn numbers(&self, column: usize) -> impl Iterator<Item = f64> {
        self.rows.iter().map(move |row| row.cell(column).parse().unwrap_or(f64::NAN))
    }
}

impl Row {
    /// A cell; empty behind the end of a short row.
    #[must_use]
    pub fn cell(&self, column: usize) -> &str {
        self.cells.get(column).unwrap_or_default()
    }
}

/// The line of a record, from 1: the reader's place is in front of the line ends and empty lines before it.
fn line(text: &str, record: &csv::StringRecord) -> u64 {
    let Some(place) = record.position() else { return 0 };
    let from = usize::try_from(place.byte()).unwrap_or(usize::MAX);
    let before = text.as_bytes().get(from..).unwrap_or_default();
    let ends = before.iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
    place.line() + ends.filter(|byte| **byte == b'\n').count() as u64
}

/// The delimiter that the header has most of.
fn delimiter(text: &str) -> u8 {
    let header = text.lines().next().unwrap_or_default();
    let count = |delimiter: u8| header.bytes().filter(|byte| *byte == delimiter).count();
    // The last of equals wins, which is the comma.
    [b'\t', b';', b','].into_iter().max_by_key(|delimiter| count(*delimiter)).unwrap_or(b',')
}

#[cfg(test)]
mod tests {
    use super::Table;

    #[test]
    fn rows_beyond_a_limit_are_refused_with_it() {
        let rows = |count: usize| Table::parse_within(&[b"a\n", &b"1\n".repeat(count)[..]].concat(), 5);
        assert_eq!(rows(5).unwrap().rows.len(), 5);
        let error = rows(6).err().unwrap().to_string();
        assert_eq!(error, "it has more than 5 rows; cut it into several files, or leave out rows");
    }
}
