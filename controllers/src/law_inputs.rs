//! Inputs of laws: their ports, and the quantities in them.
//!
//! A law with other inputs declares ports of its own in its own file.

use crate::control::{HoverMotion, MotionEstimate};
use crate::set_points::SetPoint;
use component::InputPorts;
use component::messages::{
    AttitudeEstimate, Quaternion as QuaternionMessage, Reference, SetPoint as SetPointMessage, StateEstimate,
    Vector3 as VectorMessage, WallEstimate,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Inputs of a law around a pilot's set points.
#[derive(Debug, InputPorts)]
pub struct SetPointInputs<'a> {
    /// Set point of the pilot.
    pub set_point: &'a SetPointMessage,
    /// The motion.
    pub estimate: &'a StateEstimate,
    /// Attitude and rates, where another estimator gives them.
    pub attitude: Option<&'a AttitudeEstimate>,
}

/// Inputs of a law that follows a trajectory.
#[derive(Debug, InputPorts)]
pub struct ReferenceInputs<'a> {
    /// Point of the trajectory.
    pub reference: &'a Reference,
    /// The motion.
    pub estimate: &'a StateEstimate,
    /// Attitude and rates, where another estimator gives them.
    pub attitude: Option<&'a AttitudeEstimate>,
}

/// Inputs of a law that follows a velocity.
#[derive(Debug, InputPorts)]
pub struct VelocityInputs<'a> {
    /// The motion.
    pub estimate: &'a StateEstimate,
    /// Attitude and rates, where another estimator gives them.
    pub attitude: Option<&'a AttitudeEstimate>,
    /// The velocity, where it is not a parameter.
    pub reference: Option<&'a Reference>,
}

/// Inputs of a law that is guided by range finders.
#[derive(Debug, InputPorts)]
pub struct WallInputs<'a> {
    /// Walls, height and velocities.
    pub walls: &'a WallEstimate,
    /// Attitude and rates.
    pub attitude: &'a AttitudeEstimate,
}

impl SetPointInputs<'_> {
    /// Set point of the pilot.
    #[must_use]
    pub fn asked(&self) -> SetPoint {
        self.set_point.into()
    }

    /// The estimated motion.
    #[must_use]
    pub fn motion(&self) -> MotionEstimate {
        motion(self.estimate, self.attitude)
    }
}

impl ReferenceInputs<'_> {
    /// The estimated motion.
    #[must_use]
    pub fn motion(&self) -> MotionEstimate {
        motion(self.estimate, self.attitude)
    }
}

impl VelocityInputs<'_> {
    /// The estimated motion.
    #[must_use]
    pub fn motion(&self) -> MotionEstimate {
        motion(self.estimate, self.attitude)
    }
}

impl WallInputs<'_> {
    /// The estimated motion, with height and climb by the beam downwards.
    #[must_use]
    pub fn measured(&self) -> HoverMotion {
        let (roll_rad, pitch_rad, yaw_rad) = rotation(self.attitude.attitude).euler_angles();
        HoverMotion {
            altitude_m: self.walls.height,
            climb_rate_m_s: self.walls.climb_rate,
            roll_rad,
            pitch_rad,
            yaw_rad,
            angular_velocity_B_rad_s: vector(self.attitude.angular_velocity),
        }
    }
}

/// The motion by `estimate`; attitude and rates by `attitude` where that is wired.
fn motion(estimate: &StateEstimate, attitude: Option<&AttitudeEstimate>) -> MotionEstimate {
    let q = attitude.map_or(estimate.attitude, |attitude| attitude.attitude);
    let rates = attitude.map_or(estimate.angular_velocity, |attitude| attitude.angular_velocity);
    MotionEstimate {
        position_W_m: vector(estimate.position),
        velocity_W_m_s: vector(estimate.velocity),
        attitude_WB: rotation(q),
        angular_velocity_B_rad_s: vector(rates),
    }
}

fn vector(v: VectorMessage) -> Vector3<f64> {
    <[f64; 3]>::from(v).into()
}

fn rotation(q: QuaternionMessage) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.x, q.y, q.z))
}

impl From<&MotionEstimate> for StateEstimate {
    fn from(motion: &MotionEstimate) -> Self {
        Self {
            position: vector_message(&motion.position_W_m),
            velocity: vector_message(&motion.velocity_W_m_s),
            attitude: rotation_message(&motion.attitude_WB),
            angular_velocity: vector_message(&motion.angular_velocity_B_rad_s),
            ..Self::default()
        }
    }
}

impl From<&MotionEstimate> for AttitudeEstimate {
    fn from(motion: &MotionEstimate) -> Self {
        let (roll, pitch, yaw) = motion.attitude_WB.euler_angles();
        let attitude = rotation_message(&motion.attitude_WB);
        let angular_velocity = vector_message(&motion.angular_velocity_B_rad_s);
        Self { attitude, roll, pitch, yaw, angular_velocity, ..Self::default() }
    }
}

fn vector_message(v: &Vector3<f64>) -> VectorMessage {
    <[f64; 3]>::from(*v).into()
}

fn rotation_message(rotation: &UnitQuaternion<f64>) -> QuaternionMessage {
    let [x, y, z, w] = rotation.coords.into();
    QuaternionMessage { x, y, z, w }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turning() -> MotionEstimate {
        MotionEstimate {
            position_W_m: Vector3::new(1.0, -2.0, 3.0),
            velocity_W_m_s: Vector3::new(0.1, 0.2, -0.3),
            attitude_WB: UnitQuaternion::from_euler_angles(0.2, -0.1, 2.0),
            angular_velocity_B_rad_s: Vector3::new(0.5, -0.6, 0.7),
        }
    }

    #[test]
    fn a_motion_in_messages_is_read_bit_by_bit() {
        let (estimate, attitude) = (StateEstimate::from(&turning()), AttitudeEstimate::from(&turning()));
        assert_eq!(motion(&estimate, None), turning());
        assert_eq!(motion(&estimate, Some(&attitude)), turning());
    }

    #[test]
    fn another_estimator_gives_attitude_and_rates_alone() {
        let attitude = AttitudeEstimate::default();
        let found = motion(&StateEstimate::from(&turning()), Some(&attitude));
        let level = MotionEstimate {
            attitude_WB: UnitQuaternion::identity(),
            angular_velocity_B_rad_s: Vector3::zeros(),
            ..turning()
        };
        assert_eq!(found, level);
    }

    #[test]
    fn a_law_by_range_finders_has_height_and_climb_from_the_beam_downwards() {
        let walls = WallEstimate { height: 1.5, climb_rate: -0.2, ..WallEstimate::default() };
        let found = WallInputs { walls: &walls, attitude: &AttitudeEstimate::from(&turning()) }.measured();
        let expected = HoverMotion { altitude_m: 1.5, climb_rate_m_s: -0.2, ..HoverMotion::of(&turning()) };
        assert_eq!(found, expected);
    }
}
