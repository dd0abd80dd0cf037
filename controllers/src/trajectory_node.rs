//! The trajectory node: publishes the points of a trajectory, with the derivatives that controllers feed forward.

use crate::trajectory::{Point, Start, Trajectory};
use component::context::{NodeContext, StepContext};
use component::messages::{Orientation, PlannedPath, Pose, Reference, Time};
use component::ports::OutputNumber;
use component::{Component, Info, OutputPorts, StepError};
use diagnostics::ParameterError;

/// Parameters of the trajectory.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Position at its start, in the world.
    #[parameter(example = "[0.0, 0.0, 1.0]")]
    initial_position_m: [f64; 3],
    /// Yaw at its start.
    #[parameter(default = 0.0)]
    initial_yaw_deg: f64,
    /// List of segments, flown one after another; it hovers where the last ends.
    #[parameter(default = Vec::new())]
    segments: Vec<serde_json::Value>,
}

/// Warns of segments that the run ends before.
fn warn_of_late(trajectory: &Trajectory, run: &NodeContext<'_>) {
    let end_s = run.duration_s();
    if let Some((index, start_s)) = trajectory.starts_s().enumerate().find(|(_, start_s)| *start_s >= end_s) {
        run.warn_behind_end("segments", format!(
            "`segments`: entry {index} (the first is 0) begins at {start_s:.3} s, and the run ends at {end_s} s: it and \
             what follows is never flown"
        ));
    }
}

/// Outputs of the node.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// Point of the trajectory.
    pub reference: Reference,
    /// Poses of the coming 9.9 s, one each 0.1 s, as `nav_msgs/Path`.
    pub path: Option<PlannedPath>,
}

/// The output `path`, which takes as long as 100 references.
const PATH: OutputNumber = OutputNumber::of::<Outputs>("path");

/// Time between two poses of the path.
const POSE_EVERY_NS: u64 = 100_000_000;

/// The component `trajectory`.
///
/// ```
/// use controllers::trajectory_node::TrajectoryNode;
/// use serde_json::json;
///
/// let circle = json!({ "kind": "circle", "radius_m": 2.0, "speed_m_s": 2.0, "laps": 2, "ramp_s": 2.0 });
/// let parameters = json!({ "initial_position_m": [0.0, 0.0, 1.0], "segments": [circle] });
/// let mut trajectory = component::Harness::<TrajectoryNode>::from_json(&parameters).unwrap();
/// let reference = trajectory.step(()).unwrap().reference;
/// assert_eq!((reference.position.z, reference.velocity.x), (1.0, 0.0), "it starts from rest");
/// ```
#[derive(Debug)]
pub struct TrajectoryNode {
    trajectory: Trajectory,
}

impl TrajectoryNode {
    fn at(&self, time_ns: u64) -> Point {
        self.trajectory.at(time_ns as f64 * 1e-9)
    }

    /// The course from `now_ns` on.
    fn path(&self, now_ns: u64) -> PlannedPath {
        let times_ns = (0..PlannedPath::POSES_MAX as u64).map(|index| now_ns + index * POSE_EVERY_NS);
        PlannedPath::new(times_ns.map(|time_ns| (Time::from_ns(time_ns), pose(&self.at(time_ns)))))
    }
}

/// The pose of a level vehicle at `point`.
fn pose(point: &Point) -> Pose {
    let [x, y, z] = <[f64; 3]>::from(point.path_W[0]);
    let (sine, cosine) = libm::sincos(0.5 * point.yaw_rad);
    Pose {
        position: component::messages::Point { x, y, z },
        orientation: Orientation { x: 0.0, y: 0.0, z: sine, w: cosine },
    }
}

impl Component for TrajectoryNode {
    const INFO: Info = Info::new(
        "trajectory",
        "references from the manifest: hover, circle, figure eight, minimum snap through waypoints",
    );
    type Parameters = Parameters;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = ();

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let position_W_m = parameters.initial_position_m.into();
        let start = Start { position_W_m, yaw_rad: parameters.initial_yaw_deg.to_radians() };
        let trajectory = Trajectory::read(&parameters.segments, start)?;
        trajectory.require_flyable()?;
        warn_of_late(&trajectory, context);
        Ok(Self { trajectory })
    }

    fn initial(&self) {}

    fn step(&self, context: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
        let now_ns = context.time_ns();
        let reference = Reference::from(&self.at(now_ns));
        if !context.is_due(PATH) {
            // Written apart: of an `Option` that is made first, all 7.2 kB would be copied into the outputs.
            return Ok(Outputs { reference, path: None });
        }
        Ok(Outputs { reference, path: Some(self.path(now_ns)) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::Harness;
    use component::sample_ticks::SampleTicks;
    use serde_json::json;

    #[test]
    fn the_path_is_that_of_the_coming_references() {
        let circle = json!({
            "kind": "circle", "radius_m": 2.0, "speed_m_s": 2.0, "laps": 2, "ramp_s": 2.0, "yaw_deg": 90.0
        });
        let parameters =
            Parameters { initial_position_m: [0.0, 0.0, 1.0], initial_yaw_deg: 0.0, segments: vec![circle] };
        let mut node = Harness::<TrajectoryNode>::new(parameters).unwrap();
        let path = node.step(()).unwrap().path.unwrap();
        assert_eq!(path.poses().count(), PlannedPath::POSES_MAX);
        let (stamp, pose) = path.poses().nth(30).unwrap();
        let (position, turn) = (pose.position, pose.orientation);
        assert!(position.y > 0.1 && turn.z > 0.01, "{pose:?}");
        // At 1 kHz, the second step is that at 1 ms.
        let later = (0..3000).map(|_| node.step(()).unwrap().reference).last().unwrap();
        assert_eq!(stamp, Time { sec: 3, nanosec: 0 });
        assert_eq!([position.x, position.y, position.z], <[f64; 3]>::from(later.position));
        assert!((2.0 * libm::atan2(turn.z, turn.w) - later.yaw).abs() < 1e-12, "{later:?}");
    }

    fn hover() -> Harness<TrajectoryNode> {
        Harness::from_json(&json!({ "initial_position_m": [0.0, 0.0, 1.0] })).unwrap()
    }

    #[test]
    fn a_path_is_computed_at_the_ticks_at_which_it_is_sent_and_begins_there() {
        // Evenly, and at the uneven ticks of 30 Hz.
        for ticks in [SampleTicks::every(100), SampleTicks::measured(1, 1_000_000, 33_333_333, 5_000_000)] {
            let mut node = hover().sending("path", Some(ticks));
            let mut computed = 0;
            for tick in 0..1000 {
                let path = node.step(()).unwrap().path;
                assert_eq!(path.is_some(), ticks.is_due(tick), "tick {tick} of {ticks:?}");
                let first = path.and_then(|path| path.poses().next());
                let begins_now =
                    first.is_none_or(|(stamp, _)| stamp == Time::from_ns(u64::from(tick) * 1_000_000));
                assert!(begins_now, "the path of tick {tick} begins at {first:?}");
                computed += u32::from(path.is_some());
            }
            assert!((10..=31).contains(&computed), "{computed} of {ticks:?}");
        }
    }

    #[test]
    fn no_path_is_computed_that_the_manifest_does_not_name() {
        let mut node = hover().sending("path", None);
        assert!((0..200).all(|_| node.step(()).unwrap().path.is_none()));
    }
}
