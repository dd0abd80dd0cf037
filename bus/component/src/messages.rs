//! The messages of the built-in nodes, and the standard ROS 2 messages that other tools know.
//!
//! Frames: `world` is z up; `body` is x forward, y left, z up, its origin in the centre of mass.
//!
//! ```
//! use component::messages::{PlantState, Vector3};
//!
//! let state = PlantState { position: Vector3 { z: 1.5, ..Vector3::default() }, ..PlantState::default() };
//! assert_eq!(state.attitude.w, 1.0, "level by default");
//! ```

use crate::schema::{FieldType, Kind};
use crate::{Bounded, Message};

mod control;
mod path;
mod sensing;
mod standard;
mod transform;

pub use control::{ControlStatus, RC_CHANNELS_MAX, RcChannels, Reference};
pub use path::PlannedPath;
pub use sensing::{
    Barometer, Battery, BodyStates, Clearance, Contact, Gps, Innovation, Magnetometer, Mocap, Ranges,
    RotorSpeeds, StateEstimate, Traffic, WallEstimate,
};
pub use standard::{Actuators, LaserScan, Odometry, StandardImu, StandardRange};
pub use transform::{BodyTransform, FRAME_BYTES_MAX, FrameName, body_frame};

/// The most rotors that a vehicle has.
pub const ROTORS_MAX: usize = 12;

/// A number for each rotor of a vehicle, in the order of its vehicle file.
///
/// ```
/// use component::messages::{MotorCommand, PerRotor};
///
/// let hexacopter = MotorCommand { command: PerRotor::filled(6, 76.5), ..MotorCommand::default() };
/// assert_eq!(hexacopter.command.len(), 6);
/// let quadrotor = MotorCommand { command: [76.5; 4].into(), ..MotorCommand::default() };
/// assert_eq!(quadrotor.command, [76.5; 4]);
/// ```
pub type PerRotor = Bounded<f64, ROTORS_MAX>;

/// Simulation time as ROS 2 writes it. The bus fills it in when a sample is sent.
///
/// ```
/// let time = component::messages::Time::from_ns(1_500_000_000);
/// assert_eq!((time.sec, time.nanosec), (1, 500_000_000));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Message)]
#[repr(C)]
#[message(type_name = "builtin_interfaces/msg/Time")]
pub struct Time {
    /// Whole seconds since tick 0.
    #[field(unit = "s")]
    pub sec: i32,
    /// The rest, 0 to 999 999 999.
    #[field(unit = "ns")]
    pub nanosec: u32,
}

impl Time {
    /// The time `ns` nanoseconds after tick 0.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "a run is far shorter than 2^31 s")]
    pub const fn from_ns(ns: u64) -> Self {
        Self { sec: (ns / 1_000_000_000) as i32, nanosec: (ns % 1_000_000_000) as u32 }
    }
}

/// Three numbers along the axes of a frame.
///
/// ```
/// let position = component::messages::Vector3::from([1.0, 2.0, 3.0]);
/// assert_eq!(position.z, 3.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Vector3")]
pub struct Vector3 {
    /// Along x.
    #[field(unit = "")]
    pub x: f64,
    /// Along y.
    #[field(unit = "")]
    pub y: f64,
    /// Along z.
    #[field(unit = "")]
    pub z: f64,
}

impl From<[f64; 3]> for Vector3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<Vector3> for [f64; 3] {
    fn from(v: Vector3) -> Self {
        [v.x, v.y, v.z]
    }
}

/// A unit quaternion, Hamilton convention, stored x, y, z, w; it rotates body vectors into the world.
///
/// ```
/// // Level, and turned nowhere.
/// let component::messages::Quaternion { x, y, z, w } = Default::default();
/// assert_eq!([x, y, z, w], [0.0, 0.0, 0.0, 1.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Quaternion")]
pub struct Quaternion {
    /// Vector part along x.
    #[field(unit = "1")]
    pub x: f64,
    /// Vector part along y.
    #[field(unit = "1")]
    pub y: f64,
    /// Vector part along z.
    #[field(unit = "1")]
    pub z: f64,
    /// Scalar part.
    #[field(unit = "1")]
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

/// The true state of a vehicle and its rotors. Sensors and recorders read it; estimators do not.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/PlantState")]
pub struct PlantState {
    /// Simulation time.
    pub stamp: Time,
    /// Position of the centre of mass.
    #[field(unit = "m", frame = "world")]
    pub position: Vector3,
    /// Velocity of the centre of mass.
    #[field(unit = "m/s", frame = "world")]
    pub velocity: Vector3,
    /// Attitude, body to world.
    #[field(frame = "world")]
    pub attitude: Quaternion,
    /// Angular velocity of the body against the world.
    #[field(unit = "rad/s", frame = "body")]
    pub angular_velocity: Vector3,
    /// Specific force at the centre of mass: what an ideal accelerometer there reads.
    #[field(unit = "m/s^2", frame = "body")]
    pub specific_force: Vector3,
    /// Rotor speeds, in the order of the vehicle file.
    #[field(unit = "rad/s")]
    pub rotor_speed: PerRotor,
}

/// A pose that 3-D views draw, at frame `map` (the world).
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "geometry_msgs/msg/PoseStamped")]
pub struct PoseStamped {
    /// Time and frame.
    pub header: Header,
    /// The pose.
    pub pose: Pose,
}

/// Time and the constant frame name `map`.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "std_msgs/msg/Header")]
pub struct Header {
    /// Simulation time.
    pub stamp: Time,
    /// Frame name.
    pub frame_id: MapFrame,
}

/// Position and attitude.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "geometry_msgs/msg/Pose")]
pub struct Pose {
    /// Position.
    #[field(unit = "m", frame = "world")]
    pub position: Point,
    /// Attitude, body to world.
    #[field(frame = "world")]
    pub orientation: Orientation,
}

/// A point; ROS 2's own name for three coordinates.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "geometry_msgs/msg/Point")]
pub struct Point {
    /// Along x.
    #[field(unit = "")]
    pub x: f64,
    /// Along y.
    #[field(unit = "")]
    pub y: f64,
    /// Along z.
    #[field(unit = "")]
    pub z: f64,
}

/// A unit quaternion under ROS 2's own name, stored x, y, z, w.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "geometry_msgs/msg/Quaternion")]
pub struct Orientation {
    /// Vector part along x.
    #[field(unit = "1")]
    pub x: f64,
    /// Vector part along y.
    #[field(unit = "1")]
    pub y: f64,
    /// Vector part along z.
    #[field(unit = "1")]
    pub z: f64,
    /// Scalar part.
    #[field(unit = "1")]
    pub w: f64,
}

/// The string `map`, laid out as CDR writes it; three letters keep what follows aligned.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct MapFrame {
    length: u32,
    text: [u8; 4],
}

impl Default for MapFrame {
    fn default() -> Self {
        Self { length: 4, text: *b"map\0" }
    }
}

impl FieldType for MapFrame {
    const KIND: Kind = Kind::Text;
}

/// Reading of an inertial measurement unit.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Imu")]
pub struct Imu {
    /// Simulation time.
    pub stamp: Time,
    /// Measured specific force (at rest: +g along z).
    #[field(unit = "m/s^2", frame = "body")]
    pub specific_force: Vector3,
    /// Measured angular velocity.
    #[field(unit = "rad/s", frame = "body")]
    pub angular_velocity: Vector3,
}

/// Estimated attitude and angular velocity.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/AttitudeEstimate")]
pub struct AttitudeEstimate {
    /// Simulation time.
    pub stamp: Time,
    /// Attitude, body to world.
    #[field(frame = "world")]
    pub attitude: Quaternion,
    /// Roll about body x (z-y-x sequence).
    #[field(unit = "rad", frame = "world")]
    pub roll: f64,
    /// Pitch about y, positive nose down.
    #[field(unit = "rad", frame = "world")]
    pub pitch: f64,
    /// Yaw about world z, positive counter-clockwise from above.
    #[field(unit = "rad", frame = "world")]
    pub yaw: f64,
    /// Angular velocity.
    #[field(unit = "rad/s", frame = "body")]
    pub angular_velocity: Vector3,
}

/// Set points that a pilot or a planner gives to the controller.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/SetPoint")]
pub struct SetPoint {
    /// Simulation time.
    pub stamp: Time,
    /// Altitude of the centre of mass.
    #[field(unit = "m", frame = "world")]
    pub altitude: f64,
    /// Roll.
    #[field(unit = "rad", frame = "world")]
    pub roll: f64,
    /// Pitch, positive nose down.
    #[field(unit = "rad", frame = "world")]
    pub pitch: f64,
    /// Yaw.
    #[field(unit = "rad", frame = "world")]
    pub yaw: f64,
}

/// Motor commands in the vehicle's own raw counts (Hummingbird 1…200, Crazyflie 0…65535).
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/MotorCommand")]
pub struct MotorCommand {
    /// Simulation time.
    pub stamp: Time,
    /// Commands in the order of the vehicle file's rotors; its `command` table maps them to speeds.
    #[field(unit = "count")]
    pub command: PerRotor,
}

/// A vehicle's state as measured in a real flight.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/MeasuredState")]
pub struct MeasuredState {
    /// Simulation time.
    pub stamp: Time,
    /// Position.
    #[field(unit = "m", frame = "world")]
    pub position: Vector3,
    /// Velocity.
    #[field(unit = "m/s", frame = "world")]
    pub velocity: Vector3,
    /// Attitude, body to world.
    #[field(frame = "world")]
    pub attitude: Quaternion,
    /// Angular velocity.
    #[field(unit = "rad/s", frame = "body")]
    pub angular_velocity: Vector3,
}

#[cfg(test)]
mod tests {
    use super::{MapFrame, PoseStamped, Time};

    /// Sizes of the CDR bodies of the real ROS 2 messages with these frame names.
    #[test]
    fn standard_messages_have_their_cdr_size() {
        assert_eq!(size_of::<PoseStamped>(), 72);
        assert_eq!(bytemuck::bytes_of(&MapFrame::default()), b"\x04\0\0\0map\0");
    }

    #[test]
    fn time_splits_at_the_second() {
        assert_eq!(Time::from_ns(2_000_000_001), Time { sec: 2, nanosec: 1 });
    }
}
