//! A planned path, as tools of ROS 2 draw it.

use super::{Header, MapFrame, Pose, PoseStamped, Time};
use crate::Message;
use crate::schema::{FieldType, Kind};
use std::mem::offset_of;

/// Bytes that align the first pose: it stands 4 bytes behind a multiple of 8.
const FIRST_PAD: usize = 4;
const POSES_BYTES: usize = FIRST_PAD + PlannedPath::POSES_MAX * size_of::<PoseStamped>();

/// Poses that lie ahead, each with its time; byte-identical to a ROS 2 `nav_msgs/msg/Path` in the frame `map`.
///
/// ```
/// use component::messages::{PlannedPath, Point, Pose, Time};
///
/// let pose = |x| Pose { position: Point { x, y: 0.0, z: 1.0 }, ..Pose::default() };
/// let path = PlannedPath::new([(Time::from_ns(0), pose(0.0)), (Time::from_ns(100_000_000), pose(0.2))]);
/// assert_eq!(path.poses().map(|(_, pose)| pose.position.x).collect::<Vec<_>>(), [0.0, 0.2]);
/// ```
#[derive(Clone, Copy, Debug, Message)]
#[repr(C)]
#[message(
    type_name = "nav_msgs/msg/Path",
    definition = "\
std_msgs/Header header
geometry_msgs/PoseStamped[] poses
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/PoseStamped
std_msgs/Header header
geometry_msgs/Pose pose
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
"
)]
pub struct PlannedPath {
    /// Simulation time.
    pub stamp: Time,
    /// Frame of the path, `map`.
    frame_id: MapFrame,
    /// Poses, each with its time.
    #[field(unit = "m", frame = "world")]
    poses: Poses,
}

/// Poses as CDR writes them: numbers begin at a multiple of 8 bytes, so that the first pose has its padding in its middle.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Poses {
    count: u32,
    bytes: [u8; POSES_BYTES],
}

/// A [`Bounded`](crate::Bounded) has the same size, count and numbers; only the header of its first pose is elsewhere, and no
/// program reads a message with text by its fields.
impl FieldType for Poses {
    const KIND: Kind = Kind::Sequence(&<PoseStamped as FieldType>::KIND, PlannedPath::POSES_MAX);
}

const _: () = assert!(
    (offset_of!(PlannedPath, poses) + offset_of!(Poses, bytes) + pose_place(0)).is_multiple_of(8)
        && size_of::<PoseStamped>().is_multiple_of(8)
        && size_of::<Poses>() == Poses::KIND.size()
);

/// Place of the header of pose `index` in [`Poses::bytes`].
const fn header_place(index: usize) -> usize {
    if index == 0 { 0 } else { FIRST_PAD + index * size_of::<PoseStamped>() }
}

/// Place of the numbers of pose `index` in [`Poses::bytes`].
const fn pose_place(index: usize) -> usize {
    FIRST_PAD + index * size_of::<PoseStamped>() + size_of::<Header>()
}

impl PlannedPath {
    /// The most poses. The parser of PlotJuggler leaves longer arrays out by default.
    pub const POSES_MAX: usize = 100;

    /// The path of the first [`POSES_MAX`](Self::POSES_MAX) of `poses`: times, and poses in the world.
    #[must_use]
    pub fn new(poses: impl IntoIterator<Item = (Time, Pose)>) -> Self {
        let (mut count, mut bytes) = (0, [0; POSES_BYTES]);
        for (index, (stamp, pose)) in poses.into_iter().take(Self::POSES_MAX).enumerate() {
            let header = Header { stamp, frame_id: MapFrame::default() };
            bytes[header_place(index)..][..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&header));
            bytes[pose_place(index)..][..size_of::<Pose>()].copy_from_slice(bytemuck::bytes_of(&pose));
            count = index as u32 + 1;
        }
        Self { stamp: Time::default(), frame_id: MapFrame::default(), poses: Poses { count, bytes } }
    }

    /// Its poses, each with its time.
    pub fn poses(&self) -> impl Iterator<Item = (Time, Pose)> {
        let bytes = &self.poses.bytes;
        (0..Self::POSES_MAX.min(self.poses.count as usize)).map(move |index| {
            let stamp = bytemuck::pod_read_unaligned(&bytes[header_place(index)..][..size_of::<Time>()]);
            let pose = bytemuck::pod_read_unaligned(&bytes[pose_place(index)..][..size_of::<Pose>()]);
            (stamp, pose)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Orientation, Point};

    fn poses(count: u32) -> impl Iterator<Item = (Time, Pose)> {
        (0..count).map(|index| {
            let x = f64::from(index);
            let position = Point { x, y: -x, z: 1.5 };
            let orientation = Orientation { x: 0.0, y: 0.0, z: 0.6, w: 0.8 };
            (Time { sec: index as i32, nanosec: 7 }, Pose { position, orientation })
        })
    }

    /// A header as `rclpy` writes it: the stamp, the length of the name, the name.
    fn header(bytes: &mut Vec<u8>, sec: u32, nanosec: u32) {
        bytes.extend([sec, nanosec, 4].map(u32::to_le_bytes).concat());
        bytes.extend(b"map\0");
    }

    /// The body of the message that `rclpy` writes, made here number by number.
    fn cdr(count: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        header(&mut bytes, 0, 0);
        bytes.extend(count.to_le_bytes());
        for index in 0..count {
            header(&mut bytes, index, 7);
            bytes.resize(bytes.len().next_multiple_of(8), 0);
            let x = f64::from(index);
            bytes.extend([x, -x, 1.5, 0.0, 0.0, 0.6, 0.8].map(f64::to_le_bytes).concat());
        }
        bytes
    }

    #[test]
    fn a_path_has_the_bytes_of_its_cdr_for_every_number_of_poses() {
        let extent = PlannedPath::SCHEMA.extent().unwrap();
        for count in 0..=PlannedPath::POSES_MAX as u32 {
            let path = PlannedPath::new(poses(count));
            let bytes = bytemuck::bytes_of(&path);
            assert_eq!(extent.of(bytes), cdr(count), "{count}");
            assert_eq!((extent.wrong_count(bytes), bytes.len()), (None, PlannedPath::SCHEMA.size));
            assert_eq!(path.poses().count(), count as usize);
        }
    }

    #[test]
    fn poses_behind_the_last_place_are_left_out() {
        let path = PlannedPath::new(poses(PlannedPath::POSES_MAX as u32 + 1));
        let (stamp, pose) = path.poses().last().unwrap();
        assert_eq!((stamp.sec, pose.position.x), (99, 99.0));
    }
}
