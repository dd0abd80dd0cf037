//! The buffers of a step: the bodies and the constraints between them, and the search for their impulses.

use super::free_bodies::{FIRST_BODY, Work};
use super::islands::{FOUND_M_S, Islands};
use super::joints::Line;
use super::solver::{Bilateral, Body, Row, Unilateral};
use super::world::Near;
use crate::backend::TRAFFIC_MAX;
use crate::state::RigidBody;
use nalgebra::Vector3;

/// Greatest gap of a contact: far below anything visible, far above rounding. Tuned, no source.
pub(super) const TOUCH_M: f64 = 1e-6;

/// As many constraints as a vehicle has in a corner among others, and as many again: more take memory.
pub(super) const CONSTRAINTS: usize = 64;

/// The buffers of a step: kept, so that it takes no memory, and forgotten after it.
#[derive(Default)]
pub(super) struct Scratch {
    pub near: Vec<Near>,
    /// The contacts, in the order of `near`; then the stops.
    pub constraints: Vec<Unilateral>,
    /// The joints of free bodies; rows that a joint is made of.
    pub joints: Vec<Bilateral>,
    pub rows: Vec<Row>,
    pub lines: Vec<Line>,
    /// The world, the vehicle, free bodies and other vehicles at the step's start.
    pub now: Vec<Body>,
    /// The same at its end.
    pub then: Vec<Body>,
    /// The same before something was tried.
    pub before: Vec<Body>,
    /// The same, where they are.
    pub frames: Vec<RigidBody>,
    /// Places of ropes among the constraints, and among the joints.
    pub ropes: Vec<[usize; 2]>,
    pub free_bodies: Work,
    pub islands: Islands,
    /// Greatest speed at which two that touch came nearer or slipped, before the impulses that were looked for last.
    pub fastest_m_s: f64,
}

impl Scratch {
    pub(super) fn new() -> Self {
        let bodies = || Vec::with_capacity(FIRST_BODY + TRAFFIC_MAX);
        let (near, constraints) = (Vec::with_capacity(CONSTRAINTS), Vec::with_capacity(CONSTRAINTS));
        Self { near, constraints, now: bodies(), then: bodies(), before: bodies(), ..Self::default() }
    }

    /// True if another vehicle is near.
    pub(super) fn is_among_others(&self) -> bool {
        self.near.iter().any(|near| near.neighbour.is_some())
    }

    /// Finds the impulses and gives them to the bodies at the step's end. If another vehicle would drive this
    /// one into a still object, no impulses satisfy both: the other is left out, and flies into it. Returns the
    /// greatest error of a rate.
    pub(super) fn solve(&mut self) -> f64 {
        let asked = self.constraints.iter().filter(|it| it.bound_m_s > f64::NEG_INFINITY);
        let speeds_m_s = asked.map(|it| it.slip_m_s(&self.then).max(-it.normal.rate(&self.then)));
        self.fastest_m_s = speeds_m_s.fold(0.0, f64::max);
        let is_among_others = self.is_among_others();
        if is_among_others {
            self.before.clone_from(&self.then);
        }
        let off_m_s = self.find_impulses();
        if off_m_s <= FOUND_M_S || !is_among_others {
            return off_m_s;
        }
        self.forget();
        for (near, constraint) in self.near.iter().zip(&mut self.constraints) {
            if near.neighbour.is_some() {
                constraint.bound_m_s = f64::NEG_INFINITY;
            }
        }
        self.then.clone_from(&self.before);
        self.find_impulses()
    }

    /// Finds the impulses for the bodies at the step's end; returns by how much a rate is off at most.
    pub(super) fn find_impulses(&mut self) -> f64 {
        self.islands.solve(&mut self.then, &self.now, &mut self.constraints, &self.joints)
    }

    /// Hands the ropes' impulses over the free step to their stops, which may pull less where contacts carry:
    /// so that the ends part no faster than they did. Where nothing else pushes, that leaves all as it is.
    pub(super) fn let_ropes_yield(&mut self) {
        for [constraint, joint] in &self.ropes {
            let pull_N_s = self.free_bodies.pulls_N_s[*joint];
            if pull_N_s > 0.0 {
                let stop = &mut self.constraints[*constraint];
                stop.bound_m_s = stop.normal.rate(&self.then);
                stop.normal.push(&mut self.then, -pull_N_s);
                stop.impulse_N_s = pull_N_s;
            }
        }
    }

    /// Energy that bounds ask for, J: the work of impulses whose rates are to be above zero.
    pub(super) fn lent_J(&self) -> f64 {
        self.constraints.iter().map(|it| it.impulse_N_s * it.bound_m_s.max(0.0)).sum()
    }

    /// Takes all impulses away.
    pub(super) fn forget(&mut self) {
        for constraint in &mut self.constraints {
            constraint.impulse_N_s = 0.0;
            if let Some(friction) = &mut constraint.friction {
                friction.warm_start(&Vector3::zeros());
            }
        }
    }

    /// Time until the first gap closes, if any does in the free step of `span_s`, at more than `slow_m_s`; 0
    /// where two that touch meet now.
    pub(super) fn next_impact_s(&self, span_s: f64, slow_m_s: f64) -> Option<f64> {
        let after_s = |constraint: &Unilateral| {
            let rate_m_s = constraint.normal.rate(&self.now);
            if rate_m_s >= -slow_m_s {
                return None;
            }
            let mean_m_s = (rate_m_s + constraint.normal.rate(&self.then)) / 2.0;
            let gap_m = constraint.gap_m;
            let closes_s = if gap_m <= TOUCH_M { 0.0 } else { (gap_m - TOUCH_M / 2.0) / -mean_m_s };
            (0.0..span_s).contains(&closes_s).then_some(closes_s)
        };
        self.constraints.iter().filter_map(after_s).min_by(f64::total_cmp)
    }
}
