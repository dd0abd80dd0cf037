//! Distance from a point along a direction to the first object.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::body::BodyPose;
use crate::scene::{Scene, Thing};
use nalgebra::Vector3;
use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::query::Ray;
use parry3d_f64::shape::SharedShape;

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
    still: Vec<(SharedShape, Pose)>,
    /// The free bodies' shapes, seen from their centres of mass.
    bodies: Vec<(SharedShape, Pose)>,
    objects: Vec<u32>,
    /// Poses of the free bodies at the start.
    starts: Vec<BodyPose>,
}

impl RayCaster {
    /// Prepares `scene`.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let (mut still, mut bodies, mut starts) = (Vec::new(), Vec::new(), Vec::new());
        for thing in scene.things() {
            // A mesh that has no shape was refused when the scene was read.
            let Ok((shape, place)) = shape(&thing) else { continue };
            match thing.body() {
                None => still.push((shape, place)),
                Some(body) => {
                    bodies.push((shape, pose(&body.start()).inv_mul(&place)));
                    starts.push(body.start());
                }
            }
        }
        let objects = scene.bodies().map(|(number, _)| 2 + number as u32).collect();
        Self { still, bodies, objects, starts }
    }

    /// Returns the numbers of its free bodies in contacts, in their order: 2 + i of the scene's thing i.
    #[must_use]
    pub fn body_objects(&self) -> &[u32] {
        &self.objects
    }

    /// True if some of its things move.
    #[must_use]
    pub fn has_bodies(&self) -> bool {
        !self.bodies.is_empty()
    }

    /// Returns the distance from `from_W_m` along the unit vector `along_W` to the ground or a thing, at most
    /// `max_m`; `None` if nothing is met. From inside of something solid or below the ground it is 0; a mesh of
    /// triangles has no inside. Free bodies are where they start.
    #[must_use]
    pub fn distance_m(&self, from_W_m: &Vector3<f64>, along_W: &Vector3<f64>, max_m: f64) -> Option<f64> {
        self.distance_among_m(&self.starts, from_W_m, along_W, max_m)
    }

    /// As [`RayCaster::distance_m`], with the free bodies where `bodies` says, in the order of [`Scene::bodies`].
    #[must_use]
    pub fn distance_among_m(
        &self,
        bodies: &[BodyPose],
        from_W_m: &Vector3<f64>,
        along_W: &Vector3<f64>,
        max_m: f64,
    ) -> Option<f64> {
        let ray = Ray::new(vector(from_W_m), vector(along_W));
        let ground_m = ground_m(from_W_m, along_W).filter(|distance_m| *distance_m <= max_m);
        let cast = |shape: &SharedShape, pose: &Pose| shape.cast_ray(pose, &ray, max_m, true);
        let still = self.still.iter().filter_map(|(shape, pose)| cast(shape, pose));
        let moving = self.among(bodies).filter_map(|(shape, pose)| cast(shape, &pose));
        still.chain(moving).chain(ground_m).reduce(f64::min)
    }

    /// Returns the distance of `point_W_m` from the nearest thing, the ground left out; 0 within a solid thing,
    /// infinite if there is none. Free bodies are where they start.
    #[must_use]
    pub fn clearance_m(&self, point_W_m: &Vector3<f64>) -> f64 {
        self.clearance_among_m(&self.starts, point_W_m)
    }

    /// As [`RayCaster::clearance_m`], with the free bodies where `bodies` says, in the order of [`Scene::bodies`].
    #[must_use]
    pub fn clearance_among_m(&self, bodies: &[BodyPose], point_W_m: &Vector3<f64>) -> f64 {
        let point = vector(point_W_m);
        let still = self.still.iter().map(|(shape, pose)| shape.distance_to_point(pose, point, true));
        let moving = self.among(bodies).map(|(shape, pose)| shape.distance_to_point(&pose, point, true));
        still.chain(moving).fold(f64::INFINITY, f64::min)
    }

    /// Centre and radius of each ball, with the free bodies where `bodies` says: rays in a cone may pass a small one.
    pub fn balls<'a>(&'a self, bodies: &'a [BodyPose]) -> impl Iterator<Item = (Vector3<f64>, f64)> + 'a {
        let still = self.still.iter().map(|(shape, pose)| (shape, *pose));
        still.chain(self.among(bodies)).filter_map(|(shape, pose)| {
            let [x, y, z] = pose.translation.into();
            Some((Vector3::new(x, y, z), shape.as_ball()?.radius))
        })
    }

    fn among<'a>(&'a self, bodies: &'a [BodyPose]) -> impl Iterator<Item = (&'a SharedShape, Pose)> + 'a {
        self.bodies.iter().zip(bodies).map(|((shape, place), body)| (shape, pose(body) * *place))
    }
}

/// The shape that rays meet, and where it is at the start.
fn shape(thing: &Thing) -> Result<(SharedShape, Pose), String> {
    Ok(match thing {
        Thing::Mesh(mesh) => (mesh.shape()?, Pose::IDENTITY),
        Thing::Ball(ball) => {
            (SharedShape::ball(ball.radius_m), Pose::from_translation(vector(&ball.centre_W_m)))
        }
        Thing::Cuboid(cuboid) => {
            let [x, y, z]: [f64; 3] = cuboid.half_extents_m.into();
            let turn = Vector::new(0.0, 0.0, cuboid.yaw_rad);
            (SharedShape::cuboid(x, y, z), Pose::new(vector(&cuboid.centre_W_m), turn))
        }
    })
}

fn pose(body: &BodyPose) -> Pose {
    let [x, y, z, w] = body.attitude_W.coords.into();
    Pose::from_parts(vector(&body.position_W_m), Rotation::from_xyzw(x, y, z, w))
}

fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
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
