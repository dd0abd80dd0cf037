//! The flight envelope in which a verdict was judged: the ranges of the test flights.

use flights::state::{StateQuantity, length, tilt_deg};
use flights::{Flight, Played};
use serde::Serialize;
use std::collections::BTreeMap;

/// Time between two looks at a flight, s.
const STEP_S: f64 = 0.01;
/// Part of the time within a range: outliers and short moments are left out.
const SHARE: f64 = 0.99;

/// A limit of the envelope.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reached {
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: &'static str,
}

/// Values of all judged flights, by quantity.
#[derive(Default)]
struct Seen {
    speed_m_s: Vec<f64>,
    tilt_deg: Vec<f64>,
    angular_velocity_rad_s: Vec<f64>,
    specific_force_m_s2: Vec<f64>,
    height_m: Vec<f64>,
}

/// The envelope of the judged `flights`: limits of the measured values, by the keys of `[envelope]` in a
/// vehicle file. Each flight has the width in s of the windows in which it was compared, and true if its
/// rates were judged. Values are within them in 99 % of the time. What is faster than one cycle in the widest
/// window was not compared in every flight.
pub fn of<'f>(flights: impl Iterator<Item = (&'f Flight, f64, bool)>) -> BTreeMap<&'static str, Reached> {
    let (mut seen, mut widest_s) = (Seen::default(), 0.0_f64);
    for (flight, window_s, has_judged_rates) in flights {
        widest_s = widest_s.max(window_s);
        seen.look_at(flight, has_judged_rates);
    }
    let frequency_hz = (widest_s > 0.0).then(|| widest_s.recip());
    let limits = [
        ("speed_max", quantile(&mut seen.speed_m_s, SHARE), "m/s"),
        ("tilt_max", quantile(&mut seen.tilt_deg, SHARE), "deg"),
        ("angular_velocity_max", quantile(&mut seen.angular_velocity_rad_s, SHARE), "rad/s"),
        ("specific_force_max", quantile(&mut seen.specific_force_m_s2, SHARE), "m/s^2"),
        ("height_min", quantile(&mut seen.height_m, 1.0 - SHARE), "m"),
        ("height_max", quantile(&mut seen.height_m, SHARE), "m"),
        ("frequency_max", frequency_hz, "Hz"),
    ];
    let known =
        limits.into_iter().filter_map(|(key, value, unit)| Some((key, Reached { value: value?, unit })));
    known.collect()
}

impl Seen {
    fn look_at(&mut self, flight: &Flight, has_judged_rates: bool) {
        let Ok(played) = Played::of(flight) else { return };
        let forces = flight.specific_force.time_s.iter().zip(&flight.specific_force.values);
        let forces = forces.filter(|(time_s, _)| played.counts(**time_s, **time_s));
        self.specific_force_m_s2.extend(forces.map(|(_, force)| length(force)));
        let has = |quantity: StateQuantity| quantity.is_measured(flight);
        let ((start_s, end_s), mut hint) = (played.span_s(), 0);
        for step in 0..((end_s - start_s) / STEP_S) as usize {
            let time_s = start_s + step as f64 * STEP_S;
            let row = played.at(time_s, &mut hint);
            if !played.counts(time_s, time_s + STEP_S) {
                continue;
            }
            if has(StateQuantity::Velocity) {
                self.speed_m_s.push(length(&row.velocity_m_s));
            }
            if has(StateQuantity::Attitude) {
                self.tilt_deg.push(tilt_deg(&row.attitude));
            }
            if has_judged_rates && has(StateQuantity::Rates) {
                self.angular_velocity_rad_s.push(length(&row.angular_velocity_rad_s));
            }
            if has(StateQuantity::Position) {
                self.height_m.push(row.position_m[2]);
            }
        }
    }
}

/// The value below which `share` of `values` lie; sorts them.
fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    values.get((share * last as f64).round() as usize).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use flights::Role;

    #[test]
    fn the_limits_hold_for_nearly_all_of_the_test_flights() {
        // A circle of 1 m at 2 rad/s, 1.5 m high, tilted by 10°, with one wild sample.
        let mut flight = Flight::new("circle", "log.csv", Role::Test);
        let time_s: Vec<f64> = (0..1000).map(|sample| f64::from(sample) * 0.01).collect();
        let (sine, cosine) = libm::sincos(5_f64.to_radians());
        flight.attitude.values = vec![[cosine, sine, 0.0, 0.0]; 1000];
        let at = |time_s: &f64| [libm::cos(2.0 * time_s), libm::sin(2.0 * time_s), 1.5];
        flight.position.values = time_s.iter().map(at).collect();
        flight.specific_force.values = vec![[0.0, 0.0, 9.9]; 1000];
        flight.specific_force.values[500] = [0.0, 0.0, 80.0];
        flight.command.values = vec![[100.0; vehicles::ROTORS_MAX]; 1000];
        flight.attitude.time_s = time_s.clone();
        flight.position.time_s = time_s.clone();
        flight.command.time_s = time_s.clone();
        flight.specific_force.time_s = time_s;
        flight.angular_velocity.values = vec![[0.0, 0.0, 0.5]; 1000];
        flight.angular_velocity.time_s = flight.position.time_s.clone();
        let limits = of([(&flight, 0.1, true), (&flight, 0.08, false)].into_iter());
        let near = |key: &str, expected: f64| {
            let Reached { value, .. } = limits[key];
            assert!((value - expected).abs() < 0.02 * expected, "{key}: {value}");
        };
        near("speed_max", 2.0);
        near("tilt_max", 10.0);
        near("specific_force_max", 9.9);
        near("angular_velocity_max", 0.5);
        near("height_min", 1.5);
        near("height_max", 1.5);
        near("frequency_max", 10.0);
        let forces_alone = of(std::iter::once((&flight, 0.1, false)));
        assert!(!forces_alone.contains_key("angular_velocity_max") && forces_alone.contains_key("tilt_max"));
        assert!(of(std::iter::empty()).is_empty(), "no flight was judged");
    }
}
