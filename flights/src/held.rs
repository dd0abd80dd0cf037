//! Repeated values: held on a finer grid than the sensor's, or of a sensor that is coarse.
//!
//! A held sample repeats all its components at once, and when it changes, all change. The components of a coarse sensor
//! change each by itself: where one changes, the others often stay. From how often they stay follows how often all of them
//! stay by chance; repeats beyond that are held.

use crate::frame;

/// Repeats are systematic, a value held on a finer grid, if this share of the distinct values is repeated.
const HELD_SHARE: f64 = 0.1;
/// Runs of repeats are those of a grid if this share has about the length of the others.
const REGULAR_SHARE: f64 = 0.9;
/// And this is how far from it a length may be, as a share of it.
const REGULAR_TOLERANCE: f64 = 0.25;
/// A sensor is coarse if it explains this share of the repeats. In simulated flights, coarse gyroscopes and
/// positions explain 0.65 and more. Those that are held on another grid explain 0.22 and less, unless they
/// are coarse as well.
const COARSE_SHARE: f64 = 0.4;
/// Changes over which the vehicle moves alike.
const WINDOW: usize = 20;
/// Steps until the chance of a repeat is found.
const ITERATIONS: usize = 100;
/// Angles that differ by less than this are the same, in rad: they are computed from quaternions.
const SAME_RAD: f64 = 1e-9;

/// True if `values` repeat because they are held on a finer grid.
pub fn is_held<const N: usize>(values: &[[f64; N]]) -> bool {
    let starts: Vec<usize> = starts(values).collect();
    let runs: Vec<usize> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let long = runs.iter().filter(|run| **run > 1).count() as f64;
    if starts.len() <= 2 || long < HELD_SHARE * starts.len() as f64 {
        return false;
    }
    let of_chance = || {
        let changed = |index: usize| values[starts[index]];
        let of_angles =
            || chance(starts.len(), |index| angles(&changed(index)).unwrap_or_default(), SAME_RAD);
        chance(starts.len(), changed, 0.0).max(if N == 4 { of_angles() } else { 0.0 })
    };
    is_regular(&runs) || of_chance() < COARSE_SHARE * long / runs.len() as f64
}

/// The first index of each run of equal values, where the runs are those of a finer grid.
pub fn regular_starts<const N: usize>(values: &[[f64; N]]) -> Option<Vec<usize>> {
    let starts: Vec<usize> = starts(values).collect();
    let runs: Vec<usize> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
    (runs.len() >= 2 && is_regular(&runs)).then_some(starts)
}

/// The first index of each run of equal values.
pub fn starts<const N: usize>(values: &[[f64; N]]) -> impl Iterator<Item = usize> {
    (0..values.len()).filter(|&index| index == 0 || values[index] != values[index - 1])
}

/// True if runs of repeats are of one length, as a finer grid makes them.
fn is_regular(runs: &[usize]) -> bool {
    let mut sorted = runs.to_vec();
    sorted.sort_unstable();
    let median = sorted[sorted.len() / 2] as f64;
    let is_near = |run: &&usize| (**run as f64 - median).abs() <= REGULAR_TOLERANCE * median;
    median >= 2.0 && runs.iter().filter(is_near).count() as f64 >= REGULAR_SHARE * runs.len() as f64
}

/// Roll, pitch and yaw of a quaternion: a log of coarse angles has coarse ones, although the quaternions are not.
fn angles(value: &[f64]) -> Option<[f64; 3]> {
    let wxyz: [f64; 4] = value.try_into().ok()?;
    let (roll, pitch, yaw) = frame::rotation(wxyz).euler_angles();
    Some([roll, pitch, yaw])
}

/// The chance that a value of the sensor equals the one before, from `count` values of which none does.
fn chance<const N: usize>(count: usize, value: impl Fn(usize) -> [f64; N], same: f64) -> f64 {
    let stays = |index: usize| -> [bool; N] {
        let (before, after) = (value(index), value(index + 1));
        std::array::from_fn(|component| (before[component] - after[component]).abs() <= same)
    };
    let stays: Vec<[bool; N]> = (0..count - 1).map(stays).collect();
    let varies = |component: &usize| stays.iter().any(|stays| !stays[*component]);
    let components: Vec<usize> = (0..N).filter(varies).collect();
    if let [component] = components[..] {
        return chance_of_one((0..count).map(|index| value(index)[component]), same);
    }
    let windows = stays.chunks(WINDOW).map(|window| {
        let stay = |component: &usize| {
            window.iter().filter(|stays| stays[*component]).count() as f64 / window.len() as f64
        };
        let shares: Vec<f64> = components.iter().map(stay).collect();
        // Seen are changes alone, so that each component stays more often than these say, by the chance itself.
        let next = |chance: f64, _| shares.iter().map(|share| share * (1.0 - chance) + chance).product();
        (0..ITERATIONS).fold(0.0, next) * window.len() as f64
    });
    windows.sum::<f64>() / stays.len() as f64
}

/// The same for one component: a coarse one changes mostly by its smallest step, which it then often does not do.
fn chance_of_one(values: impl Iterator<Item = f64> + Clone, same: f64) -> f64 {
    let steps = values.clone().zip(values.skip(1)).map(|(before, after)| (after - before).abs());
    let mut steps: Vec<f64> = steps.filter(|step| *step > same).collect();
    steps.sort_by(f64::total_cmp);
    let smallest = steps.get(steps.len() / 20).copied().unwrap_or(0.0);
    steps.iter().filter(|step| **step <= 1.01 * smallest).count() as f64 / steps.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rates of 30 s at 200 Hz, each held for `hold` samples, in whole `steps`, with deterministic noise.
    fn rates(hold: f64, step: f64, amplitude: f64) -> Vec<[f64; 3]> {
        let mut state = 1_u64;
        let mut noise = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            0.4 * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
        };
        let fresh: Vec<[f64; 3]> = (0..6000)
            .map(|k| {
                let t = 0.005 * f64::from(k);
                [(1.0, 4.0), (0.7, 6.0), (0.4, 2.0)].map(|(size, rate)| {
                    let value = amplitude * size * libm::sin(rate * t) * libm::cos(0.3 * t) + noise();
                    if step > 0.0 { (value / step).round() * step } else { value }
                })
            })
            .collect();
        (0..(6000.0 * hold) as usize).map(|k| fresh[(k as f64 / hold) as usize]).collect()
    }

    #[test]
    fn a_coarse_sensor_is_not_held() {
        for amplitude in [2.0, 10.0, 40.0] {
            let coarse = rates(1.0, 1.0, amplitude);
            let repeats = coarse.len() - starts(&coarse).count();
            assert!(!is_held(&coarse), "{amplitude}: {repeats} of {} repeat", coarse.len());
        }
        // So coarse that the old rule, a tenth of repeats, would take half of the flight.
        let coarse = rates(1.0, 1.0, 10.0);
        assert!(coarse.len() - starts(&coarse).count() > 1000);
    }

    #[test]
    fn a_held_sensor_is_held_whatever_the_grids() {
        for hold in [1.2, 1.5, 2.0, 2.5, 4.0, 10.0] {
            assert!(is_held(&rates(hold, 0.0, 40.0)), "{hold}");
            assert!(is_held(&rates(hold, 0.06, 40.0)), "{hold}, with sixteen bits");
        }
        assert!(!is_held(&rates(1.0, 0.0, 40.0)));
    }

    #[test]
    fn one_component_is_coarse_by_its_steps() {
        let one =
            |values: Vec<[f64; 3]>| values.into_iter().map(|value| [value[0], 0.0, 0.0]).collect::<Vec<_>>();
        assert!(!is_held(&one(rates(1.0, 1.0, 5.0))));
        assert!(is_held(&one(rates(2.5, 0.0, 5.0))));
    }

    #[test]
    fn angles_in_whole_degrees_are_not_held() {
        let degree = 1_f64.to_radians();
        let quaternions = |values: Vec<[f64; 3]>| {
            values
                .into_iter()
                .map(|angles| frame::euler(angles.map(|angle| angle * degree)))
                .collect::<Vec<_>>()
        };
        assert!(!is_held(&quaternions(rates(1.0, 1.0, 10.0))));
        assert!(is_held(&quaternions(rates(2.5, 0.0, 10.0))));
    }
}
