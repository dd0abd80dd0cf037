//! The offset in time between two channels: the one at which the squares of their difference are least.

use crate::numbers::normal::{self, Block};

/// Gauss-Newton steps.
const STEPS: usize = 40;
/// No step is longer: a linearisation of the motion holds for a fraction of its fastest oscillation.
const STEP_MAX_S: f64 = 0.02;
/// From fewer blocks no deviation can be told.
pub const LEAST_BLOCKS: usize = 5;
/// An offset is real beyond so many standard deviations.
const SURE: f64 = 4.0;

/// A channel that is later than this is not on the same flight.
pub const LATE_MAX_S: f64 = 0.4;

/// An offset that was found.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// Lateness, in s.
    pub late_s: f64,
    /// Its standard deviation.
    pub deviation_s: f64,
    /// Greatest bias due to the samples' positions on the grid.
    pub between_s: f64,
}

impl Found {
    /// True if its difference from `other` exceeds chance, the bias of both due to the grid, and `least_s`.
    pub fn is_beyond(&self, other: &Found, least_s: f64) -> bool {
        let own_s = (self.late_s - other.late_s).abs();
        let deviation_s = libm::hypot(self.deviation_s, other.deviation_s);
        own_s > SURE * deviation_s && own_s > least_s.max(self.between_s).max(other.between_s)
    }

    /// Returns the mean of the offsets; zero without any.
    pub fn mean(all: &[Found]) -> Found {
        let part = 1.0 / (all.len() as f64).max(1.0);
        Found {
            late_s: part * all.iter().map(|shift| shift.late_s).sum::<f64>(),
            deviation_s: part * all.iter().map(|shift| shift.deviation_s.powi(2)).sum::<f64>().sqrt(),
            between_s: all.iter().map(|shift| shift.between_s).fold(0.0, f64::max),
        }
    }
}

/// The offset at which the squares are least, searched from `start_s` on by the normal equations at an
/// offset. The offset is their first parameter. `None` beyond `most_s`.
pub fn descended(
    start_s: f64,
    most_s: f64,
    between_s: f64,
    mut blocks_at: impl FnMut(f64) -> Vec<Block>,
) -> Option<Found> {
    let (mut late_s, mut last_s, mut reach_s) = (start_s, 0.0_f64, STEP_MAX_S);
    for _ in 0..STEPS {
        let blocks = blocks_at(late_s);
        let total = normal::sum(&blocks);
        if blocks.len() < LEAST_BLOCKS || total.gram[(0, 0)] <= 0.0 {
            return None;
        }
        let step_s = -(normal::inverse(&total.gram) * &total.gradient)[0];
        let deviation_s = normal::covariance(&blocks)[(0, 0)].max(0.0).sqrt();
        // How samples lie on the grid makes waves in the cost, over whose troughs a whole step can go to and fro.
        if step_s * last_s < 0.0 {
            reach_s = last_s.abs() / 2.0;
        }
        last_s = step_s.clamp(-reach_s, reach_s);
        late_s += last_s;
        if late_s.abs() > most_s {
            return None;
        }
        if last_s.abs() < 1e-5_f64.max(0.02 * deviation_s) {
            return Some(Found { late_s, deviation_s, between_s });
        }
    }
    None
}
