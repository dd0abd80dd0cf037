//! The rest of a firmware on level ground before tick 0, in which its sensors settle and it is armed.

use crate::autopilot::{Autopilot, Sensed, Throttles};
use bus::Bounded;
use bus::messages::{Imu, RcChannels, StateEstimate};
use vehicles::Vehicle;

/// Pulses of the sticks at rest: roll, pitch, throttle and yaw, us.
const STICKS_US: [f64; 4] = [1500.0, 1500.0, 1000.0, 1500.0];
/// Pulses of a switch that is on, or off, us.
const ON_US: f64 = 2000.0;
const OFF_US: f64 = 1000.0;

/// A rest before tick 0.
#[derive(Clone, Copy, Debug)]
pub struct Rest {
    /// Its time, s.
    pub time_s: f64,
    /// The last part of that with the arming switch on, s.
    pub armed_s: f64,
    /// The channel of that switch, counted from 1; none where the pilot arms.
    pub armed_by_channel: Option<usize>,
    /// Time between two exchanges, s.
    pub period_s: f64,
}

impl Rest {
    /// Lets the firmware stand still, level and at the origin; true if it is armed as it should be.
    ///
    /// # Errors
    /// An exchange fails.
    pub fn of<A: Autopilot>(&self, autopilot: &A, link: &mut A::Link) -> Result<bool, String> {
        let imu = imu_at_rest(autopilot.vehicle());
        let estimate = autopilot.origin().east_north_up(&StateEstimate::default());
        let (all, armed) = (steps(self.time_s, self.period_s), steps(self.armed_s, self.period_s));
        let mut throttles = Throttles::default();
        for step in 0..all {
            let rc = self.rc(step + armed >= all);
            let time_s = (step as f64 - all as f64) * self.period_s;
            throttles = autopilot.exchange(
                link,
                &Sensed { time_s, imu: &imu, estimate: &estimate, rc: &rc, is_rc_new: true },
            )?;
        }
        Ok(self.armed_by_channel.is_none() || throttles.iter().any(|throttle| *throttle > 0.0))
    }

    /// The remote control at rest.
    fn rc(&self, is_armed: bool) -> RcChannels {
        let channels = self.armed_by_channel.filter(|_| is_armed).unwrap_or(STICKS_US.len());
        let pulse = |at: usize| match STICKS_US.get(at) {
            Some(stick) => *stick,
            None if at + 1 == channels => ON_US,
            None => OFF_US,
        };
        RcChannels { pulse: Bounded::from_fn(channels, pulse), ..RcChannels::default() }
    }
}

/// Accelerometer and gyroscope of a vehicle that stands on level ground.
#[must_use]
pub fn imu_at_rest(vehicle: &Vehicle) -> Imu {
    Imu { specific_force: [0.0, 0.0, vehicle.gravity_m_s2].into(), ..Imu::default() }
}

/// Pulse of a channel, us; a stick that is not sent is at rest, a switch that is not sent is off.
#[must_use]
pub fn pulse_us(rc: &RcChannels, at: usize) -> u16 {
    let absent = STICKS_US.get(at).copied().unwrap_or(OFF_US);
    rounded(rc.pulse.get(at).copied().unwrap_or(absent))
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 800 and 2200 by clamp")]
fn rounded(us: f64) -> u16 {
    us.clamp(800.0, 2200.0).round() as u16
}

/// Steps in a time.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
pub fn steps(time_s: f64, period_s: f64) -> u64 {
    (time_s / period_s).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_switch_is_on_in_the_last_part_alone() {
        let rest = Rest { time_s: 5.0, armed_s: 1.0, armed_by_channel: Some(6), period_s: 1e-3 };
        assert_eq!(rest.rc(false).pulse, [1500.0, 1500.0, 1000.0, 1500.0]);
        assert_eq!(rest.rc(true).pulse, [1500.0, 1500.0, 1000.0, 1500.0, 1000.0, 2000.0]);
        let by_pilot = Rest { armed_by_channel: None, ..rest };
        assert_eq!(by_pilot.rc(true).pulse.len(), 4);
    }

    #[test]
    fn channels_that_are_not_sent_are_at_rest() {
        let rc = RcChannels { pulse: [1500.6, 9000.0].into(), ..RcChannels::default() };
        let pulses: [u16; 6] = std::array::from_fn(|at| pulse_us(&rc, at));
        assert_eq!(pulses, [1501, 2200, 1000, 1500, 1000, 1000]);
    }
}
