//! Commands that a logger held: they repeat to the last bit while the vehicle goes on turning. The true ones
//! are unknown there.

use crate::command_log::{CommandLog, Stretch, is_fine};

/// Shortest stretch; whole numbers of a coarse range repeat for less.
const HELD_S: f64 = 1.0;
/// Shortest stretch in which all rotors repeat at once; motors reach another speed in a longer one.
const TOGETHER_S: f64 = 0.1;
/// And it is so many times as long as commands usually stay.
const USUAL_STAYS: usize = 5;
/// Least number of equal samples.
const LEAST_SAMPLES: usize = 20;
/// Within the stretch the vehicle turns by this part of what it does elsewhere, at least.
const GOES_ON: f64 = 0.5;
/// Greatest part of the commands that a logger holds: if more repeat, a motor's column is wrong.
const PART_MAX: f64 = 0.5;

/// Stretches of `log` that the logger held. The first command of each was fresh, the others repeat it.
///
/// ```
/// use vehicles::command_log::CommandLog;
///
/// // Commands at 100 Hz of a vehicle that turns to and fro; from 5 s to 8.99 s they repeat.
/// let time_s: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
/// let wave = |t: &f64| (5.0 * t).sin();
/// let rates: Vec<[f64; 3]> = time_s.iter().map(|t| [wave(t), 0.0, 0.0]).collect();
/// let mut rotor: Vec<f64> = time_s.iter().map(|t| 76.0 + wave(t)).collect();
/// let first = rotor[500];
/// rotor[500..900].fill(first);
/// let log = CommandLog {
///     time_s: &time_s, rotors: vec![rotor; 4], range: (0.0, 200.0), rate_time_s: &time_s, rates: &rates,
/// };
/// assert_eq!(vehicles::held_commands::of(&log)[0], (500, 899));
/// ```
#[must_use]
pub fn of(log: &CommandLog<'_>) -> Vec<Stretch> {
    let rotors = log.rotors.len();
    let held: Vec<Stretch> = log.rotors.iter().flat_map(|rotor| held(log, rotor)).collect();
    let together = held_together(log);
    // Of a log that holds most of its commands nothing is left out, and there may be many stretches.
    let count = |stretches: &[Stretch]| stretches.iter().map(|(from, to)| to - from).sum::<usize>();
    let samples = count(&held).max(rotors * count(&together));
    if samples as f64 > PART_MAX * (rotors * log.time_s.len()) as f64 {
        return Vec::new();
    }
    // In a short one the vehicle turns little, in all of them as much as elsewhere.
    let together = if log.goes_on(&together, GOES_ON) { together } else { Vec::new() };
    let long = held.into_iter().filter(|stretch| log.goes_on(&[*stretch], GOES_ON));
    let stretches: Vec<Stretch> = long.chain(together).collect();
    let mut is_repeat = vec![false; log.time_s.len()];
    stretches.iter().for_each(|(from, to)| is_repeat[from + 1..=*to].fill(true));
    let repeats = is_repeat.iter().filter(|is_repeat| **is_repeat).count();
    if repeats as f64 > PART_MAX * is_repeat.len() as f64 { Vec::new() } else { stretches }
}

/// Stretches in which the command of a rotor repeats. At its limits a command may stay.
fn held(log: &CommandLog<'_>, rotor: &[f64]) -> Vec<Stretch> {
    let (least, greatest) = limits(rotor, log.range);
    let is_at_limit = |number: f64| number <= least || number >= greatest;
    let (mut found, mut from) = (Vec::new(), 0);
    for at in 1..=rotor.len() {
        if rotor.get(at).is_some_and(|number| number.to_bits() == rotor[from].to_bits()) {
            continue;
        }
        let to = at - 1;
        let is_long = to - from >= LEAST_SAMPLES && log.time_s[to] - log.time_s[from] >= HELD_S;
        if is_long && !is_at_limit(rotor[from]) && is_fine(rotor, to - from) {
            found.push((from, to));
        }
        from = at;
    }
    found
}

/// Shorter stretches in which the commands of all rotors repeat at once, which fine commands do not do by chance.
fn held_together(log: &CommandLog<'_>) -> Vec<Stretch> {
    let count = log.time_s.len();
    let repeats =
        |at: usize| at > 0 && log.rotors.iter().all(|rotor| rotor[at].to_bits() == rotor[at - 1].to_bits());
    let starts: Vec<usize> = (0..count).filter(|at| !repeats(*at)).chain([count]).collect();
    let mut stays: Vec<usize> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
    stays.sort_unstable();
    let Some(usual) = stays.get(stays.len() / 2) else { return Vec::new() };
    let limits: Vec<(f64, f64)> = log.rotors.iter().map(|rotor| limits(rotor, log.range)).collect();
    let is_held = |(from, to): &Stretch| {
        let (from_s, to_s) = log.times_s(&(*from, *to));
        let inside = |(rotor, (least, greatest)): (&Vec<f64>, &(f64, f64))| {
            rotor[*from] > *least && rotor[*from] < *greatest
        };
        to - from >= USUAL_STAYS * usual
            && (TOGETHER_S..HELD_S).contains(&(to_s - from_s))
            && log.rotors.iter().zip(&limits).any(inside)
            && log.rotors.iter().all(|rotor| is_fine(rotor, to - from))
    };
    starts.windows(2).map(|pair| (pair[0], pair[1] - 1)).filter(is_held).collect()
}

/// Numbers at which the command of a rotor may stay.
fn limits(rotor: &[f64], (min, max): (f64, f64)) -> (f64, f64) {
    // A controller may clamp within the range of the vehicle file: what is never passed is a limit.
    let least = rotor.iter().copied().fold(f64::INFINITY, f64::min).max(min);
    let greatest = rotor.iter().copied().fold(f64::NEG_INFINITY, f64::max).min(max);
    (least, greatest)
}
