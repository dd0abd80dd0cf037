//! Tables of measurements in CSV: a header, then rows that are lines.

use crate::encoding;
use crate::foreign;
use crate::layout::{self, by_number};
use crate::lines;
use crate::quotes;

pub use crate::dialect::{Decimal, Delimiter, Dialect};
pub use crate::table_error::{ColumnError, TableError, names, shown};
pub use crate::table_rows::{Row, Rows};

/// Rows of one file at most: two hours and a half at 1 kHz. One of two short cells takes 65 bytes of memory.
const ROWS_MAX: usize = 10_000_000;

/// A file in CSV.
///
/// ```
/// use vehicles::table::{Dialect, Table};
///
/// let table = Table::parse(b"t; a\n0.1; 2\n\n0.2; x\n", &["t", "a"], &Dialect::default())?;
/// let a = table.column("a")?;
/// assert_eq!(table.numbers(a).next(), Some(2.0));
/// assert!(table.numbers(a).last().unwrap().is_nan(), "no number");
/// assert_eq!(table.rows.get(1).map(|row| (row.line, row.cell(a))), Some((4, "x")));
/// assert_eq!(table.column("#2"), Ok(a));
/// # Ok::<(), vehicles::table::TableError>(())
/// ```
pub struct Table {
    /// Names of the columns; `#1`, `#2`, … in a file without a header.
    pub headers: Vec<String>,
    /// Line of the header, from 1; `None` in a file without one.
    pub header_line: Option<u64>,
    /// The rows below the header.
    pub rows: Rows,
    decimal: Decimal,
}

impl Table {
    /// Reads a file's `bytes`, of which the columns `wanted` are asked for; they find the header where other lines stand
    /// above it. Columns can be named by number, `#1` the first. Delimiter, header and decimal mark are those of `dialect`,
    /// else those that the file shows.
    ///
    /// # Errors
    /// A file of another format, without a header, with commas of two meanings, or with millions of rows. A cell that is
    /// opened by a quotation mark and not closed on its line.
    pub fn parse(bytes: &[u8], wanted: &[&str], dialect: &Dialect) -> Result<Self, TableError> {
        Self::parse_within(ROWS_MAX, bytes, wanted, dialect)
    }

    fn parse_within(
        rows_max: usize,
        bytes: &[u8],
        wanted: &[&str],
        dialect: &Dialect,
    ) -> Result<Self, TableError> {
        foreign::of(bytes).map_or(Ok(()), Err)?;
        let text = encoding::decode(bytes);
        let layout = layout::find(&text, wanted, dialect)?;
        let (text, delimiter) = layout::delimited(&text[layout.from..], layout.delimiter);
        quotes::check(text.as_bytes(), delimiter)
            .map_err(|quote| quotes::StrayQuote { line: quote.line + layout.lines_before, ..quote })?;
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .has_headers(false)
            .flexible(true)
            .delimiter(delimiter)
            .from_reader(text.as_bytes());
        let mut lines = lines::of(text.as_bytes()).filter(|line| !line.content.is_empty()).peekable();
        let (mut rows, mut count) = (Rows::default(), 0);
        let mut cells = csv::StringRecord::new();
        while reader.read_record(&mut cells)? {
            if rows.len() == rows_max {
                return Err(TableError::Rows(rows_max));
            }
            // The reader's place can be in front of line ends and empty lines.
            let from =
                cells.position().map_or(0, |place| usize::try_from(place.byte()).unwrap_or(usize::MAX));
            while lines.next_if(|line| line.next <= from).is_some() {}
            let line = lines.next().map_or(0, |line| line.number);
            rows.push(layout.lines_before + line, &cells);
            count = count.max(cells.len());
        }
        rows.shrink_to_fit();
        let header_line = layout.header.as_ref().map(|_| layout.header_line);
        let headers =
            layout.header.unwrap_or_else(|| (1..=count).map(|number| format!("#{number}")).collect());
        let table = Self { headers, header_line, rows, decimal: Decimal::Point };
        let decimal = dialect.decimal.map_or_else(|| table.find_decimal(wanted), Ok)?;
        Ok(Self { decimal, ..table })
    }

    /// Returns the index of the column `name`, or of the number `#3`.
    ///
    /// # Errors
    /// If there is none, or more than one of that name.
    pub fn column(&self, name: &str) -> Result<usize, ColumnError> {
        column_of(&self.headers, self.header_line, name)
    }

    /// Returns the numbers of a column; NaN where a cell has none, and in a row that is longer than the header.
    pub fn numbers(&self, column: usize) -> impl Iterator<Item = f64> {
        self.rows.iter().map(move |row| {
            let is_long = self.extra_cells(row) > 0;
            if is_long { f64::NAN } else { self.number(row.cell(column)).unwrap_or(f64::NAN) }
        })
    }

    /// Returns the number in a cell.
    #[must_use]
    pub fn number(&self, cell: &str) -> Option<f64> {
        self.decimal.number(cell)
    }

    /// Refuses a table of which most rows are longer than the header: the columns behind a missing name would hold other
    /// numbers.
    ///
    /// # Errors
    /// The first such row.
    pub fn check_lengths(&self) -> Result<(), TableError> {
        let mut long = self.rows.iter().filter(|row| self.extra_cells(*row) > 0).peekable();
        let (Some(first), Some(header_line)) = (long.peek().copied(), self.header_line) else {
            return Ok(());
        };
        let (line, expected, found) = (first.line, self.headers.len(), first.len());
        if 2 * long.count() <= self.rows.len() {
            return Ok(());
        }
        Err(TableError::LongRows { header_line, line, expected, found })
    }

    /// Refuses a table of fewer than `expected` rows; rows of empty cells do not count.
    ///
    /// # Errors
    /// The last line, and the number of rows.
    ///
    /// ```
    /// use vehicles::table::{Dialect, Table};
    ///
    /// let table = Table::parse(b"t,a\n", &["t", "a"], &Dialect::default())?;
    /// let error = table.check_rows(2).unwrap_err().to_string();
    /// assert!(error.starts_with("line 1: expected at least 2 rows of numbers below the header, found none"));
    /// # Ok::<(), vehicles::table::TableError>(())
    /// ```
    pub fn check_rows(&self, expected: usize) -> Result<(), TableError> {
        let filled = || self.rows.iter().filter(|row| row.cells().any(|cell| !cell.is_empty()));
        let found = filled().take(expected).count();
        if found == expected {
            return Ok(());
        }
        let line = filled().next_back().map_or(self.header_line.unwrap_or(1), |row| row.line);
        Err(TableError::FewRows { line, expected, found })
    }

    /// Returns the fault of a `row` of another length than the header's, in words that follow its line.
    #[must_use]
    pub fn fault_of_length(&self, row: Row<'_>) -> Option<String> {
        let (expected, found) = (self.headers.len(), row.len());
        (found != expected).then(|| format!("expected {expected} cells as in the header, found {found}"))
    }

    /// Number of cells behind those of the header; empty ones at the end do not count.
    fn extra_cells(&self, row: Row<'_>) -> usize {
        if row.len() <= self.headers.len() {
            return 0;
        }
        let extra = row.cells().skip(self.headers.len()).enumerate();
        extra.filter(|(_, cell)| !cell.is_empty()).last().map_or(0, |(place, _)| place + 1)
    }

    /// The decimal mark that the wanted columns have.
    fn find_decimal(&self, wanted: &[&str]) -> Result<Decimal, TableError> {
        let columns: Vec<usize> = wanted.iter().filter_map(|name| self.column(name).ok()).collect();
        let cells = || {
            self.rows
                .iter()
                .flat_map(|row| columns.iter().map(move |column| (row.line, *column, row.cell(*column))))
        };
        let is_comma = |cell: &str| cell.contains(',') && Decimal::Comma.number(cell).is_some();
        let is_point = |cell: &str| cell.contains('.') && Decimal::Point.number(cell).is_some();
        let Some((line, column, cell)) = cells().find(|(_, _, cell)| is_comma(cell)) else {
            return Ok(Decimal::Point);
        };
        let (column, cell) = (self.headers[column].clone(), cell.to_owned());
        if let Some((other_line, _, other)) = cells().find(|(_, _, cell)| is_point(cell)) {
            return Err(TableError::TwoMarks { line, column, cell, other_line, other: other.to_owned() });
        }
        let is_plain = cells().any(|(_, _, cell)| is_comma(cell) && !crate::dialect::is_group(cell));
        is_plain.then_some(Decimal::Comma).ok_or(TableError::Comma { line, column, cell })
    }
}

/// Returns the index of the column `name` among `headers`, which are in a line of the file, or of the number `#3`.
///
/// # Errors
/// If there is none, or more than one of that name.
pub fn column_of(headers: &[String], header_line: Option<u64>, name: &str) -> Result<usize, ColumnError> {
    let places = headers.iter().enumerate().filter(|(_, header)| *header == name).map(|(place, _)| place);
    match (&places.collect::<Vec<_>>()[..], by_number(name)) {
        ([place], _) => Ok(*place),
        ([], Some(number)) if number <= headers.len() => Ok(number - 1),
        ([], Some(_)) => Err(ColumnError::Number { name: name.to_owned(), count: headers.len() }),
        ([], None) => {
            Err(ColumnError::Missing { name: name.to_owned(), known: headers.to_vec(), header_line })
        }
        (places, _) => Err(ColumnError::Several {
            name: name.to_owned(),
            places: places.iter().map(|place| place + 1).collect(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::{Dialect, Table};

    #[test]
    fn rows_beyond_a_limit_are_refused_with_it() {
        let rows = |count: usize| {
            let text = [b"a,b\n", &b"1,2\n".repeat(count)[..]].concat();
            Table::parse_within(5, &text, &["a", "b"], &Dialect::default())
        };
        assert_eq!(rows(5).unwrap().rows.len(), 5);
        let error = rows(6).err().unwrap().to_string();
        assert_eq!(error, "it has more than 5 rows; cut it into several files, or leave out rows");
    }

    #[test]
    fn a_row_of_another_length_than_the_header_has_a_fault() {
        let table = Table::parse(b"a,b\n1,2\n3\n4,5,6\n", &["a", "b"], &Dialect::default()).ok().unwrap();
        let faults: Vec<_> = table.rows.iter().map(|row| table.fault_of_length(row)).collect();
        let found = |count: usize| Some(format!("expected 2 cells as in the header, found {count}"));
        assert_eq!(faults, [None, found(1), found(3)]);
    }
}
