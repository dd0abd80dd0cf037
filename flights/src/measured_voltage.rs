//! The measured voltage of the battery, as it drives the motors of a flight.

use crate::flight::Flight;

/// Width of the mean about each moment. A battery's voltage is slow: it follows the load within some tenths of a second, and noise and single
/// spikes of its sensor are faster. Tuned on flights of a Crazyflie, where 0.05 to 1 s serve alike.
const MEAN_S: f64 = 0.2;

/// The measured voltage of a flight's battery: the mean over 0.2 s about each moment of the line through its samples.
///
/// ```
/// use flights::{Channel, Flight, MeasuredVoltage, Role};
///
/// let mut flight = Flight::new("descent", "log.csv", Role::Test);
/// assert!(MeasuredVoltage::of(&flight).is_none(), "nothing is logged");
/// flight.battery_voltage = Channel { time_s: vec![0.0, 10.0], values: vec![[12.0], [11.0]] };
/// let voltage = MeasuredVoltage::of(&flight).unwrap();
/// assert!((voltage.at(5.0) - 11.5).abs() < 1e-12);
/// assert_eq!(voltage.at(-1.0), 12.0, "the first sample holds before it");
/// assert!((voltage.greatest() - 12.0).abs() < 0.01);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredVoltage {
    /// Times of the samples, in s.
    time_s: Vec<f64>,
    /// Samples, in V.
    values_v: Vec<f64>,
    /// Integral of the line from the first sample to each, in V*s.
    sums: Vec<f64>,
}

impl MeasuredVoltage {
    /// The voltage of the battery over `flight`; `None` if it was not logged, or never changes, as that of a sensor that is absent.
    #[must_use]
    pub fn of(flight: &Flight) -> Option<Self> {
        let channel = &flight.battery_voltage;
        let samples =
            channel.time_s.iter().zip(&channel.values).map(|(time_s, [value_v])| (*time_s, *value_v));
        let (time_s, values_v): (Vec<f64>, Vec<f64>) =
            samples.filter(|(_, value_v)| value_v.is_finite() && *value_v > 0.0).unzip();
        let first_v = *values_v.first()?;
        #[allow(
            clippy::float_cmp,
            reason = "a channel that never changes repeats its samples to the last bit"
        )]
        let is_dead = values_v.iter().all(|value_v| *value_v == first_v);
        let mut sums = vec![0.0];
        for (times, values) in time_s.windows(2).zip(values_v.windows(2)) {
            let below = (times[1] - times[0]) * f64::midpoint(values[0], values[1]);
            sums.push(sums[sums.len() - 1] + below);
        }
        (!is_dead).then_some(Self { time_s, values_v, sums })
    }

    /// The voltage at `time_s`, in V. The first sample holds before it, and the last one behind it.
    #[must_use]
    pub fn at(&self, time_s: f64) -> f64 {
        let last = self.time_s.len() - 1;
        let (from_s, to_s) = (time_s - MEAN_S / 2.0, time_s + MEAN_S / 2.0);
        if to_s <= self.time_s[0] {
            return self.values_v[0];
        }
        if from_s >= self.time_s[last] {
            return self.values_v[last];
        }
        (self.integral(to_s) - self.integral(from_s)) / MEAN_S
    }

    /// Greatest voltage, in V.
    #[must_use]
    pub fn greatest(&self) -> f64 {
        self.time_s.iter().map(|time_s| self.at(*time_s)).fold(0.0, f64::max)
    }

    /// Integral from the first sample to `time_s`.
    fn integral(&self, time_s: f64) -> f64 {
        let next = self.time_s.partition_point(|known_s| *known_s <= time_s);
        let Some(before) = next.checked_sub(1) else {
            return self.values_v[0] * (time_s - self.time_s[0]);
        };
        let since_s = time_s - self.time_s[before];
        let from_v = self.values_v[before];
        let slope = match self.time_s.get(next) {
            Some(next_s) => (self.values_v[next] - from_v) / (next_s - self.time_s[before]),
            None => 0.0,
        };
        self.sums[before] + since_s * (from_v + slope * since_s / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::{Channel, Role};

    fn voltage(time_s: Vec<f64>, of: impl Fn(usize) -> f64) -> Option<MeasuredVoltage> {
        let mut flight = Flight::new("volts", "log.csv", Role::Fit);
        let values = (0..time_s.len()).map(|at| [of(at)]).collect();
        flight.battery_voltage = Channel { time_s, values };
        MeasuredVoltage::of(&flight)
    }

    #[test]
    fn noise_is_averaged_and_a_ramp_is_kept() {
        let times: Vec<f64> = (0..1000).map(|at| f64::from(at) * 0.01).collect();
        let noise = |at: usize| if at.is_multiple_of(2) { 0.1 } else { -0.1 };
        let found = voltage(times, |at| 12.0 - 0.001 * at as f64 + noise(at)).unwrap();
        for time_s in [0.5, 3.333, 9.0] {
            assert!(
                (found.at(time_s) - (12.0 - 0.1 * time_s)).abs() < 0.01,
                "{time_s} s: {}",
                found.at(time_s)
            );
        }
    }

    #[test]
    fn samples_that_are_no_voltage_are_left_out() {
        let times = || vec![0.0, 1.0, 2.0, 3.0];
        let found = voltage(times(), |at| [12.0, 0.0, f64::NAN, 11.0][at]).unwrap();
        assert!((found.at(1.5) - 11.5).abs() < 1e-12);
        assert_eq!(voltage(times(), |_| 11.1), None, "it never changes");
        assert_eq!(voltage(times(), |_| 0.0), None);
        assert_eq!(voltage(Vec::new(), |_| 0.0), None);
    }
}
