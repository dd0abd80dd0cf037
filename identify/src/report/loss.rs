//! Predictions that lose: to the declared vehicle, or to persistence, which knows no vehicle at all.

use crate::model::noise::Noise;
use crate::numbers::digits::rounded;
use crate::report::horizons::{Change, Changes};
use serde::Serialize;
use std::collections::BTreeMap;

/// Horizons and channels that are judged.
const HORIZONS: [&str; 2] = ["0.1", "0.5"];
const CHANNELS: [&str; 2] = ["attitude", "velocity"];
/// Judged in the place of an attitude that was not logged.
const RATES: &str = "rates";
/// A smaller ratio of errors is no loss.
const LEAST_RATIO: f64 = 1.05;

/// The horizon of the equations of each moment.
pub const MOMENT: &str = "0";

/// An error of the new vehicle that is greater than a rival's: of a prediction, or of the equations of each moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Loss {
    /// The flight.
    pub flight: String,
    /// Horizon in s; `0` of the equations of each moment.
    pub horizon: &'static str,
    /// The channel, or the equation of each moment.
    pub channel: &'static str,
    /// `persistence` or `declared`; of each moment `no model`, or `trim`: the greatest constant force that passes for one.
    pub rival: &'static str,
    /// Root mean square of the new vehicle; beside `trim` the constant force that it lacks.
    pub new: f64,
    /// Knowledge of the prediction besides the new vehicle: `nothing`, `own trim`, `disturbance` or `own wind`. Against persistence the best
    /// of these counts.
    pub knowing: &'static str,
    /// Root mean square of the rival; the limit of a trim.
    pub other: f64,
    /// Unit of both.
    pub unit: &'static str,
}

/// The losses among `errors` of test flights. The error that the sensors' noise causes through the measured
/// start does not count as a loss: a vehicle that hardly moves is predicted best by persistence.
pub fn losses(errors: &Changes, noise: &BTreeMap<&'static str, Noise>) -> Vec<Loss> {
    let mut losses = Vec::new();
    for (flight, horizons) in errors {
        for (horizon, channel, change) in HORIZONS.into_iter().flat_map(|horizon| judged(horizons, horizon)) {
            let floor =
                noise.get(channel).and_then(|noise| noise.prediction.get(horizon)).copied().unwrap_or(0.0);
            // A flight's own trim, its wind, and what disturbs it, are none of the vehicle's: the best of all.
            let plain = (change.after, "nothing");
            let all = [plain, (change.own_trim, "own trim"), (change.disturbance, "disturbance")];
            let in_wind = change.own_wind.map(|error| (error, "own wind"));
            let best = all.into_iter().chain(in_wind).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or(plain);
            let rivals = [("persistence", best, change.persistence), ("declared", plain, change.before)];
            let loses = |new: f64, other: f64| {
                !new.is_finite() || (new * new - floor * floor).max(0.0).sqrt() > LEAST_RATIO * other
            };
            let beaten = rivals.into_iter().filter(|(_, new, other)| loses(new.0, *other));
            if let Some((rival, (new, knowing), other)) = beaten.min_by(|a, b| a.2.total_cmp(&b.2)) {
                let (flight, unit) = (flight.clone(), change.unit);
                losses.push(Loss { flight, horizon, channel, rival, new, knowing, other, unit });
            }
        }
    }
    losses
}

/// The errors that are judged at one horizon.
fn judged<'c>(
    horizons: &'c BTreeMap<String, BTreeMap<&'static str, Change>>,
    horizon: &'static str,
) -> Vec<(&'static str, &'static str, &'c Change)> {
    let Some(channels) = horizons.get(horizon) else { return Vec::new() };
    let turning = (!channels.contains_key("attitude")).then_some(RATES);
    let names = CHANNELS.into_iter().chain(turning);
    names.filter_map(|channel| Some((horizon, channel, channels.get(channel)?))).collect()
}

impl Loss {
    /// Text of [`Loss::knowing`] behind an error; empty for nothing.
    #[must_use]
    pub fn knowing_text(&self) -> &'static str {
        match self.knowing {
            "own trim" => " with the flight's own trim",
            "disturbance" => " with the disturbance seen before",
            "own wind" => " in the wind seen before",
            _ => "",
        }
    }
}

impl std::fmt::Display for Loss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { flight, horizon, channel, rival, new, other, unit, .. } = self;
        let (new, other, knowing) = (rounded(*new), rounded(*other), self.knowing_text());
        match *rival {
            "trim" => {
                return write!(
                    f,
                    "{channel} of {flight}: a constant {new} {unit} is missing, more than {other} {unit} is no trim"
                );
            }
            "no model" => {
                return write!(
                    f,
                    "{channel} at each moment of {flight}: new {new} {unit}, without any model {other} {unit}"
                );
            }
            _ => (),
        }
        write!(
            f,
            "{channel} after {horizon} s of {flight}: new {new} {unit}{knowing}, {rival} {other} {unit}"
        )
    }
}

/// Measurements that would help where `channel` loses.
pub fn advice(channel: &str) -> &'static str {
    if ["attitude", RATES, "angular_acceleration"].contains(&channel) {
        "torques: log rotor speeds and every command the motors get, weigh and balance the vehicle before each flight, and measure \
         its inertia and the rotors' thrust over command on a stand; to judge the forces alone, give each flight the key `torques = false`"
    } else {
        "forces: weigh the vehicle, measure thrust over command and voltage on a stand, and fly in still air"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn losses_of(after: f64, own_trim: f64, persistence: f64, floor: f64) -> Vec<Loss> {
        losses_in(&["attitude"], [after, own_trim, persistence, floor])
    }

    /// Losses of a flight with the same errors in each of these channels.
    fn losses_in(logged: &[&'static str], [after, own_trim, persistence, floor]: [f64; 4]) -> Vec<Loss> {
        let change = Change {
            before: 4.0,
            after,
            persistence,
            own_trim,
            disturbance: own_trim,
            own_wind: None,
            measured_attitude: None,
            by_axis: [0.0; 3],
            unit: "deg",
        };
        let channels: BTreeMap<_, _> = logged.iter().map(|channel| (*channel, change)).collect();
        let errors = Changes::from([("leg".to_owned(), BTreeMap::from([("0.5".to_owned(), channels)]))]);
        let prediction = BTreeMap::from([("0.5".to_owned(), floor)]);
        losses(&errors, &BTreeMap::from([("attitude", Noise { value: 0.1, unit: "rad", prediction })]))
    }

    #[test]
    fn rates_are_judged_where_no_attitude_is_logged() {
        let lost = |logged: &[&'static str]| {
            losses_in(logged, [3.0, 3.0, 1.0, 0.1]).iter().map(|loss| loss.channel).collect::<Vec<_>>()
        };
        assert_eq!(lost(&["rates"]), ["rates"]);
        assert_eq!(lost(&["attitude", "rates"]), ["attitude"]);
        assert!(advice("rates").starts_with("torques") && advice("rates").contains("`torques = false`"));
    }

    #[test]
    fn the_greater_rival_is_told_and_noise_is_no_loss() {
        let rival = |losses: &[Loss]| losses.iter().map(|loss| loss.rival).collect::<Vec<_>>();
        assert_eq!(rival(&losses_of(2.0, 2.0, 1.0, 0.1)), ["persistence"]);
        assert_eq!(rival(&losses_of(5.0, 5.0, 9.0, 0.1)), ["declared"]);
        let knowing = |own_trim| losses_of(3.0, own_trim, 1.0, 0.1)[0].clone();
        assert_eq!((knowing(3.0).new, knowing(3.0).knowing), (3.0, "nothing"));
        assert_eq!((knowing(2.0).new, knowing(2.0).knowing), (2.0, "own trim"));
        let text =
            "attitude after 0.5 s of leg: new 2.000 deg with the flight's own trim, persistence 1.000 deg";
        assert_eq!(knowing(2.0).to_string(), text);
        assert!(losses_of(0.9, 0.9, 1.0, 0.1).is_empty());
        // The sensors make nearly all of the error; or the flight's own trim does.
        assert!(losses_of(2.0, 2.0, 1.0, 1.8).is_empty());
        assert!(losses_of(2.0, 0.9, 1.0, 0.1).is_empty());
    }
}
