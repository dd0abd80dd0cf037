//! The trajectory node: publishes the points of a trajectory, with the derivatives that controllers feed forward.

use crate::trajectory::{Start, Trajectory};
use bus::OutputPorts;
use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::Reference;
use diagnostics::ParameterError;

/// Parameters of the trajectory.
#[derive(Debug, bus::Parameters)]
pub struct Parameters {
    /// Position at its start, in the world.
    #[parameter(example = "[0.0, 0.0, 1.0]")]
    initial_position_m: [f64; 3],
    /// Yaw at its start.
    #[parameter(default = 0.0)]
    initial_yaw_deg: f64,
    /// List of segments, flown one after another; it hovers where the last ends.
    #[parameter(default = Vec::new())]
    segments: Vec<serde_json::Value>,
}

/// Warns of segments that the run ends before.
fn warn_of_late(trajectory: &Trajectory, run: &NodeContext<'_>) {
    let end_s = run.duration_s();
    if let Some((index, start_s)) = trajectory.starts_s().enumerate().find(|(_, start_s)| *start_s >= end_s) {
        run.warn_behind_end("segments", format!(
            "`segments`: entry {index} (the first is 0) begins at {start_s:.3} s, and the run ends at {end_s} s: it and \
             what follows is never flown"
        ));
    }
}

/// Outputs of the node.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// Point of the trajectory.
    pub reference: Reference,
}

/// The component `trajectory`.
///
/// ```
/// use controllers::trajectory_node::TrajectoryNode;
/// use serde_json::json;
///
/// let circle = json!({ "kind": "circle", "radius_m": 2.0, "speed_m_s": 2.0, "laps": 2, "ramp_s": 2.0 });
/// let parameters = json!({ "initial_position_m": [0.0, 0.0, 1.0], "segments": [circle] });
/// let mut trajectory = bus::Harness::<TrajectoryNode>::from_json(&parameters).unwrap();
/// let reference = trajectory.step(()).unwrap().reference;
/// assert_eq!((reference.position.z, reference.velocity.x), (1.0, 0.0), "it starts from rest");
/// ```
#[derive(Debug)]
pub struct TrajectoryNode(Trajectory);

impl Component for TrajectoryNode {
    const INFO: Info = Info::new(
        "trajectory",
        "references from the manifest: hover, circle, figure eight, minimum snap through waypoints",
    );
    type Parameters = Parameters;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = ();

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let position_W_m = parameters.initial_position_m.into();
        let start = Start { position_W_m, yaw_rad: parameters.initial_yaw_deg.to_radians() };
        let trajectory = Trajectory::read(&parameters.segments, start)?;
        trajectory.require_flyable()?;
        warn_of_late(&trajectory, context);
        Ok(Self(trajectory))
    }

    fn initial(&self) {}

    fn step(&self, context: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
        Ok(Outputs { reference: Reference::from(&self.0.at(context.time_ns() as f64 * 1e-9)) })
    }
}
