//! An estimation problem: flights in their roles, beside the model that they are held against.

use crate::data::prepared::Prepared;
use crate::model::physics::Model;
use crate::model::whitening::Noises;

/// An estimation problem: flights, the model that they are held against, and how.
#[derive(Debug)]
pub struct Problem<'f> {
    /// The model.
    pub model: Model,
    /// Estimation data: flights that parameters are fitted on.
    pub estimation: Vec<Prepared<'f>>,
    /// Validation data: flights that effects are chosen on. Where there are none, they are chosen by cross-validation over
    /// blocks of the estimation data.
    pub validation: Vec<Prepared<'f>>,
    /// Test data: flights that errors are reported on, and that decide nothing.
    pub test: Vec<Prepared<'f>>,
    /// The noise of each component, by which its residual is whitened and weighed.
    pub noises: Noises,
    /// Length of the blocks that count as independent.
    pub block_s: f64,
    /// Mean lateness of the attitudes of the estimation data against the gyroscopes, in s: a fit of their delay
    /// starts there.
    pub shared_late_s: f64,
}

impl<'f> Problem<'f> {
    /// Iterates over all flights, the estimation data first.
    pub fn flights(&self) -> impl Iterator<Item = &Prepared<'f>> {
        self.estimation.iter().chain(&self.validation).chain(&self.test)
    }

    /// The same, to be changed.
    pub fn flights_mut(&mut self) -> impl Iterator<Item = &mut Prepared<'f>> {
        self.estimation.iter_mut().chain(&mut self.validation).chain(&mut self.test)
    }

    /// The shortest delay that the grids can tell from zero.
    pub fn least_delay_s(&self) -> f64 {
        0.5 * self.flights().map(|flight| flight.layout.clock.step_s).fold(0.0, f64::max)
    }
}
