//! Least squares over blocks of time: normal equations with the stretch of the flight that they are from.
//!
//! Residuals of neighbouring windows are correlated, so blocks of time count as independent, not windows: the
//! covariance of a fit is the jackknife over them.
#![allow(
    clippy::disallowed_types,
    reason = "not in a component: reports of flights, whose products are summed by hand"
)]

use nalgebra::{DMatrix, DVector};

/// The normal equations of one block, for residuals r(x + d) = r + J d.
#[derive(Debug, Clone)]
pub struct Block {
    /// J'WJ.
    pub gram: DMatrix<f64>,
    /// J'Wr.
    pub gradient: DVector<f64>,
    /// r'Wr.
    pub cost: f64,
}

impl Block {
    /// An empty block for so many parameters.
    pub fn zero(parameters: usize) -> Self {
        Self { gram: DMatrix::zeros(parameters, parameters), gradient: DVector::zeros(parameters), cost: 0.0 }
    }

    /// Adds a row: its residual, its derivatives, its weight.
    pub fn add(&mut self, residual: f64, row: &[f64], weight: f64) {
        self.cost += weight * residual * residual;
        for (i, a) in row.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            self.gradient[i] += weight * a * residual;
            for (j, b) in row[..=i].iter().enumerate() {
                self.gram[(i, j)] += weight * a * b;
            }
        }
    }

    /// Fills the upper half of the matrix, which [`Block::add`] leaves out.
    pub fn complete(&mut self) {
        self.gram.fill_upper_triangle_with_lower_triangle();
    }

    /// The part of it for these parameters.
    pub fn of(&self, free: &[usize]) -> Self {
        let size = free.len();
        Self {
            gram: DMatrix::from_fn(size, size, |i, j| self.gram[(free[i], free[j])]),
            gradient: DVector::from_fn(size, |i, _| self.gradient[free[i]]),
            cost: self.cost,
        }
    }

    /// It without `other`, which is a part of it.
    pub fn without(&self, other: &Self) -> Self {
        Self {
            gram: &self.gram - &other.gram,
            gradient: &self.gradient - &other.gradient,
            cost: self.cost - other.cost,
        }
    }

    /// The equations about the point that a step leads to.
    pub fn after(&self, step: &DVector<f64>) -> Self {
        let gradient = &self.gradient + &self.gram * step;
        Self { gram: self.gram.clone(), gradient, cost: self.cost_after(step) }
    }

    /// The sum of squares after a step.
    pub fn cost_after(&self, step: &DVector<f64>) -> f64 {
        self.cost + 2.0 * self.gradient.dot(step) + step.dot(&(&self.gram * step))
    }
}

/// The sum of blocks.
pub fn sum(blocks: &[Block]) -> Block {
    let size = blocks.first().map_or(0, |block| block.gradient.len());
    blocks.iter().fold(Block::zero(size), |mut sum, block| {
        sum.gram += &block.gram;
        sum.gradient += &block.gradient;
        sum.cost += block.cost;
        sum
    })
}

/// Directions of the parameters whose curvature, in units of the columns' own lengths, is below this part cannot be
/// told from nothing.
const RANK_TOLERANCE: f64 = 1e-9;

/// The pseudo-inverse of a normal matrix, computed with columns scaled to length one.
pub fn inverse(gram: &DMatrix<f64>) -> DMatrix<f64> {
    let size = gram.nrows();
    if size == 0 {
        return gram.clone();
    }
    // Nothing can be told from equations with infinities in them.
    if gram.iter().any(|number| !number.is_finite()) {
        return DMatrix::zeros(size, size);
    }
    let lengths: Vec<f64> = (0..size).map(|i| gram[(i, i)].max(0.0).sqrt()).collect();
    let scale = |i: usize| if lengths[i] > 0.0 { 1.0 / lengths[i] } else { 0.0 };
    let scaled = DMatrix::from_fn(size, size, |i, j| gram[(i, j)] * scale(i) * scale(j));
    let eigen = scaled.symmetric_eigen();
    let largest = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
    let inverse =
        eigen.eigenvalues.map(|value| if value > RANK_TOLERANCE * largest { 1.0 / value } else { 0.0 });
    // Not as a product of matrices, whose last digits depend on the processor where sizes are found at run time.
    let product = |i: usize, j: usize| -> f64 {
        (0..size).map(|k| eigen.eigenvectors[(i, k)] * inverse[k] * eigen.eigenvectors[(j, k)]).sum()
    };
    DMatrix::from_fn(size, size, |i, j| product(i, j) * scale(i) * scale(j))
}

/// The covariance of the parameters fitted on `blocks`, at whose solution the blocks are given: the jackknife over
/// blocks. Each block is left out in turn and the others are solved again (one linear step). The scatter of the
/// solutions, times the number of blocks, is the variance (CV3 of MacKinnon, Nielsen and Webb, J. Econometrics
/// 232(2), 2023). A sandwich of the same blocks is too short where a few violent ones hold most of the
/// evidence.
pub fn covariance(blocks: &[Block]) -> DMatrix<f64> {
    blocks
        .first()
        .map_or(DMatrix::zeros(0, 0), |first| covariance_beside(blocks, &Block::zero(first.gradient.len())))
}

/// The same where the equations `known` hold beside those of the blocks, whichever block is left out.
pub fn covariance_beside(blocks: &[Block], known: &Block) -> DMatrix<f64> {
    let mut total = sum(blocks);
    total.gram += &known.gram;
    total.gradient += &known.gradient;
    let size = total.gradient.len();
    let without =
        |block: &Block| -(inverse(&(&total.gram - &block.gram)) * (&total.gradient - &block.gradient));
    let centre = -(inverse(&total.gram) * &total.gradient);
    let scatter = blocks.iter().fold(DMatrix::zeros(size, size), |sum, block| {
        let away = without(block) - &centre;
        sum + &away * away.transpose()
    });
    let count = blocks.len() as f64;
    let mut covariance = scatter * ((count - 1.0) / count);
    // What no row depends on is not known at all.
    (0..size).filter(|i| total.gram[(*i, *i)] == 0.0).for_each(|i| covariance[(i, i)] = f64::INFINITY);
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(points: &[(f64, f64)]) -> Block {
        let mut block = Block::zero(2);
        points.iter().for_each(|(x, y)| block.add(*y, &[-1.0, -x], 1.0));
        block.complete();
        block
    }

    #[test]
    fn a_line_is_fitted() {
        let block = line(&[(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)]);
        let step = -(inverse(&block.gram) * &block.gradient);
        assert!((step[0] - 1.0).abs() < 1e-9 && (step[1] - 2.0).abs() < 1e-9, "{step}");
        assert!(block.cost_after(&step).abs() < 1e-9);
    }

    #[test]
    fn a_column_of_zeros_and_twins_are_no_trouble() {
        let mut block = Block::zero(3);
        [(1.0, 2.0), (2.0, 4.0)].iter().for_each(|(x, y)| block.add(*y, &[-x, -x, 0.0], 1.0));
        block.complete();
        let step = -(inverse(&block.gram) * &block.gradient);
        assert!((step[0] - 1.0).abs() < 1e-9 && (step[1] - 1.0).abs() < 1e-9 && step[2] == 0.0, "{step}");
    }

    #[test]
    fn what_no_row_depends_on_is_not_known_at_all() {
        let mut blocks = [Block::zero(2), Block::zero(2), Block::zero(2)];
        blocks
            .iter_mut()
            .zip([0.1, -0.2, 0.1])
            .for_each(|(block, residual)| block.add(residual, &[-1.0, 0.0], 1.0));
        let found = covariance(&blocks);
        assert!(found[(0, 0)].is_finite() && found[(0, 0)] > 0.0, "{found}");
        assert!(found[(1, 1)].is_infinite(), "{found}");
    }
}
