//! Fit of the motor whose response is nearest to all steps.
//!
//! A step is modelled as w(t) = w0 + dw s(t - d), with s the motor's unit step. The levels w0 and dw and the onset d
//! belong to the step: a log tells when a command took effect only to one row. So they are fitted to every step, for
//! every motor alike, and projected out of the motor's own equations (variable projection: Golub and Pereyra, SIAM
//! J. Numer. Anal. 10, 1973). Residuals are relative to the step's height, so that every step counts the
//! same. The few motor parameters are found by Levenberg-Marquardt. Their intervals come from leaving out one
//! step after the other. The normal equations of a step are taken out of the sum (one Gauss-Newton step, no
//! fit anew).

use nalgebra::{Matrix2, Vector2};

use super::response::Lag;
use super::stand::Clock;
use super::step::Step;
use crate::numbers::statistics::mean;

/// Iterations at most; a dozen are usual.
const ITERATIONS_MAX: usize = 60;
/// A fit has ended when the cost falls by less than this share.
const ENOUGH: f64 = 1e-8;
/// Time constants that a fit is started from: this and its multiples by 1.6.
const SHORTEST_S: f64 = 3e-3;
const STARTS: i32 = 14;
/// Onsets lie at most this many rows from the row in which the command is first seen.
pub const ONSET_ROWS_MAX: f64 = 1.0;

/// Order of a motor's model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// A time constant.
    First,
    /// Natural frequency and damping.
    Second,
}

/// A motor that was fitted.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The motor.
    pub lag: Lag,
    /// Motors fitted without each of the steps in turn.
    pub without_one: Vec<Lag>,
}

/// A step held against a motor.
#[derive(Debug, Clone)]
pub struct Match {
    /// When the command took effect, from the row in which it is first seen, in s.
    pub onset_s: f64,
    /// True if the onset is at the end of the range that is allowed.
    pub is_clamped: bool,
    /// Predicted minus measured, in rad/s.
    pub errors: Vec<f64>,
}

/// The normal equations of one step.
#[derive(Debug, Clone, Copy)]
struct Normal {
    hessian: Matrix2<f64>,
    gradient: Vector2<f64>,
    cost: f64,
}

/// The times of a step's rows by a clock.
pub fn times(step: &Step, clock: Clock) -> &[f64] {
    match clock {
        Clock::Rows => &step.rows_s,
        Clock::Stamps => &step.stamps_s,
    }
}

/// Fits a motor of an order; `None` without steps.
pub fn fit(steps: &[&Step], order: Order, clock_of: impl Fn(&Step) -> Clock) -> Option<Fit> {
    if steps.is_empty() {
        return None;
    }
    let equations = |lag: Lag| -> Vec<Normal> {
        steps.iter().map(|step| normal(step, times(step, clock_of(step)), lag, order)).collect()
    };
    let rough = |lag: Lag| -> f64 {
        steps
            .iter()
            .map(|step| relative_square(step, &Line::of(step, times(step, clock_of(step)), lag, 0.0).errors))
            .sum()
    };
    let first = starts(order).map(|lag| (lag, rough(lag))).min_by(|a, b| a.1.total_cmp(&b.1));
    let mut lag = first?.0;
    let mut blocks = equations(lag);
    let mut damping = 1e-3;
    for _ in 0..ITERATIONS_MAX {
        let sum = total(&blocks);
        let Some(next) = moved(lag, &sum, damping, order) else { break };
        let next_blocks = equations(next);
        let gain = sum.cost - total(&next_blocks).cost;
        if gain > 0.0 {
            (lag, blocks, damping) = (next, next_blocks, damping * 0.2);
        } else {
            damping *= 8.0;
        }
        if (gain.abs() < ENOUGH * sum.cost && gain >= 0.0) || damping > 1e9 {
            break;
        }
    }
    let sum = total(&blocks);
    let without_one = blocks.iter().filter_map(|block| without(lag, &sum, block, order)).collect();
    Some(Fit { lag, without_one })
}

/// Holds a step against a motor, with the onset and the levels that suit it best.
pub fn matched(step: &Step, time_s: &[f64], lag: Lag) -> Match {
    let bound = ONSET_ROWS_MAX * step.period_s;
    let onset_s = best_onset(step, time_s, lag);
    let is_clamped = bound - onset_s.abs() < 1e-3 * bound;
    Match { onset_s, is_clamped, errors: Line::of(step, time_s, lag, onset_s).errors }
}

/// The motors that a fit may start from.
fn starts(order: Order) -> impl Iterator<Item = Lag> {
    let shares: &[f64] = match order {
        Order::First => &[0.0],
        Order::Second => &[0.02, 0.1, 0.25, 0.6, 1.5],
    };
    (0..STARTS).flat_map(move |index| {
        let a1_s = SHORTEST_S * 1.6_f64.powi(index);
        shares.iter().map(move |share| Lag { a1_s, a2_s2: share * a1_s * a1_s })
    })
}

/// Levels of a step under a motor with a given onset: the linear part.
struct Line {
    height: f64,
    unit: Vec<f64>,
    errors: Vec<f64>,
}

impl Line {
    fn of(step: &Step, time_s: &[f64], lag: Lag, onset_s: f64) -> Self {
        let unit: Vec<f64> = time_s.iter().map(|time| lag.step(time - onset_s)).collect();
        let (mean_unit, mean_speed) = (mean(&unit), mean(&step.speed));
        let pairs =
            || unit.iter().zip(&step.speed).map(|(unit, speed)| (unit - mean_unit, speed - mean_speed));
        let height = pairs().map(|(unit, speed)| unit * speed).sum::<f64>()
            / pairs().map(|(unit, _)| unit * unit).sum::<f64>().max(f64::MIN_POSITIVE);
        let errors = pairs().map(|(unit, speed)| height * unit - speed).collect();
        Self { height, unit, errors }
    }
}

/// The mean square of a step's `errors`, relative to its height.
pub fn relative_square(step: &Step, errors: &[f64]) -> f64 {
    errors.iter().map(|error| (error / step.height).powi(2)).sum::<f64>() / errors.len() as f64
}

/// The onset with the smallest error: the best of a few, refined by the golden section.
fn best_onset(step: &Step, time_s: &[f64], lag: Lag) -> f64 {
    const COARSE: i32 = 4;
    const REFINEMENTS: usize = 12;
    let bound = ONSET_ROWS_MAX * step.period_s;
    let cost = |onset: f64| relative_square(step, &Line::of(step, time_s, lag, onset).errors);
    let grid = (-COARSE..=COARSE).map(|index| bound * f64::from(index) / f64::from(COARSE));
    let coarse = grid.map(|onset| (onset, cost(onset))).min_by(|a, b| a.1.total_cmp(&b.1));
    let best = coarse.map_or(0.0, |(onset, _)| onset);
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let width = bound / f64::from(COARSE);
    let (mut low, mut high) = ((best - width).max(-bound), (best + width).min(bound));
    let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_left, mut at_right) = (cost(left), cost(right));
    for _ in 0..REFINEMENTS {
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - golden * (high - low);
            at_left = cost(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + golden * (high - low);
            at_right = cost(right);
        }
    }
    0.5 * (low + high)
}

/// The equations of a step for the motor's parameters, with onset and levels projected out.
fn normal(step: &Step, time_s: &[f64], lag: Lag, order: Order) -> Normal {
    let found = matched(step, time_s, lag);
    let unit_at =
        |lag: Lag, onset: f64| -> Vec<f64> { time_s.iter().map(|time| lag.step(time - onset)).collect() };
    let Line { unit, errors, height } = Line::of(step, time_s, lag, found.onset_s);
    // From the motor and the onset of `down` to those of `up`, which are `width` apart.
    let slope = |up: (Lag, f64), down: (Lag, f64), width: f64| -> Vec<f64> {
        let (up, down) = (unit_at(up.0, up.1), unit_at(down.0, down.1));
        up.iter().zip(&down).map(|(up, down)| height * (up - down) / (width * step.height)).collect()
    };
    let at = found.onset_s;
    let aside_s = 1e-3 * step.period_s;
    let by_onset = slope((lag, at + aside_s), (lag, at - aside_s), 2.0 * aside_s);
    let mut basis: Vec<Vec<f64>> = Vec::new();
    push_orthogonal(&mut basis, vec![1.0; unit.len()]);
    push_orthogonal(&mut basis, unit);
    if !found.is_clamped {
        push_orthogonal(&mut basis, by_onset);
    }
    let widths = [1e-4 * lag.a1_s, 1e-4 * lag.a1_s * lag.a1_s];
    let with_a1 = |a1_s: f64| (Lag { a1_s, ..lag }, at);
    let by_a1 = slope(with_a1(lag.a1_s + widths[0]), with_a1(lag.a1_s - widths[0]), 2.0 * widths[0]);
    let by_a2 = match order {
        Order::First => vec![0.0; time_s.len()],
        Order::Second => slope((Lag { a2_s2: lag.a2_s2 + widths[1], ..lag }, at), (lag, at), widths[1]),
    };
    let residuals: Vec<f64> = errors.iter().map(|error| -error / step.height).collect();
    assembled([without_basis(by_a1, &basis), without_basis(by_a2, &basis)], &residuals)
}

/// Sums over the rows of a step, each divided by their number.
fn assembled(columns: [Vec<f64>; 2], residuals: &[f64]) -> Normal {
    let n = residuals.len() as f64;
    let entry = |row: usize, column: usize| dot(&columns[row], &columns[column]) / n;
    Normal {
        hessian: Matrix2::new(entry(0, 0), entry(0, 1), entry(1, 0), entry(1, 1)),
        gradient: Vector2::new(dot(&columns[0], residuals), dot(&columns[1], residuals)) / n,
        cost: dot(residuals, residuals) / n,
    }
}

fn total(blocks: &[Normal]) -> Normal {
    let zero = Normal { hessian: Matrix2::zeros(), gradient: Vector2::zeros(), cost: 0.0 };
    blocks.iter().fold(zero, |sum, block| Normal {
        hessian: sum.hessian + block.hessian,
        gradient: sum.gradient + block.gradient,
        cost: sum.cost + block.cost,
    })
}

/// The motor after a damped Gauss-Newton step, within physical values.
fn moved(lag: Lag, sum: &Normal, damping: f64, order: Order) -> Option<Lag> {
    let damped = sum.hessian + Matrix2::from_diagonal(&sum.hessian.diagonal()) * damping;
    let change = solved(damped, sum.gradient, order)?;
    Some(Lag {
        a1_s: (lag.a1_s + change[0]).clamp(0.2 * lag.a1_s, 5.0 * lag.a1_s),
        a2_s2: (lag.a2_s2 + change[1]).max(0.0),
    })
}

/// The motor that the steps without one of them give, by one Gauss-Newton step.
fn without(lag: Lag, sum: &Normal, block: &Normal, order: Order) -> Option<Lag> {
    let change = solved(sum.hessian - block.hessian, sum.gradient - block.gradient, order)?;
    Some(Lag { a1_s: lag.a1_s + change[0], a2_s2: lag.a2_s2 + change[1] })
}

/// Solves for the parameters that an order has.
fn solved(hessian: Matrix2<f64>, gradient: Vector2<f64>, order: Order) -> Option<Vector2<f64>> {
    if order == Order::First {
        return (hessian[(0, 0)] > 0.0).then(|| Vector2::new(gradient[0] / hessian[(0, 0)], 0.0));
    }
    // a2 is some thousand times smaller than a1: both are brought to one size first.
    let scale = Vector2::new(hessian[(0, 0)].sqrt(), hessian[(1, 1)].sqrt()).map(f64::recip);
    let scaled = Matrix2::from_diagonal(&scale) * hessian * Matrix2::from_diagonal(&scale);
    let change = scaled.cholesky()?.solve(&gradient.component_mul(&scale));
    Some(change.component_mul(&scale))
}

fn push_orthogonal(basis: &mut Vec<Vec<f64>>, column: Vec<f64>) {
    let size = dot(&column, &column).sqrt();
    let rest = without_basis(column, basis);
    let length = dot(&rest, &rest).sqrt();
    if length > 1e-9 * size {
        basis.push(rest.iter().map(|entry| entry / length).collect());
    }
}

fn without_basis(mut column: Vec<f64>, basis: &[Vec<f64>]) -> Vec<f64> {
    for axis in basis {
        let part = dot(&column, axis);
        column.iter_mut().zip(axis).for_each(|(entry, axis)| *entry -= part * axis);
    }
    column
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
