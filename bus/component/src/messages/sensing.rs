//! Messages of sensors other than the IMU, and of estimators.
//!
//! A sensor sends a sample at each of its periods, as every publisher does. `valid` is 1 in a sample that holds
//! a measurement and 0 where it was lost; the other fields then hold what was measured last.

use super::{PerRotor, Quaternion, Time, Vector3};
use crate::Message;

/// Reading of a satellite receiver, in the world's axes.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Gps")]
pub struct Gps {
    /// Simulation time of sending.
    pub stamp: Time,
    /// Simulation time at which it was measured.
    #[field(unit = "ns")]
    pub measured_ns: u64,
    /// Position of the centre of mass.
    #[field(unit = "m", frame = "world")]
    pub position: Vector3,
    /// Velocity of the centre of mass.
    #[field(unit = "m/s", frame = "world")]
    pub velocity: Vector3,
    /// 1 if this sample holds a measurement, 0 if it was lost.
    #[field(unit = "1")]
    pub valid: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}

/// Reading of a barometer.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Barometer")]
pub struct Barometer {
    /// Simulation time of sending.
    pub stamp: Time,
    /// Simulation time at which it was measured.
    #[field(unit = "ns")]
    pub measured_ns: u64,
    /// Static pressure.
    #[field(unit = "Pa")]
    pub pressure: f64,
    /// Height above the world's origin that the pressure means in the standard atmosphere.
    #[field(unit = "m", frame = "world")]
    pub altitude: f64,
    /// 1 if this sample holds a measurement, 0 if it was lost.
    #[field(unit = "1")]
    pub valid: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}

/// Reading of a magnetometer.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Magnetometer")]
pub struct Magnetometer {
    /// Simulation time of sending.
    pub stamp: Time,
    /// Simulation time at which it was measured.
    #[field(unit = "ns")]
    pub measured_ns: u64,
    /// Magnetic flux density.
    #[field(unit = "T", frame = "body")]
    pub field: Vector3,
    /// 1 if this sample holds a measurement, 0 if it was lost.
    #[field(unit = "1")]
    pub valid: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}

/// Reading of a motion-capture system.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Mocap")]
pub struct Mocap {
    /// Simulation time of sending.
    pub stamp: Time,
    /// Simulation time at which it was measured.
    #[field(unit = "ns")]
    pub measured_ns: u64,
    /// Position of the centre of mass.
    #[field(unit = "m", frame = "world")]
    pub position: Vector3,
    /// Attitude, body to world.
    #[field(frame = "world")]
    pub attitude: Quaternion,
    /// 1 if this sample holds a measurement, 0 if it was lost.
    #[field(unit = "1")]
    pub valid: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}

/// Readings of five range finders, in the order +x, -x, +y, -y of the body, and down.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Ranges")]
pub struct Ranges {
    /// Simulation time of sending.
    pub stamp: Time,
    /// Simulation time at which it was measured.
    #[field(unit = "ns")]
    pub measured_ns: u64,
    /// Distances; the sensor's reach where nothing is met.
    #[field(unit = "m", frame = "body")]
    pub distance: [f64; 5],
    /// 1 for each beam that measured something, 0 where it met nothing within reach or was lost.
    #[field(unit = "1")]
    pub valid: [u32; 5],
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}

/// Readings of the motor controllers.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/RotorSpeeds")]
pub struct RotorSpeeds {
    /// Simulation time of sending.
    pub stamp: Time,
    /// Simulation time at which it was measured.
    #[field(unit = "ns")]
    pub measured_ns: u64,
    /// 1 if this sample holds a measurement, 0 if it was lost.
    #[field(unit = "1")]
    pub valid: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
    /// Speeds of the rotors, in the order of the vehicle file.
    #[field(unit = "rad/s")]
    pub rotor_speed: PerRotor,
}

/// Voltage and current of the battery, true or measured.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Battery")]
pub struct Battery {
    /// Simulation time of sending.
    pub stamp: Time,
    /// Simulation time at which it was measured.
    #[field(unit = "ns")]
    pub measured_ns: u64,
    /// Voltage at the terminals.
    #[field(unit = "V")]
    pub voltage: f64,
    /// Current drawn.
    #[field(unit = "A")]
    pub current: f64,
    /// Remaining part of the capacity, 0 to 1.
    #[field(unit = "1")]
    pub charge: f64,
    /// 1 if this sample holds a measurement, 0 if it was lost or the plant has no model of its battery.
    #[field(unit = "1")]
    pub valid: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}

/// Contacts of the plant with the ground, the scene's things and other vehicles.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Contact")]
pub struct Contact {
    /// Simulation time.
    pub stamp: Time,
    /// Sum of the contact forces over the last tick.
    #[field(unit = "N", frame = "world")]
    pub force: Vector3,
    /// Speed of approach just before the newest impact: a part of the vehicle, a foot or the disc of propellers,
    /// touched something that it had not touched. The fastest of those within a tick; 0 without a contact.
    #[field(unit = "m/s")]
    pub impact_speed: f64,
    /// Number of things touched: the ground, boxes, other vehicles.
    #[field(unit = "1")]
    pub count: u32,
    /// Object of the first contact: 0 nothing, 1 the ground, 2 + i the scene's thing i (boxes first, then meshes), 1000 + i the other vehicle i.
    #[field(unit = "1")]
    pub object: u32,
    /// Contacts that began since the run started, resting on the ground at the start left out.
    #[field(unit = "1")]
    pub began: u32,
    /// 1 from the first impact on that was faster than the vehicle bears.
    #[field(unit = "1")]
    pub crashed: u32,
}

/// True distances from a vehicle to the things of the scene: for judging and plotting, not for controllers.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Clearance")]
pub struct Clearance {
    /// Simulation time.
    pub stamp: Time,
    /// Distance from the centre of mass to the nearest box.
    #[field(unit = "m", frame = "world")]
    pub nearest: f64,
    /// Distances to what stands along the world's +x, -x, +y, -y; 1000 where nothing does.
    #[field(unit = "m", frame = "world")]
    pub wall: [f64; 4],
    /// The smallest of them less the distance that is to be kept.
    #[field(unit = "m", frame = "world")]
    pub side_error: f64,
    /// Turns flown about the world's origin, clockwise from above as positive: laps of a room.
    #[field(unit = "1")]
    pub laps: f64,
    /// 1 in the corner between two walls, where both are about as far as is to be kept; 0 along a side.
    #[field(unit = "1")]
    pub corner: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}

/// Positions and velocities of the vehicles of a run, for vehicles that share a room.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Traffic")]
pub struct Traffic {
    /// Simulation time.
    pub stamp: Time,
    /// Number of vehicles.
    #[field(unit = "1")]
    pub count: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
    /// Positions of their centres of mass, in the order of the inputs' names.
    #[field(unit = "m", frame = "world")]
    pub position: [Vector3; 32],
    /// Their velocities.
    #[field(unit = "m/s", frame = "world")]
    pub velocity: [Vector3; 32],
}

/// Poses and velocities of the free bodies of a scene, in the order of the scene: those beyond `count` are zeros.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/BodyStates")]
pub struct BodyStates {
    /// Simulation time.
    pub stamp: Time,
    /// Number of bodies.
    #[field(unit = "1")]
    pub count: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
    /// Their numbers among the things of the scene, as `Contact` counts them: 2 + i of the thing i.
    #[field(unit = "1")]
    pub object: [u32; 16],
    /// Positions of their centres of mass.
    #[field(unit = "m", frame = "world")]
    pub position: [Vector3; 16],
    /// Attitudes, the body's own axes to the world's.
    #[field(frame = "world")]
    pub attitude: [Quaternion; 16],
    /// Velocities of their centres of mass.
    #[field(unit = "m/s", frame = "world")]
    pub velocity: [Vector3; 16],
    /// Angular velocities.
    #[field(unit = "rad/s", frame = "world")]
    pub angular_velocity: [Vector3; 16],
}

/// Estimate of the vehicle's motion.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/StateEstimate")]
pub struct StateEstimate {
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
    /// Angular velocity, the gyroscope's estimated bias taken off.
    #[field(unit = "rad/s", frame = "body")]
    pub angular_velocity: Vector3,
    /// Standard deviation of the position as the estimator believes it.
    #[field(unit = "m", frame = "world")]
    pub position_sigma: Vector3,
    /// Standard deviation of the velocity.
    #[field(unit = "m/s", frame = "world")]
    pub velocity_sigma: Vector3,
    /// Standard deviation of the attitude, as a rotation vector.
    #[field(unit = "rad", frame = "body")]
    pub attitude_sigma: Vector3,
}

/// Agreement of an estimator's predictions with its measurements: the last update of each sensor.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/Innovation")]
pub struct Innovation {
    /// Simulation time.
    pub stamp: Time,
    /// Normalised innovation squared of the last update by GPS, motion capture, barometer, magnetometer.
    #[field(unit = "1")]
    pub normalised_squared: [f64; 4],
    /// Its degrees of freedom, which it should equal on average.
    #[field(unit = "1")]
    pub degrees_of_freedom: [u32; 4],
    /// Updates so far.
    #[field(unit = "1")]
    pub updates: [u32; 4],
    /// Measurements refused as outliers so far.
    #[field(unit = "1")]
    pub refused: [u32; 4],
}

/// Estimate from range finders: level distances to the surroundings, height and velocity.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/WallEstimate")]
pub struct WallEstimate {
    /// Simulation time.
    pub stamp: Time,
    /// Level distances along the heading's +x, -x, +y, -y; the sensor's reach where nothing is in sight.
    #[field(unit = "m")]
    pub distance: [f64; 4],
    /// 1 where a wall is in sight.
    #[field(unit = "1")]
    pub in_sight: [u32; 4],
    /// Velocity along the heading's x and y: level axes that turn with the yaw.
    #[field(unit = "m/s")]
    pub velocity: [f64; 2],
    /// Height above what is below.
    #[field(unit = "m")]
    pub height: f64,
    /// Rate of climb.
    #[field(unit = "m/s")]
    pub climb_rate: f64,
}
