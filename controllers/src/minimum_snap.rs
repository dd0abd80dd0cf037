//! Minimum-snap paths through waypoints, from rest to rest.
//!
//! Among all paths that meet the waypoints at given times, one has the least integral of squared snap. It is
//! a polynomial of degree 7 between waypoints, and its first six derivatives are continuous in them: the
//! Euler–Lagrange equation of the integral makes the eighth derivative vanish, and the free derivatives at a
//! waypoint settle the rest (D. Mellinger and V. Kumar, "Minimum snap trajectory generation and control for
//! quadrotors", ICRA 2011, solve the same problem as a quadratic programme). Without inequalities it is a
//! system of linear equations, solved once at the start. Each leg has a time of its own from 0 to 1, which
//! keeps the system well conditioned.
#![allow(
    clippy::disallowed_types,
    reason = "a system that is factorised, and no product: see the decision on numbers"
)]

use crate::curve::Path;
use nalgebra::{DMatrix, SMatrix, Vector3};

/// Coefficients of a polynomial of degree 7.
const COEFFICIENTS: usize = 8;

/// Greatest residual of the solved equations, relative to the greatest coordinate.
const RESIDUAL_MAX: f64 = 1e-9;

/// A path through waypoints.
#[derive(Debug, Clone, PartialEq)]
pub struct MinimumSnap {
    legs: Vec<Leg>,
}

/// The path between two waypoints.
#[derive(Debug, Clone, PartialEq)]
struct Leg {
    start_s: f64,
    span_s: f64,
    /// Coefficients of rising powers of the leg's own time, one column for each axis.
    coefficients_W: SMatrix<f64, COEFFICIENTS, 3>,
}

impl MinimumSnap {
    /// The path through `waypoints_W_m`, at least two, with `spans_s` between them; `None` where the equations have no
    /// accurate solution, because the spans differ by too much.
    pub fn new(waypoints_W_m: &[Vector3<f64>], spans_s: &[f64]) -> Option<Self> {
        let (matrix, right) = equations(waypoints_W_m, spans_s);
        let solution = matrix.clone().lu().solve(&right)?;
        let residual = (&matrix * &solution - &right).amax();
        if residual.is_nan() || residual > RESIDUAL_MAX * right.amax().max(1.0) {
            return None;
        }
        let mut start_s = 0.0;
        let legs = spans_s.iter().enumerate().map(|(leg, &span_s)| {
            let coefficients_W = solution.fixed_view::<COEFFICIENTS, 3>(leg * COEFFICIENTS, 0).into();
            let leg = Leg { start_s, span_s, coefficients_W };
            start_s += span_s;
            leg
        });
        Some(Self { legs: legs.collect() })
    }

    /// Returns the duration of the whole, s.
    pub fn duration_s(&self) -> f64 {
        self.legs.iter().map(|leg| leg.span_s).sum()
    }

    /// The point and its derivatives `time_s` after the start, a time within the path.
    pub fn at(&self, time_s: f64) -> Path {
        let next = self.legs.partition_point(|leg| leg.start_s <= time_s);
        self.legs[next.saturating_sub(1)].at(time_s)
    }
}

impl Leg {
    fn at(&self, time_s: f64) -> Path {
        let leg_time = ((time_s - self.start_s) / self.span_s).clamp(0.0, 1.0);
        std::array::from_fn(|order| {
            let row = powers(leg_time, order) / self.span_s.powi(order as i32);
            (row * self.coefficients_W).transpose()
        })
    }
}

/// The derivative of that order of every power of `time`.
fn powers(time: f64, order: usize) -> SMatrix<f64, 1, COEFFICIENTS> {
    SMatrix::from_fn(|_, power| {
        let falling: usize = (0..order).map(|n| power.saturating_sub(n)).product();
        if power < order { 0.0 } else { falling as f64 * time.powi((power - order) as i32) }
    })
}

/// Eight equations for each leg: both of its ends, rest at the path's ends, six continuous derivatives between legs.
fn equations(waypoints_W_m: &[Vector3<f64>], spans_s: &[f64]) -> (DMatrix<f64>, DMatrix<f64>) {
    let size = COEFFICIENTS * spans_s.len();
    let mut system = System { matrix: DMatrix::zeros(size, size), right: DMatrix::zeros(size, 3), row: 0 };
    for (leg, ends) in waypoints_W_m.windows(2).enumerate() {
        system.add(&[(leg, powers(0.0, 0))], &ends[0]);
        system.add(&[(leg, powers(1.0, 0))], &ends[1]);
    }
    let last = spans_s.len() - 1;
    for order in 1..=3 {
        system.add(&[(0, powers(0.0, order))], &Vector3::zeros());
        system.add(&[(last, powers(1.0, order))], &Vector3::zeros());
    }
    for (leg, spans_s) in spans_s.windows(2).enumerate() {
        for order in 1..=6 {
            let ratio = (spans_s[0] / spans_s[1]).powi(order as i32);
            system
                .add(&[(leg, powers(1.0, order)), (leg + 1, powers(0.0, order) * -ratio)], &Vector3::zeros());
        }
    }
    (system.matrix, system.right)
}

/// Equations that are gathered row by row.
struct System {
    matrix: DMatrix<f64>,
    right: DMatrix<f64>,
    row: usize,
}

impl System {
    fn add(&mut self, parts: &[(usize, SMatrix<f64, 1, COEFFICIENTS>)], right: &Vector3<f64>) {
        for (leg, row) in parts {
            self.matrix.fixed_view_mut::<1, COEFFICIENTS>(self.row, leg * COEFFICIENTS).copy_from(row);
        }
        self.right.row_mut(self.row).copy_from(&right.transpose());
        self.row += 1;
    }
}

/// Times between waypoints at this mean speed, of a point on the straight lines. It gains speed evenly over
/// the first quarter of the time, keeps it, and loses it over the last quarter.
pub fn spans_at_mean_speed(waypoints_W_m: &[Vector3<f64>], mean_speed_m_s: f64) -> Vec<f64> {
    let lengths_m: Vec<f64> = waypoints_W_m.windows(2).map(|ends| (ends[1] - ends[0]).norm()).collect();
    let total_m: f64 = lengths_m.iter().sum();
    let total_s = total_m / mean_speed_m_s;
    let (mut covered_m, mut passed_s) = (0.0, 0.0);
    let span = |length_m: &f64| {
        covered_m += length_m;
        let time_s = total_s * trapezoid_time(covered_m / total_m);
        let span_s = time_s - passed_s;
        passed_s = time_s;
        span_s
    };
    lengths_m.iter().map(span).collect()
}

/// The part of the time in which the point covers this part of the way. Its speed rises to 4/3 of the mean: in the
/// first quarter of the time it covers a sixth of the way.
fn trapezoid_time(part: f64) -> f64 {
    let rise = |part: f64| (part.max(0.0) * 3.0 / 8.0).sqrt();
    if part < 1.0 / 6.0 {
        rise(part)
    } else if part > 5.0 / 6.0 {
        1.0 - rise(1.0 - part)
    } else {
        0.25 + (part - 1.0 / 6.0) * 0.75
    }
}
