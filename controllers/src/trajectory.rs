//! A trajectory: segments one after another, each from rest to rest, as a function of time.

use crate::curve::{Curve, Path, PhaseClock, Shape, smooth_step};
use crate::minimum_snap::{MinimumSnap, spans_at_mean_speed};
use component::messages::Reference;
use diagnostics::parameter::{ParameterError, all, finite, positive, refuse, require};
use nalgebra::Vector3;
use serde::Deserialize;
use std::f64::consts::TAU;

/// The most waypoints of a segment: their equations are solved at once.
const WAYPOINTS_MAX: usize = 64;

/// A segment as it stands in the manifest. All begin at rest where the one before ended, and end at rest; the yaw at its
/// end is the one before where it is absent.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum SegmentEntry {
    /// Stays where it is: `{ kind = "hover", duration_s = 2.0, yaw_deg = 90.0 }`.
    Hover { duration_s: f64, yaw_deg: Option<f64> },
    /// Laps of a circle: `{ kind = "circle", radius_m = 2.0, speed_m_s = 2.0, laps = 2, ramp_s = 2.0 }`. The radius is
    /// negative for a circle to the right, the speed that between the ramps, in which it rises and falls; the direction
    /// is that in which it starts, counter-clockwise from the world's x.
    Circle {
        radius_m: f64,
        speed_m_s: f64,
        laps: u32,
        ramp_s: f64,
        #[serde(default)]
        direction_deg: f64,
        yaw_deg: Option<f64>,
    },
    /// Laps of a figure eight: `{ kind = "figure-eight", half_length_m = 2.0, speed_m_s = 3.0, laps = 3, ramp_s = 3.0 }`.
    /// The half length is that from the middle to either end, the speed the greatest, in the middle, the direction that of
    /// its length.
    FigureEight {
        half_length_m: f64,
        speed_m_s: f64,
        laps: u32,
        ramp_s: f64,
        #[serde(default)]
        direction_deg: f64,
        yaw_deg: Option<f64>,
    },
    /// A minimum-snap path through waypoints in the world after the place where it begins:
    /// `{ kind = "minimum-snap", waypoints_m = [[1.0, 0.0, 1.5], [2.0, 1.0, 1.0]], mean_speed_m_s = 1.5 }`. The times are
    /// those from each waypoint to the next, the mean speed that along the straight lines between them.
    MinimumSnap {
        waypoints_m: Vec<[f64; 3]>,
        times_s: Option<Vec<f64>>,
        mean_speed_m_s: Option<f64>,
        yaw_deg: Option<f64>,
    },
}

/// Start of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Position in the world, m.
    pub position_W_m: Vector3<f64>,
    /// Yaw, rad.
    pub yaw_rad: f64,
}

/// A point of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Position and its first four derivatives, in the world.
    pub path_W: Path,
    /// Yaw, rad.
    pub yaw_rad: f64,
    /// Its rate of change, rad/s.
    pub yaw_rate_rad_s: f64,
}

/// Segments one after another; at rest in the last one's end from then on.
///
/// ```
/// use controllers::trajectory::{Start, Trajectory};
/// use nalgebra::Vector3;
/// use serde_json::json;
///
/// let start = Start { position_W_m: Vector3::z(), yaw_rad: 0.0 };
/// let path = json!({ "kind": "minimum-snap", "waypoints_m": [[1.0, 0.0, 1.5]], "times_s": [2.0] });
/// let trajectory = Trajectory::read(&[path], start).unwrap();
/// assert_eq!(trajectory.duration_s(), 2.0);
/// assert!((trajectory.at(2.0).path_W[0] - Vector3::new(1.0, 0.0, 1.5)).norm() < 1e-9, "m in the world");
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    segments: Vec<Segment>,
    end: Start,
}

#[derive(Debug, Clone, PartialEq)]
struct Segment {
    start_s: f64,
    duration_s: f64,
    way: Way,
    yaw_start_rad: f64,
    yaw_end_rad: f64,
}

#[derive(Debug, Clone, PartialEq)]
enum Way {
    Rest(Vector3<f64>),
    Curve(Curve),
    Snap(MinimumSnap),
}

impl Trajectory {
    /// The trajectory of `entries`, read one by one so that the fault of an entry names its place.
    ///
    /// # Errors
    /// An entry of unknown kind, one that lacks a key or has an unknown one, a number out of its range: in words.
    pub fn read(entries: &[serde_json::Value], start: Start) -> Result<Self, ParameterError> {
        let mut trajectory = Self { segments: Vec::with_capacity(entries.len()), end: start };
        let mut errors = Vec::new();
        for (index, entry) in entries.iter().enumerate() {
            let appended = component::parameters::read(entry).and_then(|entry| trajectory.append(&entry));
            let each = appended.err().map_or(Vec::new(), ParameterError::into_each);
            // Behind a faulty segment, nobody knows where a path begins.
            let is_of_path = |error: &ParameterError| ["waypoints_m", "times_s"].contains(&error.key());
            let has_faults = !errors.is_empty();
            let each = each.into_iter().filter(|error| !has_faults || !is_of_path(error));
            errors.extend(each.map(|error| Err::<(), _>(error.within(&format!("segments.{index}")))));
        }
        ParameterError::gather(errors).map(|_| trajectory)
    }

    fn append(&mut self, entry: &SegmentEntry) -> Result<(), ParameterError> {
        let way = entry.way(self.end.position_W_m);
        let yaw_end_rad = entry.yaw_end_rad(self.end.yaw_rad);
        let ((way, duration_s), yaw_end_rad) = ParameterError::both(way, yaw_end_rad)?;
        let (start_s, yaw_start_rad) = (self.duration_s(), self.end.yaw_rad);
        self.end = Start { position_W_m: way.end(duration_s), yaw_rad: yaw_end_rad };
        self.segments.push(Segment { start_s, duration_s, way, yaw_start_rad, yaw_end_rad });
        Ok(())
    }

    /// When the last segment ends, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.segments.last().map_or(0.0, |segment| segment.start_s + segment.duration_s)
    }

    /// When each segment begins, s.
    pub(crate) fn starts_s(&self) -> impl Iterator<Item = f64> {
        self.segments.iter().map(|segment| segment.start_s)
    }

    /// Refuses a trajectory that no vehicle flies: each segment is looked at in `LOOKS` places.
    ///
    /// # Errors
    /// The segment, and the limit that it exceeds.
    pub(crate) fn require_flyable(&self) -> Result<(), ParameterError> {
        self.segments.iter().enumerate().try_for_each(|(index, segment)| {
            let times = (0..=LOOKS).map(|look| segment.duration_s * f64::from(look) / f64::from(LOOKS));
            times.map(|since_s| segment.at(segment.start_s + since_s)).try_for_each(|point| {
                point.require_flyable().map_err(|error| {
                    error
                        .within(&format!("segments.{index}"))
                        .advised("make the segment slower, longer or larger")
                })
            })
        })
    }

    /// The point at `time_s`, a function of the time alone.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Point {
        let next = self.segments.partition_point(|segment| segment.start_s <= time_s);
        match next.checked_sub(1).map(|index| &self.segments[index]) {
            Some(segment) if time_s < segment.start_s + segment.duration_s => segment.at(time_s),
            _ => resting(self.end.position_W_m, self.end.yaw_rad),
        }
    }
}

fn resting(position_W_m: Vector3<f64>, yaw_rad: f64) -> Point {
    Point { path_W: at_rest(position_W_m), yaw_rad, yaw_rate_rad_s: 0.0 }
}

fn at_rest(position_W_m: Vector3<f64>) -> Path {
    let mut path = Path::default();
    path[0] = position_W_m;
    path
}

/// In how many places of a segment a trajectory is looked at before a run.
const LOOKS: u32 = 200;

/// Limits of a reference, each with its unit and the reason. Tuned, no source, a decade above what any vehicle does:
/// a racing quadrotor reaches 100 m/s and 15 g; shock tests of electronics begin at 100 g.
const ASKED_MAX: [(f64, &str); 3] = [
    (1e6, "m from the world's origin; beyond 1000 km nanometres are lost in a double"),
    (1e3, "m/s; no vehicle with rotors flies near the speed of sound"),
    (1e3, "m/s^2; no vehicle that flies stands 100 g"),
];

impl From<&Point> for Reference {
    fn from(point: &Point) -> Self {
        let [position, velocity, acceleration, jerk, snap] =
            point.path_W.map(|vector| <[f64; 3]>::from(vector).into());
        let (yaw, yaw_rate) = (point.yaw_rad, point.yaw_rate_rad_s);
        Self { position, velocity, acceleration, jerk, snap, yaw, yaw_rate, ..Self::default() }
    }
}

impl From<&Reference> for Point {
    fn from(message: &Reference) -> Self {
        let Reference { position, velocity, acceleration, jerk, snap, .. } = *message;
        let path_W =
            [position, velocity, acceleration, jerk, snap].map(|vector| <[f64; 3]>::from(vector).into());
        Self { path_W, yaw_rad: message.yaw, yaw_rate_rad_s: message.yaw_rate }
    }
}

impl Point {
    fn require_flyable(&self) -> Result<(), ParameterError> {
        for (asked, (most, unit)) in self.path_W.iter().zip(ASKED_MAX) {
            let length = asked.norm();
            refuse(length.is_nan() || length > most, "", || {
                format!("it asks for {length:.4e} where at most {most:e} {unit}")
            })?;
        }
        let rate_rad_s = self.yaw_rate_rad_s;
        let holds = self.path_W.iter().all(|asked| asked.iter().all(|number| number.is_finite()));
        refuse(!holds || rate_rad_s.is_nan() || rate_rad_s.abs() > YAW_RATE_MAX_RAD_S, "", || {
            format!(
                "it asks for a yaw rate of {rate_rad_s:.4e} rad/s, or derivatives that are no numbers; expected at most \
                 {YAW_RATE_MAX_RAD_S} rad/s"
            )
        })
    }
}

/// Faster than any vehicle turns about its vertical axis: 16 turns a second. Tuned, no source.
const YAW_RATE_MAX_RAD_S: f64 = 100.0;

impl Segment {
    fn at(&self, time_s: f64) -> Point {
        let since_s = time_s - self.start_s;
        let path_W = match &self.way {
            Way::Rest(position_W_m) => at_rest(*position_W_m),
            Way::Curve(curve) => curve.at(since_s),
            Way::Snap(snap) => snap.at(since_s),
        };
        let turn_rad = self.yaw_end_rad - self.yaw_start_rad;
        let [part, part_rate, ..] = smooth_step(since_s / self.duration_s);
        let yaw_rad = self.yaw_start_rad + turn_rad * part;
        Point { path_W, yaw_rad, yaw_rate_rad_s: turn_rad * part_rate / self.duration_s }
    }
}

impl Way {
    fn end(&self, duration_s: f64) -> Vector3<f64> {
        match self {
            Self::Rest(position_W_m) => *position_W_m,
            // Laps end where they start; what rounding leaves would add up.
            Self::Curve(curve) => curve.start_W_m,
            Self::Snap(snap) => snap.at(duration_s)[0],
        }
    }
}

impl SegmentEntry {
    /// The way from a place, and how long it takes, s.
    fn way(&self, from_W_m: Vector3<f64>) -> Result<(Way, f64), ParameterError> {
        match *self {
            Self::Hover { duration_s, .. } => {
                positive("duration_s", duration_s)?;
                Ok((Way::Rest(from_W_m), duration_s))
            }
            Self::Circle { radius_m, speed_m_s, laps, ramp_s, direction_deg, .. } => {
                let radius = require("radius_m", radius_m, radius_m != 0.0, "a number other than 0")
                    .and_then(|()| finite("radius_m", radius_m));
                let laps = Laps { speed_m_s, laps, ramp_s, direction_deg };
                ParameterError::both(radius, laps.check())?;
                laps.of(Shape::Circle { radius_m }, from_W_m)
            }
            Self::FigureEight { half_length_m, speed_m_s, laps, ramp_s, direction_deg, .. } => {
                let laps = Laps { speed_m_s, laps, ramp_s, direction_deg };
                ParameterError::both(positive("half_length_m", half_length_m), laps.check())?;
                laps.of(Shape::FigureEight { half_length_m }, from_W_m)
            }
            Self::MinimumSnap { ref waypoints_m, ref times_s, mean_speed_m_s, .. } => {
                let waypoints_W_m = waypoints(from_W_m, waypoints_m)?;
                let spans_s = spans_s(&waypoints_W_m, times_s.as_deref(), mean_speed_m_s)?;
                let snap = MinimumSnap::new(&waypoints_W_m, &spans_s).ok_or_else(|| {
                    let expected = "of like size, so that the path's equations can be solved";
                    ParameterError::value("times_s", expected, format!("{spans_s:?}"))
                })?;
                let duration_s = snap.duration_s();
                Ok((Way::Snap(snap), duration_s))
            }
        }
    }

    fn yaw_end_rad(&self, before_rad: f64) -> Result<f64, ParameterError> {
        let (Self::Hover { yaw_deg, .. }
        | Self::Circle { yaw_deg, .. }
        | Self::FigureEight { yaw_deg, .. }
        | Self::MinimumSnap { yaw_deg, .. }) = *self;
        let Some(yaw_deg) = yaw_deg else { return Ok(before_rad) };
        finite("yaw_deg", yaw_deg)?;
        Ok(yaw_deg.to_radians())
    }
}

/// Keys that the entries of closed curves share.
struct Laps {
    speed_m_s: f64,
    laps: u32,
    ramp_s: f64,
    direction_deg: f64,
}

impl Laps {
    fn check(&self) -> Result<(), ParameterError> {
        let checks = [
            positive("speed_m_s", self.speed_m_s),
            positive("ramp_s", self.ramp_s),
            finite("direction_deg", self.direction_deg),
        ];
        ParameterError::gather(checks).map(drop)
    }

    /// The way along `shape`; the keys have passed their check.
    fn of(&self, shape: Shape, start_W_m: Vector3<f64>) -> Result<(Way, f64), ParameterError> {
        let (rate_rad_s, ramp_s) = (self.speed_m_s / shape.speed_max_m_rad(), self.ramp_s);
        let direction_rad = self.direction_deg.to_radians();
        let phase_rad = TAU * f64::from(self.laps);
        let clock = PhaseClock::covering(phase_rad, rate_rad_s, ramp_s).ok_or_else(|| {
            let expected =
                format!("at least {}, in which the ramps find room", (rate_rad_s * ramp_s / TAU).ceil());
            ParameterError::value("laps", expected, self.laps)
        })?;
        Ok((Way::Curve(Curve { shape, start_W_m, direction_rad, clock }), clock.duration_s))
    }
}

/// The waypoints of a path, where it begins before them.
fn waypoints(from_W_m: Vector3<f64>, waypoints_m: &[[f64; 3]]) -> Result<Vec<Vector3<f64>>, ParameterError> {
    let count = waypoints_m.len();
    let expected = format!("a list of 1 to {WAYPOINTS_MAX} points");
    require("waypoints_m", count, (1..=WAYPOINTS_MAX).contains(&count), expected)?;
    all(finite, "waypoints_m", waypoints_m.as_flattened())?;
    Ok([from_W_m].into_iter().chain(waypoints_m.iter().map(|point| Vector3::from(*point))).collect())
}

/// The times from each of these points to the next, s: as given, or those at a mean speed.
fn spans_s(
    waypoints_W_m: &[Vector3<f64>],
    times_s: Option<&[f64]>,
    mean_speed_m_s: Option<f64>,
) -> Result<Vec<f64>, ParameterError> {
    let count = waypoints_W_m.len() - 1;
    match (times_s, mean_speed_m_s) {
        (Some(times_s), None) => {
            let expected = format!("one time for each of the {count} waypoints");
            require("times_s", times_s.len(), times_s.len() == count, expected)?;
            all(positive, "times_s", times_s)?;
            Ok(times_s.to_owned())
        }
        (None, Some(speed_m_s)) => {
            if let Some(index) = waypoints_W_m.windows(2).position(|ends| ends[0] == ends[1]) {
                let expected = "points that differ from the one before, or use times_s";
                let found = format!("point {index} where it was already");
                return Err(ParameterError::value("waypoints_m", expected, found));
            }
            positive("mean_speed_m_s", speed_m_s)?;
            Ok(spans_at_mean_speed(waypoints_W_m, speed_m_s))
        }
        _ => {
            let message = "give either `times_s` or `mean_speed_m_s`, and not both";
            Err(ParameterError::conflict("times_s", message))
        }
    }
}
