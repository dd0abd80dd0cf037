//! The trim that one flight alone has, as its past shows it.
//!
//! A trim is a constant among coloured noise. Over flights it is a random effect with mean zero: the model has what all flights share. So its best
//! estimate is the posterior mean under the spread of the trims, Σ x y / (Σ x² + σ² / τ²). Here y are the innovations of a component up to a
//! moment, and x those of a constant of one. Their variance is σ², and that of the trims is τ². The source is Searle, Casella and McCulloch, Variance
//! Components (1992), section 7.4. docs/decisions/058-own-trims.md has what this replaced.

use crate::model::noise_model::NoiseModel;
use crate::model::whitening::spread;

/// Variance of the trims about the model, by the means of flights with their variances: a list for each of several components that are alike. A
/// fit has taken the common part off, so that it is at least the variance about the centre. What the noise alone makes is subtracted.
pub fn variance(components: &[Vec<(f64, f64)>]) -> f64 {
    let (mut excess, mut scale) = (0.0, 0.0);
    for (mean, variance) in components.iter().flatten() {
        excess += mean * mean / variance - 1.0;
        scale += 1.0 / variance;
    }
    let about_the_model = if scale > 0.0 { (excess / scale).max(0.0) } else { 0.0 };
    about_the_model.max(spread(components))
}

/// Estimates of the trim by knot, each from the residuals `column` up to its own: 0 where trims have no `variance`. The noise of `model` begins anew in
/// each of the `stretches`.
pub fn estimates(
    column: &[f64],
    stretches: &[(usize, usize)],
    model: &NoiseModel,
    variance: f64,
) -> Vec<f64> {
    let weight = model.weight();
    if variance <= 0.0 || weight <= 0.0 {
        return vec![0.0; column.len()];
    }
    let (mut ones, mut rows) = (vec![1.0; column.len()], column.to_vec());
    for (first, end) in stretches {
        model.whiten(&mut ones[*first..*end], 1);
        model.whiten(&mut rows[*first..*end], 1);
    }
    let (mut along, mut squares) = (0.0, 1.0 / (weight * variance));
    let at_knot = |(one, row): (&f64, &f64)| {
        along += one * row;
        squares += one * one;
        along / squares
    };
    ones.iter().zip(&rows).map(at_knot).collect()
}

#[cfg(test)]
mod tests {
    use super::{estimates, variance};
    use crate::model::noise_model::{NoiseModel, Products};
    use crate::model::whitening::mean;
    use component::random;

    const KNOTS: usize = 200;
    const KNOWN: usize = 19;

    /// Residuals of flights: a trim of this deviation and noise that remembers itself, and the trims.
    fn flights(seed: u64, count: usize, deviation: f64) -> Vec<(Vec<f64>, f64)> {
        let mut random = random::stream(seed, "trims");
        let flight = |_| {
            let trim = deviation * random::normal(&mut random);
            let mut noise = 0.0;
            let mut column = vec![0.0; KNOTS];
            for row in &mut column {
                noise = 0.8 * noise + random::normal(&mut random);
                *row = trim + noise;
            }
            (column, trim)
        };
        (0..count).map(flight).collect()
    }

    fn fitted(flights: &[(Vec<f64>, f64)]) -> (NoiseModel, f64) {
        let mut products = Products::default();
        for (column, _) in flights {
            let centre = column.iter().sum::<f64>() / KNOTS as f64;
            products.add(&column.iter().map(|row| row - centre).collect::<Vec<_>>());
        }
        let model = products.model();
        let means = flights.iter().filter_map(|(column, _)| mean(column, &[(0, KNOTS)], &model)).collect();
        let variance = variance(&[means]);
        (model, variance)
    }

    #[test]
    fn a_second_of_a_flight_tells_its_trim_better_than_its_mean_does() {
        let (mut own, mut plain) = (0.0, 0.0);
        for seed in 0..40 {
            let (model, variance) = fitted(&flights(seed, 8, 1.0));
            for (column, trim) in flights(1000 + seed, 8, 1.0) {
                let estimate = estimates(&column, &[(0, KNOTS)], &model, variance)[KNOWN];
                let mean = column[..=KNOWN].iter().sum::<f64>() / (KNOWN + 1) as f64;
                own += (estimate - trim).powi(2);
                plain += (mean - trim).powi(2);
            }
        }
        // The mean of so many rows varies by 0.98, the trims by 1: shrinking halves the squares.
        assert!(own < 0.7 * plain, "{own} {plain}");
    }

    #[test]
    fn the_variance_is_that_of_the_trims_and_none_where_flights_have_none() {
        let found: Vec<f64> = (0..40).map(|seed| fitted(&flights(seed, 12, 3.0)).1).collect();
        let mean = found.iter().sum::<f64>() / 40.0;
        assert!((7.5..11.0).contains(&mean), "{mean}, of 9");
        let none: Vec<f64> = (0..40).map(|seed| fitted(&flights(seed, 12, 0.0)).1).collect();
        assert!(none.iter().sum::<f64>() / 40.0 < 0.1, "{none:?}");
        let (column, model) = (vec![1.0; 10], NoiseModel::white(1.0));
        assert_eq!(estimates(&column, &[(0, 10)], &model, 0.0), [0.0; 10]);
    }

    #[test]
    fn white_noise_has_the_mean_shrunk_by_the_ratio_of_the_variances_and_only_the_past_counts() {
        let (model, column) = (NoiseModel::white(4.0), [3.0, 5.0, 100.0]);
        let found = estimates(&column, &[(0, 3)], &model, 2.0);
        assert_eq!(found[..2], [3.0 / 3.0, 8.0 / 4.0]);
    }
}
