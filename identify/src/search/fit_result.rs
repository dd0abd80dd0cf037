//! The result of a fit: values, what is known of them, and what the data leave.
#![allow(
    clippy::disallowed_types,
    reason = "not in a component: reports of flights, whose products are summed by hand"
)]

use crate::numbers::normal;
use crate::numbers::statistics::student_quantile;
use nalgebra::{DMatrix, DVector};

/// Result of a fit.
#[derive(Debug, Clone)]
pub struct FitResult {
    /// Values of all parameters, those that were held included.
    pub values: Vec<f64>,
    /// The free parameters, which were fitted.
    pub free: Vec<usize>,
    /// Values that the equations would have them take if there were no bounds.
    pub unbounded: Vec<f64>,
    /// Covariance of the free parameters.
    pub covariance: DMatrix<f64>,
    /// Weighted sums of squares of the blocks of the validation data.
    pub validation_costs: Vec<f64>,
    /// Weighted sums of squares of the blocks of the estimation data.
    pub estimation_costs: Vec<f64>,
}

impl FitResult {
    /// Sum of the squares of the validation data.
    pub fn validation_cost(&self) -> f64 {
        self.validation_costs.iter().sum()
    }

    /// Sum of the squares of the estimation data.
    pub fn estimation_cost(&self) -> f64 {
        self.estimation_costs.iter().sum()
    }

    /// Standard error of a parameter; `None` where it was held.
    pub fn standard_error(&self, parameter: usize) -> Option<f64> {
        let at = self.free.iter().position(|free| *free == parameter)?;
        Some(self.covariance[(at, at)].max(0.0).sqrt())
    }

    /// Standard error of a sum of parameters, each times its factor; `None` where one of them was held.
    pub fn standard_error_of(&self, parts: &[(usize, f64)]) -> Option<f64> {
        let place = |(parameter, factor): &(usize, f64)| {
            Some((self.free.iter().position(|free| free == parameter)?, *factor))
        };
        let parts: Vec<(usize, f64)> = parts.iter().map(place).collect::<Option<_>>()?;
        let mut variance = 0.0;
        for (one, factor) in &parts {
            variance +=
                parts.iter().map(|(at, other)| factor * other * self.covariance[(*one, *at)]).sum::<f64>();
        }
        Some(variance.max(0.0).sqrt())
    }

    /// The value that the equations would have a parameter take if it had no bounds; `None` where it was held.
    pub fn unbounded(&self, parameter: usize) -> Option<f64> {
        self.free.iter().position(|free| *free == parameter).map(|at| self.unbounded[at])
    }

    /// Wald's statistic of these free parameters: how far they are `away` together, in units of their covariance.
    pub fn wald(&self, parameters: &[usize], away: &[f64]) -> f64 {
        let place = |parameter: &usize| self.free.iter().position(|free| free == parameter);
        let Some(at) = parameters.iter().map(place).collect::<Option<Vec<usize>>>() else { return 0.0 };
        let covariance = DMatrix::from_fn(at.len(), at.len(), |i, j| self.covariance[(at[i], at[j])]);
        let away = DVector::from_column_slice(away);
        away.dot(&(normal::inverse(&covariance) * &away))
    }

    /// The value that an estimate's error, in units of its standard error, stays below with `probability`: the quantile
    /// of Student's t with G - 1 degrees of freedom for G blocks.
    ///
    /// Blocks, and not rows, count as independent draws, whatever the number of free parameters: G - 1 is what fixed-G
    /// asymptotics of clustered data give (Bester, Conley and Hansen, J. Econometrics 165, 2011), what Cameron and
    /// Miller (J. Human Resources 50(2), 2015, section VI) recommend, and what goes with the jackknife's standard errors
    /// (MacKinnon, Nielsen and Webb, J. Econometrics 232(2), 2023), which already pay for the parameters.
    pub fn t_quantile(&self, probability: f64) -> f64 {
        student_quantile(probability, (self.estimation_costs.len() as f64 - 1.0).max(1.0))
    }
}
