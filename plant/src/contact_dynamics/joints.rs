//! Joints between free bodies, the vehicle and the world: the rows of their constraints.
//!
//! A joint has an anchor p on each body, and a direction d that turns with the parent. It holds
//! d · (p_child - p_parent) at 0, or the child's rotation about d. A row's Jacobian maps the twists of the two
//! to the rate of that. Its bias is the part of the second derivative that does not depend on accelerations
//! (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, section 8.2).

use super::drive::Drive;
use super::solver::{Body, Row, Unilateral, join, stop};
use crate::state::RigidBody;
use nalgebra::{Unit, UnitQuaternion, Vector3, Vector6};
use scenes::{Axis, End, Freedom, Joint as Told};

/// Length of the lever at which the gap to a limit of an angle is measured, so that the gap is in metres. Tuned, no
/// source.
const LEVER_M: f64 = 0.1;

/// A joint, its ends by the numbers of the bodies.
#[derive(Debug, Clone)]
pub(super) struct Joint {
    pub ends: [usize; 2],
    /// Anchors on both ends, each seen from its end's centre of mass, in the end's own axes.
    anchors_m: [Vector3<f64>; 2],
    /// Directions along which the anchors stay together, and about which the child does not turn, in the parent's axes.
    along: Vec<Vector3<f64>>,
    about: Vec<Vector3<f64>>,
    motion: Way,
    /// The child's attitude at the start, seen from the parent.
    start: UnitQuaternion<f64>,
    damping: f64,
    pub drive: Option<Drive>,
}

/// Freedom that a joint leaves, in the parent's axes.
#[derive(Debug, Clone, Copy)]
enum Way {
    Nothing,
    AnyTurn,
    Turn(Axis),
    Shift(Axis),
    Rope { length_m: f64 },
}

/// A row of a joint's constraint.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub ends: [usize; 2],
    pub jacobian: [Vector6<f64>; 2],
    /// Part of the second derivative that does not depend on accelerations.
    pub bias: f64,
    /// Error of the constraint, m or rad.
    pub off: f64,
}

impl Line {
    /// Its rate, or its second derivative without the bias.
    pub(super) fn rate(&self, twist: impl Fn(usize) -> Vector6<f64>) -> f64 {
        self.jacobian[0].dot(&twist(self.ends[0])) + self.jacobian[1].dot(&twist(self.ends[1]))
    }
}

/// Places and rates of a joint's ends.
struct Placed {
    /// From each centre of mass to its anchor.
    arms_W_m: [Vector3<f64>; 2],
    /// From the parent's centre of mass to the child's anchor.
    reach_W_m: Vector3<f64>,
    /// From the parent's anchor to the child's.
    apart_W_m: Vector3<f64>,
    /// The rate of that.
    apart_W_m_s: Vector3<f64>,
    spins_W_rad_s: [Vector3<f64>; 2],
}

impl Joint {
    /// The joint of a scene whose bodies are `frames` at the start, the world first and the vehicle second.
    pub(super) fn new(told: &Told, frames: &[RigidBody], number: impl Fn(End) -> usize) -> Self {
        let ends = [told.parent, told.child].map(number);
        let [parent, child] = ends.map(|end| &frames[end]);
        let seen_from = |frame: &RigidBody, point_W_m: &Vector3<f64>| {
            frame.attitude_WB.inverse_transform_vector(&(point_W_m - frame.position_W_m))
        };
        let in_parent = |axis: &Axis| Axis {
            along_W: parent.attitude_WB.inverse_transform_vector(&axis.along_W),
            ..*axis
        };
        let all = || [Vector3::x(), Vector3::y(), Vector3::z()].to_vec();
        let across = |axis: &Axis| {
            let along = axis.along_W;
            let first = along.cross(&Vector3::ith(along.iamin(), 1.0)).normalize();
            vec![first, along.cross(&first)]
        };
        let (along, about, motion) = match &told.freedom {
            Freedom::Fixed => (all(), all(), Way::Nothing),
            Freedom::Ball => (all(), Vec::new(), Way::AnyTurn),
            Freedom::Revolute(axis) => (all(), across(&in_parent(axis)), Way::Turn(in_parent(axis))),
            Freedom::Prismatic(axis) => (across(&in_parent(axis)), all(), Way::Shift(in_parent(axis))),
            Freedom::Rope { length_m, .. } => (Vec::new(), Vec::new(), Way::Rope { length_m: *length_m }),
        };
        let end_W_m = match &told.freedom {
            Freedom::Rope { end_W_m, .. } => end_W_m,
            _ => &told.anchor_W_m,
        };
        let anchors_m = [seen_from(parent, &told.anchor_W_m), seen_from(child, end_W_m)];
        let start = parent.attitude_WB.inverse() * child.attitude_WB;
        let has_stops = |axis: &Axis| axis.limits.iter().any(|limit| limit.is_finite());
        let turns_round = matches!(motion, Way::Turn(axis) if !has_stops(&axis));
        let drive = told.drive.as_ref().map(|drive| Drive::new(drive, turns_round));
        Self { ends, anchors_m, along, about, motion, start, damping: told.damping, drive }
    }

    /// Moves the anchors on the vehicle, whose centre of mass is not where its file says.
    pub(super) fn shift(&mut self, vehicle: usize, by_B_m: &Vector3<f64>) {
        for (end, anchor_m) in self.ends.iter().zip(&mut self.anchors_m) {
            if *end == vehicle {
                *anchor_m += by_B_m;
            }
        }
    }

    /// True if it is a rope: all other joints keep two bodies from touching each other.
    pub(super) fn is_rope(&self) -> bool {
        matches!(self.motion, Way::Rope { .. })
    }

    /// Numbers that distinguish it from others.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> {
        let (axis, limits) = match self.motion {
            Way::Nothing => (Vector3::zeros(), [0.0; 2]),
            Way::AnyTurn => (Vector3::zeros(), [1.0; 2]),
            Way::Turn(axis) | Way::Shift(axis) => (axis.along_W, axis.limits),
            Way::Rope { length_m } => (Vector3::zeros(), [length_m; 2]),
        };
        let ends = self.ends.map(|end| end as f64);
        let anchors = self.anchors_m.map(<[f64; 3]>::from).concat();
        let more = [axis.x, axis.y, axis.z, limits[0], limits[1], self.damping];
        let start = <[f64; 4]>::from(self.start.coords);
        let held = [self.along.len() as f64, self.about.len() as f64];
        let drive = self.drive.iter().flat_map(Drive::numbers);
        ends.into_iter().chain(anchors).chain(more).chain(held).chain(start).chain(drive)
    }

    fn placed(&self, frames: &[RigidBody]) -> Placed {
        let both = self.ends.map(|end| &frames[end]);
        let arms_W_m = [0, 1].map(|at| both[at].attitude_WB * self.anchors_m[at]);
        let spins_W_rad_s = both.map(RigidBody::angular_velocity_W_rad_s);
        let [from_W_m, to_W_m] = [0, 1].map(|at| both[at].position_W_m + arms_W_m[at]);
        let [from_W_m_s, to_W_m_s] =
            [0, 1].map(|at| both[at].velocity_W_m_s + spins_W_rad_s[at].cross(&arms_W_m[at]));
        Placed {
            reach_W_m: to_W_m - both[0].position_W_m,
            apart_W_m: to_W_m - from_W_m,
            apart_W_m_s: to_W_m_s - from_W_m_s,
            arms_W_m,
            spins_W_rad_s,
        }
    }

    /// Adds the rows of its constraint; of a rope, which is one while it is taut, that of its length.
    pub(super) fn lines(&self, frames: &[RigidBody], lines: &mut Vec<Line>) {
        let placed = self.placed(frames);
        let parent = &frames[self.ends[0]];
        for along in &self.along {
            lines.push(self.line_along(&placed, &(parent.attitude_WB * along)));
        }
        for (number, about) in self.about.iter().enumerate() {
            let about_W = parent.attitude_WB * about;
            let off = self.turned_off(frames, number);
            let spin_W_rad_s = placed.spins_W_rad_s[1] - placed.spins_W_rad_s[0];
            let bias = placed.spins_W_rad_s[0].cross(&about_W).dot(&spin_W_rad_s);
            lines.push(Line { ends: self.ends, jacobian: turn(&about_W), bias, off });
        }
        if let Way::Rope { length_m } = self.motion {
            lines.extend(self.line_of_rope(&placed, length_m));
        }
    }

    /// Along `along_W`, which turns with the parent.
    fn line_along(&self, placed: &Placed, along_W: &Vector3<f64>) -> Line {
        let Placed { arms_W_m, reach_W_m, apart_W_m_s, spins_W_rad_s: [parent, child], .. } = placed;
        // Of the child's anchor as the parent sees it.
        let leaves_W_m_s = apart_W_m_s - parent.cross(&placed.apart_W_m);
        let reach_W_m_s = apart_W_m_s + parent.cross(&arms_W_m[0]);
        let bends = child.cross(&child.cross(&arms_W_m[1])) - parent.cross(&reach_W_m_s);
        let bias = along_W.dot(&bends) + parent.cross(along_W).dot(&leaves_W_m_s);
        Line {
            ends: self.ends,
            jacobian: push([reach_W_m, &arms_W_m[1]], along_W),
            bias,
            off: along_W.dot(&placed.apart_W_m),
        }
    }

    /// `None` where the anchors are in one place: then the rope has no direction.
    fn line_of_rope(&self, placed: &Placed, length_m: f64) -> Option<Line> {
        let (Placed { arms_W_m, apart_W_m, apart_W_m_s, .. }, [parent, child]) =
            (placed, placed.spins_W_rad_s);
        let (along, distance_m) = Unit::try_new_and_get(*apart_W_m, 1e-9)?;
        let leaves_m_s = along.dot(apart_W_m_s);
        let bends = child.cross(&child.cross(&arms_W_m[1])) - parent.cross(&parent.cross(&arms_W_m[0]));
        let swings = (apart_W_m_s.norm_squared() - leaves_m_s * leaves_m_s) / distance_m;
        let jacobian = push([&arms_W_m[0], &arms_W_m[1]], &along);
        let bias = along.dot(&bends) + swings;
        Some(Line { ends: self.ends, jacobian, bias, off: distance_m - length_m })
    }

    /// Returns the child's rotation about the direction `number` of those that are held, rad.
    fn turned_off(&self, frames: &[RigidBody], number: usize) -> f64 {
        let turned = self.turned(frames);
        match self.motion {
            // How far the axis leans.
            Way::Turn(axis) => self.about[number].dot(&axis.along_W.cross(&(turned * axis.along_W))),
            _ => 2.0 * turned.imag()[number] * turned.w.signum(),
        }
    }

    /// Returns the child's rotation since the start, in the parent's axes.
    fn turned(&self, frames: &[RigidBody]) -> UnitQuaternion<f64> {
        let [parent, child] = self.ends.map(|end| frames[end].attitude_WB);
        parent.inverse() * child * self.start.inverse()
    }

    /// Adds the rows along which it is damped, and by how much.
    pub(super) fn damped(&self, frames: &[RigidBody], lines: &mut Vec<(Line, f64)>) {
        if self.damping == 0.0 {
            return;
        }
        let turning =
            |about_W: &Vector3<f64>| Line { ends: self.ends, jacobian: turn(about_W), bias: 0.0, off: 0.0 };
        match self.motion {
            Way::AnyTurn => lines.extend(
                [Vector3::x(), Vector3::y(), Vector3::z()].map(|about_W| (turning(&about_W), self.damping)),
            ),
            _ => lines.extend(self.axial(frames).map(|line| (line, self.damping))),
        }
    }

    /// The row of the motion about or along the axis of a revolute or prismatic joint. Its error is the angle,
    /// from -pi to pi, or the way since the start. `None` for other joints.
    pub(super) fn axial(&self, frames: &[RigidBody]) -> Option<Line> {
        let parent = &frames[self.ends[0]];
        match self.motion {
            Way::Turn(axis) => {
                let jacobian = turn(&(parent.attitude_WB * axis.along_W));
                Some(Line { ends: self.ends, jacobian, bias: 0.0, off: self.angle_rad(frames, &axis) })
            }
            Way::Shift(axis) => {
                Some(self.line_along(&self.placed(frames), &(parent.attitude_WB * axis.along_W)))
            }
            Way::Nothing | Way::AnyTurn | Way::Rope { .. } => None,
        }
    }

    /// The angle about the axis since the start, from -pi to pi.
    fn angle_rad(&self, frames: &[RigidBody], axis: &Axis) -> f64 {
        let turned = self.turned(frames);
        let angle_rad = 2.0 * libm::atan2(turned.imag().dot(&axis.along_W), turned.w);
        // From -2 pi to 2 pi: the quaternion may have either sign.
        angle_rad - std::f64::consts::TAU * (angle_rad / std::f64::consts::TAU).round()
    }

    /// Returns the slack of a rope, and the rate at which its ends go apart; `None` for another joint.
    pub(super) fn slack(&self, frames: &[RigidBody]) -> Option<(f64, f64)> {
        let Way::Rope { length_m } = self.motion else { return None };
        let placed = self.placed(frames);
        let distance_m = placed.apart_W_m.norm();
        let along = placed.apart_W_m.try_normalize(1e-9).unwrap_or_default();
        Some((length_m - distance_m, along.dot(&placed.apart_W_m_s)))
    }

    /// Adds its stops, each a gap that must not close: the ends of its way, or a rope's length.
    pub(super) fn stops(&self, all: &[Body], frames: &[RigidBody], constraints: &mut Vec<Unilateral>) {
        let row = |jacobian: [Vector6<f64>; 2], sign: f64| {
            Row::new(all, self.ends, jacobian.map(|half| half * sign))
        };
        let mut between = |[lower, upper]: [f64; 2], at: f64, lever: f64, jacobian: [Vector6<f64>; 2]| {
            let gaps = [(1.0, at - lower), (-1.0, upper - at)];
            let ends = gaps.into_iter().filter(|(_, gap)| gap.is_finite());
            constraints.extend(ends.map(|(sign, gap)| stop(row(jacobian, sign * lever), lever * gap)));
        };
        match self.motion {
            Way::Turn(Axis { limits, .. }) | Way::Shift(Axis { limits, .. }) => {
                let lever = if matches!(self.motion, Way::Turn(_)) { LEVER_M } else { 1.0 };
                if let Some(line) = self.axial(frames) {
                    between(limits, line.off, lever, line.jacobian);
                }
            }
            Way::Rope { length_m } => {
                if let Some(line) = self.line_of_rope(&self.placed(frames), length_m) {
                    constraints.push(stop(row(line.jacobian, -1.0), -line.off));
                }
            }
            Way::Nothing | Way::AnyTurn => (),
        }
    }
}

/// The Jacobian of the child's motion along a direction, from the parent, both at these arms.
fn push([parent_W_m, child_W_m]: [&Vector3<f64>; 2], along_W: &Vector3<f64>) -> [Vector6<f64>; 2] {
    [-join(along_W, &parent_W_m.cross(along_W)), join(along_W, &child_W_m.cross(along_W))]
}

/// The Jacobian of the child's rotation about a direction, from the parent.
fn turn(about_W: &Vector3<f64>) -> [Vector6<f64>; 2] {
    let child = join(&Vector3::zeros(), about_W);
    [-child, child]
}
