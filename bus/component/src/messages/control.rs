//! Messages of guidance beyond the pilot's set point, and status messages of controllers.

use super::{Time, Vector3};
use crate::{Bounded, Message};

/// A point of a trajectory.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Reference")]
pub struct Reference {
    /// Simulation time.
    pub stamp: Time,
    /// Position.
    #[field(unit = "m", frame = "world")]
    pub position: Vector3,
    /// Velocity.
    #[field(unit = "m/s", frame = "world")]
    pub velocity: Vector3,
    /// Acceleration.
    #[field(unit = "m/s^2", frame = "world")]
    pub acceleration: Vector3,
    /// Jerk.
    #[field(unit = "m/s^3", frame = "world")]
    pub jerk: Vector3,
    /// Snap.
    #[field(unit = "m/s^4", frame = "world")]
    pub snap: Vector3,
    /// Yaw.
    #[field(unit = "rad", frame = "world")]
    pub yaw: f64,
    /// Its rate of change.
    #[field(unit = "rad/s", frame = "world")]
    pub yaw_rate: f64,
}

/// The most channels of a remote control.
pub const RC_CHANNELS_MAX: usize = 16;

/// The channels of a remote control, as its receiver reports them.
///
/// ```
/// use component::messages::RcChannels;
///
/// let centred = RcChannels { pulse: [1500.0, 1500.0, 1000.0, 1500.0].into(), ..RcChannels::default() };
/// assert_eq!(centred.pulse.len(), 4);
/// ```
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/RcChannels")]
pub struct RcChannels {
    /// Simulation time.
    pub stamp: Time,
    /// Pulses, 1000 to 2000: roll, pitch, throttle and yaw, then the switches.
    #[field(unit = "us")]
    pub pulse: Bounded<f64, RC_CHANNELS_MAX>,
}

/// Status of a controller at a tick: its set points, its demand, the part of it that the rotors make, and its state.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ControlStatus")]
pub struct ControlStatus {
    /// Simulation time.
    pub stamp: Time,
    /// Altitude that its inner loops hold: the pilot's, or its outer loop's.
    #[field(unit = "m", frame = "world")]
    pub altitude_set_point: f64,
    /// Roll, pitch and yaw that its inner loops hold.
    #[field(unit = "rad", frame = "world")]
    pub attitude_set_point: [f64; 3],
    /// Velocity that its outer loop asks for, level axes along the heading; 0 without one.
    #[field(unit = "m/s")]
    pub velocity_set_point: [f64; 2],
    /// Demanded thrust along body z.
    #[field(unit = "N", frame = "body")]
    pub thrust: f64,
    /// Demanded torque.
    #[field(unit = "N*m", frame = "body")]
    pub torque: Vector3,
    /// Thrust made less thrust demanded; it is given up first.
    #[field(unit = "N")]
    pub thrust_error: f64,
    /// The part of the demanded roll and pitch torque that is made, 0 to 1.
    #[field(unit = "1")]
    pub roll_pitch_part: f64,
    /// The part of the demanded yaw torque that is made, 0 to 1.
    #[field(unit = "1")]
    pub yaw_part: f64,
    /// 1 if any of the demand was given up.
    #[field(unit = "1")]
    pub saturated: u32,
    /// State of its guidance: of `wall-follow` 1 to 5 as in the thesis, of `wall-stop` 1 cruising, 2 braking, 3
    /// holding; 0 without guidance.
    #[field(unit = "1")]
    pub state: u32,
    /// Laps flown.
    #[field(unit = "1")]
    pub laps: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}
