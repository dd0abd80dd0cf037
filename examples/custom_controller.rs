//! A controller in its own binary: joins a run, reads two topics, publishes motor commands.
//!
//! `cargo build --release --examples`, then `hummingbus run manifests/custom-controller.toml`.

use bus::messages::{MotorCommand, Quaternion, SetPoint, StateEstimate};
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
    let estimate = node.input::<StateEstimate>("estimate")?;
    let command = node.output::<MotorCommand>("command")?;
    let gains: Parameters = node.parameters()?;

    node.run(|tick| {
        let (asked, found) = (tick.get(set_point), tick.get(estimate));
        let law = |gains: [f64; 2], error: f64, rate: f64| gains[0] * error - gains[1] * rate;
        let lift = law(gains.altitude, asked.altitude - found.position.z, found.velocity.z);
        let (roll, pitch) = tilt_rad(&found.attitude);
        let roll = law(gains.tilt, asked.roll - roll, found.angular_velocity.x);
        let pitch = law(gains.tilt, asked.pitch - pitch, found.angular_velocity.y);
        // Rotors in the order of the vehicle file: front, right, rear, left. Roll lifts the left side,
        // pitch the rear.
        let mix = [-pitch, -roll, pitch, roll];
        let command_counts = mix.map(|tilt| gains.hover_count + lift + tilt);
        tick.write(command, MotorCommand { command: command_counts, ..Default::default() })
    })
}

/// Roll and pitch (positive nose down) of an attitude near level.
fn tilt_rad(q: &Quaternion) -> (f64, f64) {
    (2.0 * (q.w * q.x + q.y * q.z), 2.0 * (q.w * q.y - q.z * q.x))
}
