//! The numbers that a field of a message is drawn as, and the units that people read them in.

use recorder::definition::{Leaf, number};
use recorder::series::{ANGLES, value};
use std::f64::consts::{PI, TAU};

/// The unit of motor commands.
const COUNT: &str = "count";

/// One number of a message, over time.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Field path.
    pub path: String,
    /// Unit that it is drawn in.
    pub unit: String,
    factor: f64,
    continued: Option<Continued>,
}

/// The channels of `field` in a message with these leaves: one for a number, three angles for a quaternion, and one
/// for each number of any other value. Counts are drawn in % of `full_throttle` counts if that is given. `None` if
/// there is no such field.
pub fn channels(leaves: &[Leaf], field: &str, full_throttle: Option<f64>) -> Option<Vec<Channel>> {
    let channel = |path: &str, unit: &str| match full_throttle.filter(|_| unit == COUNT) {
        Some(full) => Channel { unit: "%".to_owned(), factor: 100.0 / full, ..Channel::new(path, unit) },
        None => Channel::new(path, unit),
    };
    if let Some((_, unit)) = value(leaves, field) {
        return Some(vec![channel(field, unit)]);
    }
    let angles = ANGLES.map(|angle| format!("{field}.{angle}"));
    if number(leaves, &format!("{field}.w")).is_some() && value(leaves, &angles[0]).is_some() {
        return Some(angles.iter().map(|angle| channel(angle, "rad")).collect());
    }
    let inside = |leaf: &Leaf| leaf.path.strip_prefix(field).is_some_and(|rest| rest.starts_with(['.', '[']));
    let numbers = leaves.iter().filter(|leaf| inside(leaf) && leaf.value.as_f64().is_some());
    let channels: Vec<_> = numbers.map(|leaf| channel(&leaf.path, &leaf.unit)).collect();
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
    fn new(path: &str, unit: &str) -> Self {
        let shown = shown_unit(path, unit);
        Self {
            path: path.to_owned(),
            unit: shown.to_owned(),
            // No unit becomes the unit 1, which changes no number.
            factor: diagnostics::convert(unit, shown).unwrap_or(1.0),
            continued: (unit == "rad").then(Continued::default),
        }
    }

    /// The number in a message with these leaves, in the unit that is shown; NaN where the message has it not.
    pub fn value(&mut self, leaves: &[Leaf]) -> f64 {
        let value = value(leaves, &self.path).map_or(f64::NAN, |(value, _)| value);
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
            // A step by less than half a turn is a real one; a longer one is the same angle counted otherwise.
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
    use bus::messages::{MotorCommand, PlantState, PoseStamped, Quaternion};
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
        let leaves = leaves(&PlantState { rotor_speed: [400.0; 4].into(), ..PlantState::default() });
        let found = |field: &str| described(channels(&leaves, field, None));
        let position = [("position.x", "m"), ("position.y", "m"), ("position.z", "m")];
        assert_eq!(found("position"), pairs(&position));
        let angles = [("attitude.roll", "deg"), ("attitude.pitch", "deg"), ("attitude.yaw", "deg")];
        assert_eq!(found("attitude"), pairs(&angles));
        assert_eq!(found("attitude.yaw"), pairs(&angles[2..]));
        assert_eq!(found("attitude.w"), pairs(&[("attitude.w", "1")]));
        assert_eq!(found("angular_velocity.x"), pairs(&[("angular_velocity.x", "deg/s")]));
        assert_eq!(found("rotor_speed[2]"), pairs(&[("rotor_speed[2]", "rpm")]));
        assert_eq!(found("rotor_speed").len(), 4);
        assert_eq!(found("velocity.u"), pairs(&[("velocity.u", "m/s")]));
        let is_none = |field: &str| channels(&leaves, field, None).is_none();
        assert!(is_none("positio") && is_none("rotor_speed[4]"));
    }

    #[test]
    fn text_is_no_channel() {
        let leaves = leaves(&PoseStamped::default());
        assert!(channels(&leaves, "header.frame_id", None).is_none());
        assert_eq!(channels(&leaves, "pose.orientation", None).unwrap().len(), 3);
    }

    #[test]
    fn values_are_in_the_unit_that_is_shown() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let attitude = Quaternion { x: half, y: 0.0, z: 0.0, w: half };
        let state = PlantState {
            attitude,
            rotor_speed: [100.0 * std::f64::consts::PI; 4].into(),
            ..Default::default()
        };
        let leaves = leaves(&state);
        let first = |field: &str| channels(&leaves, field, None).unwrap()[0].value(&leaves);
        assert!((first("attitude.roll") - 90.0).abs() < 1e-9);
        assert!((first("rotor_speed") - 3000.0).abs() < 1e-9);
    }

    #[test]
    fn a_motor_command_is_drawn_in_percent_of_full_throttle_where_that_is_known() {
        let leaves = leaves(&MotorCommand { command: [76.5; 4].into(), ..Default::default() });
        let drawn = |full_throttle| {
            let mut channels = channels(&leaves, "command", full_throttle).unwrap();
            (channels[3].value(&leaves), channels[3].unit.clone())
        };
        assert_eq!(drawn(None), (76.5, "count".to_owned()));
        assert_eq!(drawn(Some(200.0)), (38.25, "%".to_owned()));
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
