//! The impulses of all joints at once: those that take the rates of their rows to what is wanted.
//!
//! With the Jacobian J of all rows and the bodies' mobility W they are the solution of (J W Jᵀ) λ = wanted, whose matrix is
//! symmetric and positive definite. Forces over accelerations, and shifts over distances, are found the same way.
#![allow(
    clippy::disallowed_types,
    reason = "how many rows there are is known at run time; a Cholesky decomposition and its solution go column by column, \
              without a product of matrices whose kernel suits the processor"
)]

use super::body::lay_out;
use super::joints::{Joint, Line};
use crate::state::RigidBody;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, Vector6};

/// What is added to the diagonal of the joints' matrix, over itself: joints that say one thing twice, as a closed chain in
/// a plane does, share its force. Tuned, no source.
const SHARED: f64 = 1e-12;

/// Joints and what they tie, as they are at one instant. Kept from step to step, so that it takes no memory.
pub(super) struct JointForces {
    /// The world, the vehicle and the bodies.
    frames: Vec<RigidBody>,
    mobilities: Vec<Matrix6<f64>>,
    /// The rows, with the number of the joint that each is of.
    lines: Vec<(usize, Line)>,
    damped: Vec<(Line, f64)>,
    /// What the impulse of each row changes the twists of its ends by.
    answers: Vec<[Vector6<f64>; 2]>,
    matrix: DMatrix<f64>,
    impulses: DVector<f64>,
    scratch: Vec<Line>,
}

impl Default for JointForces {
    fn default() -> Self {
        Self {
            frames: Vec::new(),
            mobilities: Vec::new(),
            lines: Vec::new(),
            damped: Vec::new(),
            answers: Vec::new(),
            matrix: DMatrix::zeros(0, 0),
            impulses: DVector::zeros(0),
            scratch: Vec::new(),
        }
    }
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

    /// Finds the impulses that change the rate of each row by what is `wanted`.
    pub(super) fn find(&mut self, wanted: impl Fn(&Line, &[RigidBody]) -> f64) {
        let count = self.lines.len();
        // Taken out, since solving takes it; a matrix of the same size takes no memory.
        let mut matrix = std::mem::replace(&mut self.matrix, DMatrix::zeros(0, 0));
        if matrix.nrows() != count {
            matrix = DMatrix::zeros(count, count);
            self.impulses = DVector::zeros(count);
        }
        for row in 0..count {
            for column in 0..=row {
                let coupling = self.coupling(row, column);
                matrix[(row, column)] = coupling;
                matrix[(column, row)] = coupling;
            }
            matrix[(row, row)] *= 1.0 + SHARED;
            self.impulses[row] = wanted(&self.lines[row].1, &self.frames);
        }
        match Cholesky::new(matrix) {
            Some(factors) => {
                factors.solve_mut(&mut self.impulses);
                self.matrix = factors.unpack_dirty();
            }
            // What is no number, which ends the run when it is published.
            None => self.impulses.fill(0.0),
        }
    }

    /// By how much an impulse of the row `column` changes the rate of the row `row`.
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

    /// Tells of each row's ends by how much its impulse changes them.
    pub(super) fn push(&self, mut change: impl FnMut(usize, &Vector6<f64>)) {
        for (((_, line), answer), impulse) in self.lines.iter().zip(&self.answers).zip(self.impulses.iter()) {
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

    /// Adds what the damping of the joints does to the accelerations.
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
