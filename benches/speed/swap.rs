//! Cost of a swap: the start of the backup, the clock's hold, and the run as a whole.

use crate::report::{Result, Spread, number, run_manifest};
use serde_json::Value;
use std::path::Path;

/// Swaps of one run: the first take-over, and the ticks between two.
const SWAPS: usize = 20;
const FIRST_TICK: u32 = 1000;
const EVERY_TICKS: u32 = 500;
const SHADOW_TICKS: u32 = 100;
const REPETITIONS: usize = 5;

/// Prints the times of swaps in free runs and in runs at real time, each against runs without.
pub fn report() -> Result<()> {
    println!(
        "\n{SWAPS} swaps of the controller in hover.toml, every {EVERY_TICKS} ticks, {SHADOW_TICKS} ticks of \
         shadowing: 0 ticks lost, host time in ms: median (min … max) of all swaps"
    );
    let folder = tempfile::tempdir()?;
    let manifest = folder.path().join("swap.toml");
    let hover = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifests/hover.toml");
    let swap = format!(
        "include = [{hover:?}]\n[[swap]]\nprocess = \"controller\"\nat_tick = {FIRST_TICK}\nrepeat = {SWAPS}\n\
         every_ticks = {EVERY_TICKS}\nshadow_ticks = {SHADOW_TICKS}\n"
    );
    std::fs::write(&manifest, swap)?;
    let recording = folder.path().join("swap.mcap");
    let recording = recording.to_string_lossy();
    for (pace, repetitions) in [("free", REPETITIONS), ("realtime", 1)] {
        let arguments = ["--record", &recording, "--pace", pace];
        let (mut plain, mut swapped) = (vec![], vec![]);
        for _ in 0..repetitions {
            // By turns, so that a noisy minute falls on both.
            plain.push(run_manifest(&hover, &arguments)?);
            swapped.push(run_manifest(&manifest, &arguments)?);
        }
        print(pace, &plain, &swapped)?;
    }
    Ok(())
}

fn print(pace: &str, plain: &[Value], swapped: &[Value]) -> Result<()> {
    let mut cost = Vec::new();
    for (plain, swapped) in plain.iter().zip(swapped) {
        if plain["ticks"] != swapped["ticks"] || successions(swapped).count() != SWAPS {
            return Err(format!("not {SWAPS} swaps, or ticks are missing: {}", swapped["successions"]).into());
        }
        cost.push((number(swapped, "host_s")? - number(plain, "host_s")?) * 1e3 / SWAPS as f64);
    }
    let all = |key: &str| -> Result<Spread> {
        let found = swapped.iter().flat_map(successions).map(|succession| number(succession, key));
        Ok(Spread::of(found.collect::<Result<Vec<f64>>>()?))
    };
    println!("  {pace}: start of the backup's process  {}", all("start_ms")?);
    println!("  {pace}: clock held                        {}", all("hold_ms")?);
    println!("  {pace}: run with swaps − run without, per swap  {}", Spread::of(cost));
    if pace != "free" {
        let missed =
            |runs: &[Value]| -> Result<f64> { runs.iter().map(|run| number(run, "missed_deadlines")).sum() };
        println!("  {pace}: missed deadlines {} with swaps, {} without", missed(swapped)?, missed(plain)?);
    }
    Ok(())
}

/// The swaps of a run that took over.
fn successions(summary: &Value) -> impl Iterator<Item = &Value> {
    let all = summary["successions"].as_array().into_iter().flatten();
    all.filter(|succession| succession["take_over_tick"].is_u64())
}
