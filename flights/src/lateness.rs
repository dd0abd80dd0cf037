//! Lateness of the gyroscope against the attitude: two clocks in one log, or files that were started apart.

use crate::agreement::Pairs;
use crate::flight::Channel;

/// Clocks that are further apart are not found.
const REACH_S: f64 = 2.0;
/// Steps of the search, and of a finer one about its best.
const STEP_S: f64 = 0.04;
const FINE_STEP_S: f64 = 0.01;
/// Correlation of channels that measure the same, at the right lateness.
const SAME: f64 = 0.9;

/// Lateness with which two channels agree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Late {
    /// Time by which the gyroscope's stamps are late, in s.
    pub late_s: f64,
    /// Correlation with it.
    pub correlation: f64,
}

/// Finds the lateness with which `rates` are the derivative of `attitude` over windows of `window_s`; `None` if they are not
/// at any.
pub fn of_rates(attitude: &Channel<4>, rates: &Channel<3>, window_s: f64, quiet: f64) -> Option<Late> {
    let at = |late_s: f64| {
        let time_s = rates.time_s.iter().map(|time_s| time_s - late_s).collect();
        let moved = Channel { time_s, values: rates.values.clone() };
        let agreement = Pairs::rates(attitude, &moved, window_s).agreement(quiet)?;
        Some(Late { late_s, correlation: agreement.correlation })
    };
    let best = |about_s: f64, reach_s: f64, step_s: f64| {
        let steps = (reach_s / step_s).round() as i32;
        let all = (-steps..=steps).filter_map(|step| at(about_s + f64::from(step) * step_s));
        all.max_by(|a, b| a.correlation.total_cmp(&b.correlation))
    };
    let coarse = best(0.0, REACH_S, STEP_S)?;
    best(coarse.late_s, STEP_S, FINE_STEP_S).filter(|late| late.correlation > SAME)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame;

    /// A flight of 20 s at 100 Hz whose gyroscope is `late_s` late.
    fn flight(late_s: f64) -> (Channel<4>, Channel<3>) {
        let angle = |t: f64| 0.4 * libm::sin(2.3 * t) + 0.2 * libm::sin(5.1 * t);
        let rate = |t: f64| 0.92 * libm::cos(2.3 * t) + 1.02 * libm::cos(5.1 * t);
        let time_s: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let attitude = time_s.iter().map(|t| frame::euler([angle(*t), 0.0, 0.0])).collect();
        let rates = time_s.iter().map(|t| [rate(t - late_s), 0.0, 0.0]).collect();
        (Channel { time_s: time_s.clone(), values: attitude }, Channel { time_s, values: rates })
    }

    #[test]
    fn a_late_gyroscope_is_found_by_how_much() {
        for late_s in [-1.2, -0.3, 0.0, 0.6, 1.0] {
            let (attitude, rates) = flight(late_s);
            let found = of_rates(&attitude, &rates, 0.1, 0.05).unwrap();
            assert!((found.late_s - late_s).abs() < 0.021, "{late_s}: {found:?}");
        }
    }

    #[test]
    fn a_gyroscope_of_another_flight_is_late_by_nothing() {
        let (attitude, _) = flight(0.0);
        let (_, mut rates) = flight(0.0);
        rates.values.iter_mut().enumerate().for_each(|(at, rate)| rate[0] = libm::sin(0.13 * at as f64));
        assert_eq!(of_rates(&attitude, &rates, 0.1, 0.05), None);
    }
}
