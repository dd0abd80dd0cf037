//! Meshes of triangles that touch with their borders too, as the edge of a door or of a sheet of metal.
//!
//! Parry lets a triangle push only along its normal, bent over the edges that it shares with others. So
//! nothing catches on the edge between two triangles of one face. An edge that no other triangle continues has
//! no such bend. Parry turns a push against it into one along the triangle's normal, so a vehicle in the plane
//! of a sheet flies through it. Here a border pushes in every direction that leads away from it.

use rapier3d_f64::geometry::{Shape, TriMesh};
use rapier3d_f64::math::{Pose, Vector};
use rapier3d_f64::parry::bounding_volume::BoundingVolume;
use rapier3d_f64::parry::query::details::NormalConstraints;
use rapier3d_f64::parry::query::{
    ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher, PointQuery,
};
use rapier3d_f64::parry::shape::TrianglePseudoNormals;
use std::collections::BTreeMap;

/// Places at which two colliders are near each other, without the data of a solver of rapier.
pub(super) type Manifold = ContactManifold<(), ()>;

/// Distance beside the middle of an edge at which another triangle is looked for, over the edge's length. Tuned, no source.
const BESIDE: f64 = 1e-3;

/// Part of that distance within which another triangle continues the face. Tuned, no source.
const CONTINUES: f64 = 0.5;

/// The borders of a mesh.
pub(super) struct Borders {
    /// For each triangle and each of its edges, from corners 0, 1 and 2 on: the direction out of the triangle in its plane, if
    /// the edge is a border.
    outward: Vec<[Option<Vector>; 3]>,
}

/// The directions in which one triangle pushes.
struct Pushes {
    shared: Option<TrianglePseudoNormals>,
    outward: [Vector; 3],
    is_border: [bool; 3],
}

impl NormalConstraints for Pushes {
    fn project_local_normal_mut(&self, direction: &mut Vector) -> bool {
        let along = self.outward.map(|outward| direction.dot(outward));
        let nearest = (0..3).fold(0, |best, edge| if along[edge] > along[best] { edge } else { best });
        if self.is_border[nearest] {
            return true;
        }
        self.shared.as_ref().is_none_or(|shared| shared.project_local_normal_mut(direction))
    }
}

impl Borders {
    /// The borders of `mesh`; none if it has no border.
    pub(super) fn of(mesh: &TriMesh) -> Option<Self> {
        let mut counts: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let key = |corners: &[u32; 3], edge: usize| {
            let (from, to) = (corners[edge], corners[(edge + 1) % 3]);
            [from.min(to), from.max(to)]
        };
        for corners in mesh.indices() {
            (0..3).for_each(|edge| *counts.entry(key(corners, edge)).or_default() += 1);
        }
        let is_border = |corners: &[u32; 3], edge: usize, outward: &Vector| {
            counts.get(&key(corners, edge)) == Some(&1) && !is_continued(mesh, corners, edge, outward)
        };
        let outward = mesh.indices().iter().map(|corners| {
            let outward = outward(mesh, corners);
            [0, 1, 2].map(|edge| outward[edge].filter(|outward| is_border(corners, edge, outward)))
        });
        let outward: Vec<_> = outward.collect();
        outward.iter().flatten().any(Option::is_some).then_some(Self { outward })
    }

    /// As parry finds where `mesh` and a `part` at `between`, seen from it, are within `margin_m` of each other, with these
    /// borders.
    pub(super) fn manifolds(
        &self,
        mesh: &TriMesh,
        (part, between): (&dyn Shape, &Pose),
        margin_m: f64,
        found: &mut Vec<Manifold>,
    ) {
        found.clear();
        let around = part.compute_aabb(between).loosened(margin_m);
        for number in mesh.bvh().intersect_aabb(&around) {
            let Some(borders) = self.outward.get(number as usize) else { continue };
            let corners = &mesh.indices()[number as usize];
            let shared = mesh.triangle_normal_constraints(number);
            let outward = outward(mesh, corners).map(Option::unwrap_or_default);
            let pushes = Pushes { shared, outward, is_border: borders.map(|border| border.is_some()) };
            let mut manifold = Manifold::with_data(number, 0, ());
            let triangle = mesh.triangle(number);
            let asked = DefaultQueryDispatcher.contact_manifold_convex_convex(
                between,
                &triangle,
                part,
                Some(&pushes),
                None,
                margin_m,
                &mut manifold,
            );
            debug_assert!(asked.is_ok(), "{:?}", part.shape_type());
            found.push(manifold);
        }
    }
}

/// The directions out of a triangle over its edges, in its plane; none over an edge of a triangle that is a line.
fn outward(mesh: &TriMesh, corners: &[u32; 3]) -> [Option<Vector>; 3] {
    let corner = |number: usize| mesh.vertices()[corners[number % 3] as usize];
    let normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    [0, 1, 2].map(|edge| (corner(edge + 1) - corner(edge)).cross(normal).try_normalize())
}

/// True if another triangle lies beside the middle of an edge, as where the corners of two triangles do not meet.
fn is_continued(mesh: &TriMesh, corners: &[u32; 3], edge: usize, outward: &Vector) -> bool {
    let [from, to] = [edge, (edge + 1) % 3].map(|number| mesh.vertices()[corners[number] as usize]);
    let beside_m = BESIDE * (to - from).length();
    let point = (from + to) / 2.0 + *outward * beside_m;
    let nearest = mesh.project_local_point(point, false).point;
    (nearest - point).length() < CONTINUES * beside_m
}
