//! Corners of convex meshes that parry leaves out.
//!
//! Parry finds contacts of the first four corners of a face. A face with more corners would stand on these alone, and its other
//! corners would sink.

use super::rim::gap;
use rapier3d_f64::geometry::Collider;
use rapier3d_f64::math::{Pose, Vector};
use rapier3d_f64::parry::shape::ConvexPolyhedron;

/// Corners of a face that parry uses.
const CORNERS: u32 = 4;

/// Points that are nearer to each other are one. Tuned, no source.
const SAME_M: f64 = 1e-4;

/// Passes to `tell` the corners of large faces that are within `margin_m` and not among the points `found` on the part, as
/// the nearest points of `thing` and of `part`, and the gap. `normal` points from the thing to the part.
pub(super) fn missing(
    thing: (&Collider, &Pose),
    part: (&Collider, &Pose),
    normal: Vector,
    margin_m: f64,
    found: impl Iterator<Item = Vector> + Clone,
    mut tell: impl FnMut([Vector; 2], f64),
) {
    // No normal was found. Triangles of a mesh would each add the same corners.
    if normal == Vector::ZERO || thing.0.shape().as_composite_shape().is_some() {
        return;
    }
    let is_new = |place: Vector| found.clone().all(|point| (point - place).length() > SAME_M);
    for (corner, gap_m) in near(part, thing, normal, margin_m) {
        if is_new(corner) {
            tell([corner - normal * gap_m, corner], gap_m);
        }
    }
    for (corner, gap_m) in near(thing, part, -normal, margin_m) {
        let place = corner + normal * gap_m;
        if is_new(place) {
            tell([corner, place], gap_m);
        }
    }
}

/// Corners of a convex mesh with large faces that are within `margin_m` of another shape along `normal`, with their gaps.
fn near(
    (solid, pose): (&Collider, &Pose),
    other: (&Collider, &Pose),
    normal: Vector,
    margin_m: f64,
) -> impl Iterator<Item = (Vector, f64)> {
    let solid = solid.shape().as_convex_polyhedron().filter(|solid| has_large_face(solid));
    let corners = solid.map_or(&[][..], ConvexPolyhedron::points);
    let placed = corners.iter().map(move |corner| pose.transform_point(*corner));
    let least_m = placed.clone().map(|corner| corner.dot(normal)).fold(f64::INFINITY, f64::min);
    // Corners that are farther from the nearest one cannot touch.
    let lowest = placed.filter(move |corner| corner.dot(normal) < least_m + 2.0 * margin_m);
    lowest.filter_map(move |corner| gap(other, corner, normal)).filter(move |(_, gap_m)| *gap_m < margin_m)
}

fn has_large_face(solid: &ConvexPolyhedron) -> bool {
    solid.faces().iter().any(|face| face.num_vertices_or_edges > CORNERS)
}
