//! A controller of height, roll and pitch, as a program of its own.

use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::{MotorCommand, Quaternion, SetPoint, StateEstimate};
use bus::{BusError, InputPorts, OutputPorts, ParameterError, Parameters};

#[cfg(test)]
mod hover_test;

/// The table `parameters` of the manifest. The defaults are tuned for the vehicle file of this project.
#[derive(Debug, Parameters)]
#[parameters(default)]
struct Gains {
    /// Command at which the vehicle hovers, in counts.
    #[parameter(default = 76.5)]
    hover: f64,
    /// Counts per metre of height error, and per metre a second of climb.
    #[parameter(default = [63.6, 31.8])]
    altitude: [f64; 2],
    /// Counts per radian of roll or pitch error, and per radian a second of rate.
    #[parameter(default = [11.6, 4.4])]
    tilt: [f64; 2],
    /// Counts per radian a second of yaw rate.
    #[parameter(default = 5.0)]
    yaw_rate: f64,
}

/// Inputs, by the names in the manifest.
#[derive(InputPorts)]
struct Inputs<'a> {
    set_point: &'a SetPoint,
    estimate: &'a StateEstimate,
}

/// Outputs, by the names in the manifest.
#[derive(OutputPorts)]
struct Outputs {
    command: MotorCommand,
}

/// The controller. Its state is empty: each command follows from the inputs of the same tick.
struct Controller(Gains);

impl Component for Controller {
    const INFO: Info =
        Info::new("own-controller", "proportional-derivative control of height, roll and pitch");
    type Parameters = Gains;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(gains: Gains, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self(gains))
    }

    fn initial(&self) {}

    fn step(&self, _: &StepContext<'_>, inputs: Inputs<'_>, (): &mut ()) -> Result<Outputs, StepError> {
        let (Self(gains), wanted, estimate) = (self, inputs.set_point, inputs.estimate);
        let law = |gains: [f64; 2], error: f64, rate: f64| gains[0] * error - gains[1] * rate;
        let lift =
            gains.hover + law(gains.altitude, wanted.altitude - estimate.position.z, estimate.velocity.z);
        let (roll, pitch) = tilt_rad(&estimate.attitude);
        let rate = &estimate.angular_velocity;
        let roll = law(gains.tilt, wanted.roll - roll, rate.x);
        let pitch = law(gains.tilt, wanted.pitch - pitch, rate.y);
        let yaw = -gains.yaw_rate * rate.z;
        // Rotors in the order of the vehicle file: front, right, rear, left. A positive roll lifts the left side, a
        // positive pitch the rear. The drag of the clockwise rotors, front and rear, yaws to the left.
        let mix = [yaw - pitch, -yaw - roll, yaw + pitch, -yaw + roll];
        let command = mix.map(|part| lift + part);
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
