//! Latency of a hop against the size of the payload, across processes.

use crate::relay::{PAYLOADS, ring_manifest};
use crate::report::{Result, run_manifest};

const TICKS: u32 = 20_000;
/// Small, since a window's samples of 4 MB each must fit into shared memory.
const WINDOW: u32 = 4;
const REPETITIONS: usize = 5;

/// Prints p50, p99 and p99.9 of a hop for every payload size, and the ratio of medians to the smallest.
pub fn report() -> Result<()> {
    println!(
        "\nlatency of a hop in µs (sent → input taken), {TICKS} hops, median of {REPETITIONS} runs by turns"
    );
    for wait in ["block", "spin"] {
        let cores = if wait == "spin" { [Some(0), Some(1)] } else { [Some(0), Some(0)] };
        println!(
            "{wait}, cores {cores:?}\n  {:>9} {:>8} {:>8} {:>8}  p50 ratio",
            "bytes", "p50", "p99", "p99.9"
        );
        let mut latencies = vec![Vec::new(); PAYLOADS.len()];
        for _ in 0..REPETITIONS {
            for (runs, (bytes, _)) in latencies.iter_mut().zip(PAYLOADS) {
                runs.push(latency_us(*bytes, &cores, wait)?);
            }
        }
        let medians: Vec<[f64; 3]> = latencies.iter().map(|runs| median(runs)).collect();
        for ((bytes, _), [p50, p99, p999]) in PAYLOADS.iter().zip(&medians) {
            println!("  {bytes:>9} {p50:>8.2} {p99:>8.2} {p999:>8.2}  {:.2}", p50 / medians[0][0]);
        }
    }
    Ok(())
}

fn median(runs: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|quantile| {
        let mut values: Vec<f64> = runs.iter().map(|run| run[quantile]).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    })
}

fn latency_us(bytes: usize, cores: &[Option<usize>], wait: &str) -> Result<[f64; 3]> {
    let folder = tempfile::tempdir()?;
    let (manifest, latency) = (folder.path().join("ring.toml"), folder.path().join("latency"));
    std::fs::write(&manifest, ring_manifest(bytes, cores, wait, TICKS, WINDOW, Some(&latency))?)?;
    run_manifest(&manifest, &[])?;
    let text = std::fs::read_to_string(&latency)?;
    let values = text.split(' ').map(|word| Ok(word.parse::<f64>()? * 1e-3)).collect::<Result<Vec<_>>>()?;
    values.try_into().map_err(|_| "the relay wrote no three quantiles".into())
}
