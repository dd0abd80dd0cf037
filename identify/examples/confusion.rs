//! The confusion matrix of `docs/validation.md`, as markdown: which effects are named where which are true.
//!
//! ```sh
//! cargo run --release -p hummingbus-identify --example confusion             # everything, some minutes
//! cargo run --release -p hummingbus-identify --example confusion -- singles  # or pairs, nulls
//! cargo run --release -p hummingbus-identify --example confusion -- singles wind  # those with one effect
//! ```
#[path = "../tests/simulated/mod.rs"]
mod simulated;

use rayon::prelude::*;
use simulated::cases::{Case, EFFECTS, Judgement, PAIRS};
use std::collections::BTreeMap;

const STRENGTHS: [f64; 4] = [0.1, 0.3, 1.0, 2.0];
const NOISES: [f64; 3] = [0.3, 1.0, 3.0];
const DURATION_S: f64 = 12.0;
const NULLS: u64 = 200;

/// A case with its name in the tables.
type Row = (Vec<&'static str>, f64, f64, Judgement);
/// The same, without a judgement where the vehicle could not be flown.
type Flown = (Vec<&'static str>, f64, f64, Option<Judgement>);

fn main() {
    let part = std::env::args().nth(1);
    let is_wanted = |name: &str| part.as_deref().is_none_or(|part| part == name);
    if is_wanted("singles") {
        print_tables(&EFFECTS.map(|name| vec![name]), &NOISES, 1);
    }
    if is_wanted("pairs") {
        print_tables(&PAIRS.map(|pair| pair.to_vec()), &NOISES[1..2], 10_001);
    }
    if is_wanted("nulls") {
        print_nulls();
    }
}

fn print_tables(sets: &[Vec<&'static str>], noises: &[f64], first_seed: u64) {
    let heads: Vec<String> = noises.iter().map(|noise| format!("noise x {noise}")).collect();
    println!("| true | strength | {} |\n|---|---|{}", heads.join(" | "), "---|".repeat(noises.len()));
    let mut rows = Vec::new();
    let only = std::env::args().nth(2);
    let is_wanted = |names: &[&str]| only.as_deref().is_none_or(|only| names.contains(&only));
    for (number, names) in sets.iter().enumerate().filter(|(_, names)| is_wanted(names)) {
        let row = flown(names, noises, first_seed + 100 * number as u64);
        print_matrix(&row, noises.len());
        rows.extend(row.into_iter().filter_map(|row| Some((row.0, row.1, row.2, row.3?))));
    }
    print_failures(&rows);
    print_intervals(&rows);
    print_floor(&rows);
}

/// Flies all strengths of these effects together, each under all noises.
fn flown(names: &[&'static str], noises: &[f64], first_seed: u64) -> Vec<Flown> {
    let wanted: Vec<(f64, f64)> =
        STRENGTHS.iter().flat_map(|strength| noises.iter().map(|noise| (*strength, *noise))).collect();
    let one = |(number, (strength, noise)): (usize, (f64, f64))| {
        let mut case = Case::of(names, strength, first_seed + number as u64, DURATION_S).with_noise(noise);
        case.plan.sensors.pose_ticks = 10;
        // The controller knows nothing of the truth: some is too much for it.
        let judged = std::panic::catch_unwind(|| case.judged()).ok();
        (names.to_vec(), strength, noise, judged)
    };
    wanted.into_par_iter().enumerate().map(one).collect()
}

/// Returns the table's cell for one case.
fn verdict(judged: &Judgement) -> String {
    let invented = judged.invented();
    if judged.is_declared_swap() {
        return format!("~ {}", judged.named.join(", "));
    }
    if !invented.is_empty() {
        return format!("+ {}", invented.join(", "));
    }
    if !judged.missed().is_empty() {
        return "missed".to_owned();
    }
    if judged.named.is_empty() { "·".to_owned() } else { "✓".to_owned() }
}

fn print_matrix(rows: &[Flown], noises: usize) {
    for cells in rows.chunks(noises) {
        let of = |row: &Flown| {
            let Some(judged) = &row.3 else { return "got out of control".to_owned() };
            let gains: Vec<String> =
                judged.true_gains.iter().map(|(_, gain)| format!("{:.0} %", 100.0 * gain)).collect();
            format!("{} ({})", verdict(judged), gains.join(", "))
        };
        let texts: Vec<String> = cells.iter().map(of).collect();
        println!("| {} | {} | {} |", cells[0].0.join(" + "), cells[0].1, texts.join(" | "));
    }
}

fn print_failures(rows: &[Row]) {
    let count = |is: &dyn Fn(&Judgement) -> bool| rows.iter().filter(|row| is(&row.3)).count();
    let matter: usize =
        rows.iter().map(|row| row.3.true_gains.iter().filter(|gain| gain.1 > 0.01).count()).sum();
    let missed: usize = rows.iter().map(|row| row.3.missed().len()).sum();
    println!(
        "\n{} cases; effects that matter {matter}, of them missed {missed}; cases with an invented effect {}, of them \
         swaps that the report itself names {}",
        rows.len(),
        count(&|judgement| !judgement.invented().is_empty()),
        count(&|judgement| judgement.is_declared_swap() && !judgement.invented().is_empty()),
    );
    for (names, strength, noise, judgement) in
        rows.iter().filter(|row| !row.3.missed().is_empty() || !row.3.invented().is_empty())
    {
        println!(
            "- {} x {strength}, noise x {noise}: named {:?}, missed {:?}, invented {:?}, confused with {:?}",
            names.join(" + "),
            judgement.named,
            judgement.missed(),
            judgement.invented(),
            judgement.confused_with
        );
    }
}

fn print_intervals(rows: &[Row]) {
    let mut counts: BTreeMap<&str, (u32, u32)> = BTreeMap::new();
    // A parameter of an effect that is not true, or that stands in for one, has no true value to hold.
    for row in rows.iter().filter(|row| row.3.invented().is_empty() && row.3.missed().is_empty()) {
        for (name, holds) in &row.3.intervals {
            let count = counts.entry(name).or_default();
            *count = (count.0 + u32::from(*holds), count.1 + 1);
        }
    }
    let all = counts.values().fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1));
    println!(
        "\n95 % intervals that hold the truth: {} of {}\n\n| parameter | holds | of |\n|---|---|---|",
        all.0, all.1
    );
    counts.iter().for_each(|(name, (holds, of))| println!("| {name} | {holds} | {of} |"));
}

fn print_floor(rows: &[Row]) {
    let mut ratios: Vec<f64> = rows.iter().map(|row| row.3.of_floor).collect();
    ratios.sort_by(f64::total_cmp);
    let at = |part: f64| ratios[((ratios.len() - 1) as f64 * part) as usize];
    println!(
        "\nworst prediction error after, in units of the true model's: median {:.3}, 95 % {:.3}, greatest {:.3}; above 1.2:",
        at(0.5),
        at(0.95),
        at(1.0)
    );
    for (names, strength, noise, judgement) in rows.iter().filter(|row| row.3.of_floor > 1.2) {
        println!(
            "- {} x {strength}, noise x {noise}: {:.3}, named {:?}",
            names.join(" + "),
            judgement.of_floor,
            judgement.named
        );
    }
}

/// Returns the effects that are named where the declared vehicle is the true one.
fn named_of_nothing(seed: u64, noise: f64) -> Vec<&'static str> {
    let mut case = Case::null(seed, DURATION_S).with_noise(noise);
    case.plan.sensors.pose_ticks = 10;
    case.judged().named
}

fn print_nulls() {
    let one = |seed: u64| {
        let noise = NOISES[(seed % 3) as usize];
        (seed, noise, named_of_nothing(5000 + seed, noise))
    };
    let found: Vec<_> = (0..NULLS).into_par_iter().map(one).filter(|null| !null.2.is_empty()).collect();
    println!("\nnull cases with a false effect: {} of {NULLS}", found.len());
    found.iter().for_each(|(seed, noise, named)| println!("- seed {seed}, noise x {noise}: {named:?}"));
}
