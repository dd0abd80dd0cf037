//! Results of a validation: errors by flight, horizon and channel, for people and for programs.

use crate::cells::Cells;
use flights::Role;
use flights::state::StateQuantity;
use serde_json::{Map, Value, json};
use std::fmt;

/// The errors of one or two vehicles on all flights; its text is a table.
///
/// ```
/// use flights::{Role, state::StateQuantity};
/// use report::validate::{ChannelErrors, Errors, FlightErrors, HorizonErrors};
/// let channels = vec![ChannelErrors { quantity: StateQuantity::Position, rms: vec![0.5, 0.25] }];
/// assert_eq!(channels[0].ratio(), Some(0.5));
/// let horizons = vec![HorizonErrors { horizon_ms: 500, windows: 7, left_out: 0, channels }];
/// let flights = vec![FlightErrors { name: "loop".to_owned(), role: Role::Test, horizons }];
/// let errors = Errors { vehicles: vec!["old".to_owned(), "new".to_owned()], flights };
/// assert_eq!(errors.json()["flights"]["loop"]["horizons"]["0.5"]["position"]["new"], 0.25);
/// assert!(errors.to_string().starts_with("flight  role  horizon"));
/// ```
#[derive(Debug)]
pub struct Errors {
    /// Names of the vehicles.
    pub vehicles: Vec<String>,
    /// The flights, in the order of the flights file.
    pub flights: Vec<FlightErrors>,
}

/// The errors on one flight.
#[derive(Debug)]
pub struct FlightErrors {
    /// The flight's name.
    pub name: String,
    /// Role of the flight.
    pub role: Role,
    /// The errors by the length of the windows, shortest first.
    pub horizons: Vec<HorizonErrors>,
}

/// The errors at the ends of windows of one length.
#[derive(Debug)]
pub struct HorizonErrors {
    /// Length of the windows, in ms.
    pub horizon_ms: u32,
    /// Number of windows that count.
    pub windows: usize,
    /// Number of windows that do not, since a measured channel has a gap there or ends, or the rotors' speeds are not known yet.
    pub left_out: usize,
    /// The errors by channel; only channels that the flight has.
    pub channels: Vec<ChannelErrors>,
}

/// The errors of one channel.
#[derive(Debug)]
pub struct ChannelErrors {
    /// The channel.
    pub quantity: StateQuantity,
    /// Root mean square over the windows, of each vehicle, in the quantity's unit.
    pub rms: Vec<f64>,
}

impl ChannelErrors {
    /// The second vehicle's error by the first's; `None` for a single vehicle.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        Some(self.rms.get(1)? / self.rms.first()?)
    }
}

impl HorizonErrors {
    /// The horizon as written: `0.5`.
    pub(crate) fn horizon(&self) -> String {
        (f64::from(self.horizon_ms) * 1e-3).to_string()
    }

    fn json(&self, vehicles: &[String]) -> Value {
        let mut value = json!({ "windows": self.windows, "left_out": self.left_out });
        for channel in &self.channels {
            let entry = &mut value[channel.quantity.name()];
            entry["unit"] = json!(channel.quantity.unit());
            vehicles.iter().zip(&channel.rms).for_each(|(vehicle, rms)| entry[vehicle.as_str()] = json!(rms));
            if let Some(ratio) = channel.ratio() {
                entry["ratio"] = json!(ratio);
            }
        }
        value
    }
}

impl Errors {
    /// The errors by the flights' names; numbers that are not finite are null.
    #[must_use]
    pub fn json(&self) -> Value {
        let horizons = |flight: &FlightErrors| -> Map<String, Value> {
            flight.horizons.iter().map(|errors| (errors.horizon(), errors.json(&self.vehicles))).collect()
        };
        let flight = |flight: &FlightErrors| {
            (flight.name.clone(), json!({ "role": flight.role, "horizons": horizons(flight) }))
        };
        json!({ "flights": self.flights.iter().map(flight).collect::<Map<_, _>>() })
    }

    fn cells(&self) -> Cells {
        let first = ["flight", "role", "horizon", "windows", "channel"].map(str::to_owned);
        let ratio = (self.vehicles.len() == 2).then(|| "ratio".to_owned());
        let headings: Vec<String> = first.into_iter().chain(self.vehicles.clone()).chain(ratio).collect();
        let is_number = (0..headings.len()).map(|column| !matches!(column, 0 | 1 | 4)).collect();
        let horizons =
            self.flights.iter().flat_map(|flight| flight.horizons.iter().map(move |at| (flight, at)));
        let rows = horizons
            .flat_map(|(flight, horizon)| horizon.channels.iter().map(move |of| row(flight, horizon, of)));
        Cells { headings, is_number, rows: rows.collect() }
    }
}

impl fmt::Display for Errors {
    /// A line for each flight, horizon and channel, and how many windows of a flight do not count.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.cells())?;
        for flight in &self.flights {
            let horizons = flight.horizons.iter().filter(|horizon| horizon.left_out > 0);
            let counts = horizons.map(|horizon| format!("{} of {} s", horizon.left_out, horizon.horizon()));
            let (name, counts) = (&flight.name, counts.collect::<Vec<_>>().join(", "));
            if !counts.is_empty() {
                writeln!(
                    f,
                    "{name}: not counted, at the start, at gaps in what was measured or at its end: {counts}"
                )?;
            }
        }
        Ok(())
    }
}

fn row(flight: &FlightErrors, horizon: &HorizonErrors, channel: &ChannelErrors) -> Vec<String> {
    let mut row = vec![
        flight.name.clone(),
        flight.role.name().to_owned(),
        format!("{} s", horizon.horizon()),
        horizon.windows.to_string(),
        format!("{}, {}", channel.quantity.name(), channel.quantity.unit()),
    ];
    row.extend(channel.rms.iter().map(|rms| short(*rms)));
    row.extend(channel.ratio().map(|ratio| format!("{ratio:.3}")));
    row
}

/// A number with three digits that count.
fn short(number: f64) -> String {
    match number.abs() {
        size if (0.01..1e308).contains(&size) => {
            let decimals = [100.0, 10.0, 1.0, 0.1].iter().filter(|limit| size < **limit).count();
            format!("{number:.decimals$}")
        }
        size if size.is_finite() => format!("{number:.2e}"),
        _ => number.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> Errors {
        let channels = vec![ChannelErrors { quantity: StateQuantity::Position, rms: vec![0.5, 0.25] }];
        let horizons = vec![HorizonErrors { horizon_ms: 100, windows: 7, left_out: 2, channels }];
        let flights = vec![FlightErrors { name: "loop".into(), role: Role::Test, horizons }];
        Errors { vehicles: vec!["old".into(), "new".into()], flights }
    }

    #[test]
    fn json_has_the_errors_by_flight_horizon_and_vehicle() {
        let expected = json!({ "flights": { "loop": { "role": "test", "horizons": { "0.1": {
            "windows": 7, "left_out": 2,
            "position": { "unit": "m", "old": 0.5, "new": 0.25, "ratio": 0.5 },
        } } } } });
        assert_eq!(two().json(), expected);
    }

    #[test]
    fn the_table_has_both_vehicles_the_ratio_and_the_windows_left_out() {
        let text = two().to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3, "{text}");
        let cells = |line: usize| lines[line].split_whitespace().collect::<Vec<_>>();
        assert_eq!(cells(0), ["flight", "role", "horizon", "windows", "channel", "old", "new", "ratio"]);
        assert_eq!(cells(1), ["loop", "test", "0.1", "s", "7", "position,", "m", "0.500", "0.250", "0.500"]);
        assert!(lines[2].contains("2 of 0.1 s"), "{text}");
    }

    #[test]
    fn three_digits_count() {
        let cases = [(123.4, "123"), (12.34, "12.3"), (0.0432, "0.0432"), (1.2e-5, "1.20e-5")];
        cases.iter().for_each(|(number, text)| assert_eq!(short(*number), *text));
    }
}
