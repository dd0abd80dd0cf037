//! Losses at each moment: forces and torques that the new vehicle file predicts worse than no model, and a constant force that is too large for
//! a trim. Predictions with the own trim of the flight may hide both.

use crate::data::prepared::{Equation, Prepared};
use crate::data::rows::column;
use crate::model::problem::Problem;
use crate::numbers::statistics::{deviation, mean};
use crate::report::loss::{Loss, MOMENT};

/// Greatest constant force beyond the model, as a part of gravity: weights and thrust coefficients err by less.
const TRIM_MAX: f64 = 0.2;
/// The part of a residual that is not noise is worse than no model beyond this ratio. In calm flights whose controller holds
/// against gusts, the forces of the gusts are about as large as what they move: those are no fault of the vehicle file.
const WORSE: f64 = 1.5;
/// Windows of neighbouring knots overlap; those of every fourth do not.
const APART: usize = 4;

/// Losses of `values` against no model, in the test flights whose attitude was measured.
pub fn misfits(problem: &Problem, values: &[f64]) -> Vec<Loss> {
    let judged = problem.test.iter().filter(|flight| !flight.is_assumed());
    judged.flat_map(|flight| of_flight(problem, flight, values)).collect()
}

fn of_flight(problem: &Problem, flight: &Prepared, values: &[f64]) -> Vec<Loss> {
    let residual = problem.model.residual_under(flight, values);
    let measured = &problem.model.tracks(flight, values).rows;
    let name = &flight.flight.name;
    let gravity_m_s2 = problem.model.vehicle.gravity_m_s2;
    let mut losses = Vec::new();
    for equation in &flight.layout.equations {
        let channel = match equation {
            Equation::SpecificForce | Equation::Acceleration | Equation::AngularAcceleration => {
                equation.name()
            }
            Equation::Gyroscope | Equation::RotorSpeed(_) => continue,
        };
        let fit = Fit::of(flight, &residual, measured, *equation);
        let loss = |rival, new: f64, other: f64| Loss {
            flight: name.clone(),
            horizon: MOMENT,
            channel,
            rival,
            new,
            knowing: "nothing",
            other,
            unit: equation.unit(),
        };
        let is_force = *equation != Equation::AngularAcceleration;
        if is_force && fit.trim > TRIM_MAX * gravity_m_s2 {
            losses.push(loss("trim", fit.trim, TRIM_MAX * gravity_m_s2));
        } else if fit.left > WORSE * fit.no_model {
            losses.push(loss("no model", fit.left, fit.no_model));
        }
    }
    losses
}

/// Sizes of the residual of an equation over one flight, as lengths of vectors.
#[derive(Default)]
struct Fit {
    /// Length of its mean.
    trim: f64,
    /// Root mean square of the part beyond the mean that neighbouring windows have in common, so that it is no noise.
    left: f64,
    /// Root mean square of the measured values, without their mean.
    no_model: f64,
}

impl Fit {
    fn of(flight: &Prepared, residual: &[f64], measured: &[f64], equation: Equation) -> Self {
        let mut squares = Self::default();
        for axis in 0..equation.size() {
            let [residual, measured] = [residual, measured].map(|rows| column(flight, rows, equation, axis));
            let middle = mean(&residual);
            let pairs = residual.iter().zip(residual.iter().skip(APART));
            let common: f64 = pairs.map(|(a, b)| (a - middle) * (b - middle)).sum();
            squares.trim += middle * middle;
            squares.left += common / residual.len().max(1) as f64;
            squares.no_model += deviation(&measured).powi(2);
        }
        Self {
            trim: squares.trim.sqrt(),
            left: squares.left.max(0.0).sqrt(),
            no_model: squares.no_model.sqrt(),
        }
    }
}
