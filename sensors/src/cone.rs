//! Ultrasonic beam: the nearest object in its cone.
//!
//! A beam widens from the body's centre of mass about one of its axes. Flat things, the ground and the boxes of a scene,
//! are found with rays: one along the axis, eight at half of the cone's half angle and eight at its edge. No direction
//! in a cone of half angle h is further than 0.42 h from a ray. So a wall whose normal lies in the cone is seen at most
//! 0.09 h² of its distance too far: 0.07 % at 5°. Vehicles are spheres, whose distance to a cone is known without rays,
//! and so is that of balls.

use component::StepError;
use component::context::NodeContext;
use component::messages::BodyStates;
use diagnostics::parameter::{ParameterError, refuse};
use inputs::InputFiles;
use nalgebra::{Rotation3, Unit, UnitQuaternion, Vector3};
use scenes::{BodyPose, RayCaster, Scene};
use std::f64::consts::FRAC_PI_4;
use std::path::Path;

/// Rays of a cone: the axis, and eight in each of two rings.
const RAYS: usize = 17;

/// The objects in the scene of the file at `path` among `files`, the parameter `scene`.
///
/// # Errors
/// There is none, or it is refused.
pub fn caster(files: &InputFiles, path: Option<&Path>) -> Result<RayCaster, ParameterError> {
    let path = path.ok_or_else(|| ParameterError::missing("scene", ""))?;
    let scene = Scene::load_from(files, path).map_err(|error| error.named_by("scene"))?;
    Ok(RayCaster::new(&scene))
}

/// Refuses a scene with free bodies without the input `bodies`, and that input for a scene without free bodies.
///
/// # Errors
/// The two do not go together.
pub fn check_bodies(scene: &RayCaster, run: &NodeContext<'_>) -> Result<(), ParameterError> {
    let is_told = run.has("bodies");
    refuse(
        scene.has_bodies() && !is_told,
        "scene",
        || "the scene holds free bodies: wire the input `bodies`, the plant's output of that name, which tells where they are",
    )?;
    refuse(
        !scene.has_bodies() && is_told,
        "scene",
        || "the input `bodies` needs a scene in which something has a `mass`: name the plant's scene, or leave it out",
    )
}

/// Refuses free bodies of another scene than this; a sample without any came before the plant's first.
///
/// # Errors
/// They are others.
pub fn check_told(scene: &RayCaster, told: Option<&BodyStates>) -> Result<(), StepError> {
    let Some(told) = told.filter(|told| told.count > 0) else { return Ok(()) };
    let count = (told.count as usize).min(told.object.len());
    if told.object[..count] == *scene.body_objects() {
        return Ok(());
    }
    Err(format!(
        "the input `bodies` tells of the things {:?}, and those that move in the parameter `scene` are {:?}: name the plant's scene",
        &told.object[..count],
        scene.body_objects()
    )
    .into())
}

/// A cone about a body axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Cone {
    axis_B: Vector3<f64>,
    half_angle_rad: f64,
    rays_B: [Vector3<f64>; RAYS],
}

impl Cone {
    /// The cone of `half_angle_rad` about `axis_B`, which is one of the body's axes or the opposite of one.
    pub fn new(axis_B: Unit<Vector3<f64>>, half_angle_rad: f64) -> Self {
        // The next of the body's axes: square to this one.
        let across_B = Unit::new_unchecked(Vector3::new(axis_B.z, axis_B.x, axis_B.y));
        let aside = |angle_rad: f64| Rotation3::from_axis_angle(&across_B, angle_rad) * *axis_B;
        let mut rays_B = [*axis_B; RAYS];
        for (index, ray_B) in rays_B[1..].iter_mut().enumerate() {
            let angle_rad = half_angle_rad * if index < 8 { 0.5 } else { 1.0 };
            let about = Rotation3::from_axis_angle(&axis_B, index as f64 * FRAC_PI_4);
            *ray_B = about * aside(angle_rad);
        }
        Self { axis_B: *axis_B, half_angle_rad, rays_B }
    }

    /// Returns the distance from `from_W_m` to the nearest object of the scene in the cone, if it is at most
    /// `reach_m`. The body is at `attitude_WB`. The scene's free bodies are at `bodies`.
    pub fn scene_distance_m(
        &self,
        (scene, bodies): (&RayCaster, &[BodyPose]),
        from_W_m: &Vector3<f64>,
        attitude_WB: &UnitQuaternion<f64>,
        reach_m: f64,
    ) -> Option<f64> {
        let distances = self.rays_B.iter();
        distances
            .filter_map(|ray_B| scene.distance_among_m(bodies, from_W_m, &(attitude_WB * ray_B), reach_m))
            .reduce(f64::min)
    }

    /// Returns the distance from the cone's tip to the nearest point in the cone of a sphere of `radius_m`
    /// whose centre is at `centre_B_m`; 0 from inside the sphere.
    pub fn sphere_distance_m(&self, centre_B_m: &Vector3<f64>, radius_m: f64) -> Option<f64> {
        let centre_m = centre_B_m.norm();
        if centre_m <= radius_m {
            return Some(0.0);
        }
        // The ray of the cone that points closest to the centre, and how far it passes it.
        let aside_rad = (self.axis_B.angle(centre_B_m) - self.half_angle_rad).max(0.0);
        let miss_m = centre_m * libm::sin(aside_rad);
        let is_met = aside_rad < std::f64::consts::FRAC_PI_2 && miss_m <= radius_m;
        is_met.then(|| centre_m * libm::cos(aside_rad) - (radius_m * radius_m - miss_m * miss_m).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scenes::Scene;

    const HALF_ANGLE_RAD: f64 = 0.1;

    fn forward() -> Cone {
        Cone::new(Vector3::x_axis(), HALF_ANGLE_RAD)
    }

    fn room() -> RayCaster {
        RayCaster::new(&Scene::parse(scenes::reference::ROOM, "room.toml").unwrap())
    }

    #[test]
    fn no_direction_in_a_cone_is_far_from_a_ray() {
        let cone = forward();
        let mut worst = 0.0_f64;
        for step in 0..=40 {
            for turn in 0..=90 {
                let aside = Rotation3::new(Vector3::y() * HALF_ANGLE_RAD * f64::from(step) / 40.0);
                let about = Rotation3::new(Vector3::x() * f64::from(turn).to_radians());
                let direction = about * (aside * Vector3::x());
                let nearest = cone.rays_B.iter().map(|ray| ray.angle(&direction)).reduce(f64::min).unwrap();
                worst = worst.max(nearest);
            }
        }
        assert!(worst < 0.42 * HALF_ANGLE_RAD, "{}", worst / HALF_ANGLE_RAD);
    }

    #[test]
    fn every_ray_is_a_unit_vector_within_the_half_angle() {
        for axis in [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis(), -Vector3::z_axis()] {
            let cone = Cone::new(axis, HALF_ANGLE_RAD);
            for ray in cone.rays_B {
                assert!((ray.norm() - 1.0).abs() < 1e-12);
                assert!(ray.angle(&axis) < HALF_ANGLE_RAD + 1e-9);
            }
        }
    }

    #[test]
    fn a_wall_that_is_tilted_less_than_the_half_angle_is_seen_at_its_shortest_distance() {
        let from = Vector3::new(1.0, 0.0, 1.5);
        for yaw in [-0.1, -0.05, 0.0, 0.03, 0.1] {
            let attitude = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw);
            let found = forward().scene_distance_m((&room(), &[]), &from, &attitude, 7.65).unwrap();
            assert!((4.0..4.0 * (1.0 + 0.09 * HALF_ANGLE_RAD.powi(2))).contains(&found), "{found} at {yaw}");
        }
    }

    #[test]
    fn a_wall_that_is_tilted_more_is_seen_along_the_edge_of_the_cone() {
        let from = Vector3::new(1.0, 0.0, 1.5);
        let attitude = UnitQuaternion::from_euler_angles(0.0, 0.0, 0.4);
        let found = forward().scene_distance_m((&room(), &[]), &from, &attitude, 7.65).unwrap();
        assert!((found - 4.0 / libm::cos(0.4_f64 - HALF_ANGLE_RAD)).abs() < 1e-9, "{found}");
    }

    #[test]
    fn the_nearest_in_the_cone_counts() {
        // The lower edge of the cone meets the floor before the axis meets the wall.
        let from = Vector3::new(0.0, 0.0, 0.2);
        let found =
            forward().scene_distance_m((&room(), &[]), &from, &UnitQuaternion::identity(), 7.65).unwrap();
        assert!((found - 0.2 / libm::sin(HALF_ANGLE_RAD)).abs() < 1e-9, "{found}");
    }

    #[test]
    fn a_sphere_is_met_where_rays_that_fill_the_cone_meet_it() {
        let cone = forward();
        let centres =
            [[3.0, 0.0, 0.0], [3.0, 0.2, -0.1], [3.0, 0.45, 0.0], [3.0, -0.3, 0.42], [3.0, 0.7, 0.0]];
        for centre in centres.map(Vector3::from) {
            let mut nearest: Option<f64> = None;
            for step in 0..=100 {
                for turn in 0..720 {
                    let aside = Rotation3::new(Vector3::y() * HALF_ANGLE_RAD * f64::from(step) / 100.0);
                    let about = Rotation3::new(Vector3::x() * (f64::from(turn) / 2.0).to_radians());
                    let along = (about * (aside * Vector3::x())).dot(&centre);
                    let inside = along * along - centre.norm_squared() + 0.27 * 0.27;
                    if inside >= 0.0 {
                        let met = along - inside.sqrt();
                        nearest = Some(nearest.map_or(met, |nearest| nearest.min(met)));
                    }
                }
            }
            match (cone.sphere_distance_m(&centre, 0.27), nearest) {
                (Some(found), Some(nearest)) => {
                    assert!(found <= nearest + 1e-12 && nearest - found < 2e-3, "{found} {nearest}");
                }
                (found, nearest) => assert_eq!(found, nearest, "{centre}"),
            }
        }
    }

    #[test]
    fn a_sphere_behind_is_not_met_and_one_around_is_at_zero() {
        assert_eq!(forward().sphere_distance_m(&Vector3::new(-1.0, 0.0, 0.0), 0.27), None);
        assert_eq!(forward().sphere_distance_m(&Vector3::new(-0.1, 0.0, 0.0), 0.27), Some(0.0));
    }
}
