//! Slow disturbances under feedback: the controller answers them, so that commands and disturbances are correlated.

use super::cases::Case;
use super::effect;
use identify::effect_reports::estimates;
use identify::run::{identify, problem};

const DURATION_S: f64 = 20.0;

/// A disturbance, and the controller and course under which it acts.
#[derive(Debug, Clone, Copy)]
pub struct Gust {
    /// Part of the thrust that it is.
    pub intensity: f64,
    /// Time over which it remembers itself.
    pub correlation_s: f64,
    /// Gains of the controller as multiples of a careful pilot's.
    pub stiffness: f64,
    /// True for a hover.
    pub is_calm: bool,
}

/// Result of a fit or a search.
#[derive(Debug)]
pub struct Found {
    /// Effects that were named.
    pub verdict: Vec<&'static str>,
    /// Errors of the inertia about x and y: estimate and ends of the 95 % interval; none where they were not estimated.
    pub inertia: Vec<(f64, f64, f64)>,
}

/// Disturbances of 0.02 to 2 s, weak and strong, under three controllers, in a hover and on a course.
pub fn gusts() -> Vec<Gust> {
    let mut all = Vec::new();
    for is_calm in [true, false] {
        for intensity in [0.02, 0.05] {
            for correlation_s in [0.02, 0.05, 0.15, 0.5, 2.0] {
                for stiffness in [0.85, 1.0, 1.3] {
                    all.push(Gust { intensity, correlation_s, stiffness, is_calm });
                }
            }
        }
    }
    all
}

/// Flights under `gust` of a vehicle whose inertia is `error` more than declared.
pub fn case(gust: &Gust, error: f64, seed: u64) -> Case {
    let mut case = Case::null(seed, DURATION_S);
    (case.plan.stiffness, case.plan.is_calm) = (gust.stiffness, gust.is_calm);
    let values =
        [("intensity", gust.intensity), ("height_scale", 10.0), ("correlation_time", gust.correlation_s)];
    case.plan.truth.push(effect("ground-turbulence", &values));
    if error != 0.0 {
        case.plan.truth.push(effect("inertia-error", &[("error_xx", error), ("error_yy", error)]));
    }
    case
}

/// Fits the inertia alone.
pub fn fitted(gust: &Gust, error: f64, seed: u64) -> Found {
    let case = case(gust, error, seed);
    let set = case.flights();
    let (vehicle, declared) = case.declared();
    let (mut problem, _) = problem(&vehicle, &declared, &set).expect("flights to identify on");
    let free = problem.model.parameters.of_name("inertia-error");
    let mut fitted = problem.fitted(&problem.model.parameters.baseline(), &[]);
    for _ in 0..3 {
        problem.weigh(&fitted, &[]);
        fitted = problem.fitted(&fitted.values, &free);
    }
    let found = estimates(&problem, &fitted, &free);
    let of = |name: &str| (found[name].value, found[name].low, found[name].high);
    Found { verdict: Vec::new(), inertia: vec![of("error_xx"), of("error_yy")] }
}

/// Searches among all effects.
pub fn searched(gust: &Gust, error: f64, seed: u64) -> Found {
    let report = identify(&case(gust, error, seed).flights(), &mut |_| ()).expect("flights").report;
    let inertia = report.effects.get("inertia-error").map(|effect| &effect.parameters);
    let of = |name: &str| inertia?.get(name).map(|found| (found.value, found.low, found.high));
    Found { verdict: report.verdict, inertia: ["error_xx", "error_yy"].into_iter().filter_map(of).collect() }
}
