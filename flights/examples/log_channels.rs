//! Prints the channels of a flights file as JSON, as they were read: SI units, body FLU, world z up.
//!
//! Usage: `cargo run --example log_channels -- FLIGHTS.toml`. A flight that is refused has a field `error`.

use flights::{Channel, Flight, FlightSet};
use serde_json::{Value, json};
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let files: Vec<String> = std::env::args().skip(1).collect();
    if files.is_empty() {
        eprintln!("usage: log_channels FLIGHTS.toml ...");
        return ExitCode::from(2);
    }
    for file in files {
        println!("{}", printed(Path::new(&file)));
    }
    ExitCode::SUCCESS
}

fn printed(file: &Path) -> Value {
    match FlightSet::load(file) {
        Ok(set) => json!({ "flights": set.flights.iter().map(flight).collect::<Vec<_>>() }),
        Err(error) => json!({ "error": error.to_string() }),
    }
}

fn flight(flight: &Flight) -> Value {
    json!({
        "name": flight.name,
        "command": channel(&flight.command),
        "attitude": channel(&flight.attitude),
        "angular_velocity": channel(&flight.angular_velocity),
        "specific_force": channel(&flight.specific_force),
        "battery_voltage": channel(&flight.battery_voltage),
        "notes": flight.notes,
    })
}

fn channel<const N: usize>(channel: &Channel<N>) -> Value {
    let values: Vec<&[f64]> = channel.values.iter().map(|value| &value[..]).collect();
    json!({ "time_s": channel.time_s, "values": values })
}
