//! A slow disturbance under feedback is not taken for an inertia, and an inertia beside one is found. The whole
//! table is made by `cargo run --release -p hummingbus-identify --example feedback`, see docs/validation.md.
use crate::simulated;
use crate::skipped::cases;
use rayon::prelude::*;
use simulated::feedback::{Gust, fitted, gusts, searched};

const SEED: u64 = 40_000;

/// Some of the disturbances: of all correlation times, controllers and courses, but not each with each.
fn some() -> Vec<(u64, Gust)> {
    (SEED..).zip(gusts()).filter(|(seed, _)| seed % 7 == 0).collect()
}

#[test]
fn the_interval_of_the_inertia_holds_the_truth_beside_slow_disturbances() {
    for error in cases("inertias", [0.0, 0.25, -0.1], |error| *error > 0.0) {
        let found: Vec<(f64, f64, f64)> =
            some().par_iter().flat_map_iter(|(seed, gust)| fitted(gust, error, *seed).inertia).collect();
        let held = found.iter().filter(|(_, low, high)| *low <= error && error <= *high).count();
        let mean = found.iter().map(|found| found.0).sum::<f64>() / found.len() as f64;
        println!("inertia {error}: {held} of {} hold, mean {mean:.3}", found.len());
        // Both axes feel the same disturbance: these are half as many. White noise has a mean of +100 % here.
        assert!(held as f64 >= 0.7 * found.len() as f64, "inertia {error}: {held} of {} hold", found.len());
        assert!((mean - error).abs() < 0.08, "inertia {error}: mean {mean:.3}");
    }
}

#[test]
fn no_inertia_is_named_for_a_disturbance_that_the_controller_answers() {
    // Quick tests take a strong and slow one of a hover.
    let taken = cases("disturbances", some(), |(seed, _)| *seed == SEED + 26);
    let named: Vec<(Gust, Vec<&str>)> = taken
        .par_iter()
        .map(|(seed, gust)| (*gust, searched(gust, 0.0, *seed).verdict))
        .filter(|(_, verdict)| verdict.contains(&"inertia-error"))
        .collect();
    assert!(named.is_empty(), "{named:?}");
}
