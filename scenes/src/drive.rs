//! Drives of joints: motors that turn a hinge or move a slide.

use diagnostics::parameter::Bounds;
use diagnostics::unit::{
    ANGLE, Dimension, FORCE, LENGTH, LINEAR_DAMPING, LINEAR_STIFFNESS, ROTARY_DAMPING, ROTARY_STIFFNESS,
    SPEED, TORQUE, VELOCITY,
};
use diagnostics::{Diagnostic, Faults};
use vehicles::reader::Section;

/// A motor in a revolute or a prismatic joint, as servos of URDF, SDF and MuJoCo: it acts on the child with
/// `stiffness` (target - position) + `damping` (target's rate - rate), within ±`limit`, and on the parent with the opposite.
///
/// ```
/// let scene = scenes::Scene::parse(scenes::reference::DRIVEN_JOINTS, "driven-joints.toml")?;
/// let drive = scene.joints[0].drive.as_ref().unwrap();
/// assert_eq!((drive.mode, drive.stiffness), (scenes::Mode::Speed, 0.0));
/// assert_eq!(drive.target(0.5), scenes::Target { position: 0.0, rate: 1.0 }, "half of the way up to 2 rad/s");
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Quantity that the schedule is of.
    pub mode: Mode,
    /// Force per distance from the target: N m/rad of a hinge, N/m of a slide; 0 of a speed.
    pub stiffness: f64,
    /// Force per difference from the target's rate: N m s/rad of a hinge, N s/m of a slide.
    pub damping: f64,
    /// The largest force, N m of a hinge, N of a slide; infinite where the file has none.
    pub limit: f64,
    /// Points of time, s, and target, in the order of time and one at least: rad or rad/s of a hinge, m or m/s of a slide.
    pub schedule: Vec<[f64; 2]>,
}

/// Quantity that a drive holds at its target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// The speed of the joint.
    Speed,
    /// The angle or the way of the joint, 0 at the start.
    Position,
}

/// Target of a drive at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Angle, rad, or way, m; 0 of a speed.
    pub position: f64,
    /// Its rate, rad/s or m/s.
    pub rate: f64,
}

impl Drive {
    /// The target at `time_s` after the start: linear between two points, constant before the first and after the last.
    /// The second of two points at one time counts from then on.
    #[must_use]
    pub fn target(&self, time_s: f64) -> Target {
        self.target_of_step(time_s, time_s)
    }

    /// The target at `time_s` of an integration step whose middle is `middle_s`, both after the start: the schedule bends and
    /// jumps between two steps only, so that a step is smooth.
    #[must_use]
    pub fn target_of_step(&self, time_s: f64, middle_s: f64) -> Target {
        let [value, slope] = self.scheduled(time_s, middle_s);
        match self.mode {
            Mode::Speed => Target { position: 0.0, rate: value },
            Mode::Position => Target { position: value, rate: slope },
        }
    }

    /// Its numbers in a line, in the SI units of these `dimensions`.
    pub(crate) fn told(&self, dimensions: &Dimensions) -> String {
        let mode = MODES.iter().find(|(_, mode)| *mode == self.mode).map_or("", |(name, _)| name);
        let of_targets = dimensions.of_targets(self.mode).si();
        let range = |at: usize| {
            let along = || self.schedule.iter().map(move |point| point[at]);
            let (least, most) =
                (along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max));
            let [least, most] = [least, most].map(|number| (number * 1e6).round() / 1e6);
            if least == most { format!("{least}") } else { format!("{least} to {most}") }
        };
        let mut told = format!("{mode}, {} {of_targets} at {} s", range(1), range(0));
        for (name, gain, unit) in [
            ("stiffness", self.stiffness, dimensions.stiffness.si()),
            ("damping", self.damping, dimensions.damping.si()),
        ] {
            if gain > 0.0 {
                told += &format!(", {name} {gain} {unit}");
            }
        }
        match self.limit.is_finite() {
            true => told + &format!(", at most {} {}", self.limit, dimensions.force.si()),
            false => told + ", without limit",
        }
    }

    /// Value and slope at `time_s` of the line that the schedule has at `middle_s`.
    fn scheduled(&self, time_s: f64, middle_s: f64) -> [f64; 2] {
        let past = self.schedule.partition_point(|[at_s, _]| *at_s <= middle_s);
        let before = past.checked_sub(1).and_then(|place| self.schedule.get(place));
        match (before, self.schedule.get(past)) {
            (Some([from_s, from]), Some([to_s, to])) => {
                let slope = (to - from) / (to_s - from_s).max(JUMP_S);
                [from + slope * (time_s - from_s), slope]
            }
            (Some([_, held]), None) | (None, Some([_, held])) => [*held, 0.0],
            (None, None) => [0.0; 2],
        }
    }
}

const MODES: [(&str, Mode); 2] = [("speed", Mode::Speed), ("position", Mode::Position)];

const LIMIT: Bounds =
    Bounds { min: 0.0, max: 1e6, unit: "", why: "zero or more: the largest force either way" };

/// The gains that a drive cannot be without are above 0: it would never act.
const GAIN: Bounds =
    Bounds { min: 1e-9, max: 1e9, unit: "", why: "above 0: a drive pushes towards its target" };

const DAMPING: Bounds =
    Bounds { min: 0.0, max: 1e9, unit: "", why: "zero or more: a drive pushes towards its target" };

/// Points that are nearer in time are a jump: no step is that short, and a slope stays finite.
const JUMP_S: f64 = 1e-9;

/// Targets of any kind.
const TARGET: Bounds = Bounds { min: -1e4, max: 1e4, unit: "", why: "in case of a wrong unit" };

/// Times of a schedule: from the start, in four months.
const TIME: Bounds = Bounds { min: 0.0, max: 1e7, unit: "s", why: "seconds since the start of the run" };

/// Dimensions of a drive's numbers.
pub(crate) struct Dimensions {
    position: Dimension,
    speed: Dimension,
    stiffness: Dimension,
    damping: Dimension,
    force: Dimension,
}

impl Dimensions {
    fn of_targets(&self, mode: Mode) -> Dimension {
        match mode {
            Mode::Speed => self.speed,
            Mode::Position => self.position,
        }
    }
}

/// Dimensions of a revolute joint.
pub(crate) const ROTARY: Dimensions = Dimensions {
    position: ANGLE,
    speed: SPEED,
    stiffness: ROTARY_STIFFNESS,
    damping: ROTARY_DAMPING,
    force: TORQUE,
};

/// Dimensions of a prismatic joint.
pub(crate) const LINEAR: Dimensions = Dimensions {
    position: LENGTH,
    speed: VELOCITY,
    stiffness: LINEAR_STIFFNESS,
    damping: LINEAR_DAMPING,
    force: FORCE,
};

/// Reads the table `drive` of a joint, whose numbers have these `dimensions`.
pub(crate) fn parse(section: &Section, dimensions: &Dimensions) -> Result<Drive, Diagnostic> {
    let mut faults = Faults::default();
    let known = section.require_known(&["mode", "limit", "stiffness", "damping", "schedule"]);
    let mode = faults.keep(section.choice("mode", &MODES));
    let limit = faults.keep(match section.has("limit") {
        true => section.bounded("limit", dimensions.force, &LIMIT),
        false => Ok(f64::INFINITY),
    });
    // The gains and the unit of the schedule are those of the mode.
    let of_mode = mode.and_then(|mode| {
        let gains = faults.keep(gains(section, mode, dimensions));
        let points = section.schedule("schedule", dimensions.of_targets(mode), [&TIME, &TARGET]);
        gains.zip(faults.keep(points))
    });
    faults.keep(known);
    let drive = (|| {
        let (mode, limit, ([stiffness, damping], schedule)) = (mode?, limit?, of_mode?);
        Some(Drive { mode, stiffness, damping, limit, schedule })
    })();
    faults.finish(drive)
}

/// Stiffness and damping: of a speed the damping alone, of a position the stiffness and, where it is given, a damping.
fn gains(section: &Section, mode: Mode, dimensions: &Dimensions) -> Result<[f64; 2], Diagnostic> {
    let (has_stiffness, has_damping) = (section.has("stiffness"), section.has("damping"));
    match mode {
        Mode::Speed if has_stiffness => {
            let found = "mode \"speed\", which has no position to hold; remove it, or change `mode`";
            let (at, key) = (section.at_of("stiffness"), section.key("stiffness"));
            Err(section.doc.bad(&at, &key, "a gain of mode \"position\"", found))
        }
        Mode::Speed => Ok([0.0, section.bounded("damping", dimensions.damping, &GAIN)?]),
        Mode::Position => {
            let mut faults = Faults::default();
            let stiffness = faults.keep(section.bounded("stiffness", dimensions.stiffness, &GAIN));
            let damping = faults.keep(match has_damping {
                true => section.bounded("damping", dimensions.damping, &DAMPING),
                false => Ok(0.0),
            });
            faults.finish((|| Some([stiffness?, damping?]))())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_linear_between_points_and_jumps_where_two_have_one_time() {
        let schedule = vec![[1.0, 2.0], [3.0, 6.0], [3.0, -1.0]];
        let drive = Drive { mode: Mode::Position, stiffness: 1.0, damping: 0.0, limit: 1.0, schedule };
        let found = [0.0, 1.0, 1.5, 3.0, 9.0].map(|time_s| drive.target(time_s));
        let expected = [(2.0, 0.0), (2.0, 2.0), (3.0, 2.0), (-1.0, 0.0), (-1.0, 0.0)];
        assert_eq!(found, expected.map(|(position, rate)| Target { position, rate }));
        // A step that ends at the jump has the line before it, one that begins there the line behind it.
        assert_eq!(drive.target_of_step(3.0, 2.75), Target { position: 6.0, rate: 2.0 });
        assert_eq!(drive.target_of_step(3.0, 3.25), Target { position: -1.0, rate: 0.0 });
        let steep = Drive { schedule: vec![[0.0, 0.0], [f64::MIN_POSITIVE, 1.0]], ..drive.clone() };
        assert!(steep.target(0.0).rate.is_finite() && steep.target(0.0).position == 0.0);
        let speed = Drive { mode: Mode::Speed, ..drive };
        assert_eq!(speed.target(1.5), Target { position: 0.0, rate: 3.0 });
    }
}
