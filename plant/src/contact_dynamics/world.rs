//! Surroundings of the vehicle, still and moving, as rapier's colliders; and the points of them that are near.
//!
//! Rapier finds where two shapes are near each other. Its memory from one search to the next is cleared, so that the
//! result depends on the poses alone.

use super::body::{self, from_rapier, to_rapier};
use super::corners::{self, Corner};
use super::free_bodies::{FIRST_BODY, FIRST_THING, VEHICLE, WORLD};
use super::hull::Hull;
use super::rim;
use super::sheet::{Borders, Manifold};
use crate::backend::Neighbour;
use crate::state::RigidBody;
use nalgebra::{Unit, Vector3};
use rapier3d_f64::geometry::{Collider, ColliderBuilder, Shape};
use rapier3d_f64::math::{Pose, Vector};
use rapier3d_f64::parry::bounding_volume::{Aabb, BoundingVolume};
use rapier3d_f64::parry::query::{
    DefaultQueryDispatcher, PersistentQueryDispatcher, contact, intersection_test,
};
use scenes::{Scene, Surface, Thing};
use std::f64::consts::FRAC_PI_2;

/// Number of the ground, as `component::messages::Contact` counts objects; the vehicle's own colliders are 0.
pub(super) const GROUND: u32 = 1;
/// The vehicle's feet, as [`Near::part`] numbers its colliders.
pub(super) const FEET: u32 = 0b1111;
/// The vehicle's disc.
pub(super) const DISC: u32 = 0b1_0000;
const FIRST_NEIGHBOUR: u32 = 1000;

/// Shapes that overlap by no more than this touch each other: tuned, no source.
const OVERLAP_M: f64 = 1e-4;

/// Overlap that is rounding. Tuned, no source.
const ROUNDING_M: f64 = 1e-9;

/// The vehicle and its surroundings.
pub(super) struct World {
    /// The ground, then the still things.
    things: Vec<Still>,
    bodies: Vec<Moving>,
    /// Pairs of bodies that a joint keeps from touching each other.
    tied: Vec<[usize; 2]>,
    /// The vehicle's feet and its disc, seen from its centre of mass.
    hull: [Collider; 5],
    /// Another vehicle, at the origin: all are taken to be alike.
    other: Collider,
    /// Greatest distance of any point of the hull from the centre of mass.
    reach_m: f64,
    manifolds: Vec<Manifold>,
}

struct Still {
    collider: Collider,
    around: Aabb,
    /// Borders of a mesh that has some.
    borders: Option<Borders>,
}

impl Still {
    fn new(collider: Collider) -> Self {
        let borders = collider.shape().as_trimesh().and_then(Borders::of);
        Self { around: collider.compute_aabb(), borders, collider }
    }

    /// As [`meet`] notes them, the points where a part, second, is near it.
    fn meet(
        &self,
        part: (&Collider, &Pose),
        margin_m: f64,
        manifolds: &mut Vec<Manifold>,
        note: impl FnMut(Near),
    ) {
        let thing = (&self.collider, self.collider.position());
        match self.borders.as_ref().zip(self.collider.shape().as_trimesh()) {
            Some((borders, mesh)) => {
                let between = thing.1.inv_mul(part.1);
                borders.manifolds(mesh, (part.0.shape(), &between), margin_m, manifolds);
                tell(thing, part, margin_m, manifolds, note);
            }
            None => meet(thing, part, margin_m, manifolds, note),
        }
    }
}

/// A free body: its collider seen from its centre of mass.
struct Moving {
    collider: Collider,
    reach_m: f64,
}

/// A point where the vehicle or a free body may touch something.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near {
    /// Number of the object, as `component::messages::Contact` counts them.
    pub object: u32,
    /// The numbers of the two bodies: the object, and the body that is near it.
    pub bodies: [usize; 2],
    /// Vehicle's colliders that it is near: a bit for each; 0 of a free body.
    pub part: u32,
    /// Index of the other vehicle, if it is one, counted as they were given.
    pub neighbour: Option<usize>,
    /// Point at which the two are nearest to each other.
    pub point_W_m: Vector3<f64>,
    /// The normal, which points from the first of the bodies to the second.
    pub normal_W: Vector3<f64>,
    /// Distance between the two; negative where they overlap.
    pub gap_m: f64,
    pub friction: f64,
    pub restitution: f64,
}

impl World {
    /// The world of `scene` with a vehicle in it; bodies that are `tied` do not touch each other.
    pub(super) fn new(hull: &Hull, scene: &Scene, tied: Vec<[usize; 2]>) -> Self {
        let up = Unit::new_unchecked(Vector::Z);
        let ground = solid(ColliderBuilder::halfspace(up), GROUND, &scene.surface);
        let still = scene.things().zip(FIRST_THING..).filter(|(thing, _)| thing.body().is_none());
        let still = still.filter_map(|(thing, number)| collider(&thing, number));
        let still = [ground].into_iter().chain(still).map(|it| it.build());
        let things = still.map(Still::new);
        let foot = |foot_B_m: Vector3<f64>| {
            let ball = ColliderBuilder::ball(hull.foot_radius_m).translation(to_rapier(&foot_B_m));
            solid(ball, 0, &scene.surface).build()
        };
        let [first, second, third, fourth] = hull.feet_B_m.map(foot);
        let disc = |centre_m: &Vector3<f64>| solid(disc(hull, centre_m), 0, &scene.surface).build();
        Self {
            things: things.collect(),
            hull: [first, second, third, fourth, disc(&hull.centre_B_m)],
            // Their centres of mass are not this one's.
            other: disc(&Vector3::zeros()),
            reach_m: hull.reach_m(),
            bodies: scene
                .things()
                .zip(FIRST_THING..)
                .filter_map(|(thing, number)| Moving::new(&thing, number))
                .collect(),
            tied,
            manifolds: Vec::new(),
        }
    }

    /// Returns the greatest distance of any point of the vehicle from its centre of mass.
    pub(super) fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// True if nothing is nearer than `margin_m` to a vehicle at `position_W_m` in any attitude, or gets nearer
    /// within `span_s`.
    pub(super) fn is_clear(
        &self,
        position_W_m: &Vector3<f64>,
        others: &[Neighbour],
        span_s: f64,
        margin_m: f64,
    ) -> bool {
        let room_m = self.reach_m + margin_m;
        let point = to_rapier(position_W_m);
        let is_far_from = |it: &Still| {
            (point.clamp(it.around.mins, it.around.maxs) - point).length_squared() > room_m * room_m
        };
        // As large as this one, and their centres of mass may be off their middles.
        let is_far = |other: &Neighbour| {
            let room_m = room_m + 2.0 * self.reach_m + other.velocity_W_m_s.norm() * span_s;
            (other.position_W_m - position_W_m).norm_squared() > room_m * room_m
        };
        position_W_m.z > room_m && self.things[1..].iter().all(is_far_from) && others.iter().all(is_far)
    }

    /// Every point within `margin_m` where a vehicle at `body` may touch something, into `found`.
    pub(super) fn find_near(
        &mut self,
        body: &RigidBody,
        others: &[Neighbour],
        margin_m: f64,
        found: &mut Vec<Near>,
    ) {
        let pose = body::pose(body);
        let Self { things, hull, other, manifolds, bodies, .. } = self;
        let first_other = FIRST_BODY + bodies.len();
        found.clear();
        for (place, part) in hull.iter().enumerate() {
            let part_pose = pose * *part.position();
            let around = part.shape().compute_aabb(&part_pose).loosened(margin_m);
            for (number, vehicle) in others.iter().enumerate() {
                let there = Pose::from_translation(to_rapier(&vehicle.position_W_m)) * *other.position();
                if other.shape().compute_aabb(&there).intersects(&around) {
                    meet((other, &there), (part, &part_pose), margin_m, manifolds, |contact| {
                        let object = FIRST_NEIGHBOUR + vehicle.number;
                        let (neighbour, bodies) = (Some(number), [first_other + number, VEHICLE]);
                        found.push(Near { part: 1 << place, object, neighbour, bodies, ..contact });
                    });
                }
            }
            for thing in things.iter().filter(|thing| thing.around.intersects(&around)) {
                thing.meet((part, &part_pose), margin_m, manifolds, |contact| {
                    found.push(Near { part: 1 << place, ..contact });
                });
            }
        }
    }

    /// The same for points where free bodies may touch each other, the vehicle or still things. The bodies
    /// are at `states`, the vehicle at `vehicle`. The points follow those that are `found` already.
    pub(super) fn find_near_bodies(
        &mut self,
        vehicle: &RigidBody,
        states: &[RigidBody],
        margin_m: f64,
        found: &mut Vec<Near>,
    ) {
        let Self { things, hull, bodies, manifolds, tied, .. } = self;
        let is_tied = |one: usize, other: usize| tied.contains(&[one.min(other), one.max(other)]);
        let vehicle_pose = body::pose(vehicle);
        for (number, (moving, state)) in bodies.iter().zip(states).enumerate() {
            let this = FIRST_BODY + number;
            let pose = body::pose(state);
            let place = pose * *moving.collider.position();
            let around = moving.collider.shape().compute_aabb(&place).loosened(margin_m);
            for thing in things.iter().filter(|thing| thing.around.intersects(&around)) {
                thing.meet((&moving.collider, &place), margin_m, manifolds, |contact| {
                    found.push(pair_surface(Near { bodies: [WORLD, this], ..contact }, &moving.collider));
                });
            }
            for (other, (collider, state)) in bodies.iter().zip(states).enumerate().take(number) {
                let (collider, other) = (&collider.collider, FIRST_BODY + other);
                let there = body::pose(state) * *collider.position();
                let is_near = collider.shape().compute_aabb(&there).intersects(&around);
                if is_near && !is_tied(other, this) {
                    meet((collider, &there), (&moving.collider, &place), margin_m, manifolds, |contact| {
                        found.push(pair_surface(Near { bodies: [other, this], ..contact }, &moving.collider));
                    });
                }
            }
            for (part, hull) in hull.iter().enumerate().filter(|_| !is_tied(VEHICLE, this)) {
                let there = vehicle_pose * *hull.position();
                if hull.shape().compute_aabb(&there).intersects(&around) {
                    meet((&moving.collider, &place), (hull, &there), margin_m, manifolds, |contact| {
                        found.push(Near { bodies: [this, VEHICLE], part: 1 << part, ..contact });
                    });
                }
            }
        }
    }

    /// The first two that overlap, as `component::messages::Contact` numbers them: a free body with another, with a
    /// still thing, or with the vehicle, 0.
    pub(super) fn overlap(&mut self, vehicle: &RigidBody, states: &[RigidBody]) -> Option<[u32; 2]> {
        let mut found = Vec::new();
        self.find_near_bodies(vehicle, states, 0.0, &mut found);
        let near = found.iter().find(|near| near.gap_m < -OVERLAP_M)?;
        let second = self.bodies.get(near.bodies[1].wrapping_sub(FIRST_BODY));
        Some([near.object, second.map_or(0, |body| body.collider.user_data as u32)])
    }

    /// Iterates over the greatest distance of any point of each free body from its centre of mass.
    pub(super) fn body_reaches_m(&self) -> impl Iterator<Item = f64> {
        self.bodies.iter().map(|body| body.reach_m)
    }

    /// Numbers that distinguish this scene and vehicle from others: places, surfaces, shapes.
    pub(super) fn numbers(&self) -> Vec<f64> {
        let things = self.things.iter().map(|thing| &thing.collider);
        let bodies = self.bodies.iter().map(|body| &body.collider);
        things.chain(bodies).chain(&self.hull).flat_map(numbers).collect()
    }

    /// The number of the first of the scene's boxes and meshes that the vehicle, placed as `body`, is partly inside of.
    pub(super) fn thing_around(&self, body: &RigidBody) -> Option<usize> {
        let pose = body::pose(body);
        let meets = |thing: &Collider, part: &Collider| {
            overlap((part.shape(), &(pose * *part.position())), (thing.shape(), thing.position()), OVERLAP_M)
        };
        let mut things = self.things.iter().skip(1).map(|thing| &thing.collider);
        let around = things.find(|thing| self.hull.iter().any(|part| meets(thing, part)))?;
        usize::try_from(around.user_data.checked_sub(FIRST_THING.into())?).ok()
    }
}

/// Passes to `note` every point where a part, second, is within `margin_m` of something, first.
fn meet(
    thing: (&Collider, &Pose),
    part: (&Collider, &Pose),
    margin_m: f64,
    manifolds: &mut Vec<Manifold>,
    note: impl FnMut(Near),
) {
    let ((thing, thing_pose), (part, part_pose)) = (thing, part);
    let between = thing_pose.inv_mul(part_pose);
    if thing.shape().as_composite_shape().is_some() {
        manifolds.clear();
    } else {
        // One is enough. Beside its points it would remember where the search before began.
        manifolds.truncate(1);
        for manifold in manifolds.iter_mut() {
            manifold.clear();
            (manifold.local_n1, manifold.local_n2) = (Vector::ZERO, Vector::ZERO);
        }
    }
    let (shape, part_shape) = (thing.shape(), part.shape());
    let found =
        DefaultQueryDispatcher.contact_manifolds(&between, shape, part_shape, margin_m, manifolds, &mut None);
    // Every shape of a scene and a hull can be asked.
    debug_assert!(found.is_ok(), "{:?} and {:?}", shape.shape_type(), part_shape.shape_type());
    tell((thing, thing_pose), (part, part_pose), margin_m, manifolds, note);
}

/// Notes every point of `manifolds` that is within the margin, and the rim's ends and the corners that they lack.
fn tell(
    thing: (&Collider, &Pose),
    part: (&Collider, &Pose),
    margin_m: f64,
    manifolds: &mut [Manifold],
    mut note: impl FnMut(Near),
) {
    drop_false_depths(thing, part, manifolds);
    for manifold in &*manifolds {
        let normal = thing.1.rotation * manifold.local_n1;
        let mut tell = |ends: [Vector; 2], gap_m: f64| note(near(thing.0, normal, ends, gap_m));
        for point in manifold.points.iter().filter(|point| point.dist < margin_m) {
            let ends = [thing.1.transform_point(point.local_p1), part.1.transform_point(point.local_p2)];
            tell(ends, point.dist);
        }
        if !manifold.points.is_empty() {
            let found = manifold.points.iter().map(|point| part.1.transform_point(point.local_p2));
            rim::missing_ends(thing, part, normal, found, |ends, gap_m| {
                if gap_m < margin_m {
                    tell(ends, gap_m);
                }
            });
        }
    }
    corners::missing(thing, part, margin_m, manifolds, |Corner { ends, normal, gap_m }| {
        note(near(thing.0, normal, ends, gap_m));
    });
}

/// A point where the vehicle may touch a still `thing`, between the nearest points of both.
fn near(thing: &Collider, normal: Vector, ends: [Vector; 2], gap_m: f64) -> Near {
    Near {
        object: thing.user_data as u32,
        part: 0,
        bodies: [WORLD, VEHICLE],
        neighbour: None,
        point_W_m: (from_rapier(ends[0]) + from_rapier(ends[1])) / 2.0,
        normal_W: from_rapier(normal),
        gap_m,
        friction: thing.friction(),
        restitution: thing.restitution(),
    }
}

/// Drops points that are deep between two shapes that only touch. Where a corner of a triangle is touched,
/// parry may turn the normal to the triangle's face. Along that normal the part may reach far beyond it.
/// For two equal prisms that stand on each other, it may take the normal of a side that both share.
fn drop_false_depths(thing: (&Collider, &Pose), part: (&Collider, &Pose), manifolds: &mut [Manifold]) {
    let shape = thing.0.shape();
    // Round shapes are told rightly, and to ask again takes time and memory.
    let is_polyhedron =
        |shape: &dyn Shape| shape.as_cuboid().is_some() || shape.as_convex_polyhedron().is_some();
    if shape.as_trimesh().is_none() && !(is_polyhedron(shape) && is_polyhedron(part.0.shape())) {
        return;
    }
    for manifold in manifolds {
        if !manifold.points.iter().any(|point| point.dist < -OVERLAP_M) {
            continue;
        }
        let triangle = shape.as_trimesh().map(|mesh| mesh.triangle(manifold.subshape1));
        let one: &dyn Shape = triangle.as_ref().map_or(shape, |triangle| triangle);
        if !overlap((one, thing.1), (part.0.shape(), part.1), ROUNDING_M) {
            manifold.points.retain(|point| point.dist >= -OVERLAP_M);
        }
    }
}

/// True if two shapes overlap by more than `least_m`.
fn overlap((one, pose): (&dyn Shape, &Pose), (other, other_pose): (&dyn Shape, &Pose), least_m: f64) -> bool {
    let met = intersection_test(pose, one, other_pose, other);
    // Searched within a distance, so that only a search that fails finds nothing.
    let deepest = || contact(pose, one, other_pose, other, OVERLAP_M).ok().flatten();
    met.is_ok_and(|found| found.intersecting) && deepest().is_none_or(|found| found.dist < -least_m)
}

fn numbers(collider: &Collider) -> Vec<f64> {
    let (pose, shape) = (collider.position(), collider.shape());
    let mut numbers = vec![collider.user_data as f64, collider.friction(), collider.restitution()];
    let mut note = |vector: Vector| numbers.extend([vector.x, vector.y, vector.z]);
    note(pose.translation);
    note(pose.rotation * Vector::X);
    note(pose.rotation * Vector::Y);
    let around = shape.compute_local_aabb();
    if shape.as_halfspace().is_none() {
        note(around.mins);
        note(around.maxs);
    }
    let corners = shape.as_trimesh().map(|mesh| mesh.vertices());
    let corners = corners.or_else(|| shape.as_convex_polyhedron().map(|hull| hull.points()));
    corners.into_iter().flatten().for_each(|corner| note(*corner));
    numbers
}

fn solid(shape: ColliderBuilder, object: u32, surface: &Surface) -> ColliderBuilder {
    let shape = shape.density(0.0).user_data(object.into());
    shape.friction(surface.friction).restitution(surface.restitution)
}

/// The surface of two that have one each: the geometric mean of the frictions and the larger restitution, as Box2D has it.
fn pair_surface(near: Near, second: &Collider) -> Near {
    let friction = (near.friction * second.friction()).sqrt();
    Near { friction, restitution: near.restitution.max(second.restitution()), ..near }
}

/// The thing as it stands at the start; none of a mesh without a shape, which was refused when the scene was read.
fn collider(thing: &Thing, number: u32) -> Option<ColliderBuilder> {
    Some(match thing {
        Thing::Cuboid(cuboid) => {
            let [x, y, z]: [f64; 3] = cuboid.half_extents_m.into();
            let shape = ColliderBuilder::cuboid(x, y, z).translation(to_rapier(&cuboid.centre_W_m));
            solid(shape.rotation(Vector::Z * cuboid.yaw_rad), number, &cuboid.surface)
        }
        Thing::Ball(ball) => {
            let shape = ColliderBuilder::ball(ball.radius_m).translation(to_rapier(&ball.centre_W_m));
            solid(shape, number, &ball.surface)
        }
        Thing::Mesh(mesh) => solid(ColliderBuilder::new(mesh.contact_shape().ok()?), number, &mesh.surface),
    })
}

impl Moving {
    fn new(thing: &Thing, number: u32) -> Option<Self> {
        let start = thing.body()?.start();
        let mut collider = collider(thing, number)?.build();
        let centre = Pose::from_parts(to_rapier(&start.position_W_m), body::rotation(&start.attitude_W));
        let place = centre.inv_mul(collider.position());
        collider.set_position(place);
        let around = collider.compute_aabb();
        let reach_m = around.mins.abs().max(around.maxs.abs()).length();
        Some(Self { collider, reach_m })
    }
}

/// Rapier's cylinders lie along y.
fn disc(hull: &Hull, centre_m: &Vector3<f64>) -> ColliderBuilder {
    let shape = ColliderBuilder::cylinder(hull.disc_half_m, hull.disc_radius_m);
    shape.translation(to_rapier(centre_m)).rotation(Vector::X * FRAC_PI_2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::airframe::Airframe;

    fn given(value: &str, unit: &str) -> String {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
    }

    /// The corners, and the faces, of an upright prism that is 0.2 m high, or of a table.
    fn obj(shape: &str) -> String {
        let faces = "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
        let (half_m, heights_m) = if shape == "prism.obj" { (0.1, [-0.1, 0.1]) } else { (0.3, [0.0, 0.5]) };
        let corners = heights_m.map(|z| {
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            corners.map(|(x, y)| format!("v {} {} {z}\n", x * half_m, y * half_m)).concat()
        });
        format!("{}{faces}", corners.concat())
    }

    fn mesh(name: &str, position: [f64; 3], solid: &str, more: &str) -> String {
        let (position, scale) = (given(&format!("{position:?}"), "m"), given("1", "m"));
        let keys = format!("position = {position}\nscale = {scale}\nsolid = \"{solid}\"\n{more}");
        format!("[[meshes]]\nname = \"{name}\"\nfile = \"{name}.obj\"\n{keys}")
    }

    /// The world of a scene, and its bodies where they start.
    fn world(parts: &[String]) -> (World, Vec<RigidBody>) {
        let text = format!("name = \"test\"\n{}", parts.concat());
        let read = |path: &std::path::Path| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            Ok(obj(name).into_bytes())
        };
        let scene = Scene::parse_with(&text, "test.toml", &read);
        let scene = scene.unwrap_or_else(|error| panic!("{error}\n{text}"));
        let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let start = |body: &scenes::FreeBody| RigidBody {
            attitude_WB: body.attitude_W,
            ..RigidBody::level_at(body.centre_W_m)
        };
        let states = scene.bodies().map(|(_, body)| start(body)).collect();
        (World::new(&Hull::of(&Airframe::new(vehicle)), &scene, Vec::new()), states)
    }

    /// The body's top overhangs a corner of the table, where a triangle of the table's side told of a depth of centimetres.
    #[test]
    fn a_body_that_touches_a_mesh_is_not_inside_of_it() {
        let far = RigidBody::level_at(Vector3::z() * 50.0);
        for (x_m, y_m) in [(0.25, -0.25), (0.278, -0.22), (0.0, 0.31), (0.0, 0.0)] {
            for yaw in ["0", "3.2", "20", "45"] {
                for height_m in [0.0, 0.4, 0.794] {
                    for (deep_m, expected) in [(0.0, None), (0.01, Some([3, 2]))] {
                        let more = format!("mass = {}\nyaw = {}\n", given("1", "kg"), given(yaw, "deg"));
                        let place = [x_m, y_m, height_m + 0.5 + 0.1 - deep_m];
                        let parts = [
                            mesh("prism", place, "convex", &more),
                            mesh("table", [0.0, 0.0, height_m], "triangles", ""),
                        ];
                        let (mut world, states) = world(&parts);
                        let found = world.overlap(&far, &states);
                        assert_eq!(found, expected, "{place:?}, turned by {yaw} deg");
                    }
                }
            }
        }
    }

    #[test]
    fn a_vehicle_that_stands_on_a_mesh_is_not_inside_of_it() {
        for solid in ["convex", "triangles"] {
            let (world, _) = world(&[mesh("table", [0.0, 0.0, 0.2], solid, "")]);
            for (off_m, expected) in [(0.0, None), (1e-9, None), (-1e-9, None), (-0.005, Some(0))] {
                let body = RigidBody::level_at(Vector3::z() * (0.7 + 0.06 + off_m));
                assert_eq!(world.thing_around(&body), expected, "{solid}, {off_m} m");
            }
        }
    }
}
