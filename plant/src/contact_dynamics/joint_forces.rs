//! The impulses of all joints at once: those that change the rates of their rows to the wanted ones.
//!
//! With the Jacobian J of all rows and the bodies' mobility W they solve (J W Jᵀ) λ = wanted. The matrix is
//! symmetric and positive semidefinite. Forces over accelerations, and shifts over distances, are found the
//! same way.
use super::body::lay_out;
use super::cholesky::{factorise, substitute};
use super::drive::{Drive, Instant};
use super::joints::{Joint, Line};
use super::poles::{self, Spring};
use crate::state::RigidBody;
use nalgebra::{Matrix6, Vector6};

/// A row of which the others leave less than this part is redundant, as in a closed chain in a plane: it gets
/// no force. Tuned, no source.
const REDUNDANT: f64 = 1e-12;

/// Joints and the bodies that they tie, at one instant. Kept from step to step, so that it takes no memory.
#[derive(Default)]
pub(super) struct JointForces {
    /// The world, the vehicle and the bodies.
    frames: Vec<RigidBody>,
    mobilities: Vec<Matrix6<f64>>,
    /// The rows, with the number of the joint that each is of.
    lines: Vec<(usize, Line)>,
    damped: Vec<(Line, f64)>,
    /// Change of the twists of its ends by a unit impulse of each row.
    answers: Vec<[Vector6<f64>; 2]>,
    /// J W Jᵀ, row by row, and then its Cholesky factor in the lower triangle.
    matrix: Vec<f64>,
    impulses: Vec<f64>,
    scratch: Vec<Line>,
}

impl JointForces {
    /// The world, the vehicle and the bodies, their attitudes of length 1.
    pub(super) fn frames(&self) -> &[RigidBody] {
        &self.frames
    }

    /// Takes in where all are, with the mobility of each by its number.
    pub(super) fn see(
        &mut self,
        vehicle: &RigidBody,
        bodies: &[RigidBody],
        mobility: impl Fn(usize, &RigidBody) -> Matrix6<f64>,
    ) {
        lay_out(vehicle, bodies, &mut self.frames);
        self.mobilities.clear();
        let mobilities = self.frames.iter().enumerate().map(|(number, frame)| mobility(number, frame));
        self.mobilities.extend(mobilities);
    }

    /// Lays out the rows of the joints that are `acting`.
    pub(super) fn lay(&mut self, joints: &[Joint], acting: &[bool]) {
        self.lines.clear();
        for (number, joint) in joints.iter().enumerate().filter(|(number, _)| acting[*number]) {
            self.scratch.clear();
            joint.lines(&self.frames, &mut self.scratch);
            self.lines.extend(self.scratch.iter().map(|line| (number, *line)));
        }
        let answer = |line: &Line| [0, 1].map(|at| self.mobilities[line.ends[at]] * line.jacobian[at]);
        self.answers.clear();
        self.answers.extend(self.lines.iter().map(|(_, line)| answer(line)));
    }

    /// Finds the impulses that change the rate of each row by `wanted`.
    pub(super) fn find(&mut self, wanted: impl Fn(&Line, &[RigidBody]) -> f64) {
        let count = self.lines.len();
        let mut matrix = std::mem::take(&mut self.matrix);
        matrix.clear();
        for row in 0..count {
            matrix.extend((0..count).map(|column| self.coupling(row, column)));
        }
        self.impulses.clear();
        self.impulses.extend(self.lines.iter().map(|(_, line)| wanted(line, &self.frames)));
        // The diagonal of a redundant row is infinite.
        let pivot = |left, diagonal| if left <= REDUNDANT * diagonal { f64::INFINITY } else { left };
        factorise(&mut matrix, count, pivot);
        substitute(&matrix, &mut self.impulses);
        self.matrix = matrix;
    }

    /// Change of the rate of the row `row` by a unit impulse of the row `column`.
    fn coupling(&self, row: usize, column: usize) -> f64 {
        let (line, other, answer) = (&self.lines[row].1, &self.lines[column].1, &self.answers[column]);
        let mut sum = 0.0;
        for (end, jacobian) in line.ends.iter().zip(&line.jacobian) {
            for (other_end, answer) in other.ends.iter().zip(answer) {
                if end == other_end {
                    sum += jacobian.dot(answer);
                }
            }
        }
        sum
    }

    /// Passes the change of each row's ends by its impulse to `change`.
    pub(super) fn push(&self, mut change: impl FnMut(usize, &Vector6<f64>)) {
        for (((_, line), answer), impulse) in self.lines.iter().zip(&self.answers).zip(&self.impulses) {
            for (end, answer) in line.ends.iter().zip(answer) {
                change(*end, &(answer * *impulse));
            }
        }
    }

    /// Of the joints that are `asked`, each of one row, the one that pushes its ends apart hardest, if any does.
    pub(super) fn hardest_push(&self, asked: impl Fn(usize) -> bool) -> Option<usize> {
        let rows = self.lines.iter().zip(self.impulses.iter());
        let pushing = rows.filter(|((joint, _), impulse)| **impulse > 0.0 && asked(*joint));
        pushing.max_by(|(_, one), (_, other)| one.total_cmp(other)).map(|((joint, _), _)| *joint)
    }

    /// Adds the force of each rope, times `weight`, to its place among `pulls`: how hard it pulls its ends together.
    pub(super) fn add_pulls(&self, weight: f64, joints: &[Joint], pulls: &mut [f64]) {
        for ((joint, _), impulse) in self.lines.iter().zip(&self.impulses) {
            if joints[*joint].is_rope() {
                pulls[*joint] -= weight * impulse;
            }
        }
    }

    /// The joint with the fastest pole, and a bound of the rate of this pole, 1/s. The pole is that of
    /// damping and drive against the inertia of the bodies that they move. The bodies count as free, which
    /// they are not where other joints hold them.
    pub(super) fn fastest_pole(&mut self, joints: &[Joint]) -> Option<(usize, f64)> {
        let mut springs = Vec::new();
        for (number, joint) in joints.iter().enumerate() {
            let [stiffness, more] = joint.drive.as_ref().map_or([0.0; 2], Drive::gains);
            self.damped.clear();
            joint.damped(&self.frames, &mut self.damped);
            if let (true, Some(_)) = (self.damped.is_empty(), &joint.drive) {
                self.damped.extend(joint.axial(&self.frames).map(|line| (line, 0.0)));
            }
            let spring =
                |&(line, damping)| Spring { joint: number, line, stiffness, damping: damping + more };
            springs.extend(self.damped.iter().map(spring));
        }
        poles::fastest(&springs, &self.mobilities)
    }

    /// The joint whose rows move apart fastest, and how fast, m/s or rad/s.
    pub(super) fn fastest_row(&self) -> Option<(usize, f64)> {
        let rate = |line: &Line| line.rate(|end| super::body::twist(&self.frames[end])).abs();
        let rows = self.lines.iter().map(|(joint, line)| (*joint, rate(line)));
        rows.max_by(|(_, one), (_, other)| one.total_cmp(other))
    }

    /// Adds the accelerations by the drives of the joints, at this time.
    pub(super) fn drive(&self, joints: &[Joint], when: &Instant, accelerations: &mut [Vector6<f64>]) {
        for joint in joints {
            let Some((drive, line)) = joint.drive.as_ref().zip(joint.axial(&self.frames)) else { continue };
            let rate = line.rate(|end| super::body::twist(&self.frames[end]));
            let force = drive.force(when, line.off, rate);
            for (end, jacobian) in line.ends.iter().zip(&line.jacobian) {
                accelerations[*end] += self.mobilities[*end] * jacobian * force;
            }
        }
    }

    /// Adds the accelerations by the damping of the joints.
    pub(super) fn damp(&mut self, joints: &[Joint], accelerations: &mut [Vector6<f64>]) {
        let Self { frames, mobilities, damped, .. } = self;
        damped.clear();
        joints.iter().for_each(|joint| joint.damped(frames, damped));
        for (line, damping) in damped.iter() {
            let against = -damping * line.rate(|end| super::body::twist(&frames[end]));
            for (end, jacobian) in line.ends.iter().zip(&line.jacobian) {
                accelerations[*end] += mobilities[*end] * jacobian * against;
            }
        }
    }
}
