//! The distance from a point along a direction to what is met first.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::scene::{Cuboid, Scene};
use nalgebra::Vector3;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::{PointQuery, Ray, RayCast};
use parry3d_f64::shape::{Cuboid as Shape, SharedShape};

/// A scene prepared for ray casts. A cast allocates nothing.
///
/// ```
/// use nalgebra::Vector3;
///
/// let room = scenes::Scene::parse(scenes::reference::ROOM, "room.toml")?;
/// let rays = scenes::RayCaster::new(&room);
/// assert_eq!(rays.distance_m(&Vector3::new(0.0, 0.0, 1.5), &-Vector3::z(), 10.0), Some(1.5));
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Debug, Clone)]
pub struct RayCaster {
    boxes: Vec<(Shape, Pose)>,
    meshes: Vec<SharedShape>,
}

impl RayCaster {
    /// Prepares `scene`.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let placed = |cuboid: &Cuboid| {
            let [x, y, z]: [f64; 3] = cuboid.centre_W_m.into();
            let [hx, hy, hz]: [f64; 3] = cuboid.half_extents_m.into();
            let pose = Pose::new(Vector::new(x, y, z), Vector::new(0.0, 0.0, cuboid.yaw_rad));
            (Shape::new(Vector::new(hx, hy, hz)), pose)
        };
        // A mesh that has no shape was refused when the scene was read.
        let meshes = scene.meshes.iter().filter_map(|mesh| mesh.shape().ok()).collect();
        Self { boxes: scene.boxes.iter().map(placed).collect(), meshes }
    }

    /// How far it is from `from_W_m` along the unit vector `along_W` to the ground, a box or a mesh, at most `max_m`;
    /// `None` where nothing is met. From inside of a box or below the ground it is 0; a mesh of triangles has no inside.
    #[must_use]
    pub fn distance_m(&self, from_W_m: &Vector3<f64>, along_W: &Vector3<f64>, max_m: f64) -> Option<f64> {
        let vector = |v: &Vector3<f64>| Vector::new(v.x, v.y, v.z);
        let ray = Ray::new(vector(from_W_m), vector(along_W));
        let ground_m = ground_m(from_W_m, along_W).filter(|distance_m| *distance_m <= max_m);
        let boxes = self.boxes.iter().filter_map(|(shape, pose)| shape.cast_ray(pose, &ray, max_m, true));
        let meshes = self.meshes.iter().filter_map(|shape| shape.cast_local_ray(&ray, max_m, true));
        boxes.chain(meshes).chain(ground_m).reduce(f64::min)
    }

    /// How far `point_W_m` is from the nearest box or mesh, the ground left out; 0 within a box or a convex mesh,
    /// infinite where there is neither.
    #[must_use]
    pub fn clearance_m(&self, point_W_m: &Vector3<f64>) -> f64 {
        let point = Vector::new(point_W_m.x, point_W_m.y, point_W_m.z);
        let distances = self.boxes.iter().map(|(shape, pose)| shape.distance_to_point(pose, point, true));
        let meshes = self.meshes.iter().map(|shape| shape.distance_to_local_point(point, true));
        distances.chain(meshes).fold(f64::INFINITY, f64::min)
    }
}

fn ground_m(from_W_m: &Vector3<f64>, along_W: &Vector3<f64>) -> Option<f64> {
    if from_W_m.z <= 0.0 {
        Some(0.0)
    } else if along_W.z < 0.0 {
        Some(from_W_m.z / -along_W.z)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn room() -> RayCaster {
        RayCaster::new(&Scene::parse(crate::reference::ROOM, "room.toml").unwrap())
    }

    #[test]
    fn each_wall_and_the_ground_are_where_the_file_says() {
        let room = room();
        let from = Vector3::new(1.0, 2.0, 1.5);
        let distance = |x, y, z| room.distance_m(&from, &Vector3::new(x, y, z), 7.65).unwrap();
        let found = [
            distance(1.0, 0.0, 0.0),
            distance(-1.0, 0.0, 0.0),
            distance(0.0, 1.0, 0.0),
            distance(0.0, -1.0, 0.0),
            distance(0.0, 0.0, -1.0),
        ];
        for (found, expected) in found.into_iter().zip([4.0, 6.0, 3.0, 7.0, 1.5]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }

    #[test]
    fn the_clearance_is_that_of_the_nearest_box_and_of_no_ground() {
        let room = room();
        assert!((room.clearance_m(&Vector3::new(1.0, -2.0, 0.1)) - 3.0).abs() < 1e-12);
        // Above the walls, 3 m high, the nearest point is on the upper edge.
        assert!((room.clearance_m(&Vector3::new(4.0, 0.0, 3.75)) - 1.25).abs() < 1e-12);
        assert_eq!(room.clearance_m(&Vector3::new(5.05, 0.0, 1.0)), 0.0);
    }

    #[test]
    fn beyond_its_reach_a_ray_meets_nothing() {
        let room = room();
        let from = Vector3::new(1.0, 2.0, 1.5);
        assert_eq!(room.distance_m(&from, &-Vector3::x(), 5.9), None);
        assert_eq!(room.distance_m(&from, &Vector3::z(), 7.65), None);
    }

    #[test]
    fn a_turned_box_is_met_on_its_edge() {
        let text = r#"
            name = "edge"
            [[boxes]]
            name = "box"
            centre = { value = [5, 0, 1], unit = "m", source = "test", uncertainty = "exact" }
            size = { value = [1, 1, 2], unit = "m", source = "test", uncertainty = "exact" }
            yaw = { value = 45, unit = "deg", source = "test", uncertainty = "exact" }
        "#;
        let caster = RayCaster::new(&Scene::parse(text, "edge.toml").unwrap());
        let found = caster.distance_m(&Vector3::z(), &Vector3::x(), 10.0).unwrap();
        assert!((found - (5.0 - 0.5_f64.sqrt())).abs() < 1e-9, "{found}");
    }

    #[test]
    fn from_within_it_is_zero() {
        assert_eq!(room().distance_m(&Vector3::new(5.05, 0.0, 1.0), &Vector3::x(), 7.65), Some(0.0));
        assert_eq!(room().distance_m(&Vector3::new(0.0, 0.0, -0.1), &Vector3::x(), 7.65), Some(0.0));
    }
}
