//! Bodies that push each other, each group of them an island that the direct solve takes alone. The sweeps before it take all
//! islands together.

use super::direct::Direct;
use super::solver::{self, Bilateral, Body, Unilateral};
use nalgebra::{Matrix6, Vector2, Vector6};

/// Impulses whose rates are off by no more than this are found, m/s. Where the sweeps end, they end far below it. Tuned, no
/// source.
pub(super) const FOUND_M_S: f64 = 1e-6;

/// The solution of all impulses of a step, and its buffers.
#[derive(Default)]
pub(super) struct Islands {
    /// For each body the first of its island.
    firsts: Vec<usize>,
    /// Twists without impulses.
    start: Vec<Vector6<f64>>,
    /// The nearest twists and impulses so far.
    nearest: Kept,
    /// Slips that the sweeps left.
    slips_m_s: Vec<f64>,
    direct: Direct,
}

/// Twists of all bodies, and impulses of all constraints.
#[derive(Default)]
struct Kept {
    twists: Vec<Vector6<f64>>,
    impulses_N_s: Vec<(f64, Option<Vector2<f64>>)>,
}

impl Kept {
    fn keep(&mut self, all: &[Body], constraints: &[Unilateral]) {
        self.twists.clear();
        self.twists.extend(all.iter().map(|body| body.twist));
        self.impulses_N_s.clear();
        let impulses_N_s = |it: &Unilateral| (it.impulse_N_s, it.friction.map(|it| it.impulses_N_s));
        self.impulses_N_s.extend(constraints.iter().map(impulses_N_s));
    }

    fn put_back(&self, all: &mut [Body], constraints: &mut [Unilateral]) {
        all.iter_mut().zip(&self.twists).for_each(|(body, twist)| body.twist = *twist);
        for (constraint, (normal_N_s, aside_N_s)) in constraints.iter_mut().zip(&self.impulses_N_s) {
            constraint.impulse_N_s = *normal_N_s;
            if let Some((friction, aside_N_s)) = constraint.friction.as_mut().zip(*aside_N_s) {
                friction.impulses_N_s = aside_N_s;
            }
        }
    }
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
        let off_m_s = off_m_s(all, constraints, joints, |_| true);
        if off_m_s <= FOUND_M_S {
            return off_m_s;
        }
        self.part(mobile, constraints, joints);
        let islands = (0..all.len()).map(|first| self.settle(first, all, mobile, constraints, joints));
        islands.fold(0.0, f64::max)
    }

    /// Finds the islands: a row joins its two ends.
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

    /// Solves the island that begins with the body `first` directly, if it is one and the sweeps left it
    /// unsettled. The nearest result is taken. Returns the greatest error of one of its rates.
    fn settle(
        &mut self,
        first: usize,
        all: &mut [Body],
        mobile: &[Body],
        constraints: &mut [Unilateral],
        joints: &[Bilateral],
    ) -> f64 {
        let Self { firsts, start, nearest, slips_m_s, direct } = self;
        let is_in = |body: usize| firsts[body] == first && moves(&mobile[body]);
        let is_row_in = |bodies: &[usize; 2]| bodies.iter().any(|body| is_in(*body));
        let mut least_m_s = off_m_s(all, constraints, joints, is_row_in);
        if least_m_s <= FOUND_M_S {
            return least_m_s;
        }
        nearest.keep(all, constraints);
        slips_m_s.clear();
        slips_m_s.extend(constraints.iter().map(|it| it.slip_m_s(all)));
        let bodies = all.iter_mut().zip(&*start).enumerate().filter(|(number, _)| is_in(*number));
        bodies.for_each(|(_, (body, start))| body.twist = *start);
        direct.solve(all, mobile, constraints, joints, slips_m_s, is_in);
        for is_found_directly in [true, false] {
            if !is_found_directly {
                // The loads are found, and almost the directions in which the contacts slip: those the sweeps may find.
                solver::sweep(all, constraints, joints);
            }
            let off_m_s = off_m_s(all, constraints, joints, is_row_in);
            let is_finite = all.iter().all(|body| body.twist.iter().all(|it| it.is_finite()));
            if !is_finite || off_m_s >= least_m_s {
                break;
            }
            nearest.keep(all, constraints);
            least_m_s = off_m_s;
            if off_m_s <= FOUND_M_S {
                break;
            }
        }
        nearest.put_back(all, constraints);
        least_m_s
    }
}

/// True if anything can move the body.
fn moves(body: &Body) -> bool {
    body.mobility != Matrix6::zeros()
}

/// Greatest error of the rates of the rows between bodies that are `asked`.
fn off_m_s(
    all: &[Body],
    constraints: &[Unilateral],
    joints: &[Bilateral],
    is_asked: impl Fn(&[usize; 2]) -> bool,
) -> f64 {
    let touching = constraints.iter().filter(|it| is_asked(&it.normal.bodies));
    let tied = joints.iter().filter(|joint| is_asked(&joint.rows[0].bodies));
    let off = touching.map(|constraint| constraint.off_m_s(all));
    off.chain(tied.map(|joint| joint.off_m_s(all))).fold(0.0, f64::max)
}
