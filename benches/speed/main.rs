//! The benchmark of the bus: every figure is a ratio against a reference measured in the same run.
//!
//! `cargo bench --bench speed` runs all parts; `cargo bench --bench speed -- hop hover` runs some.
#![allow(clippy::disallowed_methods, reason = "a benchmark measures host time")]

mod floor;
mod flying;
mod hop;
mod hover;
mod idle;
mod payload;
mod physics;
mod profile;
mod relay;
mod report;
mod scenarios;
mod start;
mod swap;
mod vehicles;

use report::Result;

/// The hummingbus binary that was built with this benchmark.
const HUMMINGBUS: &str = env!("CARGO_BIN_EXE_hummingbus");

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    match args.first().map(String::as_str) {
        // This binary is also the processes it measures.
        Some("floor-process") => floor::process(&args[1..]),
        Some("relay-process") => relay::process(&args[1..]),
        _ => parts(&args),
    }
}

/// A part of the benchmark: measures and prints.
type Part = fn() -> Result<()>;

fn parts(names: &[String]) -> Result<()> {
    let all: [(&str, Part); 10] = [
        ("hop", hop::report),
        ("hover", hover::report),
        ("payload", payload::report),
        ("idle", idle::report),
        ("profile", profile::report),
        ("vehicles", vehicles::report),
        ("start", start::report),
        ("swap", swap::report),
        ("physics", physics::report),
        ("scenarios", scenarios::report),
    ];
    if let Some(unknown) = names.iter().find(|name| all.iter().all(|(part, _)| part != name)) {
        let known = all.map(|(part, _)| part).join(", ");
        return Err(format!("no part `{unknown}`; there are {known}").into());
    }
    report::print_machine();
    for (name, report) in all {
        if names.is_empty() || names.iter().any(|wanted| wanted == name) {
            report()?;
        }
    }
    Ok(())
}
