//! Start-up time of the hover's process set, against starting as many processes that do nothing.

use crate::flying::Flying;
use crate::report::{Result, Spread};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Instant;

const REPETITIONS: usize = 21;
/// The processes of hover.toml: seven nodes and the clock.
const PROCESSES: usize = 8;

/// Prints the time from the launcher's start to the first grant, its parts, and its ratio to the reference.
pub fn report() -> Result<()> {
    println!(
        "\nstart of hover.toml ({PROCESSES} processes) in ms: median (min … max) of {REPETITIONS} runs by turns"
    );
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifests/hover.toml");
    let folder = tempfile::tempdir()?;
    let recording = folder.path().join("hover.mcap");
    // Paced, so that the end of the run does not fall into the look at its start; conditions need all of it.
    let arguments = ["--record", &recording.to_string_lossy(), "--pace", "realtime"];
    let (mut planned, mut announced, mut connected, mut whole) = (vec![], vec![], vec![], vec![]);
    let (mut reference, mut ratio) = (vec![], vec![]);
    for _ in 0..REPETITIONS {
        let idle_ms = idle_processes_ms()?;
        let run = Flying::start(&manifest, &arguments)?;
        let stages = run.stages()?;
        run.stop()?;
        planned.push(stages.planned_s * 1e3);
        announced.push((stages.announced_s - stages.planned_s) * 1e3);
        connected.push((stages.granted_s - stages.announced_s) * 1e3);
        whole.push(stages.granted_s * 1e3);
        reference.push(idle_ms);
        ratio.push(stages.granted_s * 1e3 / idle_ms);
    }
    println!("  launcher up, manifest checked        {}", Spread::of(planned));
    println!("  processes started, outputs created   {}", Spread::of(announced));
    println!("  inputs connected, tick 0 granted     {}", Spread::of(connected));
    println!("  whole                                {}", Spread::of(whole));
    println!("  {PROCESSES} × `hummingbus --version`           {}", Spread::of(reference));
    println!("  ratio                                {}", Spread::of(ratio));
    Ok(())
}

/// Host time of starting as many processes of the same executable that end at once, until the last has ended.
fn idle_processes_ms() -> Result<f64> {
    let started = Instant::now();
    let start = |_| Command::new(crate::HUMMINGBUS).arg("--version").stdout(Stdio::null()).spawn();
    let mut children = (0..PROCESSES).map(start).collect::<std::io::Result<Vec<Child>>>()?;
    for child in &mut children {
        child.wait()?;
    }
    Ok(started.elapsed().as_secs_f64() * 1e3)
}
