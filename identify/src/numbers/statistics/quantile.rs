//! Quantiles and tails of the usual distributions, by the crate `statrs`.

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, Normal, StudentsT};

/// The value that a standard normal number stays below with probability `p`.
#[must_use]
pub fn normal_quantile(p: f64) -> f64 {
    Normal::standard().inverse_cdf(p)
}

/// The value that Student's t with `freedom` degrees of freedom stays below with probability `p`; NaN if `freedom`
/// is not above 0.
#[must_use]
pub fn student_quantile(p: f64, freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::NAN, |student| student.inverse_cdf(p))
}

/// The probability that a chi-square number with `freedom` degrees of freedom is above `x`; NaN if `freedom` is not
/// above 0.
#[must_use]
pub fn chi_square_tail(x: f64, freedom: f64) -> f64 {
    if x.is_nan() {
        return f64::NAN;
    }
    ChiSquared::new(freedom).map_or(f64::NAN, |chi_square| chi_square.sf(x))
}

/// The probability that Fisher's F with these degrees of freedom is above `x`; NaN if either is not above 0.
#[must_use]
pub fn fisher_tail(x: f64, numerator: f64, denominator: f64) -> f64 {
    if x.is_nan() {
        return f64::NAN;
    }
    FisherSnedecor::new(numerator, denominator).map_or(f64::NAN, |fisher| fisher.sf(x))
}
