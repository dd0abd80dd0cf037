//! The numbers that a field of a message is drawn as, and the units that people read them in.

use recorder::definition::Leaf;
use recorder::series::roll_pitch_yaw;
use std::f64::consts::{PI, TAU};

/// The angles that a quaternion is drawn as.
const ANGLES: [&str; 3] = ["roll", "pitch", "yaw"];

/// One number of a message, over time.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Field path.
    pub path: String,
    /// Unit that it is drawn in.
    pub unit: String,
    source: Source,
    factor: f64,
    continued: Option<Continued>,
}

/// Where the number is among the leaves of a message.
#[derive(Clone, Copy, Debug)]
enum Source {
    Leaf(usize),
    /// Part of [`ANGLES`] of the quaternion in these leaves.
    Angle([usize; 4], usize),
}

/// The channels of `field` in a message with these leaves: one for a number, three angles for a quaternion, and one
/// for each number of anything else. `None` where there is no such field.
pub fn channels(leaves: &[Leaf], field: &str) -> Option<Vec<Channel>> {
    let find = |path: &str| leaves.iter().position(|leaf| leaf.path == path && leaf.value.as_f64().is_some());
    if let Some(index) = find(field) {
        return Some(vec![Channel::new(field, &leaves[index].unit, Source::Leaf(index))]);
    }
    let quaternion = |path: &str| {
        let parts = ["x", "y", "z", "w"].map(|part| find(&format!("{path}.{part}")));
        let [Some(x), Some(y), Some(z), Some(w)] = parts else { return None };
        Some([x, y, z, w])
    };
    let angle = |path: &str, parts, angle: usize| {
        Channel::new(&format!("{path}.{}", ANGLES[angle]), "rad", Source::Angle(parts, angle))
    };
    if let Some(parts) = quaternion(field) {
        return Some((0..3).map(|index| angle(field, parts, index)).collect());
    }
    if let Some((path, last)) = field.rsplit_once('.') {
        let index = ANGLES.iter().position(|angle| *angle == last);
        if let (Some(index), Some(parts)) = (index, quaternion(path)) {
            return Some(vec![angle(path, parts, index)]);
        }
    }
    let inside = |leaf: &Leaf| leaf.path.strip_prefix(field).is_some_and(|rest| rest.starts_with(['.', '[']));
    let numbers = leaves.iter().enumerate().filter(|(_, leaf)| inside(leaf) && leaf.value.as_f64().is_some());
    let channels = numbers.map(|(index, leaf)| Channel::new(&leaf.path, &leaf.unit, Source::Leaf(index)));
    let channels: Vec<_> = channels.collect();
    (!channels.is_empty()).then_some(channels)
}

/// The unit in which a field of unit `unit` is drawn.
fn shown_unit<'a>(path: &str, unit: &'a str) -> &'a str {
    match unit {
        "rad/s" if path.contains("rotor_speed") => "rpm",
        "rad/s" => "deg/s",
        "rad" => "deg",
        "" => "1",
        unit => unit,
    }
}

impl Channel {
    fn new(path: &str, unit: &str, source: Source) -> Self {
        let shown = shown_unit(path, unit);
        let is_angle = unit == "rad";
        Self {
            path: path.to_owned(),
            unit: shown.to_owned(),
            source,
            // No unit becomes the unit 1, which changes no number.
            factor: diagnostics::convert(unit, shown).unwrap_or(1.0),
            continued: is_angle.then(Continued::default),
        }
    }

    /// The number in a message with these leaves, in the unit that is shown; NaN where the message has it not.
    pub fn value(&mut self, leaves: &[Leaf]) -> f64 {
        let number =
            |index: usize| leaves.get(index).and_then(|leaf| leaf.value.as_f64()).unwrap_or(f64::NAN);
        let value = match self.source {
            Source::Leaf(index) => number(index),
            Source::Angle(parts, angle) => roll_pitch_yaw(parts.map(number))[angle],
        };
        self.continued.as_mut().map_or(value, |continued| continued.next(value)) * self.factor
    }
}

/// An angle without jumps: one that leaves ±π goes on beyond instead of coming back from the other side.
#[derive(Clone, Copy, Debug, Default)]
struct Continued {
    last: Option<f64>,
    turns: f64,
}

impl Continued {
    fn next(&mut self, angle: f64) -> f64 {
        if angle.is_finite() {
            let jump = angle - self.last.unwrap_or(angle);
            // A step by less than half a turn was asked for; a longer one is the same angle counted otherwise.
            if jump.abs() > PI {
                self.turns -= (jump / TAU).round();
            }
            self.last = Some(angle);
        }
        angle + self.turns * TAU
    }
}

#[cfg(test)]
mod tests {
    use super::{Channel, Continued, channels};
    use bus::Message;
    use bus::messages::{PlantState, PoseStamped, Quaternion};
    use recorder::definition::{Definition, Leaf};

    fn leaves<T: Message>(message: &T) -> Vec<Leaf> {
        let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(message)].concat();
        Definition::parse(T::SCHEMA.type_name, &T::SCHEMA.ros2_definition()).unwrap().decode(&cdr).unwrap()
    }

    fn described(channels: Option<Vec<Channel>>) -> Vec<(String, String)> {
        channels.unwrap().into_iter().map(|channel| (channel.path, channel.unit)).collect()
    }

    fn pairs(expected: &[(&str, &str)]) -> Vec<(String, String)> {
        expected.iter().map(|(path, unit)| ((*path).to_owned(), (*unit).to_owned())).collect()
    }

    #[test]
    fn vectors_arrays_and_quaternions_become_channels_in_the_units_that_people_read() {
        let leaves = leaves(&PlantState::default());
        let found = |field: &str| described(channels(&leaves, field));
        let position = [("position.x", "m"), ("position.y", "m"), ("position.z", "m")];
        assert_eq!(found("position"), pairs(&position));
        let angles = [("attitude.roll", "deg"), ("attitude.pitch", "deg"), ("attitude.yaw", "deg")];
        assert_eq!(found("attitude"), pairs(&angles));
        assert_eq!(found("attitude.yaw"), pairs(&angles[2..]));
        assert_eq!(found("attitude.w"), pairs(&[("attitude.w", "1")]));
        assert_eq!(found("angular_velocity.x"), pairs(&[("angular_velocity.x", "deg/s")]));
        assert_eq!(found("rotor_speed[2]"), pairs(&[("rotor_speed[2]", "rpm")]));
        assert_eq!(found("rotor_speed").len(), 4);
        assert!(channels(&leaves, "positio").is_none() && channels(&leaves, "rotor_speed[4]").is_none());
    }

    #[test]
    fn text_is_no_channel() {
        let leaves = leaves(&PoseStamped::default());
        assert!(channels(&leaves, "header.frame_id").is_none());
        assert_eq!(channels(&leaves, "pose.orientation").unwrap().len(), 3);
    }

    #[test]
    fn values_are_in_the_unit_that_is_shown() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let attitude = Quaternion { x: half, y: 0.0, z: 0.0, w: half };
        let state =
            PlantState { attitude, rotor_speed: [100.0 * std::f64::consts::PI; 4], ..Default::default() };
        let leaves = leaves(&state);
        let first = |field: &str| channels(&leaves, field).unwrap()[0].value(&leaves);
        assert!((first("attitude.roll") - 90.0).abs() < 1e-9);
        assert!((first("rotor_speed") - 3000.0).abs() < 1e-9);
    }

    #[test]
    fn an_angle_goes_on_beyond_half_a_turn() {
        let mut continued = Continued::default();
        let whole: Vec<f64> = (0..100).map(|step| 3.0 + 0.1 * f64::from(step)).collect();
        for angle in whole {
            let wrapped = libm::atan2(libm::sin(angle), libm::cos(angle));
            assert!((continued.next(wrapped) - angle).abs() < 1e-9);
            assert!(continued.next(f64::NAN).is_nan());
        }
    }
}
