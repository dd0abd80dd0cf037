//! Corners of convex meshes that parry leaves out.
//!
//! Parry finds contacts of the first four corners of a face. A face with more corners would stand on these alone, and its other
//! corners would sink. A box on a face with more would stand on one point. This module adds the corners of both, at most
//! [`LARGEST`] for two that touch, so that the buffers of a step suffice for any mesh.

use super::rim::gap;
use super::sheet::Manifold;
use rapier3d_f64::geometry::{Collider, TriMesh};
use rapier3d_f64::math::{Pose, Vector};
use rapier3d_f64::parry::query::PointQuery;
use rapier3d_f64::parry::shape::{ConvexPolyhedron, Triangle};
use std::f64::consts::TAU;

/// Corners of a face that parry uses.
const CORNERS: u32 = 4;

/// Points that are nearer to each other are one. Tuned, no source.
const SAME_M: f64 = 1e-4;

/// Cosine of the angle between two normals of one point above which the two are one contact. Tuned, no source.
const SAME_WAY: f64 = 0.999;

/// Directions around the normal in which the extreme corner is kept: each corner of a face with sixteen. Tuned, no source.
const DIRECTIONS: usize = 16;

/// Corners that are kept because they are the lowest: the one that a body rolls over, and its neighbours.
const LOWEST: usize = 3;

/// Corners of a face that are kept, beside those that parry uses.
pub(super) const LARGEST: usize = DIRECTIONS + LOWEST;

/// Faces of a mesh of triangles on which corners of one body are kept. Tuned, no source.
const FACES: usize = 8;

/// Cosine of the angle between two triangles above which they are one face. Tuned, no source.
const SAME_FACE: f64 = 1.0 - 1e-6;

/// A corner this far beside a triangle is above it: rounding. Tuned, no source.
const BESIDE_M: f64 = 1e-6;

/// A contact at a corner.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    /// The nearest points of the thing and of the part.
    pub ends: [Vector; 2],
    /// The normal, which points from the thing to the part.
    pub normal: Vector,
    pub gap_m: f64,
}

impl Corner {
    /// A corner of the part.
    fn of_part(place: Vector, normal: Vector, gap_m: f64) -> Self {
        Self { ends: [place - normal * gap_m, place], normal, gap_m }
    }

    /// A corner of the thing.
    fn of_thing(place: Vector, normal: Vector, gap_m: f64) -> Self {
        Self { ends: [place, place + normal * gap_m], normal, gap_m }
    }

    /// True if this is the contact at a `place` on the part along `normal`.
    fn is_at(&self, place: Vector, normal: Vector) -> bool {
        (self.ends[1] - place).length() <= SAME_M && self.normal.dot(normal) > SAME_WAY
    }
}

/// Passes corners of two solids, one of which has a large face, to `tell`. These are the corners within
/// `margin_m` that are not among the points of `manifolds`.
pub(super) fn missing(
    thing: (&Collider, &Pose),
    part: (&Collider, &Pose),
    margin_m: f64,
    manifolds: &[Manifold],
    mut tell: impl FnMut(Corner),
) {
    if !has_large_face(thing.0) && !has_large_face(part.0) {
        return;
    }
    if let Some(mesh) = thing.0.shape().as_trimesh() {
        on_triangles((mesh, thing.1), part, margin_m, manifolds, tell);
        return;
    }
    // There is one.
    for manifold in manifolds {
        missing_of_one(thing, part, margin_m, manifold, &mut tell);
    }
}

/// The same between two solids, of a corner that belongs to both once.
fn missing_of_one(
    thing: (&Collider, &Pose),
    part: (&Collider, &Pose),
    margin_m: f64,
    manifold: &Manifold,
    tell: impl FnMut(Corner),
) {
    let normal = thing.1.rotation * manifold.local_n1;
    // No normal was found.
    if normal == Vector::ZERO {
        return;
    }
    let found = manifold.points.iter().map(|point| part.1.transform_point(point.local_p2));
    let is_new = |place: Vector| found.clone().all(|point| (point - place).length() > SAME_M);
    let mut kept = Kept::around(normal, part.1);
    for (place, gap_m) in near(part, thing, normal, margin_m) {
        if is_new(place) {
            kept.add(Corner::of_part(place, normal, gap_m));
        }
    }
    for (place, gap_m) in near(thing, part, -normal, margin_m) {
        if is_new(place + normal * gap_m) {
            kept.add(Corner::of_thing(place, normal, gap_m));
        }
    }
    kept.each(tell);
}

/// The same of the part's corners over a mesh of triangles: each once for a face, however many triangles that has.
fn on_triangles(
    (mesh, pose): (&TriMesh, &Pose),
    part: (&Collider, &Pose),
    margin_m: f64,
    manifolds: &[Manifold],
    mut tell: impl FnMut(Corner),
) {
    let points = manifolds.iter().flat_map(|manifold| {
        let normal = pose.rotation * manifold.local_n1;
        manifold.points.iter().map(move |point| (part.1.transform_point(point.local_p2), normal))
    });
    let (mut faces, mut count) = ([Vector::ZERO; FACES], 0);
    for manifold in manifolds {
        // Over the edge to another face a triangle pushes in another direction.
        let Some((_, face)) = facing(mesh, manifold, manifold.local_n1, SAME_WAY) else { continue };
        if count == FACES || faces[..count].iter().any(|other| other.dot(face) > SAME_FACE) {
            continue;
        }
        (faces[count], count) = (face, count + 1);
        let mut kept = Kept::around(pose.rotation * face, part.1);
        let triangles = manifolds.iter().filter_map(|manifold| facing(mesh, manifold, face, SAME_FACE));
        for (triangle, local_normal) in triangles {
            let normal = pose.rotation * local_normal;
            for place in lowest(part, normal, margin_m) {
                let gap_m = above_m(&triangle, local_normal, pose.inverse_transform_point(place));
                // A corner that is deep below came from the other side.
                let Some(gap_m) = gap_m.filter(|gap_m| gap_m.abs() < margin_m) else { continue };
                let corner = Corner::of_part(place, normal, gap_m);
                if !points.clone().any(|(point, along)| corner.is_at(point, along)) {
                    kept.add(corner);
                }
            }
        }
        kept.each(&mut tell);
    }
}

/// The triangle of a manifold, and its normal on the side of `way`; none if the cosine of their angle is not above `least`.
fn facing(mesh: &TriMesh, manifold: &Manifold, way: Vector, least: f64) -> Option<(Triangle, Vector)> {
    let triangle = mesh.triangle(manifold.subshape1);
    let normal = triangle.normal()?;
    let along = normal.dot(way);
    (along.abs() > least).then(|| (triangle, normal * along.signum()))
}

/// Height of a point above a triangle; none where it is beside it.
fn above_m(triangle: &Triangle, normal: Vector, point: Vector) -> Option<f64> {
    let gap_m = normal.dot(point - triangle.a);
    let foot = point - normal * gap_m;
    let beside_m = (triangle.project_local_point(foot, false).point - foot).length();
    (beside_m <= BESIDE_M).then_some(gap_m)
}

/// Corners of a solid that are within `margin_m` of another shape along `normal`, with their gaps.
fn near(
    solid: (&Collider, &Pose),
    other: (&Collider, &Pose),
    normal: Vector,
    margin_m: f64,
) -> impl Iterator<Item = (Vector, f64)> {
    let lowest = lowest(solid, normal, margin_m);
    lowest.filter_map(move |corner| gap(other, corner, normal)).filter(move |(_, gap_m)| *gap_m < margin_m)
}

/// The placed corners of a solid, without those that are too far from the lowest one along `normal` to touch.
fn lowest((solid, pose): (&Collider, &Pose), normal: Vector, margin_m: f64) -> impl Iterator<Item = Vector> {
    let placed = corners(solid).map(move |corner| pose.transform_point(corner));
    let least_m = placed.clone().map(|corner| corner.dot(normal)).fold(f64::INFINITY, f64::min);
    placed.filter(move |corner| corner.dot(normal) < least_m + 2.0 * margin_m)
}

/// The corners of a convex mesh or a box; none of other shapes.
fn corners(solid: &Collider) -> impl Iterator<Item = Vector> + Clone {
    let shape = solid.shape();
    let mesh = shape.as_convex_polyhedron().map_or(&[][..], ConvexPolyhedron::points);
    let cuboid = shape.as_cuboid().map(|cuboid| {
        let corner = |number: usize| {
            let sign = |bit: usize| if number & bit == 0 { -1.0 } else { 1.0 };
            cuboid.half_extents * Vector::new(sign(1), sign(2), sign(4))
        };
        std::array::from_fn::<Vector, 8, _>(corner)
    });
    mesh.iter().copied().chain(cuboid.into_iter().flatten())
}

/// True if parry leaves out corners of a face of this solid.
fn has_large_face(solid: &Collider) -> bool {
    let faces = solid.shape().as_convex_polyhedron().map_or(&[][..], ConvexPolyhedron::faces);
    faces.iter().any(|face| face.num_vertices_or_edges > CORNERS)
}

/// Corners of one face: all of them, if they are no more than [`LARGEST`]; otherwise those that span the face, and the lowest.
/// Ties go to the first corner of the mesh, so that rounding alone does not choose.
struct Kept {
    count: usize,
    first: [Option<Corner>; LARGEST],
    directions: [Vector; DIRECTIONS],
    extreme: [Option<Ranked>; DIRECTIONS],
    lowest: [Option<Ranked>; LOWEST],
}

/// A corner with its number among those that were added, and its reach along a direction.
#[derive(Debug, Clone, Copy)]
struct Ranked {
    number: usize,
    reach_m: f64,
    corner: Corner,
}

impl Kept {
    /// No corners so far of a face along `normal`. The directions turn with the part, so that one that stands keeps its corners.
    fn around(normal: Vector, part: &Pose) -> Self {
        let (along, across) = (part.rotation.inverse() * normal).any_orthonormal_pair();
        let (along, across) = (part.rotation * along, part.rotation * across);
        let directions = std::array::from_fn(|number| {
            let (sin, cos) = libm::sincos(TAU * number as f64 / DIRECTIONS as f64);
            along * cos + across * sin
        });
        let (first, extreme, lowest) = ([None; LARGEST], [None; DIRECTIONS], [None; LOWEST]);
        Self { count: 0, first, directions, extreme, lowest }
    }

    /// Adds a corner, unless it is there.
    fn add(&mut self, corner: Corner) {
        if self.first.iter().flatten().any(|other| other.is_at(corner.ends[1], corner.normal)) {
            return;
        }
        if let Some(free) = self.first.get_mut(self.count) {
            *free = Some(corner);
        }
        let number = self.count;
        self.count += 1;
        for (direction, extreme) in self.directions.iter().zip(&mut self.extreme) {
            // Of two corners above each other the lower one.
            let reach_m = corner.ends[1].dot(*direction) - corner.gap_m;
            if extreme.is_none_or(|other| reach_m > other.reach_m) {
                *extreme = Some(Ranked { number, reach_m, corner });
            }
        }
        let mut next = Some(Ranked { number, reach_m: -corner.gap_m, corner });
        for low in &mut self.lowest {
            let is_lower = next.is_some_and(|one| low.is_none_or(|other| one.reach_m > other.reach_m));
            if is_lower {
                std::mem::swap(low, &mut next);
            }
        }
    }

    /// Passes the corners that are kept to `tell`: first those that span the face, which stay the same while it stands.
    fn each(&self, mut tell: impl FnMut(Corner)) {
        if self.count <= LARGEST {
            self.first.iter().flatten().for_each(|corner| tell(*corner));
            return;
        }
        let mut extreme = self.extreme;
        extreme.sort_unstable_by_key(|it| it.map(|it| it.number));
        let mut told: [Option<Corner>; LARGEST] = [None; LARGEST];
        let ranked = extreme.iter().chain(&self.lowest).flatten();
        for (place, Ranked { corner, .. }) in ranked.enumerate() {
            let mut before = told.iter().flatten();
            if !before.any(|other| other.is_at(corner.ends[1], corner.normal)) {
                told[place] = Some(*corner);
                tell(*corner);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rapier3d_f64::geometry::{ColliderBuilder, SharedShape};

    const RADIUS_M: f64 = 0.1;
    const MARGIN_M: f64 = 2e-3;

    /// An upright prism with its middle at the origin, 0.2 m high.
    fn prism(sides: u32) -> Collider {
        let corner = |side: u32, z: f64| {
            let (sin, cos) = libm::sincos(TAU * f64::from(side) / f64::from(sides));
            Vector::new(RADIUS_M * cos, RADIUS_M * sin, z)
        };
        let corners =
            (0..2 * sides).map(|it| corner(it % sides, if it < sides { -0.1 } else { 0.1 })).collect();
        let walls = (0..sides).flat_map(|one| {
            let two = (one + 1) % sides;
            [[one, two, two + sides], [one, two + sides, one + sides]]
        });
        let ends = (1..sides - 1).flat_map(|it| [[0, it + 1, it], [sides, sides + it, sides + it + 1]]);
        let faces: Vec<[u32; 3]> = walls.chain(ends).collect();
        ColliderBuilder::new(SharedShape::convex_mesh(corners, &faces).unwrap()).build()
    }

    /// The contacts at corners of `part` above `thing`, along z, where parry found none.
    fn found(thing: (&Collider, &Pose), part: (&Collider, &Pose)) -> Vec<Corner> {
        let mut manifold = Manifold::with_data(0, 0, ());
        manifold.local_n1 = Vector::Z;
        let mut found = Vec::new();
        missing(thing, part, MARGIN_M, &[manifold], |corner| found.push(corner));
        found
    }

    #[test]
    fn a_corner_that_two_prisms_share_is_one_contact() {
        for sides in [8, 16] {
            let prism = prism(sides);
            let above = Pose::from_translation(Vector::Z * 0.201);
            let found = found((&prism, &Pose::IDENTITY), (&prism, &above));
            assert_eq!(found.len(), sides as usize);
            assert!(found.iter().all(|corner| (corner.gap_m - 1e-3).abs() < 1e-6), "{found:?}");
        }
    }

    #[test]
    fn a_face_of_many_corners_stands_on_few_that_span_it_and_on_the_lowest() {
        let ground = ColliderBuilder::cuboid(1.0, 1.0, 1.0).build();
        let below = Pose::from_translation(-Vector::Z);
        for (sides, tilt_rad) in [(19, 0.0), (20, 0.0), (300, 0.0), (300, 1e-3), (900, -2e-3)] {
            let prism = prism(sides);
            let place = Pose::new(Vector::Z * 0.1005, Vector::new(tilt_rad, tilt_rad / 3.0, 0.0));
            let found = found((&ground, &below), (&prism, &place));
            let count = found.len();
            assert!((16..=LARGEST).contains(&count), "{sides} sides: {count}");
            let heights_m = corners(&prism).map(|corner| place.transform_point(corner).z);
            let lowest_m = heights_m.fold(f64::INFINITY, f64::min);
            let least_m = found.iter().map(|corner| corner.gap_m).fold(f64::INFINITY, f64::min);
            assert!((least_m - lowest_m).abs() < 1e-9, "{sides} sides: {least_m} m, not {lowest_m} m");
            for number in 0..64 {
                let (sin, cos) = libm::sincos(TAU * f64::from(number) / 64.0);
                let reach_m = found.iter().map(|it| it.ends[1].dot(Vector::new(cos, sin, 0.0)));
                let reach_m = reach_m.fold(0.0, f64::max);
                assert!(reach_m > 0.94 * RADIUS_M, "{sides} sides: {reach_m} m in direction {number}");
            }
        }
    }

    #[test]
    fn a_box_stands_on_its_corners_on_a_face_of_many() {
        let (plate, cube) = (prism(32), ColliderBuilder::cuboid(0.02, 0.03, 0.01).build());
        let above = Pose::from_translation(Vector::new(0.01, 0.02, 0.111));
        let found = found((&plate, &Pose::IDENTITY), (&cube, &above));
        assert_eq!(found.len(), 4);
        assert!(found.iter().all(|corner| (corner.gap_m - 1e-3).abs() < 1e-6), "{found:?}");
    }

    #[test]
    fn a_corner_touches_each_face_of_a_mesh_of_triangles_once() {
        // A square of four triangles around the middle.
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [0.0, 0.0]];
        let corners = corners.map(|[x, y]| Vector::new(x, y, 0.0)).to_vec();
        let faces = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        let floor = ColliderBuilder::new(SharedShape::trimesh(corners, faces).unwrap()).build();
        let (prism, place) = (prism(8), Pose::from_translation(Vector::Z * 0.1005));
        let manifolds = [0, 1, 2, 3].map(|number| {
            let mut manifold = Manifold::with_data(number, 0, ());
            manifold.local_n1 = Vector::Z;
            manifold
        });
        let mut found = Vec::new();
        let told = |corner: Corner| found.push(corner);
        missing((&floor, &Pose::IDENTITY), (&prism, &place), MARGIN_M, &manifolds, told);
        assert_eq!(found.len(), 8);
        for corner in found {
            assert!((corner.gap_m - 5e-4).abs() < 1e-9 && corner.normal == Vector::Z, "{corner:?}");
        }
    }
}
