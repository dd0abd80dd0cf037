//! The noise of an estimation problem: the residual of each component when all candidates have taken their
//! step.
#![allow(
    clippy::disallowed_types,
    reason = "not in a component: reports of flights, whose products are summed by hand"
)]
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::data::prepared::{Equation, Prepared};
use crate::model::flight_wind::FLIGHT_WIND;
use crate::model::noise_model::Products;
use crate::model::problem::Problem;
use crate::model::whitening::{
    Component, ComponentNoise, Noises, components, has_trim, mean, spread, stretches,
};
use crate::numbers::normal;
use crate::search::candidate::Candidate;
use crate::search::fit_result::FitResult;
use crate::search::lever::{Moments, factors};
use nalgebra::{DVector, Vector3};
use std::collections::BTreeMap;

/// Residual of one component of a flight.
struct Left {
    column: Vec<f64>,
    stretches: Vec<(usize, usize)>,
    /// Sum of the squares of the measured values.
    signal: f64,
}

/// Means of a component in each flight, with their variances.
type Means = Vec<(f64, f64)>;

/// The noise of one component without the spread of its trims, and its means if they are each flight's own.
fn noise_of(flights: &[Left], is_own: bool, is_white: bool) -> (ComponentNoise, Means) {
    let mut products = Products::default();
    for Left { column, stretches, signal } in flights {
        let centre = if is_own { column.iter().sum::<f64>() / column.len().max(1) as f64 } else { 0.0 };
        for (first, end) in stretches {
            let rows: Vec<f64> = column[*first..*end].iter().map(|row| row - centre).collect();
            products.add(&rows);
        }
        products.add_white(LEAST_NOISE * LEAST_NOISE * signal);
    }
    let model = if is_white { products.white() } else { products.model() };
    let means = flights.iter().filter(|_| is_own);
    let means = means.filter_map(|left| mean(&left.column, &left.stretches, &model)).collect();
    (ComponentNoise::of(model), means)
}

/// Sets the spread of the trims of each component. Torques about x and y come from the same propellers and batteries: they
/// share theirs, since two flights often agree about one axis by chance. A tilted sensor or a shifted battery causes no greater force across the thrust
/// than [`MOST_TRIM_M_S2`]: a wind or another effect has to explain the rest.
fn set_spreads(noises: &mut Noises, means: &BTreeMap<Component, Means>) {
    let tilting = [0, 1].map(|axis| (Equation::AngularAcceleration.name(), axis));
    let across = [Equation::SpecificForce.name(), Equation::Acceleration.name()];
    for (component, noise) in noises {
        let alike = if tilting.contains(component) { &tilting[..] } else { std::slice::from_ref(component) };
        let spread = spread(&alike.iter().filter_map(|of| means.get(of).cloned()).collect::<Vec<_>>());
        let is_across = across.contains(&component.0) && component.1 < 2;
        noise.trim_variance = if is_across { spread.min(MOST_TRIM_M_S2.powi(2)) } else { spread };
    }
}

/// Greatest spread of the trims along x and y: gravity along an axis of a sensor that is tilted by its bound, 0.0524 rad (3°).
pub const MOST_TRIM_M_S2: f64 = 0.514;

/// A component without any noise would count infinitely: no sensor is better than this part of its own signal.
const LEAST_NOISE: f64 = 1e-4;

impl Problem<'_> {
    /// Sets the noises by what is left on the estimation data when, from `base` on, all of `candidates` take
    /// the step that fits best.
    pub fn weigh(&mut self, base: &FitResult, candidates: &[Candidate]) {
        let mut all = base.free.clone();
        // Torques of an assumed attitude are zero, to which any scale of thrust or inertia could shrink the model's.
        let is_assumed = self.estimation.iter().any(Prepared::is_assumed);
        let counts =
            |candidate: &&Candidate| candidate.kind.is_linear && (!is_assumed || candidate.is_trim());
        // Winds of flights explain any trims. Until they are accepted, these are noise: only what a constant force cannot explain shows a wind.
        let candidates = candidates.iter().filter(|candidate| *candidate.kind != FLIGHT_WIND);
        for candidate in candidates.filter(counts) {
            all.extend(candidate.free.iter().filter(|at| !base.free.contains(at)));
        }
        for _ in 0..2 {
            if self.noises.is_empty() {
                self.noises = self.noises_after(&base.values, &[], &DVector::zeros(0));
            }
            let total = normal::sum(&self.blocks(&self.estimation, &base.values, &all));
            let step = -(normal::inverse(&total.gram) * &total.gradient);
            self.noises = self.noises_after(&base.values, &all, &step);
        }
    }

    /// Gives the flights the trims that another fit leaves with a step of `candidates`, and keeps the noise within each flight.
    pub fn allow_trims_of(&mut self, base: &FitResult, candidates: &[Candidate]) {
        let models = self.noises.clone();
        self.weigh(base, candidates);
        for (component, noise) in &mut self.noises {
            if let Some(kept) = models.get(component) {
                *noise = ComponentNoise { trim_variance: noise.trim_variance, ..kept.clone() };
            }
        }
    }

    /// The noise of each component, and the spread of the flights' trims, after a step.
    fn noises_after(&self, values: &[f64], free: &[usize], step: &DVector<f64>) -> Noises {
        let mut left: BTreeMap<Component, Vec<Left>> = BTreeMap::new();
        for flight in &self.estimation {
            for (component, of_flight) in self.left_after(flight, values, free, step) {
                left.entry(component).or_default().push(of_flight);
            }
        }
        let is_assumed = self.estimation.iter().any(Prepared::is_assumed);
        let mut given = if is_assumed { BTreeMap::new() } else { self.take_off_forces(values, &mut left) };
        let mut means = BTreeMap::new();
        let noise = |(component, flights): (Component, Vec<Left>)| {
            let is_own = !is_assumed && flights.len() > 1 && has_trim(component);
            let given = given.remove(&component).unwrap_or_default();
            let (noise, of_flights) = noise_of(&flights, is_own, is_assumed);
            means.insert(component, of_flights);
            (component, ComponentNoise { given, ..noise })
        };
        let mut noises = left.into_iter().map(noise).collect();
        set_spreads(&mut noises, &means);
        noises
    }

    /// Residuals of each component of a flight after a step.
    fn left_after(
        &self,
        flight: &Prepared,
        values: &[f64],
        free: &[usize],
        step: &DVector<f64>,
    ) -> Vec<(Component, Left)> {
        let (mut left, columns) = self.linearised(flight, values, free);
        for (column, step) in columns.iter().zip(step.iter()) {
            left.iter_mut().zip(column).for_each(|(left, slope)| *left += slope * step);
        }
        let measured = &self.model.tracks(flight, values).rows;
        let width = flight.width();
        let of = |rows: &[f64], offset: usize| -> Vec<f64> {
            rows[offset..].iter().step_by(width).copied().collect()
        };
        let of_component = |(offset, component)| {
            let signal = of(measured, offset).iter().map(|row| row * row).sum();
            (component, Left { column: of(&left, offset), stretches: stretches(flight), signal })
        };
        components(flight).enumerate().map(of_component).collect()
    }

    /// Takes off the residuals of each torque what those of the forces predict of them, and returns the factors by torque.
    fn take_off_forces(
        &self,
        values: &[f64],
        left: &mut BTreeMap<Component, Vec<Left>>,
    ) -> BTreeMap<Component, Vec<(Component, f64)>> {
        let force = [0, 1, 2].map(|axis| (Equation::SpecificForce.name(), axis));
        let mut factors_of = BTreeMap::new();
        let [Some(x), Some(y), Some(z)] = force.map(|of| left.get(&of)) else { return factors_of };
        let torques = (0..3).map(|axis| (Equation::AngularAcceleration.name(), axis));
        // Every flight has all of these equations, or the forces would be of other moments.
        let is_whole = |flights: &Vec<Left>| flights.len() == self.estimation.len();
        if ![x, y, z].into_iter().all(is_whole) {
            return factors_of;
        }
        let forces: Vec<[Vec<f64>; 3]> =
            (0..x.len()).map(|at| [x, y, z].map(|flights| flights[at].column.clone())).collect();
        let velocities: Vec<Vec<[f64; 3]>> =
            self.estimation.iter().map(|flight| self.velocities_B(flight, values)).collect();
        let blocks: Vec<_> = self.estimation.iter().map(|flight| self.block_knots(flight)).collect();
        for component in torques {
            let Some(flights) = left.get_mut(&component).filter(|flights| is_whole(flights)) else {
                continue;
            };
            let moments = |at: usize| Moments {
                torque: &flights[at].column,
                forces: &forces[at],
                velocities: &velocities[at],
                blocks: &blocks[at],
            };
            let moments: Vec<Moments> = (0..flights.len()).map(moments).collect();
            let Some(found) = factors(&moments) else { continue };
            for (left, forces) in flights.iter_mut().zip(&forces) {
                for (at, row) in left.column.iter_mut().enumerate() {
                    *row -= (0..3).map(|axis| found[axis] * forces[axis][at]).sum::<f64>();
                }
            }
            factors_of.insert(component, force.into_iter().zip(found).collect());
        }
        factors_of
    }

    /// Velocities in B at the knots of a flight.
    fn velocities_B(&self, flight: &Prepared, values: &[f64]) -> Vec<[f64; 3]> {
        let tracks = self.model.tracks(flight, values);
        let of =
            |knot: &usize| (tracks.attitude[*knot].inverse() * Vector3::from(tracks.velocity[*knot])).into();
        flight.layout.knots.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::set_spreads;
    use crate::data::prepared::Equation;
    use crate::model::noise_model::NoiseModel;
    use crate::model::whitening::{Component, ComponentNoise, Noises};
    use std::collections::BTreeMap;

    const VARIANCE: f64 = 1e-4;

    #[test]
    fn torques_about_x_and_y_share_their_spread_and_every_other_component_has_its_own() {
        let torque = |axis| -> Component { (Equation::AngularAcceleration.name(), axis) };
        let force: Component = (Equation::SpecificForce.name(), 0);
        let means = |of: [f64; 2]| of.map(|mean| (mean, VARIANCE)).to_vec();
        let means = BTreeMap::from([
            (torque(0), means([0.4, 0.4])),
            (torque(1), means([0.1, 0.6])),
            (torque(2), means([1.0, 3.0])),
        ]);
        let before = ComponentNoise { trim_variance: 9.0, ..ComponentNoise::of(NoiseModel::white(1.0)) };
        let components = [torque(0), torque(1), torque(2), force];
        let mut noises: Noises = components.map(|component| (component, before.clone())).into();
        set_spreads(&mut noises, &means);
        // Two means vary by half the square of their difference; their own variance is a part of that.
        let own = |difference: f64| difference * difference / 2.0 - VARIANCE;
        let shared = f64::midpoint(own(0.0), own(0.5));
        for (component, expected) in components.into_iter().zip([shared, shared, own(2.0), 0.0]) {
            let found = noises[&component].trim_variance;
            assert!((found - expected).abs() < 1e-9, "{component:?}: {found}, expected {expected}");
            assert_eq!(noises[&component].model, before.model);
        }
    }
}
