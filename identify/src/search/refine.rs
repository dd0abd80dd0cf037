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

use crate::data::prepared::Prepared;
use crate::model::disturbance::DisturbanceModels;
use crate::model::parameter::Parameter;
use crate::model::predict::WindowEnd;
use crate::model::problem::Problem;
use crate::model::sensor_effects::SENSOR_EFFECTS;
use crate::numbers::normal::{self, Block};
use crate::search::candidate::Candidate;
use crate::search::fit::unbounded;
use crate::search::fit_result::FitResult;
use crate::search::foresight::{ERRORS, Foresight, WindowErrors, ends, errors};
use nalgebra::{DMatrix, DVector};
use plant::effects::WIND;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Horizons at which prediction errors are made small.
const REFINED_S: [f64; 5] = [0.05, 0.1, 0.2, 0.35, 0.5];
/// Persistence's error along one axis counts as at least this part of that along all three.
const LEAST_PART: f64 = 0.1;
/// Steps at most.
const STEPS_MAX: usize = 8;
/// A step that gains a smaller part is the last.
const LEAST_STEP_GAIN: f64 = 1e-3;
/// Shares of a step that are tried.
const SHARES: [f64; 5] = [1.0, 0.5, 0.25, 0.1, 0.03];

/// Parameters that were moved on to where predictions are best, and the equations of prediction errors about them.
pub struct Refined<'p, 'f> {
    refinement: Refinement<'p, 'f>,
    /// The fit of the equations of motion.
    fitted: &'p FitResult,
    about: Linearised,
    /// The refined fit.
    pub result: FitResult,
}

/// The parameters `fitted` to the equations, moved on to where predictions are best; `None` where that does not predict better
/// beyond chance, or nothing can be moved. The search begins at the values `near`, which an earlier one may have found.
pub fn refined<'p, 'f>(
    problem: &'p Problem<'f>,
    fitted: &'p FitResult,
    near: Option<&[f64]>,
) -> Option<Refined<'p, 'f>> {
    let all = &problem.model.parameters.all;
    let has_winds = fitted.free.iter().any(|at| all[*at].flight.is_some());
    // Derivatives by the winds of flights would take the time of as many flights again, and their mean belongs to them.
    let is_wind = |entry: &Parameter| entry.flight.is_some() || (has_winds && *entry.kind == WIND);
    let is_moved = |at: &usize| !SENSOR_EFFECTS.contains(&all[*at].kind) && !is_wind(&all[*at]);
    let free: Vec<usize> = fitted.free.iter().copied().filter(is_moved).collect();
    if free.is_empty() {
        return None;
    }
    let known = known(problem, fitted, &free);
    let refinement =
        Refinement { problem, free, known, models: DisturbanceModels::of(problem, &fitted.values) };
    let (values, about) = refinement.descended(&fitted.values, near)?;
    let result = refinement.result(fitted, values, &about);
    let refined = Refined { refinement, fitted, about, result };
    refined.predicts_better().then_some(refined)
}

struct Refinement<'p, 'f> {
    problem: &'p Problem<'f>,
    free: Vec<usize>,
    /// Inverse of the covariance of the parameters by the equations.
    known: DMatrix<f64>,
    /// The models of the disturbances.
    models: DisturbanceModels,
}

/// Prediction errors of the estimation data about some values, with their derivatives.
#[derive(Clone)]
struct Linearised {
    /// The values.
    values: Vec<f64>,
    /// By flight and horizon.
    residuals: Vec<Residuals>,
    /// By parameter, flight and horizon, and window.
    slopes: Vec<Vec<Vec<WindowErrors>>>,
    /// The variance of a residual, in whose units the knowledge that the equations have counts.
    variance: f64,
}

/// The inverse of the covariance of the parameters `free` that were `fitted`; those that no row determines are known by
/// their bounds alone.
fn known(problem: &Problem, fitted: &FitResult, free: &[usize]) -> DMatrix<f64> {
    let place = |at: usize| fitted.free.iter().position(|known| *known == at).unwrap_or(0);
    let covariance = DMatrix::from_fn(free.len(), free.len(), |i, j| {
        let (entry, found) =
            (&problem.model.parameters.all[free[i]], fitted.covariance[(place(free[i]), place(free[j]))]);
        match (i == j, found.is_finite()) {
            (_, true) => found,
            (true, false) => (entry.max - entry.spec().min).powi(2),
            (false, false) => 0.0,
        }
    });
    normal::inverse(&covariance)
}

/// The residuals of one flight at one horizon, with their blocks of time.
type Residuals = Vec<(i64, WindowErrors)>;

impl Refined<'_, '_> {
    /// True if flights are predicted better, beyond chance, by values that were moved on the others: each flight in turn, or
    /// those that effects are chosen on.
    fn predicts_better(&self) -> bool {
        let problem = self.refinement.problem;
        let before = |at| {
            if self.is_each_in_turn() {
                problem.values_without(self.fitted, at)
            } else {
                self.fitted.values.clone()
            }
        };
        let before: Vec<_> =
            self.judged().iter().enumerate().map(|(at, flight)| (flight, before(at))).collect();
        let after = self.by_flight(&self.about, &[]);
        let under = |flights: &[_]| Foresight::under(problem, &self.refinement.models, flights);
        under(&after).is_better_than(&under(&before))
    }

    /// Predictions of the flights that effects are chosen on, with the parameters `dropped` at their baselines and the others moved to that.
    pub fn foresight(&self, dropped: &[usize]) -> Foresight {
        let about = if dropped.is_empty() {
            self.about.clone()
        } else {
            self.refinement.beside(&self.about, &self.fitted.values, dropped)
        };
        Foresight::under(self.refinement.problem, &self.refinement.models, &self.by_flight(&about, dropped))
    }

    /// The part of the loss of the estimation data that each of `candidates` would take off, as the linearised predictions promise.
    pub fn promises(&self, candidates: &[&Candidate]) -> Vec<f64> {
        let Refinement { problem, free, .. } = &self.refinement;
        let all =
            [free.clone(), candidates.iter().flat_map(|candidate| candidate.free.clone()).collect()].concat();
        let wide = Refinement {
            problem,
            known: DMatrix::zeros(all.len(), all.len()),
            free: all,
            models: self.refinement.models.clone(),
        };
        let about = wide.linearised(&self.about.values);
        let total = normal::sum(&plain(wide.blocks(&about)));
        let cost_after = |columns: &[usize]| {
            let block = total.of(columns);
            let parameters: Vec<usize> = columns.iter().map(|at| wide.free[*at]).collect();
            let step = problem.step_of(&block, &about.values, &parameters);
            block.cost_after(&step)
        };
        let refined: Vec<usize> = (0..free.len()).collect();
        let before = cost_after(&refined);
        let promise = |candidate: &&Candidate| {
            let columns = wide
                .free
                .iter()
                .enumerate()
                .filter(|(at, free)| *at >= refined.len() && candidate.free.contains(free));
            let columns: Vec<usize> = refined.iter().copied().chain(columns.map(|(at, _)| at)).collect();
            1.0 - cost_after(&columns) / before
        };
        candidates.iter().map(promise).collect()
    }

    /// True if the flights that predictions are judged on are not those that parameters were moved on.
    pub fn is_held_out(&self) -> bool {
        self.is_each_in_turn() || !self.refinement.problem.validation.is_empty()
    }

    fn is_each_in_turn(&self) -> bool {
        let problem = self.refinement.problem;
        problem.validation.is_empty() && problem.estimation.len() > 1
    }

    fn judged(&self) -> &[Prepared<'_>] {
        let problem = self.refinement.problem;
        if problem.validation.is_empty() { &problem.estimation } else { &problem.validation }
    }

    /// The flights that predictions are judged on, each with its values: where there are no others, those without the flight, by a step
    /// from the equations about those with all flights. It approximates a descent on the others, which would take as long as all else together.
    fn by_flight(&self, about: &Linearised, dropped: &[usize]) -> Vec<(&Prepared<'_>, Vec<f64>)> {
        let blocks = self.refinement.blocks(about);
        let of_flight = |(at, flight)| {
            if !self.is_each_in_turn() {
                return (flight, about.values.clone());
            }
            let others = blocks.iter().filter(|(of, _)| *of != at).map(|(_, block)| block.clone());
            let start = self.refinement.problem.values_without(self.fitted, at);
            (flight, self.refinement.stepped(about, &start, others.collect(), dropped))
        };
        self.judged().iter().enumerate().map(of_flight).collect()
    }
}

impl Refinement<'_, '_> {
    /// The values after some steps and the equations about them; `None` if nothing gains. `start` is what the equations of motion say.
    fn descended(&self, start: &[f64], near: Option<&[f64]>) -> Option<(Vec<f64>, Linearised)> {
        let at_start = self.residuals(start);
        let variance = variance(&at_start);
        let near = near.map(|near| self.with_refined(start, near)).filter(|near| {
            cost(&self.residuals(near)) + self.prior(start, variance, near).cost < cost(&at_start)
        });
        let mut about = self.linearised(near.as_deref().unwrap_or(start));
        for number in 0..STEPS_MAX {
            let Some((moved, gain)) = self.next(&about, start, &[], &SHARES) else {
                return (number > 0 || near.is_some()).then(|| (about.values.clone(), about));
            };
            // Residuals change more than their derivatives, and take a small part of the time.
            let moved = self.chord_steps(moved, start, &[], &[1.0]);
            about = self.linearised(&moved.values);
            if gain < LEAST_STEP_GAIN {
                break;
            }
        }
        Some((about.values.clone(), about))
    }

    /// The equations after steps with the derivatives as they were, while these gain.
    fn chord_steps(
        &self,
        mut about: Linearised,
        start: &[f64],
        dropped: &[usize],
        shares: &[f64],
    ) -> Linearised {
        for _ in 0..STEPS_MAX {
            let Some((next, gain)) = self.next(&about, start, dropped, shares) else { break };
            about = next;
            if gain < LEAST_STEP_GAIN {
                break;
            }
        }
        about
    }

    /// The values of `start` with the refined ones of `others`.
    fn with_refined(&self, start: &[f64], others: &[f64]) -> Vec<f64> {
        let mut values = start.to_vec();
        self.free.iter().for_each(|at| values[*at] = others[*at]);
        values
    }

    /// The equations with the parameters `dropped` at their baselines and the others moved to that. The derivatives stay, so that the errors come
    /// out somewhat too large.
    fn beside(&self, about: &Linearised, start: &[f64], dropped: &[usize]) -> Linearised {
        let blocks = plain(self.blocks(about));
        let moved = self.moved(about, self.stepped(about, start, blocks, dropped));
        self.chord_steps(moved, start, dropped, &SHARES)
    }

    /// The equations after the greatest of these shares of a step that gains, with the derivatives as they were, and the part that it gains.
    fn next(
        &self,
        about: &Linearised,
        start: &[f64],
        dropped: &[usize],
        shares: &[f64],
    ) -> Option<(Linearised, f64)> {
        let blocks = plain(self.blocks(about));
        let cost = normal::sum(&blocks).cost + self.prior(start, about.variance, &about.values).cost;
        let whole = self.stepped(about, start, blocks, dropped);
        let step = DVector::from_iterator(
            self.free.len(),
            self.free.iter().map(|at| whole[*at] - about.values[*at]),
        );
        shares.iter().find_map(|share| {
            let next = self.moved(about, self.problem.moved(&about.values, &self.free, &(&step * *share)));
            let of_next = self::cost(&next.residuals) + self.prior(start, about.variance, &next.values).cost;
            (of_next < cost).then(|| (next, 1.0 - of_next / cost))
        })
    }

    /// The values after the step that the equations `blocks` about some values ask for. The equations of
    /// motion, which are fulfilled best at `start`, count beside them. Those `dropped` go to their baselines;
    /// those that are not refined are as in `start`.
    fn stepped(
        &self,
        about: &Linearised,
        start: &[f64],
        mut blocks: Vec<Block>,
        dropped: &[usize],
    ) -> Vec<f64> {
        blocks.push(self.prior(start, about.variance, &about.values));
        let all = &self.problem.model.parameters.all;
        let held =
            self.free.iter().map(|at| dropped.contains(at).then(|| all[*at].baseline - about.values[*at]));
        let step = self.problem.step_beside(&normal::sum(&blocks), &about.values, &self.free, held.collect());
        let moved = self.problem.moved(&about.values, &self.free, &step);
        self.with_refined(start, &moved)
    }

    /// Normal equations of the knowledge that the equations of motion have, about `values`.
    fn prior(&self, start: &[f64], variance: f64, values: &[f64]) -> Block {
        let away = DVector::from_fn(self.free.len(), |i, _| values[self.free[i]] - start[self.free[i]]);
        let gram = &self.known * variance;
        let gradient = &gram * &away;
        Block { cost: away.dot(&gradient), gram, gradient }
    }

    /// Residuals of the estimation data in units of persistence's errors.
    fn residuals(&self, values: &[f64]) -> Vec<Residuals> {
        let flights = &self.problem.estimation;
        flights.par_iter().flat_map_iter(|flight| self.residuals_of(flight, values)).collect()
    }

    /// Those of a flight, by horizon.
    fn residuals_of(&self, flight: &Prepared, values: &[f64]) -> Vec<Residuals> {
        let of_horizon = |ends: Vec<WindowEnd>| -> Residuals {
            let mut squares = [0.0; ERRORS];
            for end in &ends {
                let away = errors(flight, end, &end.persistent);
                squares.iter_mut().zip(away).for_each(|(sum, away)| *sum += away * away);
            }
            let scales = scales(&squares, ends.len());
            let one = |end: &WindowEnd| {
                let row = errors(flight, end, &end.simulated);
                (self.problem.block_of(end.from_s), std::array::from_fn(|at| row[at] / scales[at]))
            };
            ends.iter().map(one).collect()
        };
        ends(self.problem, flight, values, &self.models, &REFINED_S).into_iter().map(of_horizon).collect()
    }

    /// The residuals about `values` with their derivatives.
    fn linearised(&self, values: &[f64]) -> Linearised {
        let residuals = self.residuals(values);
        let slopes_of = |at: &usize| {
            let entry = &self.problem.model.parameters.all[*at];
            let step = if values[*at] + entry.step <= entry.max { entry.step } else { -entry.step };
            let mut changed = values.to_vec();
            changed[*at] += step;
            slopes(&residuals, &self.residuals(&changed), step)
        };
        let slopes = self.free.par_iter().map(slopes_of).collect();
        Linearised { values: values.to_vec(), variance: variance(&residuals), residuals, slopes }
    }

    /// The same about other `values`, with the derivatives as they were.
    fn moved(&self, about: &Linearised, values: Vec<f64>) -> Linearised {
        Linearised { residuals: self.residuals(&values), values, ..about.clone() }
    }

    /// The normal equations by block of time, each with the place of its flight; rows that err much count less (soft L1).
    fn blocks(&self, about: &Linearised) -> Vec<(usize, Block)> {
        let mut blocks: BTreeMap<(usize, i64), Block> = BTreeMap::new();
        for (job, rows) in about.residuals.iter().enumerate() {
            for (window, (block, row)) in rows.iter().enumerate() {
                let key = (job / REFINED_S.len(), *block);
                let sum = blocks.entry(key).or_insert_with(|| Block::zero(self.free.len()));
                for (axis, residual) in row.iter().enumerate() {
                    let slopes: Vec<f64> = about
                        .slopes
                        .iter()
                        .map(|slopes| slopes[job].get(window).map_or(0.0, |row| row[axis]))
                        .collect();
                    sum.add(*residual, &slopes, 1.0 / (1.0 + residual * residual).sqrt());
                    sum.cost += loss(*residual) - residual * residual / (1.0 + residual * residual).sqrt();
                }
            }
        }
        let completed = |((flight, _), mut block): ((usize, i64), Block)| {
            block.complete();
            (flight, block)
        };
        blocks.into_iter().map(completed).collect()
    }

    /// The result at `values`; parameters that were not moved keep their variance.
    fn result(&self, fitted: &FitResult, values: Vec<f64>, about: &Linearised) -> FitResult {
        let blocks = plain(self.blocks(about));
        let prior = self.prior(&fitted.values, about.variance, &about.values);
        // What the equations know is not sure either.
        let share = normal::inverse(&(normal::sum(&blocks).gram + &prior.gram)) * &prior.gram;
        let of_known = &share * normal::inverse(&self.known) * share.transpose();
        let of_moved = normal::covariance_beside(&blocks, &prior) + of_known;
        let place = |at: &usize| self.free.iter().position(|free| free == at);
        let covariance = DMatrix::from_fn(fitted.free.len(), fitted.free.len(), |i, j| {
            match (place(&fitted.free[i]), place(&fitted.free[j])) {
                (Some(a), Some(b)) => of_moved[(a, b)],
                (None, None) => fitted.covariance[(i, j)],
                _ => 0.0,
            }
        });
        let mut total = normal::sum(&blocks);
        total.gram += &prior.gram;
        total.gradient += &prior.gradient;
        let of_free = unbounded(&total, &values, &self.free);
        let mut result = FitResult { values, covariance, ..fitted.clone() };
        for (at, asked) in self.free.iter().zip(of_free) {
            result
                .free
                .iter()
                .position(|free| free == at)
                .into_iter()
                .for_each(|place| result.unbounded[place] = asked);
        }
        result
    }
}

/// Root mean squares by component; an axis about which hardly anything moves counts as one with a part of the whole movement.
fn scales(squares: &WindowErrors, count: usize) -> WindowErrors {
    std::array::from_fn(|at| {
        let whole: f64 = squares[at / 3 * 3..at / 3 * 3 + 3].iter().sum();
        (squares[at].max(LEAST_PART * LEAST_PART * whole) / count.max(1) as f64).sqrt().max(1e-9)
    })
}

/// Derivatives by differences: where there is no other window, there is none.
fn slopes(residuals: &[Residuals], changed: &[Residuals], step: f64) -> Vec<Vec<WindowErrors>> {
    let of_window = |((_, row), (_, changed)): (&(i64, WindowErrors), &(i64, WindowErrors))| {
        std::array::from_fn(|at| (changed[at] - row[at]) / step)
    };
    let of_job =
        |(rows, changed): (&Residuals, &Residuals)| rows.iter().zip(changed).map(of_window).collect();
    residuals.iter().zip(changed).map(of_job).collect()
}

/// The blocks of all flights.
fn plain(blocks: Vec<(usize, Block)>) -> Vec<Block> {
    blocks.into_iter().map(|(_, block)| block).collect()
}

/// The loss of all residuals.
fn cost(residuals: &[Residuals]) -> f64 {
    residuals.iter().flatten().flat_map(|(_, row)| row).map(|residual| loss(*residual)).sum()
}

/// The mean loss of a residual; those of quantities that are not judged are 0, and no residuals.
fn variance(residuals: &[Residuals]) -> f64 {
    let judged = residuals.iter().flatten().flat_map(|(_, row)| row).filter(|residual| **residual != 0.0);
    cost(residuals) / judged.count().max(1) as f64
}

/// Twice the soft L1 loss of a residual.
fn loss(residual: f64) -> f64 {
    2.0 * ((1.0 + residual * residual).sqrt() - 1.0)
}
