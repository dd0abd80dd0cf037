//! Rows of numbers, all of one length, in one buffer.

/// Rows of numbers.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NumberRows {
    width: usize,
    numbers: Vec<f64>,
}

impl NumberRows {
    /// No rows of `width` numbers each.
    pub fn of_width(width: usize) -> Self {
        Self { width, numbers: Vec::new() }
    }

    /// Rows of NaN, `count` of `width` numbers each.
    pub fn unknown(width: usize, count: usize) -> Self {
        Self { width, numbers: vec![f64::NAN; width * count] }
    }

    /// Adds a row, whose numbers are as many as the rows are wide.
    pub fn push(&mut self, row: impl IntoIterator<Item = f64>) {
        self.numbers.extend(row);
        debug_assert!(self.numbers.len().is_multiple_of(self.width.max(1)), "rows have one length");
    }

    /// Sets the column `index` to `numbers`, row by row as far as there are rows.
    pub fn set_column(&mut self, index: usize, numbers: impl IntoIterator<Item = f64>) {
        let cells = self.numbers.iter_mut().skip(index).step_by(self.width.max(1));
        cells.zip(numbers).for_each(|(cell, number)| *cell = number);
    }

    /// Adds the rows of `others`, which are as wide, and leaves none there.
    pub fn append(&mut self, others: &mut Self) {
        self.width = others.width;
        self.numbers.append(&mut others.numbers);
    }

    /// The rows.
    pub fn iter(&self) -> impl Iterator<Item = &[f64]> + Clone {
        self.numbers.chunks_exact(self.width.max(1))
    }

    /// The rows to be changed.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        self.numbers.chunks_exact_mut(self.width.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_filled_by_row_and_by_column() {
        let mut by_row = NumberRows::of_width(2);
        by_row.push([1.0, 2.0]);
        by_row.push([3.0, 4.0]);
        let mut by_column = NumberRows::unknown(2, 2);
        by_column.set_column(0, [1.0, 3.0, 9.0]);
        assert!(by_column.iter().all(|row| row[1].is_nan()));
        by_column.set_column(1, [2.0, 4.0]);
        assert_eq!(by_row, by_column);
        let mut both = NumberRows::default();
        both.append(&mut by_row);
        both.append(&mut by_column);
        assert_eq!(both.iter().map(<[f64]>::to_vec).collect::<Vec<_>>(), [[1.0, 2.0], [3.0, 4.0]].repeat(2));
        assert_eq!((by_row.iter().count(), NumberRows::default().iter().count()), (0, 0));
    }
}
