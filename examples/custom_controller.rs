//! A controller in its own binary: reads two topics, publishes motor commands.
//!
//! `cargo build --release --examples`, then `hummingbus run manifests/custom-controller.toml`.

use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::{MotorCommand, Quaternion, SetPoint, StateEstimate};
use bus::{BusError, InputPorts, OutputPorts, ParameterError, Parameters};

/// The manifest's `parameters` table: gains from an error to motor counts.
#[derive(Parameters)]
struct Gains {
    /// Command at which the vehicle hovers, in counts.
    hover_count: f64,
    /// Counts per metre of altitude error, and per metre a second of climb.
    altitude: [f64; 2],
    /// Counts per radian of roll or pitch error, and per radian a second of rate.
    tilt: [f64; 2],
}

#[derive(InputPorts)]
struct Inputs<'a> {
    set_point: &'a SetPoint,
    estimate: &'a StateEstimate,
}

#[derive(OutputPorts)]
struct Outputs {
    command: MotorCommand,
}

/// The controller, which remembers nothing from tick to tick.
struct Controller(Gains);

impl Component for Controller {
    const INFO: Info = Info::new("custom", "proportional-derivative control of altitude, roll and pitch");
    type Parameters = Gains;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(gains: Gains, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self(gains))
    }

    fn initial(&self) {}

    fn step(&self, _: &StepContext<'_>, inputs: Inputs<'_>, (): &mut ()) -> Result<Outputs, StepError> {
        let (Self(gains), asked, found) = (self, inputs.set_point, inputs.estimate);
        let law = |gains: [f64; 2], error: f64, rate: f64| gains[0] * error - gains[1] * rate;
        let lift = law(gains.altitude, asked.altitude - found.position.z, found.velocity.z);
        let (roll, pitch) = tilt_rad(&found.attitude);
        let roll = law(gains.tilt, asked.roll - roll, found.angular_velocity.x);
        let pitch = law(gains.tilt, asked.pitch - pitch, found.angular_velocity.y);
        // Rotors in the order of the vehicle file: front, right, rear, left. Roll lifts the left side,
        // pitch the rear.
        let mix = [-pitch, -roll, pitch, roll];
        let command = mix.map(|tilt| gains.hover_count + lift + tilt);
        Ok(Outputs { command: MotorCommand { command: command.into(), ..Default::default() } })
    }
}

fn main() -> Result<(), BusError> {
    bus::run_process::<Controller>()
}

/// Roll and pitch (positive nose down) of an attitude near level.
fn tilt_rad(q: &Quaternion) -> (f64, f64) {
    (2.0 * (q.w * q.x + q.y * q.z), 2.0 * (q.w * q.y - q.z * q.x))
}
