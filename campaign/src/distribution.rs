//! Distributions of a varied value.

use crate::list::List;
use diagnostics::ParameterError;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// Distribution of a varied value: exactly one of its keys is stated.
///
/// ```
/// use campaign::distribution::Distribution;
/// let mass: Distribution = toml::from_str("uniform = [0.9, 1.1]")?;
/// assert_eq!(mass.at(0.5), 1.0);
/// let delay: Distribution = toml::from_str("integers = [1, 20]")?;
/// assert_eq!((delay.at(0.0), delay.at(0.999)), (1.0, 20.0));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// One of these values, each with the same chance; in a grid, all of them. The drawn number of one that is no number is its
    /// place in the list.
    Values(List),
    /// Uniform between two limits.
    Uniform([f64; 2]),
    /// Uniform in the logarithm between two positive limits.
    LogUniform([f64; 2]),
    /// Normal: mean and standard deviation.
    Normal([f64; 2]),
    /// Whole numbers from the first to the last, each with the same chance; in a grid, all of them.
    Integers([i64; 2]),
}

impl Distribution {
    /// The value below which the part `quantile` of the distribution lies, 0 ≤ `quantile` < 1.
    #[must_use]
    pub fn at(&self, quantile: f64) -> f64 {
        let between = |low: f64, high: f64| low + quantile * (high - low);
        match self {
            Self::Values(list) => list.nth(index(quantile, list.len() as u64) as usize),
            Self::Uniform([low, high]) => between(*low, *high),
            Self::LogUniform([low, high]) => libm::exp(between(libm::log(*low), libm::log(*high))),
            Self::Normal([mean, deviation]) => {
                // The ends would be infinite.
                let inside = quantile.clamp(1e-12, 1.0 - 1e-12);
                let normal = Normal::standard();
                mean + deviation * normal.inverse_cdf(inside)
            }
            Self::Integers([first, last]) => (first + index(quantile, count(*first, *last)) as i64) as f64,
        }
    }

    /// Number of values of a grid.
    ///
    /// # Errors
    /// If the distribution has no finite number of values.
    pub fn count(&self) -> Result<u64, ParameterError> {
        match self {
            Self::Values(list) => Ok(list.len() as u64),
            Self::Integers([first, last]) => Ok(count(*first, *last)),
            _ => Err(ParameterError::conflict(
                "sampling",
                "a grid takes `values` or `integers` for every varied value",
            )),
        }
    }

    /// Value number `index` of a grid.
    #[must_use]
    pub fn nth(&self, index: u64) -> f64 {
        match self {
            Self::Integers([first, _]) => (first + index as i64) as f64,
            Self::Values(list) => list.nth(index as usize),
            other => other.at(0.5),
        }
    }

    /// True if the values are whole numbers.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        match self {
            Self::Integers(_) => true,
            Self::Values(list) => list.is_whole(),
            _ => false,
        }
    }

    /// The texts and truth values that are chosen from; `None` where numbers are drawn.
    #[must_use]
    pub fn choices(&self) -> Option<&[toml::Value]> {
        match self {
            Self::Values(List::Choices(choices)) => Some(choices),
            _ => None,
        }
    }

    /// The text or truth value that the number `drawn` stands for, if it stands for one.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in the list")]
    pub fn choice(&self, drawn: f64) -> Option<&toml::Value> {
        self.choices()?.get(drawn as usize)
    }

    /// Refuses limits that hold no value.
    ///
    /// # Errors
    /// The key, with what was expected and found.
    pub fn check(&self) -> Result<(), ParameterError> {
        let numbers: &[f64] = match self {
            Self::Values(list) => list.numbers(),
            Self::Uniform(limits) | Self::LogUniform(limits) | Self::Normal(limits) => limits,
            Self::Integers(_) => &[],
        };
        if let Some(value) = numbers.iter().find(|value| !value.is_finite()) {
            return Err(ParameterError::value(self.key(), "finite numbers", value));
        }
        match self {
            Self::Values(list) if list.len() == 0 => {
                Err(ParameterError::value("values", "at least one value", "an empty list"))
            }
            Self::Uniform([low, high]) | Self::LogUniform([low, high]) if low >= high => {
                let found = format!("[{low}, {high}]");
                Err(ParameterError::value(self.key(), "a lower limit below the upper one", found))
            }
            Self::LogUniform([low, _]) if *low <= 0.0 => {
                Err(ParameterError::value("log_uniform", "limits above 0", low))
            }
            Self::Normal([_, deviation]) if *deviation <= 0.0 => {
                Err(ParameterError::value("normal", "a mean and a standard deviation above 0", deviation))
            }
            Self::Integers([first, last])
                if first > last || first.unsigned_abs() > EXACT || last.unsigned_abs() > EXACT =>
            {
                let found = format!("[{first}, {last}]");
                Err(ParameterError::value(
                    "integers",
                    "a first number not above the last, both within ±2^53",
                    found,
                ))
            }
            _ => Ok(()),
        }
    }

    fn key(&self) -> &'static str {
        match self {
            Self::Values(_) => "values",
            Self::Uniform(_) => "uniform",
            Self::LogUniform(_) => "log_uniform",
            Self::Normal(_) => "normal",
            Self::Integers(_) => "integers",
        }
    }
}

/// Whole numbers up to here are exact as `f64`.
const EXACT: u64 = 1 << 53;

fn count(first: i64, last: i64) -> u64 {
    last.abs_diff(first) + 1
}

/// Index of the cell that holds `quantile`, of `count` equal cells.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a quantile is at least 0")]
fn index(quantile: f64, count: u64) -> u64 {
    ((quantile * count as f64) as u64).min(count - 1)
}

#[cfg(test)]
mod tests {
    use super::Distribution;

    #[test]
    fn quantiles_are_those_of_the_distribution() {
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        close(Distribution::LogUniform([0.01, 100.0]).at(0.5), 1.0);
        // The standard normal's quantile at 97.5 %.
        assert!(
            (Distribution::Normal([1.0, 2.0]).at(0.975) - (1.0 + 2.0 * 1.959_963_984_540_054)).abs() < 1e-8
        );
        close(Distribution::Values(vec![3.0, 5.0].into()).at(0.5), 5.0);
        close(Distribution::Integers([-1, 1]).at(0.34), 0.0);
    }

    #[test]
    fn limits_without_a_value_are_refused() {
        for (distribution, key) in [
            (Distribution::Values(vec![].into()), "values"),
            (Distribution::Uniform([1.0, 1.0]), "uniform"),
            (Distribution::Uniform([f64::NAN, 1.0]), "uniform"),
            (Distribution::LogUniform([0.0, 1.0]), "log_uniform"),
            (Distribution::Normal([0.0, 0.0]), "normal"),
            (Distribution::Integers([2, 1]), "integers"),
        ] {
            assert_eq!(distribution.check().unwrap_err().key(), key, "{distribution:?}");
        }
    }
}
