//! Predictions as a judge: no effect is kept with which the vehicle predicts worse than without it.
//!
//! An effect can make the residual of the equations smaller and yet predictions worse: it then absorbs the
//! influence of another cause. The judged flights are those with role `select`, or else those that parameters
//! are fitted on, each with parameters that were fitted on the others.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::fit::{Equations, FitResult, Problem};
use crate::noise;
use crate::predict::{Measured, WindowEnd};
use crate::prepared::Prepared;
use crate::sensing::SensorErrors;
use crate::statistics::chance_of_no_gain;
use crate::trim::OwnTrim;
use flights::state::StateQuantity;
use plant::RigidBody;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Horizons at which effects are judged.
pub const HORIZONS_S: [f64; 2] = [0.1, 0.5];
/// Components of attitude and velocity.
const COMPONENTS: [&str; 6] =
    ["attitude x", "attitude y", "attitude z", "velocity x", "velocity y", "velocity z"];
/// Chance of a false finding that one component grows.
const LEVEL: f64 = 0.01;
/// A smaller growth of an error does not matter.
const LEAST_GROWTH: f64 = 1.02;
/// Nor does one by less than this part of the error that the noise of the sensors makes.
const OF_NOISE: f64 = 0.5;

/// A prediction error that an effect makes greater.
#[derive(Debug, Clone, PartialEq)]
pub struct Growth {
    /// Component: attitude about an axis of the body in deg, or velocity along an axis of the world in m/s.
    pub component: &'static str,
    /// Horizon in s.
    pub horizon_s: f64,
    /// Root mean square without the effect.
    pub without: f64,
    /// Root mean square with it.
    pub with: f64,
    /// Unit of both.
    pub unit: &'static str,
}

impl Growth {
    /// Error with the effect in units of that without.
    pub fn ratio(&self) -> f64 {
        self.with / self.without
    }
}

/// Prediction errors of the judged flights.
#[derive(Debug)]
pub struct Foresight {
    /// Squares by flight, horizon and block of time: sums by component, and the number of windows.
    squares: BTreeMap<(usize, usize, i64), ([f64; 6], f64)>,
    /// Errors of attitude and velocity about one axis that the noise of the sensors makes, by horizon.
    noise: [[f64; 2]; 2],
}

impl Foresight {
    /// Prediction errors of the judged flights under the fit with the parameters `dropped` at their baselines, where `equations` are
    /// those about it; empty where no attitude was measured.
    pub fn of(problem: &Problem, equations: &Equations, fitted: &FitResult, dropped: &[usize]) -> Self {
        let near = problem.near(equations, &fitted.values, dropped);
        let flights: Vec<(&Prepared, Vec<f64>)> = if problem.validation.is_empty() {
            problem.estimation.iter().zip(problem.each_without(&near)).collect()
        } else {
            problem.validation.iter().map(|flight| (flight, near.values.clone())).collect()
        };
        Self::by(problem, &flights, |flight, values, horizon_s| {
            trimmed_ends(problem, flight, values, horizon_s)
        })
    }

    /// Prediction errors of flights, each under its values, without trims of their own.
    pub fn under(problem: &Problem, flights: &[(&Prepared, Vec<f64>)]) -> Self {
        Self::by(problem, flights, |flight, values, horizon_s| ends(problem, flight, values, horizon_s, None))
    }

    fn by(
        problem: &Problem,
        flights: &[(&Prepared, Vec<f64>)],
        ends: impl Fn(&Prepared, &[f64], f64) -> Vec<WindowEnd> + Sync,
    ) -> Self {
        let jobs: Vec<(usize, usize)> = (0..flights.len())
            .flat_map(|at| (0..HORIZONS_S.len()).map(move |horizon| (at, horizon)))
            .collect();
        let of_job = |(at, horizon): &(usize, usize)| -> Vec<_> {
            let (flight, values) = &flights[*at];
            let ends = ends(flight, values, HORIZONS_S[*horizon]);
            ends.iter()
                .map(|end| {
                    (
                        (*at, *horizon, problem.block_of(end.from_s)),
                        errors(flight, end, &end.simulated).map(|error| error * error),
                    )
                })
                .collect()
        };
        let mut sums = BTreeMap::new();
        for (key, squares) in jobs.par_iter().map(of_job).collect::<Vec<_>>().into_iter().flatten() {
            let sum: &mut ([f64; 6], f64) = sums.entry(key).or_default();
            sum.0.iter_mut().zip(squares).for_each(|(sum, square)| *sum += square);
            sum.1 += 1.0;
        }
        Self { squares: sums, noise: noise(problem) }
    }

    /// The component whose error grows most from `without` the effect to `self`, of those that grow beyond their noise.
    pub fn growth(&self, without: &Self) -> Option<Growth> {
        let places =
            (0..HORIZONS_S.len()).flat_map(|horizon| (0..COMPONENTS.len()).map(move |at| (horizon, at)));
        let of_place = |(horizon, at): (usize, usize)| {
            let pairs: Vec<(f64, f64)> = self.blocks(without, horizon, at);
            let mean = |of: &dyn Fn(&(f64, f64)) -> f64| {
                (pairs.iter().map(of).sum::<f64>() / pairs.len().max(1) as f64).sqrt()
            };
            let (with, without) = (mean(&|pair| pair.0), mean(&|pair| pair.1));
            let growths: Vec<f64> = pairs.iter().map(|(with, without)| with - without).collect();
            let by = (with * with - without * without).max(0.0).sqrt();
            let matters = with > LEAST_GROWTH * without && by > OF_NOISE * self.noise[horizon][at / 3];
            let is_beyond = matters && chance_of_no_gain(&growths) < LEVEL;
            let (component, horizon_s) = (COMPONENTS[at], HORIZONS_S[horizon]);
            let unit = if at < 3 { "deg" } else { "m/s" };
            is_beyond.then_some(Growth { component, horizon_s, without, with, unit })
        };
        places.filter_map(of_place).max_by(|a, b| a.ratio().total_cmp(&b.ratio()))
    }

    /// True if all errors together, each in units of `other`'s, are smaller than `other`'s beyond chance, and by more than
    /// [`LEAST_GROWTH`].
    pub fn is_better_than(&self, other: &Self) -> bool {
        let mut gains: Vec<f64> = Vec::new();
        let mut total = (0.0, 0.0);
        for horizon in 0..HORIZONS_S.len() {
            let of = |at: usize| self.blocks(other, horizon, at);
            for (at, pairs) in (0..COMPONENTS.len()).map(of).enumerate() {
                let scale = pairs.iter().map(|pair| pair.1).sum::<f64>() / pairs.len().max(1) as f64;
                if at == 0 && gains.len() < pairs.len() {
                    gains.resize(pairs.len(), 0.0);
                }
                for (gain, (new, old)) in gains.iter_mut().zip(&pairs) {
                    let (new, old) = (new / scale.max(1e-18), old / scale.max(1e-18));
                    *gain += old - new;
                    total = (total.0 + new, total.1 + old);
                }
            }
        }
        total.1 > LEAST_GROWTH * LEAST_GROWTH * total.0 && chance_of_no_gain(&gains) < LEVEL
    }

    /// Mean squares of one component by block, with and without, where both have some.
    fn blocks(&self, without: &Self, horizon: usize, at: usize) -> Vec<(f64, f64)> {
        let of_horizon = self.squares.iter().filter(|(key, _)| key.1 == horizon);
        let pair = |(key, (with, count)): (&(usize, usize, i64), &([f64; 6], f64))| {
            let (other, other_count) = without.squares.get(key)?;
            Some((with[at] / count, other[at] / other_count))
        };
        of_horizon.filter_map(pair).collect()
    }
}

/// Errors of attitude in deg and velocity in m/s about one axis that the sensors' noise makes in the judged flights.
fn noise(problem: &Problem) -> [[f64; 2]; 2] {
    let flights = if problem.validation.is_empty() { &problem.estimation } else { &problem.validation };
    let floor = noise::floor(flights);
    HORIZONS_S.map(|horizon_s| {
        let of_all = noise::prediction_floor(&floor, horizon_s, problem.model.vehicle.gravity_m_s2);
        ["attitude", "velocity"].map(|name| of_all.get(name).map_or(0.0, |error| error / 3.0_f64.sqrt()))
    })
}

/// The ends of a flight's windows under `values`; none where its attitude was assumed, or there is nothing to predict with.
/// Up to `span_s` of the flight.
pub fn ends(
    problem: &Problem,
    flight: &Prepared,
    values: &[f64],
    horizon_s: f64,
    span_s: Option<f64>,
) -> Vec<WindowEnd> {
    ends_under(problem, flight, values, horizon_s, span_s, |_| [0.0; 6])
}

/// The same with the flight's own trim.
fn trimmed_ends(problem: &Problem, flight: &Prepared, values: &[f64], horizon_s: f64) -> Vec<WindowEnd> {
    let seen = OwnTrim::of(problem, flight, values);
    ends_under(problem, flight, values, horizon_s, None, |from_s| seen.at(from_s))
}

fn ends_under(
    problem: &Problem,
    flight: &Prepared,
    values: &[f64],
    horizon_s: f64,
    span_s: Option<f64>,
    push: impl Fn(f64) -> [f64; 6],
) -> Vec<WindowEnd> {
    if flight.is_assumed() || flight.flight.attitude.is_empty() {
        return Vec::new();
    }
    let errors = SensorErrors::of(&problem.model.parameters, values);
    let corrected = errors.taken_off(flight.flight, &flight.late);
    let Some(measured) = Measured::of(&corrected) else { return Vec::new() };
    let measured = span_s.into_iter().fold(measured, Measured::shortened);
    measured.ends(problem.model.airframe_of(flight, values), horizon_s, push)
}

/// Errors of a state at the end of a window: attitude about the axes of the body in deg, velocity in the world in m/s; 0
/// where `flight` does not show the velocity.
pub fn errors(flight: &Prepared, end: &WindowEnd, state: &RigidBody) -> [f64; 6] {
    let turn_B = (end.measured.attitude_WB.inverse() * state.attitude_WB).scaled_axis();
    let part = f64::from(StateQuantity::Velocity.is_measured(flight.flight));
    let slip_W = part * (state.velocity_W_m_s - end.measured.velocity_W_m_s);
    [turn_B.x.to_degrees(), turn_B.y.to_degrees(), turn_B.z.to_degrees(), slip_W.x, slip_W.y, slip_W.z]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of 40 blocks, of which the velocity along x is so many times as large as the others.
    fn errors_with(ratio: f64) -> Foresight {
        let one = |block: i64| {
            let size = 1.0 + 0.1 * ((block * 7919) % 11) as f64;
            let squares = [1.0, 1.0, 1.0, ratio * ratio, 1.0, 1.0].map(|square| size * square);
            [((0, 0, block), (squares, 1.0)), ((0, 1, block), ([size; 6], 1.0))]
        };
        Foresight { squares: (0..40).flat_map(one).collect(), noise: [[0.1; 2]; 2] }
    }

    #[test]
    fn the_component_that_grows_is_told_with_its_size() {
        let growth = errors_with(1.5).growth(&errors_with(1.0)).unwrap();
        assert_eq!((growth.component, growth.horizon_s, growth.unit), ("velocity x", 0.1, "m/s"));
        assert!((growth.ratio() - 1.5).abs() < 1e-9, "{growth:?}");
        assert_eq!(errors_with(1.0).growth(&errors_with(1.5)), None);
        assert_eq!(errors_with(1.01).growth(&errors_with(1.0)), None, "too little to matter");
    }

    #[test]
    fn better_is_better_than_worse_only() {
        assert!(errors_with(1.0).is_better_than(&errors_with(2.0)));
        assert!(!errors_with(2.0).is_better_than(&errors_with(1.0)));
        assert!(!errors_with(1.0).is_better_than(&errors_with(1.0)));
    }
}
