//! Standard ROS 2 messages of a vehicle and its sensors, byte-identical to those of ROS 2. Their frames have names of any
//! length.

use super::{FRAME_BYTES_MAX, FrameName, MapFrame, Orientation, PerRotor, Point, Time, Vector3};
use crate::Message;
use crate::schema::{FieldType, Kind, NAME_START, Numbers, Primitive};
use std::f32::consts::{FRAC_PI_2, PI};
use std::mem::offset_of;

/// Room for a frame's name. It ends at a multiple of 8 bytes, as names begin 4 bytes behind one.
const NAME_ROOM: usize = FRAME_BYTES_MAX + NAME_START;
/// A quaternion, two vectors, and the covariance of each.
const IMU_NUMBERS: Numbers = Numbers::doubles(4 + 9 + 3 + 9 + 3 + 9);
/// A pose and a twist, and the covariance of each.
const ODOMETRY_NUMBERS: Numbers = Numbers::doubles(7 + 36 + 6 + 36);
/// The type of radiation, then five singles.
const RANGE_NUMBERS: Numbers = Numbers { leading_bytes: 1, primitive: Primitive::F32, count: 5 };

/// Seven singles, the count of the ranges, the ranges, and the count of the intensities: all of 4 bytes.
const SCAN_NUMBERS: Numbers =
    Numbers { leading_bytes: 0, primitive: Primitive::F32, count: 7 + 1 + LaserScan::RAYS + 1 };

/// Declares a string and the numbers behind it, laid out as CDR writes them.
macro_rules! named_numbers {
    ($Name:ident, $numbers:ident) => {
        /// A string and the numbers behind it.
        #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
        #[repr(C)]
        struct $Name {
            /// Bytes of the name, its NUL included.
            length: u32,
            /// The name, the numbers, and zeros.
            bytes: [u8; NAME_ROOM + $numbers.room()],
        }

        impl FieldType for $Name {
            const KIND: Kind = Kind::NamedNumbers(NAME_ROOM, $numbers);
        }

        impl $Name {
            /// The name `frame`, right behind it `leading`, then `numbers`.
            fn new<T: bytemuck::Pod>(frame: &FrameName, leading: &[u8], numbers: &[T]) -> Self {
                let mut bytes = [0; NAME_ROOM + $numbers.room()];
                let length = place(&mut bytes, frame, leading, numbers) as u32;
                Self { length, bytes }
            }

            /// The numbers.
            fn numbers<T: bytemuck::Pod, const N: usize>(&self) -> [T; N] {
                let behind = (self.length as usize).min(NAME_ROOM) + $numbers.leading_bytes;
                let numbers = &self.bytes[start::<T>(behind)..][..N * size_of::<T>()];
                bytemuck::pod_read_unaligned(numbers)
            }
        }
    };
}
named_numbers!(NamedReading, IMU_NUMBERS);
named_numbers!(NamedMotion, ODOMETRY_NUMBERS);
named_numbers!(NamedBeam, RANGE_NUMBERS);
named_numbers!(NamedScan, SCAN_NUMBERS);

/// Place of the first number behind `behind` bytes of a name and what follows it, counted from the start of the name.
fn start<T>(behind: usize) -> usize {
    (NAME_START + behind).next_multiple_of(size_of::<T>()) - NAME_START
}

/// Writes a name, `leading` and `numbers` to `bytes`; returns the bytes of the name, its NUL included.
fn place<T: bytemuck::Pod>(bytes: &mut [u8], frame: &FrameName, leading: &[u8], numbers: &[T]) -> usize {
    let name = frame.as_str().as_bytes();
    let length = name.len() + 1;
    bytes[..name.len()].copy_from_slice(name);
    bytes[length..][..leading.len()].copy_from_slice(leading);
    let numbers: &[u8] = bytemuck::cast_slice(numbers);
    bytes[start::<T>(length + leading.len())..][..numbers.len()].copy_from_slice(numbers);
    length
}

const _: () = assert!(
    offset_of!(StandardImu, reading).is_multiple_of(8)
        && offset_of!(Odometry, motion).is_multiple_of(8)
        && offset_of!(StandardRange, beam).is_multiple_of(8)
        && offset_of!(LaserScan, scan).is_multiple_of(8)
        && (NAME_START + NAME_ROOM).is_multiple_of(8)
);

/// Reading of an inertial measurement unit, byte-identical to a ROS 2 `sensor_msgs/msg/Imu` without an orientation.
///
/// ```
/// use component::messages::{FrameName, StandardImu, Vector3};
///
/// let rest = Vector3 { z: 9.81, ..Vector3::default() };
/// let imu = StandardImu::new(&FrameName::new("h1/body").unwrap(), Vector3::default(), 0.0, rest, 4e-3);
/// assert_eq!(imu.numbers()[4], -1.0, "the orientation is not measured");
/// assert_eq!(imu.numbers()[25..29], [0.0, 0.0, 9.81, 4e-3]);
/// ```
#[derive(Clone, Copy, Debug, Message)]
#[repr(C)]
#[message(
    type_name = "sensor_msgs/msg/Imu",
    definition = "\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance  # [rad^2]
geometry_msgs/Vector3 angular_velocity  # [rad/s]
float64[9] angular_velocity_covariance  # [rad^2/s^2]
geometry_msgs/Vector3 linear_acceleration  # [m/s^2]
float64[9] linear_acceleration_covariance  # [m^2/s^4]
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Quaternion
float64 x  # [1]
float64 y  # [1]
float64 z  # [1]
float64 w  # [1]
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"
)]
pub struct StandardImu {
    /// Simulation time.
    pub stamp: Time,
    /// Frame of the body, then orientation, angular velocity and specific force, with covariances.
    #[field(unit = "1", frame = "body")]
    reading: NamedReading,
}

impl StandardImu {
    /// The reading of a part in the axes of `frame`: angular velocity (rad/s) and specific force (m/s²), each with the variance of
    /// each of its axes. A variance of 0 is an unknown one.
    #[must_use]
    pub fn new(
        frame: &FrameName,
        angular_velocity: Vector3,
        angular_velocity_variance: f64,
        specific_force: Vector3,
        specific_force_variance: f64,
    ) -> Self {
        let mut numbers = [0.0; IMU_NUMBERS.count];
        let rest = put(&mut numbers, &[0.0, 0.0, 0.0, 1.0]);
        // The definition of the message: no orientation.
        let rest = put(rest, &diagonal([-1.0, 0.0, 0.0]));
        let rest = put(rest, &<[f64; 3]>::from(angular_velocity));
        let rest = put(rest, &diagonal([angular_velocity_variance; 3]));
        let rest = put(rest, &<[f64; 3]>::from(specific_force));
        put(rest, &diagonal([specific_force_variance; 3]));
        Self { stamp: Time::default(), reading: NamedReading::new(frame, &[], &numbers) }
    }

    /// Its numbers, in the order of the definition.
    #[must_use]
    pub fn numbers(&self) -> [f64; IMU_NUMBERS.count] {
        self.reading.numbers()
    }
}

/// Writes `numbers` at the start of `to`; returns the rest.
fn put<'a>(to: &'a mut [f64], numbers: &[f64]) -> &'a mut [f64] {
    let (start, rest) = to.split_at_mut(numbers.len());
    start.copy_from_slice(numbers);
    rest
}

/// The matrix of three rows with these numbers on its diagonal, row by row.
fn diagonal([x, y, z]: [f64; 3]) -> [f64; 9] {
    [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]
}

/// Pose in the world and velocity in the frame of a body, byte-identical to a ROS 2 `nav_msgs/msg/Odometry` of unknown covariance.
///
/// ```
/// use component::messages::{FrameName, Odometry, Orientation, Point, Vector3};
///
/// let (point, level) = (Point { x: 1.0, y: 2.0, z: 3.0 }, Orientation { x: 0.0, y: 0.0, z: 0.0, w: 1.0 });
/// let ahead = Vector3 { x: 5.0, ..Vector3::default() };
/// let odometry = Odometry::new(&FrameName::new("h1/body").unwrap(), point, level, ahead, Vector3::default());
/// assert_eq!(odometry.numbers()[..7], [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]);
/// assert_eq!(odometry.numbers()[43], 5.0);
/// ```
#[derive(Clone, Copy, Debug, Message)]
#[repr(C)]
#[message(
    type_name = "nav_msgs/msg/Odometry",
    definition = "\
std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position  # [m]
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x  # [1]
float64 y  # [1]
float64 z  # [1]
float64 w  # [1]
================================================================================
MSG: geometry_msgs/TwistWithCovariance
geometry_msgs/Twist twist
float64[36] covariance
================================================================================
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear  # [m/s]
geometry_msgs/Vector3 angular  # [rad/s]
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"
)]
pub struct Odometry {
    /// Simulation time.
    pub stamp: Time,
    /// Frame of the pose, `map`.
    frame_id: MapFrame,
    /// Frame of the body, its pose in the world and its twist in its own axes, with covariances.
    #[field(unit = "1")]
    motion: NamedMotion,
}

impl Odometry {
    /// Numbers of a covariance of six.
    const COVARIANCE: [f64; 36] = [0.0; 36];

    /// The frame `child` at `position` (m) in the world, turned by `orientation` (child to world). Velocity
    /// (m/s) and angular velocity (rad/s) are in the axes of `child`.
    #[must_use]
    pub fn new(
        child: &FrameName,
        position: Point,
        orientation: Orientation,
        velocity: Vector3,
        angular_velocity: Vector3,
    ) -> Self {
        let Orientation { x, y, z, w } = orientation;
        let mut numbers = [0.0; ODOMETRY_NUMBERS.count];
        let rest = put(&mut numbers, &[position.x, position.y, position.z, x, y, z, w]);
        let rest = put(rest, &Self::COVARIANCE);
        let rest = put(rest, &<[f64; 3]>::from(velocity));
        let rest = put(rest, &<[f64; 3]>::from(angular_velocity));
        put(rest, &Self::COVARIANCE);
        let motion = NamedMotion::new(child, &[], &numbers);
        Self { stamp: Time::default(), frame_id: MapFrame::default(), motion }
    }

    /// Its numbers, in the order of the definition.
    #[must_use]
    pub fn numbers(&self) -> [f64; ODOMETRY_NUMBERS.count] {
        self.motion.numbers()
    }
}

/// Reading of one range finder, byte-identical to a ROS 2 `sensor_msgs/msg/Range`. Releases before Iron have no `variance`; their
/// readers ignore it.
///
/// ```
/// use component::messages::{FrameName, StandardRange};
///
/// let down = FrameName::new("range/down").unwrap();
/// let range = StandardRange::new(&down, StandardRange::ULTRASOUND, [0.17, 0.2, 7.65, 1.5, 1e-4]);
/// assert_eq!(range.numbers()[3], 1.5);
/// ```
#[derive(Clone, Copy, Debug, Message)]
#[repr(C)]
#[message(
    type_name = "sensor_msgs/msg/Range",
    definition = "\
std_msgs/Header header
uint8 ULTRASOUND=0
uint8 INFRARED=1
uint8 radiation_type
float32 field_of_view  # [rad]
float32 min_range  # [m]
float32 max_range  # [m]
float32 range  # [m]
float32 variance  # [m^2]
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"
)]
pub struct StandardRange {
    /// Simulation time.
    pub stamp: Time,
    /// Frame of the beam, type of radiation, field of view, nearest and farthest range, range, variance.
    #[field(unit = "1")]
    beam: NamedBeam,
}

impl StandardRange {
    /// Type of radiation of a range finder by sound.
    pub const ULTRASOUND: u8 = 0;

    /// The reading of a beam along the x axis of `frame`: field of view (rad), nearest range, farthest range and range (m), variance (m²).
    /// A variance of 0 is an unknown one. Readers discard a range outside of nearest and farthest.
    #[must_use]
    pub fn new(frame: &FrameName, radiation_type: u8, numbers: [f32; RANGE_NUMBERS.count]) -> Self {
        Self { stamp: Time::default(), beam: NamedBeam::new(frame, &[radiation_type], &numbers) }
    }

    /// Its singles, in the order of the definition.
    #[must_use]
    pub fn numbers(&self) -> [f32; RANGE_NUMBERS.count] {
        self.beam.numbers()
    }
}

/// Readings of four rays in a plane, byte-identical to a ROS 2 `sensor_msgs/msg/LaserScan` without intensities.
///
/// ```
/// use component::messages::{FrameName, LaserScan};
///
/// let scan = LaserScan::new(&FrameName::new("h1/body").unwrap(), 0.1, [0.2, 7.65], [7.0, 4.0, 3.0, 6.0]);
/// assert_eq!(scan.ranges(), [7.0, 4.0, 3.0, 6.0]);
/// ```
#[derive(Clone, Copy, Debug, Message)]
#[repr(C)]
#[message(
    type_name = "sensor_msgs/msg/LaserScan",
    definition = "\
std_msgs/Header header
float32 angle_min  # [rad]
float32 angle_max  # [rad]
float32 angle_increment  # [rad]
float32 time_increment  # [s]
float32 scan_time  # [s]
float32 range_min  # [m]
float32 range_max  # [m]
float32[] ranges  # [m]
float32[] intensities
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"
)]
pub struct LaserScan {
    /// Simulation time.
    pub stamp: Time,
    /// Frame of the scan, its angles, times and bounds, the ranges with their count, the count of no intensities.
    #[field(unit = "1")]
    scan: NamedScan,
}

impl LaserScan {
    /// Number of rays, a quarter of a turn apart.
    pub const RAYS: usize = 4;
    /// Angles of the first and of the last ray about the z axis of the frame, and between two rays.
    const ANGLES_RAD: [f32; 3] = [-FRAC_PI_2, PI, FRAC_PI_2];

    /// The readings `ranges_m` of rays along −y, +x, +y and −x of `frame`, which are measured together each `scan_time_s`. Readers
    /// discard ranges outside of `bounds_m`.
    #[must_use]
    pub fn new(frame: &FrameName, scan_time_s: f32, bounds_m: [f32; 2], ranges_m: [f32; Self::RAYS]) -> Self {
        // As words: the counts are integers.
        let mut words = [0; SCAN_NUMBERS.count];
        let (singles, rest) = words.split_at_mut(7);
        let (count, rest) = rest.split_at_mut(1);
        let numbers = Self::ANGLES_RAD.into_iter().chain([0.0, scan_time_s]).chain(bounds_m);
        singles.iter_mut().zip(numbers).for_each(|(word, number)| *word = number.to_bits());
        count[0] = Self::RAYS as u32;
        rest.iter_mut().zip(ranges_m).for_each(|(word, range)| *word = range.to_bits());
        Self { stamp: Time::default(), scan: NamedScan::new(frame, &[], &words) }
    }

    /// Its ranges, in m.
    #[must_use]
    pub fn ranges(&self) -> [f32; Self::RAYS] {
        let words: [u32; SCAN_NUMBERS.count] = self.scan.numbers();
        std::array::from_fn(|ray| f32::from_bits(words[8 + ray]))
    }
}

/// The empty string, laid out as CDR writes it in front of a number of 4 bytes.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct NoFrame {
    length: u32,
    text: [u8; 4],
}

impl FieldType for NoFrame {
    const KIND: Kind = Kind::Text;
}

/// Commands of the motors, byte-identical to a ROS 2 `actuator_msgs/msg/Actuators` without positions and velocities.
///
/// ```
/// use component::messages::{Actuators, PerRotor};
///
/// let hover = Actuators::new(PerRotor::filled(4, 0.38));
/// assert_eq!(hover.normalized, [0.38; 4]);
/// ```
#[derive(Clone, Copy, Debug, Message)]
#[repr(C)]
#[message(
    type_name = "actuator_msgs/msg/Actuators",
    definition = "\
std_msgs/Header header
float64[] position  # [rad]
float64[] velocity  # [rad/s]
float64[] normalized  # [1]
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"
)]
pub struct Actuators {
    /// Simulation time.
    pub stamp: Time,
    /// No frame: an empty name.
    frame_id: NoFrame,
    /// Number of positions: none.
    positions: u32,
    /// Number of velocities: none.
    velocities: u32,
    /// Command of each motor, from 0 to 1.
    #[field(unit = "1")]
    pub normalized: PerRotor,
}

impl Actuators {
    /// The commands of motors, each from 0 to 1.
    #[must_use]
    pub fn new(normalized: PerRotor) -> Self {
        let frame_id = NoFrame { length: 1, text: [0; 4] };
        Self { stamp: Time::default(), frame_id, positions: 0, velocities: 0, normalized }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schema::Schema;

    /// The start of the body that `rclpy` writes, made here: the stamp, then each of the names.
    fn stamped(names: &[&str]) -> Vec<u8> {
        let mut bytes = vec![0; 8];
        for name in names {
            bytes.resize(bytes.len().next_multiple_of(4), 0);
            bytes.extend((name.len() as u32 + 1).to_le_bytes());
            bytes.extend(name.as_bytes());
            bytes.push(0);
        }
        bytes
    }

    fn doubles(mut bytes: Vec<u8>, numbers: &[f64]) -> Vec<u8> {
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        bytes
    }

    #[track_caller]
    fn require(schema: &Schema, bytes: &[u8], cdr: &[u8]) {
        let extent = schema.extent().unwrap();
        assert_eq!(extent.of(bytes), cdr, "{}", schema.type_name);
        assert_eq!(extent.wrong_count(bytes), None);
        assert_eq!(bytes.len(), schema.size);
    }

    /// Frames with names of every length.
    fn frames() -> impl Iterator<Item = (String, FrameName)> {
        (1..FRAME_BYTES_MAX).map(|length| {
            let name = "n".repeat(length);
            let frame = FrameName::new(&name).unwrap();
            (name, frame)
        })
    }

    const TURN: [f64; 3] = [0.1, -0.2, 0.3];
    const FORCE: [f64; 3] = [1.0, 2.0, 9.81];

    #[test]
    fn an_imu_has_the_bytes_of_its_cdr_for_names_of_every_length() {
        let (diagonal_turn, diagonal_force) = (diagonal([4e-6; 3]), diagonal([5e-3; 3]));
        let unknown = [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let level = [0.0, 0.0, 0.0, 1.0];
        let numbers = [&level[..], &unknown, &TURN, &diagonal_turn, &FORCE, &diagonal_force].concat();
        for (name, frame) in frames() {
            let imu = StandardImu::new(&frame, TURN.into(), 4e-6, FORCE.into(), 5e-3);
            require(StandardImu::SCHEMA, bytemuck::bytes_of(&imu), &doubles(stamped(&[&name]), &numbers));
            assert_eq!(imu.numbers()[..], numbers);
        }
    }

    #[test]
    fn odometry_has_the_bytes_of_its_cdr_for_names_of_every_length() {
        let pose = [1.0, -2.0, 3.5, 0.1, 0.2, 0.3, 0.9];
        let numbers = [&pose[..], &[0.0; 36], &FORCE, &TURN, &[0.0; 36]].concat();
        let position = Point { x: 1.0, y: -2.0, z: 3.5 };
        let orientation = Orientation { x: 0.1, y: 0.2, z: 0.3, w: 0.9 };
        for (name, frame) in frames() {
            let odometry = Odometry::new(&frame, position, orientation, FORCE.into(), TURN.into());
            let cdr = doubles(stamped(&["map", &name]), &numbers);
            require(Odometry::SCHEMA, bytemuck::bytes_of(&odometry), &cdr);
            assert_eq!(odometry.numbers()[..], numbers);
        }
    }

    #[test]
    fn a_range_has_the_bytes_of_its_cdr_for_names_of_every_length() {
        let numbers = [0.17, 0.2, 7.65, 1.5, 1e-4_f32];
        for (name, frame) in frames() {
            let range = StandardRange::new(&frame, 1, numbers);
            let mut cdr = stamped(&[&name]);
            cdr.push(1);
            cdr.resize(cdr.len().next_multiple_of(4), 0);
            cdr.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
            require(StandardRange::SCHEMA, bytemuck::bytes_of(&range), &cdr);
            assert_eq!(range.numbers(), numbers);
        }
    }

    #[test]
    fn a_scan_has_the_bytes_of_its_cdr_for_names_of_every_length() {
        let ranges = [7.0, 4.0, 3.0, 15.3_f32];
        let numbers = [-FRAC_PI_2, PI, FRAC_PI_2, 0.0, 0.1, 0.2, 7.65];
        for (name, frame) in frames() {
            let scan = LaserScan::new(&frame, 0.1, [0.2, 7.65], ranges);
            let mut cdr = stamped(&[&name]);
            cdr.resize(cdr.len().next_multiple_of(4), 0);
            cdr.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
            cdr.extend(4_u32.to_le_bytes());
            cdr.extend(ranges.iter().flat_map(|range| range.to_le_bytes()));
            // No intensities.
            cdr.extend([0; 4]);
            require(LaserScan::SCHEMA, bytemuck::bytes_of(&scan), &cdr);
            assert_eq!(scan.ranges(), ranges);
        }
    }

    #[test]
    fn actuators_have_the_bytes_of_their_cdr_for_every_number_of_motors() {
        for count in 0..=crate::messages::ROTORS_MAX {
            let numbers: Vec<f64> = (0..count).map(|motor| 0.05 * motor as f64).collect();
            let mut cdr = stamped(&[""]);
            cdr.resize(cdr.len().next_multiple_of(4), 0);
            // No position, no velocity, then the commands.
            cdr.extend([0, 0, count as u32].into_iter().flat_map(u32::to_le_bytes));
            let cdr = if count == 0 { cdr } else { doubles(cdr, &numbers) };
            let actuators = Actuators::new(numbers.into_iter().collect());
            require(Actuators::SCHEMA, bytemuck::bytes_of(&actuators), &cdr);
        }
    }

    /// Sizes of the bodies of real messages.
    #[test]
    fn standard_messages_end_with_their_last_number() {
        let frame = FrameName::new("imu").unwrap();
        let imu = StandardImu::new(&frame, TURN.into(), 0.0, FORCE.into(), 0.0);
        assert_eq!(StandardImu::SCHEMA.extent().unwrap().of(bytemuck::bytes_of(&imu)).len(), 312);
        assert!(StandardRange::SCHEMA.layout().contains("string[<=68] uint8[1] float32[5] beam"));
    }
}
