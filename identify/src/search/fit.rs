//! Fitting some of the parameters to flights, with the others held.
#![allow(
    clippy::disallowed_types,
    reason = "not in a component: reports of flights, whose products are summed by hand"
)]

use crate::data::prepared::Prepared;
use crate::data::rows::keep_means;
use crate::model::problem::Problem;
use crate::model::whitening::{Whitening, components};
use crate::numbers::normal::{self, Block};
use crate::search::fit_result::FitResult;
use nalgebra::{DMatrix, DVector};
use plant::effects::{EffectKind, Requirement};
use rayon::prelude::*;

/// Steps of a fit at most.
const STEPS_MAX: usize = 12;
/// Halvings in the search for the longest step that meets what an effect requires.
const HALVINGS: usize = 12;
/// Margin of that check: factor on the deviation from the baseline. A file has fewer digits than a fit.
const SPARE: f64 = 1.002;
/// Chord steps after each of them at most.
const CHORD_STEPS_MAX: usize = 5;
/// Parts that the estimation data are cut into for cross-validation.
const FOLDS: usize = 10;
/// A fit is done when a step changes every parameter by less than this part of its standard deviation.
const SMALL_STEP: f64 = 0.02;

/// Equations of the estimation data.
#[derive(Debug, Clone)]
pub struct Equations {
    /// The parameters of the derivatives.
    pub free: Vec<usize>,
    /// The normal equations, by flight and block of time.
    blocks: Vec<Vec<Block>>,
    /// Whitened derivatives, by flight.
    columns: Vec<Vec<Vec<f64>>>,
}

impl Equations {
    /// The normal equations of all flights, by block of time.
    pub fn all(&self) -> Vec<Block> {
        self.blocks.concat()
    }

    /// The part of them for other parameters.
    pub fn without(&self, dropped: &[usize]) -> Self {
        let kept: Vec<usize> = self.free.iter().copied().filter(|at| !dropped.contains(at)).collect();
        self.of(&kept)
    }

    /// The part of them for the parameters `free`, in their order.
    pub fn of(&self, free: &[usize]) -> Self {
        let kept: Vec<usize> =
            free.iter().filter_map(|at| self.free.iter().position(|known| known == at)).collect();
        let of = |blocks: &Vec<Block>| blocks.iter().map(|block| block.of(&kept)).collect();
        let columns_of = |columns: &Vec<Vec<f64>>| kept.iter().map(|at| columns[*at].clone()).collect();
        Self {
            free: kept.iter().map(|at| self.free[*at]).collect(),
            blocks: self.blocks.iter().map(of).collect(),
            columns: self.columns.iter().map(columns_of).collect(),
        }
    }
}

impl Problem<'_> {
    /// Fits the parameters `free`, starting from `start`: Gauss-Newton steps, each followed by chord steps, which keep the
    /// derivatives.
    pub fn fitted(&self, start: &[f64], free: &[usize]) -> FitResult {
        let mut values = start.to_vec();
        let mut equations = self.equations(&values, free);
        let mut blocks = equations.all();
        for _ in 0..STEPS_MAX {
            let cost = normal::sum(&blocks).cost;
            let step = self.step(&blocks, &values, free);
            if free.is_empty() || self.is_small(&step, &blocks) {
                break;
            }
            let Some((next, next_cost)) = self.descended(&values, free, &step, cost) else {
                break;
            };
            values = self.chord_steps(&equations, next, next_cost);
            equations = self.equations(&values, free);
            blocks = equations.all();
            if cost - normal::sum(&blocks).cost < 1e-9 * cost {
                break;
            }
        }
        let covariance = self.covariance(&blocks, &equations);
        let validation_costs = if self.validation.is_empty() {
            self.cross_validated(&blocks, &values, free)
        } else {
            self.costs(&self.validation, &values)
        };
        let estimation_costs = blocks.iter().map(|block| block.cost).collect();
        let unbounded = unbounded(&normal::sum(&blocks), &values, free);
        FitResult { values, free: free.to_vec(), unbounded, covariance, validation_costs, estimation_costs }
    }

    /// The equations of the estimation data about `values`.
    pub fn equations(&self, values: &[f64], free: &[usize]) -> Equations {
        let of_flight = |flight| {
            let (residual, columns) = self.whitened(flight, values, free);
            (self.summed(flight, &residual, &columns), columns)
        };
        let (blocks, columns) = self.estimation.par_iter().map(of_flight).unzip();
        Equations { free: free.to_vec(), blocks, columns }
    }

    /// The equations of the estimation data about `values`, with the derivatives by `accepted` as they are at `base`.
    pub fn equations_near(
        &self,
        (base, accepted): (&[f64], &[usize]),
        values: &[f64],
        free: &[usize],
    ) -> Equations {
        let of_flight = |flight| {
            let (residual, of_free) = self.whitened(flight, values, free);
            let columns = [self.whitened(flight, base, accepted).1, of_free].concat();
            (self.summed(flight, &residual, &columns), columns)
        };
        let (blocks, columns) = self.estimation.par_iter().map(of_flight).unzip();
        Equations { free: [accepted, free].concat(), blocks, columns }
    }

    /// The normal equations about `values`, by flight and block of time, with the derivatives that are known.
    pub fn blocks_with(&self, equations: &Equations, values: &[f64]) -> Vec<Vec<Block>> {
        let of_flight = |(flight, columns): (&Prepared<'_>, &Vec<Vec<f64>>)| {
            self.summed(flight, &self.whitened(flight, values, &[]).0, columns)
        };
        self.estimation.par_iter().zip(&equations.columns).map(of_flight).collect()
    }

    /// Values after steps from `values` with the derivatives that are known, while the steps gain. Near a solution the residual is what
    /// changes, and it takes a small part of the time of the derivatives.
    pub fn chord_steps(&self, equations: &Equations, mut values: Vec<f64>, mut cost: f64) -> Vec<f64> {
        let free = &equations.free;
        for _ in 0..CHORD_STEPS_MAX {
            let about = self.blocks_with(equations, &values).concat();
            let step = self.step(&about, &values, free);
            if self.is_small(&step, &about) {
                break;
            }
            let next = self.moved(&values, free, &step);
            let next_cost: f64 = self.costs(&self.estimation, &next).iter().sum();
            let gain = cost - next_cost;
            if gain <= 0.0 {
                break;
            }
            (values, cost) = (next, next_cost);
            if gain < 1e-9 * cost {
                break;
            }
        }
        values
    }

    /// The cost of each block of the estimation data under parameters that were fitted without its fold: the folds are
    /// stretches of time, and the fit without one is a step from the equations about `values`.
    pub fn cross_validated(&self, blocks: &[Block], values: &[f64], free: &[usize]) -> Vec<f64> {
        if free.is_empty() {
            return blocks.iter().map(|block| block.cost).collect();
        }
        self.costs_by_folds(blocks, free, |others| self.step_of(others, values, free))
    }

    /// The cost of each block of the estimation data after the step that the equations without its fold ask for.
    fn costs_by_folds(
        &self,
        blocks: &[Block],
        free: &[usize],
        step: impl Fn(&Block) -> DVector<f64>,
    ) -> Vec<f64> {
        let total = normal::sum(blocks);
        let mut costs = vec![0.0; blocks.len()];
        for fold in self.folds(blocks.len(), free) {
            let left_out: Vec<Block> = fold.iter().map(|at| blocks[*at].clone()).collect();
            let step = step(&total.without(&normal::sum(&left_out)));
            fold.iter().for_each(|at| costs[*at] = blocks[*at].cost_after(&step));
        }
        costs
    }

    /// The folds of a cross-validation of so many blocks, by their places: stretches of time. If winds of
    /// single flights are among the `free` parameters, each fold is a stretch of every flight. No other
    /// flight shows the wind of one.
    pub fn folds(&self, blocks: usize, free: &[usize]) -> Vec<Vec<usize>> {
        if free.iter().all(|at| self.model.parameters.all[*at].flight.is_none()) {
            let places: Vec<usize> = (0..blocks).collect();
            return places.chunks(blocks.div_ceil(FOLDS).max(1)).map(<[usize]>::to_vec).collect();
        }
        let mut folds = vec![Vec::new(); FOLDS];
        let mut first = 0;
        for flight in &self.estimation {
            let count = self.block_knots(flight).len();
            (0..count).for_each(|at| folds[at * FOLDS / count].push(first + at));
            first += count;
        }
        folds.retain(|fold| !fold.is_empty());
        folds
    }

    /// The costs of the data that effects are chosen on, as the equations about a fit promise them. The
    /// parameters `dropped` are at their baselines, and the others are fitted to that.
    pub fn promised_without(&self, fitted: &FitResult, dropped: &[usize]) -> Vec<f64> {
        let baseline = |at: &usize| self.model.parameters.all[*at].baseline - fitted.values[*at];
        let held: Vec<Option<f64>> =
            fitted.free.iter().map(|at| dropped.contains(at).then(|| baseline(at))).collect();
        let blocks = |flights| self.blocks(flights, &fitted.values, &fitted.free);
        let estimation = blocks(&self.estimation);
        if !self.validation.is_empty() {
            let step = held_step(&normal::sum(&estimation), &held);
            return blocks(&self.validation).iter().map(|block| block.cost_after(&step)).collect();
        }
        self.costs_by_folds(&estimation, &fitted.free, |others| held_step(others, &held))
    }

    /// The values that were `fitted`, without the estimation flight at `flight`, by a step from the equations about them. With
    /// one flight all there is stays.
    pub fn values_without(&self, fitted: &FitResult, flight: usize) -> Vec<f64> {
        if self.estimation.len() < 2 || fitted.free.is_empty() {
            return fitted.values.clone();
        }
        let of = |flights: &[Prepared]| self.blocks(flights, &fitted.values, &fitted.free);
        let others = [of(&self.estimation[..flight]), of(&self.estimation[flight + 1..])].concat();
        let step = self.step(&others, &fitted.values, &fitted.free);
        self.moved(&fitted.values, &fitted.free, &step)
    }

    /// True if a step is a small part of every parameter's standard deviation, assuming that all rows are
    /// independent.
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
    ) -> Option<(Vec<f64>, f64)> {
        let mut share = 1.0;
        for _ in 0..5 {
            let next = self.moved(values, free, &(step * share));
            let sum = self.costs(&self.estimation, &next).iter().sum();
            if sum < cost {
                return Some((next, sum));
            }
            share /= 4.0;
        }
        None
    }

    /// The Gauss-Newton step within the bounds: a parameter that would leave them stops there, and the others are
    /// fitted to that.
    pub fn step(&self, blocks: &[Block], values: &[f64], free: &[usize]) -> DVector<f64> {
        self.step_of(&normal::sum(blocks), values, free)
    }

    /// The same for the sum of the blocks.
    pub fn step_of(&self, total: &Block, values: &[f64], free: &[usize]) -> DVector<f64> {
        self.step_beside(total, values, free, vec![None; free.len()])
    }

    /// The same with some parameters held: these go by so much.
    pub fn step_beside(
        &self,
        total: &Block,
        values: &[f64],
        free: &[usize],
        mut held: Vec<Option<f64>>,
    ) -> DVector<f64> {
        let mut step = DVector::zeros(free.len());
        for _ in 0..=free.len() {
            step = held_step(total, &held);
            let mut is_within = true;
            for (at, parameter) in free.iter().enumerate() {
                let entry = &self.model.parameters.all[*parameter];
                let wanted = values[*parameter] + step[at];
                let (bound, range) = (entry.bounded(wanted), entry.max - entry.spec().min);
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

    /// The values after a step, within their bounds, and such that they meet what effects require of a vehicle.
    pub fn moved(&self, values: &[f64], free: &[usize], step: &DVector<f64>) -> Vec<f64> {
        let all = &self.model.parameters.all;
        let mut next = values.to_vec();
        for (parameter, step) in free.iter().zip(step.iter()) {
            next[*parameter] = all[*parameter].bounded(next[*parameter] + step);
        }
        let mut kinds: Vec<&EffectKind> = free.iter().map(|at| all[*at].kind).collect();
        kinds.dedup();
        for (kind, requirement) in kinds.iter().filter_map(|kind| Some((kind, kind.require?))) {
            let of_kind: Vec<usize> = free.iter().copied().filter(|at| all[*at].kind == *kind).collect();
            if !self.meets(requirement, &next, &of_kind) {
                self.hold_back(requirement, values, &mut next, &of_kind);
            }
        }
        next
    }

    /// True if the vehicle meets what an effect requires, also with the effect's `parameters` [`SPARE`] times as far from their baselines.
    fn meets(&self, requirement: Requirement, values: &[f64], parameters: &[usize]) -> bool {
        let mut beyond = values.to_vec();
        for at in parameters {
            let baseline = self.model.parameters.all[*at].baseline;
            beyond[*at] = baseline + SPARE * (values[*at] - baseline);
        }
        requirement(self.model.airframe(&beyond).vehicle()).is_ok()
    }

    /// Takes back as much of the way from `values` to `next` as the requirement asks for. Of one parameter where that is enough, as of a
    /// moment of inertia that is larger than the sum of the others; else of all.
    fn hold_back(&self, requirement: Requirement, values: &[f64], next: &mut [f64], parameters: &[usize]) {
        let taken_back = |next: &[f64], taken: &[usize], part: f64| {
            let mut tried = next.to_vec();
            taken.iter().for_each(|at| tried[*at] += part * (values[*at] - next[*at]));
            tried
        };
        let is_enough = |at: &&usize| self.meets(requirement, &taken_back(next, &[**at], 1.0), parameters);
        let moved = parameters.iter().find(is_enough).map_or(parameters.to_vec(), |at| vec![*at]);
        let (mut enough, mut too_little) = (1.0, 0.0);
        for _ in 0..HALVINGS {
            let part = f64::midpoint(enough, too_little);
            let is_met = self.meets(requirement, &taken_back(next, &moved, part), parameters);
            *(if is_met { &mut enough } else { &mut too_little }) = part;
        }
        next.copy_from_slice(&taken_back(next, &moved, enough));
    }

    /// The normal equations of all blocks of `flights`.
    pub fn blocks(&self, flights: &[Prepared], values: &[f64], free: &[usize]) -> Vec<Block> {
        flights.par_iter().flat_map_iter(|flight| self.blocks_of(flight, values, free)).collect()
    }

    /// The model's residual and its derivatives; where the attitude was assumed, the means of blocks alone.
    pub fn linearised(&self, flight: &Prepared, values: &[f64], free: &[usize]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let (mut residual, mut columns) = self.model.linearised(flight, values, free);
        if flight.is_assumed() {
            let blocks = self.block_knots(flight);
            std::iter::once(&mut residual)
                .chain(&mut columns)
                .for_each(|rows| keep_means(flight, rows, &blocks));
        }
        (residual, columns)
    }

    /// Covariance of a fit at whose solution the normal equations are `blocks`, with the derivatives of `equations`: of the noise, and of the flights' trims.
    pub fn covariance(&self, blocks: &[Block], equations: &Equations) -> DMatrix<f64> {
        let mut covariance = normal::covariance(blocks);
        if equations.free.is_empty() || self.noises.values().all(|noise| noise.trim_variance == 0.0) {
            return covariance;
        }
        let inverse = normal::inverse(&normal::sum(blocks).gram);
        for (flight, columns) in self.estimation.iter().zip(&equations.columns) {
            for gradient in Whitening::of(flight, &self.noises).trim_gradients(columns) {
                let away = &inverse * DVector::from_vec(gradient);
                covariance += &away * away.transpose();
            }
        }
        covariance
    }

    /// The weighted sums of squares of all blocks of `flights`.
    pub fn costs(&self, flights: &[Prepared], values: &[f64]) -> Vec<f64> {
        self.blocks(flights, values, &[]).iter().map(|block| block.cost).collect()
    }

    /// The normal equations of the blocks of one flight.
    pub fn blocks_of(&self, flight: &Prepared, values: &[f64], free: &[usize]) -> Vec<Block> {
        self.blocks_beyond(flight, values, free, &[])
    }

    /// The same for the residual less that of another model, whose rows are `other`; nothing is taken off by no rows.
    pub fn blocks_beyond(
        &self,
        flight: &Prepared,
        values: &[f64],
        free: &[usize],
        other: &[f64],
    ) -> Vec<Block> {
        let (mut residual, columns) = self.linearised(flight, values, free);
        residual.iter_mut().zip(other).for_each(|(residual, other)| *residual -= other);
        self.blocks_from(flight, residual, columns)
    }

    /// The whitened residual and its derivatives.
    fn whitened(&self, flight: &Prepared, values: &[f64], free: &[usize]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let (mut residual, mut columns) = self.linearised(flight, values, free);
        let whitening = Whitening::of(flight, &self.noises);
        std::iter::once(&mut residual).chain(&mut columns).for_each(|rows| whitening.apply(rows));
        (residual, columns)
    }

    /// The normal equations of all blocks of `flights` about `values`, with the derivatives by `accepted` as they are at `base`: near it
    /// they hardly differ, and are known.
    pub fn blocks_near(
        &self,
        flights: &[Prepared],
        base: (&[f64], &[usize]),
        values: &[f64],
        free: &[usize],
    ) -> Vec<Block> {
        let of_flight = |flight: &Prepared| {
            let (residual, columns) = self.linearised(flight, values, free);
            let (_, accepted) = self.linearised(flight, base.0, base.1);
            self.blocks_from(flight, residual, [accepted, columns].concat())
        };
        flights.par_iter().flat_map_iter(of_flight).collect()
    }

    /// The normal equations of the blocks of one flight, from a residual and its derivatives.
    fn blocks_from(
        &self,
        flight: &Prepared,
        mut residual: Vec<f64>,
        mut columns: Vec<Vec<f64>>,
    ) -> Vec<Block> {
        let whitening = Whitening::of(flight, &self.noises);
        std::iter::once(&mut residual).chain(&mut columns).for_each(|rows| whitening.apply(rows));
        self.summed(flight, &residual, &columns)
    }

    /// The normal equations of the blocks of one flight, from a whitened residual and its derivatives.
    fn summed(&self, flight: &Prepared, residual: &[f64], columns: &[Vec<f64>]) -> Vec<Block> {
        let (width, weights) = (flight.width(), self.row_weights(flight));
        let of_knots = |knots: &(usize, usize)| {
            let mut block = Block::zero(columns.len());
            let mut row = vec![0.0; columns.len()];
            for at in knots.0 * width..knots.1 * width {
                let weight = weights[at % width];
                if weight > 0.0 {
                    row.iter_mut().zip(columns).for_each(|(row, column)| *row = column[at]);
                    block.add(residual[at], &row, weight);
                }
            }
            block.complete();
            block
        };
        self.block_knots(flight).par_iter().map(of_knots).collect()
    }

    /// The weights of the rows of one knot.
    pub fn row_weights(&self, flight: &Prepared) -> Vec<f64> {
        let weight = |component| self.noises.get(&component).map_or(0.0, |noise| noise.model.weight());
        components(flight).map(weight).collect()
    }

    /// The block of time that an instant lies in.
    pub fn block_of(&self, at_s: f64) -> i64 {
        (at_s / self.block_s).floor() as i64
    }

    /// First knot of each block, and the one behind its last.
    pub fn block_knots(&self, flight: &Prepared) -> Vec<(usize, usize)> {
        let knots = &flight.layout.knots;
        let block_of = |knot: usize| self.block_of(flight.layout.clock.at(knot));
        let mut blocks = Vec::new();
        let mut first = 0;
        for at in 1..=knots.len() {
            if at == knots.len() || block_of(knots[at]) != block_of(knots[first]) {
                blocks.push((first, at));
                first = at;
            }
        }
        blocks
    }
}

/// The values after the step that the equations `total` about `values` ask for, bounds or not.
pub fn unbounded(total: &Block, values: &[f64], free: &[usize]) -> Vec<f64> {
    let step = held_step(total, &vec![None; free.len()]);
    free.iter().zip(step.iter()).map(|(at, step)| values[*at] + step).collect()
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

impl Problem<'_> {
    /// The cost that `fitted` leaves on the estimation data, in units of what all candidates together would leave by the
    /// linearised equations: those by which the weights were set. Delays, lags and the battery are far from linear and do
    /// not count.
    pub fn left(&self, fitted: &FitResult) -> f64 {
        fitted.estimation_cost() / self.rows(&self.estimation) as f64
    }

    /// Number of rows that count in the data that effects are chosen on, at least one.
    pub fn validation_rows(&self) -> usize {
        self.rows(if self.validation.is_empty() { &self.estimation } else { &self.validation })
    }

    /// Returns the number of rows of `flights` that have a weight, at least one.
    pub fn rows(&self, flights: &[Prepared]) -> usize {
        let of = |flight: &Prepared| {
            flight.layout.knots.len()
                * self.row_weights(flight).iter().filter(|weight| **weight > 0.0).count()
        };
        flights.iter().map(of).sum::<usize>().max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::parameter::Parameters;
    use crate::model::physics::Model;
    use crate::model::whitening::Noises;
    use vehicles::Vehicle;

    /// No moment of inertia of a rigid body is larger than the sum of the other two.
    #[test]
    fn a_step_ends_where_no_rigid_body_has_the_inertia() {
        let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let model = Model { parameters: Parameters::of(&vehicle, &[]), vehicle };
        let problem = Problem {
            model,
            estimation: Vec::new(),
            validation: Vec::new(),
            test: Vec::new(),
            noises: Noises::new(),
            block_s: 1.0,
            shared_late_s: 0.0,
        };
        let is_inertia = |at: &usize| problem.model.parameters.all[*at].kind.name == "inertia-error";
        let free: Vec<usize> = (0..problem.model.parameters.all.len()).filter(is_inertia).collect();
        let start = problem.model.parameters.baseline();
        let inertia = |values: &[f64]| {
            let airframe = problem.model.airframe(values);
            let tensor = &airframe.vehicle().inertia_kg_m2;
            [tensor[(0, 0)], tensor[(1, 1)], tensor[(2, 2)]]
        };
        // To three times as much about z alone, of which some is possible, and about all three, of which all is.
        let about_z = problem.moved(&start, &free, &DVector::from_row_slice(&[0.0, 0.0, 2.0]));
        let [xx, yy, zz] = inertia(&about_z);
        let [.., declared] = inertia(&start);
        assert!(zz <= xx + yy && zz > 0.99 * (xx + yy), "{xx} {yy} {zz}");
        assert!(zz > declared && (about_z[free[0]], about_z[free[1]]) == (0.0, 0.0));
        let about_all = problem.moved(&start, &free, &DVector::from_row_slice(&[2.0, 2.0, 2.0]));
        assert_eq!(free.iter().map(|at| about_all[*at]).collect::<Vec<_>>(), [2.0; 3]);
    }
}
