//! Speed of the wall scenarios relative to the world: one vehicle with all its sensors and the recorder, and ten in
//! one room.

use crate::report::{Result, Spread, number, run_manifest};
use std::path::Path;

const REPETITIONS: usize = 5;

/// Prints simulated seconds per second.
pub fn report() -> Result<()> {
    println!("\nsimulated seconds per second, recorded, median (min … max) of {REPETITIONS} runs");
    for (name, seconds) in [("wall-follow-constant", 30), ("ten-vehicles", 5)] {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("manifests/{name}.toml"));
        let folder = tempfile::tempdir()?;
        let recording = folder.path().join("flight.mcap");
        let duration = format!("run.duration_s={seconds}");
        let arguments = ["--record", &recording.to_string_lossy(), "--set", &duration];
        let factor = || number(&run_manifest(&manifest, &arguments)?, "real_time_factor");
        let factors = (0..REPETITIONS).map(|_| factor()).collect::<Result<Vec<_>>>()?;
        println!("  {name:<22} {}", Spread::of(factors));
    }
    Ok(())
}
