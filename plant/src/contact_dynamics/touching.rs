//! Contacts and stops of a step: the points that are near, and a constraint for each point and each stop.
//!
//! The search for the impulses of these constraints is in `scratch`.

use super::corners;
use super::free_bodies::{FIRST_BODY, VEHICLE};
use super::solver::{Body, Unilateral};
use super::world::Near;
use nalgebra::Vector3;

/// Greatest gap of a contact: far below anything visible, far above rounding. Tuned, no source.
pub(super) const TOUCH_M: f64 = 1e-6;

/// As many constraints as a vehicle has in a corner among others, and as many again.
const CONSTRAINTS: usize = 64;

/// Contacts that parry finds between two solids at most: the corners of two faces of four corners, or where their edges cross,
/// and the nearest point.
const PARRY_CONTACTS: usize = 9;

/// Constraints for each free body, as many as two large faces have.
const BODY_CONSTRAINTS: usize = PARRY_CONTACTS + corners::LARGEST;

/// Number of constraints that the buffers hold among so many free bodies. The excess takes memory in flight, and its search
/// begins with no impulses. A stack on the ground has less, whatever the faces of its bodies.
pub(super) const fn room(bodies: usize) -> usize {
    CONSTRAINTS + BODY_CONSTRAINTS * bodies
}

/// Buffers of the contacts and stops.
#[derive(Default)]
pub(super) struct Touching {
    pub near: Vec<Near>,
    /// The contacts, in the order of `near`; then the stops.
    pub constraints: Vec<Unilateral>,
    /// Places of ropes among the constraints, and among the joints.
    pub ropes: Vec<[usize; 2]>,
}

impl Touching {
    /// Empty buffers, for a vehicle among so many free bodies.
    pub(super) fn new(bodies: usize) -> Self {
        let (near, constraints) = (Vec::with_capacity(room(bodies)), Vec::with_capacity(room(bodies)));
        Self { near, constraints, ropes: Vec::new() }
    }

    /// True if another vehicle is near.
    pub(super) fn is_among_others(&self) -> bool {
        self.near.iter().any(|near| near.neighbour.is_some())
    }

    /// True if a constraint is between the vehicle and a free body, or another vehicle.
    pub(super) fn is_vehicle_near_bodies(&self) -> bool {
        let mut pairs = self.constraints.iter().map(|it| it.normal.bodies);
        pairs.any(|pair| pair.contains(&VEHICLE) && pair.iter().any(|body| *body >= FIRST_BODY))
    }

    /// True if a constraint pushes any body.
    pub(super) fn pushes(&self) -> bool {
        self.constraints.iter().any(|it| it.impulse_N_s > 0.0)
    }

    /// True if a constraint pushes the body with this number.
    pub(super) fn pushes_body(&self, body: usize) -> bool {
        self.constraints.iter().any(|it| it.impulse_N_s > 0.0 && it.normal.is_on(body))
    }

    /// True if two that a constraint keeps apart overlap.
    pub(super) fn is_inside(&self) -> bool {
        self.constraints.iter().any(|it| it.bound_m_s.is_finite() && it.gap_m < -TOUCH_M)
    }

    /// Greatest speed at which two that touch come nearer or slip, where the bodies move as in `all`.
    pub(super) fn fastest_m_s(&self, all: &[Body]) -> f64 {
        let asked = self.constraints.iter().filter(|it| it.bound_m_s > f64::NEG_INFINITY);
        let speeds_m_s = asked.map(|it| it.slip_m_s(all).max(-it.normal.rate(all)));
        speeds_m_s.fold(0.0, f64::max)
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

    /// Leaves the contacts with other vehicles out of the search.
    pub(super) fn leave_out_others(&mut self) {
        for (near, constraint) in self.near.iter().zip(&mut self.constraints) {
            if near.neighbour.is_some() {
                constraint.bound_m_s = f64::NEG_INFINITY;
            }
        }
    }

    /// Hands the ropes' impulses over the free step to their stops. The stops may pull less where contacts carry, so
    /// that the ends part no faster than they did. Where nothing else pushes, that leaves all as it is.
    pub(super) fn let_ropes_yield(&mut self, pulls_N_s: &[f64], then: &mut [Body]) {
        for [constraint, joint] in &self.ropes {
            let pull_N_s = pulls_N_s[*joint];
            if pull_N_s > 0.0 {
                let stop = &mut self.constraints[*constraint];
                stop.bound_m_s = stop.normal.rate(then);
                stop.normal.push(then, -pull_N_s);
                stop.impulse_N_s = pull_N_s;
            }
        }
    }

    /// Time until the first gap closes, if any does at more than `slow_m_s`; 0 where two that touch meet now. The
    /// bodies move as `now` and, at the end of the free step of `span_s`, as `then`.
    pub(super) fn next_impact_s(&self, [now, then]: [&[Body]; 2], span_s: f64, slow_m_s: f64) -> Option<f64> {
        let after_s = |constraint: &Unilateral| {
            let rate_m_s = constraint.normal.rate(now);
            if rate_m_s >= -slow_m_s {
                return None;
            }
            let mean_m_s = (rate_m_s + constraint.normal.rate(then)) / 2.0;
            let gap_m = constraint.gap_m;
            let closes_s = if gap_m <= TOUCH_M { 0.0 } else { (gap_m - TOUCH_M / 2.0) / -mean_m_s };
            (0.0..span_s).contains(&closes_s).then_some(closes_s)
        };
        self.constraints.iter().filter_map(after_s).min_by(f64::total_cmp)
    }
}
