//! The free bodies of a scene, and one step of them and the vehicle without contacts.
//!
//! Bodies and vehicle are integrated together by the classic Runge-Kutta scheme. At each of its stages the
//! forces of the joints keep their constraints (an index-1 DAE with its multipliers). The error that the scheme
//! leaves is projected away after the step, of positions and velocities. A rope is a joint while it is taut and
//! pulls.

use super::body::{add_twist, mobility, shift, twist};
use super::drive::Instant;
use super::joint_forces::JointForces;
use super::joints::Joint;
use super::rig;
use super::solver::{Body, join, part};
use crate::actuation::Actuation;
use crate::newton_euler::NewtonEuler;
use crate::state::{BodyRates, Rates, RigidBody, State};
use nalgebra::{Matrix3, Matrix6, Quaternion, UnitQuaternion, Vector3, Vector6};
use scenes::{End, FreeBody, Rig, Scene};

/// The numbers of the bodies: first those that every scene has; others than free bodies follow these.
pub(super) const WORLD: usize = 0;
pub(super) const VEHICLE: usize = 1;
pub(super) const FIRST_BODY: usize = 2;

/// Number of the first thing of a scene in contacts.
pub(super) const FIRST_THING: u32 = 2;

/// A rope with no more slack than this is taut.
pub(super) const TAUT_M: f64 = 1e-6;

/// A taut rope whose ends come nearer than this is not. Tuned, no source.
const SLACKENING_M_S: f64 = 1e-9;

/// Times that errors of the joints' places are projected away: one would leave errors of second order. Tuned,
/// no source.
const PROJECTIONS: usize = 2;

/// The weights of the classic Runge-Kutta scheme's stages.
const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// A free body as it is built.
#[derive(Debug, Clone)]
struct Build {
    mass_kg: f64,
    inertia: Matrix3<f64>,
    inverse_inertia: Matrix3<f64>,
    /// Its state at the start: in the world, or seen from the vehicle that it hangs from.
    start: RigidBody,
    hangs: bool,
}

/// The free bodies of a scene and their joints.
pub(super) struct FreeBodies {
    builds: Vec<Build>,
    pub joints: Vec<Joint>,
    /// True if a joint ties the vehicle.
    is_vehicle_tied: bool,
    /// From where the vehicle's file has its centre of mass to where it is; the other way round in `shift_B_m`.
    shift_B_m: Vector3<f64>,
    pub states: Vec<RigidBody>,
    /// Their numbers in contacts.
    pub objects: Vec<u32>,
}

/// Energy of the free bodies, where nothing that moves does work on them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Energy {
    pub kinetic_J: f64,
    /// Potential energy, 0 at the height of the world's origin.
    pub potential_J: f64,
    /// Weight of all bodies, times their number: as if all were one pile.
    pub piled_N: f64,
}

/// Buffers for a step of the bodies: kept, so that a step takes no memory.
#[derive(Default)]
pub(super) struct Work {
    /// The bodies at the end of the free step.
    pub free: Vec<RigidBody>,
    /// True for each joint that acts: all but slack ropes.
    acting: Vec<bool>,
    /// Impulse of each rope over the free step, N s; 0 of other joints.
    pub pulls_N_s: Vec<f64>,
    stage: Vec<RigidBody>,
    rates: [Vec<BodyRates>; 4],
    accelerations: Vec<Vector6<f64>>,
    forces: JointForces,
}

/// The vehicle, as the bodies that hang from it need it.
pub(super) struct Carrier<'a> {
    pub model: &'a NewtonEuler,
    pub rig: Option<&'a Rig>,
    pub actuation: &'a Actuation,
    /// Time since the start.
    pub when: Instant,
}

/// Limits of a start or of a joint that are not kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Misfit {
    /// A rope is longer than it may be.
    Overstretched { joint: usize, over_m: f64 },
    /// The ends that a joint ties move apart, at a speed in m/s or rad/s.
    Parting { joint: usize, rate: f64 },
    /// The joint that is damped and driven fastest, as the rate of a pole: the length of a step decides whether that
    /// is too fast.
    Fast { joint: usize, per_s: f64 },
}

/// Slower than this is rounding in a scene file, m/s or rad/s.
const PARTING: f64 = 1e-6;

impl FreeBodies {
    /// The bodies of `scene`, where its file puts them; `shift_B_m` is the vehicle's frame relative to its
    /// place in the file, seen from the centre of mass.
    pub(super) fn new(scene: &Scene, shift_B_m: &Vector3<f64>) -> Self {
        let hanging = scene.hanging();
        let builds: Vec<_> =
            scene.bodies().zip(&hanging).map(|((_, body), hangs)| Build::new(body, *hangs)).collect();
        let still = RigidBody::level_at(Vector3::zeros());
        let frames: Vec<_> =
            [still, still].into_iter().chain(builds.iter().map(|build| build.start)).collect();
        let number = |end| match end {
            End::World => WORLD,
            End::Vehicle => VEHICLE,
            End::Body(place) => FIRST_BODY + place,
        };
        // A scene that was built in code may name a body that is not there.
        let is_there = |joint: &&scenes::Joint| {
            [joint.parent, joint.child].into_iter().all(|end| number(end) < frames.len())
        };
        let joints = scene.joints.iter().filter(is_there).map(|joint| {
            let mut joint = Joint::new(joint, &frames, number);
            joint.shift(VEHICLE, shift_B_m);
            joint
        });
        Self {
            joints: joints.collect(),
            is_vehicle_tied: scene.is_vehicle_tied(),
            shift_B_m: *shift_B_m,
            objects: scene.bodies().map(|(number, _)| FIRST_THING + number as u32).collect(),
            states: builds.iter().map(|build| build.start).collect(),
            builds,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.builds.is_empty() && self.joints.is_empty()
    }

    /// True if joints act on the vehicle.
    pub(super) fn is_vehicle_tied(&self) -> bool {
        self.is_vehicle_tied
    }

    /// Pairs of bodies, the smaller number first, that a joint other than a rope ties.
    pub(super) fn tied_pairs(&self) -> Vec<[usize; 2]> {
        let ties = self.joints.iter().filter(|joint| !joint.is_rope()).map(|joint| joint.ends);
        ties.map(|[parent, child]| [parent.min(child), parent.max(child)]).collect()
    }

    /// Numbers that distinguish these bodies and joints from others.
    pub(super) fn numbers(&self) -> Vec<f64> {
        let builds = self.builds.iter().flat_map(|build| {
            build.inertia.iter().copied().chain([build.mass_kg, f64::from(u8::from(build.hangs))])
        });
        builds.chain(self.joints.iter().flat_map(Joint::numbers)).collect()
    }

    /// Returns the state of the vehicle at which the bodies that hang from it are where its file puts them.
    pub(super) fn carrier_at_start(&self) -> RigidBody {
        RigidBody::level_at(-self.shift_B_m)
    }

    /// Moves those that hang from the vehicle along with it, as if all were one body: it was put from `before` to `after`.
    pub(super) fn carry(&mut self, before: &RigidBody, after: &RigidBody) {
        let turn = after.attitude_WB * before.attitude_WB.inverse();
        let [spun_W_rad_s, spin_W_rad_s] = [before, after].map(RigidBody::angular_velocity_W_rad_s);
        for (_, state) in self.builds.iter().zip(&mut self.states).filter(|(build, _)| build.hangs) {
            let arm_W_m = state.position_W_m - before.position_W_m;
            let own_W_m_s = state.velocity_W_m_s - before.velocity_W_m_s - spun_W_rad_s.cross(&arm_W_m);
            let own_W_rad_s = state.angular_velocity_W_rad_s() - spun_W_rad_s;
            let carried_W_m = turn * arm_W_m;
            let attitude_WB = turn * state.attitude_WB;
            *state = RigidBody {
                position_W_m: after.position_W_m + carried_W_m,
                velocity_W_m_s: after.velocity_W_m_s + spin_W_rad_s.cross(&carried_W_m) + turn * own_W_m_s,
                attitude_WB: UnitQuaternion::new_normalize(attitude_WB.into_inner()),
                angular_velocity_B_rad_s: attitude_WB
                    .inverse_transform_vector(&(spin_W_rad_s + turn * own_W_rad_s)),
            };
        }
    }

    /// Returns the first joint whose ends do not fit with the vehicle here, and by how much; else the fastest joint.
    pub(super) fn misfit(&self, model: &NewtonEuler, vehicle: &RigidBody) -> Option<Misfit> {
        let mut forces = JointForces::default();
        self.see(model, vehicle, &self.states, &mut forces);
        let over_m = |joint: &Joint| -joint.slack(forces.frames()).map_or(0.0, |(slack_m, _)| slack_m);
        let over_m = self.joints.iter().map(over_m).enumerate().find(|(_, over_m)| *over_m > TAUT_M);
        if let Some((joint, over_m)) = over_m {
            return Some(Misfit::Overstretched { joint, over_m });
        }
        let rigid: Vec<bool> = self.joints.iter().map(|joint| !joint.is_rope()).collect();
        forces.lay(&self.joints, &rigid);
        if let Some((joint, rate)) = forces.fastest_row().filter(|(_, rate)| *rate > PARTING) {
            return Some(Misfit::Parting { joint, rate });
        }
        let (joint, per_s) = forces.fastest_pole(&self.joints)?;
        Some(Misfit::Fast { joint, per_s })
    }

    /// The bodies as impulses see them.
    pub(super) fn as_bodies<'a>(&'a self, states: &'a [RigidBody]) -> impl Iterator<Item = Body> + 'a {
        self.builds
            .iter()
            .zip(states)
            .map(|(build, state)| Body { twist: twist(state), mobility: build.mobility(state) })
    }

    /// The kinetic energy of the bodies, J, where these are their twists; twice the mixed one where the two differ.
    pub(super) fn energy_J(&self, one: &[Body], other: &[Body]) -> f64 {
        let each = self.builds.iter().zip(&self.states).zip(FIRST_BODY..);
        let energies = each.map(|((build, state), number)| {
            build.energy_J(state, [&one[number].twist, &other[number].twist])
        });
        energies.sum()
    }

    /// The energy of the bodies where they are; `None` if there are none, or joints do work on them: those that tie the vehicle,
    /// and driven ones.
    pub(super) fn energy(&self, gravity_m_s2: f64) -> Option<Energy> {
        let is_driven = self.joints.iter().any(|joint| joint.drive.is_some());
        if self.builds.is_empty() || self.is_vehicle_tied || is_driven {
            return None;
        }
        let mut energy = Energy { kinetic_J: 0.0, potential_J: 0.0, piled_N: 0.0 };
        for (build, state) in self.builds.iter().zip(&self.states) {
            let (w, weight_N) = (&state.angular_velocity_B_rad_s, build.mass_kg * gravity_m_s2);
            energy.kinetic_J += 0.5 * build.mass_kg * state.velocity_W_m_s.norm_squared();
            energy.kinetic_J += 0.5 * w.dot(&(build.inertia * w));
            energy.potential_J += weight_N * state.position_W_m.z;
            energy.piled_N += weight_N * self.builds.len() as f64;
        }
        Some(energy)
    }

    /// A step of `span_s` of the vehicle at `vehicle` and all bodies, without contacts; those end in `work.free`.
    pub(super) fn free_step(
        &self,
        carrier: &Carrier<'_>,
        vehicle: &State,
        span_s: f64,
        work: &mut Work,
    ) -> State {
        self.find_taut(carrier, vehicle, work);
        work.pulls_N_s.clear();
        work.pulls_N_s.resize(self.joints.len(), 0.0);
        let mut ks: [Option<Rates>; 4] = [None; 4];
        for (stage, share) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
            let before = stage.saturating_sub(1);
            let state = match &ks[before] {
                Some(rates) if stage > 0 => vehicle.moved(rates, share * span_s),
                _ => *vehicle,
            };
            work.stage.clear();
            for (number, body) in self.states.iter().enumerate() {
                let moved =
                    if stage == 0 { *body } else { body.moved(&work.rates[before][number], share * span_s) };
                work.stage.push(moved);
            }
            let when = Instant { time_s: carrier.when.time_s + share * span_s, ..carrier.when };
            ks[stage] = Some(self.rates(&Carrier { when, ..*carrier }, &state, stage, work));
            let Work { forces, pulls_N_s, .. } = &mut *work;
            forces.add_pulls(WEIGHTS[stage] * span_s, &self.joints, pulls_N_s);
        }
        let [Some(k1), Some(k2), Some(k3), Some(k4)] = &ks else { return *vehicle };
        let mut sum = *k1;
        [(k2, 2.0), (k3, 2.0), (k4, 1.0)].into_iter().for_each(|(rates, weight)| sum.add(rates, weight));
        work.free.clear();
        for (number, body) in self.states.iter().enumerate() {
            let [k1, k2, k3, k4] = work.rates.each_ref().map(|rates| rates[number]);
            let sum = k1.plus(&k2, 2.0).plus(&k3, 2.0).plus(&k4, 1.0);
            let mut moved = body.moved(&sum, span_s / 6.0);
            moved.attitude_WB = UnitQuaternion::new_normalize(moved.attitude_WB.into_inner());
            work.free.push(moved);
        }
        let mut end = vehicle.moved(&sum, span_s / 6.0);
        if !self.joints.is_empty() {
            let Work { free, acting, forces, .. } = work;
            self.project(carrier.model, &mut end.body, free, (acting, forces));
        }
        end
    }

    /// Finds the ropes that are joints in this step: those that are taut and would pull.
    fn find_taut(&self, carrier: &Carrier<'_>, vehicle: &State, work: &mut Work) {
        self.see(carrier.model, &vehicle.body, &self.states, &mut work.forces);
        let Work { acting, forces, .. } = &mut *work;
        let acts = |joint: &Joint| {
            let slack = joint.slack(forces.frames());
            slack.is_none_or(|(slack_m, leaves_m_s)| slack_m <= TAUT_M && leaves_m_s > -SLACKENING_M_S)
        };
        acting.clear();
        acting.extend(self.joints.iter().map(acts));
        // One rope less each time.
        while self.joints.iter().zip(&work.acting).any(|(joint, acts)| joint.is_rope() && *acts) {
            work.stage.clone_from(&self.states);
            self.rates(carrier, vehicle, 0, work);
            let ropes = work.forces.hardest_push(|joint| self.joints[joint].is_rope());
            let Some(pushing) = ropes else { return };
            work.acting[pushing] = false;
        }
    }

    /// The rates of the vehicle at `state` and of the bodies at `work.stage`, at the time of `carrier`; the latter go into
    /// `work.rates[stage]`.
    fn rates(&self, carrier: &Carrier<'_>, state: &State, stage: usize, work: &mut Work) -> Rates {
        let mut rates = carrier.model.rates(state, carrier.actuation);
        if let Some(rig) = carrier.rig {
            rates = rig::hold(rig, carrier.model, state, rates);
        }
        let gravity_W_m_s2 = Vector3::z() * -carrier.model.vehicle().gravity_m_s2;
        let Work { stage: bodies, rates: all, acting, forces, accelerations, .. } = work;
        let out = &mut all[stage];
        out.clear();
        out.extend(self.builds.iter().zip(&*bodies).map(|(build, body)| build.rates(body, &gravity_W_m_s2)));
        if self.joints.is_empty() {
            return rates;
        }
        self.see(carrier.model, &state.body, bodies, forces);
        let frames = forces.frames();
        accelerations.clear();
        accelerations.extend([Vector6::zeros(), accelerations_of(&frames[VEHICLE], &rates.body)]);
        let bodies = out.iter().zip(&frames[FIRST_BODY..]);
        accelerations.extend(bodies.map(|(rates, frame)| accelerations_of(frame, rates)));
        forces.damp(&self.joints, accelerations);
        forces.drive(&self.joints, &carrier.when, accelerations);
        forces.lay(&self.joints, acting);
        forces.find(|line, _| -(line.bias + line.rate(|end| accelerations[end])));
        forces.push(|end, by| accelerations[end] += by);
        let frames = forces.frames();
        take(&frames[VEHICLE], &accelerations[VEHICLE], &mut rates.body);
        for (rates, number) in out.iter_mut().zip(FIRST_BODY..) {
            take(&frames[number], &accelerations[number], rates);
        }
        rates
    }

    /// Lays out the frames and their mobilities.
    fn see(&self, model: &NewtonEuler, vehicle: &RigidBody, bodies: &[RigidBody], forces: &mut JointForces) {
        let mass_kg = model.vehicle().mass_kg;
        let vehicle_mobility = |frame: &RigidBody| mobility(frame, mass_kg, model.inverse_inertia());
        let build = |number: usize| &self.builds[number - FIRST_BODY];
        forces.see(vehicle, bodies, |number, frame| match number {
            WORLD => Matrix6::zeros(),
            VEHICLE => vehicle_mobility(frame),
            _ => build(number).mobility(frame),
        });
    }

    /// Removes the errors of the joints from the vehicle and `bodies`: those of positions, and then those of
    /// velocities.
    fn project(
        &self,
        model: &NewtonEuler,
        vehicle: &mut RigidBody,
        bodies: &mut [RigidBody],
        (acting, forces): (&[bool], &mut JointForces),
    ) {
        for _ in 0..PROJECTIONS {
            self.see(model, vehicle, bodies, forces);
            forces.lay(&self.joints, acting);
            forces.find(|line, _| -line.off);
            forces.push(|end, by| match end {
                WORLD => (),
                VEHICLE => shift(vehicle, by),
                _ => shift(&mut bodies[end - FIRST_BODY], by),
            });
        }
        self.see(model, vehicle, bodies, forces);
        forces.lay(&self.joints, acting);
        forces.find(|line, frames| -line.rate(|end| twist(&frames[end])));
        forces.push(|end, by| match end {
            WORLD => (),
            VEHICLE => add_twist(vehicle, by),
            _ => add_twist(&mut bodies[end - FIRST_BODY], by),
        });
    }

    /// The same after impulses acted on the vehicle and the bodies as they are now; ropes are left to the impulses.
    pub(super) fn project_rigid(&mut self, model: &NewtonEuler, vehicle: &mut RigidBody, work: &mut Work) {
        if self.joints.is_empty() {
            return;
        }
        let Work { acting, forces, .. } = work;
        acting.clear();
        acting.extend(self.joints.iter().map(|joint| !joint.is_rope()));
        let mut states = std::mem::take(&mut self.states);
        self.project(model, vehicle, &mut states, (acting, forces));
        self.states = states;
    }
}

impl Build {
    fn new(body: &FreeBody, hangs: bool) -> Self {
        let attitude_WB = body.attitude_W;
        let spin_W_rad_s = &body.angular_velocity_W_rad_s;
        Self {
            mass_kg: body.mass_kg,
            inertia: body.inertia_kg_m2,
            // That of a solid has an inverse; zero would only freeze the rotation.
            inverse_inertia: body.inertia_kg_m2.try_inverse().unwrap_or_else(Matrix3::zeros),
            start: RigidBody {
                position_W_m: body.centre_W_m,
                velocity_W_m_s: body.velocity_W_m_s,
                attitude_WB,
                angular_velocity_B_rad_s: attitude_WB.inverse_transform_vector(spin_W_rad_s),
            },
            hangs,
        }
    }

    fn mobility(&self, state: &RigidBody) -> Matrix6<f64> {
        mobility(state, self.mass_kg, &self.inverse_inertia)
    }

    /// Newton's and Euler's equations of a body that nothing but gravity acts on.
    fn rates(&self, state: &RigidBody, gravity_W_m_s2: &Vector3<f64>) -> BodyRates {
        let w = &state.angular_velocity_B_rad_s;
        BodyRates {
            velocity_W_m_s: state.velocity_W_m_s,
            acceleration_W_m_s2: *gravity_W_m_s2,
            attitude_WB_per_s: state.attitude_WB.as_ref() * Quaternion::from_imag(w * 0.5),
            angular_acceleration_B_rad_s2: -(self.inverse_inertia * w.cross(&(self.inertia * w))),
        }
    }

    fn energy_J(&self, state: &RigidBody, twists: [&Vector6<f64>; 2]) -> f64 {
        let [[v, w], [other_v, other_w]] = twists.map(part);
        let in_body = |spin_W_rad_s: &Vector3<f64>| state.attitude_WB.inverse_transform_vector(spin_W_rad_s);
        0.5 * self.mass_kg * v.dot(&other_v) + 0.5 * in_body(&w).dot(&(self.inertia * in_body(&other_w)))
    }
}

/// Linear and angular acceleration, in the world's axes.
fn accelerations_of(frame: &RigidBody, rates: &BodyRates) -> Vector6<f64> {
    join(&rates.acceleration_W_m_s2, &(frame.attitude_WB * rates.angular_acceleration_B_rad_s2))
}

fn take(frame: &RigidBody, accelerations: &Vector6<f64>, rates: &mut BodyRates) {
    let [linear_W_m_s2, angular_W_rad_s2] = part(accelerations);
    rates.acceleration_W_m_s2 = linear_W_m_s2;
    rates.angular_acceleration_B_rad_s2 = frame.attitude_WB.inverse_transform_vector(&angular_W_rad_s2);
}
