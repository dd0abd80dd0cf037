// The messages of hummingbus for C. Made by `hummingbus schema --c`: not to be edited.

#ifndef HUMMINGBUS_MESSAGES_H
#define HUMMINGBUS_MESSAGES_H

#include "hummingbus.h"

#include <stddef.h>
#include <stdint.h>

// Simulation time as ROS 2 writes it. The bus fills it in when a sample is sent.
typedef struct HbTime {
  // Whole seconds since tick 0. [s]
  int32_t sec;
  // The rest, 0 to 999 999 999. [ns]
  uint32_t nanosec;
} HbTime;

static const HbField HB_TIME_FIELDS[] = {
  { "sec", "Whole seconds since tick 0.", "s", "", offsetof(HbTime, sec), HB_I32, NULL, 0, 0, 0 },
  { "nanosec", "The rest, 0 to 999 999 999.", "ns", "", offsetof(HbTime, nanosec), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_TIME = { "builtin_interfaces/msg/Time", "Simulation time as ROS 2 writes it. The bus fills it in when a sample is sent.", sizeof(HbTime), HB_TIME_FIELDS, 2 };

// A unit quaternion, Hamilton convention, stored x, y, z, w; it rotates body vectors into the world.
typedef struct HbQuaternion {
  // Vector part along x. [1]
  double x;
  // Vector part along y. [1]
  double y;
  // Vector part along z. [1]
  double z;
  // Scalar part. [1]
  double w;
} HbQuaternion;

static const HbField HB_QUATERNION_FIELDS[] = {
  { "x", "Vector part along x.", "1", "", offsetof(HbQuaternion, x), HB_F64, NULL, 0, 0, 0 },
  { "y", "Vector part along y.", "1", "", offsetof(HbQuaternion, y), HB_F64, NULL, 0, 0, 0 },
  { "z", "Vector part along z.", "1", "", offsetof(HbQuaternion, z), HB_F64, NULL, 0, 0, 0 },
  { "w", "Scalar part.", "1", "", offsetof(HbQuaternion, w), HB_F64, NULL, 0, 0, 0 },
};

static const HbMessage HB_QUATERNION = { "hummingbus_msgs/msg/Quaternion", "A unit quaternion, Hamilton convention, stored x, y, z, w; it rotates body vectors into the world.", sizeof(HbQuaternion), HB_QUATERNION_FIELDS, 4 };

// Three numbers along the axes of a frame.
typedef struct HbVector3 {
  // Along x.
  double x;
  // Along y.
  double y;
  // Along z.
  double z;
} HbVector3;

static const HbField HB_VECTOR3_FIELDS[] = {
  { "x", "Along x.", "", "", offsetof(HbVector3, x), HB_F64, NULL, 0, 0, 0 },
  { "y", "Along y.", "", "", offsetof(HbVector3, y), HB_F64, NULL, 0, 0, 0 },
  { "z", "Along z.", "", "", offsetof(HbVector3, z), HB_F64, NULL, 0, 0, 0 },
};

static const HbMessage HB_VECTOR3 = { "hummingbus_msgs/msg/Vector3", "Three numbers along the axes of a frame.", sizeof(HbVector3), HB_VECTOR3_FIELDS, 3 };

// Estimated attitude and angular velocity.
typedef struct HbAttitudeEstimate {
  // Simulation time.
  HbTime stamp;
  // Attitude, body to world. in world
  HbQuaternion attitude;
  // Roll about body x (z-y-x sequence). [rad] in world
  double roll;
  // Pitch about y, positive nose down. [rad] in world
  double pitch;
  // Yaw about world z, positive counter-clockwise from above. [rad] in world
  double yaw;
  // Angular velocity. [rad/s] in body
  HbVector3 angular_velocity;
} HbAttitudeEstimate;

static const HbField HB_ATTITUDE_ESTIMATE_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbAttitudeEstimate, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "attitude", "Attitude, body to world.", "", "world", offsetof(HbAttitudeEstimate, attitude), HB_NESTED, &HB_QUATERNION, 0, 0, 0 },
  { "roll", "Roll about body x (z-y-x sequence).", "rad", "world", offsetof(HbAttitudeEstimate, roll), HB_F64, NULL, 0, 0, 0 },
  { "pitch", "Pitch about y, positive nose down.", "rad", "world", offsetof(HbAttitudeEstimate, pitch), HB_F64, NULL, 0, 0, 0 },
  { "yaw", "Yaw about world z, positive counter-clockwise from above.", "rad", "world", offsetof(HbAttitudeEstimate, yaw), HB_F64, NULL, 0, 0, 0 },
  { "angular_velocity", "Angular velocity.", "rad/s", "body", offsetof(HbAttitudeEstimate, angular_velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
};

static const HbMessage HB_ATTITUDE_ESTIMATE = { "hummingbus_msgs/msg/AttitudeEstimate", "Estimated attitude and angular velocity.", sizeof(HbAttitudeEstimate), HB_ATTITUDE_ESTIMATE_FIELDS, 6 };

// Reading of a barometer.
typedef struct HbBarometer {
  // Simulation time of sending.
  HbTime stamp;
  // Simulation time at which it was measured. [ns]
  uint64_t measured_ns;
  // Static pressure. [Pa]
  double pressure;
  // Height above the world's origin that the pressure means in the standard atmosphere. [m] in world
  double altitude;
  // 1 if this sample holds a measurement, 0 if it was lost. [1]
  uint32_t valid;
  // Zero.
  uint32_t pad0;
} HbBarometer;

static const HbField HB_BAROMETER_FIELDS[] = {
  { "stamp", "Simulation time of sending.", "", "", offsetof(HbBarometer, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "measured_ns", "Simulation time at which it was measured.", "ns", "", offsetof(HbBarometer, measured_ns), HB_U64, NULL, 0, 0, 0 },
  { "pressure", "Static pressure.", "Pa", "", offsetof(HbBarometer, pressure), HB_F64, NULL, 0, 0, 0 },
  { "altitude", "Height above the world's origin that the pressure means in the standard atmosphere.", "m", "world", offsetof(HbBarometer, altitude), HB_F64, NULL, 0, 0, 0 },
  { "valid", "1 if this sample holds a measurement, 0 if it was lost.", "1", "", offsetof(HbBarometer, valid), HB_U32, NULL, 0, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbBarometer, pad0), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_BAROMETER = { "hummingbus_msgs/msg/Barometer", "Reading of a barometer.", sizeof(HbBarometer), HB_BAROMETER_FIELDS, 6 };

// Voltage and current of the battery, true or measured.
typedef struct HbBattery {
  // Simulation time of sending.
  HbTime stamp;
  // Simulation time at which it was measured. [ns]
  uint64_t measured_ns;
  // Voltage at the terminals. [V]
  double voltage;
  // Current drawn. [A]
  double current;
  // Remaining part of the capacity, 0 to 1. [1]
  double charge;
  // 1 if this sample holds a measurement, 0 if it was lost or the plant has no model of its battery. [1]
  uint32_t valid;
  // Zero.
  uint32_t pad0;
} HbBattery;

static const HbField HB_BATTERY_FIELDS[] = {
  { "stamp", "Simulation time of sending.", "", "", offsetof(HbBattery, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "measured_ns", "Simulation time at which it was measured.", "ns", "", offsetof(HbBattery, measured_ns), HB_U64, NULL, 0, 0, 0 },
  { "voltage", "Voltage at the terminals.", "V", "", offsetof(HbBattery, voltage), HB_F64, NULL, 0, 0, 0 },
  { "current", "Current drawn.", "A", "", offsetof(HbBattery, current), HB_F64, NULL, 0, 0, 0 },
  { "charge", "Remaining part of the capacity, 0 to 1.", "1", "", offsetof(HbBattery, charge), HB_F64, NULL, 0, 0, 0 },
  { "valid", "1 if this sample holds a measurement, 0 if it was lost or the plant has no model of its battery.", "1", "", offsetof(HbBattery, valid), HB_U32, NULL, 0, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbBattery, pad0), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_BATTERY = { "hummingbus_msgs/msg/Battery", "Voltage and current of the battery, true or measured.", sizeof(HbBattery), HB_BATTERY_FIELDS, 7 };

// Poses and velocities of the free bodies of a scene, in the order of the scene: those beyond `count` are zeros.
typedef struct HbBodyStates {
  // Simulation time.
  HbTime stamp;
  // Number of bodies. [1]
  uint32_t count;
  // Zero.
  uint32_t pad0;
  // Their numbers among the things of the scene, as `Contact` counts them: 2 + i of the thing i. [1]
  uint32_t object[16];
  // Positions of their centres of mass. [m] in world
  HbVector3 position[16];
  // Attitudes, the body's own axes to the world's. in world
  HbQuaternion attitude[16];
  // Velocities of their centres of mass. [m/s] in world
  HbVector3 velocity[16];
  // Angular velocities. [rad/s] in world
  HbVector3 angular_velocity[16];
} HbBodyStates;

static const HbField HB_BODY_STATES_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbBodyStates, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "count", "Number of bodies.", "1", "", offsetof(HbBodyStates, count), HB_U32, NULL, 0, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbBodyStates, pad0), HB_U32, NULL, 0, 0, 0 },
  { "object", "Their numbers among the things of the scene, as `Contact` counts them: 2 + i of the thing i.", "1", "", offsetof(HbBodyStates, object), HB_U32, NULL, 16, 0, 0 },
  { "position", "Positions of their centres of mass.", "m", "world", offsetof(HbBodyStates, position), HB_NESTED, &HB_VECTOR3, 16, 0, 0 },
  { "attitude", "Attitudes, the body's own axes to the world's.", "", "world", offsetof(HbBodyStates, attitude), HB_NESTED, &HB_QUATERNION, 16, 0, 0 },
  { "velocity", "Velocities of their centres of mass.", "m/s", "world", offsetof(HbBodyStates, velocity), HB_NESTED, &HB_VECTOR3, 16, 0, 0 },
  { "angular_velocity", "Angular velocities.", "rad/s", "world", offsetof(HbBodyStates, angular_velocity), HB_NESTED, &HB_VECTOR3, 16, 0, 0 },
};

static const HbMessage HB_BODY_STATES = { "hummingbus_msgs/msg/BodyStates", "Poses and velocities of the free bodies of a scene, in the order of the scene: those beyond `count` are zeros.", sizeof(HbBodyStates), HB_BODY_STATES_FIELDS, 8 };

// True distances from a vehicle to the things of the scene: for judging and plotting, not for controllers.
typedef struct HbClearance {
  // Simulation time.
  HbTime stamp;
  // Distance from the centre of mass to the nearest box. [m] in world
  double nearest;
  // Distances to what stands along the world's +x, -x, +y, -y; 1000 where nothing does. [m] in world
  double wall[4];
  // The smallest of them less the distance that is to be kept. [m] in world
  double side_error;
  // Turns flown about the world's origin, clockwise from above as positive: laps of a room. [1]
  double laps;
  // 1 in the corner between two walls, where both are about as far as is to be kept; 0 along a side. [1]
  uint32_t corner;
  // Zero.
  uint32_t pad0;
} HbClearance;

static const HbField HB_CLEARANCE_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbClearance, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "nearest", "Distance from the centre of mass to the nearest box.", "m", "world", offsetof(HbClearance, nearest), HB_F64, NULL, 0, 0, 0 },
  { "wall", "Distances to what stands along the world's +x, -x, +y, -y; 1000 where nothing does.", "m", "world", offsetof(HbClearance, wall), HB_F64, NULL, 4, 0, 0 },
  { "side_error", "The smallest of them less the distance that is to be kept.", "m", "world", offsetof(HbClearance, side_error), HB_F64, NULL, 0, 0, 0 },
  { "laps", "Turns flown about the world's origin, clockwise from above as positive: laps of a room.", "1", "", offsetof(HbClearance, laps), HB_F64, NULL, 0, 0, 0 },
  { "corner", "1 in the corner between two walls, where both are about as far as is to be kept; 0 along a side.", "1", "", offsetof(HbClearance, corner), HB_U32, NULL, 0, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbClearance, pad0), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_CLEARANCE = { "hummingbus_msgs/msg/Clearance", "True distances from a vehicle to the things of the scene: for judging and plotting, not for controllers.", sizeof(HbClearance), HB_CLEARANCE_FIELDS, 7 };

// Contacts of the plant with the ground, the scene's things and other vehicles.
typedef struct HbContact {
  // Simulation time.
  HbTime stamp;
  // Sum of the contact forces over the last tick. [N] in world
  HbVector3 force;
  // Speed of approach just before the newest impact: a part of the vehicle, a foot or the disc of propellers, touched something that it had not touched. The fastest of those within a tick; 0 without a contact. [m/s]
  double impact_speed;
  // Number of things touched: the ground, boxes, other vehicles. [1]
  uint32_t count;
  // Object of the first contact: 0 nothing, 1 the ground, 2 + i the scene's thing i (boxes first, then meshes), 1000 + i the other vehicle i. [1]
  uint32_t object;
  // Contacts that began since the run started, resting on the ground at the start left out. [1]
  uint32_t began;
  // 1 from the first impact on that was faster than the vehicle bears. [1]
  uint32_t crashed;
} HbContact;

static const HbField HB_CONTACT_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbContact, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "force", "Sum of the contact forces over the last tick.", "N", "world", offsetof(HbContact, force), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "impact_speed", "Speed of approach just before the newest impact: a part of the vehicle, a foot or the disc of propellers, touched something that it had not touched. The fastest of those within a tick; 0 without a contact.", "m/s", "", offsetof(HbContact, impact_speed), HB_F64, NULL, 0, 0, 0 },
  { "count", "Number of things touched: the ground, boxes, other vehicles.", "1", "", offsetof(HbContact, count), HB_U32, NULL, 0, 0, 0 },
  { "object", "Object of the first contact: 0 nothing, 1 the ground, 2 + i the scene's thing i (boxes first, then meshes), 1000 + i the other vehicle i.", "1", "", offsetof(HbContact, object), HB_U32, NULL, 0, 0, 0 },
  { "began", "Contacts that began since the run started, resting on the ground at the start left out.", "1", "", offsetof(HbContact, began), HB_U32, NULL, 0, 0, 0 },
  { "crashed", "1 from the first impact on that was faster than the vehicle bears.", "1", "", offsetof(HbContact, crashed), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_CONTACT = { "hummingbus_msgs/msg/Contact", "Contacts of the plant with the ground, the scene's things and other vehicles.", sizeof(HbContact), HB_CONTACT_FIELDS, 7 };

// Status of a controller at a tick: its set points, its demand, the part of it that the rotors make, and its state.
typedef struct HbControlStatus {
  // Simulation time.
  HbTime stamp;
  // Altitude that its inner loops hold: the pilot's, or its outer loop's. [m] in world
  double altitude_set_point;
  // Roll, pitch and yaw that its inner loops hold. [rad] in world
  double attitude_set_point[3];
  // Velocity that its outer loop asks for, level axes along the heading; 0 without one. [m/s]
  double velocity_set_point[2];
  // Demanded thrust along body z. [N] in body
  double thrust;
  // Demanded torque. [N*m] in body
  HbVector3 torque;
  // Thrust made less thrust demanded; it is given up first. [N]
  double thrust_error;
  // The part of the demanded roll and pitch torque that is made, 0 to 1. [1]
  double roll_pitch_part;
  // The part of the demanded yaw torque that is made, 0 to 1. [1]
  double yaw_part;
  // 1 if any of the demand was given up. [1]
  uint32_t saturated;
  // State of its guidance: of `wall-follow` 1 to 5 as in the thesis, of `wall-stop` 1 cruising, 2 braking, 3 holding; 0 without guidance. [1]
  uint32_t state;
  // Laps flown. [1]
  uint32_t laps;
  // Zero.
  uint32_t pad0;
} HbControlStatus;

static const HbField HB_CONTROL_STATUS_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbControlStatus, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "altitude_set_point", "Altitude that its inner loops hold: the pilot's, or its outer loop's.", "m", "world", offsetof(HbControlStatus, altitude_set_point), HB_F64, NULL, 0, 0, 0 },
  { "attitude_set_point", "Roll, pitch and yaw that its inner loops hold.", "rad", "world", offsetof(HbControlStatus, attitude_set_point), HB_F64, NULL, 3, 0, 0 },
  { "velocity_set_point", "Velocity that its outer loop asks for, level axes along the heading; 0 without one.", "m/s", "", offsetof(HbControlStatus, velocity_set_point), HB_F64, NULL, 2, 0, 0 },
  { "thrust", "Demanded thrust along body z.", "N", "body", offsetof(HbControlStatus, thrust), HB_F64, NULL, 0, 0, 0 },
  { "torque", "Demanded torque.", "N*m", "body", offsetof(HbControlStatus, torque), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "thrust_error", "Thrust made less thrust demanded; it is given up first.", "N", "", offsetof(HbControlStatus, thrust_error), HB_F64, NULL, 0, 0, 0 },
  { "roll_pitch_part", "The part of the demanded roll and pitch torque that is made, 0 to 1.", "1", "", offsetof(HbControlStatus, roll_pitch_part), HB_F64, NULL, 0, 0, 0 },
  { "yaw_part", "The part of the demanded yaw torque that is made, 0 to 1.", "1", "", offsetof(HbControlStatus, yaw_part), HB_F64, NULL, 0, 0, 0 },
  { "saturated", "1 if any of the demand was given up.", "1", "", offsetof(HbControlStatus, saturated), HB_U32, NULL, 0, 0, 0 },
  { "state", "State of its guidance: of `wall-follow` 1 to 5 as in the thesis, of `wall-stop` 1 cruising, 2 braking, 3 holding; 0 without guidance.", "1", "", offsetof(HbControlStatus, state), HB_U32, NULL, 0, 0, 0 },
  { "laps", "Laps flown.", "1", "", offsetof(HbControlStatus, laps), HB_U32, NULL, 0, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbControlStatus, pad0), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_CONTROL_STATUS = { "hummingbus_msgs/msg/ControlStatus", "Status of a controller at a tick: its set points, its demand, the part of it that the rotors make, and its state.", sizeof(HbControlStatus), HB_CONTROL_STATUS_FIELDS, 13 };

// Reading of a satellite receiver, in the world's axes.
typedef struct HbGps {
  // Simulation time of sending.
  HbTime stamp;
  // Simulation time at which it was measured. [ns]
  uint64_t measured_ns;
  // Position of the centre of mass. [m] in world
  HbVector3 position;
  // Velocity of the centre of mass. [m/s] in world
  HbVector3 velocity;
  // 1 if this sample holds a measurement, 0 if it was lost. [1]
  uint32_t valid;
  // Zero.
  uint32_t pad0;
} HbGps;

static const HbField HB_GPS_FIELDS[] = {
  { "stamp", "Simulation time of sending.", "", "", offsetof(HbGps, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "measured_ns", "Simulation time at which it was measured.", "ns", "", offsetof(HbGps, measured_ns), HB_U64, NULL, 0, 0, 0 },
  { "position", "Position of the centre of mass.", "m", "world", offsetof(HbGps, position), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "velocity", "Velocity of the centre of mass.", "m/s", "world", offsetof(HbGps, velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "valid", "1 if this sample holds a measurement, 0 if it was lost.", "1", "", offsetof(HbGps, valid), HB_U32, NULL, 0, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbGps, pad0), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_GPS = { "hummingbus_msgs/msg/Gps", "Reading of a satellite receiver, in the world's axes.", sizeof(HbGps), HB_GPS_FIELDS, 6 };

// Reading of an inertial measurement unit.
typedef struct HbImu {
  // Simulation time.
  HbTime stamp;
  // Measured specific force (at rest: +g along z). [m/s^2] in body
  HbVector3 specific_force;
  // Measured angular velocity. [rad/s] in body
  HbVector3 angular_velocity;
} HbImu;

static const HbField HB_IMU_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbImu, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "specific_force", "Measured specific force (at rest: +g along z).", "m/s^2", "body", offsetof(HbImu, specific_force), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "angular_velocity", "Measured angular velocity.", "rad/s", "body", offsetof(HbImu, angular_velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
};

static const HbMessage HB_IMU = { "hummingbus_msgs/msg/Imu", "Reading of an inertial measurement unit.", sizeof(HbImu), HB_IMU_FIELDS, 3 };

// Agreement of an estimator's predictions with its measurements: the last update of each sensor.
typedef struct HbInnovation {
  // Simulation time.
  HbTime stamp;
  // Normalised innovation squared of the last update by GPS, motion capture, barometer, magnetometer. [1]
  double normalised_squared[4];
  // Its degrees of freedom, which it should equal on average. [1]
  uint32_t degrees_of_freedom[4];
  // Updates so far. [1]
  uint32_t updates[4];
  // Measurements refused as outliers so far. [1]
  uint32_t refused[4];
} HbInnovation;

static const HbField HB_INNOVATION_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbInnovation, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "normalised_squared", "Normalised innovation squared of the last update by GPS, motion capture, barometer, magnetometer.", "1", "", offsetof(HbInnovation, normalised_squared), HB_F64, NULL, 4, 0, 0 },
  { "degrees_of_freedom", "Its degrees of freedom, which it should equal on average.", "1", "", offsetof(HbInnovation, degrees_of_freedom), HB_U32, NULL, 4, 0, 0 },
  { "updates", "Updates so far.", "1", "", offsetof(HbInnovation, updates), HB_U32, NULL, 4, 0, 0 },
  { "refused", "Measurements refused as outliers so far.", "1", "", offsetof(HbInnovation, refused), HB_U32, NULL, 4, 0, 0 },
};

static const HbMessage HB_INNOVATION = { "hummingbus_msgs/msg/Innovation", "Agreement of an estimator's predictions with its measurements: the last update of each sensor.", sizeof(HbInnovation), HB_INNOVATION_FIELDS, 5 };

// Statistics of a link, from its first tick on; arrays by the names of the streams.
typedef struct HbLinkStatistics {
  // Simulation time.
  HbTime stamp;
  // Whole bytes that the wire has carried. [1]
  uint64_t sent_bytes;
  // Bytes that wait for the wire. [1]
  uint32_t queued_bytes;
  // Messages that wait for the wire. [1]
  uint32_t queued;
  // Time from queueing to arrival of the message that arrived last. [s]
  double delay;
  // Messages that are on the wire or behind it. [1]
  uint32_t under_way;
  // Messages that have arrived. [1]
  uint32_t arrived;
  // Messages that were lost on the way; counted when they would have arrived. [1]
  uint32_t lost;
  // Messages that were dropped because the queue was full. [1]
  uint32_t dropped;
  // Messages that have arrived, by stream. [1]
  uint32_t stream_arrived[16];
  // Messages that were lost on the way, by stream. [1]
  uint32_t stream_lost[16];
  // Messages that were dropped because the queue was full, by stream. [1]
  uint32_t stream_dropped[16];
} HbLinkStatistics;

static const HbField HB_LINK_STATISTICS_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbLinkStatistics, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "sent_bytes", "Whole bytes that the wire has carried.", "1", "", offsetof(HbLinkStatistics, sent_bytes), HB_U64, NULL, 0, 0, 0 },
  { "queued_bytes", "Bytes that wait for the wire.", "1", "", offsetof(HbLinkStatistics, queued_bytes), HB_U32, NULL, 0, 0, 0 },
  { "queued", "Messages that wait for the wire.", "1", "", offsetof(HbLinkStatistics, queued), HB_U32, NULL, 0, 0, 0 },
  { "delay", "Time from queueing to arrival of the message that arrived last.", "s", "", offsetof(HbLinkStatistics, delay), HB_F64, NULL, 0, 0, 0 },
  { "under_way", "Messages that are on the wire or behind it.", "1", "", offsetof(HbLinkStatistics, under_way), HB_U32, NULL, 0, 0, 0 },
  { "arrived", "Messages that have arrived.", "1", "", offsetof(HbLinkStatistics, arrived), HB_U32, NULL, 0, 0, 0 },
  { "lost", "Messages that were lost on the way; counted when they would have arrived.", "1", "", offsetof(HbLinkStatistics, lost), HB_U32, NULL, 0, 0, 0 },
  { "dropped", "Messages that were dropped because the queue was full.", "1", "", offsetof(HbLinkStatistics, dropped), HB_U32, NULL, 0, 0, 0 },
  { "stream_arrived", "Messages that have arrived, by stream.", "1", "", offsetof(HbLinkStatistics, stream_arrived), HB_U32, NULL, 16, 0, 0 },
  { "stream_lost", "Messages that were lost on the way, by stream.", "1", "", offsetof(HbLinkStatistics, stream_lost), HB_U32, NULL, 16, 0, 0 },
  { "stream_dropped", "Messages that were dropped because the queue was full, by stream.", "1", "", offsetof(HbLinkStatistics, stream_dropped), HB_U32, NULL, 16, 0, 0 },
};

static const HbMessage HB_LINK_STATISTICS = { "hummingbus_msgs/msg/LinkStatistics", "Statistics of a link, from its first tick on; arrays by the names of the streams.", sizeof(HbLinkStatistics), HB_LINK_STATISTICS_FIELDS, 12 };

// Reading of a magnetometer.
typedef struct HbMagnetometer {
  // Simulation time of sending.
  HbTime stamp;
  // Simulation time at which it was measured. [ns]
  uint64_t measured_ns;
  // Magnetic flux density. [T] in body
  HbVector3 field;
  // 1 if this sample holds a measurement, 0 if it was lost. [1]
  uint32_t valid;
  // Zero.
  uint32_t pad0;
} HbMagnetometer;

static const HbField HB_MAGNETOMETER_FIELDS[] = {
  { "stamp", "Simulation time of sending.", "", "", offsetof(HbMagnetometer, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "measured_ns", "Simulation time at which it was measured.", "ns", "", offsetof(HbMagnetometer, measured_ns), HB_U64, NULL, 0, 0, 0 },
  { "field", "Magnetic flux density.", "T", "body", offsetof(HbMagnetometer, field), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "valid", "1 if this sample holds a measurement, 0 if it was lost.", "1", "", offsetof(HbMagnetometer, valid), HB_U32, NULL, 0, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbMagnetometer, pad0), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_MAGNETOMETER = { "hummingbus_msgs/msg/Magnetometer", "Reading of a magnetometer.", sizeof(HbMagnetometer), HB_MAGNETOMETER_FIELDS, 5 };

// A vehicle's state as measured in a real flight.
typedef struct HbMeasuredState {
  // Simulation time.
  HbTime stamp;
  // Position. [m] in world
  HbVector3 position;
  // Velocity. [m/s] in world
  HbVector3 velocity;
  // Attitude, body to world. in world
  HbQuaternion attitude;
  // Angular velocity. [rad/s] in body
  HbVector3 angular_velocity;
} HbMeasuredState;

static const HbField HB_MEASURED_STATE_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbMeasuredState, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "position", "Position.", "m", "world", offsetof(HbMeasuredState, position), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "velocity", "Velocity.", "m/s", "world", offsetof(HbMeasuredState, velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "attitude", "Attitude, body to world.", "", "world", offsetof(HbMeasuredState, attitude), HB_NESTED, &HB_QUATERNION, 0, 0, 0 },
  { "angular_velocity", "Angular velocity.", "rad/s", "body", offsetof(HbMeasuredState, angular_velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
};

static const HbMessage HB_MEASURED_STATE = { "hummingbus_msgs/msg/MeasuredState", "A vehicle's state as measured in a real flight.", sizeof(HbMeasuredState), HB_MEASURED_STATE_FIELDS, 5 };

// Reading of a motion-capture system.
typedef struct HbMocap {
  // Simulation time of sending.
  HbTime stamp;
  // Simulation time at which it was measured. [ns]
  uint64_t measured_ns;
  // Position of the centre of mass. [m] in world
  HbVector3 position;
  // Attitude, body to world. in world
  HbQuaternion attitude;
  // 1 if this sample holds a measurement, 0 if it was lost. [1]
  uint32_t valid;
  // Zero.
  uint32_t pad0;
} HbMocap;

static const HbField HB_MOCAP_FIELDS[] = {
  { "stamp", "Simulation time of sending.", "", "", offsetof(HbMocap, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "measured_ns", "Simulation time at which it was measured.", "ns", "", offsetof(HbMocap, measured_ns), HB_U64, NULL, 0, 0, 0 },
  { "position", "Position of the centre of mass.", "m", "world", offsetof(HbMocap, position), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "attitude", "Attitude, body to world.", "", "world", offsetof(HbMocap, attitude), HB_NESTED, &HB_QUATERNION, 0, 0, 0 },
  { "valid", "1 if this sample holds a measurement, 0 if it was lost.", "1", "", offsetof(HbMocap, valid), HB_U32, NULL, 0, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbMocap, pad0), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_MOCAP = { "hummingbus_msgs/msg/Mocap", "Reading of a motion-capture system.", sizeof(HbMocap), HB_MOCAP_FIELDS, 6 };

// Motor commands in the vehicle's own raw counts (Hummingbird 1…200, Crazyflie 0…65535).
typedef struct HbMotorCommand {
  // Simulation time.
  HbTime stamp;
  // Commands in the order of the vehicle file's rotors; its `command` table maps them to speeds. [count]
  struct { uint32_t count; uint32_t pad; double values[12]; } command;
} HbMotorCommand;

static const HbField HB_MOTOR_COMMAND_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbMotorCommand, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "command", "Commands in the order of the vehicle file's rotors; its `command` table maps them to speeds.", "count", "", offsetof(HbMotorCommand, command), HB_F64, NULL, 0, 0, 12 },
};

static const HbMessage HB_MOTOR_COMMAND = { "hummingbus_msgs/msg/MotorCommand", "Motor commands in the vehicle's own raw counts (Hummingbird 1…200, Crazyflie 0…65535).", sizeof(HbMotorCommand), HB_MOTOR_COMMAND_FIELDS, 2 };

// The true state of a vehicle and its rotors. Sensors and recorders read it; estimators do not.
typedef struct HbPlantState {
  // Simulation time.
  HbTime stamp;
  // Position of the centre of mass. [m] in world
  HbVector3 position;
  // Velocity of the centre of mass. [m/s] in world
  HbVector3 velocity;
  // Attitude, body to world. in world
  HbQuaternion attitude;
  // Angular velocity of the body against the world. [rad/s] in body
  HbVector3 angular_velocity;
  // Specific force at the centre of mass: what an ideal accelerometer there reads. [m/s^2] in body
  HbVector3 specific_force;
  // Rotor speeds, in the order of the vehicle file. [rad/s]
  struct { uint32_t count; uint32_t pad; double values[12]; } rotor_speed;
} HbPlantState;

static const HbField HB_PLANT_STATE_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbPlantState, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "position", "Position of the centre of mass.", "m", "world", offsetof(HbPlantState, position), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "velocity", "Velocity of the centre of mass.", "m/s", "world", offsetof(HbPlantState, velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "attitude", "Attitude, body to world.", "", "world", offsetof(HbPlantState, attitude), HB_NESTED, &HB_QUATERNION, 0, 0, 0 },
  { "angular_velocity", "Angular velocity of the body against the world.", "rad/s", "body", offsetof(HbPlantState, angular_velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "specific_force", "Specific force at the centre of mass: what an ideal accelerometer there reads.", "m/s^2", "body", offsetof(HbPlantState, specific_force), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "rotor_speed", "Rotor speeds, in the order of the vehicle file.", "rad/s", "", offsetof(HbPlantState, rotor_speed), HB_F64, NULL, 0, 0, 12 },
};

static const HbMessage HB_PLANT_STATE = { "hummingbus_msgs/msg/PlantState", "The true state of a vehicle and its rotors. Sensors and recorders read it; estimators do not.", sizeof(HbPlantState), HB_PLANT_STATE_FIELDS, 7 };

// Readings of five range finders, in the order +x, -x, +y, -y of the body, and down.
typedef struct HbRanges {
  // Simulation time of sending.
  HbTime stamp;
  // Simulation time at which it was measured. [ns]
  uint64_t measured_ns;
  // Distances; the sensor's reach where nothing is met. [m] in body
  double distance[5];
  // 1 for each beam that measured something, 0 where it met nothing within reach or was lost. [1]
  uint32_t valid[5];
  // Zero.
  uint32_t pad0;
} HbRanges;

static const HbField HB_RANGES_FIELDS[] = {
  { "stamp", "Simulation time of sending.", "", "", offsetof(HbRanges, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "measured_ns", "Simulation time at which it was measured.", "ns", "", offsetof(HbRanges, measured_ns), HB_U64, NULL, 0, 0, 0 },
  { "distance", "Distances; the sensor's reach where nothing is met.", "m", "body", offsetof(HbRanges, distance), HB_F64, NULL, 5, 0, 0 },
  { "valid", "1 for each beam that measured something, 0 where it met nothing within reach or was lost.", "1", "", offsetof(HbRanges, valid), HB_U32, NULL, 5, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbRanges, pad0), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_RANGES = { "hummingbus_msgs/msg/Ranges", "Readings of five range finders, in the order +x, -x, +y, -y of the body, and down.", sizeof(HbRanges), HB_RANGES_FIELDS, 5 };

// The channels of a remote control, as its receiver reports them.
typedef struct HbRcChannels {
  // Simulation time.
  HbTime stamp;
  // Pulses, 1000 to 2000: roll, pitch, throttle and yaw, then the switches. [us]
  struct { uint32_t count; uint32_t pad; double values[16]; } pulse;
} HbRcChannels;

static const HbField HB_RC_CHANNELS_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbRcChannels, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "pulse", "Pulses, 1000 to 2000: roll, pitch, throttle and yaw, then the switches.", "us", "", offsetof(HbRcChannels, pulse), HB_F64, NULL, 0, 0, 16 },
};

static const HbMessage HB_RC_CHANNELS = { "hummingbus_msgs/msg/RcChannels", "The channels of a remote control, as its receiver reports them.", sizeof(HbRcChannels), HB_RC_CHANNELS_FIELDS, 2 };

// A point of a trajectory.
typedef struct HbReference {
  // Simulation time.
  HbTime stamp;
  // Position. [m] in world
  HbVector3 position;
  // Velocity. [m/s] in world
  HbVector3 velocity;
  // Acceleration. [m/s^2] in world
  HbVector3 acceleration;
  // Jerk. [m/s^3] in world
  HbVector3 jerk;
  // Snap. [m/s^4] in world
  HbVector3 snap;
  // Yaw. [rad] in world
  double yaw;
  // Its rate of change. [rad/s] in world
  double yaw_rate;
} HbReference;

static const HbField HB_REFERENCE_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbReference, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "position", "Position.", "m", "world", offsetof(HbReference, position), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "velocity", "Velocity.", "m/s", "world", offsetof(HbReference, velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "acceleration", "Acceleration.", "m/s^2", "world", offsetof(HbReference, acceleration), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "jerk", "Jerk.", "m/s^3", "world", offsetof(HbReference, jerk), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "snap", "Snap.", "m/s^4", "world", offsetof(HbReference, snap), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "yaw", "Yaw.", "rad", "world", offsetof(HbReference, yaw), HB_F64, NULL, 0, 0, 0 },
  { "yaw_rate", "Its rate of change.", "rad/s", "world", offsetof(HbReference, yaw_rate), HB_F64, NULL, 0, 0, 0 },
};

static const HbMessage HB_REFERENCE = { "hummingbus_msgs/msg/Reference", "A point of a trajectory.", sizeof(HbReference), HB_REFERENCE_FIELDS, 8 };

// Readings of the stand's sensors.
typedef struct HbRotorLoad {
  // Simulation time.
  HbTime stamp;
  // The speed that the motor is asked for. [rad/s]
  double rotor_speed_commanded;
  // Speed of the rotor, positive in its own sense of rotation. [rad/s]
  double rotor_speed;
  // Thrust along the rotor's axis. [N]
  double thrust;
  // Torque of the air on the rotor, against its rotation. [N*m]
  double drag_torque;
  // Torque on what the motor is bolted to, about the axis that points up: the air's drag and what speeds the rotor up. [N*m] in body
  double mount_torque;
} HbRotorLoad;

static const HbField HB_ROTOR_LOAD_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbRotorLoad, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "rotor_speed_commanded", "The speed that the motor is asked for.", "rad/s", "", offsetof(HbRotorLoad, rotor_speed_commanded), HB_F64, NULL, 0, 0, 0 },
  { "rotor_speed", "Speed of the rotor, positive in its own sense of rotation.", "rad/s", "", offsetof(HbRotorLoad, rotor_speed), HB_F64, NULL, 0, 0, 0 },
  { "thrust", "Thrust along the rotor's axis.", "N", "", offsetof(HbRotorLoad, thrust), HB_F64, NULL, 0, 0, 0 },
  { "drag_torque", "Torque of the air on the rotor, against its rotation.", "N*m", "", offsetof(HbRotorLoad, drag_torque), HB_F64, NULL, 0, 0, 0 },
  { "mount_torque", "Torque on what the motor is bolted to, about the axis that points up: the air's drag and what speeds the rotor up.", "N*m", "body", offsetof(HbRotorLoad, mount_torque), HB_F64, NULL, 0, 0, 0 },
};

static const HbMessage HB_ROTOR_LOAD = { "hummingbus_msgs/msg/RotorLoad", "Readings of the stand's sensors.", sizeof(HbRotorLoad), HB_ROTOR_LOAD_FIELDS, 6 };

// Readings of the motor controllers.
typedef struct HbRotorSpeeds {
  // Simulation time of sending.
  HbTime stamp;
  // Simulation time at which it was measured. [ns]
  uint64_t measured_ns;
  // 1 if this sample holds a measurement, 0 if it was lost. [1]
  uint32_t valid;
  // Zero.
  uint32_t pad0;
  // Speeds of the rotors, in the order of the vehicle file. [rad/s]
  struct { uint32_t count; uint32_t pad; double values[12]; } rotor_speed;
} HbRotorSpeeds;

static const HbField HB_ROTOR_SPEEDS_FIELDS[] = {
  { "stamp", "Simulation time of sending.", "", "", offsetof(HbRotorSpeeds, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "measured_ns", "Simulation time at which it was measured.", "ns", "", offsetof(HbRotorSpeeds, measured_ns), HB_U64, NULL, 0, 0, 0 },
  { "valid", "1 if this sample holds a measurement, 0 if it was lost.", "1", "", offsetof(HbRotorSpeeds, valid), HB_U32, NULL, 0, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbRotorSpeeds, pad0), HB_U32, NULL, 0, 0, 0 },
  { "rotor_speed", "Speeds of the rotors, in the order of the vehicle file.", "rad/s", "", offsetof(HbRotorSpeeds, rotor_speed), HB_F64, NULL, 0, 0, 12 },
};

static const HbMessage HB_ROTOR_SPEEDS = { "hummingbus_msgs/msg/RotorSpeeds", "Readings of the motor controllers.", sizeof(HbRotorSpeeds), HB_ROTOR_SPEEDS_FIELDS, 5 };

// Set points that a pilot or a planner gives to the controller.
typedef struct HbSetPoint {
  // Simulation time.
  HbTime stamp;
  // Altitude of the centre of mass. [m] in world
  double altitude;
  // Roll. [rad] in world
  double roll;
  // Pitch, positive nose down. [rad] in world
  double pitch;
  // Yaw. [rad] in world
  double yaw;
} HbSetPoint;

static const HbField HB_SET_POINT_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbSetPoint, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "altitude", "Altitude of the centre of mass.", "m", "world", offsetof(HbSetPoint, altitude), HB_F64, NULL, 0, 0, 0 },
  { "roll", "Roll.", "rad", "world", offsetof(HbSetPoint, roll), HB_F64, NULL, 0, 0, 0 },
  { "pitch", "Pitch, positive nose down.", "rad", "world", offsetof(HbSetPoint, pitch), HB_F64, NULL, 0, 0, 0 },
  { "yaw", "Yaw.", "rad", "world", offsetof(HbSetPoint, yaw), HB_F64, NULL, 0, 0, 0 },
};

static const HbMessage HB_SET_POINT = { "hummingbus_msgs/msg/SetPoint", "Set points that a pilot or a planner gives to the controller.", sizeof(HbSetPoint), HB_SET_POINT_FIELDS, 5 };

// Estimate of the vehicle's motion.
typedef struct HbStateEstimate {
  // Simulation time.
  HbTime stamp;
  // Position of the centre of mass. [m] in world
  HbVector3 position;
  // Velocity of the centre of mass. [m/s] in world
  HbVector3 velocity;
  // Attitude, body to world. in world
  HbQuaternion attitude;
  // Angular velocity, the gyroscope's estimated bias taken off. [rad/s] in body
  HbVector3 angular_velocity;
  // Standard deviation of the position as the estimator believes it. [m] in world
  HbVector3 position_sigma;
  // Standard deviation of the velocity. [m/s] in world
  HbVector3 velocity_sigma;
  // Standard deviation of the attitude, as a rotation vector. [rad] in body
  HbVector3 attitude_sigma;
} HbStateEstimate;

static const HbField HB_STATE_ESTIMATE_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbStateEstimate, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "position", "Position of the centre of mass.", "m", "world", offsetof(HbStateEstimate, position), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "velocity", "Velocity of the centre of mass.", "m/s", "world", offsetof(HbStateEstimate, velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "attitude", "Attitude, body to world.", "", "world", offsetof(HbStateEstimate, attitude), HB_NESTED, &HB_QUATERNION, 0, 0, 0 },
  { "angular_velocity", "Angular velocity, the gyroscope's estimated bias taken off.", "rad/s", "body", offsetof(HbStateEstimate, angular_velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "position_sigma", "Standard deviation of the position as the estimator believes it.", "m", "world", offsetof(HbStateEstimate, position_sigma), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "velocity_sigma", "Standard deviation of the velocity.", "m/s", "world", offsetof(HbStateEstimate, velocity_sigma), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "attitude_sigma", "Standard deviation of the attitude, as a rotation vector.", "rad", "body", offsetof(HbStateEstimate, attitude_sigma), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
};

static const HbMessage HB_STATE_ESTIMATE = { "hummingbus_msgs/msg/StateEstimate", "Estimate of the vehicle's motion.", sizeof(HbStateEstimate), HB_STATE_ESTIMATE_FIELDS, 8 };

// Positions and velocities of the vehicles of a run, for vehicles that share a room.
typedef struct HbTraffic {
  // Simulation time.
  HbTime stamp;
  // Number of vehicles. [1]
  uint32_t count;
  // Zero.
  uint32_t pad0;
  // Positions of their centres of mass, in the order of the inputs' names. [m] in world
  HbVector3 position[32];
  // Their velocities. [m/s] in world
  HbVector3 velocity[32];
} HbTraffic;

static const HbField HB_TRAFFIC_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbTraffic, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "count", "Number of vehicles.", "1", "", offsetof(HbTraffic, count), HB_U32, NULL, 0, 0, 0 },
  { "pad0", "Zero.", "", "", offsetof(HbTraffic, pad0), HB_U32, NULL, 0, 0, 0 },
  { "position", "Positions of their centres of mass, in the order of the inputs' names.", "m", "world", offsetof(HbTraffic, position), HB_NESTED, &HB_VECTOR3, 32, 0, 0 },
  { "velocity", "Their velocities.", "m/s", "world", offsetof(HbTraffic, velocity), HB_NESTED, &HB_VECTOR3, 32, 0, 0 },
};

static const HbMessage HB_TRAFFIC = { "hummingbus_msgs/msg/Traffic", "Positions and velocities of the vehicles of a run, for vehicles that share a room.", sizeof(HbTraffic), HB_TRAFFIC_FIELDS, 5 };

// Estimate from range finders: level distances to the surroundings, height and velocity.
typedef struct HbWallEstimate {
  // Simulation time.
  HbTime stamp;
  // Level distances along the heading's +x, -x, +y, -y; the sensor's reach where nothing is in sight. [m]
  double distance[4];
  // 1 where a wall is in sight. [1]
  uint32_t in_sight[4];
  // Velocity along the heading's x and y: level axes that turn with the yaw. [m/s]
  double velocity[2];
  // Height above what is below. [m]
  double height;
  // Rate of climb. [m/s]
  double climb_rate;
} HbWallEstimate;

static const HbField HB_WALL_ESTIMATE_FIELDS[] = {
  { "stamp", "Simulation time.", "", "", offsetof(HbWallEstimate, stamp), HB_NESTED, &HB_TIME, 0, 0, 0 },
  { "distance", "Level distances along the heading's +x, -x, +y, -y; the sensor's reach where nothing is in sight.", "m", "", offsetof(HbWallEstimate, distance), HB_F64, NULL, 4, 0, 0 },
  { "in_sight", "1 where a wall is in sight.", "1", "", offsetof(HbWallEstimate, in_sight), HB_U32, NULL, 4, 0, 0 },
  { "velocity", "Velocity along the heading's x and y: level axes that turn with the yaw.", "m/s", "", offsetof(HbWallEstimate, velocity), HB_F64, NULL, 2, 0, 0 },
  { "height", "Height above what is below.", "m", "", offsetof(HbWallEstimate, height), HB_F64, NULL, 0, 0, 0 },
  { "climb_rate", "Rate of climb.", "m/s", "", offsetof(HbWallEstimate, climb_rate), HB_F64, NULL, 0, 0, 0 },
};

static const HbMessage HB_WALL_ESTIMATE = { "hummingbus_msgs/msg/WallEstimate", "Estimate from range finders: level distances to the surroundings, height and velocity.", sizeof(HbWallEstimate), HB_WALL_ESTIMATE_FIELDS, 6 };

// State of the component.
typedef struct HbClearanceState {
  // Bearing of the vehicle from the world's origin at the last tick; not a number before the first. [rad] in world
  double bearing;
  // Turns flown clockwise. [1]
  double laps;
} HbClearanceState;

static const HbField HB_CLEARANCE_STATE_FIELDS[] = {
  { "bearing", "Bearing of the vehicle from the world's origin at the last tick; not a number before the first.", "rad", "world", offsetof(HbClearanceState, bearing), HB_F64, NULL, 0, 0, 0 },
  { "laps", "Turns flown clockwise.", "1", "", offsetof(HbClearanceState, laps), HB_F64, NULL, 0, 0, 0 },
};

static const HbMessage HB_CLEARANCE_STATE = { "hummingbus_msgs/msg/ClearanceState", "State of the component.", sizeof(HbClearanceState), HB_CLEARANCE_STATE_FIELDS, 2 };

// State of the filter between two samples.
typedef struct HbComplementaryState {
  // The estimated attitude at the last sample, body to world. in world
  HbQuaternion attitude;
  // The last sample's angular rate; not a number before the first. [rad/s] in body
  HbVector3 last_angular_velocity;
} HbComplementaryState;

static const HbField HB_COMPLEMENTARY_STATE_FIELDS[] = {
  { "attitude", "The estimated attitude at the last sample, body to world.", "", "world", offsetof(HbComplementaryState, attitude), HB_NESTED, &HB_QUATERNION, 0, 0, 0 },
  { "last_angular_velocity", "The last sample's angular rate; not a number before the first.", "rad/s", "body", offsetof(HbComplementaryState, last_angular_velocity), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
};

static const HbMessage HB_COMPLEMENTARY_STATE = { "hummingbus_msgs/msg/ComplementaryState", "State of the filter between two samples.", sizeof(HbComplementaryState), HB_COMPLEMENTARY_STATE_FIELDS, 2 };

// Law that a state belongs to; zero before the first tick.
typedef struct HbLawId {
  // The law's name, zeros behind. [1]
  uint8_t name[24];
  // Layout hash of its state, combined with its name. [1]
  uint64_t state;
} HbLawId;

static const HbField HB_LAW_ID_FIELDS[] = {
  { "name", "The law's name, zeros behind.", "1", "", offsetof(HbLawId, name), HB_U8, NULL, 24, 0, 0 },
  { "state", "Layout hash of its state, combined with its name.", "1", "", offsetof(HbLawId, state), HB_U64, NULL, 0, 0, 0 },
};

static const HbMessage HB_LAW_ID = { "hummingbus_msgs/msg/LawId", "Law that a state belongs to; zero before the first tick.", sizeof(HbLawId), HB_LAW_ID_FIELDS, 2 };

// Outputs of the integrators of a law, in units that mean the same to all laws.
typedef struct HbControlIntegrals {
  // Vertical acceleration. [m/s^2] in world
  double lift;
  // Angular accelerations for roll, pitch and yaw; zero under `lqr` and `geometric`, which observe a lift alone. [rad/s^2] in body
  double turn[3];
} HbControlIntegrals;

static const HbField HB_CONTROL_INTEGRALS_FIELDS[] = {
  { "lift", "Vertical acceleration.", "m/s^2", "world", offsetof(HbControlIntegrals, lift), HB_F64, NULL, 0, 0, 0 },
  { "turn", "Angular accelerations for roll, pitch and yaw; zero under `lqr` and `geometric`, which observe a lift alone.", "rad/s^2", "body", offsetof(HbControlIntegrals, turn), HB_F64, NULL, 3, 0, 0 },
};

static const HbMessage HB_CONTROL_INTEGRALS = { "hummingbus_msgs/msg/ControlIntegrals", "Outputs of the integrators of a law, in units that mean the same to all laws.", sizeof(HbControlIntegrals), HB_CONTROL_INTEGRALS_FIELDS, 2 };

// State of a controller between ticks.
typedef struct HbControllerState {
  // The law that left it.
  HbLawId id;
  // Thrust that was demanded last. [N] in body
  double thrust;
  // Torque that was demanded last. [N*m] in body
  double torque[3];
  // Outputs of the law's integrators.
  HbControlIntegrals integrals;
  // Remaining part of the predecessor's thrust that this law does not ask for itself. [N] in body
  double residual_thrust;
  // The same of its torque. [N*m] in body
  double residual_torque[3];
  // The law's own state in the first words. [1]
  uint64_t law_state[32];
} HbControllerState;

static const HbField HB_CONTROLLER_STATE_FIELDS[] = {
  { "id", "The law that left it.", "", "", offsetof(HbControllerState, id), HB_NESTED, &HB_LAW_ID, 0, 0, 0 },
  { "thrust", "Thrust that was demanded last.", "N", "body", offsetof(HbControllerState, thrust), HB_F64, NULL, 0, 0, 0 },
  { "torque", "Torque that was demanded last.", "N*m", "body", offsetof(HbControllerState, torque), HB_F64, NULL, 3, 0, 0 },
  { "integrals", "Outputs of the law's integrators.", "", "", offsetof(HbControllerState, integrals), HB_NESTED, &HB_CONTROL_INTEGRALS, 0, 0, 0 },
  { "residual_thrust", "Remaining part of the predecessor's thrust that this law does not ask for itself.", "N", "body", offsetof(HbControllerState, residual_thrust), HB_F64, NULL, 0, 0, 0 },
  { "residual_torque", "The same of its torque.", "N*m", "body", offsetof(HbControllerState, residual_torque), HB_F64, NULL, 3, 0, 0 },
  { "law_state", "The law's own state in the first words.", "1", "", offsetof(HbControllerState, law_state), HB_U64, NULL, 32, 0, 0 },
};

static const HbMessage HB_CONTROLLER_STATE = { "hummingbus_msgs/msg/ControllerState", "State of a controller between ticks.", sizeof(HbControllerState), HB_CONTROLLER_STATE_FIELDS, 7 };

// State of `operator`.
typedef struct HbOperatorState {
  // Altitude that was asked for last, within its limits. [m] in world
  double altitude;
  // Roll that was asked for last, within its limit. [rad]
  double roll;
  // Pitch that was asked for last, positive nose down, within its limit. [rad]
  double pitch;
  // Yaw that was asked for last. [rad]
  double yaw;
  // Altitude lost since the source fell silent. [m] in world
  double lowered;
  // 1 once somebody has asked.
  uint32_t is_asked;
  // Zero.
  uint32_t reserved;
} HbOperatorState;

static const HbField HB_OPERATOR_STATE_FIELDS[] = {
  { "altitude", "Altitude that was asked for last, within its limits.", "m", "world", offsetof(HbOperatorState, altitude), HB_F64, NULL, 0, 0, 0 },
  { "roll", "Roll that was asked for last, within its limit.", "rad", "", offsetof(HbOperatorState, roll), HB_F64, NULL, 0, 0, 0 },
  { "pitch", "Pitch that was asked for last, positive nose down, within its limit.", "rad", "", offsetof(HbOperatorState, pitch), HB_F64, NULL, 0, 0, 0 },
  { "yaw", "Yaw that was asked for last.", "rad", "", offsetof(HbOperatorState, yaw), HB_F64, NULL, 0, 0, 0 },
  { "lowered", "Altitude lost since the source fell silent.", "m", "world", offsetof(HbOperatorState, lowered), HB_F64, NULL, 0, 0, 0 },
  { "is_asked", "1 once somebody has asked.", "", "", offsetof(HbOperatorState, is_asked), HB_U32, NULL, 0, 0, 0 },
  { "reserved", "Zero.", "", "", offsetof(HbOperatorState, reserved), HB_U32, NULL, 0, 0, 0 },
};

static const HbMessage HB_OPERATOR_STATE = { "hummingbus_msgs/msg/OperatorState", "State of `operator`.", sizeof(HbOperatorState), HB_OPERATOR_STATE_FIELDS, 7 };

// State of the position hold.
typedef struct HbPositionHoldState {
  // The place that is held; without meaning along an axis that is not locked. [m] in world
  double place[2];
  // 1 where the place along the heading's x, or y, is locked. [1]
  uint32_t locked[2];
} HbPositionHoldState;

static const HbField HB_POSITION_HOLD_STATE_FIELDS[] = {
  { "place", "The place that is held; without meaning along an axis that is not locked.", "m", "world", offsetof(HbPositionHoldState, place), HB_F64, NULL, 2, 0, 0 },
  { "locked", "1 where the place along the heading's x, or y, is locked.", "1", "", offsetof(HbPositionHoldState, locked), HB_U32, NULL, 2, 0, 0 },
};

static const HbMessage HB_POSITION_HOLD_STATE = { "hummingbus_msgs/msg/PositionHoldState", "State of the position hold.", sizeof(HbPositionHoldState), HB_POSITION_HOLD_STATE_FIELDS, 2 };

// State of the component.
typedef struct HbPropellerStandState {
  // Speed of the rotor. [rad/s]
  double speed;
  // Its rate of change. [rad/s^2]
  double acceleration;
} HbPropellerStandState;

static const HbField HB_PROPELLER_STAND_STATE_FIELDS[] = {
  { "speed", "Speed of the rotor.", "rad/s", "", offsetof(HbPropellerStandState, speed), HB_F64, NULL, 0, 0, 0 },
  { "acceleration", "Its rate of change.", "rad/s^2", "", offsetof(HbPropellerStandState, acceleration), HB_F64, NULL, 0, 0, 0 },
};

static const HbMessage HB_PROPELLER_STAND_STATE = { "hummingbus_msgs/msg/PropellerStandState", "State of the component.", sizeof(HbPropellerStandState), HB_PROPELLER_STAND_STATE_FIELDS, 2 };

// Estimate along one axis.
typedef struct HbRangeInertialAxis {
  // Velocity. [m/s] in world
  double velocity;
  // Error of the acceleration that is fed in. [m/s^2] in world
  double bias;
  // Displacement since the start. [m] in world
  double path;
  // Distances to what stands ahead and behind; without meaning where nothing is in sight. [m] in world
  double distance[2];
  // 1 where something is in sight. [1]
  uint32_t in_sight[2];
  // Covariance of the errors of the above, in their order and units.
  double covariance[25];
} HbRangeInertialAxis;

static const HbField HB_RANGE_INERTIAL_AXIS_FIELDS[] = {
  { "velocity", "Velocity.", "m/s", "world", offsetof(HbRangeInertialAxis, velocity), HB_F64, NULL, 0, 0, 0 },
  { "bias", "Error of the acceleration that is fed in.", "m/s^2", "world", offsetof(HbRangeInertialAxis, bias), HB_F64, NULL, 0, 0, 0 },
  { "path", "Displacement since the start.", "m", "world", offsetof(HbRangeInertialAxis, path), HB_F64, NULL, 0, 0, 0 },
  { "distance", "Distances to what stands ahead and behind; without meaning where nothing is in sight.", "m", "world", offsetof(HbRangeInertialAxis, distance), HB_F64, NULL, 2, 0, 0 },
  { "in_sight", "1 where something is in sight.", "1", "", offsetof(HbRangeInertialAxis, in_sight), HB_U32, NULL, 2, 0, 0 },
  { "covariance", "Covariance of the errors of the above, in their order and units.", "", "", offsetof(HbRangeInertialAxis, covariance), HB_F64, NULL, 25, 0, 0 },
};

static const HbMessage HB_RANGE_INERTIAL_AXIS = { "hummingbus_msgs/msg/RangeInertialAxis", "Estimate along one axis.", sizeof(HbRangeInertialAxis), HB_RANGE_INERTIAL_AXIS_FIELDS, 6 };

// Sums of the acceleration, its bias not taken off.
typedef struct HbRangeInertialGains {
  // Samples so far.
  uint64_t samples;
  // The sum of all. [m/s] in world
  HbVector3 total;
  // The sum as it was every 10 ms, the k-th of these at the place k modulo the number of places. [m/s] in world
  HbVector3 kept[128];
} HbRangeInertialGains;

static const HbField HB_RANGE_INERTIAL_GAINS_FIELDS[] = {
  { "samples", "Samples so far.", "", "", offsetof(HbRangeInertialGains, samples), HB_U64, NULL, 0, 0, 0 },
  { "total", "The sum of all.", "m/s", "world", offsetof(HbRangeInertialGains, total), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "kept", "The sum as it was every 10 ms, the k-th of these at the place k modulo the number of places.", "m/s", "world", offsetof(HbRangeInertialGains, kept), HB_NESTED, &HB_VECTOR3, 128, 0, 0 },
};

static const HbMessage HB_RANGE_INERTIAL_GAINS = { "hummingbus_msgs/msg/RangeInertialGains", "Sums of the acceleration, its bias not taken off.", sizeof(HbRangeInertialGains), HB_RANGE_INERTIAL_GAINS_FIELDS, 3 };

// Pose of the vehicle at a sample.
typedef struct HbRangeInertialPast {
  // Displacement since the start. [m] in world
  HbVector3 path;
  // Attitude, body to world. in world
  HbQuaternion attitude;
} HbRangeInertialPast;

static const HbField HB_RANGE_INERTIAL_PAST_FIELDS[] = {
  { "path", "Displacement since the start.", "m", "world", offsetof(HbRangeInertialPast, path), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "attitude", "Attitude, body to world.", "", "world", offsetof(HbRangeInertialPast, attitude), HB_NESTED, &HB_QUATERNION, 0, 0, 0 },
};

static const HbMessage HB_RANGE_INERTIAL_PAST = { "hummingbus_msgs/msg/RangeInertialPast", "Pose of the vehicle at a sample.", sizeof(HbRangeInertialPast), HB_RANGE_INERTIAL_PAST_FIELDS, 2 };

// State of the estimator, as it is handed over.
typedef struct HbRangeInertialState {
  // Samples so far.
  uint64_t samples;
  // When the newest ranges were measured; the largest number before the first. [ns]
  uint64_t measured_ns;
  // When the newest velocity of a receiver was measured; the largest number before the first. [ns]
  uint64_t gps_measured_ns;
  // When the last echo came from ahead and from behind along x, and along y. [ns]
  uint64_t echo_ns[2][2];
  // In a room of known size: distances to what hides the walls, and when it was seen last, as above. [m] in world
  double obstacle[2][2];
  // See above; 0 for never. [ns]
  uint64_t obstacle_ns[2][2];
  // The last sample's acceleration. [m/s^2] in world
  HbVector3 acceleration;
  // The axes of the world; the ground is behind the third.
  HbRangeInertialAxis axes[3];
  // Gains of the velocity.
  HbRangeInertialGains gains;
  // The last samples, sample k at the place k modulo the number of places.
  HbRangeInertialPast past[128];
} HbRangeInertialState;

static const HbField HB_RANGE_INERTIAL_STATE_FIELDS[] = {
  { "samples", "Samples so far.", "", "", offsetof(HbRangeInertialState, samples), HB_U64, NULL, 0, 0, 0 },
  { "measured_ns", "When the newest ranges were measured; the largest number before the first.", "ns", "", offsetof(HbRangeInertialState, measured_ns), HB_U64, NULL, 0, 0, 0 },
  { "gps_measured_ns", "When the newest velocity of a receiver was measured; the largest number before the first.", "ns", "", offsetof(HbRangeInertialState, gps_measured_ns), HB_U64, NULL, 0, 0, 0 },
  { "echo_ns", "When the last echo came from ahead and from behind along x, and along y.", "ns", "", offsetof(HbRangeInertialState, echo_ns), HB_U64, NULL, 2, 2, 0 },
  { "obstacle", "In a room of known size: distances to what hides the walls, and when it was seen last, as above.", "m", "world", offsetof(HbRangeInertialState, obstacle), HB_F64, NULL, 2, 2, 0 },
  { "obstacle_ns", "See above; 0 for never.", "ns", "", offsetof(HbRangeInertialState, obstacle_ns), HB_U64, NULL, 2, 2, 0 },
  { "acceleration", "The last sample's acceleration.", "m/s^2", "world", offsetof(HbRangeInertialState, acceleration), HB_NESTED, &HB_VECTOR3, 0, 0, 0 },
  { "axes", "The axes of the world; the ground is behind the third.", "", "", offsetof(HbRangeInertialState, axes), HB_NESTED, &HB_RANGE_INERTIAL_AXIS, 3, 0, 0 },
  { "gains", "Gains of the velocity.", "", "", offsetof(HbRangeInertialState, gains), HB_NESTED, &HB_RANGE_INERTIAL_GAINS, 0, 0, 0 },
  { "past", "The last samples, sample k at the place k modulo the number of places.", "", "", offsetof(HbRangeInertialState, past), HB_NESTED, &HB_RANGE_INERTIAL_PAST, 128, 0, 0 },
};

static const HbMessage HB_RANGE_INERTIAL_STATE = { "hummingbus_msgs/msg/RangeInertialState", "State of the estimator, as it is handed over.", sizeof(HbRangeInertialState), HB_RANGE_INERTIAL_STATE_FIELDS, 10 };

// State of the remote control.
typedef struct HbRemoteControlState {
  // Throttle that the integral has added to that of hover. [1]
  double throttle;
} HbRemoteControlState;

static const HbField HB_REMOTE_CONTROL_STATE_FIELDS[] = {
  { "throttle", "Throttle that the integral has added to that of hover.", "1", "", offsetof(HbRemoteControlState, throttle), HB_F64, NULL, 0, 0, 0 },
};

static const HbMessage HB_REMOTE_CONTROL_STATE = { "hummingbus_msgs/msg/RemoteControlState", "State of the remote control.", sizeof(HbRemoteControlState), HB_REMOTE_CONTROL_STATE_FIELDS, 1 };

#endif // HUMMINGBUS_MESSAGES_H
