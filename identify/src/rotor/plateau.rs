//! Plateaus of a log's speed, and the readings there.

use statrs::statistics::{Data, OrderStatistics};
use std::collections::VecDeque;
use std::f64::consts::PI;
use std::ops::Range;

use crate::numbers::statistics::{autocorrelation, white_noise_bound};

/// A reading of a plateau is an outlier beyond this many robust standard deviations.
const OUTLIER_SIGMAS: f64 = 6.0;
/// The robust standard deviation of normal numbers over their median absolute deviation.
const MAD_TO_SIGMA: f64 = 1.4826;
/// By this share of a reading two that would be equal may differ, as they were rounded.
const ROUNDING: f64 = 1e-9;
/// Rows before and after a row that its running median looks at.
const MEDIAN_REACH: usize = 2;
/// Equal readings in a row that are suspicious.
const STUCK_READINGS: usize = 5;
/// Below this a rotor stands still.
pub const REST_RAD_S: f64 = 1.0;

/// The plateaus of a log.
pub struct Plateaus {
    /// Rows of each, in the log's order.
    pub rows: Vec<Range<usize>>,
    /// Rows whose speed is a spike: far from the running median of five.
    pub is_spike: Vec<bool>,
}

/// Finds the rows before which the speed has been within `steady` of itself for `settle_s`.
///
/// Spikes of one or two rows do not break a plateau. A plateau ends where the speed leaves twice the band around its
/// first value, so that a slow sweep becomes many.
pub fn find(time_s: &[f64], speed: &[f64], settle_s: f64, steady: f64) -> Plateaus {
    let smooth = running_median(speed);
    let band = |row: usize| (steady * smooth[row]).max(REST_RAD_S);
    let is_spike = (0..speed.len()).map(|row| (speed[row] - smooth[row]).abs() > band(row)).collect();
    let mut plateaus: Vec<Range<usize>> = Vec::new();
    let mut first = 0;
    let mut extremes = Extremes::default();
    for row in 0..speed.len() {
        while time_s[row] - time_s[first] > settle_s {
            first += 1;
        }
        let (low, high) = extremes.range(&smooth, first, row);
        let is_long = first > 0;
        if !is_long || high - low > band(row) {
            continue;
        }
        match plateaus.last_mut() {
            Some(last) if last.end == row && (smooth[row] - smooth[last.start]).abs() <= 2.0 * band(row) => {
                last.end = row + 1;
            }
            _ => plateaus.push(row..row + 1),
        }
    }
    Plateaus { rows: plateaus, is_spike }
}

/// The smallest and the largest of a stretch of rows that moves on: each row is looked at once, however many rows the
/// stamps put into a stretch.
#[derive(Default)]
struct Extremes {
    /// Rows of the stretch whose values grow, the smallest first.
    low: VecDeque<usize>,
    /// The same, the largest first.
    high: VecDeque<usize>,
}

impl Extremes {
    /// Those of the rows from `first` to `row`; both grow from call to call, `row` by one.
    fn range(&mut self, values: &[f64], first: usize, row: usize) -> (f64, f64) {
        while self.low.pop_back_if(|last| values[*last] >= values[row]).is_some() {}
        while self.high.pop_back_if(|last| values[*last] <= values[row]).is_some() {}
        self.low.push_back(row);
        self.high.push_back(row);
        while self.low.pop_front_if(|at| *at < first).is_some() {}
        while self.high.pop_front_if(|at| *at < first).is_some() {}
        (values[self.low[0]], values[self.high[0]])
    }
}

/// The rows of a plateau, each with a squared speed and a reading, without those whose reading is an outlier, and how many
/// these are. What the speed explains is no outlier: within a plateau it may still settle.
pub fn without_outliers(rows: Vec<(f64, f64)>) -> (Vec<(f64, f64)>, usize) {
    let squares: Vec<f64> = rows.iter().map(|(squared, _)| *squared).collect();
    let readings: Vec<f64> = rows.iter().map(|(_, reading)| *reading).collect();
    let (square, middle) = (median(&squares), median(&readings));
    let off: Vec<f64> = rows.iter().map(|(squared, reading)| reading - middle * squared / square).collect();
    let (centre, scatter) = (median(&off), OUTLIER_SIGMAS * spread(&off));
    let bound = scatter.max(ROUNDING * middle.abs());
    let all = rows.len();
    let kept = rows.into_iter().zip(off).filter(|(_, off)| (off - centre).abs() <= bound);
    let kept: Vec<(f64, f64)> = kept.map(|(row, _)| row).collect();
    let outliers = all - kept.len();
    (kept, outliers)
}

/// The standard deviation, estimated from the median absolute deviation.
pub fn spread(values: &[f64]) -> f64 {
    let middle = median(values);
    let deviations: Vec<f64> = values.iter().map(|value| (value - middle).abs()).collect();
    MAD_TO_SIGMA * median(&deviations)
}

/// The standard error of the median of correlated readings. It is that of as many normal numbers as the
/// autocorrelation leaves independent. The autocorrelation is summed up to where it cannot be distinguished
/// from 0 (Bartlett 1946; Sokal, "Monte Carlo methods in statistical mechanics", 1997, section 3).
pub fn median_error(values: &[f64]) -> f64 {
    let (n, scatter) = (values.len(), spread(values));
    if scatter <= 0.0 || n < 2 {
        return 0.0;
    }
    let noise = white_noise_bound(n, 0.95);
    let remembered = autocorrelation(values, n - 1).into_iter().skip(1).take_while(|r| *r > noise);
    let memory = 1.0 + 2.0 * remembered.sum::<f64>();
    scatter * (0.5 * PI * memory / n as f64).sqrt()
}

/// The median; NaN of nothing.
pub fn median(values: &[f64]) -> f64 {
    Data::new(values.to_vec()).median()
}

/// Returns a finding about a log whose speeds repeat themselves.
pub fn stuck_finding(log: &str, speed: &[f64]) -> Option<String> {
    let (stuck, top) = stuck(speed, STUCK_READINGS);
    (stuck > 0).then(|| {
        format!(
            "{log}: {stuck} speeds stand in runs of {STUCK_READINGS} or more equal readings ({top} of them at the largest \
             reading: saturation if many): the sensor repeats itself"
        )
    })
}

/// Counts the readings in runs of at least `shortest` equal ones while the rotor turns. Counts those among
/// them that equal the largest reading of all.
fn stuck(values: &[f64], shortest: usize) -> (usize, usize) {
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let runs = values.chunk_by(|a, b| a == b).filter(|run| run.len() >= shortest && run[0] > REST_RAD_S);
    runs.fold((0, 0), |(all, top), run| {
        (all + run.len(), top + if run[0] == largest { run.len() } else { 0 })
    })
}

/// The median of five readings about each; fewer at the ends.
fn running_median(values: &[f64]) -> Vec<f64> {
    let window = |row: usize| row.saturating_sub(MEDIAN_REACH)..(row + MEDIAN_REACH + 1).min(values.len());
    (0..values.len()).map(|row| median(&values[window(row)])).collect()
}

/// The smallest and the largest.
pub fn range(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plateau_begins_after_settling_and_outlives_a_spike() {
        let time_s: Vec<f64> = (0..200).map(|row| f64::from(row) * 0.05).collect();
        let mut speed: Vec<f64> = (0..200).map(|row| if row < 100 { 300.0 } else { 400.0 }).collect();
        speed[150] = 900.0;
        let found = find(&time_s, &speed, 1.0, 0.02);
        assert_eq!(found.rows, [21..100, 120..200]);
        assert_eq!(found.is_spike.iter().filter(|spike| **spike).count(), 1);
    }

    #[test]
    fn the_extremes_are_those_of_each_stretch() {
        let values: Vec<f64> = (0..300).map(|row| f64::from((row * 7919) % 101)).collect();
        let (mut extremes, mut first) = (Extremes::default(), 0);
        for row in 0..values.len() {
            if row % 23 == 0 {
                first = row.saturating_sub(5);
            }
            assert_eq!(extremes.range(&values, first, row), range(&values[first..=row]));
        }
    }

    #[test]
    fn what_the_speed_explains_is_no_outlier_even_without_noise() {
        let settling = |row: i32| 400.0 + 8.0 * libm::exp(-0.1 * f64::from(row));
        let mut rows: Vec<(f64, f64)> =
            (0..200).map(|row| settling(row).powi(2)).map(|squared| (squared, 4e-6 * squared)).collect();
        assert_eq!(without_outliers(rows.clone()), (rows.clone(), 0));
        rows[70].1 *= 1.01;
        let (kept, outliers) = without_outliers(rows.clone());
        assert_eq!((kept.len(), outliers), (199, 1));
        assert!(!kept.contains(&rows[70]));
    }

    #[test]
    fn the_median_of_readings_that_remember_is_less_certain() {
        let mut random = component::random::stream(1, "stand");
        let fresh: Vec<f64> = (0..400).map(|_| component::random::normal(&mut random)).collect();
        // That of the median of 400 normal numbers is 1.253 / 20.
        assert!((median_error(&fresh) / 0.0627 - 1.0).abs() < 0.15, "{}", median_error(&fresh));
        let held: Vec<f64> = fresh.iter().flat_map(|value| [*value; 4]).collect();
        let ratio = median_error(&held) / median_error(&fresh);
        assert!((ratio - 1.0).abs() < 0.15, "{ratio}: four equal readings are one");
        assert_eq!(median_error(&[0.5; 100]), 0.0);
    }

    #[test]
    fn equal_readings_in_a_row_are_counted() {
        assert_eq!(stuck(&[0.0, 0.0, 5.0, 5.0, 5.0, 4.0, 9.0, 9.0, 9.0], 3), (6, 3));
    }
}
