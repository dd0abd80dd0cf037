//! The vectors and quaternions of messages as those of nalgebra, and back.

use bus::messages::{Quaternion, Vector3};

/// A message's vector.
pub(crate) fn vector(message: Vector3) -> nalgebra::Vector3<f64> {
    <[f64; 3]>::from(message).into()
}

/// A vector for a message.
pub(crate) fn vector_message(vector: nalgebra::Vector3<f64>) -> Vector3 {
    <[f64; 3]>::from(vector).into()
}

/// A message's attitude, which is a unit quaternion already: normalising it again would change its last bits.
pub(crate) fn attitude(message: Quaternion) -> nalgebra::UnitQuaternion<f64> {
    let Quaternion { x, y, z, w } = message;
    nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(w, x, y, z))
}

/// An attitude for a message.
pub(crate) fn attitude_message(attitude_WB: nalgebra::UnitQuaternion<f64>) -> Quaternion {
    let [x, y, z, w] = attitude_WB.coords.into();
    Quaternion { x, y, z, w }
}
