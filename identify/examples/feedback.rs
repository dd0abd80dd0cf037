//! Flights under feedback with disturbances of many spectra: the inertia that identification finds.
//!
//! ```sh
//! cargo run --release -p hummingbus-identify --example feedback            # the search, flight by flight
//! cargo run --release -p hummingbus-identify --example feedback -- fit     # the fit of the inertia alone
//! cargo run --release -p hummingbus-identify --example feedback -- search 0.25   # of a vehicle with so much more inertia
//! ```
#[path = "../tests/simulated/mod.rs"]
mod simulated;

use rayon::prelude::*;
use simulated::feedback::{Found, Gust, fitted, gusts, searched};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let is_fit = arguments.first().is_some_and(|part| part == "fit");
    let error: f64 = arguments.get(1).map_or(0.0, |error| error.parse().expect("an error of inertia"));
    let one = |(number, gust): (usize, &Gust)| {
        let seed = 40_000 + number as u64;
        let found = || if is_fit { fitted(gust, error, seed) } else { searched(gust, error, seed) };
        (*gust, std::panic::catch_unwind(found).ok())
    };
    let all: Vec<(Gust, Option<Found>)> = gusts().par_iter().enumerate().map(one).collect();
    let (mut held, mut count, mut named) = (0, 0, 0);
    for (gust, found) in &all {
        println!("{gust:?}: {found:.3?}");
        let Some(found) = found else { continue };
        named += usize::from(found.verdict.contains(&"inertia-error"));
        count += found.inertia.len();
        held += found.inertia.iter().filter(|(_, low, high)| *low <= error && error <= *high).count();
    }
    println!("inertia named in {named} of {}; intervals hold {held} of {count}", all.len());
}
