//! Lone samples that no vehicle and no sensor makes: a value far away that returns at once, as flipped bits and misread
//! frames give. Rotor speeds and attitudes have rules of their own (`spikes`, `jumps`); positions that do not return are `jumps`, too.

use crate::flight::{Channel, median};
use crate::quantity::Quantity;
use vehicles::Vehicle;

/// Most samples one after the other that are wrong together.
const RUN_MAX: usize = 3;
/// The samples before and behind agree within this part of the way to the wrong ones: the value returns.
const RETURNS: f64 = 0.1;
/// A wrong value is further from its neighbours than this many times the usual distance of neighbours: noise is not.
const UNUSUAL: f64 = 12.0;
/// More wrong samples than this share are no accident, but another unit or another sensor.
const SHARE_MAX: f64 = 0.05;
/// Commands lie outside the vehicle's range by more than this part of it.
const BEYOND: f64 = 0.5;

/// A voltage that goes and returns by less than this part of it may be a load's.
const OF_PACK: f64 = 0.3;

/// Distances that no value goes and returns from.
struct Limits {
    /// Least distance.
    least: f64,
    /// Greatest rate of change.
    per_s: f64,
}

impl Limits {
    fn of(quantity: Quantity) -> Option<Self> {
        match quantity {
            // As in `jumps`: 500 rad/s^2 and 50 m/s^2 are several times what rotors can do.
            Quantity::AngularVelocity => Some(Self { least: 2.0, per_s: 500.0 }),
            Quantity::Position => Some(Self { least: 0.3, per_s: 25.0 }),
            Quantity::Velocity => Some(Self { least: 0.5, per_s: 50.0 }),
            // Full scale of most accelerometers, 16 g: an impact may fill it.
            Quantity::SpecificForce => Some(Self { least: 160.0, per_s: 0.0 }),
            // Half of a cell; [`without`] asks for more of a pack.
            Quantity::BatteryVoltage => Some(Self { least: 2.0, per_s: 0.0 }),
            _ => None,
        }
    }
}

/// Marks the samples of a measured channel that are not glitches.
pub fn without<const N: usize>(quantity: Quantity, channel: &Channel<N>) -> Vec<bool> {
    let whole = vec![true; channel.values.len()];
    let Some(limits) = Limits::of(quantity) else { return whole };
    // A load lowers the voltage of a pack of many cells by volts, and in a slow log it returns in the next sample.
    let least = match quantity {
        Quantity::BatteryVoltage => {
            let voltage = median(channel.values.iter().map(|values| values[0])).unwrap_or(0.0);
            limits.least.max(OF_PACK * voltage)
        }
        _ => limits.least,
    };
    let usual: [f64; N] = std::array::from_fn(|axis| usual_step(channel, axis));
    let is_far = |sample: usize, other: usize, axis: usize| {
        let span_s = (channel.time_s[sample] - channel.time_s[other]).abs();
        let limit = least.max(limits.per_s * span_s).max(UNUSUAL * usual[axis]);
        distance(channel, sample, other, axis) > limit
    };
    kept(channel, is_far)
}

/// Marks the samples of the commands that are not glitches: far outside the vehicle's range, where its neighbours are not.
pub fn without_commands<const N: usize>(channel: &Channel<N>, vehicle: &Vehicle) -> Vec<bool> {
    let (map, rotors) = (vehicle.command, vehicle.rotors.len().min(N));
    let beyond = BEYOND * (map.max - map.min);
    let is_outside = |number: f64| number > map.max + beyond || number < (map.min - beyond).min(0.0);
    kept(channel, |sample, other, rotor| {
        let [here, there] = [sample, other].map(|at| channel.values[at][rotor]);
        rotor < rotors && is_outside(here) && !is_outside(there)
    })
}

/// Marks the samples outside of short runs that are far from what is before and behind them.
fn kept<const N: usize>(channel: &Channel<N>, is_far: impl Fn(usize, usize, usize) -> bool) -> Vec<bool> {
    let count = channel.values.len();
    let mut is_kept = vec![true; count];
    let is_run = |from: usize, to: usize, axis: usize| {
        let neighbours = neighbours(from, to, count);
        let Some([before, behind]) = neighbours else { return false };
        let mut way = f64::INFINITY;
        for sample in from..to {
            for other in [before, behind] {
                if !is_far(sample, other, axis) {
                    return false;
                }
                way = way.min(distance(channel, sample, other, axis));
            }
        }
        distance(channel, before, behind, axis) <= RETURNS * way
    };
    let mut from = 0;
    while from < count {
        let of_length = |length: &usize| (0..N).any(|axis| is_run(from, from + length, axis));
        let length = (1..=RUN_MAX).find(of_length).unwrap_or(0);
        is_kept[from..from + length].fill(false);
        from += length.max(1);
    }
    let wrong = is_kept.iter().filter(|is_kept| !**is_kept).count();
    if wrong as f64 > SHARE_MAX * count as f64 { vec![true; count] } else { is_kept }
}

/// The samples before and behind a run. At an end of the channel, the two next ones, for a run of one sample.
fn neighbours(from: usize, to: usize, count: usize) -> Option<[usize; 2]> {
    match (from.checked_sub(1), (to < count).then_some(to)) {
        (Some(before), Some(behind)) => Some([before, behind]),
        (None, Some(behind)) if to == 1 && to + 1 < count => Some([behind, behind + 1]),
        (Some(before), None) if to == from + 1 && before > 0 => Some([before - 1, before]),
        _ => None,
    }
}

fn distance<const N: usize>(channel: &Channel<N>, a: usize, b: usize, axis: usize) -> f64 {
    (channel.values[a][axis] - channel.values[b][axis]).abs()
}

fn usual_step<const N: usize>(channel: &Channel<N>, axis: usize) -> f64 {
    median((1..channel.values.len()).map(|at| distance(channel, at - 1, at, axis))).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rates that swing by 6 rad/s at 100 Hz, with noise.
    fn rates() -> Channel<3> {
        let time_s: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
        let rate = |(k, t): (usize, &f64)| {
            let noise = 0.02 * (((k * 7919) % 1009) as f64 / 504.5 - 1.0);
            [6.0 * libm::sin(8.0 * t) + noise, 2.0 * libm::cos(3.0 * t), noise]
        };
        Channel { values: time_s.iter().enumerate().map(rate).collect(), time_s }
    }

    fn left_out(is_kept: &[bool]) -> Vec<usize> {
        (0..is_kept.len()).filter(|at| !is_kept[*at]).collect()
    }

    #[test]
    fn values_that_return_at_once_are_glitches() {
        let mut channel = rates();
        channel.values[0][0] = 1e30;
        channel.values[50][2] = -35.0;
        channel.values[90][1] = 1e9;
        channel.values[91][1] = -1e9;
        channel.values[300..303].iter_mut().for_each(|rates| rates[0] = 200.0);
        channel.values[999][1] = f64::MAX;
        let found = left_out(&without(Quantity::AngularVelocity, &channel));
        assert_eq!(found, [0, 50, 90, 91, 300, 301, 302, 999]);
    }

    #[test]
    fn motion_steps_and_impacts_are_not_glitches() {
        let channel = rates();
        assert_eq!(left_out(&without(Quantity::AngularVelocity, &channel)), [0; 0]);
        // A propeller strikes something: the rate stays changed.
        let mut struck = channel.clone();
        struck.values[500..].iter_mut().for_each(|rates| rates[2] += 15.0);
        assert_eq!(left_out(&without(Quantity::AngularVelocity, &struck)), [0; 0]);
        // A touch of the ground that rings, as a Crazyflie felt it at 100 Hz.
        let mut touched = channel.clone();
        for (at, rate) in [-18.1, 3.7, 1.1, 0.9, -1.8].into_iter().enumerate() {
            touched.values[400 + at][2] = rate;
        }
        assert_eq!(left_out(&without(Quantity::AngularVelocity, &touched)), [0; 0]);
        // A flip that lasts four samples of a slow log.
        let mut slow = channel.clone();
        slow.time_s.iter_mut().for_each(|time_s| *time_s *= 10.0);
        slow.values[500][2] = 20.0;
        assert_eq!(left_out(&without(Quantity::AngularVelocity, &slow)), [0; 0]);
        // A hard landing, felt in one sample.
        let mut landed = channel.clone();
        landed.values[700][2] = 120.0;
        assert_eq!(left_out(&without(Quantity::SpecificForce, &landed)), [0; 0]);
        landed.values[700][2] = -1e20;
        assert_eq!(left_out(&without(Quantity::SpecificForce, &landed)), [700]);
    }

    #[test]
    fn values_that_are_often_far_away_are_no_glitches() {
        let mut channel = rates();
        (0..1000).step_by(10).for_each(|at| channel.values[at][0] = 500.0);
        assert_eq!(left_out(&without(Quantity::AngularVelocity, &channel)), [0; 0]);
    }

    #[test]
    fn commands_far_outside_the_range_are_glitches_and_pulses_are_not() {
        let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let time_s: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        let mut channel = Channel { values: vec![[76.0; 4]; 200], time_s };
        channel.values[20][1] = 200.0;
        channel.values[30][2] = 0.0;
        channel.values[40][3] = 210.0;
        assert_eq!(left_out(&without_commands(&channel, &vehicle)), [0; 0]);
        channel.values[50][0] = 1e9;
        channel.values[60][0] = -1e9;
        assert_eq!(left_out(&without_commands(&channel, &vehicle)), [50, 60]);
        channel.values.iter_mut().for_each(|commands| *commands = [1500.0; 4]);
        assert_eq!(left_out(&without_commands(&channel, &vehicle)), [0; 0]);
    }

    #[test]
    fn short_channels_have_no_glitches() {
        for count in 0..3_usize {
            let time_s = (0..count).map(|at| at as f64).collect();
            let channel = Channel { values: (0..count).map(|at| [1e9 * at as f64]).collect(), time_s };
            assert_eq!(without(Quantity::AngularVelocity, &channel), vec![true; count]);
        }
    }
}
