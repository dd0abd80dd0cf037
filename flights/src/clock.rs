//! Clocks that start again, run backwards or stand still.

use crate::flight::median;

/// Number of samples to both sides of a step back that are compared: a stray stamp or a late batch is shorter.
const WINDOW: usize = 50;
/// Fewer samples are not a recording.
const RECORDING_MIN: usize = 5;

/// The indices of the samples with which the clock starts again. Times without a number are passed over.
pub fn restarts(time_s: &[f64]) -> Vec<usize> {
    let finite: Vec<usize> = (0..time_s.len()).filter(|index| time_s[*index].is_finite()).collect();
    let times: Vec<f64> = finite.iter().map(|index| time_s[*index]).collect();
    let (mut begun, mut found) = (0, Vec::new());
    for at in 1..times.len() {
        if times[at] < times[at - 1] && is_restart(&times[begun..at], &times[at..]) {
            begun = at;
            found.push(finite[at]);
        }
    }
    found
}

/// Times of a clock that does not run forward.
#[derive(Debug, PartialEq, Eq)]
pub enum NotForward {
    /// Most steps fall, or so many that no recordings can be told apart.
    Falls {
        /// Number of steps that fall.
        falling: usize,
        /// Number of steps.
        steps: usize,
        /// The indices of the first two times that fall.
        first: [usize; 2],
    },
    /// Every time is the same.
    Stands,
}

/// The fault of times that fall or stand still; `None` of a clock that runs forward, though it may start again.
pub fn not_forward(time_s: &[f64]) -> Option<NotForward> {
    let mut finite = (0..time_s.len()).filter(|index| time_s[*index].is_finite());
    let mut before = finite.next()?;
    let (mut steps, mut falling, mut rising, mut first) = (0, 0, 0, None);
    for index in finite {
        steps += 1;
        falling += usize::from(time_s[index] < time_s[before]);
        rising += usize::from(time_s[index] > time_s[before]);
        if time_s[index] < time_s[before] {
            first = first.or(Some([before, index]));
        }
        before = index;
    }
    match first {
        None => (rising == 0 && steps + 1 >= RECORDING_MIN).then_some(NotForward::Stands),
        Some(first) => {
            let is_mixed = || 4 * falling > falling + rising && !restarts(time_s).is_empty();
            (falling > 2 * rising || is_mixed()).then_some(NotForward::Falls { falling, steps, first })
        }
    }
}

/// True if time as a whole goes back from the last samples `before` to the first `after`.
fn is_restart(before: &[f64], after: &[f64]) -> bool {
    let before = &before[before.len().saturating_sub(WINDOW)..];
    let after = &after[..after.len().min(WINDOW)];
    if before.len().min(after.len()) < RECORDING_MIN {
        return false;
    }
    let middle = |times: &[f64]| median(times.iter().copied());
    middle(after) < middle(before)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(from_s: f64, count: usize) -> Vec<f64> {
        (0..count).map(|index| from_s + 0.01 * index as f64).collect()
    }

    #[test]
    fn a_clock_that_starts_again_is_found() {
        let cases = [
            (vec![times(0.0, 1000), times(0.0, 2000)], vec![1000]),
            (vec![times(1000.0, 1000), times(0.0, 100)], vec![1000]),
            (vec![times(0.0, 100), times(0.0, 100), times(0.0, 100)], vec![100, 200]),
            (vec![times(0.0, 300), vec![f64::NAN], times(0.0, 300)], vec![301]),
            (vec![times(5.0, 300), times(3.0, 300)], vec![300]),
            (vec![times(5.0, 300), times(3.0, 8)], vec![300]),
        ];
        for (parts, found) in cases {
            assert_eq!(
                restarts(&parts.concat()),
                found,
                "{:?}",
                parts.iter().map(Vec::len).collect::<Vec<_>>()
            );
        }
    }

    #[test]
    fn clocks_that_fall_or_stand_still_are_no_recordings() {
        let falling: Vec<f64> = times(0.0, 100).into_iter().rev().collect();
        let found = NotForward::Falls { falling: 99, steps: 99, first: [0, 1] };
        assert_eq!(not_forward(&falling), Some(found));
        // Sorted by another column.
        let sorted: Vec<f64> = (0..701).map(|index| f64::from(index * 300 % 701)).collect();
        assert!(matches!(
            not_forward(&sorted),
            Some(NotForward::Falls { falling: 200.., first: [2, 3], .. })
        ));
        let still = [vec![f64::NAN], vec![5.0; 20], vec![f64::NAN]].concat();
        assert_eq!(not_forward(&still), Some(NotForward::Stands));
        let swapped: Vec<f64> = (0..100).map(|index: i32| f64::from(index ^ 1)).collect();
        let held: Vec<f64> = (0..100).map(|index| f64::from(index / 50)).collect();
        let again = [times(0.0, 100), times(0.0, 100)].concat();
        for forward in [swapped, held, again, times(0.0, 9), vec![], vec![1.0], vec![2.0, 1.0, 3.0]] {
            assert_eq!(not_forward(&forward), None, "{:?}", &forward[..forward.len().min(4)]);
        }
    }

    #[test]
    fn stray_stamps_and_late_batches_are_no_start() {
        let mut ahead = times(0.0, 500);
        ahead[200] = 1e9;
        let mut behind = times(0.0, 500);
        behind[200] = 0.0;
        let mut shuffled = times(0.0, 500);
        shuffled[200..220].reverse();
        let zeros = [vec![0.0; 20], times(900.0, 500)].concat();
        let set_back = [times(0.0, 500), times(4.95, 500)].concat();
        let held = [times(0.0, 100), vec![0.5; 3], times(1.0, 100)].concat();
        for times in
            [times(0.0, 500), ahead, behind, shuffled, zeros, set_back, held, vec![], vec![f64::NAN; 9]]
        {
            assert_eq!(restarts(&times), [0; 0], "{:?}", &times[..times.len().min(3)]);
        }
    }
}
