//! Pass rates by the value of a varied number. They show an effect on both sides of a range, which a rank correlation does not see.

use crate::statistics::{independence, rank_correlation};
use serde::Serialize;
use std::fmt;

/// Groups of about equally many flights, by the rank of their value.
const GROUPS: usize = 5;
/// Different values at most of which each has a group of its own.
const VALUES: usize = 10;

/// Pass rates by the value of a varied number.
#[derive(Debug, Serialize)]
pub struct PassRates {
    /// Name of the varied value.
    pub varied: String,
    /// Groups of flights, lowest values first.
    pub groups: Vec<Group>,
    /// Spearman's rank correlation of the value with the outcome.
    pub rank_correlation: Option<f64>,
    /// Chance of pass rates as different without any relation (chi-square test of independence); `None` for too few flights.
    pub chance: Option<f64>,
}

/// Flights with values of one range.
#[derive(Debug, PartialEq, Serialize)]
pub struct Group {
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
    /// Flights with figures.
    pub flights: u64,
    /// Those whose conditions all held.
    pub passed: u64,
    /// Part of them that passed.
    pub pass_rate: f64,
}

impl PassRates {
    /// Pass rates by the value `varied` of `flights`: the value of each, and true if the flight passed.
    ///
    /// ```
    /// use campaign::pass_rates::PassRates;
    /// // Values in the middle pass.
    /// let flights: Vec<(f64, bool)> = (0..100).map(|k| (f64::from(k), (20..80).contains(&k))).collect();
    /// let rates = PassRates::of("gain", &flights);
    /// assert_eq!(rates.groups.iter().map(|group| group.passed).collect::<Vec<_>>(), [0, 20, 20, 20, 0]);
    /// assert!(rates.rank_correlation.unwrap().abs() < 0.1 && rates.chance.unwrap() < 1e-9);
    /// ```
    #[must_use]
    pub fn of(varied: &str, flights: &[(f64, bool)]) -> Self {
        let groups = groups(flights);
        let counts: Vec<(u64, u64)> = groups.iter().map(|group| (group.flights, group.passed)).collect();
        let pairs: Vec<(f64, f64)> =
            flights.iter().map(|&(value, passed)| (value, if passed { 1.0 } else { 0.0 })).collect();
        Self {
            varied: varied.to_owned(),
            groups,
            rank_correlation: rank_correlation(&pairs).map(|(rank, _)| rank),
            chance: independence(&counts),
        }
    }
}

/// Groups of `flights`: one for each value where they are few, else by rank. Equal values are in one group.
fn groups(flights: &[(f64, bool)]) -> Vec<Group> {
    let mut sorted = flights.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let values: Vec<&[(f64, bool)]> = sorted.chunk_by(|a, b| a.0.total_cmp(&b.0).is_eq()).collect();
    let is_few = values.len() <= VALUES;
    let mut numbered: Vec<(usize, f64, bool)> = Vec::with_capacity(sorted.len());
    for (number, equal) in values.iter().enumerate() {
        let twice_middle = 2 * numbered.len() + equal.len();
        let group = if is_few { number } else { twice_middle * GROUPS / (2 * sorted.len()) };
        numbered.extend(equal.iter().map(|&(value, passed)| (group, value, passed)));
    }
    numbered.chunk_by(|a, b| a.0 == b.0).map(Group::of).collect()
}

impl Group {
    /// The group of `flights`, which are sorted by their values.
    fn of(flights: &[(usize, f64, bool)]) -> Self {
        let passed = flights.iter().filter(|flight| flight.2).count() as u64;
        let count = flights.len() as u64;
        Self {
            low: flights.first().map_or(f64::NAN, |flight| flight.1),
            high: flights.last().map_or(f64::NAN, |flight| flight.1),
            flights: count,
            passed,
            pass_rate: passed as f64 / count.max(1) as f64,
        }
    }
}

impl fmt::Display for PassRates {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rates: Vec<String> = self.groups.iter().map(Group::to_string).collect();
        write!(f, "pass rates by `{}`: {}", self.varied, rates.join("; "))
    }
}

impl fmt::Display for Group {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { low, high, pass_rate, .. } = self;
        write!(f, "{:.1} % from {low:.4} to {high:.4}", 100.0 * pass_rate)
    }
}

#[cfg(test)]
mod tests {
    use super::{Group, PassRates};

    fn counts(rates: &PassRates) -> Vec<(u64, u64)> {
        rates.groups.iter().map(|group| (group.flights, group.passed)).collect()
    }

    #[test]
    fn few_values_have_groups_of_their_own_and_equal_ones_stay_together() {
        let flights = [(2.0, true), (1.0, false), (2.0, false), (1.0, false), (3.0, true)];
        let rates = PassRates::of("gain", &flights);
        assert_eq!(counts(&rates), [(2, 0), (2, 1), (1, 1)]);
        assert_eq!(rates.chance, None, "too few flights");
        let middle = Group { low: 2.0, high: 2.0, flights: 2, passed: 1, pass_rate: 0.5 };
        assert_eq!(rates.groups[1], middle);
        // Eleven values, and half of the flights have the first one.
        let flights: Vec<(f64, bool)> = (0..20).map(|k| (f64::from(k.max(9)), true)).collect();
        assert_eq!(counts(&PassRates::of("gain", &flights)), [(10, 10), (2, 2), (4, 4), (4, 4)]);
        assert!(PassRates::of("gain", &[]).groups.is_empty());
    }

    #[test]
    fn pass_rates_are_a_line() {
        let rates = PassRates::of("gain", &[(1.0, false), (2.0, true)]);
        assert_eq!(
            rates.to_string(),
            "pass rates by `gain`: 0.0 % from 1.0000 to 1.0000; 100.0 % from 2.0000 to 2.0000"
        );
    }
}
