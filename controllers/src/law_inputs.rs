//! Inputs of laws from the bus.

use crate::control::{ControlInput, MotionEstimate};
use crate::set_points::SetPoint;
use bus::InputPorts;
use bus::messages::{
    AttitudeEstimate, Reference, SetPoint as SetPointMessage, StateEstimate, Vector3 as VectorMessage,
    WallEstimate,
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

impl From<SetPointInputs<'_>> for ControlInput {
    fn from(inputs: SetPointInputs<'_>) -> Self {
        let SetPointMessage { altitude, roll, pitch, yaw, .. } = *inputs.set_point;
        let set_point = SetPoint { altitude_m: altitude, roll_rad: roll, pitch_rad: pitch, yaw_rad: yaw };
        Self { motion: motion(inputs.estimate, inputs.attitude), set_point, ..Self::default() }
    }
}

impl From<ReferenceInputs<'_>> for ControlInput {
    fn from(inputs: ReferenceInputs<'_>) -> Self {
        let motion = motion(inputs.estimate, inputs.attitude);
        Self { motion, reference: *inputs.reference, ..Self::default() }
    }
}

impl From<VelocityInputs<'_>> for ControlInput {
    fn from(inputs: VelocityInputs<'_>) -> Self {
        let motion = motion(inputs.estimate, inputs.attitude);
        Self { motion, reference: inputs.reference.copied().unwrap_or_default(), ..Self::default() }
    }
}

impl From<WallInputs<'_>> for ControlInput {
    fn from(inputs: WallInputs<'_>) -> Self {
        let motion = motion(&StateEstimate::default(), Some(inputs.attitude));
        Self { motion, walls: *inputs.walls, ..Self::default() }
    }
}

/// The motion by `estimate`; attitude and rates by `attitude` where that is wired.
fn motion(estimate: &StateEstimate, attitude: Option<&AttitudeEstimate>) -> MotionEstimate {
    let vector = |v: VectorMessage| Vector3::from(<[f64; 3]>::from(v));
    let q = attitude.map_or(estimate.attitude, |attitude| attitude.attitude);
    let rates = attitude.map_or(estimate.angular_velocity, |attitude| attitude.angular_velocity);
    MotionEstimate {
        position_W_m: vector(estimate.position),
        velocity_W_m_s: vector(estimate.velocity),
        attitude_WB: UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.x, q.y, q.z)),
        angular_velocity_B_rad_s: vector(rates),
    }
}
