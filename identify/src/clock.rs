//! The grid of instants on which measured and modelled quantities are compared, and clocks that are late on it.

/// Instants at equal steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// The first instant, in the flight's time.
    pub start_s: f64,
    /// Time between two instants.
    pub step_s: f64,
    /// Number of instants.
    pub count: usize,
}

impl Clock {
    /// The instants from `start_s` to `end_s`.
    pub fn spanning(start_s: f64, end_s: f64, step_s: f64) -> Self {
        let steps = ((end_s - start_s) / step_s + 1e-9).floor().max(0.0);
        Self { start_s, step_s, count: steps as usize + 1 }
    }

    /// Instant `index`.
    pub fn at(&self, index: usize) -> f64 {
        self.start_s + index as f64 * self.step_s
    }
}

/// Lateness that is removed from the clocks of one flight.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lateness {
    /// Lateness of the attitude in s.
    pub attitude_s: f64,
    /// Lateness of the position in s.
    pub position_s: f64,
    /// Lateness of the velocity in s.
    pub velocity_s: f64,
    /// Lateness of the rotor speeds in s.
    pub rotor_speed_s: f64,
}
