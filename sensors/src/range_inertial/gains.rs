//! Changes of the velocity since an earlier time by the accelerometer, for measurements that come late.
//!
//! A late velocity is compared with the *present* estimate of the velocity then: that of now, less the gain
//! since. The estimate of that time would not do. Corrections made since, by earlier samples, would be found
//! missing again and made once more. Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking
//! and Navigation, section 7.7, treats measurements that are out of sequence.

use crate::wire::{vector, vector_message};
use component::Message;
use component::messages::Vector3 as Vector3Message;
use nalgebra::Vector3;

/// Number of sums that are kept.
const KEPT: usize = 128;

/// Time between two that are kept at least, s, in whole samples. Between them, the gain is taken as linear.
/// So at least 1.27 s can be looked back: more than the delay of any receiver (u-blox NEO-M8 data sheet: a navigation
/// rate of 5 Hz and more).
const SPACING_S: f64 = 0.01;

/// Sums of the acceleration, its bias not taken off.
#[derive(Clone, Copy, Debug, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/RangeInertialGains")]
pub struct Gains {
    /// Samples so far.
    samples: u64,
    /// The sum of all.
    #[field(unit = "m/s", frame = "world")]
    total: Vector3Message,
    /// The sum as it was every 10 ms, the k-th of these at the place k modulo the number of places.
    #[field(unit = "m/s", frame = "world")]
    kept: [Vector3Message; KEPT],
}

impl Default for Gains {
    fn default() -> Self {
        Self { samples: 0, total: Vector3Message::default(), kept: [Vector3Message::default(); KEPT] }
    }
}

/// The time was too long ago; holds the longest time that is known, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TooLongAgo(pub(super) f64);

impl Gains {
    /// Adds the gain of a sample.
    pub(super) fn add(&mut self, gained_W_m_s: &Vector3<f64>, period_s: f64) {
        self.total = vector_message(vector(self.total) + gained_W_m_s);
        let stride = stride(period_s);
        if self.samples.is_multiple_of(stride) {
            self.kept[(self.samples / stride) as usize % KEPT] = self.total;
        }
        self.samples += 1;
    }

    /// Returns the gain over the last `age_s`, m/s along the world's axes; `None` if that is longer than the flight.
    pub(super) fn since(&self, age_s: f64, period_s: f64) -> Result<Option<Vector3<f64>>, TooLongAgo> {
        let stride = stride(period_s);
        let newest = self.samples.saturating_sub(1);
        let at = newest as f64 - age_s / period_s;
        if at < 0.0 {
            return Ok(None);
        }
        let (before, last) = (at as u64 / stride, newest / stride);
        if last - before >= KEPT as u64 {
            return Err(TooLongAgo((KEPT as u64 - 1) as f64 * stride as f64 * period_s));
        }
        let kept = |k: u64| vector(self.kept[k as usize % KEPT]);
        let from = before * stride;
        let (to, after) =
            if before < last { (from + stride, kept(before + 1)) } else { (newest, vector(self.total)) };
        let part = if to > from { (at - from as f64) / (to - from) as f64 } else { 0.0 };
        Ok(Some(vector(self.total) - kept(before).lerp(&after, part)))
    }
}

fn stride(period_s: f64) -> u64 {
    // A quotient that is whole but for rounding is whole.
    ((SPACING_S / period_s - 1e-9).ceil() as u64).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A gain that grows with the square of time, as that of a tilt which grows.
    #[test]
    fn what_was_gained_since_any_time_is_known_for_more_than_a_second() {
        for period_s in [1e-3, 4e-3, 7e-3, 0.02] {
            let sum = |time_s: f64| Vector3::new(0.5, -1.0, 0.2) * time_s * time_s;
            let (mut gains, mut samples) = (Gains::default(), 0_u32);
            while f64::from(samples) * period_s < 3.0 {
                let time_s = f64::from(samples) * period_s;
                gains.add(&(sum(time_s) - sum((time_s - period_s).max(0.0))), period_s);
                samples += 1;
            }
            let now_s = f64::from(samples - 1) * period_s;
            for age_s in [0.0, 0.5e-3, 0.0123, 0.2, 0.777, 1.25] {
                let found = gains.since(age_s, period_s).unwrap().unwrap();
                let off = found - (sum(now_s) - sum(now_s - age_s));
                // A parabola against its chord over the spacing.
                let bound = sum(stride(period_s) as f64 * period_s).norm() / 4.0 + 1e-12;
                assert!(off.norm() <= bound, "{period_s} s, {age_s} s ago: off by {off}");
            }
            let TooLongAgo(reach_s) = gains.since(2.9, period_s).map(|_| ()).err().unwrap_or(TooLongAgo(2.9));
            assert!(reach_s >= 1.27 - 1e-9, "{reach_s}");
            assert_eq!(gains.since(3.5, period_s), Ok(None), "before the flight");
        }
    }
}
