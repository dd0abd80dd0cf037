//! Statistics of residuals: whiteness, dependence on an input, and intervals that stay honest when samples are
//! correlated. Slices of plain numbers in, plain numbers out; nothing here knows units.
//!
//! | room | what it holds |
//! |---|---|
//! | `correlation` | auto- and cross-correlation, and the bound that white noise keeps |
//! | `ljung_box` | one test of whiteness over many lags |
//! | `bootstrap` | the interval of a mean whose samples are correlated, by resampling blocks |
//! | `jackknife` | the interval of any estimate, by leaving out one block after the other |
//! | `quantile` | quantiles and tails of the usual distributions |

mod bootstrap;
mod correlation;
mod gain;
mod jackknife;
mod ljung_box;
mod quantile;

pub use bootstrap::{Bootstrap, MeanInterval, block_bootstrap_mean};
pub(crate) use correlation::deviation;
pub use correlation::{autocorrelation, cross_correlation, mean, white_noise_bound};
pub(crate) use gain::chance_of_no_gain;
pub use jackknife::{Estimate, jackknife};
pub use ljung_box::{LjungBox, ljung_box};
pub use quantile::{chi_square_tail, fisher_tail, normal_quantile, student_quantile};
