//! Stretches in which the attitude does not change at all, although the gyroscope turns: an attitude that is filled in, or whose
//! measurement was lost.

use crate::flight::Channel;
use crate::held;

/// A gyroscope that turns by less than this may be noise, in rad: 10 degrees. White noise of 0.1 rad/s at 100 Hz adds up to half of
/// that in a minute.
const TURNED_MIN_RAD: f64 = 0.17;

/// A stretch of one attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Still {
    /// Time of its first sample.
    pub from_s: f64,
    /// Time of its last.
    pub to_s: f64,
    /// Largest turn about one axis in it, by the gyroscope without its mean, in rad.
    pub turned_rad: f64,
}

/// The stretch of one attitude in which the gyroscope turns most; `None` if it does so in none.
pub fn turning(attitude: &Channel<4>, angular_velocity: &Channel<3>) -> Option<Still> {
    let mut starts: Vec<usize> = held::starts(&attitude.values).collect();
    starts.push(attitude.values.len());
    let stills = starts.windows(2).map(|pair| {
        let (from_s, to_s) = (attitude.time_s[pair[0]], attitude.time_s[pair[1] - 1]);
        Still { from_s, to_s, turned_rad: turned_rad(angular_velocity, from_s, to_s) }
    });
    let most = stills.max_by(|a, b| a.turned_rad.total_cmp(&b.turned_rad));
    most.filter(|most| most.turned_rad > TURNED_MIN_RAD)
}

/// The range of the rates' integrals between two times, without their mean: a bias turns nothing.
fn turned_rad(rates: &Channel<3>, from_s: f64, to_s: f64) -> f64 {
    let index = |time_s: f64| rates.time_s.partition_point(|sample_s| *sample_s < time_s);
    let (first, end) = (index(from_s), index(to_s));
    let steps = || (first..end).skip(1).map(|k| (k, rates.time_s[k] - rates.time_s[k - 1]));
    let whole_s: f64 = steps().map(|(_, step_s)| step_s).sum();
    let range = |axis: usize| {
        let mean = steps().map(|(k, step_s)| rates.values[k][axis] * step_s).sum::<f64>() / whole_s;
        let (mut angle, mut low, mut high) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (k, step_s) in steps() {
            angle += (rates.values[k][axis] - mean) * step_s;
            (low, high) = (low.min(angle), high.max(angle));
        }
        high - low
    };
    if whole_s > 0.0 { (0..3).map(range).fold(0.0, f64::max) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel<const N: usize>(value: impl Fn(f64) -> [f64; N]) -> Channel<N> {
        let time_s: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        Channel { values: time_s.iter().map(|time_s| value(*time_s)).collect(), time_s }
    }

    #[test]
    fn a_lost_attitude_is_found_and_a_bias_is_not() {
        let turning_rates = channel(|t| [0.5 * libm::sin(t), 0.0, 0.0]);
        let frozen = channel(|t| [1.0, if t < 5.0 { 0.01 * t } else { 0.05 }, 0.0, 0.0]);
        let still = turning(&frozen, &turning_rates).unwrap();
        assert!((still.from_s - 5.0).abs() < 0.02 && still.to_s > 19.9, "{still:?}");
        assert!((0.8..1.2).contains(&still.turned_rad), "{still:?}");
        assert_eq!(turning(&channel(|t| [1.0, 0.01 * t, 0.0, 0.0]), &turning_rates), None);
        let constant = channel(|_| [1.0, 0.0, 0.0, 0.0]);
        assert!(turning(&constant, &turning_rates).is_some());
        assert_eq!(turning(&constant, &channel(|_| [0.3, -0.2, 0.1])), None);
        assert_eq!(turning(&constant, &Channel::default()), None);
        assert_eq!(turning(&Channel::default(), &turning_rates), None);
    }
}
