//! Generalised least squares over rows of several components, with blocks of time as independent units.
//!
//! Each component has a noise of its own, whose autoregressive model whitens its rows (docs/decisions/022). The model is
//! estimated from what is left of the fit before, first with white noise.

use std::ops::Range;

use crate::model::noise_model::{NoiseModel, Products};
use crate::numbers::normal::{self, Block};
use crate::numbers::statistics::{Estimate, jackknife};
use crate::rotor::score::LEVEL;

/// Blocks of time from which an interval means anything.
pub const BLOCKS_MIN: usize = 5;
/// Estimates of the noise, each followed by a fit.
const ROUNDS: usize = 3;

/// Rows of one component of one flight.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Number of the component: its noise is the same in all flights.
    pub component: usize,
    /// Rows without a gap between them.
    pub stretches: Vec<Range<usize>>,
    /// Measured value, or the residual about a linearisation.
    pub values: Vec<f64>,
    /// Derivatives of the model by the parameters: a column each.
    pub columns: Vec<Vec<f64>>,
    /// Number of the block of time of each row.
    pub blocks: Vec<usize>,
}

/// Weights of rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Weighting {
    /// Each row counts as much as any other of its component: what is slow counts, in which a mean is told.
    Plain,
    /// Rows are whitened: a slow disturbance that a controller answers does not bias a gain (docs/decisions/022).
    Whitened,
}

/// Knowledge about one parameter that the rows do not hold.
#[derive(Debug, Clone, Copy)]
pub struct Prior {
    /// The parameter; it is 0 on average.
    pub parameter: usize,
    /// Its standard deviation.
    pub sigma: f64,
}

/// Result of a fit.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The parameters.
    pub values: Vec<f64>,
    /// The parameters without one block of time after the other.
    pub without_one: Vec<Vec<f64>>,
    /// Change of the parameters with one standard deviation of each thing that the blocks of time do not show.
    pub by_prior: Vec<Vec<f64>>,
}

impl Rows {
    /// Residual under `values`.
    pub fn residual(&self, values: &[f64]) -> Vec<f64> {
        let mut residual = self.values.clone();
        for (column, value) in self.columns.iter().zip(values) {
            residual.iter_mut().zip(column).for_each(|(residual, entry)| *residual -= value * entry);
        }
        residual
    }

    fn whiten(&self, model: &NoiseModel, column: &mut [f64]) {
        self.stretches.iter().for_each(|stretch| model.whiten(&mut column[stretch.clone()], 1));
    }

    /// Adds the whitened rows to `blocks`.
    fn add_to(&self, blocks: &mut [Block], model: &NoiseModel) {
        let (mut values, mut columns) = (self.values.clone(), self.columns.clone());
        self.whiten(model, &mut values);
        columns.iter_mut().for_each(|column| self.whiten(model, column));
        let mut row = vec![0.0; columns.len()];
        for (at, value) in values.iter().enumerate() {
            row.iter_mut().zip(&columns).for_each(|(entry, column)| *entry = -column[at]);
            blocks[self.blocks[at]].add(*value, &row, model.weight());
        }
    }
}

/// Noise of each component, from the residuals under `values`.
pub fn noises(rows: &[Rows], values: &[f64], weighting: Weighting) -> Vec<NoiseModel> {
    let model = |products: &Products| match weighting {
        Weighting::Plain => products.white(),
        Weighting::Whitened => products.model(),
    };
    products(rows, values).iter().map(model).collect()
}

fn products(rows: &[Rows], values: &[f64]) -> Vec<Products> {
    let components = rows.iter().map(|rows| rows.component + 1).max().unwrap_or(0);
    let mut products = vec![Products::default(); components];
    for rows in rows {
        let residual = rows.residual(values);
        rows.stretches.iter().for_each(|stretch| products[rows.component].add(&residual[stretch.clone()]));
    }
    products
}

/// Normal equations of each block of time that has rows, about the values at which `rows` are residuals.
pub fn blocks(rows: &[Rows], noises: &[NoiseModel]) -> Vec<Block> {
    let size = rows.first().map_or(0, |rows| rows.columns.len());
    let count = rows.iter().flat_map(|rows| &rows.blocks).max().map_or(0, |last| last + 1);
    let mut blocks = vec![Block::zero(size); count];
    rows.iter().for_each(|rows| rows.add_to(&mut blocks, &noises[rows.component]));
    blocks.iter_mut().for_each(Block::complete);
    blocks.retain(|block| block.cost > 0.0 || block.gram.iter().any(|entry| *entry != 0.0));
    blocks
}

/// Step from the point of the normal equations to their solution.
pub fn step(total: &Block) -> Vec<f64> {
    (-(normal::inverse(&total.gram) * &total.gradient)).iter().copied().collect()
}

/// Fits the parameters of linear `rows`; `None` with too few blocks of time.
pub fn solved(rows: &[Rows], priors: &[Prior], weighting: Weighting) -> Option<Solution> {
    let size = rows.first()?.columns.len();
    let all = blocks(rows, &noises_of_fit(rows, priors, weighting));
    (all.len() >= BLOCKS_MIN).then(|| Solution::of(vec![0.0; size], &all, priors))
}

/// Noise of each component about the fit of linear `rows`.
pub fn noises_of_fit(rows: &[Rows], priors: &[Prior], weighting: Weighting) -> Vec<NoiseModel> {
    let size = rows.first().map_or(0, |rows| rows.columns.len());
    let mut noises = noises(rows, &vec![0.0; size], Weighting::Plain);
    for _ in 0..ROUNDS {
        let values = step(&with_priors(&normal::sum(&blocks(rows, &noises)), priors));
        noises = self::noises(rows, &values, weighting);
    }
    noises
}

fn with_priors(total: &Block, priors: &[Prior]) -> Block {
    let mut total = total.clone();
    for Prior { parameter, sigma } in priors {
        total.gram[(*parameter, *parameter)] += 1.0 / (sigma * sigma);
    }
    total
}

impl Solution {
    /// Solves the normal equations of `blocks`, which are about `values`.
    pub fn of(values: Vec<f64>, blocks: &[Block], priors: &[Prior]) -> Self {
        let total = with_priors(&normal::sum(blocks), priors);
        let moved = |total: &Block| -> Vec<f64> {
            values.iter().zip(step(total)).map(|(value, step)| value + step).collect()
        };
        let without_one = blocks.iter().map(|block| moved(&total.without(block))).collect();
        let inverse = normal::inverse(&total.gram);
        let by_prior = |Prior { parameter, sigma }: &Prior| {
            (0..values.len()).map(|at| inverse[(at, *parameter)] / sigma).collect()
        };
        let by_prior = priors.iter().map(by_prior).collect();
        Self { values: moved(&total), without_one, by_prior }
    }

    /// A function of the parameters with its interval.
    pub fn estimate(&self, of: impl Fn(&[f64]) -> f64) -> Estimate {
        let value = of(&self.values);
        let without_one: Vec<f64> = self.without_one.iter().map(|values| of(values)).collect();
        let by_prior = self.by_prior.iter().map(|change| {
            let moved: Vec<f64> = self.values.iter().zip(change).map(|(value, by)| value + by).collect();
            of(&moved) - value
        });
        let squares: f64 = by_prior.map(|change| change * change).sum();
        jackknife(value, &without_one, LEVEL).with_error(squares.sqrt(), LEVEL)
    }
}
