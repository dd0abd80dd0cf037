//! The backend `rapier`: the same forces as in free flight, in a world that can be touched.
//!
//! At every step the free flight over the step is computed first, by the integrator of [`NewtonEuler`]. Its
//! change of velocity is then given to rapier as a force and a torque, and rapier moves the body and solves the
//! contacts. So rapier's own integrator, which is of first order, adds an error to the position only, of the
//! velocity's change times a fraction of the step (docs/decisions/008-two-backends.md).
//!
//! | room | what it holds |
//! |---|---|
//! | `body` | who owns pose and velocity; where glam meets nalgebra |
//! | `world` | what stands and moves in rapier's world |
//! | [`hull`] | how much room a vehicle takes |
//! | `contacts` | when contacts begin and end |
//! | `rig` | test rigs as joints |

mod body;
mod contacts;
pub mod hull;
mod rig;
mod world;

use crate::actuation::{Actuation, Battery};
use crate::airframe_state::AirframeState;
use crate::backend::{Backend, ContactReport, Neighbour, TRAFFIC_MAX};
use crate::newton_euler::{Accelerations, NewtonEuler};
use crate::snapshot::{Snapshot, SnapshotError};
use crate::state::{RigidBody, State};
use contacts::Contacts;
use hull::Hull;
use nalgebra::Vector3;
use scenes::{Rig, Scene};
use serde::{Deserialize, Serialize};
use world::World;

/// What its snapshots are called.
const NAME: &str = "rapier";

/// A vehicle lower than this above its stand starts on its feet, at rest.
const ON_THE_GROUND_M: f64 = 1e-3;

/// A vehicle that is slower than this when it is placed on the ground or in a rig is carried there: tuned, no source.
const AT_REST_M_S: f64 = 0.01;

/// A vehicle in a scene.
///
/// ```
/// use nalgebra::Vector3;
/// use plant::{Airframe, Backend, NewtonEuler, Rapier, RigidBody};
///
/// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let vehicle = vehicles::Vehicle::load(path.as_ref()).unwrap();
/// let airframe = Airframe::new(vehicle);
/// let effects = airframe.initial_state(1, "plant", 1e-3);
/// let scene = scenes::Scene::default();
/// let body = RigidBody::level_at(Vector3::zeros());
/// let mut flight = Rapier::new(NewtonEuler::flying(airframe, 1), effects, &scene, &body, 1.0);
/// (0..10).for_each(|_| flight.step(&[0.0; 4], 1e-3, &[]));
/// assert_eq!((flight.contact().object, flight.contact().crashed), (1, false), "it stands on the ground");
/// ```
pub struct Rapier {
    model: NewtonEuler,
    hull: Hull,
    rig: Option<Rig>,
    crash_speed_m_s: f64,
    /// The least moment of inertia about any axis.
    inertia_min_kg_m2: f64,
    world: World,
    contacts: Contacts,
    state: State,
    effects: AirframeState,
    reaction: Reaction,
}

/// What contacts and joints changed over the last tick, against free flight.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
struct Reaction {
    acceleration_W_m_s2: Vector3<f64>,
    angular_acceleration_W_rad_s2: Vector3<f64>,
    /// Force of the contacts along their normals.
    normal_W_N: Vector3<f64>,
}

impl Rapier {
    /// A vehicle that starts as `body` in `scene`, its rotors at the lowest command; it crashes where it meets
    /// something faster than `crash_speed_m_s`. A body lower than the vehicle stands is raised onto its feet; in
    /// a rig it is moved to hang from the bearing. `effects` are made by the vehicle's airframe.
    #[must_use]
    pub fn new(
        model: NewtonEuler,
        effects: AirframeState,
        scene: &Scene,
        body: &RigidBody,
        crash_speed_m_s: f64,
    ) -> Self {
        let vehicle = model.vehicle();
        let hull = Hull::of(model.airframe());
        // The mount is on the frame, and where it is seen from may have moved.
        let mount_shift_B_m = model.airframe().frame_shift_B_m();
        let rig = scene.rig.map(|rig| Rig { mount_B_m: rig.mount_B_m + mount_shift_B_m, ..rig });
        let mut rapier = Self {
            hull,
            rig,
            crash_speed_m_s,
            inertia_min_kg_m2: vehicle.inertia_kg_m2.symmetric_eigenvalues().min(),
            world: World::new(vehicle, &hull, scene, rig.as_ref(), body),
            contacts: Contacts::new(1 + scene.thing_count() + TRAFFIC_MAX),
            state: model.start(*body, 0.0),
            effects,
            reaction: Reaction::default(),
            model,
        };
        rapier.set_body(body);
        rapier
    }

    /// The number of the scene's box or mesh that the vehicle is partly inside of, if any.
    pub(crate) fn thing_around(&self) -> Option<usize> {
        self.world.thing_around(&self.state.body)
    }

    /// One step of `span_s`; returns by how much contacts and joints changed the velocities.
    fn substep(&mut self, actuation: &Actuation, span_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let before = self.state.body;
        let free = self.model.runge_kutta(&self.state, actuation, span_s);
        if !free.body.is_finite() {
            // The world would panic on it; what is published ends the run with the field that is no number.
            self.state = free;
            return (Vector3::zeros(), Vector3::zeros());
        }
        let (force_W_N, torque_W_N_m) = self.push(&free.body, span_s);
        let friction_W_N_m = self.rig_friction(span_s);
        self.world.step(&force_W_N, &(torque_W_N_m + friction_W_N_m), span_s);
        self.contacts.note(&before, self.world.sightings(), self.crash_speed_m_s);
        self.state = State { body: self.world.body(), rotors: free.rotors };
        let after = &self.state.body;
        (after.velocity_W_m_s - free.body.velocity_W_m_s, spin_W_rad_s(after) - spin_W_rad_s(&free.body))
    }

    /// Pushes the rig's slider, and returns the torque of the bearing's friction on the vehicle.
    fn rig_friction(&mut self, span_s: f64) -> Vector3<f64> {
        let Some(rig) = &self.rig else { return Vector3::zeros() };
        if let Some(slider) = self.world.slider() {
            rig::push_slider(slider, rig, self.model.vehicle().gravity_m_s2, span_s);
        }
        rig::bearing_torque_W_N_m(rig, &spin_W_rad_s(&self.state.body), self.inertia_min_kg_m2, span_s)
    }

    /// The constant force and torque that take the body's velocities to those of `free` over `span_s`.
    fn push(&self, free: &RigidBody, span_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (vehicle, body) = (self.model.vehicle(), &self.state.body);
        let turned_W_rad_s = spin_W_rad_s(free) - spin_W_rad_s(body);
        let turned_B_rad_s = body.attitude_WB.inverse_transform_vector(&turned_W_rad_s);
        let impulse_W_N_s = (free.velocity_W_m_s - body.velocity_W_m_s) * vehicle.mass_kg;
        let turn_W_N_m_s = body.attitude_WB * (vehicle.inertia_kg_m2 * turned_B_rad_s);
        (impulse_W_N_s / span_s, turn_W_N_m_s / span_s)
    }

    /// Has the vehicle stand on its feet where it is too low to fly.
    fn put_down(&mut self) {
        let stands = self.stands();
        let height_m = &mut self.state.body.position_W_m.z;
        if stands {
            *height_m = height_m.max(self.hull.stand_m());
        }
        self.contacts.place(stands.then_some(world::GROUND), world::FEET);
    }

    /// Before anything has moved, what carries a vehicle at rest is what takes its free acceleration away: so its
    /// accelerometer feels g from the first tick on.
    fn lean_on_support(&mut self) {
        let free = self.model.accelerations_under(&self.effects.actuation, &self.state);
        let body = &self.state.body;
        let gravity_W_m_s2 = Vector3::z() * self.model.vehicle().gravity_m_s2;
        let free_W_m_s2 = body.attitude_WB * free.specific_force_B_m_s2 - gravity_W_m_s2;
        let is_at_rest = body.velocity_W_m_s.norm() < AT_REST_M_S;
        self.reaction = Reaction::default();
        if is_at_rest && self.is_carried(&free_W_m_s2) {
            self.reaction.acceleration_W_m_s2 = -free_W_m_s2;
        }
    }

    /// Whether ground or rig keep the vehicle from accelerating freely.
    fn is_carried(&self, free_W_m_s2: &Vector3<f64>) -> bool {
        let vehicle = self.model.vehicle();
        match &self.rig {
            Some(rig) => {
                let lift_N = free_W_m_s2.z * vehicle.mass_kg;
                rig::holds(rig, &self.state.body, lift_N, vehicle.gravity_m_s2)
            }
            None => self.stands() && free_W_m_s2.z < 0.0,
        }
    }

    fn stands(&self) -> bool {
        let upright = self.state.body.attitude_WB * Vector3::z();
        self.state.body.position_W_m.z < self.hull.stand_m() + ON_THE_GROUND_M && upright.z > 0.999
    }

    /// Moves the vehicle to hang from the rig's bearing.
    fn hang(&mut self, rig: &Rig) {
        let (body, bearing_W_m) = rig::hung(rig, &self.state.body);
        self.state.body = body;
        self.contacts.place(None, 0);
        let arm_W_m = body.attitude_WB * rig.mount_B_m;
        let velocity_W_m_s = body.velocity_W_m_s + spin_W_rad_s(&body).cross(&arm_W_m);
        if let Some(slider) = self.world.slider() {
            rig::place(slider, rig, &bearing_W_m, &velocity_W_m_s);
        }
    }
}

impl Backend for Rapier {
    fn state(&self) -> &State {
        &self.state
    }

    fn accelerations(&self) -> Accelerations {
        let free = self.model.accelerations_under(&self.effects.actuation, &self.state);
        let in_body = |v_W: &Vector3<f64>| self.state.body.attitude_WB.inverse_transform_vector(v_W);
        let Reaction { acceleration_W_m_s2, angular_acceleration_W_rad_s2, .. } = &self.reaction;
        Accelerations {
            specific_force_B_m_s2: free.specific_force_B_m_s2 + in_body(acceleration_W_m_s2),
            angular_acceleration_B_rad_s2: free.angular_acceleration_B_rad_s2
                + in_body(angular_acceleration_W_rad_s2),
        }
    }

    fn step(&mut self, commands: &[f64; 4], dt_s: f64, traffic: &[Neighbour]) {
        let actuation = self.model.airframe().begin_tick(&mut self.effects, &self.state, commands, dt_s);
        let span_s = dt_s / f64::from(self.model.substeps());
        self.contacts.begin_tick();
        let (mut change_W_m_s, mut change_W_rad_s) = (Vector3::zeros(), Vector3::zeros());
        for substep in 1..=self.model.substeps() {
            self.world.move_neighbours(traffic, &self.hull, f64::from(substep) * span_s);
            let (linear_W_m_s, angular_W_rad_s) = self.substep(&actuation, span_s);
            change_W_m_s += linear_W_m_s;
            change_W_rad_s += angular_W_rad_s;
        }
        self.state.rotors = self.model.airframe().settled(&actuation, &self.state.rotors);
        self.reaction = Reaction {
            acceleration_W_m_s2: change_W_m_s / dt_s,
            angular_acceleration_W_rad_s2: change_W_rad_s / dt_s,
            normal_W_N: self.contacts.normal_impulse_W_N_s / dt_s,
        };
    }

    fn settle_rotors(&mut self, commands: &[f64; 4]) {
        self.state.rotors = commands.map(|command| self.model.steady(command));
        self.lean_on_support();
    }

    fn set_body(&mut self, body: &RigidBody) {
        self.state.body = *body;
        match self.rig {
            Some(rig) => self.hang(&rig),
            None => self.put_down(),
        }
        self.world.set_body(&self.state.body);
        self.lean_on_support();
    }

    fn contact(&self) -> ContactReport {
        // All that free flight does not explain is the contacts' doing; in a rig, where the bearing pushes too, it is what
        // they push along their normals, friction left out.
        self.contacts.report(&match self.rig {
            Some(_) => self.reaction.normal_W_N,
            None => self.reaction.acceleration_W_m_s2 * self.model.vehicle().mass_kg,
        })
    }

    fn battery(&self) -> Option<Battery> {
        self.model.airframe().battery(&self.effects, &self.state)
    }

    fn snapshot(&self) -> Result<Vec<u8>, SnapshotError> {
        let snapshot = Snapshot::of(NAME)
            .with("state", &self.state)?
            .with("effects", &self.effects)?
            .with("reaction", &self.reaction)?
            .with("contacts", &self.contacts)?;
        self.world.write(snapshot)?.bytes()
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        let snapshot = Snapshot::read(snapshot, NAME)?;
        let (state, reaction) = (snapshot.get("state")?, snapshot.get("reaction")?);
        let effects = snapshot.fitting("effects", |effects| self.effects.fits(effects))?;
        let (contacts, world) = (snapshot.get("contacts")?, self.world.read(&snapshot)?);
        (self.state, self.effects, self.reaction) = (state, effects, reaction);
        (self.contacts, self.world) = (contacts, world);
        Ok(())
    }
}

fn spin_W_rad_s(body: &RigidBody) -> Vector3<f64> {
    body.attitude_WB * body.angular_velocity_B_rad_s
}
