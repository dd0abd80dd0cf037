//! Speed of the wall scenarios relative to the world: one vehicle with all its sensors and the recorder, and ten in
//! one room under each host.

use crate::report::{Result, Spread, number, run_manifest};
use std::path::Path;

const REPETITIONS: usize = 5;

/// A scenario under a host: name, manifest, simulated seconds, and value of `--compose`.
struct Case {
    name: &'static str,
    manifest: &'static str,
    seconds: u32,
    compose: &'static str,
}

const CASES: [Case; 4] = [
    Case {
        name: "one vehicle, a process each",
        manifest: "wall-follow-constant",
        seconds: 30,
        compose: "none",
    },
    Case { name: "ten vehicles, a process each", manifest: "ten-vehicles", seconds: 5, compose: "none" },
    Case { name: "ten vehicles, a group each", manifest: "ten-vehicles", seconds: 5, compose: "vehicles" },
    Case { name: "ten vehicles, one group", manifest: "ten-vehicles", seconds: 5, compose: "all" },
];

/// Prints the real-time factor: simulated seconds per second of host time.
pub fn report() -> Result<()> {
    println!(
        "\nreal-time factor (simulated seconds per second), recorded, median (min … max) of {REPETITIONS} runs by turns"
    );
    let folder = tempfile::tempdir()?;
    let mut factors = CASES.map(|_| Vec::new());
    for _ in 0..REPETITIONS {
        for (found, case) in factors.iter_mut().zip(&CASES) {
            found.push(case.factor(folder.path())?);
        }
    }
    for (found, case) in factors.into_iter().zip(&CASES) {
        println!("  {:<30} {}", case.name, Spread::of(found));
    }
    Ok(())
}

impl Case {
    /// Flies the scenario once, recorded to `folder`; returns its real-time factor.
    fn factor(&self, folder: &Path) -> Result<f64> {
        let manifest =
            Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("manifests/{}.toml", self.manifest));
        let recording = folder.join("flight.mcap");
        let duration = format!("run.duration_s={}", self.seconds);
        let record = recording.to_string_lossy();
        let arguments = ["--record", &*record, "--set", &duration, "--compose", self.compose];
        number(&run_manifest(&manifest, &arguments)?, "real_time_factor")
    }
}
