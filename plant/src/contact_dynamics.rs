//! The backend `rapier`: the same forces as in free flight, in a world that can be touched.
//!
//! Rapier finds what is near; where nothing is, the vehicle moves exactly as with `newton-euler`. Contacts, and the
//! joints of a rig, are solved here, not by rapier's own solver (docs/decisions/008-two-backends.md says why).
//!
//! | room | what it holds |
//! |---|---|
//! | `body` | a rigid body as rapier and as impulses see it |
//! | `world` | what stands and moves in rapier's world, and what of it is near |
//! | [`hull`] | how much room a vehicle takes |
//! | `free_bodies` | the free bodies of the scene, and a step without contacts |
//! | `joints`, `joint_forces` | what ties them: rows of constraints, and the forces that keep them |
//! | `drive` | the force of a motor in a joint |
//! | `poles` | how fast damped and driven joints are, for the step to follow |
//! | `solver` | the impulses of contacts, stops and joints, by sweeps |
//! | `islands`, `direct` | the same of bodies that the sweeps do not settle, all at once |
//! | `cone`, `cholesky` | the algebra of that |
//! | `multibody` | the vehicle, its rig and the free bodies, with their state |
//! | `stepping` | a step that is cut at impacts |
//! | `free_step` | a step without contacts |
//! | `margin`, `constraints` | the search for contacts, and a constraint for each contact and each stop |
//! | `impact`, `lasting` | contacts that bounce, and contacts that last |
//! | `integration`, `push_out` | the end of a step with impulses, and the overlaps that it left |
//! | `energy` | kinetic energy, and what impulses add to it |
//! | `touching`, `ties`, `scratch` | the buffers of a step: contacts, joints, and all of them |
//! | `warm_start`, `record` | the impulses of the last step, and all that lasts from step to step |
//! | `unsolved` | impulses that were not found |
//! | `doubts` | results that were taken although they are off, counted |
//! | `contacts` | when contacts begin and end |
//! | `corners` | corners of large faces that parry leaves out |
//! | `sheet` | triangles that touch with their borders |
//! | `rim`, `rolling` | a disc's rim on an edge, and rolling |
//! | `rig` | test rigs: joints and stops |

mod body;
mod cholesky;
mod cone;
mod constraints;
mod contacts;
mod corners;
mod direct;
mod doubts;
mod drive;
mod energy;
mod free_bodies;
mod free_step;
pub mod hull;
mod impact;
mod integration;
mod islands;
mod joint_forces;
mod joints;
mod lasting;
mod margin;
mod multibody;
mod poles;
mod push_out;
mod record;
mod rig;
mod rim;
mod rolling;
mod scratch;
mod sheet;
mod solver;
mod stepping;
mod ties;
mod touching;
mod unsolved;
mod warm_start;
mod world;

use crate::actuation::Battery;
use crate::airframe_state::AirframeState;
use crate::backend::{Backend, CONFIGURATION, ContactReport, Neighbour, NotePart, TRAFFIC_MAX};
use crate::newton_euler::{Accelerations, NewtonEuler};
use crate::saved::{Fingerprint, Saved, saved_fields};
use crate::snapshot::SnapshotError;
use crate::state::{RigidBody, State};
use contacts::Contacts;
use doubts::Doubts;
pub(crate) use free_bodies::Misfit;
use free_bodies::{FIRST_THING, FreeBodies};
use hull::Hull;
use multibody::{Changed, Multibody, Size};
use nalgebra::{UnitQuaternion, Vector3};
use record::Record;
use scenes::{Rig, Scene};
use scratch::Scratch;
use stepping::Motion;
use warm_start::Held;
use world::World;

/// A vehicle lower than this above its stand starts on its feet, at rest.
const ON_THE_GROUND_M: f64 = 1e-3;

/// A vehicle that is slower than this when it is placed on the ground or in a rig is carried there: tuned, no source.
const AT_REST_M_S: f64 = 0.01;

const NAME: &str = "rapier";

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
    hull: Hull,
    motion: Motion,
    effects: AirframeState,
    reaction: Reaction,
    /// Ticks since the start, for the schedules of drives.
    ticks: u64,
    /// The other vehicles, moved on within a tick.
    others: Vec<Neighbour>,
    /// The names of the scene's things.
    names: Vec<String>,
    /// Scene, rig and number of rotors, which no state of others fits.
    configuration: Fingerprint,
}

/// Change of the motion over the last tick by contacts and joints, against free flight.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Reaction {
    acceleration_W_m_s2: Vector3<f64>,
    angular_acceleration_W_rad_s2: Vector3<f64>,
    /// Force of the contacts along their normals.
    normal_W_N: Vector3<f64>,
}

saved_fields!(Reaction { acceleration_W_m_s2, angular_acceleration_W_rad_s2, normal_W_N });

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
        let free_bodies = FreeBodies::new(scene, mount_shift_B_m);
        let inertia_min_kg_m2 = vehicle.inertia_kg_m2.symmetric_eigenvalues().min();
        let world = World::new(&hull, scene, free_bodies.tied_pairs());
        let system = Multibody {
            size: Size { disc_radius_m: hull.disc_radius_m, inertia_min_kg_m2 },
            rig: scene.rig.map(|rig| Rig { mount_B_m: rig.mount_B_m + mount_shift_B_m, ..rig }),
            state: model.start(free_bodies.carrier_at_start(), 0.0),
            changed: Changed::default(),
            free_bodies,
            model,
        };
        let bodies = scene.bodies().count();
        let record = Record {
            contacts: Contacts::new(1 + scene.thing_count() + TRAFFIC_MAX, crash_speed_m_s),
            held: Held::new(bodies, scene.joints.len()),
            unsolved: None,
            doubts: Doubts::default(),
            is_vehicle_near_bodies: false,
        };
        let motion = Motion { system, world, record, scratch: Scratch::new(bodies) };
        let others = Vec::with_capacity(TRAFFIC_MAX);
        let names = scene.things().map(|thing| thing.name().to_owned()).collect();
        let fingerprint = motion.system.model.airframe().fingerprint(NAME);
        let configuration = fingerprint.with(numbers(&motion).into_iter());
        let reaction = Reaction::default();
        let mut rapier = Self { hull, motion, effects, reaction, ticks: 0, others, names, configuration };
        rapier.set_body(body);
        rapier
    }

    /// The number of the scene's box or mesh that the vehicle is partly inside of, if any.
    pub(crate) fn thing_around(&self) -> Option<usize> {
        self.motion.world.thing_around(&self.motion.system.state.body)
    }

    /// The numbers of the first two of the scene's bodies, things and the vehicle that start inside of each other, as
    /// `component::messages::Contact` counts them: 0 is the vehicle.
    pub(crate) fn overlap(&mut self) -> Option<[u32; 2]> {
        let Motion { world, system, .. } = &mut self.motion;
        world.overlap(&system.state.body, &system.free_bodies.states)
    }

    /// Returns a fault of the scene's joints, with the vehicle and the bodies where they are.
    pub(crate) fn misfit(&self) -> Option<Misfit> {
        self.motion.system.free_bodies.misfit(&self.motion.system.model, &self.motion.system.state.body)
    }

    /// Has the vehicle stand on its feet where it is too low to fly.
    fn put_down(&mut self) {
        let stands = self.stands();
        let height_m = &mut self.motion.system.state.body.position_W_m.z;
        if stands {
            *height_m = height_m.max(self.hull.stand_m());
        }
        self.motion.record.contacts.place(stands.then_some(world::GROUND), world::FEET);
    }

    /// Before anything has moved, a vehicle at rest is carried by the acceleration opposite to its free one: so its
    /// accelerometer reads g from the first tick on.
    fn lean_on_support(&mut self) {
        let free =
            self.motion.system.model.accelerations_under(&self.effects.actuation, &self.motion.system.state);
        let body = &self.motion.system.state.body;
        let gravity_W_m_s2 = Vector3::z() * self.motion.system.model.vehicle().gravity_m_s2;
        let free_W_m_s2 = body.attitude_WB * free.specific_force_B_m_s2 - gravity_W_m_s2;
        let is_at_rest = body.velocity_W_m_s.norm() < AT_REST_M_S;
        self.reaction = Reaction::default();
        if is_at_rest && self.is_carried(&free_W_m_s2) {
            self.reaction.acceleration_W_m_s2 = -free_W_m_s2;
        }
    }

    /// True if ground or rig keep the vehicle from accelerating freely.
    fn is_carried(&self, free_W_m_s2: &Vector3<f64>) -> bool {
        let vehicle = self.motion.system.model.vehicle();
        match &self.motion.system.rig {
            Some(rig) => {
                let lift_N = free_W_m_s2.z * vehicle.mass_kg;
                rig::holds(rig, &self.motion.system.state.body, lift_N, vehicle.gravity_m_s2)
            }
            None => self.stands() && free_W_m_s2.z < 0.0,
        }
    }

    fn stands(&self) -> bool {
        let upright = self.motion.system.state.body.attitude_WB * Vector3::z();
        self.motion.system.state.body.position_W_m.z < self.hull.stand_m() + ON_THE_GROUND_M
            && upright.z > 0.999
    }

    /// Moves the vehicle to hang from the rig's bearing.
    fn hang(&mut self, rig: &Rig) {
        self.motion.system.state.body = rig::hung(rig, &self.motion.system.state.body);
        self.motion.record.contacts.place(None, 0);
    }
}

/// Numbers that distinguish a scene and a vehicle from others.
fn numbers(motion: &Motion) -> Vec<f64> {
    let mut numbers = motion.world.numbers();
    numbers.extend(motion.system.free_bodies.numbers());
    numbers.extend(motion.system.rig.iter().flat_map(rig::numbers));
    numbers
}

impl Backend for Rapier {
    fn name(&self) -> &'static str {
        NAME
    }

    fn state(&self) -> &State {
        &self.motion.system.state
    }

    fn accelerations(&self) -> Accelerations {
        let free =
            self.motion.system.model.accelerations_under(&self.effects.actuation, &self.motion.system.state);
        let in_body =
            |v_W: &Vector3<f64>| self.motion.system.state.body.attitude_WB.inverse_transform_vector(v_W);
        let Reaction { acceleration_W_m_s2, angular_acceleration_W_rad_s2, .. } = &self.reaction;
        Accelerations {
            specific_force_B_m_s2: free.specific_force_B_m_s2 + in_body(acceleration_W_m_s2),
            angular_acceleration_B_rad_s2: free.angular_acceleration_B_rad_s2
                + in_body(angular_acceleration_W_rad_s2),
        }
    }

    fn step(&mut self, commands: &[f64], dt_s: f64, traffic: &[Neighbour]) {
        let airframe = self.motion.system.model.airframe();
        let actuation = *airframe.begin_tick(&mut self.effects, &self.motion.system.state, commands, dt_s);
        let span_s = dt_s / f64::from(self.motion.system.model.substeps());
        self.motion.record.contacts.begin_tick();
        self.motion.system.changed = Changed::default();
        let mut others = std::mem::take(&mut self.others);
        others.clear();
        others.extend_from_slice(traffic);
        let begin_s = self.ticks as f64 * dt_s;
        for number in 0..self.motion.system.model.substeps() {
            let time_s = begin_s + f64::from(number) * span_s;
            self.motion.substep(&actuation, [time_s, span_s], &mut others);
        }
        self.ticks += 1;
        self.others = others;
        let body = &mut self.motion.system.state.body;
        body.attitude_WB = UnitQuaternion::new_normalize(body.attitude_WB.into_inner());
        self.motion.system.model.airframe().settle(&actuation, &mut self.motion.system.state.rotors);
        self.reaction = Reaction {
            acceleration_W_m_s2: self.motion.system.changed.velocity_W_m_s / dt_s,
            angular_acceleration_W_rad_s2: self.motion.system.changed.spin_W_rad_s / dt_s,
            normal_W_N: self.motion.record.contacts.normal_impulse_W_N_s / dt_s,
        };
    }

    fn settle_rotors(&mut self, commands: &[f64]) {
        self.motion.system.state.rotors = self.motion.system.model.steady_each(commands);
        self.lean_on_support();
    }

    fn set_measured_voltage(&mut self, voltage_V: Option<f64>) {
        self.effects.measured_voltage_V = voltage_V;
    }

    fn set_body(&mut self, body: &RigidBody) {
        let before = self.motion.system.state.body;
        self.motion.system.state.body = *body;
        match self.motion.system.rig {
            Some(rig) => self.hang(&rig),
            None => self.put_down(),
        }
        let after = self.motion.system.state.body;
        self.motion.system.free_bodies.carry(&before, &after);
        self.motion.record.held.clear();
        self.lean_on_support();
    }

    fn bodies(&self) -> &[RigidBody] {
        &self.motion.system.free_bodies.states
    }

    fn body_objects(&self) -> &[u32] {
        &self.motion.system.free_bodies.objects
    }

    fn contact(&self) -> ContactReport {
        // All that free flight does not explain is the contacts' doing; in a rig and on joints, which push too, it is what
        // they push along their normals, friction left out.
        self.motion.record.contacts.report(&match self.motion.system.is_held() {
            true => self.reaction.normal_W_N,
            false => self.reaction.acceleration_W_m_s2 * self.motion.system.model.vehicle().mass_kg,
        })
    }

    fn trouble(&self) -> Option<String> {
        let named = |number: u32| self.names.get((number as usize).checked_sub(FIRST_THING as usize)?);
        let name = |number: u32| match number {
            0 => "the vehicle".to_owned(),
            world::GROUND => "the ground".to_owned(),
            _ => named(number).map_or("another vehicle".to_owned(), |name| format!("\"{name}\"")),
        };
        self.motion.record.unsolved.map(|unsolved| unsolved.message(name))
    }

    fn remark(&self) -> Option<String> {
        self.motion.record.doubts.remark()
    }

    fn battery(&self) -> Option<Battery> {
        self.motion.system.model.airframe().battery(&self.effects, &self.motion.system.state)
    }

    fn configuration(&self) -> u64 {
        self.configuration.and(self.motion.system.model.airframe().kinds()).number()
    }

    fn parts(&self, note: &mut dyn FnMut(&'static str, &dyn Saved)) {
        note(CONFIGURATION, &self.configuration);
        note("state", &self.motion.system.state);
        note("effects", &self.effects);
        note("reaction", &self.reaction);
        note("held", &self.motion.record.held);
        note("contacts", &self.motion.record.contacts);
        note("bodies", &self.motion.system.free_bodies.states);
        note("ticks", &self.ticks);
    }

    fn parts_mut(&mut self, note: &mut NotePart<'_>) -> Result<(), SnapshotError> {
        note(CONFIGURATION, &mut self.configuration)?;
        note("state", &mut self.motion.system.state)?;
        note("effects", &mut self.effects)?;
        note("reaction", &mut self.reaction)?;
        note("held", &mut self.motion.record.held)?;
        note("contacts", &mut self.motion.record.contacts)?;
        note("bodies", &mut self.motion.system.free_bodies.states)?;
        note("ticks", &mut self.ticks)?;
        self.motion.record.unsolved = None;
        Ok(())
    }
}
