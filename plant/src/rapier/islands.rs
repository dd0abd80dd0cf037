//! Bodies that push each other: what happens in one island changes no bit of another.

use super::direct::Direct;
use super::solver::{self, Bilateral, Body, Unilateral};
use nalgebra::{Matrix6, Vector6};

/// Impulses whose rates are off by no more than this are found, m/s: the sweeps end far below it where they end. Tuned, no
/// source.
const FOUND_M_S: f64 = 1e-6;

/// The solution of all impulses of a step, and its buffers.
#[derive(Default)]
pub(super) struct Islands {
    /// For each body the first of its island.
    firsts: Vec<usize>,
    /// Twists without impulses, and those that the sweeps found.
    start: Vec<Vector6<f64>>,
    swept: Vec<Vector6<f64>>,
    direct: Direct,
}

impl Islands {
    /// Finds the impulses that `constraints` and `joints` need, from those that the former hold already, and gives them to
    /// the bodies: by sweeps, and directly for the islands that these do not settle. `mobile` are the bodies as the rows see
    /// them. Returns by how much a rate is off at most.
    pub(super) fn solve(
        &mut self,
        all: &mut [Body],
        mobile: &[Body],
        constraints: &mut [Unilateral],
        joints: &[Bilateral],
    ) -> f64 {
        self.start.clear();
        self.start.extend(all.iter().map(|body| body.twist));
        solver::solve(all, constraints, joints);
        if residual_m_s(all, constraints, joints, |_| true) <= FOUND_M_S {
            return residual_m_s(all, constraints, joints, |_| true);
        }
        self.part(mobile, constraints, joints);
        let mut most_m_s = 0.0_f64;
        for first in 0..all.len() {
            let Self { firsts, start, swept, direct } = self;
            let is_in = |bodies: &[usize; 2]| bodies.iter().any(|body| firsts[*body] == first && moves(&mobile[*body]));
            let mut off_m_s = residual_m_s(all, constraints, joints, is_in);
            if off_m_s > FOUND_M_S {
                swept.clear();
                swept.extend(all.iter().map(|body| body.twist));
                for (number, body) in all.iter_mut().enumerate().filter(|(number, _)| firsts[*number] == first) {
                    body.twist = start[number];
                }
                let is_asked = |it: &Unilateral| it.bound_m_s > f64::NEG_INFINITY && is_in(&it.normal.bodies);
                if direct.solve(all, mobile, constraints, is_asked, joints) {
                    off_m_s = residual_m_s(all, constraints, joints, is_in);
                    if std::env::var("TRACE").is_ok() { eprintln!("after direct: {off_m_s:e}"); }
                } else {
                    all.iter_mut().zip(swept).for_each(|(body, swept)| body.twist = *swept);
                }
            }
            most_m_s = most_m_s.max(off_m_s);
        }
        most_m_s
    }

    /// Finds the islands, by union of the ends of all rows.
    fn part(&mut self, mobile: &[Body], constraints: &[Unilateral], joints: &[Bilateral]) {
        let firsts = &mut self.firsts;
        firsts.clear();
        firsts.extend(0..mobile.len());
        let asked = constraints.iter().filter(|constraint| constraint.bound_m_s > f64::NEG_INFINITY);
        let pairs = asked.map(|constraint| constraint.normal.bodies);
        for [one, other] in pairs.chain(joints.iter().map(|joint| joint.rows[0].bodies)) {
            let (one_first, other_first) = (firsts[one], firsts[other]);
            if one_first != other_first && moves(&mobile[one]) && moves(&mobile[other]) {
                let (first, later) = (one_first.min(other_first), one_first.max(other_first));
                firsts.iter_mut().filter(|it| **it == later).for_each(|it| *it = first);
            }
        }
    }
}

/// Whether anything moves the body.
fn moves(body: &Body) -> bool {
    body.mobility != Matrix6::zeros()
}

/// By how much a rate of the rows between bodies that are `asked` is off at most.
fn residual_m_s(
    all: &[Body],
    constraints: &[Unilateral],
    joints: &[Bilateral],
    is_asked: impl Fn(&[usize; 2]) -> bool,
) -> f64 {
    let touching = constraints.iter().filter(|it| is_asked(&it.normal.bodies));
    let tied = joints.iter().filter(|joint| is_asked(&joint.rows[0].bodies));
    let off = touching.map(|constraint| constraint.residual_m_s(all));
    off.chain(tied.map(|joint| joint.residual_m_s(all))).fold(0.0, f64::max)
}
