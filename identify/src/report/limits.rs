//! Limits of predictions: what their errors are due to, as parts of the squared error.

use crate::model::noise::Noise;
use crate::report::horizons::{Change, Changes};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// The horizon that is taken apart.
const HORIZON: &str = "0.5";

/// Parts of the squared error of one channel that is left after [`HORIZON`] s, over all test flights; their sum is 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limits {
    /// Taken off by the flight's own trim.
    pub trim: f64,
    /// Taken off by the disturbance that was seen before each window.
    pub disturbance: f64,
    /// Due to the noise of the sensors.
    pub noise: f64,
    /// The rest: disturbances that began later, and what the model lacks.
    pub unknown: f64,
}

/// The limits of each channel of `errors`.
pub fn limits(errors: &Changes, noise: &BTreeMap<&'static str, Noise>) -> BTreeMap<&'static str, Limits> {
    let mut sums: BTreeMap<&'static str, [f64; 4]> = BTreeMap::new();
    for channels in errors.values().filter_map(|horizons| horizons.get(HORIZON)) {
        for (channel, change) in channels {
            let floor =
                noise.get(channel).and_then(|noise| noise.prediction.get(HORIZON)).copied().unwrap_or(0.0);
            let sum = sums.entry(channel).or_default();
            sum.iter_mut().zip(parts(change, floor)).for_each(|(sum, part)| *sum += part);
        }
    }
    let of_sum = |(channel, sum): (&'static str, [f64; 4])| {
        let total = sum.iter().sum::<f64>();
        let [trim, disturbance, noise, unknown] = sum.map(|part| part / total);
        (total > 0.0).then_some((channel, Limits { trim, disturbance, noise, unknown }))
    };
    sums.into_iter().filter_map(of_sum).collect()
}

/// Parts of a squared error: trim, disturbance, noise, and the rest.
fn parts(change: &Change, floor: f64) -> [f64; 4] {
    let [all, trimmed, seen, floor] =
        [change.after, change.own_trim, change.disturbance, floor].map(|error| error * error);
    let trim = (all - trimmed).max(0.0);
    let disturbance = (all - trim - seen).max(0.0);
    let left = all - trim - disturbance;
    let noise = floor.min(left);
    [trim, disturbance, noise, left - noise]
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = [
            ("the flight's own trim", self.trim),
            ("a disturbance seen before", self.disturbance),
            ("noise of the sensors", self.noise),
            ("unknown", self.unknown),
        ];
        parts.sort_by(|a, b| b.1.total_cmp(&a.1));
        let named = parts.iter().filter(|(_, part)| *part >= 0.05);
        let named: Vec<String> = named.map(|(name, part)| format!("{:.0} % {name}", 100.0 * part)).collect();
        f.write_str(&named.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_an_error_are_told_apart() {
        let change = Change {
            before: 9.0,
            after: 5.0,
            persistence: 9.0,
            own_trim: 4.0,
            disturbance: 3.0,
            own_wind: None,
            measured_attitude: None,
            by_axis: [5.0, 0.0, 0.0],
            unit: "deg",
        };
        let channels = BTreeMap::from([("attitude", change)]);
        let errors = Changes::from([("leg".to_owned(), BTreeMap::from([(HORIZON.to_owned(), channels)]))]);
        let noise =
            Noise { value: 0.1, unit: "rad", prediction: BTreeMap::from([(HORIZON.to_owned(), 1.0)]) };
        let found = limits(&errors, &BTreeMap::from([("attitude", noise)]))["attitude"];
        assert_eq!(
            found,
            Limits { trim: 9.0 / 25.0, disturbance: 7.0 / 25.0, noise: 1.0 / 25.0, unknown: 8.0 / 25.0 }
        );
        assert_eq!(
            found.to_string(),
            "36 % the flight's own trim, 32 % unknown, 28 % a disturbance seen before"
        );
    }

    #[test]
    fn a_trim_or_a_disturbance_that_does_not_help_takes_nothing_off() {
        let change = Change {
            before: 9.0,
            after: 2.0,
            persistence: 9.0,
            own_trim: 3.0,
            disturbance: 4.0,
            own_wind: None,
            measured_attitude: None,
            by_axis: [2.0, 0.0, 0.0],
            unit: "deg",
        };
        assert_eq!(parts(&change, 3.0), [0.0, 0.0, 4.0, 0.0]);
    }
}
