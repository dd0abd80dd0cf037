//! Where glam, which rapier's vectors are of, meets nalgebra.

use crate::state::RigidBody;
use nalgebra::{UnitQuaternion, Vector3};
use rapier3d_f64::math::{Pose, Rotation, Vector};

/// The pose, as rapier writes it.
pub(super) fn pose(body: &RigidBody) -> Pose {
    Pose::from_parts(to_rapier(&body.position_W_m), rotation(&body.attitude_WB))
}

/// A vector as rapier writes it.
pub(super) fn to_rapier(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

/// A vector of rapier's.
pub(super) fn from_rapier(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn rotation(attitude: &UnitQuaternion<f64>) -> Rotation {
    let [x, y, z, w] = attitude.coords.into();
    Rotation::from_xyzw(x, y, z, w)
}
