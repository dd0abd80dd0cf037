//! A controller in its own binary: joins a run, reads three topics, publishes motor commands.
//!
//! `cargo build --release --examples`, then `hummingbus run manifests/custom-controller.toml`.

use bus::messages::{AttitudeEstimate, MotorCommand, PlantState, SetPoint};
use bus::{BusError, Node};
use serde::Deserialize;

/// What the manifest's `parameters` table holds; gains from an error to motor counts.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Command at which the vehicle hovers, in counts.
    hover_count: f64,
    /// Counts per metre of altitude error, and per metre a second of climb.
    altitude: [f64; 2],
    /// Counts per radian of roll or pitch error, and per radian a second of rate.
    tilt: [f64; 2],
}

fn main() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let set_point = node.input::<SetPoint>("set_point")?;
    let attitude = node.input::<AttitudeEstimate>("attitude")?;
    let truth = node.input::<PlantState>("altitude")?;
    let command = node.output::<MotorCommand>("command")?;
    let gains: Parameters = node.parameters()?;

    node.run(|tick| {
        let (asked, attitude, truth) = (tick.get(set_point), tick.get(attitude), tick.get(truth));
        let law = |gains: [f64; 2], error: f64, rate: f64| gains[0] * error - gains[1] * rate;
        let lift = law(gains.altitude, asked.altitude - truth.position.z, truth.velocity.z);
        let roll = law(gains.tilt, asked.roll - attitude.roll, attitude.angular_velocity.x);
        let pitch = law(gains.tilt, asked.pitch - attitude.pitch, attitude.angular_velocity.y);
        // Rotors in the order of the vehicle file: front, right, rear, left. Roll lifts the left side,
        // pitch the rear.
        let mix = [-pitch, -roll, pitch, roll];
        let command_counts = mix.map(|tilt| gains.hover_count + lift + tilt);
        tick.write(command, MotorCommand { command: command_counts, ..Default::default() })
    })
}
