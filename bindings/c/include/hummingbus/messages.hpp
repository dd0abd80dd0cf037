// The messages of hummingbus for C++17. Made by `hummingbus schema --cpp`: not to be edited.

#pragma once

#include "hummingbus.hpp"

#include <array>
#include <cstdint>

namespace hummingbus::msgs {
// Simulation time as ROS 2 writes it. The bus fills it in when a sample is sent.
struct Time {
  // Whole seconds since tick 0. [s]
  std::int32_t sec{};
  // The rest, 0 to 999 999 999. [ns]
  std::uint32_t nanosec{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Time, "builtin_interfaces/msg/Time", "Simulation time as ROS 2 writes it. The bus fills it in when a sample is sent.",
    HUMMINGBUS_FIELD(sec, "s", "", "Whole seconds since tick 0."),
    HUMMINGBUS_FIELD(nanosec, "ns", "", "The rest, 0 to 999 999 999."));

namespace hummingbus::msgs {
// A unit quaternion, Hamilton convention, stored x, y, z, w; it rotates body vectors into the world.
struct Quaternion {
  // Vector part along x. [1]
  double x{};
  // Vector part along y. [1]
  double y{};
  // Vector part along z. [1]
  double z{};
  // Scalar part. [1]
  double w{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Quaternion, "hummingbus_msgs/msg/Quaternion", "A unit quaternion, Hamilton convention, stored x, y, z, w; it rotates body vectors into the world.",
    HUMMINGBUS_FIELD(x, "1", "", "Vector part along x."),
    HUMMINGBUS_FIELD(y, "1", "", "Vector part along y."),
    HUMMINGBUS_FIELD(z, "1", "", "Vector part along z."),
    HUMMINGBUS_FIELD(w, "1", "", "Scalar part."));

namespace hummingbus::msgs {
// Three numbers along the axes of a frame.
struct Vector3 {
  // Along x.
  double x{};
  // Along y.
  double y{};
  // Along z.
  double z{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Vector3, "hummingbus_msgs/msg/Vector3", "Three numbers along the axes of a frame.",
    HUMMINGBUS_FIELD(x, "", "", "Along x."),
    HUMMINGBUS_FIELD(y, "", "", "Along y."),
    HUMMINGBUS_FIELD(z, "", "", "Along z."));

namespace hummingbus::msgs {
// Estimated attitude and angular velocity.
struct AttitudeEstimate {
  // Simulation time.
  Time stamp{};
  // Attitude, body to world. in world
  Quaternion attitude{};
  // Roll about body x (z-y-x sequence). [rad] in world
  double roll{};
  // Pitch about y, positive nose down. [rad] in world
  double pitch{};
  // Yaw about world z, positive counter-clockwise from above. [rad] in world
  double yaw{};
  // Angular velocity. [rad/s] in body
  Vector3 angular_velocity{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::AttitudeEstimate, "hummingbus_msgs/msg/AttitudeEstimate", "Estimated attitude and angular velocity.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(attitude, "", "world", "Attitude, body to world."),
    HUMMINGBUS_FIELD(roll, "rad", "world", "Roll about body x (z-y-x sequence)."),
    HUMMINGBUS_FIELD(pitch, "rad", "world", "Pitch about y, positive nose down."),
    HUMMINGBUS_FIELD(yaw, "rad", "world", "Yaw about world z, positive counter-clockwise from above."),
    HUMMINGBUS_FIELD(angular_velocity, "rad/s", "body", "Angular velocity."));

namespace hummingbus::msgs {
// Reading of a barometer.
struct Barometer {
  // Simulation time of sending.
  Time stamp{};
  // Simulation time at which it was measured. [ns]
  std::uint64_t measured_ns{};
  // Static pressure. [Pa]
  double pressure{};
  // Height above the world's origin that the pressure means in the standard atmosphere. [m] in world
  double altitude{};
  // 1 if this sample holds a measurement, 0 if it was lost. [1]
  std::uint32_t valid{};
  // Zero.
  std::uint32_t pad0{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Barometer, "hummingbus_msgs/msg/Barometer", "Reading of a barometer.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time of sending."),
    HUMMINGBUS_FIELD(measured_ns, "ns", "", "Simulation time at which it was measured."),
    HUMMINGBUS_FIELD(pressure, "Pa", "", "Static pressure."),
    HUMMINGBUS_FIELD(altitude, "m", "world", "Height above the world's origin that the pressure means in the standard atmosphere."),
    HUMMINGBUS_FIELD(valid, "1", "", "1 if this sample holds a measurement, 0 if it was lost."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."));

namespace hummingbus::msgs {
// Voltage and current of the battery, true or measured.
struct Battery {
  // Simulation time of sending.
  Time stamp{};
  // Simulation time at which it was measured. [ns]
  std::uint64_t measured_ns{};
  // Voltage at the terminals. [V]
  double voltage{};
  // Current drawn. [A]
  double current{};
  // Remaining part of the capacity, 0 to 1. [1]
  double charge{};
  // 1 if this sample holds a measurement, 0 if it was lost or the plant has no model of its battery. [1]
  std::uint32_t valid{};
  // Zero.
  std::uint32_t pad0{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Battery, "hummingbus_msgs/msg/Battery", "Voltage and current of the battery, true or measured.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time of sending."),
    HUMMINGBUS_FIELD(measured_ns, "ns", "", "Simulation time at which it was measured."),
    HUMMINGBUS_FIELD(voltage, "V", "", "Voltage at the terminals."),
    HUMMINGBUS_FIELD(current, "A", "", "Current drawn."),
    HUMMINGBUS_FIELD(charge, "1", "", "Remaining part of the capacity, 0 to 1."),
    HUMMINGBUS_FIELD(valid, "1", "", "1 if this sample holds a measurement, 0 if it was lost or the plant has no model of its battery."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."));

namespace hummingbus::msgs {
// Poses and velocities of the free bodies of a scene, in the order of the scene: those beyond `count` are zeros.
struct BodyStates {
  // Simulation time.
  Time stamp{};
  // Number of bodies. [1]
  std::uint32_t count{};
  // Zero.
  std::uint32_t pad0{};
  // Their numbers among the things of the scene, as `Contact` counts them: 2 + i of the thing i. [1]
  std::array<std::uint32_t, 16> object{};
  // Positions of their centres of mass. [m] in world
  std::array<Vector3, 16> position{};
  // Attitudes, the body's own axes to the world's. in world
  std::array<Quaternion, 16> attitude{};
  // Velocities of their centres of mass. [m/s] in world
  std::array<Vector3, 16> velocity{};
  // Angular velocities. [rad/s] in world
  std::array<Vector3, 16> angular_velocity{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::BodyStates, "hummingbus_msgs/msg/BodyStates", "Poses and velocities of the free bodies of a scene, in the order of the scene: those beyond `count` are zeros.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(count, "1", "", "Number of bodies."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."),
    HUMMINGBUS_FIELD(object, "1", "", "Their numbers among the things of the scene, as `Contact` counts them: 2 + i of the thing i."),
    HUMMINGBUS_FIELD(position, "m", "world", "Positions of their centres of mass."),
    HUMMINGBUS_FIELD(attitude, "", "world", "Attitudes, the body's own axes to the world's."),
    HUMMINGBUS_FIELD(velocity, "m/s", "world", "Velocities of their centres of mass."),
    HUMMINGBUS_FIELD(angular_velocity, "rad/s", "world", "Angular velocities."));

namespace hummingbus::msgs {
// True distances from a vehicle to the things of the scene: for judging and plotting, not for controllers.
struct Clearance {
  // Simulation time.
  Time stamp{};
  // Distance from the centre of mass to the nearest box. [m] in world
  double nearest{};
  // Distances to what stands along the world's +x, -x, +y, -y; 1000 where nothing does. [m] in world
  std::array<double, 4> wall{};
  // The smallest of them less the distance that is to be kept. [m] in world
  double side_error{};
  // Turns flown about the world's origin, clockwise from above as positive: laps of a room. [1]
  double laps{};
  // 1 in the corner between two walls, where both are about as far as is to be kept; 0 along a side. [1]
  std::uint32_t corner{};
  // Zero.
  std::uint32_t pad0{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Clearance, "hummingbus_msgs/msg/Clearance", "True distances from a vehicle to the things of the scene: for judging and plotting, not for controllers.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(nearest, "m", "world", "Distance from the centre of mass to the nearest box."),
    HUMMINGBUS_FIELD(wall, "m", "world", "Distances to what stands along the world's +x, -x, +y, -y; 1000 where nothing does."),
    HUMMINGBUS_FIELD(side_error, "m", "world", "The smallest of them less the distance that is to be kept."),
    HUMMINGBUS_FIELD(laps, "1", "", "Turns flown about the world's origin, clockwise from above as positive: laps of a room."),
    HUMMINGBUS_FIELD(corner, "1", "", "1 in the corner between two walls, where both are about as far as is to be kept; 0 along a side."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."));

namespace hummingbus::msgs {
// Contacts of the plant with the ground, the scene's things and other vehicles.
struct Contact {
  // Simulation time.
  Time stamp{};
  // Sum of the contact forces over the last tick. [N] in world
  Vector3 force{};
  // Speed of approach just before the newest impact: a part of the vehicle, a foot or the disc of propellers, touched something that it had not touched. The fastest of those within a tick; 0 without a contact. [m/s]
  double impact_speed{};
  // Number of things touched: the ground, boxes, other vehicles. [1]
  std::uint32_t count{};
  // Object of the first contact: 0 nothing, 1 the ground, 2 + i the scene's thing i (boxes first, then meshes), 1000 + i the other vehicle i. [1]
  std::uint32_t object{};
  // Contacts that began since the run started, resting on the ground at the start left out. [1]
  std::uint32_t began{};
  // 1 from the first impact on that was faster than the vehicle bears. [1]
  std::uint32_t crashed{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Contact, "hummingbus_msgs/msg/Contact", "Contacts of the plant with the ground, the scene's things and other vehicles.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(force, "N", "world", "Sum of the contact forces over the last tick."),
    HUMMINGBUS_FIELD(impact_speed, "m/s", "", "Speed of approach just before the newest impact: a part of the vehicle, a foot or the disc of propellers, touched something that it had not touched. The fastest of those within a tick; 0 without a contact."),
    HUMMINGBUS_FIELD(count, "1", "", "Number of things touched: the ground, boxes, other vehicles."),
    HUMMINGBUS_FIELD(object, "1", "", "Object of the first contact: 0 nothing, 1 the ground, 2 + i the scene's thing i (boxes first, then meshes), 1000 + i the other vehicle i."),
    HUMMINGBUS_FIELD(began, "1", "", "Contacts that began since the run started, resting on the ground at the start left out."),
    HUMMINGBUS_FIELD(crashed, "1", "", "1 from the first impact on that was faster than the vehicle bears."));

namespace hummingbus::msgs {
// Status of a controller at a tick: its set points, its demand, the part of it that the rotors make, and its state.
struct ControlStatus {
  // Simulation time.
  Time stamp{};
  // Altitude that its inner loops hold: the pilot's, or its outer loop's. [m] in world
  double altitude_set_point{};
  // Roll, pitch and yaw that its inner loops hold. [rad] in world
  std::array<double, 3> attitude_set_point{};
  // Velocity that its outer loop asks for, level axes along the heading; 0 without one. [m/s]
  std::array<double, 2> velocity_set_point{};
  // Demanded thrust along body z. [N] in body
  double thrust{};
  // Demanded torque. [N*m] in body
  Vector3 torque{};
  // Thrust made less thrust demanded; it is given up first. [N]
  double thrust_error{};
  // The part of the demanded roll and pitch torque that is made, 0 to 1. [1]
  double roll_pitch_part{};
  // The part of the demanded yaw torque that is made, 0 to 1. [1]
  double yaw_part{};
  // 1 if any of the demand was given up. [1]
  std::uint32_t saturated{};
  // State of its guidance: of `wall-follow` 1 to 5 as in the thesis, of `wall-stop` 1 cruising, 2 braking, 3 holding; 0 without guidance. [1]
  std::uint32_t state{};
  // Laps flown. [1]
  std::uint32_t laps{};
  // Zero.
  std::uint32_t pad0{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::ControlStatus, "hummingbus_msgs/msg/ControlStatus", "Status of a controller at a tick: its set points, its demand, the part of it that the rotors make, and its state.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(altitude_set_point, "m", "world", "Altitude that its inner loops hold: the pilot's, or its outer loop's."),
    HUMMINGBUS_FIELD(attitude_set_point, "rad", "world", "Roll, pitch and yaw that its inner loops hold."),
    HUMMINGBUS_FIELD(velocity_set_point, "m/s", "", "Velocity that its outer loop asks for, level axes along the heading; 0 without one."),
    HUMMINGBUS_FIELD(thrust, "N", "body", "Demanded thrust along body z."),
    HUMMINGBUS_FIELD(torque, "N*m", "body", "Demanded torque."),
    HUMMINGBUS_FIELD(thrust_error, "N", "", "Thrust made less thrust demanded; it is given up first."),
    HUMMINGBUS_FIELD(roll_pitch_part, "1", "", "The part of the demanded roll and pitch torque that is made, 0 to 1."),
    HUMMINGBUS_FIELD(yaw_part, "1", "", "The part of the demanded yaw torque that is made, 0 to 1."),
    HUMMINGBUS_FIELD(saturated, "1", "", "1 if any of the demand was given up."),
    HUMMINGBUS_FIELD(state, "1", "", "State of its guidance: of `wall-follow` 1 to 5 as in the thesis, of `wall-stop` 1 cruising, 2 braking, 3 holding; 0 without guidance."),
    HUMMINGBUS_FIELD(laps, "1", "", "Laps flown."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."));

namespace hummingbus::msgs {
// Reading of a satellite receiver, in the world's axes.
struct Gps {
  // Simulation time of sending.
  Time stamp{};
  // Simulation time at which it was measured. [ns]
  std::uint64_t measured_ns{};
  // Position of the centre of mass. [m] in world
  Vector3 position{};
  // Velocity of the centre of mass. [m/s] in world
  Vector3 velocity{};
  // 1 if this sample holds a measurement, 0 if it was lost. [1]
  std::uint32_t valid{};
  // Zero.
  std::uint32_t pad0{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Gps, "hummingbus_msgs/msg/Gps", "Reading of a satellite receiver, in the world's axes.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time of sending."),
    HUMMINGBUS_FIELD(measured_ns, "ns", "", "Simulation time at which it was measured."),
    HUMMINGBUS_FIELD(position, "m", "world", "Position of the centre of mass."),
    HUMMINGBUS_FIELD(velocity, "m/s", "world", "Velocity of the centre of mass."),
    HUMMINGBUS_FIELD(valid, "1", "", "1 if this sample holds a measurement, 0 if it was lost."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."));

namespace hummingbus::msgs {
// Reading of an inertial measurement unit.
struct Imu {
  // Simulation time.
  Time stamp{};
  // Measured specific force (at rest: +g along z). [m/s^2] in body
  Vector3 specific_force{};
  // Measured angular velocity. [rad/s] in body
  Vector3 angular_velocity{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Imu, "hummingbus_msgs/msg/Imu", "Reading of an inertial measurement unit.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(specific_force, "m/s^2", "body", "Measured specific force (at rest: +g along z)."),
    HUMMINGBUS_FIELD(angular_velocity, "rad/s", "body", "Measured angular velocity."));

namespace hummingbus::msgs {
// Agreement of an estimator's predictions with its measurements: the last update of each sensor.
struct Innovation {
  // Simulation time.
  Time stamp{};
  // Normalised innovation squared of the last update by GPS, motion capture, barometer, magnetometer. [1]
  std::array<double, 4> normalised_squared{};
  // Its degrees of freedom, which it should equal on average. [1]
  std::array<std::uint32_t, 4> degrees_of_freedom{};
  // Updates so far. [1]
  std::array<std::uint32_t, 4> updates{};
  // Measurements refused as outliers so far. [1]
  std::array<std::uint32_t, 4> refused{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Innovation, "hummingbus_msgs/msg/Innovation", "Agreement of an estimator's predictions with its measurements: the last update of each sensor.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(normalised_squared, "1", "", "Normalised innovation squared of the last update by GPS, motion capture, barometer, magnetometer."),
    HUMMINGBUS_FIELD(degrees_of_freedom, "1", "", "Its degrees of freedom, which it should equal on average."),
    HUMMINGBUS_FIELD(updates, "1", "", "Updates so far."),
    HUMMINGBUS_FIELD(refused, "1", "", "Measurements refused as outliers so far."));

namespace hummingbus::msgs {
// Statistics of a link, from its first tick on; arrays by the names of the streams.
struct LinkStatistics {
  // Simulation time.
  Time stamp{};
  // Whole bytes that the wire has carried. [1]
  std::uint64_t sent_bytes{};
  // Bytes that wait for the wire. [1]
  std::uint32_t queued_bytes{};
  // Messages that wait for the wire. [1]
  std::uint32_t queued{};
  // Time from queueing to arrival of the message that arrived last. [s]
  double delay{};
  // Messages that are on the wire or behind it. [1]
  std::uint32_t under_way{};
  // Messages that have arrived. [1]
  std::uint32_t arrived{};
  // Messages that were lost on the way; counted when they would have arrived. [1]
  std::uint32_t lost{};
  // Messages that were dropped because the queue was full. [1]
  std::uint32_t dropped{};
  // Messages that have arrived, by stream. [1]
  std::array<std::uint32_t, 16> stream_arrived{};
  // Messages that were lost on the way, by stream. [1]
  std::array<std::uint32_t, 16> stream_lost{};
  // Messages that were dropped because the queue was full, by stream. [1]
  std::array<std::uint32_t, 16> stream_dropped{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::LinkStatistics, "hummingbus_msgs/msg/LinkStatistics", "Statistics of a link, from its first tick on; arrays by the names of the streams.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(sent_bytes, "1", "", "Whole bytes that the wire has carried."),
    HUMMINGBUS_FIELD(queued_bytes, "1", "", "Bytes that wait for the wire."),
    HUMMINGBUS_FIELD(queued, "1", "", "Messages that wait for the wire."),
    HUMMINGBUS_FIELD(delay, "s", "", "Time from queueing to arrival of the message that arrived last."),
    HUMMINGBUS_FIELD(under_way, "1", "", "Messages that are on the wire or behind it."),
    HUMMINGBUS_FIELD(arrived, "1", "", "Messages that have arrived."),
    HUMMINGBUS_FIELD(lost, "1", "", "Messages that were lost on the way; counted when they would have arrived."),
    HUMMINGBUS_FIELD(dropped, "1", "", "Messages that were dropped because the queue was full."),
    HUMMINGBUS_FIELD(stream_arrived, "1", "", "Messages that have arrived, by stream."),
    HUMMINGBUS_FIELD(stream_lost, "1", "", "Messages that were lost on the way, by stream."),
    HUMMINGBUS_FIELD(stream_dropped, "1", "", "Messages that were dropped because the queue was full, by stream."));

namespace hummingbus::msgs {
// Reading of a magnetometer.
struct Magnetometer {
  // Simulation time of sending.
  Time stamp{};
  // Simulation time at which it was measured. [ns]
  std::uint64_t measured_ns{};
  // Magnetic flux density. [T] in body
  Vector3 field{};
  // 1 if this sample holds a measurement, 0 if it was lost. [1]
  std::uint32_t valid{};
  // Zero.
  std::uint32_t pad0{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Magnetometer, "hummingbus_msgs/msg/Magnetometer", "Reading of a magnetometer.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time of sending."),
    HUMMINGBUS_FIELD(measured_ns, "ns", "", "Simulation time at which it was measured."),
    HUMMINGBUS_FIELD(field, "T", "body", "Magnetic flux density."),
    HUMMINGBUS_FIELD(valid, "1", "", "1 if this sample holds a measurement, 0 if it was lost."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."));

namespace hummingbus::msgs {
// A vehicle's state as measured in a real flight.
struct MeasuredState {
  // Simulation time.
  Time stamp{};
  // Position. [m] in world
  Vector3 position{};
  // Velocity. [m/s] in world
  Vector3 velocity{};
  // Attitude, body to world. in world
  Quaternion attitude{};
  // Angular velocity. [rad/s] in body
  Vector3 angular_velocity{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::MeasuredState, "hummingbus_msgs/msg/MeasuredState", "A vehicle's state as measured in a real flight.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(position, "m", "world", "Position."),
    HUMMINGBUS_FIELD(velocity, "m/s", "world", "Velocity."),
    HUMMINGBUS_FIELD(attitude, "", "world", "Attitude, body to world."),
    HUMMINGBUS_FIELD(angular_velocity, "rad/s", "body", "Angular velocity."));

namespace hummingbus::msgs {
// Reading of a motion-capture system.
struct Mocap {
  // Simulation time of sending.
  Time stamp{};
  // Simulation time at which it was measured. [ns]
  std::uint64_t measured_ns{};
  // Position of the centre of mass. [m] in world
  Vector3 position{};
  // Attitude, body to world. in world
  Quaternion attitude{};
  // 1 if this sample holds a measurement, 0 if it was lost. [1]
  std::uint32_t valid{};
  // Zero.
  std::uint32_t pad0{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Mocap, "hummingbus_msgs/msg/Mocap", "Reading of a motion-capture system.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time of sending."),
    HUMMINGBUS_FIELD(measured_ns, "ns", "", "Simulation time at which it was measured."),
    HUMMINGBUS_FIELD(position, "m", "world", "Position of the centre of mass."),
    HUMMINGBUS_FIELD(attitude, "", "world", "Attitude, body to world."),
    HUMMINGBUS_FIELD(valid, "1", "", "1 if this sample holds a measurement, 0 if it was lost."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."));

namespace hummingbus::msgs {
// Motor commands in the vehicle's own raw counts (Hummingbird 1…200, Crazyflie 0…65535).
struct MotorCommand {
  // Simulation time.
  Time stamp{};
  // Commands in the order of the vehicle file's rotors; its `command` table maps them to speeds. [count]
  hummingbus::Bounded<double, 12> command{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::MotorCommand, "hummingbus_msgs/msg/MotorCommand", "Motor commands in the vehicle's own raw counts (Hummingbird 1…200, Crazyflie 0…65535).",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(command, "count", "", "Commands in the order of the vehicle file's rotors; its `command` table maps them to speeds."));

namespace hummingbus::msgs {
// The true state of a vehicle and its rotors. Sensors and recorders read it; estimators do not.
struct PlantState {
  // Simulation time.
  Time stamp{};
  // Position of the centre of mass. [m] in world
  Vector3 position{};
  // Velocity of the centre of mass. [m/s] in world
  Vector3 velocity{};
  // Attitude, body to world. in world
  Quaternion attitude{};
  // Angular velocity of the body against the world. [rad/s] in body
  Vector3 angular_velocity{};
  // Specific force at the centre of mass: what an ideal accelerometer there reads. [m/s^2] in body
  Vector3 specific_force{};
  // Rotor speeds, in the order of the vehicle file. [rad/s]
  hummingbus::Bounded<double, 12> rotor_speed{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::PlantState, "hummingbus_msgs/msg/PlantState", "The true state of a vehicle and its rotors. Sensors and recorders read it; estimators do not.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(position, "m", "world", "Position of the centre of mass."),
    HUMMINGBUS_FIELD(velocity, "m/s", "world", "Velocity of the centre of mass."),
    HUMMINGBUS_FIELD(attitude, "", "world", "Attitude, body to world."),
    HUMMINGBUS_FIELD(angular_velocity, "rad/s", "body", "Angular velocity of the body against the world."),
    HUMMINGBUS_FIELD(specific_force, "m/s^2", "body", "Specific force at the centre of mass: what an ideal accelerometer there reads."),
    HUMMINGBUS_FIELD(rotor_speed, "rad/s", "", "Rotor speeds, in the order of the vehicle file."));

namespace hummingbus::msgs {
// Readings of five range finders, in the order +x, -x, +y, -y of the body, and down.
struct Ranges {
  // Simulation time of sending.
  Time stamp{};
  // Simulation time at which it was measured. [ns]
  std::uint64_t measured_ns{};
  // Distances; the sensor's reach where nothing is met. [m] in body
  std::array<double, 5> distance{};
  // 1 for each beam that measured something, 0 where it met nothing within reach or was lost. [1]
  std::array<std::uint32_t, 5> valid{};
  // Zero.
  std::uint32_t pad0{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Ranges, "hummingbus_msgs/msg/Ranges", "Readings of five range finders, in the order +x, -x, +y, -y of the body, and down.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time of sending."),
    HUMMINGBUS_FIELD(measured_ns, "ns", "", "Simulation time at which it was measured."),
    HUMMINGBUS_FIELD(distance, "m", "body", "Distances; the sensor's reach where nothing is met."),
    HUMMINGBUS_FIELD(valid, "1", "", "1 for each beam that measured something, 0 where it met nothing within reach or was lost."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."));

namespace hummingbus::msgs {
// The channels of a remote control, as its receiver reports them.
struct RcChannels {
  // Simulation time.
  Time stamp{};
  // Pulses, 1000 to 2000: roll, pitch, throttle and yaw, then the switches. [us]
  hummingbus::Bounded<double, 16> pulse{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::RcChannels, "hummingbus_msgs/msg/RcChannels", "The channels of a remote control, as its receiver reports them.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(pulse, "us", "", "Pulses, 1000 to 2000: roll, pitch, throttle and yaw, then the switches."));

namespace hummingbus::msgs {
// A point of a trajectory.
struct Reference {
  // Simulation time.
  Time stamp{};
  // Position. [m] in world
  Vector3 position{};
  // Velocity. [m/s] in world
  Vector3 velocity{};
  // Acceleration. [m/s^2] in world
  Vector3 acceleration{};
  // Jerk. [m/s^3] in world
  Vector3 jerk{};
  // Snap. [m/s^4] in world
  Vector3 snap{};
  // Yaw. [rad] in world
  double yaw{};
  // Its rate of change. [rad/s] in world
  double yaw_rate{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Reference, "hummingbus_msgs/msg/Reference", "A point of a trajectory.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(position, "m", "world", "Position."),
    HUMMINGBUS_FIELD(velocity, "m/s", "world", "Velocity."),
    HUMMINGBUS_FIELD(acceleration, "m/s^2", "world", "Acceleration."),
    HUMMINGBUS_FIELD(jerk, "m/s^3", "world", "Jerk."),
    HUMMINGBUS_FIELD(snap, "m/s^4", "world", "Snap."),
    HUMMINGBUS_FIELD(yaw, "rad", "world", "Yaw."),
    HUMMINGBUS_FIELD(yaw_rate, "rad/s", "world", "Its rate of change."));

namespace hummingbus::msgs {
// Readings of the stand's sensors.
struct RotorLoad {
  // Simulation time.
  Time stamp{};
  // The speed that the motor is asked for. [rad/s]
  double rotor_speed_commanded{};
  // Speed of the rotor, positive in its own sense of rotation. [rad/s]
  double rotor_speed{};
  // Thrust along the rotor's axis. [N]
  double thrust{};
  // Torque of the air on the rotor, against its rotation. [N*m]
  double drag_torque{};
  // Torque on what the motor is bolted to, about the axis that points up: the air's drag and what speeds the rotor up. [N*m] in body
  double mount_torque{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::RotorLoad, "hummingbus_msgs/msg/RotorLoad", "Readings of the stand's sensors.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(rotor_speed_commanded, "rad/s", "", "The speed that the motor is asked for."),
    HUMMINGBUS_FIELD(rotor_speed, "rad/s", "", "Speed of the rotor, positive in its own sense of rotation."),
    HUMMINGBUS_FIELD(thrust, "N", "", "Thrust along the rotor's axis."),
    HUMMINGBUS_FIELD(drag_torque, "N*m", "", "Torque of the air on the rotor, against its rotation."),
    HUMMINGBUS_FIELD(mount_torque, "N*m", "body", "Torque on what the motor is bolted to, about the axis that points up: the air's drag and what speeds the rotor up."));

namespace hummingbus::msgs {
// Readings of the motor controllers.
struct RotorSpeeds {
  // Simulation time of sending.
  Time stamp{};
  // Simulation time at which it was measured. [ns]
  std::uint64_t measured_ns{};
  // 1 if this sample holds a measurement, 0 if it was lost. [1]
  std::uint32_t valid{};
  // Zero.
  std::uint32_t pad0{};
  // Speeds of the rotors, in the order of the vehicle file. [rad/s]
  hummingbus::Bounded<double, 12> rotor_speed{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::RotorSpeeds, "hummingbus_msgs/msg/RotorSpeeds", "Readings of the motor controllers.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time of sending."),
    HUMMINGBUS_FIELD(measured_ns, "ns", "", "Simulation time at which it was measured."),
    HUMMINGBUS_FIELD(valid, "1", "", "1 if this sample holds a measurement, 0 if it was lost."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."),
    HUMMINGBUS_FIELD(rotor_speed, "rad/s", "", "Speeds of the rotors, in the order of the vehicle file."));

namespace hummingbus::msgs {
// Set points that a pilot or a planner gives to the controller.
struct SetPoint {
  // Simulation time.
  Time stamp{};
  // Altitude of the centre of mass. [m] in world
  double altitude{};
  // Roll. [rad] in world
  double roll{};
  // Pitch, positive nose down. [rad] in world
  double pitch{};
  // Yaw. [rad] in world
  double yaw{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::SetPoint, "hummingbus_msgs/msg/SetPoint", "Set points that a pilot or a planner gives to the controller.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(altitude, "m", "world", "Altitude of the centre of mass."),
    HUMMINGBUS_FIELD(roll, "rad", "world", "Roll."),
    HUMMINGBUS_FIELD(pitch, "rad", "world", "Pitch, positive nose down."),
    HUMMINGBUS_FIELD(yaw, "rad", "world", "Yaw."));

namespace hummingbus::msgs {
// Estimate of the vehicle's motion.
struct StateEstimate {
  // Simulation time.
  Time stamp{};
  // Position of the centre of mass. [m] in world
  Vector3 position{};
  // Velocity of the centre of mass. [m/s] in world
  Vector3 velocity{};
  // Attitude, body to world. in world
  Quaternion attitude{};
  // Angular velocity, the gyroscope's estimated bias taken off. [rad/s] in body
  Vector3 angular_velocity{};
  // Standard deviation of the position as the estimator believes it. [m] in world
  Vector3 position_sigma{};
  // Standard deviation of the velocity. [m/s] in world
  Vector3 velocity_sigma{};
  // Standard deviation of the attitude, as a rotation vector. [rad] in body
  Vector3 attitude_sigma{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::StateEstimate, "hummingbus_msgs/msg/StateEstimate", "Estimate of the vehicle's motion.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(position, "m", "world", "Position of the centre of mass."),
    HUMMINGBUS_FIELD(velocity, "m/s", "world", "Velocity of the centre of mass."),
    HUMMINGBUS_FIELD(attitude, "", "world", "Attitude, body to world."),
    HUMMINGBUS_FIELD(angular_velocity, "rad/s", "body", "Angular velocity, the gyroscope's estimated bias taken off."),
    HUMMINGBUS_FIELD(position_sigma, "m", "world", "Standard deviation of the position as the estimator believes it."),
    HUMMINGBUS_FIELD(velocity_sigma, "m/s", "world", "Standard deviation of the velocity."),
    HUMMINGBUS_FIELD(attitude_sigma, "rad", "body", "Standard deviation of the attitude, as a rotation vector."));

namespace hummingbus::msgs {
// Positions and velocities of the vehicles of a run, for vehicles that share a room.
struct Traffic {
  // Simulation time.
  Time stamp{};
  // Number of vehicles. [1]
  std::uint32_t count{};
  // Zero.
  std::uint32_t pad0{};
  // Positions of their centres of mass, in the order of the inputs' names. [m] in world
  std::array<Vector3, 32> position{};
  // Their velocities. [m/s] in world
  std::array<Vector3, 32> velocity{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::Traffic, "hummingbus_msgs/msg/Traffic", "Positions and velocities of the vehicles of a run, for vehicles that share a room.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(count, "1", "", "Number of vehicles."),
    HUMMINGBUS_FIELD(pad0, "", "", "Zero."),
    HUMMINGBUS_FIELD(position, "m", "world", "Positions of their centres of mass, in the order of the inputs' names."),
    HUMMINGBUS_FIELD(velocity, "m/s", "world", "Their velocities."));

namespace hummingbus::msgs {
// Estimate from range finders: level distances to the surroundings, height and velocity.
struct WallEstimate {
  // Simulation time.
  Time stamp{};
  // Level distances along the heading's +x, -x, +y, -y; the sensor's reach where nothing is in sight. [m]
  std::array<double, 4> distance{};
  // 1 where a wall is in sight. [1]
  std::array<std::uint32_t, 4> in_sight{};
  // Velocity along the heading's x and y: level axes that turn with the yaw. [m/s]
  std::array<double, 2> velocity{};
  // Height above what is below. [m]
  double height{};
  // Rate of climb. [m/s]
  double climb_rate{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::WallEstimate, "hummingbus_msgs/msg/WallEstimate", "Estimate from range finders: level distances to the surroundings, height and velocity.",
    HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
    HUMMINGBUS_FIELD(distance, "m", "", "Level distances along the heading's +x, -x, +y, -y; the sensor's reach where nothing is in sight."),
    HUMMINGBUS_FIELD(in_sight, "1", "", "1 where a wall is in sight."),
    HUMMINGBUS_FIELD(velocity, "m/s", "", "Velocity along the heading's x and y: level axes that turn with the yaw."),
    HUMMINGBUS_FIELD(height, "m", "", "Height above what is below."),
    HUMMINGBUS_FIELD(climb_rate, "m/s", "", "Rate of climb."));

namespace hummingbus::msgs {
// State of the component.
struct ClearanceState {
  // Bearing of the vehicle from the world's origin at the last tick; not a number before the first. [rad] in world
  double bearing{};
  // Turns flown clockwise. [1]
  double laps{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::ClearanceState, "hummingbus_msgs/msg/ClearanceState", "State of the component.",
    HUMMINGBUS_FIELD(bearing, "rad", "world", "Bearing of the vehicle from the world's origin at the last tick; not a number before the first."),
    HUMMINGBUS_FIELD(laps, "1", "", "Turns flown clockwise."));

namespace hummingbus::msgs {
// State of the filter between two samples.
struct ComplementaryState {
  // The estimated attitude at the last sample, body to world. in world
  Quaternion attitude{};
  // The last sample's angular rate; not a number before the first. [rad/s] in body
  Vector3 last_angular_velocity{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::ComplementaryState, "hummingbus_msgs/msg/ComplementaryState", "State of the filter between two samples.",
    HUMMINGBUS_FIELD(attitude, "", "world", "The estimated attitude at the last sample, body to world."),
    HUMMINGBUS_FIELD(last_angular_velocity, "rad/s", "body", "The last sample's angular rate; not a number before the first."));

namespace hummingbus::msgs {
// Law that a state belongs to; zero before the first tick.
struct LawId {
  // The law's name, zeros behind. [1]
  std::array<std::uint8_t, 24> name{};
  // Layout hash of its state, combined with its name. [1]
  std::uint64_t state{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::LawId, "hummingbus_msgs/msg/LawId", "Law that a state belongs to; zero before the first tick.",
    HUMMINGBUS_FIELD(name, "1", "", "The law's name, zeros behind."),
    HUMMINGBUS_FIELD(state, "1", "", "Layout hash of its state, combined with its name."));

namespace hummingbus::msgs {
// Outputs of the integrators of a law, in units that mean the same to all laws.
struct ControlIntegrals {
  // Vertical acceleration. [m/s^2] in world
  double lift{};
  // Angular accelerations for roll, pitch and yaw; zero under `lqr` and `geometric`, which observe a lift alone. [rad/s^2] in body
  std::array<double, 3> turn{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::ControlIntegrals, "hummingbus_msgs/msg/ControlIntegrals", "Outputs of the integrators of a law, in units that mean the same to all laws.",
    HUMMINGBUS_FIELD(lift, "m/s^2", "world", "Vertical acceleration."),
    HUMMINGBUS_FIELD(turn, "rad/s^2", "body", "Angular accelerations for roll, pitch and yaw; zero under `lqr` and `geometric`, which observe a lift alone."));

namespace hummingbus::msgs {
// State of a controller between ticks.
struct ControllerState {
  // The law that left it.
  LawId id{};
  // Thrust that was demanded last. [N] in body
  double thrust{};
  // Torque that was demanded last. [N*m] in body
  std::array<double, 3> torque{};
  // Outputs of the law's integrators.
  ControlIntegrals integrals{};
  // Remaining part of the predecessor's thrust that this law does not ask for itself. [N] in body
  double residual_thrust{};
  // The same of its torque. [N*m] in body
  std::array<double, 3> residual_torque{};
  // The law's own state in the first words. [1]
  std::array<std::uint64_t, 32> law_state{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::ControllerState, "hummingbus_msgs/msg/ControllerState", "State of a controller between ticks.",
    HUMMINGBUS_FIELD(id, "", "", "The law that left it."),
    HUMMINGBUS_FIELD(thrust, "N", "body", "Thrust that was demanded last."),
    HUMMINGBUS_FIELD(torque, "N*m", "body", "Torque that was demanded last."),
    HUMMINGBUS_FIELD(integrals, "", "", "Outputs of the law's integrators."),
    HUMMINGBUS_FIELD(residual_thrust, "N", "body", "Remaining part of the predecessor's thrust that this law does not ask for itself."),
    HUMMINGBUS_FIELD(residual_torque, "N*m", "body", "The same of its torque."),
    HUMMINGBUS_FIELD(law_state, "1", "", "The law's own state in the first words."));

namespace hummingbus::msgs {
// State of `operator`.
struct OperatorState {
  // Altitude that was asked for last, within its limits. [m] in world
  double altitude{};
  // Roll that was asked for last, within its limit. [rad]
  double roll{};
  // Pitch that was asked for last, positive nose down, within its limit. [rad]
  double pitch{};
  // Yaw that was asked for last. [rad]
  double yaw{};
  // Altitude lost since the source fell silent. [m] in world
  double lowered{};
  // 1 once somebody has asked.
  std::uint32_t is_asked{};
  // Zero.
  std::uint32_t reserved{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::OperatorState, "hummingbus_msgs/msg/OperatorState", "State of `operator`.",
    HUMMINGBUS_FIELD(altitude, "m", "world", "Altitude that was asked for last, within its limits."),
    HUMMINGBUS_FIELD(roll, "rad", "", "Roll that was asked for last, within its limit."),
    HUMMINGBUS_FIELD(pitch, "rad", "", "Pitch that was asked for last, positive nose down, within its limit."),
    HUMMINGBUS_FIELD(yaw, "rad", "", "Yaw that was asked for last."),
    HUMMINGBUS_FIELD(lowered, "m", "world", "Altitude lost since the source fell silent."),
    HUMMINGBUS_FIELD(is_asked, "", "", "1 once somebody has asked."),
    HUMMINGBUS_FIELD(reserved, "", "", "Zero."));

namespace hummingbus::msgs {
// State of the position hold.
struct PositionHoldState {
  // The place that is held; without meaning along an axis that is not locked. [m] in world
  std::array<double, 2> place{};
  // 1 where the place along the heading's x, or y, is locked. [1]
  std::array<std::uint32_t, 2> locked{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::PositionHoldState, "hummingbus_msgs/msg/PositionHoldState", "State of the position hold.",
    HUMMINGBUS_FIELD(place, "m", "world", "The place that is held; without meaning along an axis that is not locked."),
    HUMMINGBUS_FIELD(locked, "1", "", "1 where the place along the heading's x, or y, is locked."));

namespace hummingbus::msgs {
// State of the component.
struct PropellerStandState {
  // Speed of the rotor. [rad/s]
  double speed{};
  // Its rate of change. [rad/s^2]
  double acceleration{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::PropellerStandState, "hummingbus_msgs/msg/PropellerStandState", "State of the component.",
    HUMMINGBUS_FIELD(speed, "rad/s", "", "Speed of the rotor."),
    HUMMINGBUS_FIELD(acceleration, "rad/s^2", "", "Its rate of change."));

namespace hummingbus::msgs {
// Estimate along one axis.
struct RangeInertialAxis {
  // Velocity. [m/s] in world
  double velocity{};
  // Error of the acceleration that is fed in. [m/s^2] in world
  double bias{};
  // Displacement since the start. [m] in world
  double path{};
  // Distances to what stands ahead and behind; without meaning where nothing is in sight. [m] in world
  std::array<double, 2> distance{};
  // 1 where something is in sight. [1]
  std::array<std::uint32_t, 2> in_sight{};
  // Covariance of the errors of the above, in their order and units.
  std::array<double, 25> covariance{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::RangeInertialAxis, "hummingbus_msgs/msg/RangeInertialAxis", "Estimate along one axis.",
    HUMMINGBUS_FIELD(velocity, "m/s", "world", "Velocity."),
    HUMMINGBUS_FIELD(bias, "m/s^2", "world", "Error of the acceleration that is fed in."),
    HUMMINGBUS_FIELD(path, "m", "world", "Displacement since the start."),
    HUMMINGBUS_FIELD(distance, "m", "world", "Distances to what stands ahead and behind; without meaning where nothing is in sight."),
    HUMMINGBUS_FIELD(in_sight, "1", "", "1 where something is in sight."),
    HUMMINGBUS_FIELD(covariance, "", "", "Covariance of the errors of the above, in their order and units."));

namespace hummingbus::msgs {
// Sums of the acceleration, its bias not taken off.
struct RangeInertialGains {
  // Samples so far.
  std::uint64_t samples{};
  // The sum of all. [m/s] in world
  Vector3 total{};
  // The sum as it was every 10 ms, the k-th of these at the place k modulo the number of places. [m/s] in world
  std::array<Vector3, 128> kept{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::RangeInertialGains, "hummingbus_msgs/msg/RangeInertialGains", "Sums of the acceleration, its bias not taken off.",
    HUMMINGBUS_FIELD(samples, "", "", "Samples so far."),
    HUMMINGBUS_FIELD(total, "m/s", "world", "The sum of all."),
    HUMMINGBUS_FIELD(kept, "m/s", "world", "The sum as it was every 10 ms, the k-th of these at the place k modulo the number of places."));

namespace hummingbus::msgs {
// Pose of the vehicle at a sample.
struct RangeInertialPast {
  // Displacement since the start. [m] in world
  Vector3 path{};
  // Attitude, body to world. in world
  Quaternion attitude{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::RangeInertialPast, "hummingbus_msgs/msg/RangeInertialPast", "Pose of the vehicle at a sample.",
    HUMMINGBUS_FIELD(path, "m", "world", "Displacement since the start."),
    HUMMINGBUS_FIELD(attitude, "", "world", "Attitude, body to world."));

namespace hummingbus::msgs {
// State of the estimator, as it is handed over.
struct RangeInertialState {
  // Samples so far.
  std::uint64_t samples{};
  // When the newest ranges were measured; the largest number before the first. [ns]
  std::uint64_t measured_ns{};
  // When the newest velocity of a receiver was measured; the largest number before the first. [ns]
  std::uint64_t gps_measured_ns{};
  // When the last echo came from ahead and from behind along x, and along y. [ns]
  std::array<std::array<std::uint64_t, 2>, 2> echo_ns{};
  // In a room of known size: distances to what hides the walls, and when it was seen last, as above. [m] in world
  std::array<std::array<double, 2>, 2> obstacle{};
  // See above; 0 for never. [ns]
  std::array<std::array<std::uint64_t, 2>, 2> obstacle_ns{};
  // The last sample's acceleration. [m/s^2] in world
  Vector3 acceleration{};
  // The axes of the world; the ground is behind the third.
  std::array<RangeInertialAxis, 3> axes{};
  // Gains of the velocity.
  RangeInertialGains gains{};
  // The last samples, sample k at the place k modulo the number of places.
  std::array<RangeInertialPast, 128> past{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::RangeInertialState, "hummingbus_msgs/msg/RangeInertialState", "State of the estimator, as it is handed over.",
    HUMMINGBUS_FIELD(samples, "", "", "Samples so far."),
    HUMMINGBUS_FIELD(measured_ns, "ns", "", "When the newest ranges were measured; the largest number before the first."),
    HUMMINGBUS_FIELD(gps_measured_ns, "ns", "", "When the newest velocity of a receiver was measured; the largest number before the first."),
    HUMMINGBUS_FIELD(echo_ns, "ns", "", "When the last echo came from ahead and from behind along x, and along y."),
    HUMMINGBUS_FIELD(obstacle, "m", "world", "In a room of known size: distances to what hides the walls, and when it was seen last, as above."),
    HUMMINGBUS_FIELD(obstacle_ns, "ns", "", "See above; 0 for never."),
    HUMMINGBUS_FIELD(acceleration, "m/s^2", "world", "The last sample's acceleration."),
    HUMMINGBUS_FIELD(axes, "", "", "The axes of the world; the ground is behind the third."),
    HUMMINGBUS_FIELD(gains, "", "", "Gains of the velocity."),
    HUMMINGBUS_FIELD(past, "", "", "The last samples, sample k at the place k modulo the number of places."));

namespace hummingbus::msgs {
// State of the remote control.
struct RemoteControlState {
  // Throttle that the integral has added to that of hover. [1]
  double throttle{};
};
} // namespace hummingbus::msgs

HUMMINGBUS_MESSAGE(hummingbus::msgs::RemoteControlState, "hummingbus_msgs/msg/RemoteControlState", "State of the remote control.",
    HUMMINGBUS_FIELD(throttle, "1", "", "Throttle that the integral has added to that of hover."));
