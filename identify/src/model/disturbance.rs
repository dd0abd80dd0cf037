//! Disturbance observer: the force and torque that a model lacks, as they were seen up to a moment, and as they are expected to go on.
//!
//! The residual of each component is an autoregressive process (`noise_model`) about the flight's own trim (`own_trim`). Its best prediction from
//! the samples before is known by its coefficients (Box and Jenkins, Time Series Analysis, chapter 5; in the state space it is the
//! prediction of a Kalman filter with disturbance states). It begins at what was seen last, and decays to the trim.

use crate::data::prepared::{BOX_STEPS, Equation, Prepared};
use crate::data::rows::column;
use crate::data::sensing::SensorErrors;
use crate::model::forecast::{AddedAcceleration, Forecast};
use crate::model::noise_model::{NoiseModel, Products};
use crate::model::own_trim;
use crate::model::problem::Problem;
use crate::model::whitening::{mean, stretches};

/// While effects are searched for, a trim counts by the time that it was seen, against this time: about ten times that over which disturbances of
/// flights remember themselves; tuned, no source.
const SETTLED_S: f64 = 2.0;
/// Disturbances are expected for so long after the start of a window, in s: to the longest horizon of predictions.
const AHEAD_S: f64 = 1.0;

/// The colour of what a model leaves, by component of a push.
#[derive(Debug, Clone)]
pub struct DisturbanceModels([NoiseModel; 6]);

/// Variances of the flights' trims, by component of a push.
#[derive(Debug, Clone, Copy)]
pub struct TrimVariances([f64; 6]);

/// Components of a push whose trims are alike: torques about x and y, which the same propellers and batteries cause, forces along x and y, and each
/// other alone.
const ALIKE: [&[usize]; 6] = [&[0, 1], &[0, 1], &[2], &[3, 4], &[3, 4], &[5]];

impl DisturbanceModels {
    /// Those of the estimation data under `values`.
    pub fn of(problem: &Problem, values: &[f64]) -> Self {
        let mut products: [Products; 6] = Default::default();
        for flight in &problem.estimation {
            let stretches = stretches(flight);
            for (products, column) in products.iter_mut().zip(columns(problem, flight, values)) {
                let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
                let rows: Vec<f64> = column.iter().map(|row| row - mean).collect();
                stretches
                    .iter()
                    .filter_map(|(first, end)| rows.get(*first..*end))
                    .for_each(|rows| products.add(rows));
            }
        }
        Self(products.map(|products| products.model()))
    }
}

impl TrimVariances {
    /// Those of the estimation data under `values`, whose noise is that of `models`.
    pub fn of(problem: &Problem, models: &DisturbanceModels, values: &[f64]) -> Self {
        let mut means: [Vec<(f64, f64)>; 6] = Default::default();
        for flight in &problem.estimation {
            let stretches = stretches(flight);
            let columns = columns(problem, flight, values);
            for ((means, column), model) in means.iter_mut().zip(&columns).zip(&models.0) {
                means.extend((!column.is_empty()).then(|| mean(column, &stretches, model)).flatten());
            }
        }
        let alike = |of: &[usize]| of.iter().map(|at| means[*at].clone()).collect::<Vec<_>>();
        Self(ALIKE.map(|of| own_trim::variance(&alike(of))))
    }
}

/// Residuals of each component of a push, by knot; empty where the flight has no such equation.
fn columns(problem: &Problem, flight: &Prepared, values: &[f64]) -> [Vec<f64>; 6] {
    let residual = problem.model.residual_under(flight, values);
    let equations = [Equation::AngularAcceleration, Equation::Acceleration];
    std::array::from_fn(|at| column(flight, &residual, equations[at / 3], at % 3))
}

/// The disturbances of one flight as they were seen up to each moment.
#[derive(Debug, Default)]
pub struct Observed {
    /// Time from knot to knot, in s.
    knot_s: f64,
    /// Time from a knot to the last sample that its residual depends on, in s.
    lag_s: f64,
    /// Knots, in s.
    time_s: Vec<f64>,
    /// The first knot of the stretch without a gap that each knot is in.
    first: Vec<usize>,
    /// Residuals beyond the trim, by component and knot; empty where the flight does not show it.
    rows: [Vec<f64>; 6],
    /// The trim as it was known at each knot.
    trims: Vec<AddedAcceleration>,
}

impl Observed {
    /// The disturbances of `flight` under `values`.
    pub fn of(problem: &Problem, flight: &Prepared, values: &[f64]) -> Self {
        let rows = columns(problem, flight, values);
        let knot_s = BOX_STEPS as f64 * flight.layout.clock.step_s;
        let (mut sum, mut trims) = ([0.0; 6], Vec::new());
        for at in 0..flight.layout.knots.len() {
            sum.iter_mut().zip(&rows).for_each(|(sum, row)| *sum += row.get(at).copied().unwrap_or(0.0));
            trims.push(sum.map(|sum| sum / ((at + 1) as f64 + SETTLED_S / knot_s)));
        }
        let first = stretches(flight).into_iter().flat_map(|(first, end)| vec![first; end - first]).collect();
        // Knots stand at the stamps of the poses, windows at the times at which these were taken.
        let late_s = SensorErrors::of(&problem.model.parameters, values).pose_delay_s;
        let time_s = flight.layout.knots.iter().map(|knot| flight.layout.clock.at(*knot) - late_s).collect();
        Self { knot_s, lag_s: lag_s(flight), time_s, first, rows, trims }
    }

    /// The same about the best estimates of the trims of `flight`, which settle as fast as their `variances` allow. A search does without: such trims
    /// take what an effect is worth.
    pub fn about_own_trims(
        mut self,
        flight: &Prepared,
        models: &DisturbanceModels,
        variances: &TrimVariances,
    ) -> Self {
        let stretches = stretches(flight);
        let trims: [Vec<f64>; 6] = std::array::from_fn(|at| {
            let column = &self.rows[at];
            let stretches = if column.is_empty() { &[] } else { &stretches[..] };
            own_trim::estimates(column, stretches, &models.0[at], variances.0[at])
        });
        for (knot, trim) in self.trims.iter_mut().enumerate() {
            *trim = trims.each_ref().map(|trims| trims.get(knot).copied().unwrap_or(0.0));
        }
        self
    }

    /// The last knot that is known at `at_s`.
    fn last(&self, at_s: f64) -> Option<usize> {
        self.time_s.partition_point(|time_s| time_s + self.lag_s <= at_s).checked_sub(1)
    }

    /// The trim that was known at `at_s`.
    pub fn trim(&self, at_s: f64) -> Forecast {
        self.last(at_s).map_or(Forecast::none(), |last| Forecast::constant(self.trims[last]))
    }

    /// The disturbance as it was expected at `at_s` from then on.
    pub fn expected(&self, models: &DisturbanceModels, at_s: f64) -> Forecast {
        let Some(last) = self.last(at_s) else { return Forecast::none() };
        let (start_s, trim) = (self.time_s[last], self.trims[last]);
        // After a gap nothing is left of it but the trim.
        if at_s - start_s > self.lag_s + 2.0 * self.knot_s {
            return Forecast::constant(trim);
        }
        let count = ((at_s - start_s + AHEAD_S) / self.knot_s).ceil() as usize;
        let mut values = vec![trim; count + 1];
        for (at, (rows, model)) in self.rows.iter().zip(&models.0).enumerate() {
            let Some(past) = rows.get(self.first[last]..=last) else { continue };
            let past: Vec<f64> = past.iter().map(|row| row - trim[at]).collect();
            let away = past.last().copied().into_iter().chain(model.forecast(&past, count));
            values.iter_mut().zip(away).for_each(|(value, away)| value[at] += away);
        }
        Forecast { start_s, step_s: self.knot_s, values }
    }
}

/// Time from a knot to the last sample that its residual depends on, in s: the reach of the window, that of slopes of positions and rotor speeds, and two
/// samples of interpolation.
pub fn lag_s(flight: &Prepared) -> f64 {
    let periods_s = [flight.flight.attitude.period_s(), flight.flight.position.period_s()];
    let slowest_s = periods_s.into_iter().flatten().fold(0.0, f64::max);
    (flight.reach() + BOX_STEPS) as f64 * flight.layout.clock.step_s + 2.0 * slowest_s
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_course_is_straight_between_its_values_and_stays_at_the_last() {
        let forecast = Forecast { start_s: 1.0, step_s: 0.5, values: vec![[0.0; 6], [2.0; 6]] };
        let at = |time_s: f64| forecast.at(time_s)[4];
        assert_eq!([at(0.0), at(1.0), at(1.25), at(1.5), at(9.0)], [0.0, 0.0, 1.0, 2.0, 2.0]);
        assert_eq!((Forecast::none().at(3.0), Forecast::constant([1.0; 6]).at(3.0)), ([0.0; 6], [1.0; 6]));
    }

    #[test]
    fn what_was_seen_decays_to_the_trim_and_only_the_past_counts() {
        let knots = 400;
        let observed = Observed {
            knot_s: 0.05,
            lag_s: 0.1,
            time_s: (0..knots).map(|at| 0.05 * at as f64).collect(),
            first: vec![0; knots],
            // A step at the end.
            rows: std::array::from_fn(|at| {
                (0..knots).map(|knot| if at == 1 && knot > 380 { 5.0 } else { 1.0 }).collect()
            }),
            trims: vec![[1.0; 6]; knots],
        };
        let mut products = Products::default();
        // Autocovariance of a first-order process with 0.8 from knot to knot.
        let (mut row, mut seed) = (0.0, 1_u64);
        let mut next = || {
            // Knuth's linear congruential generator (MMIX).
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            row = 0.8 * row + (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
            row
        };
        let column: Vec<f64> = (0..4000).map(|_| next()).collect();
        products.add(&column);
        let models = DisturbanceModels(std::array::from_fn(|_| products.model()));
        // The step is at 19.05 s, and known 0.1 s later.
        let before = observed.expected(&models, 19.14);
        assert!(before.at(19.5).iter().all(|push| (push - 1.0).abs() < 1e-9), "the step is not known yet");
        let behind = observed.expected(&models, 19.951);
        assert!((behind.at(19.8)[1] - 5.0).abs() < 0.3, "{:?}", behind.at(19.85));
        assert!(behind.at(20.0)[1] < behind.at(19.9)[1]);
        assert!((behind.at(21.0)[1] - 1.0).abs() < 0.3, "{:?}", behind.at(21.0));
        assert!((behind.at(20.0)[0] - 1.0).abs() < 1e-9);
    }
}
