//! One field of one topic over time.
//!
//! A quaternion has three fields more than the message: `roll`, `pitch` and `yaw` (z-y-x sequence, in
//! radians), since that is how people judge an attitude.

use crate::definition::{DecodeError, Definition, Leaf, number};
use crate::error::RecordingError;
use crate::reader::Recording;
use bus::schema::Schema;

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
    /// The values of `fields`, given as topic and field path: a series each, read in one pass.
    ///
    /// ```no_run
    /// use recorder::reader::Recording;
    ///
    /// let recording = Recording::open("hover.mcap".as_ref())?;
    /// let series = recording.series(&[("/plant/state", "position.z"), ("/plant/state", "attitude.yaw")])?;
    /// let highest_m = series[0].value.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    /// assert!(highest_m < 1.7);
    /// # Ok::<(), recorder::RecordingError>(())
    /// ```
    ///
    /// # Errors
    /// If there is no such topic or field, or the file is damaged.
    pub fn series(&self, fields: &[(&str, &str)]) -> Result<Vec<Series>, RecordingError> {
        fields.iter().try_for_each(|(topic, _)| self.topic(topic).map(|_| ()))?;
        let mut series = vec![Series::default(); fields.len()];
        for record in self.messages() {
            let record = record?;
            let wanted = |(topic, _): &(&str, &str)| record.topic == *topic;
            if !fields.iter().any(wanted) {
                continue;
            }
            let leaves = self.decode(&record)?;
            for (series, field) in series.iter_mut().zip(fields).filter(|(_, field)| wanted(field)) {
                let unknown = || RecordingError::unknown_field(&record.topic, field.1, &leaves);
                let (value, unit) = value(&leaves, field.1).ok_or_else(unknown)?;
                series.time_ns.push(record.time_ns);
                series.value.push(value);
                unit.clone_into(&mut series.unit);
            }
        }
        Ok(series)
    }

    /// The numbers that `field` on `topic` is: itself, or the parts `x`, `y` and `z` of a vector.
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

fn parts(leaves: &[Leaf], topic: &str, field: &str) -> Result<Vec<String>, RecordingError> {
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
/// `None` where the message has strings or sequences, whose fields are known only from data.
///
/// # Errors
/// If there is no such field; the error lists those there are.
pub fn unit_of(schema: &Schema, topic: &str, field: &str) -> Result<Option<String>, RecordingError> {
    if schema.has_text() {
        return Ok(None);
    }
    let zeros = [&[0, 1, 0, 0][..], &vec![0; schema.size]].concat();
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

/// The number at `field` among `leaves` and its unit; that may be an angle of a quaternion.
#[must_use]
pub fn value<'a>(leaves: &'a [Leaf], field: &str) -> Option<(f64, &'a str)> {
    if let Some(leaf) = leaves.iter().find(|leaf| leaf.path == field) {
        return Some((leaf.value.as_f64()?, &leaf.unit));
    }
    let (quaternion, angle) = field.rsplit_once('.')?;
    let angle = ANGLES.iter().position(|name| *name == angle)?;
    let part = |name: &str| {
        let is_part =
            |path: &str| path.strip_prefix(quaternion).and_then(|rest| rest.strip_prefix('.')) == Some(name);
        leaves.iter().find(|leaf| is_part(&leaf.path))?.value.as_f64()
    };
    Some((roll_pitch_yaw([part("x")?, part("y")?, part("z")?, part("w")?])[angle], "rad"))
}

/// The angles of a quaternion, stored x, y, z, w, in the sequence z-y-x, in radians; roll and yaw from -π to π.
fn roll_pitch_yaw([x, y, z, w]: [f64; 4]) -> [f64; 3] {
    [
        libm::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        libm::asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0)),
        libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    ]
}
