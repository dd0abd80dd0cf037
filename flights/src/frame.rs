//! From the frames of a log into those of this project.
//!
//! North-east-down becomes east-north-up: x is then east, y north. Heading north, which is yaw 0 in the log, is a
//! yaw of 90 degrees here.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use crate::declaration::{Frame, Holds};

/// A vector of the world.
pub fn world(frame: Frame, [x, y, z]: [f64; 3]) -> [f64; 3] {
    match frame {
        Frame::FluEnu => [x, y, z],
        Frame::FrdNed => [y, x, -z],
    }
}

/// A vector of the body.
pub fn body(frame: Frame, [x, y, z]: [f64; 3]) -> [f64; 3] {
    match frame {
        Frame::FluEnu => [x, y, z],
        Frame::FrdNed => [x, -y, -z],
    }
}

/// A specific force or an angular velocity as the log holds it, in the world or in the body.
pub fn axes(frame: Frame, holds: Holds, vector: [f64; 3]) -> [f64; 3] {
    if holds.is_in_world() { world(frame, vector) } else { body(frame, vector) }
}

/// An attitude, body to world, given and returned in the order w, x, y, z.
pub fn attitude(frame: Frame, [w, x, y, z]: [f64; 4]) -> [f64; 4] {
    match frame {
        Frame::FluEnu => [w, x, y, z],
        Frame::FrdNed => {
            to_wxyz(enu_ned().into_inner() * Quaternion::new(w, x, y, z) * frd_flu().into_inner())
        }
    }
}

/// The attitude of roll, pitch and yaw in radians, z-y-x sequence, in the order w, x, y, z.
pub fn euler([roll, pitch, yaw]: [f64; 3]) -> [f64; 4] {
    to_wxyz(UnitQuaternion::from_euler_angles(roll, pitch, yaw).into_inner())
}

/// The rotation of a quaternion in the order w, x, y, z.
pub fn rotation([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// The order w, x, y, z of a quaternion.
pub fn to_wxyz(q: Quaternion<f64>) -> [f64; 4] {
    [q.w, q.i, q.j, q.k]
}

/// Takes vectors from north-east-down to east-north-up: a half turn about the axis between x and y.
fn enu_ned() -> UnitQuaternion<f64> {
    let matrix = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
}

/// Takes vectors from forward-left-up to forward-right-down: a half turn about x.
fn frd_flu() -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotate(wxyz: [f64; 4], v: [f64; 3]) -> [f64; 3] {
        (rotation(wxyz) * Vector3::from(v)).into()
    }

    fn near(a: [f64; 3], b: [f64; 3]) {
        assert!((Vector3::from(a) - Vector3::from(b)).norm() < 1e-12, "{a:?} is not {b:?}");
    }

    #[test]
    fn level_and_heading_north_is_level_with_x_along_our_y() {
        let q = attitude(Frame::FrdNed, [1.0, 0.0, 0.0, 0.0]);
        near(rotate(q, [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]);
        near(rotate(q, [0.0, 0.0, 1.0]), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn a_vector_is_the_same_whether_turned_before_or_after_the_frames_change() {
        let ned = euler([0.3, -0.5, 1.1]);
        for v in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, -0.7, 3.0]] {
            let ours = rotate(attitude(Frame::FrdNed, ned), body(Frame::FrdNed, v));
            near(ours, world(Frame::FrdNed, rotate(ned, v)));
        }
    }

    #[test]
    fn nose_up_in_one_frame_is_nose_up_in_the_other() {
        // Pitch is positive nose up with z down: the nose points to where z of our world is positive.
        let q = attitude(Frame::FrdNed, euler([0.0, 0.2, 0.0]));
        assert!(rotate(q, [1.0, 0.0, 0.0])[2] > 0.19);
        // Clockwise from north is towards east, our x.
        let q = attitude(Frame::FrdNed, euler([0.0, 0.0, 0.5]));
        assert!(rotate(q, [1.0, 0.0, 0.0])[0] > 0.4);
    }
}
