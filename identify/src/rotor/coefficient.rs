//! y = c w^2 from plateaus: T = c_T w^2 (thesis eq. 3.1) and Q = c_Q w^2 (eq. 3.2).

use serde::Serialize;

use super::score::{LEVEL, Score};
use crate::numbers::statistics::{Estimate, jackknife};

/// Plateaus that a fit needs.
pub const PLATEAUS_MIN: usize = 4;

/// A mean square speed in (rad/s)^2 and the mean thrust or torque there, tare taken off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Mean of w^2.
    pub squared: f64,
    /// Mean thrust in N or torque in N*m.
    pub force: f64,
    /// Number of its log: the plateaus of a log share a tare.
    pub log: usize,
}

/// A coefficient, and how well the law fits.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coefficient {
    /// c, in N/(rad/s)^2 or N*m/(rad/s)^2.
    pub value: Estimate,
    /// p of y ~ w^p: the law says 2.
    pub exponent: Estimate,
    /// y at w = 0 of the line y = b + c w^2, which after the tare should be 0; in N or N*m.
    pub intercept: Estimate,
    /// y / w^2 at the slowest plateau.
    pub at_slowest: f64,
    /// y / w^2 at the fastest plateau.
    pub at_fastest: f64,
    /// Plateaus fitted.
    pub plateaus: usize,
    /// Errors on the plateaus that were held out, in N or N*m.
    pub held_out: Option<Score>,
}

impl Coefficient {
    /// Least squares over plateaus, each one vote; `None` with too few. Intervals come from leaving out one
    /// plateau after the other, since readings of one plateau are correlated. They include the standard error
    /// of each log's tare, in `tare_sigmas`, which all of its plateaus share.
    pub fn fitted(fit: &[Point], test: &[Point], tare_sigmas: &[f64]) -> Option<Self> {
        let speed = |point: &&Point| point.squared;
        let ratio = |point: &Point| point.force / point.squared;
        if fit.len() < PLATEAUS_MIN {
            return None;
        }
        let slowest = fit.iter().min_by(|a, b| speed(a).total_cmp(&speed(b)))?;
        let fastest = fit.iter().max_by(|a, b| speed(a).total_cmp(&speed(b)))?;
        let c = slope_through_zero(fit);
        let pairs: Vec<_> = test.iter().map(|point| (c * point.squared, point.force)).collect();
        Some(Self {
            value: estimated(fit, tare_sigmas, slope_through_zero),
            exponent: estimated(fit, tare_sigmas, exponent),
            intercept: estimated(fit, tare_sigmas, intercept),
            at_slowest: ratio(slowest),
            at_fastest: ratio(fastest),
            plateaus: fit.len(),
            held_out: Score::of(&pairs),
        })
    }
}

/// An estimate from plateaus with the interval of leaving out one after the other and of the tares.
fn estimated(points: &[Point], tare_sigmas: &[f64], estimate: impl Fn(&[Point]) -> f64) -> Estimate {
    let blocks = jackknifed(points, &estimate);
    let with_tare = |(log, sigma): (usize, &f64)| {
        let shift = |point: &Point| if point.log == log { *sigma } else { 0.0 };
        let shifted: Vec<Point> =
            points.iter().map(|point| Point { force: point.force + shift(point), ..*point }).collect();
        estimate(&shifted) - blocks.value
    };
    let squares: f64 = tare_sigmas.iter().enumerate().map(with_tare).map(|change| change * change).sum();
    blocks.with_error(squares.sqrt(), LEVEL)
}

/// An estimate from `points` with the interval of leaving out one after the other.
pub fn jackknifed<T: Copy>(points: &[T], estimate: impl Fn(&[T]) -> f64) -> Estimate {
    let without = |left_out: usize| {
        let others: Vec<T> = points
            .iter()
            .enumerate()
            .filter(|(index, _)| *index != left_out)
            .map(|(_, point)| *point)
            .collect();
        estimate(&others)
    };
    let without_one: Vec<f64> = (0..points.len()).map(without).collect();
    jackknife(estimate(points), &without_one, LEVEL)
}

/// The line y = intercept + slope x of least squares.
pub fn line(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    let mean_x = points.iter().map(|(x, _)| x).sum::<f64>() / n;
    let mean_y = points.iter().map(|(_, y)| y).sum::<f64>() / n;
    let xy: f64 = points.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    let xx: f64 = points.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
    (mean_y - xy / xx * mean_x, xy / xx)
}

fn slope_through_zero(points: &[Point]) -> f64 {
    let products: f64 = points.iter().map(|point| point.squared * point.force).sum();
    let squares: f64 = points.iter().map(|point| point.squared.powi(2)).sum();
    products / squares
}

fn intercept(points: &[Point]) -> f64 {
    line(&points.iter().map(|point| (point.squared, point.force)).collect::<Vec<_>>()).0
}

/// The slope of ln y over ln w, as far as y has a logarithm.
fn exponent(points: &[Point]) -> f64 {
    let positive = points.iter().filter(|point| point.force > 0.0);
    line(&positive.map(|point| (0.5 * libm::log(point.squared), libm::log(point.force))).collect::<Vec<_>>())
        .1
}
