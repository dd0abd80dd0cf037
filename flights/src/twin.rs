//! Comparison of two channels for the same measurements: a copy, rows saved again, a part of them, at other times.
//!
//! Noise makes measured vectors all but unique. Those that two channels have in common vote for the offset between their
//! clocks; at the offset with the most votes a copy agrees sample by sample, and another flight does not, however alike it
//! was flown.

use crate::flight::Channel;

/// Values that differ by less than this part of the channel's spread are the same. So are those that differ
/// by less than the digits of one of the two: a copy may have fewer.
const SAME: f64 = 1e-3;
/// A vector that a channel has more often, as at rest, does not show when it was measured.
const REPEATS_MAX: usize = 4;
/// Fewer samples in common prove nothing.
const COMMON_MIN: usize = 10;
/// Of the samples that both have at the same time, so many are the same in a copy.
const SHARE_MIN: f64 = 0.5;
/// Samples that are looked at for one of the other channel: logs can have many with one stamp.
const NEIGHBOURS_MAX: usize = 16;

/// The same measurements in two channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twin {
    /// Number of samples of the second that are the same as those of the first at their time.
    pub same: usize,
    /// Number of samples that were compared.
    pub compared: usize,
    /// First and last of them, in the first channel's time.
    pub in_first_s: (f64, f64),
    /// The same in the second's.
    pub in_second_s: (f64, f64),
}

/// Result of the comparison of two channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Comparison {
    /// The second holds measurements of the first.
    Same(Twin),
    /// The second does not hold measurements of the first.
    Other,
    /// Too few of their samples are conclusive, such as those of a channel that stands still.
    Unknown,
}

/// Compares two channels.
///
/// ```
/// use flights::{Channel, Comparison, twin};
///
/// let values: Vec<[f64; 1]> = (0..100).map(|k| [f64::from(k * 7919 % 1009)]).collect();
/// let first = Channel { time_s: (0..100).map(f64::from).collect(), values };
/// let later = Channel { time_s: first.time_s.iter().map(|time_s| time_s + 60.0).collect(), ..first.clone() };
/// assert!(matches!(twin(&first, &later), Comparison::Same(twin) if twin.in_second_s == (60.0, 159.0)));
/// ```
#[must_use]
pub fn twin<const N: usize>(first: &Channel<N>, second: &Channel<N>) -> Comparison {
    let steps = Steps::of(first, second);
    let (of_first, of_second) = (Telling::of(first, &steps.key), Telling::of(second, &steps.key));
    if of_first.keys.len() < COMMON_MIN || of_second.keys.len() < COMMON_MIN {
        return Comparison::Unknown;
    }
    let period_s = first.period_s().unwrap_or(0.0).min(second.period_s().unwrap_or(0.0));
    let apart_s = (0.5 * period_s).max(1e-6);
    let offset_s = offset_s(&of_first, &of_second, (first, second), apart_s);
    let found =
        offset_s.and_then(|offset_s| agreeing(first, second, &of_second, &steps.same, (offset_s, apart_s)));
    found.map_or(Comparison::Other, Comparison::Same)
}

/// Smallest differences that count, on each axis; zero where the channel stands still.
struct Steps<const N: usize> {
    /// Values in one step are the same for a start.
    key: [f64; N],
    /// Values that differ by no more are the same. A rounded one is within half of its last digit.
    same: [f64; N],
}

impl<const N: usize> Steps<N> {
    fn of(first: &Channel<N>, second: &Channel<N>) -> Self {
        let digit = |axis: usize| digit(first, axis).max(digit(second, axis));
        let spread: [f64; N] = std::array::from_fn(|axis| SAME * spread(first, axis));
        Self {
            key: std::array::from_fn(|axis| spread[axis].max(digit(axis))),
            same: std::array::from_fn(|axis| spread[axis].max(0.500_001 * digit(axis))),
        }
    }
}

fn spread<const N: usize>(channel: &Channel<N>, axis: usize) -> f64 {
    let count = channel.values.len().max(1) as f64;
    let of_axis = || channel.values.iter().map(|value| value[axis]);
    let mean = of_axis().sum::<f64>() / count;
    (of_axis().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// The smallest difference of two values of an axis: the last digit of numbers that were rounded.
fn digit<const N: usize>(channel: &Channel<N>, axis: usize) -> f64 {
    let mut sorted: Vec<f64> = channel.values.iter().map(|value| value[axis]).collect();
    sorted.sort_by(f64::total_cmp);
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0);
    gaps.min_by(f64::total_cmp).unwrap_or(0.0)
}

/// The samples of a channel whose values it has only a few times.
struct Telling<const N: usize> {
    /// The values in steps with the index of the sample, sorted.
    keys: Vec<([i64; N], usize)>,
}

impl<const N: usize> Telling<N> {
    fn of(channel: &Channel<N>, steps: &[f64; N]) -> Self {
        let key = |value: &[f64; N]| {
            std::array::from_fn(|axis| {
                if steps[axis] > 0.0 { (value[axis] / steps[axis]).round() as i64 } else { 0 }
            })
        };
        let mut all: Vec<([i64; N], usize)> =
            channel.values.iter().enumerate().map(|(index, value)| (key(value), index)).collect();
        all.sort_unstable();
        let rare = all.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() <= REPEATS_MAX);
        Self { keys: rare.flatten().copied().collect() }
    }
}

/// The offset of the first channel's clock from the second's that most of their common vectors ask for; `None` where too
/// few do.
fn offset_s<const N: usize>(
    of_first: &Telling<N>,
    of_second: &Telling<N>,
    (first, second): (&Channel<N>, &Channel<N>),
    apart_s: f64,
) -> Option<f64> {
    let mut offsets_s = Vec::new();
    let mut rest = &of_first.keys[..];
    for (key, index) in &of_second.keys {
        rest = &rest[rest.partition_point(|other| other.0 < *key)..];
        let same = rest.iter().take_while(|other| other.0 == *key);
        offsets_s.extend(same.map(|other| first.time_s[other.1] - second.time_s[*index]));
    }
    offsets_s.sort_by(f64::total_cmp);
    let mut best = (0, 0.0);
    let mut low = 0;
    for high in 0..offsets_s.len() {
        while offsets_s[high] - offsets_s[low] > apart_s {
            low += 1;
        }
        if high + 1 - low > best.0 {
            best = (high + 1 - low, offsets_s[usize::midpoint(low, high)]);
        }
    }
    (best.0 >= COMMON_MIN).then_some(best.1)
}

/// Compares the second channel's telling samples with those of the first at the same time.
fn agreeing<const N: usize>(
    first: &Channel<N>,
    second: &Channel<N>,
    of_second: &Telling<N>,
    steps: &[f64; N],
    (offset_s, apart_s): (f64, f64),
) -> Option<Twin> {
    let is_same = |a: &[f64; N], b: &[f64; N]| (0..N).all(|axis| (a[axis] - b[axis]).abs() <= steps[axis]);
    let (mut compared, mut same) = (0, Vec::new());
    for (_, index) in &of_second.keys {
        let at_s = second.time_s[*index] + offset_s;
        let from = first.time_s.partition_point(|time_s| *time_s < at_s - apart_s);
        let until = first.time_s.partition_point(|time_s| *time_s <= at_s + apart_s);
        let near = from..until.min(from + NEIGHBOURS_MAX);
        compared += usize::from(!near.is_empty());
        if near.clone().any(|other| is_same(&first.values[other], &second.values[*index])) {
            same.push(second.time_s[*index]);
        }
    }
    let is_twin = same.len() >= COMMON_MIN && same.len() as f64 >= SHARE_MIN * compared as f64;
    let from_s = same.iter().copied().fold(f64::INFINITY, f64::min);
    let to_s = same.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    is_twin.then_some(Twin {
        same: same.len(),
        compared,
        in_first_s: (from_s + offset_s, to_s + offset_s),
        in_second_s: (from_s, to_s),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A measured course: smooth, with noise of its own, read to `digits` behind the point.
    fn course(seed: u32, digits: i32) -> Channel<3> {
        let mut state = seed.wrapping_mul(2_654_435_761).max(1);
        let mut noise = || {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            f64::from(state) / f64::from(u32::MAX) - 0.5
        };
        let scale = 10_f64.powi(digits);
        let mut value = |k: i32, axis: i32| {
            let smooth = libm::sin(0.011 * f64::from(k) + f64::from(axis));
            ((smooth + 0.02 * noise()) * scale).round() / scale
        };
        let values = (0..4000).map(|k| [value(k, 0), value(k, 1), value(k, 2)]).collect();
        Channel { time_s: (0..4000).map(|k| 0.01 * f64::from(k)).collect(), values }
    }

    fn part(channel: &Channel<3>, keep: impl Fn(usize) -> bool, later_s: f64) -> Channel<3> {
        let kept: Vec<usize> = (0..channel.time_s.len()).filter(|index| keep(*index)).collect();
        Channel {
            time_s: kept.iter().map(|index| channel.time_s[*index] + later_s).collect(),
            values: kept.iter().map(|index| channel.values[*index]).collect(),
        }
    }

    #[test]
    fn copies_and_parts_of_them_are_found_at_any_offset() {
        let whole = course(1, 9);
        let found = |other: &Channel<3>| match twin(&whole, other) {
            Comparison::Same(twin) => twin,
            other => panic!("{other:?}"),
        };
        assert_eq!(found(&whole).same, found(&whole).compared);
        let late = found(&part(&whole, |index| index % 7 == 0, 1234.5));
        assert!(
            late.same > 500 && (late.in_first_s.0 + 1234.5 - late.in_second_s.0).abs() < 1e-6,
            "{late:?}"
        );
        let end = found(&part(&whole, |index| index > 3800, 0.0));
        assert!(end.same > 190 && end.in_first_s.0 > 38.0, "{end:?}");
        for digits in [2, 3, 5] {
            let rounded = found(&course(1, digits));
            assert!(rounded.same > 3000, "{digits} digits: {rounded:?}");
        }
        // The other way round: the whole against a part of it.
        let tenth = part(&whole, |index| index % 10 == 0, 0.0);
        assert!(matches!(twin(&tenth, &whole), Comparison::Same(_)));
    }

    #[test]
    fn the_same_course_flown_again_is_another_flight() {
        assert_eq!(twin(&course(1, 9), &course(2, 9)), Comparison::Other);
        // Coarse readings meet by chance, and at rest all are the same.
        assert_eq!(twin(&course(1, 2), &course(2, 2)), Comparison::Other);
        let rest = Channel { values: vec![[0.0, 0.0, 9.81]; 4000], ..course(1, 9) };
        assert_eq!(twin(&rest, &rest), Comparison::Unknown);
    }

    #[test]
    fn parts_that_do_not_overlap_have_nothing_in_common() {
        let whole = course(1, 9);
        let (first, second) =
            (part(&whole, |index| index < 2000, 0.0), part(&whole, |index| index >= 2000, 0.0));
        assert_eq!(twin(&first, &second), Comparison::Other);
    }
}
