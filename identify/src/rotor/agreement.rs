//! Agreement of a stand with flights: do the intervals of a value overlap?

use diagnostics::unit::RATIO;
use serde::Serialize;

use super::command_map::CommandLine;
use super::dynamics::{Dynamics, Order};
use super::flown::{Figure, Flown, FlownMotor};
use super::stand::Stand;
use super::statics::Statics;
use crate::numbers::statistics::Estimate;

/// A value that a stand and flights both determine.
#[derive(Debug, Clone, Serialize)]
pub struct Agreement {
    /// Name of the value.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// Estimate of the stand.
    pub stand: Estimate,
    /// Estimate of the flights.
    pub flights: Estimate,
    /// True if the intervals overlap.
    pub agrees: bool,
}

impl Agreement {
    fn of(name: impl Into<String>, unit: &'static str, stand: Estimate, flights: &Figure) -> Option<Self> {
        let flights = *flights.determined()?;
        let agrees = stand.low <= flights.high && flights.low <= stand.high;
        Some(Self { name: name.into(), unit, stand, flights, agrees })
    }
}

/// Compares what the stand `found` with the flights, value by value; values that one of them lacks are left out.
pub fn compared(
    stand: &Stand,
    statics: Option<&Statics>,
    dynamics: Option<&Dynamics>,
    flights: &Flown,
) -> Vec<Agreement> {
    let mut all = Vec::new();
    if let (Some(statics), Some(flown)) = (statics, &flights.coefficients) {
        let pairs = [
            ("c_T", "N/(rad/s)^2", &statics.thrust, &flown.thrust),
            ("c_Q", "N*m/(rad/s)^2", &statics.torque, &flown.torque),
        ];
        for (name, unit, stand, flown) in pairs {
            let stand = stand.as_ref().map(|stand| stand.value);
            all.extend(stand.and_then(|stand| Agreement::of(name, unit, stand, &flown.coefficient)));
        }
    }
    if let (Some(dynamics), Some(motor)) = (dynamics, &flights.motor) {
        all.extend(lags(dynamics, motor));
        all.extend(dynamics.command.iter().flat_map(|line| commands(stand, line, motor)));
    }
    all
}

fn lags(dynamics: &Dynamics, motor: &FlownMotor) -> Vec<Agreement> {
    let of = |name: &str, unit, stand: Option<Estimate>, flown: &Option<Figure>| {
        Agreement::of(name, unit, stand?, flown.as_ref()?)
    };
    let first = of("time constant", "s", dynamics.first.time_constant_s, &motor.first.time_constant);
    // A second order that neither of the two prefers says nothing.
    let is_second =
        dynamics.comparison.preferred == Order::Second && motor.comparison.preferred == Order::Second;
    let second = &dynamics.second;
    let natural =
        of("natural frequency", "rad/s", second.natural_frequency_rad_s, &motor.second.natural_frequency);
    let damping = of("damping ratio", "1", second.damping_ratio, &motor.second.damping_ratio);
    if is_second { natural.into_iter().chain(damping).collect() } else { first.into_iter().collect() }
}

/// Speeds at the ends of the stand's commands, on the line of the flights.
fn commands(stand: &Stand, line: &CommandLine, motor: &FlownMotor) -> Vec<Agreement> {
    let (min, max) = motor.command_range;
    let units: Vec<&str> = stand.dynamics.iter().map(|log| log.command.unit.as_str()).collect();
    let Some(unit) = units.first().filter(|first| units.iter().all(|unit| unit == *first)) else {
        return Vec::new();
    };
    // A share of the range in %, or the vehicle's own command.
    let command = |value: f64| match *unit {
        "%" => RATIO.factor(unit).map(|factor| min + factor * value * (max - min)),
        _ => Some(value),
    };
    let ends = [(line.min, line.speed_at_min_rad_s), (line.max, line.speed_at_max_rad_s)];
    let of_end = |(value, speed): (f64, Estimate)| {
        let command = command(value).filter(|command| (min..=max).contains(command))?;
        let name = format!("steady speed at a command of {command:.4}");
        Agreement::of(name, "rad/s", speed, &motor.speed_at(command))
    };
    ends.into_iter().filter_map(of_end).collect()
}
