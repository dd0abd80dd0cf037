//! One integration step of a vehicle that may touch something.
//!
//! The free flight over the step is computed first, by the integrator of [`crate::NewtonEuler`]. Where nothing is
//! near and no rig holds the vehicle, that is the step. Otherwise the step is cut at each impact, at the instant at
//! which the gap closes: free flight up to it, then Newton's law of restitution. Contacts that last are held by the
//! impulses of `solver`: they change the free step's velocities, and, as a constant force would, half of that
//! change times the step is added to its pose. Free bodies are moved and held the same way. Bodies that nothing
//! pushes move as in free flight.

use super::body::{lay_out, mobility, set_twist, shift, twist};
use super::contacts::{Contacts, Sighting};
use super::drive::Instant;
use super::free_bodies::{Carrier, FIRST_BODY, FreeBodies, VEHICLE, Work};
use super::islands::FOUND_M_S;
use super::rig::{self, Mounted};
use super::rolling;
use super::scratch::{CONSTRAINTS, Scratch, TOUCH_M};
use super::solver::{Bilateral, Body, Friction, Row, Unilateral, join, part};
use super::unsolved::{Outcome, Unsolved};
use super::world::{Near, World};
use crate::actuation::Actuation;
use crate::backend::Neighbour;
use crate::newton_euler::NewtonEuler;
use crate::saved::{Bounded, saved_fields};
use crate::state::{RigidBody, State};
use nalgebra::{Matrix6, Vector3, Vector6};
use scenes::Rig;

/// Gaps that are not closed any further: a body that stands on several points stands on all of them. Tuned, no
/// source.
const LEVEL_M: f64 = 1e-9;

/// Steps in which gravity makes the speed below which an impact does not bounce: 2 cm/s at two steps of half a
/// millisecond. Tuned, no source.
const SLOW_STEPS: f64 = 4.0;

/// A step is cut at this many impacts at most; those that follow are inelastic. Tuned, no source.
const IMPACTS_MAX: usize = 24;

/// Distance within which contacts are searched, beyond the way of a step: a contact lasts until there is a millimetre
/// of air. Tuned, no source.
const MARGIN_M: f64 = 2e-3;

/// Greatest distance within which contacts are searched, however fast the vehicle is: a vehicle that moves this
/// far in a step flies through things. Tuned, no source.
const MARGIN_MAX_M: f64 = 2.0;

/// Speed at which a vehicle that was put inside an object comes out of it; it takes none of that speed along.
/// Tuned, no source.
const PUSH_OUT_M_S: f64 = 1.0;

/// Impulses of contacts that are kept for each free body; the search for more begins with none. Tuned, no source: the most
/// that a scene of this repository has is 11, among six bodies and the vehicle.
const BODY_CONTACTS: usize = 16;

/// Stops of a rig at most: two along each axis, and that of its tilt.
const RIG_STOPS: usize = 7;
/// Stops of a joint at most: its two ends.
const JOINT_STOPS: usize = 2;

/// Errors of a pose that are left as they are.
const EXACT_M: f64 = 1e-12;

/// The impulses of the last step, with which the next one warm starts its search.
#[derive(Debug, Clone)]
pub(super) struct Held {
    contacts: Bounded<HeldContact>,
    stops_N_s: Bounded<f64>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct HeldContact {
    object: u32,
    /// The number of the body that touches it.
    body: u32,
    part: u32,
    impulse_N_s: f64,
    slip_W_N_s: Vector3<f64>,
}

saved_fields!(HeldContact { object, body, part, impulse_N_s, slip_W_N_s });
saved_fields!(Held { contacts, stops_N_s });

impl Held {
    /// No impulses so far, of a vehicle among `bodies` free bodies and `joints`.
    pub(super) fn new(bodies: usize, joints: usize) -> Self {
        let contacts = CONSTRAINTS + BODY_CONTACTS * bodies;
        let stops = RIG_STOPS + JOINT_STOPS * joints;
        Self { contacts: Bounded::new(contacts), stops_N_s: Bounded::new(stops) }
    }

    pub(super) fn clear(&mut self) {
        self.contacts.clear();
        self.stops_N_s.clear();
    }
}

/// The end of a step without contacts and stops.
struct Free {
    state: State,
    /// Change of the vehicle's twist by the bearing or joints.
    held: Vector6<f64>,
}

/// A vehicle that flies, touches things, or hangs in a rig.
pub(super) struct Motion {
    pub model: NewtonEuler,
    pub rig: Option<Rig>,
    pub world: World,
    pub free_bodies: FreeBodies,
    pub contacts: Contacts,
    pub state: State,
    /// Time of that since the start.
    pub time_s: f64,
    /// An impact that is faster is a crash.
    pub crash_speed_m_s: f64,
    /// Radius of the vehicle's disc.
    pub disc_radius_m: f64,
    /// The least moment of inertia about any axis.
    pub inertia_min_kg_m2: f64,
    pub held: Held,
    /// The first impulses that were not found.
    pub unsolved: Option<Unsolved>,
    pub changed: Changed,
    pub scratch: Scratch,
}

/// Changes of the velocities by contacts and joints since the tick began.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Changed {
    pub velocity_W_m_s: Vector3<f64>,
    pub spin_W_rad_s: Vector3<f64>,
}

impl Motion {
    /// One step of `span_s` from `time_s` after the start; `others` are the other vehicles as they are then.
    pub(super) fn substep(
        &mut self,
        actuation: &Actuation,
        [time_s, span_s]: [f64; 2],
        others: &mut [Neighbour],
    ) {
        let mut scratch = std::mem::take(&mut self.scratch);
        self.time_s = time_s;
        self.cut_at_impacts(&mut scratch, actuation, span_s, others);
        self.scratch = scratch;
    }

    fn cut_at_impacts(
        &mut self,
        scratch: &mut Scratch,
        actuation: &Actuation,
        span_s: f64,
        others: &mut [Neighbour],
    ) {
        let slow_m_s = SLOW_STEPS * self.model.vehicle().gravity_m_s2 * span_s;
        let mut free = self.free(&mut scratch.free_bodies, actuation, span_s);
        let uncut = free.state;
        let (mut left_s, mut cuts, mut is_pushed) = (span_s, 0, false);
        loop {
            let is_finite =
                free.state.body.is_finite() && scratch.free_bodies.free.iter().all(RigidBody::is_finite);
            if !is_finite || self.is_clear(&free.state.body, left_s, others) {
                // What is no number ends the run when it is published.
                move_on(others, left_s);
                self.fly_freely(free.state, &scratch.free_bodies.free);
                break;
            }
            self.look_around(scratch, &free, left_s, others);
            match scratch.next_impact_s(left_s, slow_m_s).filter(|_| cuts < IMPACTS_MAX) {
                None => {
                    move_on(others, left_s);
                    is_pushed |= self.constrain(scratch, &free, left_s, f64::NEG_INFINITY);
                    break;
                }
                Some(0.0) => {
                    let before = twist(&self.state.body);
                    // One that does not come to an end would not the next time either.
                    cuts = if self.impact(scratch, slow_m_s) { cuts + 1 } else { IMPACTS_MAX };
                    is_pushed |= twist(&self.state.body) != before;
                }
                Some(after_s) => {
                    let free = self.free(&mut scratch.free_bodies, actuation, after_s);
                    self.bodies(&free.state.body, &scratch.free_bodies.free, others, &mut scratch.then);
                    // What is about to be met is not held back before.
                    is_pushed |= self.constrain(scratch, &free, after_s, -slow_m_s);
                    move_on(others, after_s);
                    (left_s, cuts) = (left_s - after_s, cuts + 1);
                    self.time_s += after_s;
                }
            }
            free = self.free(&mut scratch.free_bodies, actuation, left_s);
        }
        if !is_pushed && !self.is_held() {
            // Cut for a gap that did not close after all: the flight is free, and its steps are those of free flight.
            self.state = uncut;
        }
    }

    /// A step with nothing but the bearing and the joints; free bodies end in `work`.
    fn free(&self, work: &mut Work, actuation: &Actuation, span_s: f64) -> Free {
        let unheld = self.model.runge_kutta(&self.state, actuation, span_s);
        let mut state = unheld;
        if !self.free_bodies.is_empty() {
            let (model, rig) = (&self.model, self.rig.as_ref());
            let when = Instant { time_s: self.time_s, middle_s: self.time_s + span_s / 2.0 };
            let carrier = Carrier { model, rig, actuation, when };
            state = self.free_bodies.free_step(&carrier, &self.state, span_s, work);
        } else if let Some(rig) = &self.rig {
            let hold = |state: &State, rates| rig::hold(rig, &self.model, state, rates);
            state = self.model.runge_kutta_held(&self.state, actuation, span_s, hold);
        }
        if !self.is_held() {
            return Free { state: unheld, held: Vector6::zeros() };
        }
        if let Some(mounted) = self.mounted(&state.body) {
            let twist = twist(&state.body);
            set_twist(&mut state.body, &(twist + mounted.back(&mounted.mount_W_m_s(&twist))));
        }
        self.project(&mut state.body);
        Free { held: twist(&state.body) - twist(&unheld.body), state }
    }

    /// True if a rig or joints hold the vehicle.
    pub(super) fn is_held(&self) -> bool {
        self.rig.is_some() || self.free_bodies.is_vehicle_tied()
    }

    /// The vehicle in its rig, if it has one.
    fn mounted(&self, body: &RigidBody) -> Option<Mounted<'_>> {
        let rig = self.rig.as_ref()?;
        Some(Mounted::new(rig, body, self.mobility(body)))
    }

    /// The mobility in free flight.
    fn mobility(&self, body: &RigidBody) -> Matrix6<f64> {
        mobility(body, self.model.vehicle().mass_kg, self.model.inverse_inertia())
    }

    /// Moves the mount back onto its line, from where the order of the step left it.
    fn project(&self, body: &mut RigidBody) {
        let Some((rig, mounted)) = self.rig.as_ref().zip(self.mounted(body)) else { return };
        let off_W_m = rig::off_W_m(rig, body);
        shift(body, &mounted.back(&off_W_m));
    }

    fn fly_freely(&mut self, free: State, bodies: &[RigidBody]) {
        self.contacts.note(&self.state.body, std::iter::empty(), self.crash_speed_m_s);
        self.held.clear();
        self.free_bodies.states.copy_from_slice(bodies);
        self.state = free;
    }

    /// True if nothing holds the vehicle, no body moves, and nothing is near on the way to `free`.
    fn is_clear(&self, free: &RigidBody, span_s: f64, others: &[Neighbour]) -> bool {
        let margin_m = MARGIN_M + self.way_m(free, span_s);
        let is_alone = self.rig.is_none() && self.free_bodies.is_empty();
        is_alone && self.world.is_clear(&self.state.body.position_W_m, others, span_s, margin_m)
    }

    /// Returns the longest way of any point of the vehicle over a step, with half of it to spare.
    fn way_m(&self, free: &RigidBody, span_s: f64) -> f64 {
        let reach_m = self.world.reach_m();
        1.5 * span_s * fastest_m_s(&self.state.body, reach_m).max(fastest_m_s(free, reach_m))
    }

    /// The same of the free bodies.
    fn bodies_way_m(&self, free: &[RigidBody], span_s: f64) -> f64 {
        let reaches_m = self.world.body_reaches_m();
        let both = self.free_bodies.states.iter().zip(free).zip(reaches_m);
        let fastest = |((now, then), reach_m): ((&RigidBody, &RigidBody), f64)| {
            fastest_m_s(now, reach_m).max(fastest_m_s(then, reach_m))
        };
        1.5 * span_s * both.map(fastest).fold(0.0, f64::max)
    }

    /// Finds the contacts that are near, and makes a constraint of each point and each stop.
    fn look_around(&mut self, scratch: &mut Scratch, free: &Free, span_s: f64, others: &[Neighbour]) {
        let Scratch { near, constraints, now, then, frames, ropes, free_bodies, .. } = scratch;
        let ends = &free_bodies.free;
        let fastest_other_m_s = others.iter().map(|other| other.velocity_W_m_s.norm()).fold(0.0, f64::max);
        let way_m = self.way_m(&free.state.body, span_s) + span_s * fastest_other_m_s;
        // Two that fly at each other.
        let bodies_m = self.bodies_way_m(ends, span_s);
        let way_m = (way_m + bodies_m).max(2.0 * bodies_m);
        let margin_m = (MARGIN_M + way_m).min(MARGIN_MAX_M);
        let states = &self.free_bodies.states;
        self.world.find_near(&self.state.body, others, margin_m, near);
        self.world.find_near_bodies(&self.state.body, states, margin_m, near);
        self.bodies(&self.state.body, states, others, now);
        self.bodies(&free.state.body, ends, others, then);
        constraints.clear();
        constraints.extend(near.iter().map(|near| self.contact(now, near)));
        if let Some(mounted) = self.mounted(&self.state.body) {
            mounted.stops(now, VEHICLE, &self.state.body, constraints);
        }
        if !self.free_bodies.joints.is_empty() {
            lay_out(&self.state.body, states, frames);
            ropes.clear();
            for (number, joint) in self.free_bodies.joints.iter().enumerate() {
                let first = constraints.len();
                joint.stops(now, frames, constraints);
                if joint.is_rope() && constraints.len() > first {
                    ropes.push([first, number]);
                }
            }
        }
    }

    /// The world, the vehicle, free bodies and the others, as impulses see them.
    fn bodies(&self, vehicle: &RigidBody, free: &[RigidBody], others: &[Neighbour], bodies: &mut Vec<Body>) {
        let mounted = self.mounted(vehicle);
        let mobility = mounted.map_or_else(|| self.mobility(vehicle), |mounted| mounted.mobility());
        let others = others.iter().map(|other| Body {
            // Others do not turn, and nothing moves them.
            twist: join(&other.velocity_W_m_s, &Vector3::zeros()),
            ..Body::default()
        });
        bodies.clear();
        bodies.extend([Body::default(), Body { twist: twist(vehicle), mobility }]);
        bodies.extend(self.free_bodies.as_bodies(free).chain(others));
    }

    /// The joints of free bodies, for impulses on `bodies`, which are `vehicle` and `free`.
    fn tie(&self, scratch: &mut Scratch, vehicle: &RigidBody, is_end: bool) {
        let Scratch { joints, rows, lines, now, then, frames, free_bodies, .. } = scratch;
        joints.clear();
        if self.free_bodies.joints.is_empty() {
            return;
        }
        let (bodies, states) =
            if is_end { (then, &free_bodies.free) } else { (now, &self.free_bodies.states) };
        lay_out(vehicle, states, frames);
        for joint in self.free_bodies.joints.iter().filter(|joint| !joint.is_rope()) {
            lines.clear();
            joint.lines(frames, lines);
            rows.clear();
            rows.extend(lines.iter().map(|line| Row::new(bodies, line.ends, line.jacobian)));
            joints.extend(Bilateral::new(rows));
        }
    }

    fn contact(&self, bodies: &[Body], near: &Near) -> Unilateral {
        let arm_W_m = |body: usize| match body {
            VEHICLE => near.point_W_m - self.state.body.position_W_m,
            _ => match self.free_bodies.states.get(body.wrapping_sub(FIRST_BODY)) {
                Some(state) => near.point_W_m - state.position_W_m,
                // The world stands still, and other vehicles do not turn.
                None => Vector3::zeros(),
            },
        };
        let (pair, arms_W_m) = (near.bodies, near.bodies.map(arm_W_m));
        let normal_W = near.normal_W;
        let normal = Row::at(bodies, pair, arms_W_m, &normal_W);
        Unilateral {
            friction: Some(Friction::new(bodies, pair, arms_W_m, (&normal, &normal_W), near.friction)),
            normal,
            gap_m: near.gap_m,
            restitution: near.restitution,
            bound_m_s: f64::NEG_INFINITY,
            impulse_N_s: 0.0,
        }
    }

    /// A step of `span_s` that ends as `free`, but for the impulses of the constraints. A contact that comes
    /// nearer at a rate below `ahead_m_s` and does not touch yet is not a constraint. Returns whether the
    /// vehicle was pushed.
    fn constrain(&mut self, scratch: &mut Scratch, free: &Free, span_s: f64, ahead_m_s: f64) -> bool {
        for constraint in &mut scratch.constraints {
            let rate_m_s = constraint.normal.rate(&scratch.now);
            constraint.bound_m_s = match constraint.gap_m > TOUCH_M {
                true if rate_m_s < ahead_m_s => f64::NEG_INFINITY,
                // Over the step the gap changes by the mean of the rates at its ends.
                true => (-2.0 * constraint.gap_m / span_s - rate_m_s).min(0.0),
                false if constraint.gap_m > LEVEL_M => -constraint.gap_m / span_s,
                // The same for all that touch: four feet cannot come down by four different ways.
                false => 0.0,
            };
        }
        self.warm_start(scratch);
        if let Some(mounted) = self.mounted(&free.state.body) {
            let friction = mounted.friction(&twist(&self.state.body), self.inertia_min_kg_m2, span_s);
            let vehicle = &mut scratch.then[VEHICLE];
            vehicle.twist += vehicle.mobility * friction;
        }
        rolling::resist(&scratch.near, &scratch.constraints, &mut scratch.then, self.disc_radius_m);
        self.tie(scratch, &free.state.body, true);
        scratch.let_ropes_yield();
        let start_J = self.energy_J(&scratch.then, &scratch.then);
        let off_m_s = scratch.solve();
        self.judge(scratch, off_m_s, start_J);
        self.note(scratch);
        self.hold(scratch, off_m_s <= FOUND_M_S);
        let pushes = |it: &Unilateral| it.impulse_N_s > 0.0 && it.normal.is_on(VEHICLE);
        let is_pushed = scratch.constraints.iter().any(pushes);
        let is_anything_pushed = scratch.constraints.iter().any(|it| it.impulse_N_s > 0.0);
        if !is_anything_pushed && !self.is_held() {
            self.state = free.state;
            self.free_bodies.states.clone_from(&scratch.free_bodies.free);
            // What bounces at every step, as a disc that whirls, sinks otherwise.
            let is_inside = |it: &Unilateral| it.bound_m_s.is_finite() && it.gap_m < -TOUCH_M;
            if scratch.constraints.iter().any(is_inside) {
                self.push_out(scratch, span_s);
            }
            return false;
        }
        if is_pushed || self.is_held() {
            self.take_over(free, &scratch.then[VEHICLE].twist, span_s);
        } else {
            self.state = free.state;
        }
        self.take_over_bodies(scratch, span_s);
        self.push_out(scratch, span_s);
        let mut body = self.state.body;
        self.project(&mut body);
        let before = twist(&body);
        self.free_bodies.project_rigid(&self.model, &mut body, &mut scratch.free_bodies);
        let [velocity_W_m_s, spin_W_rad_s] = part(&(twist(&body) - before));
        self.changed.velocity_W_m_s += velocity_W_m_s;
        self.changed.spin_W_rad_s += spin_W_rad_s;
        self.state.body = body;
        is_pushed
    }

    /// The impact of all contacts that touch, by Newton's law: the restitution's part of the rate of approach
    /// is left, as far as that makes no energy (Moreau). Returns whether its impulses were found.
    fn impact(&mut self, scratch: &mut Scratch, slow_m_s: f64) -> bool {
        for constraint in &mut scratch.constraints {
            let rate_m_s = constraint.normal.rate(&scratch.now);
            constraint.bound_m_s = match constraint.gap_m <= TOUCH_M {
                false => f64::NEG_INFINITY,
                true if rate_m_s.abs() > slow_m_s => -constraint.restitution * rate_m_s,
                true => 0.0,
            };
        }
        scratch.then.clone_from(&scratch.now);
        let vehicle = self.state.body;
        self.tie(scratch, &vehicle, false);
        let start_J = self.energy_J(&scratch.now, &scratch.now);
        let off_m_s = scratch.solve();
        self.note(scratch);
        let off_m_s = self.lose_gain(scratch, off_m_s, start_J);
        self.judge(scratch, off_m_s, start_J);
        let after = scratch.then[VEHICLE].twist;
        scratch.free_bodies.free.clone_from(&self.free_bodies.states);
        if after != scratch.now[VEHICLE].twist {
            self.take_over(&Free { state: self.state, held: Vector6::zeros() }, &after, 0.0);
        }
        self.take_over_bodies(scratch, 0.0);
        off_m_s <= FOUND_M_S
    }

    /// Notes impulses that do not satisfy the laws. Others that push do work.
    fn judge(&mut self, scratch: &Scratch, off_m_s: f64, start_J: f64) {
        let end_J = self.energy_J(&scratch.then, &scratch.then);
        let gain_J = if scratch.is_among_others() { 0.0 } else { end_J - start_J - scratch.lent_J() };
        let outcome = Outcome { off_m_s, fastest_m_s: scratch.fastest_m_s, start_J, gain_J };
        let unsolved = || Unsolved::of(&outcome, scratch, &self.free_bodies.objects);
        self.unsolved = self.unsolved.or_else(unsolved);
    }

    /// Leaves the twists after an impact between those of an inelastic one, which never makes energy, and those found:
    /// Newton's law makes some where friction and an arm couple (Kane and Levinson, Dynamics, 1985). Others that push do
    /// work on the vehicle, and are left out of this. Where no impulses make the bodies leave as asked, the impact is
    /// inelastic. Returns by how much a rate is off at most.
    fn lose_gain(&self, scratch: &mut Scratch, off_m_s: f64, start_J: f64) -> f64 {
        let is_met = off_m_s <= Outcome::may_be_off_m_s(scratch.fastest_m_s);
        let makes_none = self.energy_J(&scratch.then, &scratch.then) <= start_J;
        if scratch.is_among_others() || (is_met && makes_none) {
            return off_m_s;
        }
        for constraint in &mut scratch.constraints {
            constraint.bound_m_s = constraint.bound_m_s.min(0.0);
        }
        scratch.forget();
        scratch.before.clone_from(&scratch.then);
        scratch.then.clone_from(&scratch.now);
        let dull_off_m_s = scratch.find_impulses();
        if !is_met {
            return dull_off_m_s;
        }
        let (more, dull) = (&mut scratch.before, &mut scratch.then);
        for (more, dull) in more.iter_mut().zip(&*dull) {
            more.twist -= dull.twist;
        }
        // The largest part s of the way to what was found at which the energy is that of before: a s^2 + 2 b s + c = 0.
        let (a, b) = (self.energy_J(more, more), self.energy_J(dull, more));
        let c = self.energy_J(dull, dull) - start_J;
        let part = if a > 0.0 { (((b * b - a * c).max(0.0).sqrt() - b) / a).clamp(0.0, 1.0) } else { 0.0 };
        for (dull, more) in dull.iter_mut().zip(&*more) {
            dull.twist += more.twist * part;
        }
        off_m_s.max(dull_off_m_s)
    }

    /// The kinetic energy of the vehicle and the free bodies; the mixed one of two where they differ.
    fn energy_J(&self, one: &[Body], other: &[Body]) -> f64 {
        let (vehicle, body) = (self.model.vehicle(), &self.state.body);
        let bodies_J = self.free_bodies.energy_J(one, other);
        let (one, other) = (&one[VEHICLE].twist, &other[VEHICLE].twist);
        let [[v, w], [other_v, other_w]] = [part(one), part(other)];
        let in_body = |spin_W_rad_s: &Vector3<f64>| body.attitude_WB.inverse_transform_vector(spin_W_rad_s);
        let spin_J = 0.5 * in_body(&w).dot(&(vehicle.inertia_kg_m2 * in_body(&other_w)));
        let slider_J = self.mounted(body).map_or(0.0, |mounted| mounted.slider_energy_J(one, other));
        0.5 * vehicle.mass_kg * v.dot(&other_v) + spin_J + slider_J + bodies_J
    }

    /// Starts the solver with the impulses of the step before: the first point of a part with the first of it then.
    fn warm_start(&self, scratch: &mut Scratch) {
        let Scratch { near, constraints, .. } = scratch;
        let (contacts, stops) = constraints.split_at_mut(near.len());
        for (number, (this, constraint)) in near.iter().zip(contacts).enumerate() {
            // Points of one part follow each other, and there are few: a wrong guess costs iterations only.
            let key = |near: &Near| (near.object, near.bodies[1] as u32, near.part);
            let before = near[..number].iter().rev();
            let place = before.take_while(|other| key(other) == key(this)).count();
            let is_this = |held: &&HeldContact| (held.object, held.body, held.part) == key(this);
            let held = self.held.contacts.as_slice().iter().filter(is_this).nth(place);
            let Some(held) = held.filter(|_| constraint.bound_m_s.is_finite()) else { continue };
            constraint.impulse_N_s = held.impulse_N_s;
            if let Some(friction) = &mut constraint.friction {
                friction.warm_start(&held.slip_W_N_s);
            }
        }
        for (constraint, held_N_s) in stops.iter_mut().zip(self.held.stops_N_s.as_slice()) {
            if constraint.bound_m_s.is_finite() {
                constraint.impulse_N_s = *held_N_s;
            }
        }
    }

    fn hold(&mut self, scratch: &Scratch, is_found: bool) {
        self.held.clear();
        if !is_found {
            return;
        }
        let (contacts, stops) = scratch.constraints.split_at(scratch.near.len());
        self.held.contacts.extend(scratch.near.iter().zip(contacts).map(|(near, contact)| HeldContact {
            object: near.object,
            body: near.bodies[1] as u32,
            part: near.part,
            impulse_N_s: contact.impulse_N_s,
            slip_W_N_s: contact.friction.map_or(Vector3::zeros(), |friction| friction.impulse_W_N_s()),
        }));
        self.held.stops_N_s.extend(stops.iter().map(|stop| stop.impulse_N_s));
    }

    /// Passes the contacts of the vehicle and their impulses to the list of contacts.
    fn note(&mut self, scratch: &Scratch) {
        let both = scratch.near.iter().zip(&scratch.constraints);
        let sightings = both.filter(|(near, _)| near.bodies[1] == VEHICLE).map(|(near, contact)| {
            let [velocity_W_m_s, spin_W_rad_s] = part(&scratch.now[near.bodies[0]].twist);
            let state = self.free_bodies.states.get(near.bodies[0].wrapping_sub(FIRST_BODY));
            let arm_W_m = state.map_or(Vector3::zeros(), |state| near.point_W_m - state.position_W_m);
            Sighting {
                near: *near,
                impulse_N_s: contact.impulse_N_s,
                velocity_W_m_s: velocity_W_m_s + spin_W_rad_s.cross(&arm_W_m),
            }
        });
        self.contacts.note(&self.state.body, sightings, self.crash_speed_m_s);
    }

    /// Ends a step of `span_s` with this twist, which impulses changed from that of `free`.
    fn take_over(&mut self, free: &Free, after: &Vector6<f64>, span_s: f64) {
        let mut body = free.state.body;
        let change = after - twist(&body);
        shift(&mut body, &(change * (span_s / 2.0)));
        set_twist(&mut body, after);
        self.state = State { body, rotors: free.state.rotors };
        let [velocity_W_m_s, spin_W_rad_s] = part(&(change + free.held));
        self.changed.velocity_W_m_s += velocity_W_m_s;
        self.changed.spin_W_rad_s += spin_W_rad_s;
    }

    /// The same of the free bodies, which impulses left with the twists of `scratch.then`.
    fn take_over_bodies(&mut self, scratch: &Scratch, span_s: f64) {
        let ends = scratch.free_bodies.free.iter().zip(&scratch.then[FIRST_BODY..]);
        for (state, (free, after)) in self.free_bodies.states.iter_mut().zip(ends) {
            let change = after.twist - twist(free);
            *state = *free;
            // What nothing pushed keeps its bits.
            if change != Vector6::zeros() {
                shift(state, &(change * (span_s / 2.0)));
                set_twist(state, &after.twist);
            }
        }
    }

    /// Moves the vehicle and the bodies out of overlaps that the order of the step left; no velocity is changed
    /// by that.
    fn push_out(&mut self, scratch: &mut Scratch, span_s: f64) {
        let mut is_exact = true;
        let asked = scratch.constraints.iter_mut().filter(|constraint| constraint.bound_m_s.is_finite());
        for constraint in asked {
            let rates_m_s = constraint.normal.rate(&scratch.now) + constraint.normal.rate(&scratch.then);
            let gap_m = constraint.gap_m + rates_m_s / 2.0 * span_s;
            is_exact &= gap_m > -EXACT_M;
            // A shift over the step in place of a rate.
            constraint.bound_m_s = (-gap_m).min(PUSH_OUT_M_S * span_s);
            (constraint.impulse_N_s, constraint.friction) = (0.0, None);
        }
        if is_exact {
            return;
        }
        scratch.then.iter_mut().for_each(|body| body.twist = Vector6::zeros());
        scratch.solve();
        shift(&mut self.state.body, &scratch.then[VEHICLE].twist);
        for (state, by) in self.free_bodies.states.iter_mut().zip(&scratch.then[FIRST_BODY..]) {
            if by.twist != Vector6::zeros() {
                shift(state, &by.twist);
            }
        }
    }
}

/// Returns the greatest speed of any point of a body that reaches this far.
fn fastest_m_s(body: &RigidBody, reach_m: f64) -> f64 {
    body.velocity_W_m_s.norm() + body.angular_velocity_B_rad_s.norm() * reach_m
}

/// Has the other vehicles fly on for `span_s`.
fn move_on(others: &mut [Neighbour], span_s: f64) {
    for other in others {
        other.position_W_m += other.velocity_W_m_s * span_s;
    }
}
