//! One integration step of a vehicle that may touch something.
//!
//! The free flight over the step is computed first, by the integrator of [`crate::NewtonEuler`]. Where nothing is
//! near and no rig holds the vehicle, that is the step. Otherwise the step is cut at each impact, at the instant at
//! which the gap closes: free flight up to it, then Newton's law of restitution. What touches already is held by the
//! impulses of `solver`: they change the free step's velocities, and, as a constant force would, half of that
//! change times the step is added to its pose.

use super::contacts::{Contacts, Sighting};
use super::rig::{self, Slider};
use super::solver::{self, Ball, Body, Friction, Limit, Row};
use super::world::{Near, World};
use crate::actuation::Actuation;
use crate::backend::Neighbour;
use crate::newton_euler::NewtonEuler;
use crate::state::{RigidBody, State};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use scenes::Rig;
use serde::{Deserialize, Serialize};

/// What is nearer than this touches: far below what anybody sees, far above rounding. Tuned, no source.
const TOUCH: f64 = 1e-6;

/// What meets something slower than this, in m/s or rad/s, does not bounce: twice what gravity gives it in a tick.
/// Tuned, no source.
const SLOW: f64 = 0.02;

/// A step is cut at this many impacts at most; those that follow are inelastic. Tuned, no source.
const IMPACTS_MAX: usize = 24;

/// What is this near is looked at, beyond what a step may bring nearer: a contact lasts until there is a millimetre
/// of air. Tuned, no source.
const MARGIN_M: f64 = 2e-3;

/// How far a step moves the vehicle out of what it is inside of, at most, in m or rad: a vehicle that was put
/// inside of something comes out of it as fast as 1 m/s, and takes none of that speed along. Tuned, no source.
const PUSHED_OUT_MAX: f64 = 1e-3;

/// Errors of a pose that are left as they are.
const EXACT: f64 = 1e-12;

/// The bodies by their numbers; other vehicles follow.
const WORLD: usize = 0;
const VEHICLE: usize = 1;
const SLIDER: usize = 2;

/// What a step works with: kept, so that it takes no memory, and forgotten after it.
#[derive(Default)]
pub(super) struct Scratch {
    near: Vec<Near>,
    /// The contacts, in the order of `near`; then the stops.
    limits: Vec<Limit>,
    /// The bodies at the step's start.
    now: Vec<Body>,
    /// The bodies at its end.
    then: Vec<Body>,
}

/// The impulses of the last step: where the next one begins to look for its own.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Held {
    contacts: Vec<HeldContact>,
    bearing_W_N_s: Vector3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct HeldContact {
    object: u32,
    part: u32,
    impulse_N_s: f64,
    slip_W_N_s: Vector3<f64>,
}

/// Vehicle and slider at the end of a step without contacts and stops.
struct Free {
    state: State,
    slider: Option<Slider>,
    /// By how much the bearing changed the vehicle's velocities.
    held_W_m_s: Vector3<f64>,
    held_W_rad_s: Vector3<f64>,
}

impl Free {
    /// Without a rig.
    fn of(state: State) -> Self {
        Self { state, slider: None, held_W_m_s: Vector3::zeros(), held_W_rad_s: Vector3::zeros() }
    }
}

/// A vehicle that flies, touches things, or hangs in a rig.
pub(super) struct Motion {
    pub model: NewtonEuler,
    pub rig: Option<Rig>,
    pub world: World,
    pub contacts: Contacts,
    pub state: State,
    pub slider: Option<Slider>,
    /// An impact that is faster is a crash.
    pub crash_speed_m_s: f64,
    /// The least moment of inertia about any axis.
    pub inertia_min_kg_m2: f64,
    pub held: Held,
    pub changed: Changed,
    pub scratch: Scratch,
}

/// By how much contacts and joints changed the velocities since the tick began.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Changed {
    pub velocity_W_m_s: Vector3<f64>,
    pub spin_W_rad_s: Vector3<f64>,
}

impl Motion {
    /// One step of `span_s`; `others` are the other vehicles as they are at its start.
    pub(super) fn substep(&mut self, actuation: &Actuation, span_s: f64, others: &mut [Neighbour]) {
        let mut scratch = std::mem::take(&mut self.scratch);
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
        let mut left_s = span_s;
        for impact in 0..=IMPACTS_MAX {
            let free = self.free(actuation, left_s);
            if !free.state.body.is_finite() || self.is_clear(&free.state.body, left_s, others) {
                // What is no number ends the run when it is published.
                move_on(others, left_s);
                return self.fly_freely(free.state);
            }
            self.look_around(scratch, &free, left_s, others);
            match scratch.next_impact_s(left_s).filter(|_| impact < IMPACTS_MAX) {
                None => {
                    move_on(others, left_s);
                    return self.constrain(scratch, &free, left_s, f64::NEG_INFINITY);
                }
                Some(0.0) => self.bounce(scratch),
                Some(after_s) => {
                    let free = self.free(actuation, after_s);
                    self.bodies(&free.state.body, free.slider.as_ref(), others, &mut scratch.then);
                    // What is about to be met is not held back before.
                    self.constrain(scratch, &free, after_s, -SLOW);
                    move_on(others, after_s);
                    left_s -= after_s;
                }
            }
        }
    }

    /// A step with nothing but the bearing that holds the vehicle.
    fn free(&self, actuation: &Actuation, span_s: f64) -> Free {
        let Some(rig) = &self.rig else {
            return Free::of(self.model.runge_kutta(&self.state, actuation, span_s));
        };
        let hold = |state: &State, rates| rig::hold(rig, &self.model, state, rates);
        let state = self.model.runge_kutta_held(&self.state, actuation, span_s, hold);
        let unheld = self.model.runge_kutta(&self.state, actuation, span_s).body;
        Free {
            state,
            slider: Slider::under(rig, &state.body),
            held_W_m_s: state.body.velocity_W_m_s - unheld.velocity_W_m_s,
            held_W_rad_s: state.body.angular_velocity_W_rad_s() - unheld.angular_velocity_W_rad_s(),
        }
    }

    fn fly_freely(&mut self, free: State) {
        self.contacts.note(&self.state.body, std::iter::empty(), self.crash_speed_m_s);
        self.held.contacts.clear();
        self.state = free;
    }

    /// Whether nothing holds the vehicle and nothing is near on its way to `free`.
    fn is_clear(&self, free: &RigidBody, span_s: f64, others: &[Neighbour]) -> bool {
        let margin_m = MARGIN_M + self.way_m(free, span_s);
        self.rig.is_none() && self.world.is_clear(&self.state.body.position_W_m, others, span_s, margin_m)
    }

    /// How far any point of the vehicle gets over a step at most, with half of it to spare.
    fn way_m(&self, free: &RigidBody, span_s: f64) -> f64 {
        let fastest_m_s = |body: &RigidBody| {
            body.velocity_W_m_s.norm() + body.angular_velocity_B_rad_s.norm() * self.world.reach_m()
        };
        1.5 * span_s * fastest_m_s(&self.state.body).max(fastest_m_s(free))
    }

    /// Finds what is near, and makes a limit of each point and each stop.
    fn look_around(&mut self, scratch: &mut Scratch, free: &Free, span_s: f64, others: &[Neighbour]) {
        let Scratch { near, limits, now, then } = scratch;
        let fastest_other_m_s = others.iter().map(|other| other.velocity_W_m_s.norm()).fold(0.0, f64::max);
        let margin_m = MARGIN_M + self.way_m(&free.state.body, span_s) + span_s * fastest_other_m_s;
        self.world.find_near(&self.state.body, others, margin_m, near);
        self.bodies(&self.state.body, self.slider.as_ref(), others, now);
        self.bodies(&free.state.body, free.slider.as_ref(), others, then);
        limits.clear();
        limits.extend(near.iter().map(|near| self.contact(now, near)));
        if let Some(rig) = &self.rig {
            let slider = self.slider.as_ref().map(|slider| (SLIDER, slider));
            rig::stops(now, rig, slider, (VEHICLE, &self.state.body), limits);
        }
    }

    /// The world, the vehicle, the slider and the others, as impulses see them.
    fn bodies(
        &self,
        vehicle: &RigidBody,
        slider: Option<&Slider>,
        others: &[Neighbour],
        bodies: &mut Vec<Body>,
    ) {
        let turn_WB = vehicle.attitude_WB.to_rotation_matrix();
        let vehicle = Body {
            velocity_W_m_s: vehicle.velocity_W_m_s,
            spin_W_rad_s: vehicle.angular_velocity_W_rad_s(),
            inverse_mass_per_kg: Vector3::repeat(1.0 / self.model.vehicle().mass_kg),
            inverse_inertia_W: turn_WB * self.model.inverse_inertia() * turn_WB.transpose(),
        };
        let slider = slider.zip(self.rig.as_ref()).map(|(slider, rig)| slider.body(rig));
        let others = others.iter();
        let others = others.map(|other| Body { velocity_W_m_s: other.velocity_W_m_s, ..Body::default() });
        bodies.clear();
        bodies.extend([Body::default(), vehicle].into_iter().chain(slider).chain(others));
    }

    fn contact(&self, bodies: &[Body], near: &Near) -> Limit {
        let arm_W_m = near.point_W_m - self.state.body.position_W_m;
        // Others do not turn.
        let (pair, arms_W_m) = ([self.other(near), VEHICLE], [Vector3::zeros(), arm_W_m]);
        let normal_W = near.towards_vehicle_W;
        Limit {
            normal: Row::at(bodies, pair, arms_W_m, normal_W),
            gap: near.gap_m,
            restitution: near.restitution,
            friction: Some(Friction::new(bodies, pair, arms_W_m, &normal_W, near.friction)),
            least: f64::NEG_INFINITY,
            impulse: 0.0,
        }
    }

    /// The body that something near belongs to.
    fn other(&self, near: &Near) -> usize {
        near.neighbour.map_or(WORLD, |number| self.first_other() + number)
    }

    fn first_other(&self) -> usize {
        if self.slider.is_some() { SLIDER + 1 } else { SLIDER }
    }

    /// A step of `span_s` that ends as `free`, but for what limits and the bearing do; what comes nearer at a rate
    /// below `ahead` and does not touch yet is no limit.
    fn constrain(&mut self, scratch: &mut Scratch, free: &Free, span_s: f64, ahead: f64) {
        for limit in &mut scratch.limits {
            let is_ahead = limit.gap > TOUCH && limit.normal.rate(&scratch.now) < ahead;
            limit.least = if is_ahead { f64::NEG_INFINITY } else { -limit.gap.max(0.0) / span_s };
        }
        self.take_up(scratch);
        let mut ball = self.bearing(&scratch.then, &free.state.body);
        let [vehicle, slider] = self.rig_friction(span_s);
        scratch.then[VEHICLE].push(&Vector3::zeros(), &vehicle);
        if self.slider.is_some() {
            scratch.then[SLIDER].push(&slider, &Vector3::zeros());
        }
        solver::solve(&mut scratch.then, &mut ball, &mut scratch.limits);
        self.note(scratch);
        self.hold(scratch, ball.as_ref());
        if ball.is_none() && scratch.limits.iter().all(|limit| limit.impulse == 0.0) {
            self.state = free.state;
            return;
        }
        self.move_on(free, &scratch.then, span_s);
        self.correct_pose(scratch, ball, span_s);
    }

    /// The impact of all that touch: Newton's law for those that meet, and none of the others comes nearer.
    fn bounce(&mut self, scratch: &mut Scratch) {
        for limit in &mut scratch.limits {
            let rate = limit.normal.rate(&scratch.now);
            limit.least = match limit.gap <= TOUCH {
                false => f64::NEG_INFINITY,
                true if rate < -SLOW => -limit.restitution * rate,
                true => 0.0,
            };
        }
        scratch.then.clone_from(&scratch.now);
        let mut ball = self.bearing(&scratch.then, &self.state.body);
        solver::solve(&mut scratch.then, &mut ball, &mut scratch.limits);
        self.note(scratch);
        let free = Free { slider: self.slider, ..Free::of(self.state) };
        self.move_on(&free, &scratch.then, 0.0);
    }

    fn bearing(&self, bodies: &[Body], vehicle: &RigidBody) -> Option<Ball> {
        let above = if self.slider.is_some() { SLIDER } else { WORLD };
        let rig = self.rig.as_ref()?;
        let mut ball = rig::bearing(bodies, [above, VEHICLE], rig, vehicle);
        ball.impulse_W_N_s = self.held.bearing_W_N_s;
        Some(ball)
    }

    /// What the rig's friction turns the vehicle with and drives the slider with.
    fn rig_friction(&self, span_s: f64) -> [Vector3<f64>; 2] {
        let Some(rig) = &self.rig else { return [Vector3::zeros(); 2] };
        let spin_W_rad_s = self.state.body.angular_velocity_W_rad_s();
        let turn = rig::bearing_friction_W_N_m_s(rig, &spin_W_rad_s, self.inertia_min_kg_m2, span_s);
        let drive = self.slider.map_or(Vector3::zeros(), |slider| slider.friction_W_N_s(rig, span_s));
        [turn, drive]
    }

    /// Has the solver begin with the impulses of the step before.
    fn take_up(&self, scratch: &mut Scratch) {
        for (near, limit) in scratch.near.iter().zip(&mut scratch.limits) {
            let same = |held: &&HeldContact| (held.object, held.part) == (near.object, near.part);
            let Some(held) = self.held.contacts.iter().find(same).filter(|_| limit.least.is_finite()) else {
                continue;
            };
            limit.impulse = held.impulse_N_s;
            if let Some(friction) = &mut limit.friction {
                friction.take_up(&held.slip_W_N_s);
            }
        }
    }

    fn hold(&mut self, scratch: &Scratch, ball: Option<&Ball>) {
        self.held.bearing_W_N_s = ball.map_or(Vector3::zeros(), |ball| ball.impulse_W_N_s);
        let pushing = scratch.near.iter().zip(&scratch.limits).filter(|(_, limit)| limit.impulse > 0.0);
        self.held.contacts.clear();
        self.held.contacts.extend(pushing.map(|(near, limit)| HeldContact {
            object: near.object,
            part: near.part,
            impulse_N_s: limit.impulse,
            slip_W_N_s: limit.friction.map_or(Vector3::zeros(), |friction| friction.impulse_W_N_s()),
        }));
    }

    /// Tells the contacts what was found and what it pushed with.
    fn note(&mut self, scratch: &Scratch) {
        let others = &scratch.now[self.first_other()..];
        let sightings = scratch.near.iter().zip(&scratch.limits).map(|(near, limit)| Sighting {
            near: *near,
            impulse_N_s: limit.impulse,
            velocity_W_m_s: near.neighbour.map_or(Vector3::zeros(), |number| others[number].velocity_W_m_s),
        });
        self.contacts.note(&self.state.body, sightings, self.crash_speed_m_s);
    }

    /// Takes over the velocities of `bodies`, which impulses changed from those of `free` over a step of `span_s`.
    fn move_on(&mut self, free: &Free, bodies: &[Body], span_s: f64) {
        let mut body = free.state.body;
        let solved = &bodies[VEHICLE];
        let change_W_m_s = solved.velocity_W_m_s - body.velocity_W_m_s;
        let change_W_rad_s = solved.spin_W_rad_s - body.angular_velocity_W_rad_s();
        body.velocity_W_m_s = solved.velocity_W_m_s;
        shift(&mut body, &(change_W_m_s * (span_s / 2.0)), &(change_W_rad_s * (span_s / 2.0)));
        body.angular_velocity_B_rad_s = body.attitude_WB.inverse_transform_vector(&solved.spin_W_rad_s);
        self.state = State { body, rotors: free.state.rotors };
        self.changed.velocity_W_m_s += change_W_m_s + free.held_W_m_s;
        self.changed.spin_W_rad_s += change_W_rad_s + free.held_W_rad_s;
        self.slider = free.slider.map(|slider| {
            let velocity_W_m_s = bodies[SLIDER].velocity_W_m_s;
            let change_W_m_s = velocity_W_m_s - slider.velocity_W_m_s;
            let position_W_m = slider.position_W_m + change_W_m_s * (span_s / 2.0);
            Slider { position_W_m, velocity_W_m_s }
        });
    }

    /// Moves the bodies out of each other and the mount into the bearing, as far as the step left an error of its
    /// own order; no velocity is changed by that.
    fn correct_pose(&mut self, scratch: &mut Scratch, mut ball: Option<Ball>, span_s: f64) {
        let mut is_exact = true;
        for limit in scratch.limits.iter_mut().filter(|limit| limit.least.is_finite()) {
            let mean = (limit.normal.rate(&scratch.now) + limit.normal.rate(&scratch.then)) / 2.0;
            let gap = limit.gap + mean * span_s;
            is_exact &= gap > -EXACT;
            (limit.least, limit.impulse, limit.friction) = ((-gap).min(PUSHED_OUT_MAX), 0.0, None);
        }
        if let (Some(ball), Some(rig)) = (&mut ball, &self.rig) {
            let bearing_W_m = self.slider.map_or(rig.bearing_W_m, |slider| slider.position_W_m);
            let off_W_m = rig::off_W_m(rig, &self.state.body, &bearing_W_m);
            is_exact &= off_W_m.amax() < EXACT;
            (ball.wanted_W_m_s, ball.impulse_W_N_s) = (-off_W_m, Vector3::zeros());
        }
        if is_exact {
            return;
        }
        scratch.then.iter_mut().for_each(|body| *body = body.still());
        solver::solve(&mut scratch.then, &mut ball, &mut scratch.limits);
        let moved = &scratch.then[VEHICLE];
        shift(&mut self.state.body, &moved.velocity_W_m_s, &moved.spin_W_rad_s);
        if let Some(slider) = &mut self.slider {
            slider.position_W_m += scratch.then[SLIDER].velocity_W_m_s;
        }
    }
}

impl Scratch {
    /// How long after now the first gap closes, if any does in the free step of `span_s`; 0 where two that touch
    /// meet now.
    fn next_impact_s(&self, span_s: f64) -> Option<f64> {
        let after_s = |limit: &Limit| {
            let rate = limit.normal.rate(&self.now);
            if rate >= -SLOW {
                return None;
            }
            let mean = (rate + limit.normal.rate(&self.then)) / 2.0;
            let closes_s = if limit.gap <= TOUCH { 0.0 } else { (limit.gap - TOUCH / 2.0) / -mean };
            (0.0..span_s).contains(&closes_s).then_some(closes_s)
        };
        self.limits.iter().filter_map(after_s).min_by(f64::total_cmp)
    }
}

/// Has the other vehicles fly on for `span_s`.
fn move_on(others: &mut [Neighbour], span_s: f64) {
    for other in others {
        other.position_W_m += other.velocity_W_m_s * span_s;
    }
}

/// Moves and turns a body by little.
fn shift(body: &mut RigidBody, by_W_m: &Vector3<f64>, by_W_rad: &Vector3<f64>) {
    body.position_W_m += by_W_m;
    let turn = Quaternion::from_parts(1.0, by_W_rad / 2.0);
    body.attitude_WB = UnitQuaternion::new_normalize(turn * body.attitude_WB.into_inner());
}
