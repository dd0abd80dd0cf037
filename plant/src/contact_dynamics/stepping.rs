//! One integration step of a vehicle that may touch something.
//!
//! The free flight over the step is computed first, by the integrator of [`crate::NewtonEuler`]. Where nothing is
//! near and no rig holds the vehicle, that is the step. Otherwise the step is cut at each impact, at the instant at
//! which the gap closes: free flight up to it, then Newton's law of restitution (`impact`). Contacts that last are held
//! by impulses (`lasting`), and so are free bodies. Bodies that nothing pushes move as in free flight.

use super::body::twist;
use super::constraints;
use super::free_bodies::Energy;
use super::free_step::Free;
use super::impact;
use super::lasting;
use super::margin;
use super::multibody::Multibody;
use super::record::Record;
use super::scratch::Scratch;
use super::world::World;
use crate::actuation::Actuation;
use crate::backend::Neighbour;
use crate::state::RigidBody;

/// Steps in which gravity makes the speed below which an impact does not bounce: 2 cm/s at two steps of half a
/// millisecond. Tuned, no source.
const SLOW_STEPS: f64 = 4.0;

/// A step is cut at this many impacts at most; those that follow are inelastic. Tuned, no source.
const IMPACTS_MAX: usize = 24;

/// A vehicle that flies, touches things, or hangs in a rig.
pub(super) struct Motion {
    pub system: Multibody,
    pub world: World,
    pub record: Record,
    pub scratch: Scratch,
}

/// The rest of a step that is cut at impacts.
struct Rest {
    /// Time of its begin since the start.
    time_s: f64,
    /// Its length.
    left_s: f64,
    /// An impact that is slower does not bounce.
    slow_m_s: f64,
    /// Number of cuts so far.
    cuts: usize,
    /// True if impulses pushed the vehicle so far.
    is_pushed: bool,
}

impl Motion {
    /// One step of `span_s` from `time_s` after the start; `others` are the other vehicles as they are then.
    pub(super) fn substep(
        &mut self,
        actuation: &Actuation,
        [time_s, span_s]: [f64; 2],
        others: &mut [Neighbour],
    ) {
        let start = if others.is_empty() { self.energy() } else { None };
        self.record.is_vehicle_near_bodies = false;
        let slow_m_s = SLOW_STEPS * self.system.model.vehicle().gravity_m_s2 * span_s;
        let mut rest = Rest { time_s, left_s: span_s, slow_m_s, cuts: 0, is_pushed: false };
        let mut free = self.free(actuation, [time_s, span_s]);
        let uncut = free.state;
        while !self.advance(&mut rest, &free, actuation, others) {
            free = self.free(actuation, [rest.time_s, rest.left_s]);
        }
        if !rest.is_pushed && !self.system.is_held() {
            // Cut for a gap that did not close after all: the flight is free, and its steps are those of free flight.
            self.system.state = uncut;
        }
        if let Some(start) = start {
            self.check_energy(&start);
        }
    }

    /// Energy of the free bodies, if only the vehicle can do work on them.
    fn energy(&self) -> Option<Energy> {
        self.system.free_bodies.energy(self.system.model.vehicle().gravity_m_s2)
    }

    /// Checks the energy of the free bodies after a step from `start`, unless the vehicle may have done work on them.
    fn check_energy(&mut self, start: &Energy) {
        if let Some(end) = self.energy().filter(|_| !self.record.is_vehicle_near_bodies) {
            self.record.doubts.note_step(start, &end);
        }
    }

    /// A step without contacts and stops.
    fn free(&mut self, actuation: &Actuation, when_s: [f64; 2]) -> Free {
        Free::of(&self.system, &mut self.scratch.work, actuation, when_s)
    }

    /// Moves on to the next impact, through it, or to the end of the step. Without impulses the rest ends as `free`.
    /// Returns true at the end of the step.
    fn advance(
        &mut self,
        rest: &mut Rest,
        free: &Free,
        actuation: &Actuation,
        others: &mut [Neighbour],
    ) -> bool {
        let Self { system, world, scratch, .. } = self;
        let is_finite = free.state.body.is_finite() && scratch.work.free.iter().all(RigidBody::is_finite);
        if !is_finite || margin::is_clear(system, world, &free.state.body, rest.left_s, others) {
            // What is no number ends the run when it is published.
            self.fly_freely(rest, free, others);
            return true;
        }
        constraints::find(system, world, scratch, free, rest.left_s, others);
        match self.next_impact_s(rest) {
            None => {
                self.hold_to_end(rest, free, others);
                return true;
            }
            Some(0.0) => self.meet(rest),
            Some(after_s) => self.fly_to_impact(after_s, rest, actuation, others),
        }
        false
    }

    /// Time until the next impact at which the step may be cut.
    fn next_impact_s(&self, rest: &Rest) -> Option<f64> {
        let twists = &self.scratch.twists;
        let both = [&twists.now[..], &twists.then[..]];
        let next_s = self.scratch.touching.next_impact_s(both, rest.left_s, rest.slow_m_s);
        next_s.filter(|_| rest.cuts < IMPACTS_MAX)
    }

    /// Flies the rest without any contact.
    fn fly_freely(&mut self, rest: &Rest, free: &Free, others: &mut [Neighbour]) {
        move_on(others, rest.left_s);
        self.record.note_none(&self.system);
        self.system.free_bodies.states.copy_from_slice(&self.scratch.work.free);
        self.system.state = free.state;
    }

    /// Flies the rest with contacts that last.
    fn hold_to_end(&mut self, rest: &mut Rest, free: &Free, others: &mut [Neighbour]) {
        let Self { system, record, scratch, .. } = self;
        move_on(others, rest.left_s);
        let limits = [rest.left_s, f64::NEG_INFINITY];
        rest.is_pushed |= lasting::constrain(system, record, scratch, free, limits);
    }

    /// Has all meet that touch.
    fn meet(&mut self, rest: &mut Rest) {
        let Self { system, record, scratch, .. } = self;
        let before = twist(&system.state.body);
        let is_found = impact::meet(system, record, scratch, rest.slow_m_s);
        // One that does not come to an end would not the next time either.
        rest.cuts = if is_found { rest.cuts + 1 } else { IMPACTS_MAX };
        rest.is_pushed |= twist(&system.state.body) != before;
    }

    /// Flies up to the impact after `after_s`.
    fn fly_to_impact(
        &mut self,
        after_s: f64,
        rest: &mut Rest,
        actuation: &Actuation,
        others: &mut [Neighbour],
    ) {
        let free = self.free(actuation, [rest.time_s, after_s]);
        let Self { system, record, scratch, .. } = self;
        system.bodies(&free.state.body, &scratch.work.free, others, &mut scratch.twists.then);
        // What is about to be met is not held back before.
        let limits = [after_s, -rest.slow_m_s];
        rest.is_pushed |= lasting::constrain(system, record, scratch, &free, limits);
        move_on(others, after_s);
        (rest.left_s, rest.cuts) = (rest.left_s - after_s, rest.cuts + 1);
        rest.time_s += after_s;
    }
}

/// Has the other vehicles fly on for `span_s`.
fn move_on(others: &mut [Neighbour], span_s: f64) {
    for other in others {
        other.position_W_m += other.velocity_W_m_s * span_s;
    }
}
