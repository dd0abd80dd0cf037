//! Vehicles along their paths, by the outlines of their airframes.

use crate::airframe::Body;
use crate::attached::Attached;
use crate::plot::choice::{Ask, Role};
use crate::plot::figure::Trail;
use crate::plot::thin::Poses;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::Serialize;

/// Vehicles on a path at most, but for the one at its end: tuned, no source; more hide the path.
const SHOWN_MAX: f64 = 8.0;
/// Room between two vehicles on a path, as a multiple of how far their propellers reach: tuned, no source.
const ROOM: f64 = 3.0;

/// A vehicle at some places of its path, in the world.
#[derive(Clone, Debug, Serialize)]
pub struct Outline {
    /// The vehicle, as its file calls it.
    pub name: String,
    /// The topic of its path.
    pub topic: String,
    /// The colour of its path, as HTML writes it.
    pub colour: &'static str,
    /// Positions of its centre of mass, in metres.
    pub places: Vec<[f64; 3]>,
    /// Its lines at each of these positions, in metres.
    #[serde(skip)]
    pub lines: Vec<Vec<[f64; 3]>>,
}

/// The outlines along the flown paths, of the vehicles whose files are attached.
pub fn outlines(read: &[(Ask, Poses)], trails: &[Trail], attached: &Attached) -> Vec<Outline> {
    let flown = read.iter().filter(|(ask, poses)| ask.role == Role::Flown && poses.body().is_none());
    let outline = |(ask, poses): &(Ask, Poses)| {
        let colour = trails.iter().find(|trail| trail.topic == ask.topic)?.colour;
        let body = attached.body(ask.vehicle())?;
        let poses: Vec<Pose> = poses.points().into_iter().filter_map(Pose::of).collect();
        let shown = chosen(&poses, body.reach_m());
        (!shown.is_empty()).then(|| Outline {
            name: body.name.clone(),
            topic: ask.topic.clone(),
            colour,
            places: shown.iter().map(|pose| pose.at_W_m.into()).collect(),
            lines: shown.iter().flat_map(|pose| pose.lines(&body)).collect(),
        })
    };
    flown.filter_map(outline).collect()
}

struct Pose {
    at_W_m: Vector3<f64>,
    attitude_WB: UnitQuaternion<f64>,
}

impl Pose {
    /// `None` for values that are not a pose: many topics have positions only.
    fn of([x, y, z, i, j, k, w]: [f64; 7]) -> Option<Self> {
        let attitude_WB = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 0.5)?;
        let is_finite = [x, y, z, i, j, k, w].iter().all(|value| value.is_finite());
        is_finite.then(|| Self { at_W_m: Vector3::new(x, y, z), attitude_WB })
    }

    fn lines(&self, body: &Body) -> Vec<Vec<[f64; 3]>> {
        let placed = |at_B_m: &Vector3<f64>| (self.at_W_m + self.attitude_WB * at_B_m).into();
        body.outline_B_m().iter().map(|line| line.iter().map(placed).collect()).collect()
    }
}

/// The poses at the start, at the end, and where the vehicle has gone on far enough in between.
fn chosen(poses: &[Pose], reach_m: f64) -> Vec<&Pose> {
    let step_m = |pair: &[Pose]| (pair[1].at_W_m - pair[0].at_W_m).norm();
    let length_m: f64 = poses.windows(2).map(step_m).sum();
    let room_m = (length_m / SHOWN_MAX).max(ROOM * reach_m);
    let (Some(first), Some(last)) = (poses.first(), poses.last()) else { return Vec::new() };
    let (mut shown, mut gone_m) = (vec![first], 0.0);
    let mut left_m = length_m;
    for pair in poses.windows(2) {
        gone_m += step_m(pair);
        left_m -= step_m(pair);
        if gone_m >= room_m && left_m >= room_m / 2.0 {
            shown.push(&pair[1]);
            gone_m = 0.0;
        }
    }
    // A vehicle that stays where it is, is drawn once.
    let is_elsewhere = |pose: &&Pose| {
        (last.at_W_m - pose.at_W_m).norm() > 0.1 * reach_m
            || last.attitude_WB.angle_to(&pose.attitude_WB) > 0.1
    };
    if shown.last().is_some_and(is_elsewhere) {
        shown.push(last);
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::{Pose, chosen};

    fn path(length_m: f64) -> Vec<Pose> {
        (0..=1000)
            .filter_map(|index| Pose::of([length_m * f64::from(index) * 1e-3, 0., 1., 0., 0., 0., 1.]))
            .collect()
    }

    #[test]
    fn a_long_path_shows_ends_and_some_places_a_short_one_its_ends_and_none_but_one() {
        let places = |length_m: f64| -> Vec<f64> {
            let poses = path(length_m);
            chosen(&poses, 0.25).iter().map(|pose| pose.at_W_m.x).collect()
        };
        let long = places(80.0);
        assert!((8..=10).contains(&long.len()), "{long:?}");
        assert_eq!((long[0], *long.last().unwrap()), (0.0, 80.0));
        assert!(long.windows(2).all(|pair| pair[1] - pair[0] >= 4.9), "{long:?}");
        assert_eq!(places(0.5), [0.0, 0.5]);
        assert_eq!(places(0.001), [0.0]);
        assert!(chosen(&[], 0.25).is_empty());
    }

    #[test]
    fn places_without_an_attitude_are_no_poses() {
        assert!(Pose::of([0.0, 0.0, 1.0, f64::NAN, f64::NAN, f64::NAN, f64::NAN]).is_none());
        assert!(Pose::of([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]).is_none());
    }
}
