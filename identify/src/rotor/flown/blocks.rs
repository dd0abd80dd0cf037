//! Blocks of time that count as independent units, numbered over all flights.

use crate::data::prepared::block_s;

/// The blocks of some flights.
#[derive(Debug, Clone)]
pub struct Blocks {
    length_s: f64,
    /// Number of the first block of each flight.
    first: Vec<usize>,
}

impl Blocks {
    /// The blocks of flights of which so much is compared in all, where each ends at `ends_s`.
    pub fn of(compared_s: f64, ends_s: &[f64]) -> Self {
        let length_s = block_s(compared_s);
        let mut next = 0;
        let mut number = |end_s: &f64| {
            let first = next;
            next += (end_s.max(0.0) / length_s) as usize + 1;
            first
        };
        Self { length_s, first: ends_s.iter().map(&mut number).collect() }
    }

    /// Number of the block of a time of a flight.
    pub fn of_time(&self, flight: usize, time_s: f64) -> usize {
        self.first[flight] + (time_s.max(0.0) / self.length_s) as usize
    }
}
