//! Helpers that the parts share: medians with spread, a table, a run of a manifest as JSON.

use std::path::Path;
use std::process::Command;

pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Median, smallest and largest of some repetitions.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    pub median: f64,
    pub min: f64,
    pub max: f64,
}

impl Spread {
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        Self { median: values[values.len() / 2], min: values[0], max: values[values.len() - 1] }
    }
}

impl std::fmt::Display for Spread {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:8.2}  ({:.2} … {:.2})", self.median, self.min, self.max)
    }
}

/// Prints the facts of this machine.
pub fn print_machine() {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find(|line| line.starts_with("model name")).unwrap_or("unknown processor");
    let kernel = std::fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    println!("{cores} cores, {}, Linux {}", model.rsplit(": ").next().unwrap_or(model), kernel.trim());
}

/// Runs the manifest at `path` and returns its summary.
pub fn run_manifest(path: &Path, arguments: &[&str]) -> Result<serde_json::Value> {
    fly_manifest("run", path, arguments)
}

/// Runs or profiles the manifest at `path` and returns its summary.
pub fn fly_manifest(verb: &str, path: &Path, arguments: &[&str]) -> Result<serde_json::Value> {
    let output =
        Command::new(crate::HUMMINGBUS).arg(verb).arg(path).args(arguments).arg("--json").output()?;
    // Conditions that a shortened flight cannot meet are no matter here.
    if output.status.success() || output.status.code() == Some(1) {
        Ok(serde_json::from_slice(&output.stdout)?)
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned().into())
    }
}

/// A number of a summary.
pub fn number(summary: &serde_json::Value, key: &str) -> Result<f64> {
    summary[key].as_f64().ok_or_else(|| format!("the summary has no number `{key}`").into())
}

/// The slope of the straight line through `points` with the least squares of the ordinates' errors.
pub fn slope(points: impl Iterator<Item = (f64, f64)>) -> f64 {
    let points: Vec<_> = points.collect();
    let count = points.len() as f64;
    let (mean_x, mean_y) =
        points.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0 / count, y + point.1 / count));
    let products = points.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>();
    products / points.iter().map(|(x, _)| (x - mean_x).powi(2)).sum::<f64>()
}
