//! The trajectory node: publishes the points of a trajectory, with the derivatives that controllers feed forward.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::trajectory::{Start, Trajectory};
use bus::context::NodeContext;
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::Reference;
use bus::{BusError, Message, Node};
use diagnostics::ParameterError;
use serde::Deserialize;

/// The trajectory, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "trajectory",
    summary: "references from the manifest: hover, circle, figure eight, minimum snap through waypoints",
    inputs: Inputs::Ports(&[]),
    outputs: &[PortSpec::required("reference", Reference::SCHEMA)],
    check: |parameters, run| {
        let trajectory = read(&diagnostics::read(parameters)?)?;
        trajectory.require_flyable()?;
        warn_of_late(&trajectory, run);
        Ok(())
    },
    run,
};

/// Parameters of the trajectory.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Where it starts, in the world.
    initial_position_m: [f64; 3],
    /// Yaw at its start.
    #[serde(default)]
    initial_yaw_deg: f64,
    /// The segments; it hovers where the last ends.
    #[serde(default)]
    segments: Vec<serde_json::Value>,
}

fn read(parameters: &Parameters) -> Result<Trajectory, ParameterError> {
    let position_W_m = nalgebra::Vector3::from(parameters.initial_position_m);
    Trajectory::read(
        &parameters.segments,
        Start { position_W_m, yaw_rad: parameters.initial_yaw_deg.to_radians() },
    )
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

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let output = node.output::<Reference>("reference")?;
    let trajectory = read(&node.parameters()?).map_err(|error| node.error(error))?;
    node.run(|tick| tick.write(output, Reference::from(&trajectory.at(tick.time_ns() as f64 * 1e-9))))
}
