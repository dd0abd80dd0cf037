//! Covariance of a residual: the noise of each component, and the trims of the flights.
//!
//! A flight's trim is a constant force and torque that it alone has: a propeller that was changed, a battery that was
//! strapped on differently. It is a random effect: the flights themselves show its spread. So the part that
//! all flights share is separated from the part of each flight alone. Rows are freed of the part of their
//! mean that the spread explains: quasi-demeaning (Fuller and Battese, J. Econometrics 2, 1974), of which
//! nothing and the whole mean are the ends.
//!
//! A force that no effect explains acts at a lever and turns the vehicle too. The part of a torque residual that force residuals predict is
//! subtracted first (`lever`).

use crate::data::prepared::{BOX_STEPS, Equation, Prepared};
use crate::model::noise_model::NoiseModel;
use std::collections::BTreeMap;

/// A component of an equation: its name and axis.
pub type Component = (&'static str, usize);

/// The noise of one component.
#[derive(Debug, Clone, PartialEq)]
pub struct ComponentNoise {
    /// The noise within a flight.
    pub model: NoiseModel,
    /// Variance of the flights' trims.
    pub trim_variance: f64,
    /// Components whose residuals at the same moment predict a part of this one's, and by how much.
    pub given: Vec<(Component, f64)>,
}

impl ComponentNoise {
    /// Noise without trims.
    pub fn of(model: NoiseModel) -> Self {
        Self { model, trim_variance: 0.0, given: Vec::new() }
    }
}

/// The noise of all components.
pub type Noises = BTreeMap<Component, ComponentNoise>;

/// The components of the rows of one knot.
pub fn components(flight: &Prepared) -> impl Iterator<Item = Component> {
    let equations = flight.layout.equations.iter();
    equations.flat_map(|equation| (0..equation.size()).map(|axis| (equation.name(), axis)))
}

/// True for components that can have a trim: constant forces, torques and biases of sensors.
pub fn has_trim(component: Component) -> bool {
    // The name is the same for any number of rotors.
    component.0 != Equation::RotorSpeed(0).name()
}

/// First knot of each stretch without a gap, and the one behind its last.
pub fn stretches(flight: &Prepared) -> Vec<(usize, usize)> {
    let knots = &flight.layout.knots;
    let mut first = 0;
    let next = |stretch: &[usize]| {
        first += stretch.len();
        (first - stretch.len(), first)
    };
    knots.chunk_by(|a, b| b - a == BOX_STEPS).map(next).collect()
}

/// The whitening of the rows of one flight.
pub struct Whitening<'n> {
    width: usize,
    stretches: Vec<(usize, usize)>,
    components: Vec<Option<&'n ComponentNoise>>,
    /// By component: places in a knot's rows of those that it is given, and the factors.
    given: Vec<Vec<(usize, f64)>>,
    trims: Vec<TrimColumn>,
}

/// A trim of one, as it shows in the rows of its component.
struct TrimColumn {
    offset: usize,
    /// The whitened trim, by knot.
    column: Vec<f64>,
    /// Sum of its squares.
    squares: f64,
    /// The part of it that is taken off.
    part: f64,
    variance: f64,
    weight: f64,
}

impl<'n> Whitening<'n> {
    /// The whitening of `flight` by `noises`.
    pub fn of(flight: &Prepared, noises: &'n Noises) -> Self {
        let names: Vec<Component> = components(flight).collect();
        let components: Vec<_> = names.iter().map(|component| noises.get(component)).collect();
        let place = |of: &(Component, f64)| Some((names.iter().position(|name| *name == of.0)?, of.1));
        let places = |noise: &Option<&ComponentNoise>| -> Vec<(usize, f64)> {
            noise.map_or(Vec::new(), |noise| noise.given.iter().filter_map(place).collect())
        };
        let given = components.iter().map(places).collect();
        let (width, stretches) = (flight.width(), stretches(flight));
        let mut whitening = Self { width, stretches, components, given, trims: Vec::new() };
        let with_trims =
            |noise: &Option<&ComponentNoise>| noise.is_some_and(|noise| noise.trim_variance > 0.0);
        let offsets = (0..width).filter(|offset| with_trims(&whitening.components[*offset]));
        let trims = offsets.filter_map(|offset| whitening.trim(offset, flight.layout.knots.len())).collect();
        whitening.trims = trims;
        whitening
    }

    fn trim(&self, offset: usize, knots: usize) -> Option<TrimColumn> {
        let noise = self.components[offset]?;
        let mut column = vec![1.0; knots];
        self.stretches.iter().for_each(|(first, end)| noise.model.whiten(&mut column[*first..*end], 1));
        let squares: f64 = column.iter().map(|value| value * value).sum();
        let (variance, weight) = (noise.trim_variance, noise.model.weight());
        let part = 1.0 - 1.0 / (1.0 + variance * weight * squares).sqrt();
        (squares > 0.0).then_some(TrimColumn { offset, column, squares, part, variance, weight })
    }

    /// Puts the innovations in place of `rows`, without the part of their means that trims explain.
    pub fn apply(&self, rows: &mut [f64]) {
        for (offset, given) in self.given.iter().enumerate().filter(|(_, given)| !given.is_empty()) {
            for knot in rows.chunks_exact_mut(self.width) {
                knot[offset] -= given.iter().map(|(at, factor)| factor * knot[*at]).sum::<f64>();
            }
        }
        for (offset, noise) in self.components.iter().enumerate() {
            let Some(noise) = noise else { continue };
            for (first, end) in &self.stretches {
                noise.model.whiten(&mut rows[first * self.width + offset..end * self.width], self.width);
            }
        }
        for trim in &self.trims {
            let share = trim.part * self.along(trim, rows) / trim.squares;
            let of_component = rows[trim.offset..].iter_mut().step_by(self.width);
            of_component.zip(&trim.column).for_each(|(row, one)| *row -= share * one);
        }
    }

    fn along(&self, trim: &TrimColumn, rows: &[f64]) -> f64 {
        rows[trim.offset..].iter().step_by(self.width).zip(&trim.column).map(|(row, one)| row * one).sum()
    }

    /// For each trim, the standard deviation of the gradient that it makes along each of the whitened `columns`. Blocks
    /// of time share a flight's trim, and do not show this.
    pub fn trim_gradients(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let of_trim = |trim: &TrimColumn| {
            let scale = trim.variance.sqrt() * trim.weight * (1.0 - trim.part);
            columns.iter().map(|column| scale * self.along(trim, column)).collect()
        };
        self.trims.iter().map(of_trim).collect()
    }
}

/// Mean of one flight's component by generalised least squares, and its variance under the noise alone; `None` without
/// noise.
pub fn mean(column: &[f64], stretches: &[(usize, usize)], model: &NoiseModel) -> Option<(f64, f64)> {
    let (mut ones, mut rows) = (vec![1.0; column.len()], column.to_vec());
    for (first, end) in stretches {
        model.whiten(&mut ones[*first..*end], 1);
        model.whiten(&mut rows[*first..*end], 1);
    }
    let squares: f64 = ones.iter().map(|one| one * one).sum();
    let along: f64 = ones.iter().zip(&rows).map(|(one, row)| one * row).sum();
    let variance = 1.0 / (model.weight() * squares);
    variance.is_finite().then_some((along / squares, variance))
}

/// Variance of the trims of which these are the means with their variances, by their moments (DerSimonian and Laird,
/// Controlled Clinical Trials 7, 1986): one for several `components` whose trims are alike. 0 of one flight.
pub fn spread(components: &[Vec<(f64, f64)>]) -> f64 {
    let moments = components.iter().filter(|means| means.len() > 1).map(|means| moments(means));
    let (excess, scale) = moments.fold((0.0, 0.0), |sum, of| (sum.0 + of.0, sum.1 + of.1));
    if scale > 0.0 { (excess / scale).max(0.0) } else { 0.0 }
}

/// Excess of the weighted scatter of means over its expectation, and the derivative of that expectation by the variance of the trims.
fn moments(means: &[(f64, f64)]) -> (f64, f64) {
    let weights: Vec<f64> = means.iter().map(|(_, variance)| 1.0 / variance).collect();
    let total: f64 = weights.iter().sum();
    let centre = means.iter().zip(&weights).map(|((mean, _), weight)| mean * weight).sum::<f64>() / total;
    let scatter: f64 =
        means.iter().zip(&weights).map(|((mean, _), weight)| weight * (mean - centre).powi(2)).sum();
    let scale = total - weights.iter().map(|weight| weight * weight).sum::<f64>() / total;
    (scatter - (means.len() - 1) as f64, scale)
}

#[cfg(test)]
mod tests {
    use super::spread;

    #[test]
    fn the_spread_of_known_means_is_found() {
        let means: Vec<(f64, f64)> =
            [1.0, -1.0, 3.0, -3.0, 0.0].into_iter().map(|mean| (mean, 0.5)).collect();
        // Their own variance is 5, of which the means' is 0.5.
        let own = spread(std::slice::from_ref(&means));
        assert!((own - 4.5).abs() < 1e-12, "{own}");
        assert_eq!(spread(&[means[..1].to_vec()]), 0.0);
        assert_eq!(spread(&[vec![(1.0, 4.0), (1.5, 4.0)]]), 0.0);
    }

    /// Two flights that agree in one of two alike components by chance do not show that there are no trims.
    #[test]
    fn components_that_are_alike_share_their_spread() {
        let (agree, differ) = (vec![(0.4, 1e-4); 2], vec![(0.1, 1e-4), (0.6, 1e-4)]);
        let own = spread(std::slice::from_ref(&differ));
        let shared = spread(&[agree.clone(), differ]);
        assert_eq!(spread(&[agree]), 0.0);
        assert!((2.0 * shared - (own - 1e-4)).abs() < 1e-9, "{shared} {own}");
    }
}
