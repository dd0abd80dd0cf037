//! Joints, which tie free bodies to the world, to each other and to the vehicle.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::drive::{self, Drive};
use crate::rig::PLACE;
use diagnostics::parameter::Bounds;
use diagnostics::unit::{ANGLE, LENGTH, LINEAR_DAMPING, PURE_NUMBER, ROTARY_DAMPING};
use diagnostics::{Diagnostic, Faults};
use nalgebra::Vector3;
use vehicles::reader::{Quantity, Section};

/// Body at an end of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The ground and everything that stands still.
    World,
    /// The vehicle of the run.
    Vehicle,
    /// The free body with this place among [`Scene::bodies`](crate::Scene::bodies).
    Body(usize),
}

/// Freedom that a joint leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Freedom {
    /// Nothing.
    Fixed,
    /// Any rotation.
    Ball,
    /// The rotation about an axis, by an angle from 0 at the start.
    Revolute(Axis),
    /// The motion along an axis, by a way from 0 at the start.
    Prismatic(Axis),
    /// Everything, as far as the two anchors are not farther apart than this.
    Rope {
        /// The most that the anchors are apart.
        length_m: f64,
        /// The anchor on the child; that on the parent is the joint's.
        end_W_m: Vector3<f64>,
    },
}

/// An axis and how far a joint moves on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Its direction at the start, a unit vector.
    pub along_W: Vector3<f64>,
    /// The least and the most of the angle, rad, or the way, m; infinite where there is no stop.
    pub limits: [f64; 2],
}

/// A joint between two of a scene.
///
/// ```
/// use scenes::{End, Freedom};
///
/// let scene = scenes::Scene::parse(scenes::reference::SLUNG_LOAD, "slung-load.toml")?;
/// let rope = &scene.joints[0];
/// assert_eq!((rope.parent, rope.child), (End::Vehicle, End::Body(0)));
/// assert!(matches!(rope.freedom, Freedom::Rope { length_m: 0.8, .. }), "{rope:?}");
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Its name in the file.
    pub name: String,
    /// Body from which the axis and the angles are seen.
    pub parent: End,
    /// Body that moves on it.
    pub child: End,
    /// Point at which the two meet at the start: in the world; or as seen from the vehicle, for bodies that
    /// hang from it.
    pub anchor_W_m: Vector3<f64>,
    /// Freedom that it leaves.
    pub freedom: Freedom,
    /// Viscous friction of the free motion: N m s of rotations, N s/m of a way.
    pub damping: f64,
    /// Motor of a revolute or a prismatic joint, if it has one.
    pub drive: Option<Drive>,
}

impl Joint {
    /// Its drive in a line, in SI units, if it has one.
    ///
    /// ```
    /// let scene = scenes::Scene::parse(scenes::reference::DRIVEN_JOINTS, "driven-joints.toml")?;
    /// let told = scene.joints[0].driven().unwrap();
    /// assert_eq!(told, "spindle: speed, 0 to 2 rad/s at 0 to 1 s, damping 1.8 N*m*s/rad, at most 2 N*m");
    /// # Ok::<(), diagnostics::Diagnostic>(())
    /// ```
    #[must_use]
    pub fn driven(&self) -> Option<String> {
        let dimensions = match self.freedom {
            Freedom::Revolute(_) => &drive::ROTARY,
            Freedom::Prismatic(_) => &drive::LINEAR,
            Freedom::Fixed | Freedom::Ball | Freedom::Rope { .. } => return None,
        };
        Some(format!("{}: {}", self.name, self.drive.as_ref()?.told(dimensions)))
    }
}

/// Two points nearer than a millimetre are one to a rope.
const ROPE: Bounds = Bounds { min: 1e-3, max: 1e4, unit: "m", why: "a millimetre to 10 km" };

const DAMPING: Bounds =
    Bounds { min: 0.0, max: 1e6, unit: "", why: "zero or more: a joint that drives itself makes energy" };

/// A limit of a prismatic joint.
const WAY: Bounds = Bounds { min: -1e4, max: 1e4, unit: "m", why: "10 km to either side" };

/// A limit of a revolute joint: within a turn angles are told without doubt.
const TURN: Bounds =
    Bounds { min: -3.1, max: 3.1, unit: "rad", why: "less than half a turn to either side, 177 deg" };

/// Kind of a freedom, to be looked up.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Fixed,
    Ball,
    Revolute,
    Prismatic,
    Rope,
}

const KINDS: [(&str, Kind); 5] = [
    ("fixed", Kind::Fixed),
    ("ball", Kind::Ball),
    ("revolute", Kind::Revolute),
    ("prismatic", Kind::Prismatic),
    ("rope", Kind::Rope),
];

/// Reads a table of `[[joints]]` in a scene with these `bodies`; see `scenes/slung-load.toml`.
pub(crate) fn parse(section: &Section, bodies: &[&str]) -> Result<Joint, Diagnostic> {
    let ends = ["name", "kind", "parent", "child", "anchor"];
    let of_kinds = ["axis", "lower", "upper", "length", "end", "damping", "drive"];
    let mut faults = Faults::default();
    let known = section.require_known(&[&ends[..], &of_kinds].concat());
    let name = faults.keep(section.text("name"));
    let kind = faults.keep(section.choice("kind", &KINDS));
    let parent = faults.keep(end(section, "parent", bodies));
    let child = faults.keep(end(section, "child", bodies));
    if let Some((parent, child)) = parent.zip(child) {
        faults.keep(refuse_pair(section, parent, child));
    }
    let anchor_W_m = faults.keep(section.vector("anchor", LENGTH, &PLACE));
    let freedom = kind.and_then(|kind| faults.keep(freedom_of(section, kind)));
    let damping = kind.and_then(|kind| faults.keep(damping_of(section, kind)));
    let drive = kind.and_then(|kind| faults.keep(drive_of(section, kind)));
    // Without a kind, the keys of all kinds are known; with one, those that were read.
    faults.keep(known.and_then(|()| if kind.is_some() { section.finish() } else { Ok(()) }));
    let joint = (|| {
        Some(Joint {
            name: name?.to_owned(),
            parent: parent?,
            child: child?,
            anchor_W_m: anchor_W_m?.into(),
            freedom: freedom?,
            damping: damping?,
            drive: drive?,
        })
    })();
    faults.finish(joint)
}

fn freedom_of(section: &Section, kind: Kind) -> Result<Freedom, Diagnostic> {
    let freedom = match kind {
        Kind::Fixed => Freedom::Fixed,
        Kind::Ball => Freedom::Ball,
        Kind::Revolute => Freedom::Revolute(axis(section, |name| section.quantity(name, ANGLE), &TURN)?),
        Kind::Prismatic => Freedom::Prismatic(axis(section, |name| section.quantity(name, LENGTH), &WAY)?),
        Kind::Rope => {
            let mut faults = Faults::default();
            let length_m = faults.keep(section.bounded("length", LENGTH, &ROPE));
            let end_W_m = faults.keep(section.vector("end", LENGTH, &PLACE));
            let (length_m, end_W_m) = faults.finish(length_m.zip(end_W_m))?;
            Freedom::Rope { length_m, end_W_m: end_W_m.into() }
        }
    };
    Ok(freedom)
}

fn damping_of(section: &Section, kind: Kind) -> Result<f64, Diagnostic> {
    match (section.has("damping"), kind) {
        (true, Kind::Ball | Kind::Revolute) => section.bounded("damping", ROTARY_DAMPING, &DAMPING),
        (true, Kind::Prismatic) => section.bounded("damping", LINEAR_DAMPING, &DAMPING),
        (true, Kind::Fixed | Kind::Rope) => {
            let found = "a joint that has none to damp";
            Err(refused(section, "damping", "kind ball, revolute or prismatic", found))
        }
        (false, _) => Ok(0.0),
    }
}

/// The table `drive` of a joint of this `kind`, if it has one.
fn drive_of(section: &Section, kind: Kind) -> Result<Option<Drive>, Diagnostic> {
    let dimensions = match kind {
        _ if !section.has("drive") => return Ok(None),
        Kind::Revolute => &drive::ROTARY,
        Kind::Prismatic => &drive::LINEAR,
        Kind::Fixed | Kind::Ball | Kind::Rope => {
            let found = format!(
                "one of kind \"{}\", which has no axis to drive; remove it, or change `kind`",
                section.text("kind")?
            );
            return Err(refused(
                section,
                "drive",
                "a table of a joint of kind revolute or prismatic",
                &found,
            ));
        }
    };
    drive::parse(&section.section("drive")?, dimensions).map(Some)
}

fn refused(section: &Section, key: &str, expected: &str, found: &str) -> Diagnostic {
    section.doc.bad(&section.at_of(key), &section.key(key), expected, found)
}

fn end(section: &Section, key: &'static str, bodies: &[&str]) -> Result<End, Diagnostic> {
    let text = section.text(key)?;
    let body = bodies.iter().position(|name| *name == text).map(End::Body);
    let fixed = [("world", End::World), ("vehicle", End::Vehicle)];
    let fixed = fixed.into_iter().find_map(|(name, end)| (name == text).then_some(end));
    body.or(fixed).ok_or_else(|| {
        let names: Vec<_> = bodies.iter().map(|name| format!("\"{name}\"")).collect();
        let expected = "\"world\", \"vehicle\", or a thing of this scene that has a `mass`";
        let found = match &names[..] {
            [] => format!("\"{text}\"; nothing has a `mass` here"),
            names => format!("\"{text}\"; these have a `mass`: {}", names.join(", ")),
        };
        refused(section, key, expected, &found)
    })
}

fn refuse_pair(section: &Section, parent: End, child: End) -> Result<(), Diagnostic> {
    if child == End::World {
        return Err(refused(
            section,
            "child",
            "\"vehicle\" or a thing with a `mass`",
            "\"world\": swap the two",
        ));
    }
    if parent == child {
        return Err(refused(section, "child", "another than `parent`", "the same"));
    }
    Ok(())
}

fn axis<'d, 't>(
    section: &Section<'d, 't>,
    limit: impl Fn(&'static str) -> Result<Quantity<'d, 't>, Diagnostic>,
    bounds: &Bounds,
) -> Result<Axis, Diagnostic> {
    let unit = Bounds { min: -1e6, max: 1e6, unit: "1", why: "a direction: its length does not matter" };
    let mut faults = Faults::default();
    let along_W = faults.keep(section.vector("axis", PURE_NUMBER, &unit).and_then(|along_W| {
        let along_W = Vector3::from(along_W).try_normalize(1e-6);
        along_W.ok_or_else(|| refused(section, "axis", "a direction", "three zeros"))
    }));
    let stop = |name, otherwise: f64| match section.has(name) {
        true => Ok(limit(name)?.within(bounds)?.si),
        false => Ok(otherwise),
    };
    let lower = faults.keep(stop("lower", f64::NEG_INFINITY));
    let upper = faults.keep(stop("upper", f64::INFINITY));
    let (along_W, lower, upper) = faults.finish((|| Some((along_W?, lower?, upper?)))())?;
    let limits = [lower, upper];
    let key = if limits[0] > 0.0 { "lower" } else { "upper" };
    if limits[0] > 0.0 || limits[1] < 0.0 {
        let found = format!("{} to {} {}", limits[0], limits[1], bounds.unit);
        return Err(refused(
            section,
            key,
            "such that `lower` is at most 0 and `upper` at least 0: a joint starts at 0",
            &found,
        ));
    }
    let has_one = limits[0].is_finite() != limits[1].is_finite();
    if has_one && bounds.unit == "rad" {
        let given = if limits[0].is_finite() { "lower" } else { "upper" };
        let expected =
            "one of two limits: beyond half a turn nobody could say from which side a single one is met";
        return Err(refused(section, given, expected, "it alone; give the other too, or neither"));
    }
    Ok(Axis { along_W, limits })
}
