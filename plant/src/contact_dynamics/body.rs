//! A rigid body as rapier sees it, whose vectors are glam's, and as impulses do.

use super::solver::{join, part};
use crate::state::RigidBody;
use nalgebra::{Matrix3, Matrix6, Quaternion, UnitQuaternion, Vector3, Vector6};
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

/// The attitude, as rapier writes it.
pub(super) fn rotation(attitude: &UnitQuaternion<f64>) -> Rotation {
    let [x, y, z, w] = attitude.coords.into();
    Rotation::from_xyzw(x, y, z, w)
}

/// Velocity of the centre of mass and angular velocity, in the world's axes.
pub(super) fn twist(body: &RigidBody) -> Vector6<f64> {
    join(&body.velocity_W_m_s, &body.angular_velocity_W_rad_s())
}

/// Has the body move with this twist.
pub(super) fn set_twist(body: &mut RigidBody, twist: &Vector6<f64>) {
    let [velocity_W_m_s, spin_W_rad_s] = part(twist);
    body.velocity_W_m_s = velocity_W_m_s;
    body.angular_velocity_B_rad_s = body.attitude_WB.inverse_transform_vector(&spin_W_rad_s);
}

/// Has the body move faster by this twist.
pub(super) fn add_twist(body: &mut RigidBody, by: &Vector6<f64>) {
    let [velocity_W_m_s, spin_W_rad_s] = part(by);
    body.velocity_W_m_s += velocity_W_m_s;
    body.angular_velocity_B_rad_s += body.attitude_WB.inverse_transform_vector(&spin_W_rad_s);
}

/// Moves and turns a body by little.
pub(super) fn shift(body: &mut RigidBody, by: &Vector6<f64>) {
    let [by_W_m, by_W_rad] = part(by);
    body.position_W_m += by_W_m;
    let turn = Quaternion::from_parts(1.0, by_W_rad / 2.0);
    body.attitude_WB = UnitQuaternion::new_normalize(turn * body.attitude_WB.into_inner());
}

/// The mobility of a body that nothing ties.
pub(super) fn mobility(body: &RigidBody, mass_kg: f64, inverse_inertia: &Matrix3<f64>) -> Matrix6<f64> {
    let turn_WB = body.attitude_WB.to_rotation_matrix();
    let mut mobility = Matrix6::from_diagonal_element(1.0 / mass_kg);
    mobility.fixed_view_mut::<3, 3>(3, 3).copy_from(&(turn_WB * inverse_inertia * turn_WB.transpose()));
    mobility
}

/// The world, the vehicle and free bodies in the order of their numbers; within a step quaternions are not kept at
/// length 1, and here they are.
pub(super) fn lay_out(vehicle: &RigidBody, bodies: &[RigidBody], frames: &mut Vec<RigidBody>) {
    let upright = |body: &RigidBody| RigidBody {
        attitude_WB: UnitQuaternion::new_normalize(body.attitude_WB.into_inner()),
        ..*body
    };
    frames.clear();
    frames.extend([RigidBody::level_at(Vector3::zeros()), upright(vehicle)]);
    frames.extend(bodies.iter().map(upright));
}
