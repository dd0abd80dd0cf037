//! Cost of profiling: ticks per second of the hover manifest with and without it.

use crate::report::{Result, Spread, fly_manifest, number};
use std::path::Path;

/// Pairs of runs; odd, so that a median is one of them.
const PAIRS: usize = 9;
const SECONDS: f64 = 60.0;

/// Prints both tick rates and their ratio.
pub fn report() -> Result<()> {
    println!(
        "\nhover.toml with recorder, free-running, {SECONDS} s simulated, {PAIRS} pairs of runs by turns"
    );
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifests/hover.toml");
    let folder = tempfile::tempdir()?;
    let recording = folder.path().join("hover.mcap");
    let duration = format!("run.duration_s={SECONDS}");
    let arguments = ["--record", &recording.to_string_lossy(), "--set", &duration];
    let rate = |verb| {
        Ok::<_, Box<dyn std::error::Error>>(
            number(&fly_manifest(verb, &manifest, &arguments)?, "ticks_per_s")? * 1e-3,
        )
    };
    let (mut plain, mut profiled, mut ratio) = (Vec::new(), Vec::new(), Vec::new());
    for pair in 0..PAIRS {
        // The first of a pair changes, so that a machine that slows down favours neither.
        let verbs = if pair % 2 == 0 { ["run", "profile"] } else { ["profile", "run"] };
        let mut rates = [rate(verbs[0])?, rate(verbs[1])?];
        if verbs[0] == "profile" {
            rates.reverse();
        }
        plain.push(rates[0]);
        profiled.push(rates[1]);
        ratio.push(rates[1] / rates[0]);
    }
    println!("  not profiled, kticks/s      {}", Spread::of(plain));
    println!("  profiled, kticks/s          {}", Spread::of(profiled));
    println!("  profiled / not profiled     {}", Spread::of(ratio));
    Ok(())
}
