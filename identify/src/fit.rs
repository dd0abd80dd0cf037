//! Fitting some of the parameters to flights, with the others held.
#![allow(
    clippy::disallowed_types,
    reason = "not in a component: reports of flights, whose products are summed by hand"
)]

use crate::candidate::Candidate;
use crate::model::Model;
use crate::normal::{self, Block};
use crate::prepared::Prepared;
use crate::rows::{keep_means, take_off_means};
use crate::statistics::student_quantile;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// Weight of each component of each equation: one over the variance of its residual.
pub type Weights = BTreeMap<(&'static str, usize), f64>;

/// Steps of a fit at most.
const STEPS_MAX: usize = 12;
/// A fit is done when a step changes every parameter by less than this part of its standard deviation.
const SMALL_STEP: f64 = 0.02;

/// An estimation problem: flights, the model that they are held against, and how.
#[derive(Debug)]
pub struct Problem<'f> {
    /// The model.
    pub model: Model,
    /// Estimation data: flights that parameters are fitted on.
    pub estimation: Vec<Prepared<'f>>,
    /// Validation data: flights that errors are judged on.
    pub validation: Vec<Prepared<'f>>,
    /// How much each component counts.
    pub weights: Weights,
    /// Length of the blocks that count as independent.
    pub block_s: f64,
    /// What the attitudes of all flights are late by according to the gyroscopes, in s: where a fit of their delay starts.
    pub shared_late_s: f64,
    /// Whether each flight has a trim of its own: then the means of the angular accelerations do not count.
    pub has_own_trims: bool,
}

/// What came of a fit.
#[derive(Debug, Clone)]
pub struct FitResult {
    /// All values, those that were held included.
    pub values: Vec<f64>,
    /// The free parameters, which were fitted.
    pub free: Vec<usize>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Weighted sums of squares of the blocks of the validation data.
    pub validation_costs: Vec<f64>,
    /// Weighted sums of squares of the blocks of the estimation data.
    pub estimation_costs: Vec<f64>,
}

impl FitResult {
    /// Sum of the squares of the validation data.
    pub fn validation_cost(&self) -> f64 {
        self.validation_costs.iter().sum()
    }

    /// Sum of the squares of the estimation data.
    pub fn estimation_cost(&self) -> f64 {
        self.estimation_costs.iter().sum()
    }

    /// Standard error of a parameter; `None` where it was held.
    pub fn standard_error(&self, parameter: usize) -> Option<f64> {
        let at = self.free.iter().position(|free| *free == parameter)?;
        Some(self.covariance[(at, at)].max(0.0).sqrt())
    }

    /// The value that an estimate's error, in units of its standard error, stays below with `probability`: the quantile
    /// of Student's t with G - 1 degrees of freedom for G blocks.
    ///
    /// Blocks, and not rows, count as independent draws, whatever the number of free parameters: G - 1 is what fixed-G
    /// asymptotics of clustered data give (Bester, Conley and Hansen, J. Econometrics 165, 2011), what Cameron and
    /// Miller (J. Human Resources 50(2), 2015, section VI) recommend, and what goes with the jackknife's standard errors
    /// (MacKinnon, Nielsen and Webb, J. Econometrics 232(2), 2023), which already pay for the parameters.
    pub fn t_quantile(&self, probability: f64) -> f64 {
        student_quantile(probability, (self.estimation_costs.len() as f64 - 1.0).max(1.0))
    }
}

impl<'f> Problem<'f> {
    /// All flights, those that are fitted on first.
    pub fn flights(&self) -> impl Iterator<Item = &Prepared<'f>> {
        self.estimation.iter().chain(&self.validation)
    }

    /// The same flights, to be changed.
    pub fn flights_mut(&mut self) -> impl Iterator<Item = &mut Prepared<'f>> {
        self.estimation.iter_mut().chain(&mut self.validation)
    }

    /// Fits the parameters `free`, starting from `start`.
    pub fn fitted(&self, start: &[f64], free: &[usize]) -> FitResult {
        let mut values = start.to_vec();
        let mut blocks = self.blocks(&self.estimation, &values, free);
        let mut cost = normal::sum(&blocks).cost;
        for _ in 0..STEPS_MAX {
            let step = self.step(&blocks, &values, free);
            if free.is_empty() || self.is_small(&step, &blocks) {
                break;
            }
            let Some((next, next_blocks, next_cost)) = self.descended(&values, free, &step, cost) else {
                break;
            };
            (values, blocks) = (next, next_blocks);
            let gain = cost - next_cost;
            cost = next_cost;
            if gain < 1e-9 * cost {
                break;
            }
        }
        let covariance = normal::covariance(&blocks);
        let validation_costs = self.costs(&self.validation, &values);
        let estimation_costs = blocks.iter().map(|block| block.cost).collect();
        FitResult { values, free: free.to_vec(), covariance, validation_costs, estimation_costs }
    }

    /// Whether a step is a small part of every parameter's standard deviation, if all rows were independent.
    fn is_small(&self, step: &DVector<f64>, blocks: &[Block]) -> bool {
        let variances = normal::inverse(&normal::sum(blocks).gram).diagonal();
        step.iter()
            .zip(&variances)
            .all(|(step, variance)| step.abs() <= SMALL_STEP * variance.max(0.0).sqrt())
    }

    /// The values after the step, or after a part of it, where the sum of squares is smaller.
    fn descended(
        &self,
        values: &[f64],
        free: &[usize],
        step: &DVector<f64>,
        cost: f64,
    ) -> Option<(Vec<f64>, Vec<Block>, f64)> {
        let mut share = 1.0;
        for _ in 0..5 {
            let next = self.moved(values, free, &(step * share));
            let blocks = self.blocks(&self.estimation, &next, free);
            let sum = normal::sum(&blocks).cost;
            if sum < cost {
                return Some((next, blocks, sum));
            }
            share /= 4.0;
        }
        None
    }

    /// The Gauss-Newton step within the bounds: a parameter that would leave them stops there, and the others are
    /// fitted to that.
    pub fn step(&self, blocks: &[Block], values: &[f64], free: &[usize]) -> DVector<f64> {
        let total = normal::sum(blocks);
        let mut held: Vec<Option<f64>> = vec![None; free.len()];
        let mut step = DVector::zeros(free.len());
        for _ in 0..=free.len() {
            step = held_step(&total, &held);
            let mut is_within = true;
            for (at, parameter) in free.iter().enumerate() {
                let entry = &self.model.parameters.all[*parameter];
                let wanted = values[*parameter] + step[at];
                let (bound, range) = (entry.bounded(wanted), entry.spec().max - entry.spec().min);
                if held[at].is_none() && (bound - wanted).abs() > 1e-12 * range {
                    held[at] = Some(bound - values[*parameter]);
                    is_within = false;
                }
            }
            if is_within {
                break;
            }
        }
        step
    }

    /// The values after a step, within their bounds.
    pub fn moved(&self, values: &[f64], free: &[usize], step: &DVector<f64>) -> Vec<f64> {
        let mut next = values.to_vec();
        for (parameter, step) in free.iter().zip(step.iter()) {
            next[*parameter] = self.model.parameters.all[*parameter].bounded(next[*parameter] + step);
        }
        next
    }

    /// The normal equations of all blocks of `flights`.
    pub fn blocks(&self, flights: &[Prepared], values: &[f64], free: &[usize]) -> Vec<Block> {
        flights.iter().flat_map(|flight| self.blocks_of(flight, values, free)).collect()
    }

    /// The model's residual and its derivatives, without what this problem does not compare: the means of angular
    /// accelerations where flights have trims of their own, all but their means where the attitude was assumed.
    fn linearised(&self, flight: &Prepared, values: &[f64], free: &[usize]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let (mut residual, mut columns) = self.model.linearised(flight, values, free);
        for rows in std::iter::once(&mut residual).chain(&mut columns) {
            if flight.is_assumed() {
                keep_means(flight, rows, &self.block_knots(flight));
            } else if self.has_own_trims {
                take_off_means(flight, rows);
            }
        }
        (residual, columns)
    }

    /// The weighted sums of squares of all blocks of `flights`.
    pub fn costs(&self, flights: &[Prepared], values: &[f64]) -> Vec<f64> {
        self.blocks(flights, values, &[]).iter().map(|block| block.cost).collect()
    }

    /// The normal equations of the blocks of one flight.
    pub fn blocks_of(&self, flight: &Prepared, values: &[f64], free: &[usize]) -> Vec<Block> {
        use rayon::prelude::*;
        let (residual, columns) = self.linearised(flight, values, free);
        let (width, weights) = (flight.width(), self.row_weights(flight));
        let of_knots = |knots: &(usize, usize)| {
            let mut block = Block::zero(columns.len());
            let mut row = vec![0.0; columns.len()];
            for at in knots.0 * width..knots.1 * width {
                let weight = weights[at % width];
                if weight > 0.0 {
                    row.iter_mut().zip(&columns).for_each(|(row, column)| *row = column[at]);
                    block.add(residual[at], &row, weight);
                }
            }
            block.complete();
            block
        };
        self.block_knots(flight).par_iter().map(of_knots).collect()
    }

    /// The weights of the rows of one knot.
    fn row_weights(&self, flight: &Prepared) -> Vec<f64> {
        let weight = |component| self.weights.get(&component).copied().unwrap_or(0.0);
        components(flight).map(weight).collect()
    }

    /// First knot of each block, and the one behind its last.
    pub fn block_knots(&self, flight: &Prepared) -> Vec<(usize, usize)> {
        let knots = &flight.layout.knots;
        let block_of = |knot: usize| (flight.layout.clock.at(knot) / self.block_s).floor();
        let mut blocks = Vec::new();
        let mut first = 0;
        for at in 1..=knots.len() {
            #[allow(clippy::float_cmp, reason = "whole numbers")]
            if at == knots.len() || block_of(knots[at]) != block_of(knots[first]) {
                blocks.push((first, at));
                first = at;
            }
        }
        blocks
    }
}

/// What the rows of one knot are: equations by name, each with its axes.
fn components(flight: &Prepared) -> impl Iterator<Item = (&'static str, usize)> {
    let equations = flight.layout.equations.iter();
    equations.flat_map(|equation| (0..equation.size()).map(|axis| (equation.name(), axis)))
}

/// The step of the parameters that are not held, while the others go where they are held.
fn held_step(total: &Block, held: &[Option<f64>]) -> DVector<f64> {
    let free: Vec<usize> = (0..held.len()).filter(|at| held[*at].is_none()).collect();
    let mut step = DVector::from_fn(held.len(), |at, _| held[at].unwrap_or(0.0));
    let equations = total.after(&step).of(&free);
    let solved = -(normal::inverse(&equations.gram) * equations.gradient);
    free.iter().zip(solved.iter()).for_each(|(at, solved)| step[*at] = *solved);
    step
}

/// A component without any noise would count infinitely: no sensor is better than this part of its own signal.
const LEAST_NOISE: f64 = 1e-4;

impl Problem<'_> {
    /// Sets the weights by the variance that is left on the estimation data when, from `base` on, all of `candidates` take
    /// the step that fits best.
    pub fn weigh(&mut self, base: &FitResult, candidates: &[Candidate]) {
        let mut all = base.free.clone();
        // Torques of an assumed attitude are zero, to which any scale of thrust or inertia could shrink the model's.
        let is_assumed = self.estimation.iter().any(Prepared::is_assumed);
        let counts =
            |candidate: &&Candidate| candidate.kind.is_linear && (!is_assumed || candidate.is_trim());
        for candidate in candidates.iter().filter(counts) {
            all.extend(candidate.free.iter().filter(|at| !base.free.contains(at)));
        }
        for _ in 0..2 {
            if self.weights.is_empty() {
                self.weights = self.variances(&base.values, &[], &DVector::zeros(0));
            }
            let total = normal::sum(&self.blocks(&self.estimation, &base.values, &all));
            let step = -(normal::inverse(&total.gram) * &total.gradient);
            self.weights = self.variances(&base.values, &all, &step);
        }
    }

    /// One over the variance of each component after a step.
    fn variances(&self, values: &[f64], free: &[usize], step: &DVector<f64>) -> Weights {
        let mut sums: BTreeMap<(&'static str, usize), (f64, f64, f64)> = BTreeMap::new();
        for flight in &self.estimation {
            let (residual, columns) = self.linearised(flight, values, free);
            let measured = self.model.tracks(flight, values).rows;
            let names: Vec<_> = components(flight).collect();
            for (at, residual) in residual.iter().enumerate() {
                let left = residual
                    + columns.iter().zip(step.iter()).map(|(column, step)| column[at] * step).sum::<f64>();
                let sum = sums.entry(names[at % names.len()]).or_default();
                *sum = (sum.0 + left * left, sum.1 + measured[at] * measured[at], sum.2 + 1.0);
            }
        }
        let weight = |(cost, signal, count): (f64, f64, f64)| {
            let variance = (cost + LEAST_NOISE * LEAST_NOISE * signal) / count;
            if variance > 0.0 { 1.0 / variance } else { 0.0 }
        };
        sums.into_iter().map(|(name, sum)| (name, weight(sum))).collect()
    }

    /// The cost that `fitted` leaves on the estimation data, in units of what all candidates together would leave by the
    /// linearised equations: those by which the weights were set. Delays, lags and the battery are far from linear and do
    /// not count.
    pub fn left(&self, fitted: &FitResult) -> f64 {
        fitted.estimation_cost() / self.rows(&self.estimation) as f64
    }

    /// How many rows of `flights` count, at least one.
    pub fn rows(&self, flights: &[Prepared]) -> usize {
        let of = |flight: &Prepared| {
            flight.layout.knots.len()
                * self.row_weights(flight).iter().filter(|weight| **weight > 0.0).count()
        };
        flights.iter().map(of).sum::<usize>().max(1)
    }

    /// The shortest delay that the grids can tell from none.
    pub fn least_delay_s(&self) -> f64 {
        0.5 * self.flights().map(|flight| flight.layout.clock.step_s).fold(0.0, f64::max)
    }
}
