//! Ratios: all that flights determine that show rotation alone, such as those on a rig.
//!
//! A common factor on the rotors' thrust and drag, the moments of inertia, the static moment and the friction leaves every rotation
//! as it is. So thrust by inertia is determined, but neither of the two.

use crate::data::prepared::{Equation, Prepared};
use crate::model::problem::Problem;
use crate::numbers::digits::rounded;
use crate::search::fit_result::FitResult;
use serde::Serialize;
use std::fmt;
use vehicles::Vehicle;

/// The experiment that separates the sides of the ratios.
pub const EXPERIMENT: &str =
    "fly freely with a position or an accelerometer, or hang a known weight at a known arm on the rig";

/// A part of a plausible change by which derivatives are taken.
const PART: f64 = 1e-3;

/// The ratios that are determined, as multiples of the declared ones.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ratios {
    /// Thrust by the moment of inertia about x and about y, drag torque of the rotors by that about z.
    pub of_axes: [Ratio; 3],
    /// The experiment that would tell the sides of the ratios apart.
    pub experiment: &'static str,
}

/// A ratio as a multiple of the declared one, with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratio {
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Ratios {
    /// The ratios that the flights of `problem` determine beside the effects of `fitted`; `None` if some flight shows forces.
    pub fn of(problem: &Problem, fitted: &FitResult) -> Option<Self> {
        if !shows_rotation_alone(problem) {
            return None;
        }
        // About an axis of which no accepted effect changes the ratio, a moment of inertia does.
        let mut free = fitted.free.clone();
        for axis in 0..3 {
            if !free.iter().any(|at| changes(problem, *at)[axis]) {
                free.extend(alone_about(problem, axis));
            }
        }
        // Measured rotors are noisy regressors, by which least squares finds too small ratios.
        let all = problem.fitted_by_instruments(&problem.fitted(&fitted.values, &free));
        let of_axes = std::array::from_fn(|axis| ratio(problem, &all, axis));
        Some(Self { of_axes, experiment: EXPERIMENT })
    }
}

impl fmt::Display for Ratios {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = &self.of_axes;
        write!(
            f,
            "these flights show rotation alone, which determines ratios only: thrust by inertia is {x} of the declared about x and \
             {y} about y, drag torque by inertia {z} about z"
        )
    }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [value, low, high] = [self.value, self.low, self.high].map(rounded);
        write!(f, "{value} (95 %: {low} ... {high})")
    }
}

/// True if no flight that parameters are fitted on shows forces, but torques.
pub fn shows_rotation_alone(problem: &Problem) -> bool {
    let has = |flight: &Prepared, equation| flight.offset_of(equation).is_some();
    problem.estimation.iter().all(|flight| {
        has(flight, Equation::AngularAcceleration)
            && !has(flight, Equation::SpecificForce)
            && !has(flight, Equation::Acceleration)
    })
}

/// The parameters among `free` that change a ratio: thrust, drag and moments of inertia.
pub fn scaling(problem: &Problem, free: &[usize]) -> Vec<usize> {
    free.iter().copied().filter(|at| changes(problem, *at).contains(&true)).collect()
}

/// A parameter that changes the ratio about one axis and no other.
fn alone_about(problem: &Problem, axis: usize) -> Option<usize> {
    let wanted = std::array::from_fn(|other| other == axis);
    (0..problem.model.parameters.all.len()).find(|at| changes(problem, *at) == wanted)
}

/// For each axis true if a parameter changes the ratio about it.
fn changes(problem: &Problem, parameter: usize) -> [bool; 3] {
    let base = problem.model.parameters.baseline();
    let of_axis = |axis: usize| slope(problem, &base, parameter, axis).abs() > 0.0;
    std::array::from_fn(of_axis)
}

fn ratio(problem: &Problem, fitted: &FitResult, axis: usize) -> Ratio {
    let value = at(problem, &fitted.values, axis);
    let slopes: Vec<f64> =
        fitted.free.iter().map(|parameter| slope(problem, &fitted.values, *parameter, axis)).collect();
    let mut variance = 0.0;
    for (i, one) in slopes.iter().enumerate() {
        for (j, other) in slopes.iter().enumerate() {
            variance += one * fitted.covariance[(i, j)] * other;
        }
    }
    let half = fitted.t_quantile(0.975) * variance.max(0.0).sqrt();
    Ratio { value, low: value - half, high: value + half }
}

/// Derivative of the ratio about `axis` by a parameter.
fn slope(problem: &Problem, values: &[f64], parameter: usize, axis: usize) -> f64 {
    let entry = &problem.model.parameters.all[parameter];
    let mut moved = values.to_vec();
    let up = entry.bounded(values[parameter] + PART * entry.scale);
    moved[parameter] =
        if up > values[parameter] { up } else { entry.bounded(values[parameter] - PART * entry.scale) };
    let way = moved[parameter] - values[parameter];
    if way == 0.0 { 0.0 } else { (at(problem, &moved, axis) - at(problem, values, axis)) / way }
}

/// The ratio about `axis` under `values`, as a multiple of that of the declared model.
fn at(problem: &Problem, values: &[f64], axis: usize) -> f64 {
    let of = |vehicle: &Vehicle| {
        let push = if axis < 2 { vehicle.thrust_coefficient } else { vehicle.torque_coefficient };
        push / vehicle.inertia_kg_m2[(axis, axis)]
    };
    let declared = problem.model.airframe(&problem.model.parameters.baseline());
    of(problem.model.airframe(values).vehicle()) / of(declared.vehicle())
}
