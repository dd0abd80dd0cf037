//! Noise of sensors, and the error that it makes in a prediction that starts at a measured state.

use crate::data::prepared::Prepared;
use flights::{Channel, Flight};
use serde::Serialize;
use std::collections::BTreeMap;

/// Standard deviation of the white noise of a channel, mean over its axes: third differences leave little of a smooth
/// course, and of white noise 20 times its variance (von Neumann 1941 has it for first differences). A channel that
/// was interpolated looks quieter than its sensor is.
pub fn deviation<const N: usize>(channel: &Channel<N>) -> Option<f64> {
    let third = |w: &[[f64; N]], i: usize| w[3][i] - 3.0 * w[2][i] + 3.0 * w[1][i] - w[0][i];
    let squares: f64 = channel.values.windows(4).flat_map(|w| (0..N).map(move |i| third(w, i).powi(2))).sum();
    let count = (channel.values.len().checked_sub(3)? * N) as f64;
    (count > 0.0).then(|| (squares / count / 20.0).sqrt())
}

/// The noise of channels, with its unit.
pub type Floor = BTreeMap<&'static str, (f64, &'static str)>;

/// The noise of each channel that was measured, over `flights`.
pub fn floor(flights: &[Prepared]) -> Floor {
    let mut floor = Floor::new();
    let mut add = |name: &'static str, unit: &'static str, of_flight: &dyn Fn(&Flight) -> Option<f64>| {
        let found: Vec<f64> = flights.iter().filter_map(|flight| of_flight(&flight.flight)).collect();
        if !found.is_empty() {
            let mean_square = found.iter().map(|x| x * x).sum::<f64>() / found.len() as f64;
            floor.insert(name, (mean_square.sqrt(), unit));
        }
    };
    add("position", "m", &|flight| deviation(&flight.position));
    add("velocity", "m/s", &|flight| velocity(flight));
    // A quaternion's component moves by half of the angle.
    let measured = |flight: &Flight, deviation: Option<f64>| deviation.filter(|_| flight.assumed.is_empty());
    add("attitude", "rad", &|flight| {
        measured(flight, deviation(&flight.attitude).map(|x| x * 4.0 / 3.0_f64.sqrt()))
    });
    add("rates", "rad/s", &|flight| measured(flight, rates(flight)));
    add("specific_force", "m/s^2", &|flight| deviation(&flight.specific_force));
    floor
}

fn velocity(flight: &Flight) -> Option<f64> {
    deviation(&flight.velocity)
        .or_else(|| Some(deviation(&flight.position)? * of_slope(flight.position.period_s()?)))
}

fn rates(flight: &Flight) -> Option<f64> {
    let of_attitude = || {
        let angle = deviation(&flight.attitude)? * 4.0 / 3.0_f64.sqrt();
        Some(angle * of_slope(flight.attitude.period_s()?))
    };
    deviation(&flight.angular_velocity).or_else(of_attitude)
}

/// Deviation of the slope of a line through three samples to both sides, of samples with deviation 1.
fn of_slope(period_s: f64) -> f64 {
    1.0 / (period_s * 28.0_f64.sqrt())
}

/// The error per channel that a perfect model has over `horizon_s` by noise alone: that of the start, carried on, and
/// that of the end. Each is the length of a vector of three axes; attitude in deg as in predictions.
pub fn prediction_floor(floor: &Floor, horizon_s: f64, gravity_m_s2: f64) -> BTreeMap<&'static str, f64> {
    let floor_of = |name| floor.get(name).map_or(0.0, |(value, _)| *value);
    let (position, velocity, rates) = (floor_of("position"), floor_of("velocity"), floor_of("rates"));
    let angle = floor_of("attitude");
    let h = horizon_s;
    let root = |squares: &[f64]| (3.0 * squares.iter().map(|x| x * x).sum::<f64>()).sqrt();
    // Only tilt, two of three axes, turns gravity into acceleration.
    let tilt = (2.0_f64 / 3.0).sqrt() * gravity_m_s2;
    let position_now =
        root(&[position, position, h * velocity, tilt * h * h / 2.0 * angle, tilt * h * h * h / 6.0 * rates]);
    let velocity_now = root(&[velocity, velocity, tilt * h * angle, tilt * h * h / 2.0 * rates]);
    let attitude_now = root(&[angle, angle, h * rates]).to_degrees();
    let rates_now = root(&[rates, rates]);
    [("position", position_now), ("velocity", velocity_now), ("attitude", attitude_now), ("rates", rates_now)]
        .into_iter()
        .filter(|(name, _)| floor.contains_key(name))
        .collect()
}

/// The noise of a channel.
#[derive(Debug, Clone, Serialize)]
pub struct Noise {
    /// Standard deviation of one axis.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// Prediction error that noise alone makes, by horizon in s, in the unit of `held_out`.
    pub prediction: BTreeMap<String, f64>,
}

/// The noise of each channel, with the prediction errors that it alone makes at these horizons.
pub fn table(floor: &Floor, horizons_s: &[f64], gravity_m_s2: f64) -> BTreeMap<&'static str, Noise> {
    let at = |name: &str, horizon_s: &f64| {
        let of_all = prediction_floor(floor, *horizon_s, gravity_m_s2);
        Some((horizon_s.to_string(), *of_all.get(name)?))
    };
    let one = |(name, (value, unit)): (&&'static str, &(f64, &'static str))| {
        let prediction = horizons_s.iter().filter_map(|horizon_s| at(name, horizon_s)).collect();
        (*name, Noise { value: *value, unit, prediction })
    };
    floor.iter().map(one).collect()
}
