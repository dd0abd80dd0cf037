//! Free bodies: things of a scene that move.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use diagnostics::parameter::Bounds;
use diagnostics::unit::{ANGULAR_VELOCITY, MASS, VELOCITY};
use diagnostics::{Diagnostic, Faults};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use vehicles::reader::Section;

/// Mass and start of a thing that moves. Its mass is spread evenly over its volume.
///
/// ```
/// let scene = scenes::Scene::parse(scenes::reference::SLUNG_LOAD, "slung-load.toml")?;
/// let (_, load) = scene.bodies().next().unwrap();
/// assert_eq!(load.mass_kg, 0.1);
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeBody {
    /// Its mass.
    pub mass_kg: f64,
    /// Its inertia about its centre of mass, along its own axes.
    pub inertia_kg_m2: Matrix3<f64>,
    /// Its centre of mass at the start, in the world; or as seen from the vehicle, for bodies that hang from it.
    pub centre_W_m: Vector3<f64>,
    /// Its attitude at the start; the axes of a mesh are those of the file.
    pub attitude_W: UnitQuaternion<f64>,
    /// The velocity of its centre of mass at the start; for bodies that hang from the vehicle, beside that of
    /// the vehicle.
    pub velocity_W_m_s: Vector3<f64>,
    /// Its angular velocity at the start, in the world's axes.
    pub angular_velocity_W_rad_s: Vector3<f64>,
}

/// Pose of a free body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyPose {
    /// Its centre of mass, in the world.
    pub position_W_m: Vector3<f64>,
    /// Takes vectors from its own axes to the world's.
    pub attitude_W: UnitQuaternion<f64>,
}

impl FreeBody {
    /// Returns its pose at the start.
    #[must_use]
    pub fn start(&self) -> BodyPose {
        BodyPose { position_W_m: self.centre_W_m, attitude_W: self.attitude_W }
    }
}

/// From an insect to a lorry.
const BODY_MASS: Bounds = Bounds {
    min: 1e-6,
    max: 1e5,
    unit: "kg",
    why: "a milligram at least: below it the step of a contact tells nothing; 100 t at most",
};

/// Along each axis.
const BODY_SPEED: Bounds =
    Bounds { min: -300.0, max: 300.0, unit: "m/s", why: "slower than sound: the body feels no air" };

/// About each axis.
const BODY_SPIN: Bounds =
    Bounds { min: -1e3, max: 1e3, unit: "rad/s", why: "a radian a tick at 1 kHz cannot be integrated" };

/// Keys of a free body.
pub(crate) const KEYS: [&str; 3] = ["mass", "velocity", "angular_velocity"];

/// The keys of a thing that say that it moves; none of them where it stands still.
pub(crate) struct Keys {
    mass_kg: f64,
    velocity_W_m_s: Vector3<f64>,
    angular_velocity_W_rad_s: Vector3<f64>,
}

impl Keys {
    /// Reads `mass`, `velocity` and `angular_velocity`; without the first the others are unknown keys.
    pub(crate) fn read(section: &Section) -> Result<Option<Self>, Diagnostic> {
        if !section.has("mass") {
            return Ok(None);
        }
        let mut faults = Faults::default();
        let mass_kg = faults.keep(section.bounded("mass", MASS, &BODY_MASS));
        let vector = |name, dimension, bounds| match section.has(name) {
            true => section.vector(name, dimension, bounds).map(Vector3::from),
            false => Ok(Vector3::zeros()),
        };
        let velocity_W_m_s = faults.keep(vector("velocity", VELOCITY, &BODY_SPEED));
        let angular_velocity_W_rad_s = faults.keep(vector("angular_velocity", ANGULAR_VELOCITY, &BODY_SPIN));
        let keys = (|| {
            Some(Self {
                mass_kg: mass_kg?,
                velocity_W_m_s: velocity_W_m_s?,
                angular_velocity_W_rad_s: angular_velocity_W_rad_s?,
            })
        })();
        faults.finish(keys).map(Some)
    }

    /// The body, of a shape whose inertia for each kilogram is `inertia_m2`.
    pub(crate) fn body(self, inertia_m2: Matrix3<f64>, centre_W_m: Vector3<f64>, yaw_rad: f64) -> FreeBody {
        let Self { mass_kg, velocity_W_m_s, angular_velocity_W_rad_s } = self;
        FreeBody {
            mass_kg,
            inertia_kg_m2: inertia_m2 * mass_kg,
            centre_W_m,
            attitude_W: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad),
            velocity_W_m_s,
            angular_velocity_W_rad_s,
        }
    }
}

/// Of a box: (b² + c²) / 3 about each axis, of half its lengths.
pub(crate) fn box_inertia_m2(half_extents_m: &Vector3<f64>) -> Matrix3<f64> {
    let squares = half_extents_m.component_mul(half_extents_m);
    Matrix3::from_diagonal(&(Vector3::repeat(squares.sum()) - squares)) / 3.0
}

/// Of a solid ball: 2/5 r².
pub(crate) fn ball_inertia_m2(radius_m: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal_element(0.4 * radius_m * radius_m)
}

/// The centre of the volume that closed triangles enclose, and the inertia for each kilogram about it. It is
/// the sum over the tetrahedra between the first corner and each triangle. Their second moments are V/20 (Σ v
/// vᵀ + s sᵀ), with s = Σ v (F. Tonon, Explicit exact formulas for the 3-D tetrahedron inertia tensor, 2004).
pub(crate) fn solid_moments(corners_m: &[[f64; 3]], faces: &[[u32; 3]]) -> (Vector3<f64>, Matrix3<f64>) {
    let corner = |number: u32| Vector3::from(corners_m[number as usize]);
    let first_m = corner(faces[0][0]);
    let (mut volume_m3, mut first_moment, mut second_moment) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for face in faces {
        let ends = face.map(|number| corner(number) - first_m);
        let sum = ends[0] + ends[1] + ends[2];
        let part_m3 = ends[0].dot(&ends[1].cross(&ends[2])) / 6.0;
        let squares = ends.iter().fold(sum * sum.transpose(), |squares, end| squares + end * end.transpose());
        volume_m3 += part_m3;
        first_moment += sum * (part_m3 / 4.0);
        second_moment += squares * (part_m3 / 20.0);
    }
    let off_m = first_moment / volume_m3;
    let spread_m2 = second_moment / volume_m3 - off_m * off_m.transpose();
    (first_m + off_m, Matrix3::from_diagonal_element(spread_m2.trace()) - spread_m2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_of_triangles_has_the_inertia_of_a_box_wherever_it_is() {
        let half_m = Vector3::new(0.1, 0.2, 0.3);
        let centre_m = Vector3::new(4.0, -5.0, 6.0);
        let corners: Vec<[f64; 3]> = (0..8_u32)
            .map(|at| {
                let side = |bit: u32| if at & bit == 0 { -1.0 } else { 1.0 };
                (centre_m + half_m.component_mul(&Vector3::new(side(1), side(2), side(4)))).into()
            })
            .collect();
        let faces = [
            [0, 2, 3],
            [0, 3, 1],
            [4, 5, 7],
            [4, 7, 6],
            [0, 1, 5],
            [0, 5, 4],
            [2, 6, 7],
            [2, 7, 3],
            [0, 4, 6],
            [0, 6, 2],
            [1, 3, 7],
            [1, 7, 5],
        ];
        let (found_m, inertia_m2) = solid_moments(&corners, &faces);
        assert!((found_m - centre_m).norm() < 1e-12, "{found_m}");
        assert!((inertia_m2 - box_inertia_m2(&half_m)).norm() < 1e-12, "{inertia_m2}");
    }
}
