//! Host time per tick and memory against the number of vehicles of one process set.

use crate::flying::Flying;
use crate::report::{Result, Spread, number, run_manifest, slope};
use std::path::Path;

const VEHICLES: [u32; 6] = [1, 2, 4, 8, 16, 32];
const REPETITIONS: usize = 3;
/// Ticks of all vehicles of a run together, so that each run takes one to two seconds.
const VEHICLE_TICKS: u32 = 48_000;
/// By then every process has computed, and has touched the memory that it needs.
const WARM_TICKS: u32 = 200;

/// Prints rates, host time per tick against that of one vehicle, the exponent, and the memory.
pub fn report() -> Result<()> {
    println!(
        "\nvehicles of one process set (5 processes each) with one recorder, free-running, {VEHICLE_TICKS} \
         vehicle ticks: median (min … max) of {REPETITIONS} runs by turns"
    );
    let folder = tempfile::tempdir()?;
    let mut tick_us = VEHICLES.map(|_| Vec::new());
    for _ in 0..REPETITIONS {
        for (found, vehicles) in tick_us.iter_mut().zip(VEHICLES) {
            found.push(1e6 / ticks_per_s(folder.path(), vehicles)?);
        }
    }
    for (found, vehicles) in tick_us.iter().zip(VEHICLES) {
        // Each run against that of one vehicle in the same turn.
        let ratio = found.iter().zip(&tick_us[0]).map(|(many, one)| many / one / f64::from(vehicles));
        let rate = found.iter().map(|us| 1e3 / us).collect();
        println!("  {vehicles:2} vehicles, kticks/s                   {}", Spread::of(rate));
        println!("     host time of a tick / (one vehicle's · {vehicles:2}) {}", Spread::of(ratio.collect()));
    }
    let exponents = (0..REPETITIONS).map(|turn| {
        let points = VEHICLES.iter().zip(&tick_us);
        slope(points.map(|(vehicles, found)| (libm::log(f64::from(*vehicles)), libm::log(found[turn]))))
    });
    println!("  exponent of host time per tick against vehicles {}", Spread::of(exponents.collect()));
    print_memory(folder.path())
}

/// Prints the memory of runs in flight and its slope.
fn print_memory(folder: &Path) -> Result<()> {
    println!(
        "  memory in MB: private and files (Pss_Anon + Pss_File of launcher, clock and nodes) + /dev/shm"
    );
    let mut totals = VEHICLES.map(|_| Vec::new());
    for _ in 0..REPETITIONS {
        for (found, vehicles) in totals.iter_mut().zip(VEHICLES) {
            let manifest = write_manifest(folder, vehicles, 600.0)?;
            let recording = folder.join("memory.mcap");
            let run = Flying::start(&manifest, &["--record", &recording.to_string_lossy(), "--pace", "0.2"])?;
            run.await_ticks(WARM_TICKS)?;
            found.push(run.memory()?);
            run.stop()?;
        }
    }
    for (found, vehicles) in totals.iter().zip(VEHICLES) {
        let mb = |bytes: fn(&crate::flying::Memory) -> u64| {
            Spread::of(found.iter().map(|memory| bytes(memory) as f64 * 1e-6).collect())
        };
        println!("  {vehicles:2} vehicles: processes {}", mb(|memory| memory.processes_bytes));
        println!("               /dev/shm  {}", mb(|memory| memory.shared_bytes));
    }
    let slopes = (0..REPETITIONS).map(|turn| {
        let points = VEHICLES.iter().zip(&totals);
        slope(points.map(|(vehicles, found)| (f64::from(*vehicles), found[turn].total_bytes() as f64 * 1e-6)))
    });
    println!("  MB per vehicle (slope)   {}", Spread::of(slopes.collect()));
    Ok(())
}

fn ticks_per_s(folder: &Path, vehicles: u32) -> Result<f64> {
    let manifest = write_manifest(folder, vehicles, f64::from(VEHICLE_TICKS / vehicles) * 1e-3)?;
    let recording = folder.join("vehicles.mcap");
    number(&run_manifest(&manifest, &["--record", &recording.to_string_lossy()])?, "ticks_per_s")
}

/// A manifest of `vehicles` hovering Hummingbirds with one recorder, beside each other on no grid: they do not
/// meet.
fn write_manifest(folder: &Path, vehicles: u32, duration_s: f64) -> Result<std::path::PathBuf> {
    let set = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifests/sets/hover-set.toml");
    let path = folder.join("vehicles.toml");
    let text = format!(
        "include = [{set:?}]\n[run]\nduration_s = {duration_s}\n[process.recorder]\nkind = \"recorder\"\n\
         [[vehicle]]\nname = \"h\"\nset = \"hummingbird\"\ncount = {vehicles}\n"
    );
    std::fs::write(&path, text)?;
    Ok(path)
}
