//! Refinement by prediction errors: the accepted parameters moved to where predictions are best.
//!
//! Equations see each instant alone. A vehicle may have more than they hold (a log that misses commands,
//! torques that no effect has). Then the parameters that explain most of their rows are not those that predict
//! best (Ljung, System Identification, 2nd ed., sections 3.2 and 7.2). So the fit of the equations is moved on,
//! by least squares of the errors at the ends of windows. It is taken if it predicts flights better on which it
//! was not moved.
#![allow(
    clippy::disallowed_types,
    reason = "not in a component: reports of flights, whose products are summed by hand"
)]

use crate::fit::{FitResult, Problem};
use crate::foresight::{Foresight, HORIZONS_S, ends, errors};
use crate::normal::{self, Block};
use crate::predict::WindowEnd;
use crate::prepared::Prepared;
use crate::sensor_effects::SENSOR_EFFECTS;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Steps at most.
const STEPS_MAX: usize = 8;
/// A step that gains a smaller part is the last.
const LEAST_STEP_GAIN: f64 = 1e-3;
/// Shares of a step that are tried.
const SHARES: [f64; 5] = [1.0, 0.5, 0.25, 0.1, 0.03];
/// Flights are refined on up to so much of their time, in s.
const SPAN_MAX_S: f64 = 120.0;

/// The parameters `fitted` to the equations, moved on to where predictions are best; `None` where that does not predict better
/// beyond chance, or nothing can be moved.
pub fn refined(problem: &Problem, fitted: &FitResult) -> Option<FitResult> {
    let is_moved = |at: &usize| !SENSOR_EFFECTS.contains(&problem.model.parameters.all[*at].kind);
    let free: Vec<usize> = fitted.free.iter().copied().filter(is_moved).collect();
    let flights: Vec<&Prepared> = problem.estimation.iter().collect();
    if free.is_empty() {
        return None;
    }
    let refinement = Refinement { problem, free: &free, known: known(problem, fitted, &free) };
    let better = refinement.descended(&flights, &fitted.values)?;
    let (blocks, rows) = refinement.blocks(&flights, &better);
    if !refinement.predicts_better(fitted, &better, &blocks, rows) {
        return None;
    }
    Some(refinement.result(fitted, better, &plain(&blocks)))
}

struct Refinement<'p, 'f> {
    problem: &'p Problem<'f>,
    free: &'p [usize],
    /// Inverse of the covariance of the parameters by the equations.
    known: DMatrix<f64>,
}

/// The inverse of the covariance of the parameters `free` that were `fitted`; those that no row determines are known by
/// their bounds alone.
fn known(problem: &Problem, fitted: &FitResult, free: &[usize]) -> DMatrix<f64> {
    let place = |at: usize| fitted.free.iter().position(|known| *known == at).unwrap_or(0);
    let covariance = DMatrix::from_fn(free.len(), free.len(), |i, j| {
        let (spec, found) = (
            problem.model.parameters.all[free[i]].spec(),
            fitted.covariance[(place(free[i]), place(free[j]))],
        );
        match (i == j, found.is_finite()) {
            (_, true) => found,
            (true, false) => (spec.max - spec.min).powi(2),
            (false, false) => 0.0,
        }
    });
    normal::inverse(&covariance)
}

/// The residuals of one flight at one horizon by block of time: six numbers a window.
type Residuals = Vec<(i64, [f64; 6])>;

impl Refinement<'_, '_> {
    /// The values after some steps; `None` if the first gains nothing.
    fn descended(&self, flights: &[&Prepared], start: &[f64]) -> Option<Vec<f64>> {
        let mut values = start.to_vec();
        // The variance of a residual, in whose units the equations' knowledge counts.
        let mut variance = None;
        for number in 0..STEPS_MAX {
            let (blocks, rows) = self.blocks(flights, &values);
            let mut blocks = plain(&blocks);
            let of_errors = normal::sum(&blocks).cost;
            let variance = *variance.get_or_insert(of_errors / rows.max(1) as f64);
            let prior = self.prior(start, &values, variance);
            let cost = of_errors + prior.cost;
            blocks.push(prior);
            let step = self.problem.step(&blocks, &values, self.free);
            let tried = SHARES.iter().find_map(|share| {
                let next = self.problem.moved(&values, self.free, &(&step * *share));
                let next_cost = self.cost(flights, &next) + self.prior(start, &next, variance).cost;
                (next_cost < cost).then_some((next, next_cost))
            });
            let Some((next, next_cost)) = tried else { return (number > 0).then_some(values) };
            values = next;
            if next_cost > (1.0 - LEAST_STEP_GAIN) * cost {
                break;
            }
        }
        Some(values)
    }

    /// Normal equations of the knowledge that the equations have, about `values`.
    fn prior(&self, start: &[f64], values: &[f64], variance: f64) -> Block {
        let away = DVector::from_fn(self.free.len(), |i, _| values[self.free[i]] - start[self.free[i]]);
        let gram = &self.known * variance;
        let gradient = &gram * &away;
        Block { cost: away.dot(&gradient), gram, gradient }
    }

    /// True if flights are predicted better, beyond chance, by values that were moved on the others: each flight in turn, or
    /// those that effects are chosen on. `blocks` are the equations about `better`.
    fn predicts_better(
        &self,
        fitted: &FitResult,
        better: &[f64],
        blocks: &[(usize, Block)],
        rows: usize,
    ) -> bool {
        let problem = self.problem;
        let is_each_in_turn = problem.validation.is_empty() && problem.estimation.len() > 1;
        let judged = if problem.validation.is_empty() { &problem.estimation } else { &problem.validation };
        let pairs = |(at, flight)| {
            if !is_each_in_turn {
                return (flight, fitted.values.clone(), better.to_vec());
            }
            let start = problem.values_without(fitted, at);
            let moved = self.without(at, &start, better, blocks, rows);
            (flight, start, moved)
        };
        let all: Vec<(&Prepared, Vec<f64>, Vec<f64>)> = judged.iter().enumerate().map(pairs).collect();
        let before: Vec<_> = all.iter().map(|(flight, start, _)| (*flight, start.clone())).collect();
        let after: Vec<_> = all.into_iter().map(|(flight, _, moved)| (flight, moved)).collect();
        Foresight::under(problem, &after).is_better_than(&Foresight::under(problem, &before))
    }

    /// The values without the flight at `at`, by a step from the equations about those with all flights. It approximates a descent on the
    /// others, which would take as long as all else together. `start` is what the equations of the other flights say.
    fn without(
        &self,
        at: usize,
        start: &[f64],
        better: &[f64],
        blocks: &[(usize, Block)],
        rows: usize,
    ) -> Vec<f64> {
        let variance = blocks.iter().map(|(_, block)| block.cost).sum::<f64>() / rows.max(1) as f64;
        let others = blocks.iter().filter(|(flight, _)| *flight != at).map(|(_, block)| block.clone());
        let equations: Vec<Block> = others.chain([self.prior(start, better, variance)]).collect();
        let step = self.problem.step(&equations, better, self.free);
        let moved = self.problem.moved(better, self.free, &step);
        // What is not refined stays as the other flights alone have it.
        let mut values = start.to_vec();
        self.free.iter().for_each(|at| values[*at] = moved[*at]);
        values
    }

    fn cost(&self, flights: &[&Prepared], values: &[f64]) -> f64 {
        self.residuals(flights, values).iter().flatten().flat_map(|(_, row)| row).map(|r| loss(*r)).sum()
    }

    /// Residuals in units of persistence's errors.
    fn residuals(&self, flights: &[&Prepared], values: &[f64]) -> Vec<Residuals> {
        let jobs: Vec<(&Prepared, f64)> =
            flights.iter().flat_map(|flight| HORIZONS_S.map(|horizon_s| (*flight, horizon_s))).collect();
        let of_job = |(flight, horizon_s): &(&Prepared, f64)| -> Residuals {
            let ends = ends(self.problem, flight, values, *horizon_s, Some(SPAN_MAX_S));
            let mut scales = [0.0; 2];
            for end in &ends {
                let away = errors(flight, end, &end.persistent);
                for (at, away) in away.iter().enumerate() {
                    scales[at / 3] += away * away / ends.len() as f64;
                }
            }
            let scaled = |row: [f64; 6]| -> [f64; 6] {
                std::array::from_fn(|at| row[at] / scales[at / 3].sqrt().max(1e-9))
            };
            let one = |end: &WindowEnd| {
                (self.problem.block_of(end.from_s), scaled(errors(flight, end, &end.simulated)))
            };
            ends.iter().map(one).collect()
        };
        jobs.par_iter().map(of_job).collect()
    }

    /// The normal equations by block of time, each with the place of its flight, and the number of rows; rows that err much count
    /// less (soft L1).
    fn blocks(&self, flights: &[&Prepared], values: &[f64]) -> (Vec<(usize, Block)>, usize) {
        let now = self.residuals(flights, values);
        let moved: Vec<(f64, Vec<Residuals>)> = self
            .free
            .par_iter()
            .map(|at| {
                let entry = &self.problem.model.parameters.all[*at];
                let mut changed = values.to_vec();
                let step =
                    if values[*at] + entry.step <= entry.spec().max { entry.step } else { -entry.step };
                changed[*at] += step;
                (step, self.residuals(flights, &changed))
            })
            .collect();
        let mut blocks: BTreeMap<(usize, i64), Block> = BTreeMap::new();
        for (job, rows) in now.iter().enumerate() {
            for (window, (block, row)) in rows.iter().enumerate() {
                let key = (job / HORIZONS_S.len(), *block);
                let sum = blocks.entry(key).or_insert_with(|| Block::zero(self.free.len()));
                for (axis, residual) in row.iter().enumerate() {
                    let slope = |(step, residuals): &(f64, Vec<Residuals>)| {
                        let changed = residuals[job].get(window).map_or(*residual, |changed| changed.1[axis]);
                        (changed - residual) / step
                    };
                    let slopes: Vec<f64> = moved.iter().map(slope).collect();
                    sum.add(*residual, &slopes, 1.0 / (1.0 + residual * residual).sqrt());
                    sum.cost += loss(*residual) - residual * residual / (1.0 + residual * residual).sqrt();
                }
            }
        }
        let completed = |((flight, _), mut block): ((usize, i64), Block)| {
            block.complete();
            (flight, block)
        };
        let blocks = blocks.into_iter().map(completed).collect();
        (blocks, 6 * now.iter().map(Vec::len).sum::<usize>())
    }

    /// The result at `values`; parameters that were not moved keep their variance.
    fn result(&self, fitted: &FitResult, values: Vec<f64>, blocks: &[Block]) -> FitResult {
        let of_moved = normal::covariance(blocks);
        let place = |at: &usize| self.free.iter().position(|free| free == at);
        let covariance = DMatrix::from_fn(fitted.free.len(), fitted.free.len(), |i, j| {
            match (place(&fitted.free[i]), place(&fitted.free[j])) {
                (Some(a), Some(b)) => of_moved[(a, b)],
                (None, None) => fitted.covariance[(i, j)],
                _ => 0.0,
            }
        });
        FitResult { values, covariance, ..fitted.clone() }
    }
}

/// Twice the soft L1 loss of a residual.
fn loss(residual: f64) -> f64 {
    2.0 * ((1.0 + residual * residual).sqrt() - 1.0)
}

/// The blocks of all flights.
fn plain(blocks: &[(usize, Block)]) -> Vec<Block> {
    blocks.iter().map(|(_, block)| block.clone()).collect()
}
