//! One field of one topic over time.
//!
//! Some fields have additional parts, in which people judge a flight. A quaternion has the angles `roll`, `pitch` and
//! `yaw` (z-y-x sequence, in radians). A `velocity` in the world beside an `attitude` has the components `u`, `v` and
//! `w` along the body's x, y and z.

use crate::definition::{DecodeError, Definition, Leaf, number};
use crate::error::RecordingError;
use crate::reader::Recording;
use bus::schema::Schema;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Samples of a field.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Simulation times in nanoseconds.
    pub time_ns: Vec<u64>,
    /// Values.
    pub value: Vec<f64>,
    /// Unit.
    pub unit: String,
}

impl Recording {
    /// The numbers of `field` on `topic`: itself, or the parts `x`, `y` and `z` of a vector.
    ///
    /// # Errors
    /// If there is no such topic, or neither such a field nor such a vector.
    pub fn parts(&self, topic: &str, field: &str) -> Result<Vec<String>, RecordingError> {
        self.topic(topic)?;
        match self.messages().find(|record| record.as_ref().map_or(true, |record| record.topic == topic)) {
            Some(record) => parts(&self.decode(&record?)?, topic, field),
            None => Ok(vec![field.to_owned()]),
        }
    }
}

pub(crate) fn parts(leaves: &[Leaf], topic: &str, field: &str) -> Result<Vec<String>, RecordingError> {
    let vector = ["x", "y", "z"].map(|axis| format!("{field}.{axis}"));
    let is_number = |path: &str| number(leaves, path).is_some();
    match value(leaves, field) {
        Some(_) => Ok(vec![field.to_owned()]),
        None if vector.iter().all(|part| is_number(part)) && !is_number(&format!("{field}.w")) => {
            Ok(vector.into())
        }
        None => Err(RecordingError::unknown_field(topic, field, leaves)),
    }
}

/// The unit of `field` in messages of `schema`, that of its parts for a vector, known before anything is recorded;
/// `None` if the message has strings or sequences without a bound, whose fields are known only from data.
///
/// # Errors
/// If there is no such field; the error lists those there are.
pub fn unit_of(schema: &Schema, topic: &str, field: &str) -> Result<Option<String>, RecordingError> {
    if schema.has_text() {
        return Ok(None);
    }
    let zeros = [&[0, 1, 0, 0][..], &schema.zeros()].concat();
    let decoded = Definition::parse(schema.type_name, &schema.ros2_definition())
        .map_err(DecodeError::from)
        .and_then(|parsed| parsed.decode(&zeros));
    let leaves = decoded.map_err(|reason| RecordingError::Decode {
        topic: topic.to_owned(),
        type_name: schema.type_name.to_owned(),
        reason,
    })?;
    let parts = parts(&leaves, topic, field)?;
    Ok(value(&leaves, &parts[0]).map(|(_, unit)| unit.to_owned()))
}

/// The angles that a quaternion has as fields.
pub const ANGLES: [&str; 3] = ["roll", "pitch", "yaw"];

/// The components along the body's axes that a velocity has as fields.
const ALONG_BODY: [&str; 3] = ["u", "v", "w"];

/// The number at `field` among `leaves` and its unit; that may be an angle of a quaternion, or a velocity along an axis
/// of the body.
#[must_use]
pub fn value<'a>(leaves: &'a [Leaf], field: &str) -> Option<(f64, &'a str)> {
    let made = Made::of(leaves, field)?;
    Some((made.value(|&leaf| leaves[leaf].value.as_f64())?, made.unit(leaves)))
}

/// The numbers of a message of which a field is made, each a `P`: an index among its leaves, or a place in its bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Made<P> {
    /// The number itself.
    Number(P),
    /// The angle of this number of a quaternion, in the order x, y, z, w.
    Angle([P; 4], usize),
    /// The component along this axis of the body of a velocity in the world.
    AlongBody([P; 3], [P; 4], usize),
}

impl Made<usize> {
    /// The indices among `leaves` of which `field` is made.
    pub(crate) fn of(leaves: &[Leaf], field: &str) -> Option<Self> {
        if let Some(leaf) = leaves.iter().position(|leaf| leaf.path == field) {
            return Some(Self::Number(leaf));
        }
        let (whole, part) = field.rsplit_once('.')?;
        let index_in = |names: [&str; 3]| names.iter().position(|name| *name == part);
        if let Some(angle) = index_in(ANGLES) {
            return Some(Self::Angle(parts_of(leaves, whole, ["x", "y", "z", "w"])?, angle));
        }
        let axis = index_in(ALONG_BODY)?;
        let message = whole.strip_suffix("velocity").filter(|rest| rest.is_empty() || rest.ends_with('.'))?;
        let attitude = parts_of(leaves, &format!("{message}attitude"), ["x", "y", "z", "w"])?;
        Some(Self::AlongBody(parts_of(leaves, whole, ["x", "y", "z"])?, attitude, axis))
    }

    /// The unit of the field.
    pub(crate) fn unit<'a>(&self, leaves: &'a [Leaf]) -> &'a str {
        match self {
            Self::Number(leaf) => &leaves[*leaf].unit,
            Self::Angle(..) => "rad",
            Self::AlongBody(velocity, _, axis) => &leaves[velocity[*axis]].unit,
        }
    }
}

impl<P> Made<P> {
    /// The value of the field; `None` where `number` knows no number.
    pub(crate) fn value(&self, number: impl Fn(&P) -> Option<f64>) -> Option<f64> {
        match self {
            Self::Number(one) => number(one),
            Self::Angle(quaternion, angle) => Some(roll_pitch_yaw(all(quaternion, number)?)[*angle]),
            Self::AlongBody(velocity, attitude, axis) => {
                Some(along_body(all(velocity, &number)?, all(attitude, &number)?)[*axis])
            }
        }
    }

    /// The parts converted by `other`; `None` if it gives none for one of them.
    pub(crate) fn map<Q: Copy>(&self, other: impl Fn(&P) -> Option<Q>) -> Option<Made<Q>> {
        Some(match self {
            Self::Number(one) => Made::Number(other(one)?),
            Self::Angle(quaternion, angle) => Made::Angle(all(quaternion, other)?, *angle),
            Self::AlongBody(velocity, attitude, axis) => {
                Made::AlongBody(all(velocity, &other)?, all(attitude, &other)?, *axis)
            }
        })
    }
}

/// Values that `other` makes of each, if it makes something of all.
fn all<P, Q: Copy, const N: usize>(of: &[P; N], other: impl Fn(&P) -> Option<Q>) -> Option<[Q; N]> {
    let mut found = [other(of.first()?)?; N];
    for (place, one) in found.iter_mut().zip(of) {
        *place = other(one)?;
    }
    Some(found)
}

/// The indices among `leaves` of these parts of the field `whole`.
fn parts_of<const N: usize>(leaves: &[Leaf], whole: &str, names: [&str; N]) -> Option<[usize; N]> {
    let is_part = |path: &str, name: &str| {
        path.strip_prefix(whole).and_then(|rest| rest.strip_prefix('.')) == Some(name)
    };
    all(&names, |name| leaves.iter().position(|leaf| is_part(&leaf.path, name)))
}

/// A vector in the world, along the axes of a body with this attitude: the quaternion, in the order x, y, z, w, turns the
/// body's axes into the world's.
fn along_body(vector: [f64; 3], [x, y, z, w]: [f64; 4]) -> [f64; 3] {
    let to_world = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    to_world.inverse_transform_vector(&Vector3::from(vector)).into()
}

/// The angles of a quaternion, stored x, y, z, w, in the sequence z-y-x, in radians; roll and yaw from -π to π.
fn roll_pitch_yaw([x, y, z, w]: [f64; 4]) -> [f64; 3] {
    [
        libm::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        libm::asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0)),
        libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    ]
}

#[cfg(test)]
mod tests {
    use super::value;
    use crate::definition::{Definition, Leaf};
    use bus::Message;
    use bus::messages::{PlantState, Quaternion};

    fn leaves<T: Message>(message: &T) -> Vec<Leaf> {
        let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(message)].concat();
        Definition::parse(T::SCHEMA.type_name, &T::SCHEMA.ros2_definition()).unwrap().decode(&cdr).unwrap()
    }

    /// Turned by 90° to the left, the body's x points along the world's y; then by 90° about it, its y points down.
    #[test]
    fn a_velocity_beside_an_attitude_has_components_along_the_body() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let cases = [
            (Quaternion { x: 0.0, y: 0.0, z: half, w: half }, [2.0, -1.0, 3.0]),
            (Quaternion { x: -half, y: 0.0, z: 0.0, w: half }, [1.0, -3.0, 2.0]),
            (Quaternion { x: 0.0, y: half, z: 0.0, w: half }, [-3.0, 2.0, 1.0]),
        ];
        for (attitude, expected) in cases {
            let state = PlantState { attitude, velocity: [1.0, 2.0, 3.0].into(), ..PlantState::default() };
            let found =
                ["u", "v", "w"].map(|axis| value(&leaves(&state), &format!("velocity.{axis}")).unwrap().0);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
        }
        let leaves = leaves(&PlantState::default());
        assert_eq!(value(&leaves, "velocity.u").unwrap().1, "m/s");
        assert!(value(&leaves, "angular_velocity.u").is_none() && value(&leaves, "position.u").is_none());
    }
}
