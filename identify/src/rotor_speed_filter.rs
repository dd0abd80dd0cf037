//! Logged rotor speeds that a sensor or a driver has filtered: what the rotors did, and what such a sensor logs of it.
//!
//! A low pass weakens a fast change, and the torque that the model derives from it. Inertia then seems the smaller, the faster the manoeuvre:
//! an inertia that changes with the band is a filtered speed.

use crate::track::Track;
use flights::Channel;
use vehicles::ROTORS_MAX;

/// The sensor of the rotor speeds: a first-order low pass, and late stamps.
///
/// ```
/// use flights::{Channel, Flight, Role};
/// use identify::{SensorErrors, SpeedFilter};
///
/// let mut flight = Flight::new("steps", "", Role::Fit);
/// let mut step = vec![[0.0; vehicles::ROTORS_MAX]; 200];
/// step[100..].fill([400.0; vehicles::ROTORS_MAX]);
/// flight.rotor_speed = Channel { time_s: (0..200).map(|k| f64::from(k) * 1e-3).collect(), values: step };
/// let rotor_speed = SpeedFilter { lag_s: 0.02, late_s: 0.0 };
/// let logged = SensorErrors { rotor_speed, ..SensorErrors::default() }.put_on(&flight).rotor_speed;
/// // One lag behind the step two thirds of it are logged.
/// assert!((logged.values[120][0] / 400.0 - 0.64).abs() < 0.02, "{}", logged.values[120][0]);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SpeedFilter {
    /// Time constant T of T y' + y = w, in s.
    pub lag_s: f64,
    /// Lateness of the stamps, in s.
    pub late_s: f64,
}

impl SpeedFilter {
    /// The speeds of the rotors on the grid, by those that were logged: y + T y'.
    pub(crate) fn taken_off_track(self, mut logged: Track<ROTORS_MAX>, step_s: f64) -> Track<ROTORS_MAX> {
        if self.lag_s != 0.0 {
            // From one instant to the next but one: a longer line would weaken what the filter weakened.
            let slopes = logged.slope(1, step_s);
            logged.values.iter_mut().zip(slopes).for_each(|(value, slope)| self.lead(value, slope));
        }
        logged
    }

    /// The same for the samples of a channel.
    pub(crate) fn taken_off(self, logged: &mut Channel<ROTORS_MAX>) {
        logged.time_s.iter_mut().for_each(|time_s| *time_s -= self.late_s);
        if self.lag_s == 0.0 || logged.time_s.len() < 2 {
            return;
        }
        let last = logged.time_s.len() - 1;
        let slope = |at: usize| {
            let (before, after) = (at.saturating_sub(1), (at + 1).min(last));
            let span_s = logged.time_s[after] - logged.time_s[before];
            std::array::from_fn(|rotor| (logged.values[after][rotor] - logged.values[before][rotor]) / span_s)
        };
        let slopes: Vec<[f64; ROTORS_MAX]> = (0..=last).map(slope).collect();
        logged.values.iter_mut().zip(slopes).for_each(|(value, slope)| self.lead(value, slope));
    }

    /// The samples that such a sensor logs of `speeds`: exact for speeds on a line from one sample to the next. It has settled at the first one.
    pub(crate) fn put_on(self, speeds: &mut Channel<ROTORS_MAX>) {
        if self.lag_s > 0.0 {
            let mut logged = speeds.values.first().copied().unwrap_or_default();
            for at in 1..speeds.values.len() {
                let span_s = speeds.time_s[at] - speeds.time_s[at - 1];
                let part = libm::exp(-span_s / self.lag_s);
                // The sample before was replaced behind its use.
                let (from, to) = (speeds.values[at - 1], speeds.values[at]);
                let behind = |rotor: usize| self.lag_s * (to[rotor] - from[rotor]) / span_s;
                let next = |rotor: usize| {
                    to[rotor] - behind(rotor) + part * (logged[rotor] - from[rotor] + behind(rotor))
                };
                let next = std::array::from_fn(next);
                speeds.values[at - 1] = logged;
                logged = next;
            }
            if let Some(last) = speeds.values.last_mut() {
                *last = logged;
            }
        }
        speeds.time_s.iter_mut().for_each(|time_s| *time_s += self.late_s);
    }

    fn lead(self, value: &mut [f64; ROTORS_MAX], slope: [f64; ROTORS_MAX]) {
        value.iter_mut().zip(slope).for_each(|(value, slope)| *value += self.lag_s * slope);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Speeds that swing at 6 Hz, sampled at 1 kHz.
    fn swinging() -> Channel<ROTORS_MAX> {
        let time_s: Vec<f64> = (0..1000).map(|k| f64::from(k) * 1e-3).collect();
        let speed = |time_s: &f64| {
            std::array::from_fn(|rotor| 400.0 + 50.0 * libm::sin(37.7 * time_s + rotor as f64))
        };
        Channel { values: time_s.iter().map(speed).collect(), time_s }
    }

    #[test]
    fn a_filter_weakens_a_swing_by_its_own_frequency_response() {
        let mut logged = swinging();
        SpeedFilter { lag_s: 0.03, late_s: 0.0 }.put_on(&mut logged);
        let greatest = logged.values[300..].iter().map(|value| value[0] - 400.0).fold(0.0, f64::max);
        let expected = 50.0 / (1.0 + (37.7_f64 * 0.03).powi(2)).sqrt();
        assert!((greatest / expected - 1.0).abs() < 5e-3, "{greatest}, expected {expected}");
    }

    #[test]
    fn what_is_put_on_is_taken_off() {
        let filter = SpeedFilter { lag_s: 0.03, late_s: 0.004 };
        let (speeds, mut logged) = (swinging(), swinging());
        filter.put_on(&mut logged);
        assert!((logged.values[500][0] - speeds.values[500][0]).abs() > 10.0, "it was filtered");
        assert!((logged.time_s[500] - 0.504).abs() < 1e-12, "and is late");
        filter.taken_off(&mut logged);
        for at in 1..999 {
            let apart = (logged.values[at][1] - speeds.values[at][1]).abs();
            assert!(apart < 1.0, "{at}: {apart}");
        }
        assert!((logged.time_s[500] - 0.5).abs() < 1e-12);
    }
}
