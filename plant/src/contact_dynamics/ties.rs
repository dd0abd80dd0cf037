//! Joints of free bodies, as impulses see them: rows that keep two bodies together, and stops at the ends of their ways.
//!
//! The rows are laid out anew for each search for impulses, in buffers that are kept.

use super::body::lay_out;
use super::joints::{Joint, Line};
use super::solver::{Bilateral, Body, Row};
use super::touching::Touching;
use crate::state::RigidBody;

/// Buffers of the joints.
#[derive(Default)]
pub(super) struct Ties {
    /// The joints, ropes left out.
    pub joints: Vec<Bilateral>,
    /// Rows of one joint.
    rows: Vec<Row>,
    lines: Vec<Line>,
    /// The world, the vehicle and the free bodies, where they are.
    frames: Vec<RigidBody>,
}

impl Ties {
    /// Lays out `joints` for impulses on `bodies`: the vehicle at `vehicle`, and the free bodies at `states`.
    pub(super) fn lay(
        &mut self,
        joints: &[Joint],
        (vehicle, states): (&RigidBody, &[RigidBody]),
        bodies: &[Body],
    ) {
        self.joints.clear();
        if joints.is_empty() {
            return;
        }
        lay_out(vehicle, states, &mut self.frames);
        for joint in joints.iter().filter(|joint| !joint.is_rope()) {
            self.lines.clear();
            joint.lines(&self.frames, &mut self.lines);
            self.rows.clear();
            self.rows.extend(self.lines.iter().map(|line| Row::new(bodies, line.ends, line.jacobian)));
            self.joints.extend(Bilateral::new(&self.rows));
        }
    }

    /// Adds the stops of `joints` to the constraints in `touching`, and notes the ropes among them.
    pub(super) fn add_stops(
        &mut self,
        joints: &[Joint],
        (vehicle, states): (&RigidBody, &[RigidBody]),
        bodies: &[Body],
        touching: &mut Touching,
    ) {
        if joints.is_empty() {
            return;
        }
        let Touching { constraints, ropes, .. } = touching;
        lay_out(vehicle, states, &mut self.frames);
        ropes.clear();
        for (number, joint) in joints.iter().enumerate() {
            let first = constraints.len();
            joint.stops(bodies, &self.frames, constraints);
            if joint.is_rope() && constraints.len() > first {
                ropes.push([first, number]);
            }
        }
    }
}
