//! The grid of instants on which measured and modelled quantities are compared, and clocks that are late on it.

use std::ops::Range;

/// Instants at equal steps; between pieces of a flight there may be others, which do not count.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// The first instant, in the flight's time.
    pub start_s: f64,
    /// Time between two instants of a piece.
    pub step_s: f64,
    /// Number of instants.
    pub count: usize,
    /// First instant of each piece, as an index and in the flight's time; empty where nothing is left out.
    pieces: Vec<(usize, f64)>,
}

impl Clock {
    /// The instants from `start_s` to `end_s`.
    pub fn spanning(start_s: f64, end_s: f64, step_s: f64) -> Self {
        let steps = ((end_s - start_s) / step_s + 1e-9).floor().max(0.0);
        Self { start_s, step_s, count: steps as usize + 1, pieces: Vec::new() }
    }

    /// The instants of this unbroken clock that lie in `pieces`: ranges of indices, in rising order.
    pub fn within(&self, pieces: &[Range<usize>]) -> Self {
        let mut count = 0;
        let first = |piece: &Range<usize>| {
            count += piece.len();
            (count - piece.len(), self.at(piece.start))
        };
        let pieces: Vec<(usize, f64)> = pieces.iter().map(first).collect();
        Self { start_s: pieces.first().map_or(self.start_s, |piece| piece.1), count, pieces, ..*self }
    }

    /// Instant `index`.
    pub fn at(&self, index: usize) -> f64 {
        let (first, start_s) = self.piece(index);
        start_s + (index - first) as f64 * self.step_s
    }

    /// First instant of the piece that `index` is in, as an index and in the flight's time.
    pub fn piece(&self, index: usize) -> (usize, f64) {
        let begun = self.pieces.partition_point(|piece| piece.0 <= index);
        begun.checked_sub(1).map_or((0, self.start_s), |last| self.pieces[last])
    }

    /// First and last instant of each piece, in the flight's time; empty where nothing is left out.
    pub fn pieces_s(&self) -> Vec<(f64, f64)> {
        let ends = self.pieces.iter().skip(1).map(|piece| piece.0).chain([self.count]);
        self.pieces.iter().zip(ends).map(|((_, start_s), end)| (*start_s, self.at(end - 1))).collect()
    }
}

/// Lateness that is removed from the clocks of one flight.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lateness {
    /// Lateness of the attitude in s.
    pub attitude_s: f64,
    /// Lateness of the position in s.
    pub position_s: f64,
    /// Lateness of the velocity in s.
    pub velocity_s: f64,
    /// Lateness of the rotor speeds in s.
    pub rotor_speed_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_keep_the_times_of_their_instants() {
        let whole = Clock::spanning(2.0, 12.0, 0.5);
        let pieces = [3..5, 9..12];
        let clock = whole.within(&pieces);
        let kept: Vec<f64> = pieces.into_iter().flatten().map(|index| whole.at(index)).collect();
        assert_eq!((0..clock.count).map(|index| clock.at(index)).collect::<Vec<_>>(), kept);
        assert_eq!(clock.pieces_s(), [(3.5, 4.0), (6.5, 7.5)]);
        assert_eq!((clock.piece(1), clock.piece(2)), ((0, 3.5), (2, 6.5)));
        assert_eq!((whole.pieces_s(), whole.piece(7)), (Vec::new(), (0, 2.0)));
    }
}
