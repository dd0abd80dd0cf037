//! The transform of a vehicle's body, whose frame has the vehicle's name.

use super::{MapFrame, Orientation, Point, Time};
use crate::Message;
use crate::schema::{FieldType, Kind, Numbers};

/// The most bytes of a frame's name, the NUL behind it included.
pub const FRAME_BYTES_MAX: usize = 64;
/// Numbers of a pose: a point and a quaternion.
const POSE_NUMBERS: usize = 7;
const POSE_BYTES: usize = POSE_NUMBERS * size_of::<f64>();

/// Name of a frame: 1 to 63 bytes of printable ASCII.
///
/// ```
/// use component::messages::FrameName;
///
/// let frame = FrameName::new("h1/body").unwrap();
/// assert_eq!(frame.as_str(), "h1/body");
/// assert!(FrameName::new("").is_none() && FrameName::new(&"long".repeat(16)).is_none());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameName {
    /// Bytes of the name, without a NUL.
    length: usize,
    bytes: [u8; FRAME_BYTES_MAX],
}

impl FrameName {
    /// The frame `name`; `None` if it is empty, too long, or has other characters than printable ASCII.
    #[must_use]
    pub fn new(name: &str) -> Option<Self> {
        let is_fine = !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_graphic());
        let mut bytes = [0; FRAME_BYTES_MAX];
        let (text, _nul) = bytes.split_last_chunk_mut::<1>().filter(|_| is_fine)?;
        text.get_mut(..name.len())?.copy_from_slice(name.as_bytes());
        Some(Self { length: name.len(), bytes })
    }

    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        std::str::from_utf8(&self.bytes[..self.length]).unwrap_or_default()
    }
}

/// Frame of the body of a vehicle, as plants publish it: `NAME/body`; of a vehicle without a name `hb_body`.
///
/// ```
/// use component::messages::body_frame;
///
/// assert_eq!((&*body_frame("h1"), &*body_frame("")), ("h1/body", "hb_body"));
/// ```
#[must_use]
pub fn body_frame(vehicle: &str) -> String {
    if vehicle.is_empty() { "hb_body".to_owned() } else { format!("{vehicle}/body") }
}

/// One transform from `map` to the frame of a vehicle's body, byte-identical to a ROS 2 `TFMessage` with one element.
///
/// ```
/// use component::messages::{BodyTransform, FrameName, Orientation, Point};
///
/// let (point, level) = (Point { x: 1.0, y: 2.0, z: 3.0 }, Orientation { x: 0.0, y: 0.0, z: 0.0, w: 1.0 });
/// let transform = BodyTransform::new(&FrameName::new("h1/body").unwrap(), point, level);
/// assert_eq!(transform.pose(), [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]);
/// ```
#[derive(Clone, Copy, Debug, Message)]
#[repr(C)]
#[message(
    type_name = "tf2_msgs/msg/TFMessage",
    definition = "\
geometry_msgs/TransformStamped[] transforms
================================================================================
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation  # [m]
geometry_msgs/Quaternion rotation
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x  # [1]
float64 y  # [1]
float64 z  # [1]
float64 w  # [1]
"
)]
pub struct BodyTransform {
    /// Number of transforms: one.
    count: u32,
    /// Simulation time.
    pub stamp: Time,
    /// Parent frame, `map`.
    frame_id: MapFrame,
    /// Child frame, and the transform from the parent.
    #[field(unit = "m", frame = "world")]
    child: NamedPose,
}

/// A string and seven numbers, laid out as CDR writes them: the numbers begin behind the string, at a multiple of 8 bytes.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct NamedPose {
    /// Bytes of the name, its NUL included.
    length: u32,
    /// The name, the numbers, and zeros.
    bytes: [u8; FRAME_BYTES_MAX + POSE_BYTES],
}

impl FieldType for NamedPose {
    const KIND: Kind = Kind::NamedNumbers(FRAME_BYTES_MAX, Numbers::doubles(POSE_NUMBERS));
}

/// Offset in a message at which `NamedPose::bytes` begin: a multiple of 8, as CDR aligns numbers from the message's start.
const NAME_OFFSET: usize = std::mem::offset_of!(BodyTransform, child) + size_of::<u32>();
const _: () = assert!(NAME_OFFSET.is_multiple_of(8) && FRAME_BYTES_MAX.is_multiple_of(8));

impl BodyTransform {
    /// The transform of the frame `child` at `translation` in the world, turned by `rotation` (child to world).
    #[must_use]
    pub fn new(child: &FrameName, translation: Point, rotation: Orientation) -> Self {
        let length = child.length + 1;
        let mut bytes = [0; FRAME_BYTES_MAX + POSE_BYTES];
        bytes[..FRAME_BYTES_MAX].copy_from_slice(&child.bytes);
        let pose = &mut bytes[length.next_multiple_of(8)..][..POSE_BYTES];
        let (to_translation, to_rotation) = pose.split_at_mut(size_of::<Point>());
        to_translation.copy_from_slice(bytemuck::bytes_of(&translation));
        to_rotation.copy_from_slice(bytemuck::bytes_of(&rotation));
        let child = NamedPose { length: length as u32, bytes };
        Self { count: 1, stamp: Time::default(), frame_id: MapFrame::default(), child }
    }

    /// Position (m) and attitude (x, y, z, w; child to world) in the world.
    #[must_use]
    pub fn pose(&self) -> [f64; POSE_NUMBERS] {
        let start = (self.child.length as usize).min(FRAME_BYTES_MAX).next_multiple_of(8);
        bytemuck::pod_read_unaligned(&self.child.bytes[start..][..POSE_BYTES])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The body of the message that `rclpy` writes for one transform, made here number by number.
    fn cdr(name: &str, pose: [f64; 7]) -> Vec<u8> {
        let mut bytes = [1_u32, 0, 0, 4].map(u32::to_le_bytes).concat();
        bytes.extend(b"map\0");
        bytes.extend((name.len() as u32 + 1).to_le_bytes());
        bytes.extend(name.as_bytes());
        bytes.push(0);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes.extend(pose.map(f64::to_le_bytes).concat());
        bytes
    }

    #[test]
    fn a_transform_has_the_bytes_of_its_cdr_for_names_of_every_length() {
        let extent = BodyTransform::SCHEMA.extent().unwrap();
        for length in 1..FRAME_BYTES_MAX {
            let name = "n".repeat(length);
            let (translation, rotation) =
                (Point { x: 1.0, y: -2.0, z: 3.5 }, Orientation { x: 0.1, y: 0.2, z: 0.3, w: 0.9 });
            let pose = [1.0, -2.0, 3.5, 0.1, 0.2, 0.3, 0.9];
            let transform = BodyTransform::new(&FrameName::new(&name).unwrap(), translation, rotation);
            assert_eq!(transform.pose(), pose);
            let bytes = bytemuck::bytes_of(&transform);
            assert_eq!(extent.of(bytes), cdr(&name, pose), "{length}");
            assert_eq!(extent.wrong_count(bytes), None);
        }
    }

    #[test]
    fn names_that_no_frame_has_are_refused() {
        for name in ["", "two words", "line\n", "ö", &"n".repeat(FRAME_BYTES_MAX)] {
            assert_eq!(FrameName::new(name), None, "{name:?}");
        }
    }
}
