//! The trajectory node: publishes the points of a course, with the derivatives that controllers feed forward.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::course::{Course, Point, Start};
use bus::context::NodeContext;
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::{Reference, Vector3};
use bus::{BusError, Message, Node};
use serde::Deserialize;

/// The trajectory, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "trajectory",
    summary: "references from the manifest: hover, circle, figure eight, minimum snap through waypoints",
    inputs: Inputs::Ports(&[]),
    outputs: &[PortSpec::required("reference", Reference::SCHEMA)],
    check: |parameters, run| {
        let course = course(&read_parameters(parameters)?)?;
        course.require_flyable()?;
        warn_of_late(&course, run);
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

fn course(parameters: &Parameters) -> Result<Course, String> {
    let position_W_m = nalgebra::Vector3::from(parameters.initial_position_m);
    Course::read(
        &parameters.segments,
        Start { position_W_m, yaw_rad: parameters.initial_yaw_deg.to_radians() },
    )
}

/// Warns of segments that the run ends before.
fn warn_of_late(course: &Course, run: &NodeContext<'_>) {
    let end_s = run.duration_s();
    if let Some((index, start_s)) = course.starts_s().enumerate().find(|(_, start_s)| *start_s >= end_s) {
        run.warn_behind_end(format!(
            "`segments`: entry {index} (the first is 0) begins at {start_s:.3} s, and the run ends at {end_s} s: it and \
             what follows is never flown"
        ));
    }
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let output = node.output::<Reference>("reference")?;
    let course = course(&node.parameters()?).map_err(|error| node.error(error))?;
    node.run(|tick| tick.write(output, reference(&course.at(tick.time_ns() as f64 * 1e-9))))
}

/// The message for a point.
#[must_use]
pub fn reference(point: &Point) -> Reference {
    let [position, velocity, acceleration, jerk, snap] =
        point.path_W.map(|vector| Vector3::from(<[f64; 3]>::from(vector)));
    let (yaw, yaw_rate) = (point.yaw_rad, point.yaw_rate_rad_s);
    Reference { position, velocity, acceleration, jerk, snap, yaw, yaw_rate, ..Default::default() }
}

/// The point in a message.
#[must_use]
pub fn point(message: &Reference) -> Point {
    let Reference { position, velocity, acceleration, jerk, snap, .. } = *message;
    let path_W = [position, velocity, acceleration, jerk, snap].map(|vector| <[f64; 3]>::from(vector).into());
    Point { path_W, yaw_rad: message.yaw, yaw_rate_rad_s: message.yaw_rate }
}
