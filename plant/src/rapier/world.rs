//! What stands and moves in rapier's world: the ground, the scene's boxes, the vehicle, the other vehicles; and
//! how rapier is set up to solve what they do to each other.
//!
//! Gravity is part of the push that [`super::Rapier`] gives the vehicle, so rapier's own is zero.

use super::body::{self, from_rapier, to_rapier};
use super::contacts::Sighting;
use super::hull::Hull;
use super::rig;
use crate::backend::Neighbour;
use crate::snapshot::{Snapshot, SnapshotError};
use crate::state::RigidBody;
use nalgebra::{Unit, Vector3};
use rapier3d_f64::dynamics::{
    FrictionModel, IntegrationParameters, RigidBody as Owner, RigidBodyBuilder, RigidBodyHandle,
};
use rapier3d_f64::geometry::{Collider, ColliderBuilder, ColliderHandle, ContactPair};
use rapier3d_f64::math::Vector;
use rapier3d_f64::parry::query::intersection_test;
use rapier3d_f64::parry::shape::TriMesh;
use rapier3d_f64::pipeline::PhysicsWorld;
use scenes::{Cuboid, Rig, Scene};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;
use vehicles::Vehicle;

/// What a collider is, as `bus::messages::Contact` numbers it; the vehicle's own colliders are 0.
pub(super) const GROUND: u32 = 1;
/// The vehicle's feet, as [`Sighting::part`] numbers its colliders.
pub(super) const FEET: u32 = 0b1111;
const FIRST_BOX: u32 = 2;
const FIRST_NEIGHBOUR: u32 = 1000;

/// Coulomb friction of feet and guards on floor and walls: tuned, no source.
const FRICTION: f64 = 0.5;
/// Fraction of the speed of approach that a bounce leaves: tuned, no source.
const RESTITUTION: f64 = 0.2;

/// Rapier's world and the handles into it.
pub(super) struct World {
    physics: PhysicsWorld,
    handles: Handles,
}

#[derive(Serialize, Deserialize)]
struct Handles {
    vehicle: RigidBodyHandle,
    hull: [ColliderHandle; 5],
    slider: Option<RigidBodyHandle>,
    neighbours: Vec<RigidBodyHandle>,
}

impl World {
    /// The world of `scene` with `vehicle` in it.
    pub(super) fn new(
        vehicle: &Vehicle,
        hull: &Hull,
        scene: &Scene,
        rig: Option<&Rig>,
        start: &RigidBody,
    ) -> Self {
        let mut physics = empty();
        let up = Unit::new_unchecked(Vector::Z);
        physics.insert_collider(solid(ColliderBuilder::halfspace(up), GROUND), None);
        for (cuboid, number) in scene.boxes.iter().zip(FIRST_BOX..) {
            physics.insert_collider(wall(cuboid, number), None);
        }
        for (mesh, number) in scene.meshes.iter().zip(FIRST_BOX + scene.boxes.len() as u32..) {
            // One that has no shape was refused when the scene was read.
            if let Ok(shape) = mesh.contact_shape() {
                physics.insert_collider(solid(ColliderBuilder::new(shape), number), None);
            }
        }
        let owner = physics.insert_body(body::owner(vehicle));
        body::write(&mut physics.bodies[owner], start);
        let [first, second, third, fourth] = hull.feet_B_m.map(|foot_B_m| {
            let ball = ColliderBuilder::ball(hull.foot_radius_m).translation(to_rapier(&foot_B_m));
            physics.insert_collider(solid(ball, 0), Some(owner))
        });
        let disc = physics.insert_collider(disc(hull, &hull.centre_B_m, 0), Some(owner));
        let slider = rig.and_then(|rig| rig::build(&mut physics, owner, rig));
        let hull = [first, second, third, fourth, disc];
        Self { physics, handles: Handles { vehicle: owner, hull, slider, neighbours: Vec::new() } }
    }

    /// The vehicle's pose and velocity.
    pub(super) fn body(&self) -> RigidBody {
        body::read(&self.physics.bodies[self.handles.vehicle])
    }

    /// Gives the vehicle another pose and velocity.
    pub(super) fn set_body(&mut self, body: &RigidBody) {
        body::write(&mut self.physics.bodies[self.handles.vehicle], body);
    }

    /// The rig's slider, if it has one.
    pub(super) fn slider(&mut self) -> Option<&mut Owner> {
        self.handles.slider.map(|slider| &mut self.physics.bodies[slider])
    }

    /// One step of `span_s` with this force and torque on the vehicle.
    pub(super) fn step(&mut self, force_W_N: &Vector3<f64>, torque_W_N_m: &Vector3<f64>, span_s: f64) {
        body::push(&mut self.physics.bodies[self.handles.vehicle], force_W_N, torque_W_N_m);
        self.physics.integration_parameters.dt = span_s;
        self.physics.step();
    }

    /// Has the other vehicles move, in the next step, to where they are `after_s` after they were seen. They are
    /// level, and nothing that this vehicle does moves them: each vehicle's own plant says where it is.
    pub(super) fn move_neighbours(&mut self, traffic: &[Neighbour], hull: &Hull, after_s: f64) {
        for neighbour in traffic.iter().skip(self.handles.neighbours.len()) {
            self.add_neighbour(neighbour, hull);
        }
        for (handle, neighbour) in self.handles.neighbours.iter().zip(traffic) {
            let there_W_m = neighbour.position_W_m + neighbour.velocity_W_m_s * after_s;
            self.physics.bodies[*handle].set_next_kinematic_translation(to_rapier(&there_W_m));
        }
    }

    fn add_neighbour(&mut self, neighbour: &Neighbour, hull: &Hull) {
        let place = to_rapier(&neighbour.position_W_m);
        let moved = RigidBodyBuilder::kinematic_position_based().translation(place).can_sleep(false);
        // Their centres of mass are not this one's.
        let shape = disc(hull, &Vector3::zeros(), FIRST_NEIGHBOUR + neighbour.number);
        self.handles.neighbours.push(self.physics.insert(moved, shape).0);
    }

    /// The world as components of a snapshot. What rapier keeps beside them is scratch of a single step.
    pub(super) fn write(&self, snapshot: Snapshot) -> Result<Snapshot, SnapshotError> {
        let physics = &self.physics;
        snapshot
            .with("handles", &self.handles)?
            .with("bodies", &physics.bodies)?
            .with("colliders", &physics.colliders)?
            .with("joints", &physics.impulse_joints)?
            .with("islands", &physics.islands)?
            .with("broad phase", &physics.broad_phase)?
            .with("narrow phase", &physics.narrow_phase)
    }

    /// The world that `write` wrote, of the same vehicle in the same scene as this one.
    pub(super) fn read(&self, snapshot: &Snapshot) -> Result<Self, SnapshotError> {
        let physics = PhysicsWorld {
            bodies: snapshot.get("bodies")?,
            colliders: snapshot.get("colliders")?,
            impulse_joints: snapshot.get("joints")?,
            islands: snapshot.get("islands")?,
            broad_phase: snapshot.get("broad phase")?,
            narrow_phase: snapshot.get("narrow phase")?,
            ..empty()
        };
        let world = Self { physics, handles: snapshot.get("handles")? };
        if !self.has_bodies_of(&world) {
            return Err(SnapshotError::Misfit("bodies"));
        }
        if self.has_colliders_of(&world) { Ok(world) } else { Err(SnapshotError::Misfit("colliders")) }
    }

    /// Whether all that has a handle is there, and the joints are as many.
    fn has_bodies_of(&self, other: &Self) -> bool {
        let (expected, handles, bodies) = (&self.handles, &other.handles, &other.physics.bodies);
        let moving = [handles.vehicle].into_iter().chain(handles.slider).chain(handles.neighbours.clone());
        (expected.vehicle, expected.slider, expected.hull) == (handles.vehicle, handles.slider, handles.hull)
            && moving.into_iter().all(|handle| bodies.get(handle).is_some())
            && bodies.len() - handles.neighbours.len()
                == self.physics.bodies.len() - expected.neighbours.len()
            && other.physics.impulse_joints.len() == self.physics.impulse_joints.len()
    }

    /// Whether the vehicle is of the same shape and what stands is in the same places. Each neighbour has one
    /// collider.
    fn has_colliders_of(&self, other: &Self) -> bool {
        let count = |world: &Self| world.physics.colliders.len() - world.handles.neighbours.len();
        let mut lasting =
            self.physics.colliders.iter().filter(|(_, shape)| shape.user_data < FIRST_NEIGHBOUR.into());
        count(self) == count(other)
            && lasting.all(|(handle, shape)| {
                other.physics.colliders.get(handle).is_some_and(|other| is_same(shape, other))
            })
    }

    /// The number of the first of the scene's boxes and meshes that the vehicle, placed as `body`, is partly inside of.
    pub(super) fn thing_around(&self, body: &RigidBody) -> Option<usize> {
        let pose = body::pose(body);
        let colliders = &self.physics.colliders;
        let parts = self.handles.hull.map(|handle| &colliders[handle]);
        let meets = |shape: &Collider, part: &Collider| {
            let place = part.position_wrt_parent().map_or(pose, |within| pose * *within);
            let found = intersection_test(&place, part.shape(), shape.position(), shape.shape());
            found.is_ok_and(|found| found.intersecting)
        };
        let boxes = colliders.iter().map(|(_, collider)| collider).filter(|it| it.parent().is_none());
        let mut around = boxes.filter(|shape| parts.iter().any(|part| meets(shape, part)));
        around.find_map(|shape| usize::try_from(shape.user_data.checked_sub(FIRST_BOX.into())?).ok())
    }

    /// Everything near the vehicle, as the last step found it.
    pub(super) fn sightings(&self) -> impl Iterator<Item = Sighting> + '_ {
        let parts = self.handles.hull.iter().enumerate();
        parts.flat_map(move |(place, part)| {
            let pairs = self.physics.narrow_phase.contact_pairs_with(*part);
            pairs.filter_map(move |pair| self.sighting(pair, 1 << place))
        })
    }

    fn sighting(&self, pair: &ContactPair, part: u32) -> Option<Sighting> {
        let (manifold, contact) = pair.find_deepest_contact()?;
        let (first, second) =
            (&self.physics.colliders[pair.collider1], &self.physics.colliders[pair.collider2]);
        let vehicle_is_first = self.handles.hull.contains(&pair.collider1);
        let other = if vehicle_is_first { second } else { first };
        let outwards_W = from_rapier(first.position().rotation * manifold.local_n1);
        let other_body = other.parent().map(|handle| &self.physics.bodies[handle]);
        Some(Sighting {
            object: other.user_data as u32,
            part,
            point_W_m: from_rapier(first.position().transform_point(contact.local_p1)),
            towards_vehicle_W: if vehicle_is_first { -outwards_W } else { outwards_W },
            gap_m: contact.dist,
            impulse_N_s: pair.total_impulse_magnitude(),
            velocity_W_m_s: other_body.map_or(Vector3::zeros(), |body| from_rapier(body.linvel())),
        })
    }
}

/// Whether two colliders are the same part of a vehicle, or the same box in the same place.
fn is_same(a: &Collider, b: &Collider) -> bool {
    a.user_data == b.user_data
        && a.parent() == b.parent()
        && a.position_wrt_parent() == b.position_wrt_parent()
        && (a.parent().is_some() || a.position() == b.position())
        && a.shape().as_cuboid() == b.shape().as_cuboid()
        && a.shape().as_ball() == b.shape().as_ball()
        && a.shape().as_cylinder() == b.shape().as_cylinder()
        && a.shape().as_trimesh().map(TriMesh::vertices) == b.shape().as_trimesh().map(TriMesh::vertices)
        && hull_points(a) == hull_points(b)
}

fn hull_points(collider: &Collider) -> Option<&[Vector]> {
    collider.shape().as_convex_polyhedron().map(|hull| hull.points())
}

fn empty() -> PhysicsWorld {
    PhysicsWorld { gravity: Vector::ZERO, integration_parameters: settings(), ..Default::default() }
}

/// Contacts are found anew at every step and solved point by point: the shortcuts that rapier takes for large
/// worlds would let forces and snapshots depend on what was found some steps ago. At 1 kHz nothing that flies
/// crosses a wall within a step, so there is no continuous collision detection either.
fn settings() -> IntegrationParameters {
    IntegrationParameters {
        contact_clustering: false,
        contact_recycling: false,
        friction_model: FrictionModel::Coulomb,
        max_ccd_substeps: 0,
        ..Default::default()
    }
}

fn solid(shape: ColliderBuilder, object: u32) -> ColliderBuilder {
    shape.density(0.0).friction(FRICTION).restitution(RESTITUTION).user_data(object.into())
}

fn wall(cuboid: &Cuboid, object: u32) -> ColliderBuilder {
    let [x, y, z]: [f64; 3] = cuboid.half_extents_m.into();
    let shape = ColliderBuilder::cuboid(x, y, z).translation(to_rapier(&cuboid.centre_W_m));
    solid(shape.rotation(Vector::Z * cuboid.yaw_rad), object)
}

/// Rapier's cylinders lie along y.
fn disc(hull: &Hull, centre_m: &Vector3<f64>, object: u32) -> ColliderBuilder {
    let shape = ColliderBuilder::cylinder(hull.disc_half_m, hull.disc_radius_m);
    solid(shape.translation(to_rapier(centre_m)).rotation(Vector::X * FRAC_PI_2), object)
}
