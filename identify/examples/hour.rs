//! Identification time of an hour of flight at 1 kHz: 3.6 million rows through all candidates, flown in this process.
//!
//! ```sh
//! cargo run --release -p hummingbus-identify --example hour          # or with a number of minutes
//! ```
#![allow(clippy::disallowed_methods, reason = "it measures the time that the machine takes")]
#[path = "../tests/simulated/mod.rs"]
mod simulated;

use flights::{FlightSet, Role};
use identify::run::identify;
use simulated::{Plan, effect, fly, vehicle_file};
use std::time::Instant;
use vehicles::Vehicle;

fn main() {
    let minutes: f64 = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(60.0);
    let file = vehicle_file("hummingbird.toml");
    let vehicle = Vehicle::load(&file).expect("a vehicle file");
    let truth =
        vec![effect("rotor-drag", &[("coefficient", 8e-5)]), effect("mass-error", &[("error", 0.05)])];
    let mut plan = Plan { duration_s: 30.0 * minutes, ..Plan::of(truth, 1) };
    plan.sensors.has_rotor_speeds = true;
    let flights = [Role::Fit, Role::Test].map(|role| {
        plan.seed += 1;
        fly(&vehicle, &plan, role)
    });
    let rows: usize = flights.iter().map(|flight| flight.command.time_s.len()).sum();
    let set = FlightSet {
        vehicle: file,
        flights: flights.to_vec(),
        next_flight: Default::default(),
        files: Default::default(),
    };
    println!("{rows} rows of 1 ms in {} flights", set.flights.len());
    let start = Instant::now();
    let mut stages: Vec<(String, f64)> = Vec::new();
    let outcome = identify(&set, &mut |step| {
        stages.push((step.split(':').next().unwrap_or(step).to_owned(), start.elapsed().as_secs_f64()));
    })
    .expect("flights to identify on");
    let total_s = start.elapsed().as_secs_f64();
    for (at, (name, from_s)) in
        stages.iter().enumerate().filter(|(at, stage)| *at == 0 || stages[at - 1].0 != stage.0)
    {
        let next = stages[at..].iter().find(|stage| stage.0 != *name).map_or(total_s, |stage| stage.1);
        println!("| {name} | {:.1} s |", next - from_s);
    }
    println!("named in {total_s:.1} s:");
    for name in &outcome.report.verdict {
        let effect = &outcome.report.effects[name];
        let gain = 1.0 - (effect.held_out.after / effect.held_out.before).powi(2);
        println!("| {name} | {:.2} % of the squares |", 100.0 * gain);
        for (parameter, found) in &effect.parameters {
            println!("| {parameter} | {:.4e} | {:.4e} to {:.4e} |", found.value, found.low, found.high);
        }
    }
}
