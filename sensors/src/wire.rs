//! The vectors and quaternions of messages as those of nalgebra, and back.

use component::messages::{BodyStates, Quaternion, Vector3};
use scenes::{BODIES_MAX, BodyPose};

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

/// The poses of a message's free bodies; none without one.
pub(crate) fn body_poses(message: Option<&BodyStates>) -> ([BodyPose; BODIES_MAX], usize) {
    let nowhere = BodyPose {
        position_W_m: nalgebra::Vector3::zeros(),
        attitude_W: nalgebra::UnitQuaternion::identity(),
    };
    let mut poses = [nowhere; BODIES_MAX];
    let Some(message) = message else { return (poses, 0) };
    let count = (message.count as usize).min(BODIES_MAX);
    for (place, pose) in poses[..count].iter_mut().enumerate() {
        *pose = BodyPose {
            position_W_m: vector(message.position[place]),
            attitude_W: attitude(message.attitude[place]),
        };
    }
    (poses, count)
}
