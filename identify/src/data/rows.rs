//! Rows of a flight's equations, taken apart by component and changed by their means.

use crate::data::prepared::{Equation, Prepared};

/// One component of an equation over the knots.
pub fn column(flight: &Prepared, rows: &[f64], equation: Equation, axis: usize) -> Vec<f64> {
    let Some(offset) = flight.offset_of(equation) else { return Vec::new() };
    rows[offset + axis..].iter().step_by(flight.width()).copied().collect()
}

/// Puts the mean of each block, given by its first knot and the one behind its last, in place of the angular
/// acceleration's rows.
pub fn keep_means(flight: &Prepared, rows: &mut [f64], blocks: &[(usize, usize)]) {
    on_means(flight, rows, blocks, |row, mean| *row = mean);
}

fn on_means(flight: &Prepared, rows: &mut [f64], blocks: &[(usize, usize)], change: impl Fn(&mut f64, f64)) {
    let Some(offset) = flight.offset_of(Equation::AngularAcceleration) else { return };
    let width = flight.width();
    for (first, last) in blocks {
        for axis in 0..3 {
            let column = || (first * width + offset + axis..last * width).step_by(width);
            let mean = column().map(|at| rows[at]).sum::<f64>() / column().count().max(1) as f64;
            column().for_each(|at| change(&mut rows[at], mean));
        }
    }
}
