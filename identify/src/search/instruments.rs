//! Fits by instrumental variables, for regressors that are measured and so are noisy.
//!
//! Least squares takes noisy regressors for exact, and finds too little of what they stand for (errors in variables). Rotors that follow
//! from the commands have no noise of a sensor. So the derivatives under them are the instruments of those under the measured rotors:
//! Z'W r = 0 in place of X'W r = 0 (Ljung, System Identification, 2nd ed., section 7.6). Without measured speeds both are the same, and
//! so is the fit.
#![allow(
    clippy::disallowed_types,
    reason = "not in a component: reports of flights, whose products are summed by hand"
)]

use crate::data::prepared::Prepared;
use crate::data::rows::keep_means;
use crate::model::problem::Problem;
use crate::model::whitening::Whitening;
use crate::search::fit_result::FitResult;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Steps of a fit at most.
const STEPS_MAX: usize = 8;
/// A fit is done when a step changes every parameter by less than this part of its standard error.
const SMALL_STEP: f64 = 0.02;
/// A pivot below this part of a column's own length counts as zero.
const PIVOT_MIN: f64 = 1e-9;

/// The equations Z'W (r + X d) = 0 of a stretch of time.
#[derive(Debug, Clone)]
struct Moments {
    /// Z'WX.
    cross: DMatrix<f64>,
    /// Z'Wr.
    gradient: DVector<f64>,
}

impl Moments {
    fn zero(size: usize) -> Self {
        Self { cross: DMatrix::zeros(size, size), gradient: DVector::zeros(size) }
    }

    fn add(&mut self, residual: f64, instruments: &[f64], row: &[f64], weight: f64) {
        for (i, instrument) in instruments.iter().enumerate().filter(|(_, one)| **one != 0.0) {
            self.gradient[i] += weight * instrument * residual;
            row.iter().enumerate().for_each(|(j, one)| self.cross[(i, j)] += weight * instrument * one);
        }
    }

    fn sum(blocks: &[Self], size: usize) -> Self {
        blocks.iter().fold(Self::zero(size), |sum, block| Self {
            cross: &sum.cross + &block.cross,
            gradient: &sum.gradient + &block.gradient,
        })
    }

    fn without(&self, other: &Self) -> Self {
        Self { cross: &self.cross - &other.cross, gradient: &self.gradient - &other.gradient }
    }

    /// The step d; 0 of parameters that nothing determines. By elimination, whose last digits do not depend on the processor.
    fn step(&self) -> DVector<f64> {
        let size = self.gradient.len();
        let scale: Vec<f64> = (0..size).map(|i| self.cross[(i, i)].abs().sqrt()).collect();
        let part = |i: usize| if scale[i] > 0.0 { 1.0 / scale[i] } else { 0.0 };
        let mut left = DMatrix::from_fn(size, size, |i, j| self.cross[(i, j)] * part(i) * part(j));
        let mut right = DVector::from_fn(size, |i, _| -self.gradient[i] * part(i));
        let mut pivots: Vec<Option<usize>> = vec![None; size];
        for column in 0..size {
            let open = (0..size).filter(|row| !pivots.contains(&Some(*row)));
            let best = open.max_by(|a, b| left[(*a, column)].abs().total_cmp(&left[(*b, column)].abs()));
            let Some(pivot) = best.filter(|row| left[(*row, column)].abs() > PIVOT_MIN) else { continue };
            pivots[column] = Some(pivot);
            for row in (0..size).filter(|row| *row != pivot) {
                let factor = left[(row, column)] / left[(pivot, column)];
                (0..size).for_each(|at| left[(row, at)] -= factor * left[(pivot, at)]);
                right[row] -= factor * right[pivot];
            }
        }
        DVector::from_fn(size, |at, _| {
            pivots[at].map_or(0.0, |pivot| right[pivot] / left[(pivot, at)] * part(at))
        })
    }
}

impl Problem<'_> {
    /// The fit of the free parameters of `fitted` by instruments, with its covariance: the jackknife over blocks of time.
    pub fn fitted_by_instruments(&self, fitted: &FitResult) -> FitResult {
        let (mut values, free) = (fitted.values.clone(), &fitted.free);
        let mut blocks = self.moments(&values, free);
        for _ in 0..STEPS_MAX {
            let step = Moments::sum(&blocks, free.len()).step();
            let covariance = covariance(&blocks, free.len());
            let is_small = |at: usize| step[at].abs() <= SMALL_STEP * covariance[(at, at)].max(0.0).sqrt();
            if (0..free.len()).all(is_small) {
                break;
            }
            values = self.moved(&values, free, &step);
            blocks = self.moments(&values, free);
        }
        FitResult { covariance: covariance(&blocks, free.len()), values, ..fitted.clone() }
    }

    /// The moments of the estimation data, by block of time.
    fn moments(&self, values: &[f64], free: &[usize]) -> Vec<Moments> {
        self.estimation.par_iter().flat_map_iter(|flight| self.moments_of(flight, values, free)).collect()
    }

    fn moments_of(&self, flight: &Prepared, values: &[f64], free: &[usize]) -> Vec<Moments> {
        let (mut residual, mut columns) = self.linearised(flight, values, free);
        let mut instruments = self.model.instruments(flight, values, free);
        if flight.is_assumed() {
            let blocks = self.block_knots(flight);
            instruments.iter_mut().for_each(|rows| keep_means(flight, rows, &blocks));
        }
        let whitening = Whitening::of(flight, &self.noises);
        let rows = std::iter::once(&mut residual).chain(&mut columns).chain(&mut instruments);
        rows.for_each(|rows| whitening.apply(rows));
        let (width, weights) = (flight.width(), self.row_weights(flight));
        let of_knots = |(first, end): (usize, usize)| {
            let mut moments = Moments::zero(free.len());
            for at in (first * width..end * width).filter(|at| weights[at % width] > 0.0) {
                let row = |of: &[Vec<f64>]| -> Vec<f64> { of.iter().map(|column| column[at]).collect() };
                moments.add(residual[at], &row(&instruments), &row(&columns), weights[at % width]);
            }
            moments
        };
        self.block_knots(flight).into_iter().map(of_knots).collect()
    }
}

/// Covariance of the solution of `blocks`: the jackknife, as of least squares (`normal`).
fn covariance(blocks: &[Moments], size: usize) -> DMatrix<f64> {
    let total = Moments::sum(blocks, size);
    let centre = total.step();
    let scatter = blocks.iter().fold(DMatrix::zeros(size, size), |sum, block| {
        let away = total.without(block).step() - &centre;
        sum + &away * away.transpose()
    });
    let count = blocks.len() as f64;
    let mut covariance = scatter * ((count - 1.0) / count);
    (0..size).filter(|i| total.cross[(*i, *i)] == 0.0).for_each(|i| covariance[(i, i)] = f64::INFINITY);
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = 2 x, where x is measured with as much noise as it has signal: least squares finds 1, instruments find 2.
    #[test]
    fn instruments_find_the_slope_of_a_noisy_regressor() {
        let mut random = component::random::stream(3, "instruments");
        let mut normal = || component::random::normal(&mut random);
        let (mut by_instruments, mut by_squares) = (Moments::zero(1), Moments::zero(1));
        for _ in 0..20_000 {
            let (truth, noise, of_result) = (normal(), normal(), normal());
            let (measured, result) = (truth + noise, 2.0 * truth + 0.1 * of_result);
            by_instruments.add(result, &[-truth], &[-measured], 1.0);
            by_squares.add(result, &[-measured], &[-measured], 1.0);
        }
        assert!((by_instruments.step()[0] - 2.0).abs() < 0.05, "{}", by_instruments.step());
        assert!((by_squares.step()[0] - 1.0).abs() < 0.05, "{}", by_squares.step());
    }

    #[test]
    fn two_parameters_are_told_apart_and_one_without_rows_stays() {
        let mut moments = Moments::zero(3);
        for (x, y) in [(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)] {
            moments.add(y, &[-1.0, -x, 0.0], &[-1.0, -x, 0.0], 1.0);
        }
        let step = moments.step();
        assert!((step[0] - 1.0).abs() < 1e-9 && (step[1] - 2.0).abs() < 1e-9 && step[2] == 0.0, "{step}");
    }
}
