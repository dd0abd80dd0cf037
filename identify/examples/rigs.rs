//! The table of rigs in `docs/validation.md`: verdicts on hidden truths, by flights of an integrator of their own.
//!
//! ```sh
//! cargo run --release -p hummingbus-identify --example rigs           # six seeds of each truth, some minutes
//! cargo run --release -p hummingbus-identify --example rigs -- 3      # three seeds
//! cargo run --release -p hummingbus-identify --example rigs -- 3 thrust  # of the truths with this word
//! ```
#[path = "../tests/simulated/mod.rs"]
mod simulated;

use simulated::bearing::Bearing;
use simulated::rigs::{DURATION_S, Judgement, TRUTHS, judged, report};

fn main() {
    let seeds: u64 = std::env::args().nth(1).map_or(6, |text| text.parse().expect("a number of seeds"));
    let word = std::env::args().nth(2).unwrap_or_default();
    println!("| truth | right | confounded | missed | false | verdicts |\n|---|---|---|---|---|---|");
    for (number, (name, truth, change)) in
        TRUTHS.iter().enumerate().filter(|(_, truth)| truth.0.contains(&word))
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
