//! Content of descriptions of robots in any format: links with mass, joints between them, motors.

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use std::ops::Range;

use super::xml::Source;

/// A robot, as its file describes it.
pub struct Model<'a> {
    /// The file.
    pub source: Source<'a>,
    /// Name of the robot.
    pub name: String,
    /// Links, in the order of the file.
    pub links: Vec<Link>,
    /// Joints, in the order of the file.
    pub joints: Vec<Joint>,
    /// Motors of the simulator's plugins, in the order of the file.
    pub motors: Vec<Motor>,
    /// Properties of the file that the model cannot hold, in words.
    pub notes: Vec<String>,
}

/// A rigid part.
pub struct Link {
    /// Name, of which there is one.
    pub name: String,
    /// Pose in the model's frame: x forward, y left, z up.
    pub pose: Isometry3<f64>,
    /// Mass and its distribution; none for a mere frame.
    pub inertial: Option<Inertial>,
    /// Place in the file.
    pub at: Range<usize>,
}

/// Mass and its distribution.
pub struct Inertial {
    /// Mass.
    pub mass_kg: f64,
    /// Centre of mass and axes of the tensor, in the link's frame.
    pub pose: Isometry3<f64>,
    /// Tensor about the centre of mass, in the axes of `pose`.
    pub tensor_kg_m2: Matrix3<f64>,
    /// Place in the file.
    pub at: Range<usize>,
}

/// Freedom of a joint.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Freedom {
    /// None: a fixed joint, or one whose limits are both 0.
    Fixed,
    /// Turns about its axis.
    Turns,
    /// Another one.
    Other,
}

/// A joint.
pub struct Joint {
    /// Name.
    pub name: String,
    /// Link that carries the other.
    pub parent: String,
    /// Link that is carried.
    pub child: String,
    /// Freedom.
    pub freedom: Freedom,
    /// Place of the joint in the model's frame.
    pub point: Point3<f64>,
    /// Axis in the model's frame.
    pub axis: Vector3<f64>,
    /// Place in the file.
    pub at: Range<usize>,
}

/// Numbers of a plugin of Gazebo about a rotor; SI.
pub struct Motor {
    /// Joint of the rotor.
    pub joint: Option<String>,
    /// Link of the rotor.
    pub link: Option<String>,
    /// +1 for counter-clockwise seen from above.
    pub spin: Option<f64>,
    /// Thrust by speed squared.
    pub thrust_coefficient: Option<f64>,
    /// Torque by thrust.
    pub moment_m: Option<f64>,
    /// Largest speed.
    pub speed_max_rad_s: Option<f64>,
    /// Lag of a rotor that becomes faster.
    pub lag_up_s: Option<f64>,
    /// Lag of a rotor that becomes slower.
    pub lag_down_s: Option<f64>,
    /// Ratio of the speed of the rotor to that of its joint in the simulator.
    pub slowdown: Option<f64>,
    /// Index of its command.
    pub number: Option<f64>,
    /// Place in the file.
    pub at: Range<usize>,
}

/// Ratio of the speed of a rotor to that of its joint that the plugins take if the model has none.
pub const SLOWDOWN_DEFAULT: f64 = 10.0;

impl Motor {
    /// Ratio of the speed of the rotor to that of its joint in the simulator.
    pub fn slowdown(&self) -> f64 {
        self.slowdown.unwrap_or(SLOWDOWN_DEFAULT)
    }
}

/// The pose of a place, and of angles about the fixed axes x, y, z, in this order (rad).
pub fn pose(xyz: [f64; 3], rpy: [f64; 3]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
    Isometry3::from_parts(Translation3::from(Vector3::from(xyz)), turn)
}

/// The symmetric tensor with these entries: xx, xy, xz, yy, yz, zz.
pub fn tensor([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}
