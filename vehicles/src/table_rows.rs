//! The rows of a table, in little memory: their cells one behind the other in one text.

use std::ops::Range;

/// Rows of a table.
///
/// A row takes 24 bytes, each of its cells 8, beside the text: a log of short rows takes some ten times the bytes of its file.
#[derive(Default)]
pub struct Rows {
    /// The cells, one behind the other.
    text: String,
    /// The end of each cell in the text.
    ends: Vec<usize>,
    places: Vec<Place>,
}

struct Place {
    line: u64,
    /// The cells, by their numbers in the table.
    cells: Range<usize>,
}

/// A row of a table. It may have fewer or more cells than the header.
#[derive(Clone, Copy)]
pub struct Row<'a> {
    /// The line, from 1.
    pub line: u64,
    text: &'a str,
    /// Start of the first cell in the text.
    from: usize,
    /// The end of each cell in the text.
    ends: &'a [usize],
}

impl Rows {
    /// The number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// True if there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The row `index`, from 0.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<Row<'_>> {
        self.places.get(index).map(|place| self.row(place))
    }

    /// The line of row `index`; 0 behind the last row.
    #[must_use]
    pub fn line(&self, index: usize) -> u64 {
        self.places.get(index).map_or(0, |place| place.line)
    }

    /// Iterates over the rows.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = Row<'_>> + ExactSizeIterator + Clone {
        self.places.iter().map(|place| self.row(place))
    }

    /// Leaves out all rows but `kept`.
    pub fn keep(&mut self, kept: Range<usize>) {
        self.places.truncate(kept.end);
        self.places.drain(..kept.start);
    }

    /// Gives back the memory for rows that did not come.
    pub(crate) fn shrink_to_fit(&mut self) {
        self.text.shrink_to_fit();
        self.ends.shrink_to_fit();
        self.places.shrink_to_fit();
    }

    pub(crate) fn push<'c>(&mut self, line: u64, cells: impl IntoIterator<Item = &'c str>) {
        let first = self.ends.len();
        for cell in cells {
            self.text.push_str(cell);
            self.ends.push(self.text.len());
        }
        self.places.push(Place { line, cells: first..self.ends.len() });
    }

    fn row(&self, place: &Place) -> Row<'_> {
        let from = place.cells.start.checked_sub(1).map_or(0, |before| self.ends[before]);
        Row { line: place.line, text: &self.text, from, ends: &self.ends[place.cells.clone()] }
    }
}

impl<'a> Row<'a> {
    /// The number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// True if there are no cells.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// A cell, without blanks around it; empty behind the end of a short row.
    #[must_use]
    pub fn cell(&self, column: usize) -> &'a str {
        let from = column.checked_sub(1).map_or(Some(&self.from), |before| self.ends.get(before));
        match (from, self.ends.get(column)) {
            (Some(&from), Some(&end)) => &self.text[from..end],
            _ => "",
        }
    }

    /// Iterates over the cells.
    pub fn cells(self) -> impl Iterator<Item = &'a str> {
        (0..self.ends.len()).map(move |column| self.cell(column))
    }
}

#[cfg(test)]
mod tests {
    use super::Rows;

    #[test]
    fn rows_keep_their_cells_whatever_their_lengths() {
        let mut rows = Rows::default();
        let written: [(u64, &[&str]); 4] = [(2, &["a", "", "bc"]), (3, &[]), (5, &["", "d"]), (6, &["µ"])];
        for (line, cells) in written {
            rows.push(line, cells.iter().copied());
        }
        let read = |rows: &Rows| -> Vec<(u64, Vec<String>)> {
            rows.iter().map(|row| (row.line, row.cells().map(str::to_owned).collect())).collect()
        };
        let expected = written.map(|(line, cells)| (line, cells.iter().map(ToString::to_string).collect()));
        assert_eq!(read(&rows), expected);
        assert_eq!((rows.get(2).unwrap().cell(1), rows.get(2).unwrap().cell(2)), ("d", ""));
        assert_eq!((rows.get(4).is_none(), rows.line(3), rows.line(4)), (true, 6, 0));
        rows.keep(2..3);
        assert_eq!(read(&rows), expected[2..3]);
    }
}
