//! Cost of a paced run while it waits: processor share per process.

use crate::report::{Result, number, run_manifest};
use std::path::Path;

/// Prints the processor share of each process of a hover run at real time.
pub fn report() -> Result<()> {
    println!("\nhover.toml at real time for 12 s: processor share of one core");
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifests/hover.toml");
    let folder = tempfile::tempdir()?;
    let recording = folder.path().join("hover.mcap");
    let arguments = ["--record", &recording.to_string_lossy(), "--pace", "realtime"];
    let summary = run_manifest(&manifest, &arguments)?;
    for process in summary["processes"].as_array().into_iter().flatten() {
        println!(
            "  {:<12} {:5.2} %",
            process["name"].as_str().unwrap_or("?"),
            100.0 * number(process, "cpu_share")?
        );
    }
    println!(
        "  missed deadlines: {} of {}",
        number(&summary, "missed_deadlines")?,
        number(&summary, "ticks")?
    );
    Ok(())
}
