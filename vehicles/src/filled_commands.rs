//! Commands that an exporter filled in where the log had none: zeros, and straight lines from the last command to the next.

use crate::command_log::{CommandLog, Stretch, is_fine};
use crate::gaps::GAP_PERIODS;

/// Shortest stretch that is looked at; motors reach another speed in a longer one.
const LEAST_S: f64 = 0.1;
/// Deviation from a straight line, as a part of the rotor's greatest command: fractions of four bytes are rounded by a third of it.
const STRAIGHT: f64 = 2e-7;
/// Least change over a line, in deviations. Commands that stay are judged by other rules.
const MOVED: f64 = 1000.0;
/// Share of the lines that are no longer than the usual one: on a finer grid every command begins one.
const USUAL: f64 = 0.9;
/// Greatest part of the commands that an exporter fills in: if more are so, it is the way in which they were flown.
const PART_MAX: f64 = 0.5;
/// In a stretch of zeros the vehicle turns by this part of what it does elsewhere, at least: on the ground it does not.
const GOES_ON: f64 = 0.2;
/// The commands beside a stretch of zeros are at least this part of the usual ones: motors that are stopped on the ground idle before or
/// behind.
const IN_FLIGHT: f64 = 0.5;

/// Stretches that were filled in, without the measured commands at their ends.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Filled {
    /// Stretches in which all rotors have the least command.
    pub zeros: Vec<Stretch>,
    /// Stretches in which the commands of all rotors follow straight lines.
    pub lines: Vec<Stretch>,
}

impl Filled {
    /// Stretches of `log` that were filled in; `falls` is true if the motion between two times shows that nothing carries the
    /// vehicle.
    ///
    /// ```
    /// use vehicles::command_log::CommandLog;
    /// use vehicles::filled_commands::Filled;
    ///
    /// // Commands at 100 Hz that change with each sample, but from 2 s to 3 s, where they go straight from 70 to 90.
    /// let time_s: Vec<f64> = (0..500).map(|k| 0.01 * f64::from(k)).collect();
    /// let noisy = |k: usize| 80.0 + (k * 7919 % 101) as f64 / 10.0;
    /// let mut rotor: Vec<f64> = (0..500).map(noisy).collect();
    /// (200..=300).for_each(|k| rotor[k] = 70.0 + 0.2 * (k - 200) as f64);
    /// let log = CommandLog {
    ///     time_s: &time_s, rotors: vec![rotor; 4], range: (0.0, 200.0), rate_time_s: &[], rates: &[],
    /// };
    /// assert_eq!(Filled::of(&log, &|_, _| false).lines, [(201, 299)]);
    /// ```
    #[must_use]
    pub fn of(log: &CommandLog<'_>, falls: &dyn Fn(f64, f64) -> bool) -> Self {
        let found = Self { zeros: zeros(log, falls), lines: lines(log) };
        let count: usize = found.stretches().map(|(from, to)| to + 1 - from).sum();
        if count as f64 > PART_MAX * log.time_s.len() as f64 { Self::default() } else { found }
    }

    /// Iterates over all stretches.
    pub fn stretches(&self) -> impl Iterator<Item = &Stretch> {
        self.zeros.iter().chain(&self.lines)
    }
}

/// Stretches in which all rotors have the least command although the vehicle flies on.
fn zeros(log: &CommandLog<'_>, falls: &dyn Fn(f64, f64) -> bool) -> Vec<Stretch> {
    let count = log.time_s.len();
    let least = if log.range.0.is_finite() { log.range.0.max(0.0) } else { 0.0 };
    let is_zero: Vec<bool> = (0..count).map(|at| log.rotors.iter().all(|rotor| rotor[at] <= least)).collect();
    let sum = |at: usize| log.rotors.iter().map(|rotor| rotor[at] - least).sum::<f64>();
    let mut sums: Vec<f64> = (0..count).filter(|at| !is_zero[*at]).map(sum).collect();
    sums.sort_by(f64::total_cmp);
    let Some(usual) = sums.get(sums.len() / 2) else { return Vec::new() };
    let is_filled = |(from, to): &Stretch| {
        // What no command ends, or begins, is the end or the begin of the flight.
        let Some((before, after)) = from.checked_sub(1).zip((to + 1 < count).then_some(to + 1)) else {
            return false;
        };
        let is_in_flight = [before, after].into_iter().all(|at| sum(at) > IN_FLIGHT * usual);
        let (from_s, to_s) = (log.time_s[before], log.time_s[after]);
        is_in_flight && to_s - from_s >= LEAST_S && !falls(from_s, to_s)
    };
    let runs = is_zero.chunk_by(|a, b| a == b).scan(0, |next, run| {
        *next += run.len();
        Some((run[0], (*next - run.len(), *next - 1)))
    });
    let found: Vec<Stretch> =
        runs.filter(|(is_zero, run)| *is_zero && is_filled(run)).map(|(_, run)| run).collect();
    if log.goes_on(&found, GOES_ON) { found } else { Vec::new() }
}

/// Stretches in which the commands of all rotors follow straight lines over time, or over the rows.
fn lines(log: &CommandLog<'_>) -> Vec<Stretch> {
    let rows: Vec<f64> = (0..log.time_s.len()).map(|at| at as f64).collect();
    let mut found = lines_over(log, log.time_s);
    found.extend(lines_over(log, &rows));
    found.sort_unstable();
    // The same over times and rows.
    found.dedup_by(|next, last| {
        let is_same = next.0 <= last.1;
        if is_same {
            last.1 = last.1.max(next.1);
        }
        is_same
    });
    found
}

fn lines_over(log: &CommandLog<'_>, along: &[f64]) -> Vec<Stretch> {
    let tolerances: Vec<f64> = log.rotors.iter().map(|rotor| STRAIGHT * greatest(rotor)).collect();
    let straight = straight(log, along, &tolerances);
    let length_s = |stretch: &Stretch| {
        let (from_s, to_s) = log.times_s(stretch);
        to_s - from_s
    };
    let mut lengths_s: Vec<f64> = straight.iter().map(length_s).collect();
    lengths_s.sort_by(f64::total_cmp);
    let usual_s =
        lengths_s.get((USUAL * lengths_s.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0.0);
    let least_s = LEAST_S.max(GAP_PERIODS * usual_s);
    let moves = |(from, to): &Stretch| {
        let mut each = log.rotors.iter().zip(&tolerances);
        each.any(|(rotor, tolerance)| (rotor[*to] - rotor[*from]).abs() > MOVED * tolerance)
    };
    let is_line = |stretch: &Stretch| {
        let count = stretch.1 - stretch.0;
        count as f64 > GAP_PERIODS && length_s(stretch) > least_s && moves(stretch)
    };
    let marked: Vec<bool> = straight.iter().map(is_line).collect();
    // Commands that a pilot moves in straight lines have other lines, or rests, beside them; those about a gap are noisy.
    let is_noisy = |at: Option<usize>| {
        at.and_then(|at| straight.get(at)).is_some_and(|side| length_s(side) <= usual_s * (1.0 + 1e-9))
    };
    let mut found = Vec::new();
    let mut from: usize = 0;
    for run in marked.chunk_by(|a, b| a == b) {
        if run[0] && is_noisy(from.checked_sub(1)) && is_noisy(Some(from + run.len())) {
            // The ends of a line are commands.
            found.extend(straight[from..from + run.len()].iter().map(|(from, to)| (from + 1, to - 1)));
        }
        from += run.len();
    }
    // Coarse commands may stay on a line by chance.
    let shortest = found.iter().map(|(from, to)| to + 2 - from).min().unwrap_or(0);
    let is_told = |rotor: &Vec<f64>| never_changes(rotor) || is_fine(rotor, shortest);
    if log.rotors.iter().all(is_told) { found } else { Vec::new() }
}

/// The whole log as stretches in each of which the commands of all rotors follow straight lines; each begins where the one before
/// ends.
fn straight(log: &CommandLog<'_>, along: &[f64], tolerances: &[f64]) -> Vec<Stretch> {
    let unbounded = || vec![(f64::NEG_INFINITY, f64::INFINITY); log.rotors.len()];
    let (mut found, mut from, mut slopes) = (Vec::new(), 0, unbounded());
    let mut at = 1;
    while at < along.len() {
        let way = along[at] - along[from];
        // Slopes of the lines through the first sample that pass by all others.
        let narrowed: Vec<(f64, f64)> = log
            .rotors
            .iter()
            .zip(tolerances)
            .zip(&slopes)
            .map(|((rotor, tolerance), (least, most))| {
                let change = rotor[at] - rotor[from];
                (least.max((change - tolerance) / way), most.min((change + tolerance) / way))
            })
            .collect();
        if narrowed.iter().all(|(least, most)| least <= most) {
            slopes = narrowed;
            at += 1;
        } else {
            // Two samples are always on a line.
            found.push((from, at - 1));
            (from, slopes) = (at - 1, unbounded());
        }
    }
    if from + 1 < along.len() {
        found.push((from, along.len() - 1));
    }
    found
}

fn never_changes(numbers: &[f64]) -> bool {
    numbers.windows(2).all(|pair| pair[0].total_cmp(&pair[1]).is_eq())
}

fn greatest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0_f64, |size, number| size.max(number.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 20 s of noisy commands of four rotors at 100 Hz, about 76 counts.
    fn noisy() -> (Vec<f64>, Vec<Vec<f64>>) {
        let time_s: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let mut state = 1_u64;
        let mut noise = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            6.0 * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
        };
        let rotors = (0..4).map(|_| time_s.iter().map(|_| 76.0 + noise()).collect()).collect();
        (time_s, rotors)
    }

    /// A vehicle that turns to and fro all the time.
    fn turning(time_s: &[f64]) -> Vec<[f64; 3]> {
        (0..time_s.len()).map(|k| [[0.3, -0.2, 0.1][k % 3], 0.0, 0.0]).collect()
    }

    fn found(time_s: &[f64], rotors: &[Vec<f64>], falls: bool) -> Filled {
        let rates = turning(time_s);
        let (rotors, range) = (rotors.to_vec(), (0.0, 200.0));
        Filled::of(&CommandLog { time_s, rotors, range, rate_time_s: time_s, rates: &rates }, &|_, _| falls)
    }

    /// Straight from the command at `from` to that at `to`, over `along`.
    fn fill(rotor: &mut [f64], along: &[f64], (from, to): (usize, usize)) {
        let (first, last) = (rotor[from], rotor[to]);
        for at in from..to {
            rotor[at] = first + (last - first) * (along[at] - along[from]) / (along[to] - along[from]);
        }
    }

    #[test]
    fn straight_lines_over_time_and_over_rows_are_found_whatever_numbers_they_were_written_in() {
        let whole = |number: f64| number;
        let short = |number: f64| f64::from(number as f32);
        for write in [whole, short] {
            let (mut time_s, mut rotors) = noisy();
            time_s.iter_mut().enumerate().for_each(|(k, time_s)| *time_s += 0.002 * (k % 3) as f64);
            let rows: Vec<f64> = (0..time_s.len()).map(|at| at as f64).collect();
            for rotor in &mut rotors {
                fill(rotor, &time_s, (500, 620));
                fill(rotor, &rows, (1200, 1225));
                rotor.iter_mut().for_each(|number| *number = write(*number));
            }
            assert_eq!(
                found(&time_s, &rotors, false),
                Filled { zeros: vec![], lines: vec![(501, 619), (1201, 1224)] }
            );
        }
    }

    /// A table at 100 Hz of commands at 20 Hz: each of its commands is at the end of a line.
    #[test]
    fn lines_between_all_commands_are_the_way_in_which_they_were_merged() {
        let (time_s, mut rotors) = noisy();
        for rotor in &mut rotors {
            (0..1990).step_by(5).for_each(|from| fill(rotor, &time_s, (from, from + 5)));
        }
        assert_eq!(found(&time_s, &rotors, false), Filled::default());
        rotors.iter_mut().for_each(|rotor| fill(rotor, &time_s, (500, 600)));
        assert_eq!(found(&time_s, &rotors, false).lines, [(501, 599)]);
    }

    #[test]
    fn zeros_amid_a_flight_are_found_and_those_of_a_fall_or_on_the_ground_are_not() {
        let (time_s, mut rotors) = noisy();
        rotors.iter_mut().for_each(|rotor| rotor[700..800].fill(0.0));
        assert_eq!(found(&time_s, &rotors, false), Filled { zeros: vec![(700, 799)], lines: vec![] });
        assert_eq!(found(&time_s, &rotors, true), Filled::default());
        // Motors that idle before they carry.
        rotors.iter_mut().for_each(|rotor| rotor[800..850].fill(10.0));
        assert_eq!(found(&time_s, &rotors, false), Filled::default());
        // Before the flight and behind it, and a pulse that is shorter than motors follow.
        let (time_s, mut rotors) = noisy();
        rotors.iter_mut().for_each(|rotor| {
            rotor[..100].fill(0.0);
            rotor[300..305].fill(0.0);
            rotor[1900..].fill(0.0);
        });
        assert_eq!(found(&time_s, &rotors, false), Filled::default());
    }

    #[test]
    fn commands_of_simple_pilots_stay() {
        let (time_s, noise) = noisy();
        let of =
            |command: &dyn Fn(f64) -> f64| vec![time_s.iter().map(|t| command(*t)).collect::<Vec<_>>(); 4];
        let ramp = |t: f64| 60.0 + 10.0 * (t - 8.0).clamp(0.0, 2.0);
        for rotors in
            [of(&|_| 76.0), of(&ramp), of(&|t| if t < 10.0 { 76.0 } else { 80.0 }), of(&|t| 70.0 + 0.5 * t)]
        {
            assert_eq!(found(&time_s, &rotors, false), Filled::default());
        }
        // A constant command and a ramp amid noisy ones; one rotor that goes straight; whole numbers.
        let amid = |change: &dyn Fn(usize, usize) -> Option<f64>| {
            let mut rotors = noise.clone();
            for (rotor, numbers) in rotors.iter_mut().enumerate() {
                numbers
                    .iter_mut()
                    .enumerate()
                    .for_each(|(at, number)| *number = change(rotor, at).unwrap_or(*number));
            }
            rotors
        };
        let steady = amid(&|_, at| (500..700).contains(&at).then_some(76.0));
        let ramped = amid(&|_, at| (500..900).contains(&at).then(|| ramp(time_s[at])));
        let single = amid(&|rotor, at| (rotor < 3 && (500..700).contains(&at)).then_some(0.01 * at as f64));
        let coarse = amid(&|_, at| Some(70.0 + (at / 40 % 4) as f64 + (at % 40 / 10) as f64));
        for rotors in [steady, ramped, single, coarse] {
            assert_eq!(found(&time_s, &rotors, false), Filled::default());
        }
    }

    #[test]
    fn a_log_that_is_filled_for_the_most_part_stays() {
        let (time_s, mut rotors) = noisy();
        for rotor in &mut rotors {
            (0..10).for_each(|number| fill(rotor, &time_s, (10 + 190 * number, 150 + 190 * number)));
        }
        assert_eq!(found(&time_s, &rotors, false), Filled::default());
    }
}
