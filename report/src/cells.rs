//! A table of text.

use std::fmt;

/// A table: what its columns are called, and its rows. Its text has columns as wide as their longest cell.
pub(crate) struct Cells<const N: usize> {
    pub headings: [&'static str; N],
    /// Whether a column holds numbers, which stand right.
    pub is_number: [bool; N],
    pub rows: Vec<[String; N]>,
}

impl<const N: usize> fmt::Display for Cells<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let headings = self.headings.map(str::to_owned);
        let rows = || std::iter::once(&headings).chain(&self.rows);
        let width = |column: usize| rows().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: [usize; N] = std::array::from_fn(width);
        let cell = |row: &[String; N], column: usize| {
            let (text, width) = (&row[column], widths[column]);
            if self.is_number[column] { format!("{text:>width$}") } else { format!("{text:<width$}") }
        };
        rows().try_for_each(|row| {
            let cells: Vec<String> = (0..N).map(|column| cell(row, column)).collect();
            writeln!(f, "{}", cells.join("  "))
        })
    }
}
