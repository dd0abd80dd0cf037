//! The table of rigs in `docs/validation.md`: verdicts on hidden truths, by flights of an integrator of their own.
//!
//! ```sh
//! cargo run --release -p hummingbus-identify --example rigs           # six seeds of each truth, some minutes
//! cargo run --release -p hummingbus-identify --example rigs -- 3      # three seeds
//! cargo run --release -p hummingbus-identify --example rigs -- 3 thrust  # of the truths with this word
//! cargo run --release -p hummingbus-identify --example rigs -- ratios 40 # the table of ratios, with forty seeds
//! ```
#[path = "../tests/simulated/mod.rs"]
mod simulated;

use rayon::prelude::*;
use simulated::bearing::Bearing;
use simulated::rigs::{DURATION_S, Judgement, LOGS, Rig, STICKING, TRUTHS, errors_of_ratios, judged, report};

fn main() {
    let mut words = std::env::args().skip(1).peekable();
    let is_of_ratios = words.next_if(|word| word == "ratios").is_some();
    let seeds: u64 = words.next().map_or(6, |text| text.parse().expect("a number of seeds"));
    let word = words.next().unwrap_or_default();
    if is_of_ratios { ratios(seeds, &word) } else { verdicts(seeds, &word) }
}

/// Sizes of the sensors' noise, 1 for good ones.
const NOISES: [f64; 3] = [1.0, 3.0, 10.0];

/// Prints how often the intervals of ratios hold the truth, by truth, log, noise and axis.
fn ratios(seeds: u64, word: &str) {
    println!(
        "| truth | log | noise | axis | mean error | its standard error | half interval | holds the truth |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let truths = TRUTHS.iter().enumerate().filter(|(_, truth)| truth.0 != STICKING);
    for (number, (name, truth, change)) in truths {
        let logs = LOGS.iter().filter(|(log, _)| format!("{name}; {log}").contains(word));
        for (log, logged) in logs {
            for noise in NOISES {
                let of_seed = |seed: u64| {
                    let mut bearing = change(Bearing::plain(7000 + 100 * number as u64 + seed, DURATION_S));
                    bearing.sensors.noise = noise;
                    errors_of_ratios(&logged(Rig { bearing, is_without_gyroscope: false }), truth)
                };
                let found: Vec<_> = (0..seeds).into_par_iter().map(of_seed).collect();
                for (axis, of_axis) in ["x", "y", "z"].into_iter().enumerate() {
                    let of_axis_only: Vec<_> = found.iter().map(|axes| axes[axis]).collect();
                    println!("| {name} | {log} | {noise} | {of_axis} | {} |", spread(&of_axis_only));
                }
            }
        }
    }
}

/// Mean error, its standard error, mean half interval, and how often that holds the truth.
fn spread(found: &[(f64, f64)]) -> String {
    let count = found.len() as f64;
    let error = found.iter().map(|found| found.0).sum::<f64>() / count;
    let half = found.iter().map(|found| found.1).sum::<f64>() / count;
    let deviation = (found.iter().map(|found| (found.0 - error).powi(2)).sum::<f64>() / count).sqrt();
    let holds = found.iter().filter(|(error, half)| error.abs() <= *half).count();
    let [error, of_mean, half] = [error, deviation / count.sqrt(), half].map(|part| 100.0 * part);
    format!("{error:.3} % | {of_mean:.3} % | {half:.3} % | {holds} of {count}")
}

/// Prints the table of verdicts.
fn verdicts(seeds: u64, word: &str) {
    println!("| truth | right | confounded | missed | false | verdicts |\n|---|---|---|---|---|---|");
    for (number, (name, truth, change)) in
        TRUTHS.iter().enumerate().filter(|(_, truth)| truth.0.contains(word))
    {
        let (mut counts, mut verdicts) = ([0; 4], Vec::<(String, usize)>::new());
        for seed in 0..seeds {
            let plain = Bearing::plain(100 * number as u64 + seed, DURATION_S);
            // Every other log has a position and an accelerometer, too.
            let logged = if seed % 2 == 0 { plain } else { plain.tracked() };
            let found = report(&change(logged));
            let judgement = judged(truth, &found);
            let places = [Judgement::Right, Judgement::Confounded, Judgement::Missed, Judgement::False];
            counts[places.iter().position(|place| *place == judgement).expect("one of four")] += 1;
            let of = |name: &&str| match found.effects[name].confused_with.as_slice() {
                [] => (*name).to_owned(),
                rivals => format!("{name} (or {})", rivals.join(", ")),
            };
            let verdict = match found.verdict.iter().map(of).collect::<Vec<_>>().join(", ") {
                empty if empty.is_empty() => "nothing".to_owned(),
                verdict => verdict,
            };
            match verdicts.iter_mut().find(|known| known.0 == verdict) {
                Some(known) => known.1 += 1,
                None => verdicts.push((verdict, 1)),
            }
        }
        let texts: Vec<String> =
            verdicts.iter().map(|(verdict, count)| format!("{count} × {verdict}")).collect();
        let [right, confounded, missed, false_ones] = counts;
        println!("| {name} | {right} | {confounded} | {missed} | {false_ones} | {} |", texts.join("; "));
    }
}
