//! Estimated motion and outputs of a control law at a tick.

use crate::allocation::RotorWrench;
use crate::set_points::SetPoint;
use nalgebra::{UnitQuaternion, Vector3};

/// The vehicle's motion as its estimators believe it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotionEstimate {
    /// Position of the centre of mass in the world, m.
    pub position_W_m: Vector3<f64>,
    /// Velocity of the centre of mass in the world, m/s.
    pub velocity_W_m_s: Vector3<f64>,
    /// Attitude, body to world.
    pub attitude_WB: UnitQuaternion<f64>,
    /// Angular rate of the body against the world, body axes, rad/s.
    pub angular_velocity_B_rad_s: Vector3<f64>,
}

/// Outputs of a law: the wrench to make, and its report beside it.
#[derive(Debug, Clone, Copy, Default)]
pub struct ControlOutput {
    /// The wrench.
    pub wrench: RotorWrench,
    /// Part of it that the integrators ask for.
    pub integrals: Integrals,
    /// Set point of the inner loops.
    pub set_point: SetPoint,
    /// Set point of the outer loop: velocity along the heading's level x and y, m/s.
    pub velocity_m_s: [f64; 2],
    /// The state of the guidance; each guidance numbers its own.
    pub phase: u32,
    /// Laps flown.
    pub laps: u32,
}

/// Outputs of the integrators of a law, in units that mean the same to all laws.
///
/// They are accelerations, not integrals of an error, so that a backup with other gains goes on without a jump.
#[derive(Debug, Clone, Copy, PartialEq, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ControlIntegrals")]
pub struct Integrals {
    /// Vertical acceleration.
    #[field(unit = "m/s^2", frame = "world")]
    pub lift: f64,
    /// Angular accelerations for roll, pitch and yaw; zero under `lqr` and `geometric`, which observe a lift alone.
    #[field(unit = "rad/s^2", frame = "body")]
    pub turn: [f64; 3],
}

/// The motion as the loops about hover see it: height, climb, the three angles and the body rates.
///
/// ```
/// use controllers::control::{HoverMotion, MotionEstimate};
/// use nalgebra::{UnitQuaternion, Vector3};
///
/// let attitude_WB = UnitQuaternion::from_euler_angles(0.0, 0.2, 1.0);
/// let motion = MotionEstimate { position_W_m: Vector3::z(), attitude_WB, ..MotionEstimate::default() };
/// let found = HoverMotion::of(&motion);
/// assert!(found.altitude_m == 1.0 && (found.pitch_rad - 0.2).abs() < 1e-12 && (found.yaw_rad - 1.0).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoverMotion {
    /// Height, m.
    pub altitude_m: f64,
    /// Rate of climb, m/s.
    pub climb_rate_m_s: f64,
    /// Roll, rad.
    pub roll_rad: f64,
    /// Pitch, positive for nose down, rad.
    pub pitch_rad: f64,
    /// Yaw, counter-clockwise from above, rad.
    pub yaw_rad: f64,
    /// Angular rate of the body against the world, body axes, rad/s.
    pub angular_velocity_B_rad_s: Vector3<f64>,
}

impl HoverMotion {
    /// The estimated motion, height and climb in the world.
    #[must_use]
    pub fn of(motion: &MotionEstimate) -> Self {
        let (roll_rad, pitch_rad, yaw_rad) = motion.attitude_WB.euler_angles();
        Self {
            altitude_m: motion.position_W_m.z,
            climb_rate_m_s: motion.velocity_W_m_s.z,
            roll_rad,
            pitch_rad,
            yaw_rad,
            angular_velocity_B_rad_s: motion.angular_velocity_B_rad_s,
        }
    }
}

/// `value` cut to ±`max`; nothing of a value that is not a number.
pub(crate) fn within(value: f64, max: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value.clamp(-max, max) }
}
