//! The battery's voltage over a flight, against a reference.

use flights::{Channel, Flight};

use crate::numbers::statistics::{deviation, mean};
use crate::rotor::plateau::median;

/// Below this part of its variation, the noise of a voltage hardly flattens a slope over it.
const NOISE_MAX: f64 = 0.1;

/// The voltage over one flight.
#[derive(Debug, Clone)]
pub struct Voltage {
    time_s: Vec<f64>,
    /// Logarithm of the voltage by the reference.
    log: Vec<f64>,
}

/// The reference of some flights: the median of their voltages in V; `None` if one of them has no voltage.
pub fn reference_v(flights: &[&Flight]) -> Option<f64> {
    let all_have = flights.iter().all(|flight| has_voltage(flight));
    let values = || flights.iter().flat_map(|flight| &flight.battery_voltage.values);
    let positive: Vec<f64> =
        values().map(|[voltage_v]| *voltage_v).filter(|voltage_v| *voltage_v > 0.0).collect();
    (all_have && !positive.is_empty()).then(|| median(&positive))
}

fn has_voltage(flight: &Flight) -> bool {
    flight.battery_voltage.values.iter().any(|[voltage_v]| *voltage_v > 0.0)
}

/// Part of the variance of the voltages that is noise, estimated from neighbouring samples; 1 if all voltages
/// are equal.
pub fn noise_share(flights: &[&Flight]) -> f64 {
    let channels = || flights.iter().map(|flight| &flight.battery_voltage);
    let all: Vec<f64> =
        channels().flat_map(|channel| &channel.values).map(|[voltage_v]| *voltage_v).collect();
    // A straight line has no second difference; that of white noise has six times its variance.
    let second = |three: &[[f64; 1]]| (three[0][0] - 2.0 * three[1][0] + three[2][0]).powi(2) / 6.0;
    let noise: Vec<f64> = channels().flat_map(|channel| channel.values.windows(3).map(second)).collect();
    let variance = deviation(&all).powi(2);
    if variance > 0.0 && !noise.is_empty() { (mean(&noise) / variance).min(1.0) } else { 1.0 }
}

/// True if the voltages vary beyond their noise.
pub fn varies(flights: &[&Flight]) -> bool {
    noise_share(flights) < NOISE_MAX
}

impl Voltage {
    /// The voltage over `flight`; `None` if it was not logged.
    pub fn of(flight: &Flight, reference_v: f64) -> Option<Self> {
        let Channel { time_s, values } = &flight.battery_voltage;
        let samples = time_s.iter().zip(values).filter(|(_, [voltage_v])| *voltage_v > 0.0);
        let (time_s, log): (Vec<f64>, Vec<f64>) =
            samples.map(|(time_s, [voltage_v])| (*time_s, libm::log(voltage_v / reference_v))).unzip();
        (!time_s.is_empty()).then_some(Self { time_s, log })
    }

    /// The logarithm at a time, on a line between the samples about it.
    pub fn log_at(&self, time_s: f64) -> f64 {
        let next = self.time_s.partition_point(|known_s| *known_s <= time_s);
        if next == 0 || next == self.time_s.len() {
            return self.log[next.min(self.log.len() - 1)];
        }
        let (from_s, to_s) = (self.time_s[next - 1], self.time_s[next]);
        let part = (time_s - from_s) / (to_s - from_s);
        self.log[next - 1] + part * (self.log[next] - self.log[next - 1])
    }
}
