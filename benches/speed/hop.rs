//! The cost of a hop on the bus against a raw ring of as many processes on the same cores.

use crate::floor;
use crate::relay::ring_manifest;
use crate::report::{Result, Spread, number, run_manifest};

const PROCESSES: usize = 4;
const TICKS: u32 = 60_000;
const REPETITIONS: usize = 7;

/// Prints the hop cost of the bus, of the floor, and their ratio.
pub fn report() -> Result<()> {
    println!(
        "\nhop cost in µs: median (min … max) of {REPETITIONS} runs, {TICKS} laps, floor and bus in turn"
    );
    let one_core = vec![Some(0); PROCESSES];
    row("4 processes on one core, blocking", &one_core, "block")?;
    if std::thread::available_parallelism()?.get() > 1 {
        let two_cores: Vec<_> = (0..PROCESSES).map(|index| Some(index % 2)).collect();
        row("4 processes on two cores by turns, blocking", &two_cores, "block")?;
        row("2 processes on two cores, spinning", &[Some(0), Some(1)], "spin")?;
    }
    Ok(())
}

fn row(name: &str, cores: &[Option<usize>], wait: &str) -> Result<()> {
    let (mut floor, mut bus, mut ratio) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..REPETITIONS {
        // By turns, so that a noisy minute falls on both.
        let floor_us = floor::hop_ns(cores, TICKS, wait == "spin")? * 1e-3;
        let bus_us = bus_hop_us(cores, wait)?;
        floor.push(floor_us);
        bus.push(bus_us);
        ratio.push(bus_us / floor_us);
    }
    println!("{name}\n  floor {}\n  bus   {}", Spread::of(floor), Spread::of(bus));
    println!("  ratio {}", Spread::of(ratio));
    Ok(())
}

fn bus_hop_us(cores: &[Option<usize>], wait: &str) -> Result<f64> {
    let file = tempfile::Builder::new().suffix(".toml").tempfile()?;
    std::fs::write(file.path(), ring_manifest(64, cores, wait, TICKS, 64, None)?)?;
    let summary = run_manifest(file.path(), &[])?;
    Ok(number(&summary, "host_s")? * 1e6 / f64::from(TICKS) / cores.len() as f64)
}
