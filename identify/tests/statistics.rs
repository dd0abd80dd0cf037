//! The statistics agree with SciPy and statsmodels, and the intervals hold the truth as often as they promise.

use crate::skipped;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use identify::statistics::{
    Bootstrap, autocorrelation, block_bootstrap_mean, chi_square_tail, cross_correlation, jackknife,
    ljung_box, normal_quantile, student_quantile, white_noise_bound,
};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use serde_json::{Value, json};

const PROBABILITIES: [f64; 7] = [0.001, 0.025, 0.2, 0.5, 0.9, 0.975, 0.9995];
const FREEDOMS: [f64; 5] = [1.0, 2.0, 7.0, 19.0, 240.0];
const VALUES: [f64; 5] = [0.01, 0.7, 6.0, 31.4, 260.0];
const LAGS: usize = 25;

/// Noise that remembers: x_t = memory x_{t-1} + e_t.
fn remembering(samples: usize, memory: f64, seed: u64) -> Vec<f64> {
    let mut draws = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || component::random::normal(&mut draws);
    let mut state = normal() / (1.0 - memory * memory).sqrt();
    (0..samples)
        .map(|_| {
            state = memory * state + normal();
            state
        })
        .collect()
}

/// The folder with the Python that has SciPy and statsmodels; `scripts/test` makes it.
fn readers() -> Option<PathBuf> {
    let readers = skipped::variable_or_skip("HUMMINGBUS_READERS", "which scripts/test sets up");
    assert!(readers.is_some() || std::env::var_os("CI").is_none(), "HUMMINGBUS_READERS is not set");
    readers.map(PathBuf::from)
}

fn answers(readers: &Path, question: &Value) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/statistics.py");
    let mut command = Command::new(readers.join("venv/bin/python"));
    command.arg(script).env("PYTHONDONTWRITEBYTECODE", "1").stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.spawn().expect("the readers' Python");
    child.stdin.take().unwrap().write_all(question.to_string().as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "the reference script failed");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Compares to 1e-9, relative where numbers are above 1.
fn require_near(name: &str, found: &[f64], reference: &Value) {
    let reference: Vec<f64> = serde_json::from_value(reference.clone()).unwrap();
    assert_eq!(found.len(), reference.len(), "{name}");
    for (found, reference) in found.iter().zip(reference) {
        let error = (found - reference).abs() / reference.abs().max(1.0);
        assert!(error < 1e-9, "{name}: {found} against {reference}");
    }
}

#[test]
fn scipy_and_statsmodels_say_the_same() {
    let Some(readers) = readers() else { return };
    let (x, y) = (remembering(500, 0.5, 1), remembering(500, 0.8, 2));
    let question = json!({
        "x": x, "y": y, "lags": LAGS, "probabilities": PROBABILITIES, "freedoms": FREEDOMS, "values": VALUES,
    });
    let reference = answers(&readers, &question);
    require_near("autocorrelation", &autocorrelation(&x, LAGS), &reference["autocorrelation"]);
    require_near("cross_correlation", &cross_correlation(&x, &y, LAGS), &reference["cross_correlation"]);
    let test = ljung_box(&x, LAGS);
    require_near("ljung_box", &[test.statistic, test.p_value], &reference["ljung_box"]);
    require_near("normal_quantile", &PROBABILITIES.map(normal_quantile), &reference["normal_quantile"]);
    for (index, freedom) in FREEDOMS.into_iter().enumerate() {
        let student = PROBABILITIES.map(|p| student_quantile(p, freedom));
        require_near("student_quantile", &student, &reference["student_quantile"][index]);
        let tails = VALUES.map(|value| chi_square_tail(value, freedom));
        require_near("chi_square_tail", &tails, &reference["chi_square_tail"][index]);
    }
}

#[test]
fn white_noise_keeps_its_bound_and_the_remembering_does_not() {
    assert!((white_noise_bound(400, 0.95) - 1.959_963_984_540_054 / 20.0).abs() < 1e-12);
    let bound = white_noise_bound(2000, 0.99);
    let outside = |memory: f64| {
        let correlation = autocorrelation(&remembering(2000, memory, 3), 40);
        correlation[1..].iter().filter(|r| r.abs() > bound).count()
    };
    assert!(outside(0.0) <= 2, "{}", outside(0.0));
    assert!(outside(0.7) > 4, "{}", outside(0.7));
}

#[test]
fn ljung_box_rejects_white_noise_at_its_rate() {
    let rejected =
        (0..400).filter(|seed| ljung_box(&remembering(300, 0.0, *seed), 20).p_value < 0.05).count();
    assert!((8..=36).contains(&rejected), "{rejected} of 400");
    assert!(ljung_box(&remembering(300, 0.6, 5), 20).p_value < 1e-6);
}

/// Returns the share of 95 % intervals that hold the mean, which is 0, of 400 samples that remember about four.
fn coverage(block: usize) -> f64 {
    const CASES: u64 = 300;
    let how = |seed| Bootstrap { block, resamples: 400, seed, level: 0.95 };
    let holds = |seed: &u64| {
        let interval = block_bootstrap_mean(&remembering(400, 0.6, 1000 + *seed), &how(*seed));
        interval.low <= 0.0 && 0.0 <= interval.high
    };
    (0..CASES).filter(holds).count() as f64 / CASES as f64
}

#[test]
fn the_block_bootstrap_holds_the_mean_and_single_samples_do_not() {
    let (blocks, singles) = (coverage(20), coverage(1));
    assert!((0.88..=0.98).contains(&blocks), "blocks: {blocks}");
    assert!(singles < 0.75, "single samples: {singles}");
}

#[test]
fn the_bootstrap_is_the_same_for_the_same_seed() {
    let values = remembering(50, 0.3, 9);
    let how = Bootstrap { block: 7, resamples: 100, seed: 4, level: 0.9 };
    let interval = block_bootstrap_mean(&values, &how);
    assert_eq!(interval, block_bootstrap_mean(&values, &how));
    assert_ne!(interval, block_bootstrap_mean(&values, &Bootstrap { seed: 5, ..how }));
    assert!(interval.low < interval.mean && interval.mean < interval.high);
}

#[test]
fn the_jackknife_of_a_mean_is_its_textbook_error() {
    let values = [1.0, 4.0, 2.0, 7.0];
    let sum: f64 = values.iter().sum();
    let estimate = jackknife(sum / 4.0, &values.map(|value| (sum - value) / 3.0), 0.95);
    let variance = values.iter().map(|value| (value - 3.5_f64).powi(2)).sum::<f64>() / 3.0;
    assert!((estimate.sigma - (variance / 4.0).sqrt()).abs() < 1e-12, "{estimate:?}");
    assert!(jackknife(1.0, &[1.0], 0.95).high.is_infinite());
}
