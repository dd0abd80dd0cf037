//! The wind of a test flight as its past shows it, stage by stage, beside what the winds of the fit flights tell: their mean and their spread.
//!
//! A test flight decides nothing, so that its wind is fitted nowhere. But a prediction may know what was seen before it, as that of a trim does.

use crate::data::prepared::Prepared;
use crate::model::disturbance::lag_s;
use crate::model::problem::Problem;
use crate::numbers::normal::{self, Block};
use crate::search::wind_start::deviations_m_s;

/// Length of a stage, in s.
const STAGE_S: f64 = 5.0;
/// The spread of the winds is at least this, in m/s: two flights may have the same wind by chance; tuned, no source.
const LEAST_SPREAD_M_S: f64 = 0.3;

/// A stretch of a flight.
pub struct Stage {
    /// Its begin, in s.
    pub from_s: f64,
    /// Its end, in s.
    pub to_s: f64,
    /// The values in the wind that was seen before it.
    pub values: Vec<f64>,
}

/// The stages of `flight` under `values`; none where all flights have one wind, or its own was fitted.
pub fn stages(problem: &Problem, flight: &Prepared, values: &[f64]) -> Vec<Stage> {
    let (parameters, clock) = (&problem.model.parameters, &flight.layout.clock);
    let Some(precisions) = precisions(&deviations_m_s(parameters, values)) else { return Vec::new() };
    if flight.number.is_some() {
        return Vec::new();
    }
    let wind = parameters.level_wind();
    let knots = problem.block_knots(flight);
    let known_s = |end: usize| clock.at(flight.layout.knots[end - 1]) + lag_s(flight);
    let (start_s, last_s) = (clock.at(0), clock.at(clock.count - 1));
    let count = ((last_s - start_s) / STAGE_S).ceil() as usize;
    let mut now = values.to_vec();
    let stage = |number: usize| {
        let from_s = start_s + number as f64 * STAGE_S;
        let seen = knots.iter().take_while(|(_, end)| known_s(*end) <= from_s).count();
        if seen > 0 {
            let blocks = problem.blocks_of(flight, &now, &wind);
            let mut past = normal::sum(&blocks[..seen]);
            for (axis, precision) in precisions.iter().enumerate() {
                past.gram[(axis, axis)] += precision;
                past.gradient[axis] += precision * (now[wind[axis]] - values[wind[axis]]);
            }
            now = moved(problem, &past, &now, &wind);
        }
        Stage { from_s, to_s: from_s + STAGE_S, values: now.clone() }
    };
    (0..count).map(stage).collect()
}

/// The values after the step of the wind that the equations `past` ask for.
fn moved(problem: &Problem, past: &Block, values: &[f64], wind: &[usize]) -> Vec<f64> {
    let step = -(normal::inverse(&past.gram) * &past.gradient);
    problem.moved(values, wind, &step)
}

/// Inverse variances of the winds of the fit flights, by axis; `None` where these have one wind.
fn precisions(deviations_m_s: &[[f64; 2]]) -> Option<[f64; 2]> {
    let is_one = deviations_m_s.iter().flatten().all(|deviation| *deviation == 0.0);
    let others = deviations_m_s.len().saturating_sub(1) as f64;
    let precision = |axis: usize| {
        let variance = deviations_m_s.iter().map(|of| of[axis] * of[axis]).sum::<f64>() / others;
        1.0 / variance.max(LEAST_SPREAD_M_S * LEAST_SPREAD_M_S)
    };
    (!is_one).then(|| [0, 1].map(precision))
}

#[cfg(test)]
mod tests {
    use super::precisions;

    #[test]
    fn winds_that_differ_much_tell_little_of_another_one() {
        let precisions = precisions(&[[3.0, 0.1], [-3.0, -0.1]]).expect("two winds");
        assert!((precisions[0] - 1.0 / 18.0).abs() < 1e-12, "{precisions:?}");
        assert!((precisions[1] - 1.0 / 0.09).abs() < 1e-9, "{precisions:?}");
    }

    #[test]
    fn one_wind_has_no_stages() {
        assert_eq!(precisions(&[[0.0; 2]; 3]), None);
        assert_eq!(precisions(&[]), None);
    }
}
