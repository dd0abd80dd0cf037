//! A table of text.

use std::fmt;

/// A table: the names of its columns, and its rows. Its text has columns as wide as their longest cell.
pub(crate) struct Cells {
    pub headings: Vec<String>,
    /// True for a column of numbers, which are aligned right.
    pub is_number: Vec<bool>,
    pub rows: Vec<Vec<String>>,
}

impl Cells {
    /// A table of which the first `texts` columns hold text, and the others numbers.
    pub fn new(headings: &[&str], texts: usize, rows: Vec<Vec<String>>) -> Self {
        let is_number = (0..headings.len()).map(|column| column >= texts).collect();
        Self { headings: headings.iter().map(|heading| (*heading).to_owned()).collect(), is_number, rows }
    }
}

impl fmt::Display for Cells {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = || std::iter::once(&self.headings).chain(&self.rows);
        let width = |column: usize| rows().filter_map(|row| Some(row.get(column)?.chars().count())).max();
        let widths: Vec<usize> = (0..self.headings.len()).filter_map(width).collect();
        let cell = |((text, width), is_number): ((&String, &usize), &bool)| {
            if *is_number { format!("{text:>width$}") } else { format!("{text:<width$}") }
        };
        rows().try_for_each(|row| {
            let cells: Vec<String> = row.iter().zip(&widths).zip(&self.is_number).map(cell).collect();
            writeln!(f, "{}", cells.join("  ").trim_end())
        })
    }
}
