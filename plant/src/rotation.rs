//! Turning vectors by quaternions that are not quite of length 1, as those inside of an integration step.

use nalgebra::{Quaternion, Vector3};

/// A body vector in the world frame: v + 2 u x (u x v + a v) / |q|^2 with q = (a, u).
pub(crate) fn rotated(attitude_WB: &Quaternion<f64>, vector_B: &Vector3<f64>) -> Vector3<f64> {
    let imaginary = attitude_WB.imag();
    let inner = imaginary.cross(vector_B) + vector_B * attitude_WB.scalar();
    vector_B + imaginary.cross(&inner) * (2.0 / attitude_WB.norm_squared())
}

/// A world vector in the body frame.
pub(crate) fn rotated_back(attitude_WB: &Quaternion<f64>, vector_W: &Vector3<f64>) -> Vector3<f64> {
    rotated(&attitude_WB.conjugate(), vector_W)
}
