//! Predictions as a judge: no effect is kept with which the vehicle predicts worse than without it, or the same.
//!
//! An effect can make the residual of the equations smaller and yet predictions worse: it then absorbs the
//! influence of another cause. The judged flights are those with role `select`, or else those that parameters
//! are fitted on, each with parameters that were fitted on the others.

use crate::data::measured::Measured;
use crate::data::prepared::Prepared;
use crate::data::sensing::SensorErrors;
use crate::model::disturbance::{DisturbanceModels, Observed};
use crate::model::noise;
use crate::model::predict::{WindowEnd, components};
use crate::model::problem::Problem;
use crate::numbers::statistics::chance_of_no_gain;
use crate::search::fit::Equations;
use crate::search::fit_result::FitResult;
use crate::search::worth::Worth;
use flights::state::StateQuantity;
use plant::RigidBody;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Horizons at which effects are judged.
pub const HORIZONS_S: [f64; 2] = [0.1, 0.5];
/// Quantities that are judged.
const QUANTITIES: [StateQuantity; 4] = StateQuantity::ALL;
/// Number of their components.
pub const ERRORS: usize = 3 * QUANTITIES.len();
/// Errors of all components.
pub type WindowErrors = [f64; ERRORS];
/// Chance of a false finding that one channel grows.
const LEVEL: f64 = 0.01;
/// A smaller growth of an error does not matter.
const LEAST_GROWTH: f64 = 1.02;
/// Nor does one by less than this part of the error that the noise of the sensors makes.
const OF_NOISE: f64 = 0.5;
/// Nor one by less than this part of persistence's error: a position after 0.1 s is known to a millimetre by its velocity.
const OF_PERSISTENCE: f64 = 0.01;
/// An effect changes something where an error without it has a part of at least this share of persistence's error; tuned, no source.
const LEAST_CHANGE: f64 = 0.02;
/// The same of a part that the noise beside it hides, and that is beyond chance.
const SURE_CHANGE: f64 = 0.05;
/// Mean square that stands for a prediction that diverged.
const DIVERGED: f64 = 1e60;

/// Prediction errors of the judged flights.
#[derive(Debug, Default)]
pub struct Foresight {
    /// Squares by flight, horizon and block of time: sums by component, and the number of windows.
    squares: BTreeMap<(usize, usize, i64), (WindowErrors, f64)>,
    /// Mean squares of persistence's errors, by horizon.
    persistent: [WindowErrors; HORIZONS_S.len()],
    /// Errors of each quantity that the noise of the sensors makes, by horizon.
    noise: [[f64; QUANTITIES.len()]; 2],
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
        Self::under(problem, &DisturbanceModels::of(problem, &near.values), &flights)
    }

    /// Prediction errors of flights, each under its values, with disturbances of these models as they were seen before each window.
    pub fn under(problem: &Problem, models: &DisturbanceModels, flights: &[(&Prepared, Vec<f64>)]) -> Self {
        let jobs: Vec<(usize, usize)> = (0..flights.len())
            .flat_map(|at| (0..HORIZONS_S.len()).map(move |horizon| (at, horizon)))
            .collect();
        let of_job = |(at, horizon): &(usize, usize)| -> Vec<_> {
            let (flight, values) = &flights[*at];
            let ends = ends(problem, flight, values, models, &HORIZONS_S[*horizon..=*horizon]);
            ends.iter()
                .flatten()
                .map(|end| {
                    let squares = |state| errors(flight, end, state).map(|error| error * error);
                    let key = (*at, *horizon, problem.block_of(end.from_s));
                    (key, squares(&end.simulated), squares(&end.persistent))
                })
                .collect()
        };
        let (mut sums, mut persistent) = (BTreeMap::new(), [([0.0; ERRORS], 0.0); HORIZONS_S.len()]);
        for (key, squares, of_persistence) in
            jobs.par_iter().map(of_job).collect::<Vec<_>>().into_iter().flatten()
        {
            let (sum, count) = &mut persistent[key.1];
            sum.iter_mut().zip(of_persistence).for_each(|(sum, square)| *sum += square);
            *count += 1.0;
            let sum: &mut (WindowErrors, f64) = sums.entry(key).or_default();
            sum.0.iter_mut().zip(squares).for_each(|(sum, square)| *sum += square);
            sum.1 += 1.0;
        }
        let persistent = persistent.map(|(sum, count)| sum.map(|sum| sum / f64::max(count, 1.0)));
        Self { squares: sums, persistent, noise: noise(problem) }
    }

    /// Every error with an effect beside that `without` it.
    pub fn worths(&self, without: &Self) -> Vec<Worth> {
        self.compared(without).into_iter().map(|(worth, _)| worth).collect()
    }

    /// The channel whose error grows most from `without` the effect to `self`, of those that grow beyond their noise.
    pub fn growth(&self, without: &Self) -> Option<Worth> {
        let grown = self.compared(without).into_iter().filter(|(_, is_grown)| *is_grown);
        grown.map(|(worth, _)| worth).max_by(|a, b| a.ratio().total_cmp(&b.ratio()))
    }

    /// True if an effect changes something: an error is greater without it, or all of them together are smaller with it.
    pub fn is_worth_more_than(&self, without: &Self) -> bool {
        let mut places =
            (0..HORIZONS_S.len()).flat_map(|horizon| (0..QUANTITIES.len()).map(move |at| (horizon, at)));
        places.any(|(horizon, at)| without.is_grown(self, horizon, at)) || self.is_better_than(without)
    }

    /// True if the error of a quantity is noticeably greater than that `with` an effect, by a part that
    /// matters. True also if it is greater by a larger part, beyond chance.
    fn is_grown(&self, with: &Self, horizon: usize, at: usize) -> bool {
        let pairs = self.blocks(with, horizon, 3 * at..3 * at + 3);
        let [without, with] = root_means(&pairs);
        let persistent = self.persistent[horizon][3 * at..3 * at + 3].iter().sum::<f64>().sqrt();
        let part = (without * without - with * with).max(0.0).sqrt();
        let is_noticeable = part > LEAST_CHANGE * persistent && without > LEAST_GROWTH * with;
        is_noticeable || (part > SURE_CHANGE * persistent && is_beyond_chance(&pairs))
    }

    /// Every error that was measured, with an effect and `without` it, and whether it grows by the effect beyond its noise.
    fn compared(&self, without: &Self) -> Vec<(Worth, bool)> {
        let places =
            (0..HORIZONS_S.len()).flat_map(|horizon| (0..QUANTITIES.len()).map(move |at| (horizon, at)));
        let of_place = |(horizon, at): (usize, usize)| {
            let pairs = self.blocks(without, horizon, 3 * at..3 * at + 3);
            let [with, without] = root_means(&pairs);
            let persistent: f64 = self.persistent[horizon][3 * at..3 * at + 3].iter().sum();
            let by = (with * with - without * without).max(0.0).sqrt();
            let matters = with > LEAST_GROWTH * without
                && by > OF_NOISE * self.noise[horizon][at]
                && with - without > OF_PERSISTENCE * persistent.sqrt();
            let (channel, unit) = (QUANTITIES[at].name(), QUANTITIES[at].unit());
            let worth = Worth { channel, horizon_s: HORIZONS_S[horizon], without, with, unit };
            (without > 0.0).then_some((worth, matters && is_beyond_chance(&pairs)))
        };
        places.filter_map(of_place).collect()
    }

    /// True if all errors together are smaller than `other`'s beyond chance, and by more than
    /// [`LEAST_GROWTH`]. They are compared by the geometric mean over components, horizons and blocks of
    /// time: half of an error counts as much where it is small, down to the noise of the sensors, as where it
    /// is great.
    pub fn is_better_than(&self, other: &Self) -> bool {
        self.chance_against(other) < LEVEL
    }

    /// Chance of errors that much smaller than `other`'s, all together; 1 where they are not smaller by more than [`LEAST_GROWTH`].
    pub fn chance_against(&self, other: &Self) -> f64 {
        let mut gains: BTreeMap<(usize, i64), f64> = BTreeMap::new();
        let mut count = 0.0;
        for (key, (new, windows)) in &self.squares {
            let Some((old, old_windows)) = other.squares.get(key) else { continue };
            // A vehicle whose prediction diverges is no better one.
            if !new.iter().all(|square| square.is_finite()) {
                return 1.0;
            }
            let (flight, horizon, block) = *key;
            let gain = gains.entry((flight, block)).or_default();
            for at in (0..ERRORS).filter(|at| old[*at] != 0.0) {
                let floor = (OF_NOISE * self.noise[horizon][at / 3]).powi(2) / 3.0;
                let (old, new) = (finite(old[at] / old_windows), new[at] / windows);
                *gain += libm::log((old + floor) / (new + floor).max(f64::MIN_POSITIVE));
                count += 1.0;
            }
        }
        let gains: Vec<f64> = gains.into_values().collect();
        let is_smaller = gains.iter().sum::<f64>() > 2.0 * libm::log(LEAST_GROWTH) * count;
        if is_smaller { chance_of_no_gain(&gains) } else { 1.0 }
    }

    /// Mean squares of these components together by block, with and without, where both have some.
    fn blocks(&self, without: &Self, horizon: usize, of: Range<usize>) -> Vec<(f64, f64)> {
        let of_horizon = self.squares.iter().filter(|(key, _)| key.1 == horizon);
        let pair = |(key, (with, count)): (&(usize, usize, i64), &(WindowErrors, f64))| {
            let (other, other_count) = without.squares.get(key)?;
            let sum = |squares: &WindowErrors| squares[of.clone()].iter().sum::<f64>();
            Some((finite(sum(with) / count), finite(sum(other) / other_count)))
        };
        of_horizon.filter_map(pair).collect()
    }
}

#[cfg(test)]
impl Foresight {
    /// The same with all errors so many times as large.
    pub fn times(mut self, factor: f64) -> Self {
        let squares = self.squares.values_mut().flat_map(|(squares, _)| squares);
        squares.for_each(|square| *square *= factor * factor);
        self
    }
}

/// A mean square; that of a prediction that diverged is very great.
fn finite(square: f64) -> f64 {
    if square.is_finite() { square } else { DIVERGED }
}

/// Root means of the first and of the second of mean squares by block.
fn root_means(pairs: &[(f64, f64)]) -> [f64; 2] {
    let mean = |sum: f64| (sum / pairs.len().max(1) as f64).sqrt();
    [mean(pairs.iter().map(|pair| pair.0).sum()), mean(pairs.iter().map(|pair| pair.1).sum())]
}

/// True if the first are greater than the second beyond chance.
fn is_beyond_chance(pairs: &[(f64, f64)]) -> bool {
    let growths: Vec<f64> = pairs.iter().map(|(first, second)| first - second).collect();
    chance_of_no_gain(&growths) < LEVEL
}

/// Errors of each quantity that the sensors' noise makes in the judged flights.
fn noise(problem: &Problem) -> [[f64; QUANTITIES.len()]; 2] {
    let flights = if problem.validation.is_empty() { &problem.estimation } else { &problem.validation };
    let floor = noise::floor(flights);
    HORIZONS_S.map(|horizon_s| {
        let of_all = noise::prediction_floor(&floor, horizon_s, problem.model.vehicle.gravity_m_s2);
        QUANTITIES.map(|of| of_all.get(of.name()).copied().unwrap_or(0.0))
    })
}

/// The ends of a flight's windows under `values` at several horizons, with the disturbance of these `models` that was seen before each; none where its
/// attitude was assumed, or there is nothing to predict with.
pub fn ends(
    problem: &Problem,
    flight: &Prepared,
    values: &[f64],
    models: &DisturbanceModels,
    horizons_s: &[f64],
) -> Vec<Vec<WindowEnd>> {
    let errors = SensorErrors::of(&problem.model.parameters, values);
    let measured = flight.recent_measured.at(errors, || measured(flight, &errors));
    let Some(measured) = measured.as_ref() else { return vec![Vec::new(); horizons_s.len()] };
    let (airframe, seen) = (problem.model.airframe_of(flight, values), Observed::of(problem, flight, values));
    measured.ends_within(airframe, horizons_s, |from_s| seen.expected(models, from_s))
}

/// A flight's measurements without the errors of the sensors, in the pieces of its grid; `None` where its attitude was assumed, or there is nothing to
/// predict with.
fn measured(flight: &Prepared, errors: &SensorErrors) -> Option<Measured> {
    if flight.is_assumed() || flight.flight.attitude.is_empty() {
        return None;
    }
    let pieces_s = flight.layout.clock.pieces_s();
    let cut = (!pieces_s.is_empty()).then(|| flight.flight.within(&pieces_s));
    let measured = Measured::of(&errors.taken_off(cut.as_ref().unwrap_or(&flight.flight), &flight.late))?;
    let measured = measured.within(pieces_s, flight.settling_s());
    Some(if flight.turns_as_measured() { measured.turning_as_measured() } else { measured })
}

/// Errors of a state at the end of a window; 0 of a quantity that `flight` does not show, or that predictions take as it was measured.
pub fn errors(flight: &Prepared, end: &WindowEnd, state: &RigidBody) -> WindowErrors {
    let errors = components(end, state);
    let is_judged = |quantity: StateQuantity| {
        quantity.is_measured(&flight.flight) && !(quantity.is_turn() && flight.turns_as_measured())
    };
    std::array::from_fn(|at| f64::from(is_judged(QUANTITIES[at / 3])) * errors[at / 3][at % 3])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of 40 blocks, of which the velocity is so many times as large as the others.
    fn errors_with(ratio: f64) -> Foresight {
        let one = |block: i64| {
            let size = 1.0 + 0.1 * ((block * 7919) % 11) as f64;
            let mut squares = [size; ERRORS];
            squares[3..6].iter_mut().for_each(|square| *square *= ratio * ratio);
            [((0, 0, block), (squares, 1.0)), ((0, 1, block), ([size; ERRORS], 1.0))]
        };
        Foresight {
            squares: (0..40).flat_map(one).collect(),
            persistent: [[1.0; ERRORS]; 2],
            noise: [[0.1; QUANTITIES.len()]; 2],
        }
    }

    #[test]
    fn the_channel_that_grows_is_told_with_its_size() {
        let growth = errors_with(1.5).growth(&errors_with(1.0)).unwrap();
        assert_eq!((growth.channel, growth.horizon_s, growth.unit), ("velocity", 0.1, "m/s"));
        assert!((growth.ratio() - 1.5).abs() < 1e-9, "{growth:?}");
        assert_eq!(errors_with(1.0).growth(&errors_with(1.5)), None);
        assert_eq!(errors_with(1.01).growth(&errors_with(1.0)), None, "too little to matter");
    }

    #[test]
    fn an_effect_is_worth_something_where_an_error_is_greater_without_it() {
        assert!(errors_with(1.0).is_worth_more_than(&errors_with(1.5)));
        assert!(!errors_with(1.0).is_worth_more_than(&errors_with(1.0)));
        assert!(!errors_with(1.5).is_worth_more_than(&errors_with(1.0)), "without it they are smaller");
        assert!(errors_with(1.0).is_worth_more_than(&errors_with(1.01)), "little, but in every block");
        assert!(!errors_with(1.0).is_worth_more_than(&errors_with(1.0001)), "too little");
        let mut diverged = errors_with(1.0);
        diverged.squares.values_mut().take(2).for_each(|(squares, _)| squares[4] = f64::NAN);
        assert!(errors_with(1.0).is_worth_more_than(&diverged), "it diverges without the effect");
        assert!(!diverged.is_worth_more_than(&errors_with(1.0)));
    }

    #[test]
    fn better_is_better_than_worse_only() {
        assert!(errors_with(1.0).is_better_than(&errors_with(2.0)));
        assert!(!errors_with(2.0).is_better_than(&errors_with(1.0)));
        assert!(!errors_with(1.0).is_better_than(&errors_with(1.0)));
    }
}
