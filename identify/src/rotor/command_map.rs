//! The line from the command to the steady speed, as a vehicle file has it.

use serde::Serialize;

use super::coefficient::{jackknifed, line};
use super::score::Score;
use super::step::Hold;
use crate::numbers::statistics::Estimate;

/// Holds that a line needs.
const HOLDS_MIN: usize = 3;

/// The line between the smallest and the largest command that was held.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CommandLine {
    /// Smallest command, in the log's unit.
    pub min: f64,
    /// Largest command.
    pub max: f64,
    /// The line's speed at the smallest command, in rad/s.
    pub speed_at_min_rad_s: Estimate,
    /// The line's speed at the largest command, in rad/s.
    pub speed_at_max_rad_s: Estimate,
    /// True if the motor stood still at a command of 0.
    pub zero_is_off: bool,
    /// The command at which the line misses most, and by how much (measured minus line), in rad/s.
    pub worst: (f64, f64),
    /// Errors on the holds that were held out, in rad/s.
    pub held_out: Option<Score>,
}

impl CommandLine {
    /// Least squares over the holds that are not held out; `None` with too few.
    pub fn fitted(holds: &[Hold], zero_is_off: bool) -> Option<Self> {
        let points: Vec<(f64, f64)> =
            holds.iter().filter(|hold| !hold.is_test).map(|hold| (hold.command, hold.speed_rad_s)).collect();
        if points.len() < HOLDS_MIN {
            return None;
        }
        let min = holds.iter().map(|hold| hold.command).fold(f64::INFINITY, f64::min);
        let max = holds.iter().map(|hold| hold.command).fold(0.0, f64::max);
        let at = |points: &[(f64, f64)], command: f64| {
            let (intercept, slope) = line(points);
            intercept + slope * command
        };
        let error = |hold: &Hold| (hold.command, hold.speed_rad_s - at(&points, hold.command));
        let worst = holds.iter().map(error).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        let tests = holds.iter().filter(|hold| hold.is_test);
        let pairs: Vec<_> = tests.map(|hold| (at(&points, hold.command), hold.speed_rad_s)).collect();
        Some(Self {
            min,
            max,
            speed_at_min_rad_s: jackknifed(&points, |points| at(points, min)),
            speed_at_max_rad_s: jackknifed(&points, |points| at(points, max)),
            zero_is_off,
            worst,
            held_out: Score::of(&pairs),
        })
    }
}
