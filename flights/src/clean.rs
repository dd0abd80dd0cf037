//! Cleaning of a channel: faulty samples are left out, counted and noted.

use diagnostics::nine_decimals;
use vehicles::Vehicle;
use vehicles::gaps::GAP_PERIODS;

use crate::clock::{self, NotForward};
use crate::error::{LogError, Spot};
use crate::flight::{Channel, median, period_s};
use crate::glitches;
use crate::held;
use crate::quantity::Quantity;
use crate::spikes;

/// A quaternion whose length is further from one than this is not an attitude.
const NORM_TOLERANCE: f64 = 0.1;

/// Leaves out samples that are not finite, whose time does not grow, or that only repeat the one before.
///
/// # Errors
/// If nothing is left.
pub fn clean<const N: usize>(
    quantity: Quantity,
    channel: Channel<N>,
    notes: &mut Vec<String>,
) -> Result<Channel<N>, LogError> {
    let total = channel.time_s.len();
    let channel = finite(quantity, channel, notes);
    check_clock(&channel.time_s)?;
    let channel = growing(quantity, channel, notes);
    let channel = if quantity == Quantity::Command { channel } else { unheld(quantity, channel, notes) };
    let channel = if quantity == Quantity::RotorSpeed { unspiked(channel, notes) } else { channel };
    let channel = without_glitches(quantity, &glitches::without(quantity, &channel), channel, notes);
    if channel.is_empty() {
        let why = notes.last().map_or("the log has none", String::as_str);
        let (expected, found) = ("samples that can be used", format!("none of {total} ({why})"));
        return Err(LogError::unexpected(Spot::Whole, expected, found, "check the names in `channels`"));
    }
    Ok(channel)
}

fn finite<const N: usize>(quantity: Quantity, channel: Channel<N>, notes: &mut Vec<String>) -> Channel<N> {
    let is_finite = |index: usize| {
        channel.time_s[index].is_finite() && channel.values[index].iter().all(|number| number.is_finite())
    };
    if (0..channel.time_s.len()).all(is_finite) {
        return channel;
    }
    let kept = channel.kept(is_finite);
    say_dropped(quantity, &channel, &kept, "have no finite number", notes);
    kept
}

/// Leaves out rotor speeds with a spike.
fn unspiked<const N: usize>(channel: Channel<N>, notes: &mut Vec<String>) -> Channel<N> {
    let is_kept = spikes::without(&channel);
    let kept = channel.kept(|index| is_kept[index]);
    say_dropped(Quantity::RotorSpeed, &channel, &kept, "have a spike, which no rotor can follow", notes);
    kept
}

/// Leaves out the samples that are not kept, as glitches.
fn without_glitches<const N: usize>(
    quantity: Quantity,
    is_kept: &[bool],
    channel: Channel<N>,
    notes: &mut Vec<String>,
) -> Channel<N> {
    if is_kept.iter().all(|is_kept| *is_kept) {
        return channel;
    }
    let kept = channel.kept(|index| is_kept[index]);
    let first_s = (0..is_kept.len()).find(|index| !is_kept[*index]).map_or(0.0, |at| channel.time_s[at]);
    let why = format!("are far from the samples before and after them, first at {first_s:.3} s of the log");
    say_dropped(quantity, &channel, &kept, &why, notes);
    kept
}

/// Leaves out commands far outside the range of `vehicle`, where those before and behind are not.
pub fn without_wild_commands<const N: usize>(
    channel: Channel<N>,
    vehicle: &Vehicle,
    notes: &mut Vec<String>,
) -> Channel<N> {
    let is_kept = glitches::without_commands(&channel, vehicle);
    without_glitches(Quantity::Command, &is_kept, channel, notes)
}

/// Leaves out samples of messages that do not hold the quantity, which their `fields` say.
///
/// # Errors
/// If no message holds it.
pub fn without_absent<const N: usize>(
    quantity: Quantity,
    channel: Channel<N>,
    is_absent: &[bool],
    fields: &str,
    notes: &mut Vec<String>,
) -> Result<Channel<N>, LogError> {
    let kept = channel.kept(|index| is_absent.get(index) != Some(&true));
    if kept.is_empty() && !channel.is_empty() {
        let (expected, found) = (
            format!("messages with a valid value, by `{fields}`"),
            format!("none of {}", channel.time_s.len()),
        );
        return Err(LogError::unexpected(
            Spot::Whole,
            expected,
            found,
            "name another topic, or remove the channel",
        ));
    }
    say_dropped(quantity, &channel, &kept, &format!("have no valid value, by `{fields}`"), notes);
    Ok(kept)
}

/// Notes how many samples were left out, and the reason.
pub fn say_dropped<const N: usize>(
    quantity: Quantity,
    before: &Channel<N>,
    after: &Channel<N>,
    why: &str,
    notes: &mut Vec<String>,
) {
    let (total, dropped) = (before.time_s.len(), before.time_s.len() - after.time_s.len());
    if dropped > 0 {
        notes.push(format!("{quantity}: {dropped} of {total} samples {why}; left out"));
    }
}

/// Refuses times that do not run forward, and those of several recordings.
fn check_clock(time_s: &[f64]) -> Result<(), LogError> {
    if let Some(fault) = clock::not_forward(time_s) {
        let (expected, advice) =
            ("times that increase", "choose another clock or message, or sort the log by time");
        let found = match fault {
            NotForward::Stands => {
                format!("the same time, {} s, in all {} samples", nine_decimals(time_s[0]), time_s.len())
            }
            NotForward::Falls { falling, steps, first: [from, to] } => format!(
                "times that fall in {falling} of {steps} steps, first from {} s to {} s after {} samples",
                nine_decimals(time_s[from]),
                nine_decimals(time_s[to]),
                from + 1
            ),
        };
        return Err(LogError::unexpected(Spot::Whole, expected, found, advice));
    }
    let Some(at) = clock::restarts(time_s).first().copied() else { return Ok(()) };
    let found = format!(
        "a clock that starts again: after {at} samples the time goes back from {} s to {} s",
        nine_decimals(time_s[at - 1]),
        nine_decimals(time_s[at])
    );
    let advice = "the log holds several recordings: cut it there";
    Err(LogError::unexpected(Spot::Whole, "one clock", found, advice))
}

/// Leaves out the fewest samples such that time grows: a single stamp far ahead costs itself, not all after it.
fn growing<const N: usize>(quantity: Quantity, channel: Channel<N>, notes: &mut Vec<String>) -> Channel<N> {
    if channel.time_s.windows(2).all(|pair| pair[1] > pair[0]) {
        return channel;
    }
    let is_kept = longest_growing(&channel.time_s);
    let kept = channel.kept(|index| is_kept[index]);
    say_dropped(quantity, &channel, &kept, "have a time that does not increase", notes);
    kept
}

/// Marks a longest strictly growing subsequence of finite numbers.
pub fn longest_growing(times: &[f64]) -> Vec<bool> {
    // `tails[n]` is the index of the smallest time that ends a growing sequence of n + 1 samples.
    let mut tails: Vec<usize> = Vec::new();
    let mut before: Vec<Option<usize>> = Vec::with_capacity(times.len());
    for (index, time) in times.iter().enumerate() {
        let length = tails.partition_point(|&tail| times[tail] < *time);
        before.push(length.checked_sub(1).map(|last| tails[last]));
        tails.truncate(tails.len().max(length));
        match tails.get_mut(length) {
            Some(tail) => *tail = index,
            None => tails.push(index),
        }
    }
    let mut is_kept = vec![false; times.len()];
    let mut next = tails.last().copied();
    while let Some(index) = next {
        is_kept[index] = true;
        next = before[index];
    }
    is_kept
}

/// Leaves out repeats where they are systematic. A vehicle at rest in a simulation repeats its values too, but
/// that is one long run and not many short ones.
fn unheld<const N: usize>(quantity: Quantity, channel: Channel<N>, notes: &mut Vec<String>) -> Channel<N> {
    if !held::is_held(&channel.values) {
        return channel;
    }
    let mut is_new = vec![false; channel.values.len()];
    held::starts(&channel.values).for_each(|start| is_new[start] = true);
    let kept = channel.kept(|index| is_new[index]);
    say_dropped(quantity, &channel, &kept, "repeat the one before (a held value)", notes);
    kept
}

/// Notes the times at which a channel has no samples for long.
pub fn say_gaps(quantity: Quantity, time_s: &[f64], notes: &mut Vec<String>) {
    let gaps = gaps(time_s);
    let Some(longest) = gaps.iter().map(|(from, to)| to - from).max_by(f64::total_cmp) else { return };
    let first = gaps.first().map_or(0.0, |gap| gap.0);
    notes.push(format!(
        "{quantity}: {} gaps of more than {GAP_PERIODS} periods ({:.4} s), the longest of {longest:.3} s; the first \
         begins at {first:.3} s",
        gaps.len(),
        period_s(time_s).unwrap_or_default(),
    ));
}

/// The gaps between samples: the times of the samples before and after each.
pub fn gaps(time_s: &[f64]) -> Vec<(f64, f64)> {
    let limit_s = GAP_PERIODS * period_s(time_s).unwrap_or(f64::INFINITY);
    let steps = time_s.windows(2).map(|pair| (pair[0], pair[1]));
    steps.filter(|(from, to)| to - from > limit_s).collect()
}

/// Makes quaternions of length one and without jumps of sign; leaves out those of another length.
///
/// # Errors
/// If most have another length.
pub fn unit_quaternions(channel: Channel<4>, notes: &mut Vec<String>) -> Result<Channel<4>, LogError> {
    let norm = |q: &[f64; 4]| q.iter().map(|part| part * part).sum::<f64>().sqrt();
    let is_unit = |index: usize| (norm(&channel.values[index]) - 1.0).abs() <= NORM_TOLERANCE;
    let mut kept = channel.kept(is_unit);
    if 2 * kept.time_s.len() < channel.time_s.len() {
        let length = median(channel.values.iter().map(norm)).unwrap_or(f64::NAN);
        let (expected, found) = ("quaternions of length 1", format!("a median length of {length:.4}"));
        let advice = "name the columns of x, y, z and w, or use `euler` for angles";
        return Err(LogError::unexpected(Spot::Whole, expected, found, advice));
    }
    say_dropped(Quantity::Attitude, &channel, &kept, "are not unit quaternions", notes);
    let mut before = [1.0, 0.0, 0.0, 0.0];
    for (index, q) in kept.values.iter_mut().enumerate() {
        let along: f64 = q.iter().zip(before).map(|(a, b)| a * b).sum();
        let sign = if index > 0 && along < 0.0 { -1.0 } else { 1.0 };
        let scale = sign / norm(q);
        *q = q.map(|part| part * scale);
        before = *q;
    }
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(samples: &[(f64, f64)]) -> Channel<1> {
        Channel {
            time_s: samples.iter().map(|sample| sample.0).collect(),
            values: samples.iter().map(|sample| [sample.1]).collect(),
        }
    }

    #[test]
    fn a_stamp_far_ahead_costs_itself_only() {
        let mut notes = Vec::new();
        let read = channel(&[(0.0, 1.0), (1.0, 2.0), (1e9, 3.0), (2.0, 4.0), (2.0, 5.0), (3.0, 6.0)]);
        let cleaned = clean(Quantity::BatteryVoltage, read, &mut notes).unwrap();
        assert_eq!(cleaned.time_s, [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(notes, ["battery_voltage: 2 of 6 samples have a time that does not increase; left out"]);
    }

    #[test]
    fn cells_without_numbers_are_counted() {
        let mut notes = Vec::new();
        let read = channel(&[(0.0, 1.0), (1.0, f64::NAN), (f64::INFINITY, 3.0), (2.0, 4.0)]);
        assert_eq!(clean(Quantity::BatteryVoltage, read, &mut notes).unwrap().time_s, [0.0, 2.0]);
        assert!(notes[0].contains("2 of 4"), "{notes:?}");
        assert!(clean(Quantity::BatteryVoltage, channel(&[(0.0, f64::NAN)]), &mut notes).is_err());
    }

    #[test]
    fn held_values_are_left_out_but_not_rest() {
        let mut notes = Vec::new();
        let held: Vec<_> = (0..100).map(|k| (f64::from(k), f64::from(k / 10))).collect();
        let cleaned = clean(Quantity::BatteryVoltage, channel(&held), &mut notes).unwrap();
        assert_eq!(cleaned.time_s.len(), 10);
        assert!(notes[0].contains("90 of 100"), "{notes:?}");
        let rest: Vec<_> = (0..100).map(|k| (f64::from(k), f64::from(k.max(50)))).collect();
        assert_eq!(clean(Quantity::BatteryVoltage, channel(&rest), &mut notes).unwrap().time_s.len(), 100);
        assert_eq!(clean(Quantity::Command, channel(&held), &mut notes).unwrap().time_s.len(), 100);
    }

    #[test]
    fn gaps_are_said() {
        let mut notes = Vec::new();
        let times: Vec<_> = (0..20).map(|k| (f64::from(if k < 10 { k } else { k + 30 }), 0.0)).collect();
        say_gaps(Quantity::Position, &channel(&times).time_s, &mut notes);
        assert!(notes[0].contains("1 gaps") && notes[0].contains("31.000 s"), "{notes:?}");
    }

    #[test]
    fn quaternions_keep_their_sign() {
        let mut notes = Vec::new();
        let q = [0.6, 0.8, 0.0, 0.0];
        let read = Channel { time_s: vec![0.0, 1.0, 2.0], values: vec![q, q.map(|x| -x), [9.0; 4]] };
        let unit = unit_quaternions(read, &mut notes).unwrap();
        assert_eq!(unit.values, [q, q]);
        assert_eq!(notes.len(), 1);
    }
}
