//! Whiteness of a residual: its test, and the size of the part that is not noise.

use crate::data::prepared::Equation;
use crate::data::rows::column;
use crate::model::problem::Problem;
use crate::numbers::statistics::{autocorrelation, deviation, ljung_box, white_noise_bound};
use serde::Serialize;
use std::collections::BTreeMap;

/// Windows of neighbouring knots overlap; those of every fourth do not.
const APART: usize = 4;
/// Lags looked at, in windows that do not overlap.
const LAGS: usize = 25;

/// The residual of one equation on the test data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Whiteness {
    /// Root mean square over all components.
    pub rms: f64,
    /// The same without any model: of the measured values, less their mean over each flight.
    pub no_model: f64,
    /// Its unit.
    pub unit: &'static str,
    /// Part of the autocorrelations up to lag 25 (of windows that do not overlap) beyond their 99 % bound: 0.01 if
    /// the residual is white.
    pub beyond_bound: f64,
    /// Probability of as much autocorrelation in white noise (Ljung and Box), the least over components, times their
    /// number.
    pub p_value: f64,
    /// Root mean square of the part that neighbouring windows have in common: the residual that is not noise.
    pub persistent: f64,
}

/// The whiteness of every equation under `values`, over the test data.
pub fn whiteness(problem: &Problem, values: &[f64]) -> BTreeMap<&'static str, Whiteness> {
    let mut columns: BTreeMap<&'static str, Vec<Column>> = BTreeMap::new();
    for flight in &problem.test {
        let residual = problem.model.residual_under(flight, values);
        let measured = &problem.model.tracks(flight, values).rows;
        for equation in &flight.layout.equations {
            for axis in 0..equation.size() {
                let [residual, measured] =
                    [&residual, measured].map(|rows| column(flight, rows, *equation, axis));
                let column = Column { equation: *equation, residual, spread: deviation(&measured) };
                columns.entry(equation.name()).or_default().push(column);
            }
        }
    }
    columns.into_iter().map(|(name, columns)| (name, of_equation(&columns))).collect()
}

/// One component of an equation over one flight.
struct Column {
    equation: Equation,
    residual: Vec<f64>,
    /// Standard deviation of the measured values.
    spread: f64,
}

fn of_equation(columns: &[Column]) -> Whiteness {
    let (mut squares, mut count, mut common, mut beyond, mut lags, mut p_value) =
        (0.0, 0, 0.0, 0, 0, 1.0_f64);
    let mut measured = 0.0;
    for Column { residual: column, spread, .. } in columns {
        measured += spread * spread * column.len() as f64;
        squares += column.iter().map(|number| number * number).sum::<f64>();
        count += column.len();
        let pairs = column.iter().zip(column.iter().skip(APART));
        common += pairs.map(|(a, b)| a * b).sum::<f64>();
        let apart: Vec<f64> = column.iter().step_by(APART).copied().collect();
        let own_lags = LAGS.min(apart.len() / 4);
        if own_lags >= 2 && apart.iter().any(|number| *number != 0.0) {
            let bound = white_noise_bound(apart.len(), 0.99);
            let correlations = autocorrelation(&apart, own_lags);
            beyond += correlations[1..].iter().filter(|number| number.abs() > bound).count();
            lags += own_lags;
            p_value = p_value.min(ljung_box(&apart, own_lags).p_value);
        }
    }
    let unit = columns.first().map_or("", |column| column.equation.unit());
    Whiteness {
        rms: (squares / count.max(1) as f64).sqrt(),
        no_model: (measured / count.max(1) as f64).sqrt(),
        unit,
        beyond_bound: f64::from(beyond as u32) / (lags.max(1) as f64),
        p_value: (p_value * columns.len() as f64).min(1.0),
        persistent: (common.max(0.0) / count.max(1) as f64).sqrt(),
    }
}
