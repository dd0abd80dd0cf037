//! Fits near a solution: the derivatives of another point are kept.
//!
//! They compare a fit with and without an effect in a small part of the time of a fit in full.

use crate::model::problem::Problem;
use crate::numbers::normal::{self, Block};
use crate::search::fit::{Equations, unbounded};
use crate::search::fit_result::FitResult;

/// A fit whose derivatives were taken at a point near: exact enough for a comparison, and not for an interval.
#[derive(Debug, Clone)]
pub struct Near {
    /// Values of all parameters.
    pub values: Vec<f64>,
    /// The free parameters.
    free: Vec<usize>,
    /// The normal equations about the values, by flight and block of time.
    blocks: Vec<Vec<Block>>,
}

impl Problem<'_> {
    /// The fit with the parameters `dropped` at their baselines and the other ones of `equations`, which are those about `values`.
    pub fn near(&self, equations: &Equations, values: &[f64], dropped: &[usize]) -> Near {
        let others = equations.without(dropped);
        let start = if dropped.is_empty() {
            values.to_vec()
        } else {
            let baseline = |at: &usize| self.model.parameters.all[*at].baseline - values[*at];
            let held = equations.free.iter().map(|at| dropped.contains(at).then(|| baseline(at))).collect();
            let total = normal::sum(&equations.all());
            self.moved(values, &equations.free, &self.step_beside(&total, values, &equations.free, held))
        };
        let cost = self.costs(&self.estimation, &start).iter().sum();
        let values = self.chord_steps(&others, start, cost);
        Near { blocks: self.blocks_with(&others, &values), free: others.free, values }
    }

    /// The fit near, as a result, of the parameters of `equations`, which are those about `values`.
    pub fn fitted_near(&self, equations: &Equations, values: &[f64]) -> FitResult {
        let near = self.near(equations, values, &[]);
        let blocks = near.blocks.concat();
        FitResult {
            covariance: self.covariance(&blocks, equations),
            validation_costs: self.costs_near(&near),
            estimation_costs: blocks.iter().map(|block| block.cost).collect(),
            unbounded: unbounded(&normal::sum(&blocks), &near.values, &near.free),
            values: near.values,
            free: near.free,
        }
    }

    /// The values of `near` without each estimation flight in turn, as those of [`Problem::values_without`].
    pub fn each_without(&self, near: &Near) -> Vec<Vec<f64>> {
        let Near { values, free, blocks } = near;
        if blocks.len() < 2 || free.is_empty() {
            return vec![values.clone(); blocks.len()];
        }
        let without = |flight: usize| {
            let kept = [&blocks[..flight], &blocks[flight + 1..]].concat().concat();
            self.moved(values, free, &self.step(&kept, values, free))
        };
        (0..blocks.len()).map(without).collect()
    }

    /// The costs of `near` on the data that effects are chosen on.
    pub fn costs_near(&self, near: &Near) -> Vec<f64> {
        if self.validation.is_empty() {
            self.cross_validated(&near.blocks.concat(), &near.values, &near.free)
        } else {
            self.costs(&self.validation, &near.values)
        }
    }
}
