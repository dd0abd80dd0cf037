//! The line along which the rim of a disc touches an edge.
//!
//! Parry finds both ends of the line where the rim touches a face. Where it touches an edge, it finds one point, which is an
//! end of the line: pushed there alone, the disc would turn.

use rapier3d_f64::geometry::Collider;
use rapier3d_f64::math::{Pose, Vector};

/// Cosine of the angle between the rim's line and its normal, above which the flat side of the disc touches. Tuned, no source.
const FLAT: f64 = 0.1;

/// Points that are nearer to each other are one. Tuned, no source.
const SAME_M: f64 = 1e-4;

/// Part of a gap that the nearest point of the same contact may be beside its normal, and the rounding error of
/// the normal. Tuned, no source.
const ASIDE: f64 = 0.05;
const ASIDE_M: f64 = 1e-6;

/// Passes to `tell` the ends of the rim's line that are not among those `found`, with the nearest point of
/// `thing` first, and the gap. `normal` points from the thing to the disc; parts that are not discs have none.
pub(super) fn missing_ends(
    thing: (&Collider, &Pose),
    part: (&Collider, &Pose),
    normal: Vector,
    found: impl Iterator<Item = Vector> + Clone,
    mut tell: impl FnMut([Vector; 2], f64),
) {
    let (disc, pose) = part;
    let Some(cylinder) = disc.shape().as_cylinder() else { return };
    // Cylinders lie along y.
    let (axis, middle) = (pose.rotation * Vector::Y, pose.translation);
    let across = normal - axis * normal.dot(axis);
    if normal.dot(axis).abs() > FLAT {
        return;
    }
    let nearest = middle - across.normalize() * cylinder.radius;
    for sign in [-1.0, 1.0] {
        let end = nearest + axis * (sign * cylinder.half_height);
        // Where the edge ends before the rim does, the line ends with it.
        let Some((place, gap_m)) = gap(thing, end, normal).or_else(|| {
            let along_m = (nearest_of(thing, end) - nearest).dot(axis);
            let end = nearest + axis * along_m.clamp(-cylinder.half_height, cylinder.half_height);
            gap(thing, end, normal)
        }) else {
            continue;
        };
        if found.clone().all(|point| (point - place).length() > SAME_M) {
            tell([place - normal * gap_m, place], gap_m);
        }
    }
}

fn nearest_of((thing, pose): (&Collider, &Pose), point: Vector) -> Vector {
    thing.shape().project_point(pose, point, false).point
}

/// The point and its gap to the thing, if that is along the normal.
pub(super) fn gap(thing: (&Collider, &Pose), point: Vector, normal: Vector) -> Option<(Vector, f64)> {
    let way = point - nearest_of(thing, point);
    let gap_m = way.dot(normal);
    let aside_m = (way - normal * gap_m).length();
    (aside_m <= ASIDE * gap_m.abs() + ASIDE_M).then_some((point, gap_m))
}
