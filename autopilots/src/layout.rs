//! Finds the motor output of each rotor from the rotors' places and spins, and the firmware's numbering.

use crate::settings;
use bus::context::NodeContext;
use vehicles::{Rotor, Vehicle};

/// A motor of a frame: its angle from the front, clockwise seen from above, in degrees, and whether it turns clockwise.
pub type Motor = (f64, bool);

/// A frame of a firmware: its name, and its motors in the firmware's order.
pub type Frame = (&'static str, &'static [Motor]);

/// A rotor stands in a motor's place up to this part of the angle between two neighbours.
const PLACE: f64 = 25.0 / 90.0;

/// Mixers count on equal arms and upright rotors: warned of is a longest arm of more than this multiple of the shortest, and an axis
/// that leans by more than this, degrees. Tuned, no source: the integrators of a firmware balance less.
const ARMS_MAX: f64 = 1.5;
const LEAN_MAX_DEG: f64 = 20.0;

/// A frame, and the rotor of each of its motors.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Name of the frame.
    pub frame: &'static str,
    /// Rotor of each motor output, counted from 0.
    pub motors: Vec<usize>,
    /// True if every rotor turns against the frame's convention.
    pub is_reversed: bool,
}

impl Layout {
    /// The layout of `rotors` in one of `frames`.
    ///
    /// # Errors
    /// No frame has rotors in these places with these spins.
    pub fn of(rotors: &[Rotor], frames: &[Frame]) -> Result<Self, String> {
        let placed =
            frames.iter().find_map(|(frame, motors)| Some((*frame, *motors, assigned(rotors, motors)?)));
        let Some((frame, motors, order)) = placed else {
            let names: Vec<&str> = frames.iter().map(|(name, _)| *name).collect();
            return Err(format!("its {} rotors match none of the frames {}", rotors.len(), names.join(", ")));
        };
        let clockwise = order.iter().map(|rotor| rotors[*rotor].spin < 0.0);
        let reversed: Vec<bool> = clockwise.zip(motors).map(|(rotor, (_, motor))| rotor != *motor).collect();
        if let Some(wrong) = reversed.iter().position(|is| *is != reversed[0]) {
            let name = &rotors[order[wrong]].name;
            return Err(format!(
                "its rotors stand as those of {frame}, and `{name}` turns the other way than there"
            ));
        }
        Ok(Self { frame, is_reversed: reversed[0], motors: order })
    }

    /// Warns of rotors of `vehicle` for which the frame's mixer was not made.
    pub fn warn_of_oddities(&self, vehicle: &Vehicle, context: &NodeContext<'_>) {
        let (rotors, frame) = (&vehicle.rotors, self.frame);
        let arm_m = |at: usize| rotors[at].position_m.xy().norm();
        let by_arm = |a: &usize, b: &usize| arm_m(*a).total_cmp(&arm_m(*b));
        let extremes = (0..rotors.len()).min_by(by_arm).zip((0..rotors.len()).max_by(by_arm));
        if let Some((least, most)) = extremes.filter(|(least, most)| arm_m(*most) > ARMS_MAX * arm_m(*least))
        {
            let (least_m, most_m) = (arm_m(least), arm_m(most));
            let odd = format!(
                "has arms of {least_m:.4} m and {most_m:.4} m, and the mixer {frame} counts on equal ones"
            );
            settings::warn_of_vehicle(context, vehicle, &odd, &format!("rotors.{least}.position"));
        }
        let lean_deg = |rotor: &Rotor| libm::acos(rotor.axis.z.clamp(-1.0, 1.0)).to_degrees();
        if let Some(at) = rotors.iter().position(|rotor| lean_deg(rotor) > LEAN_MAX_DEG) {
            let (name, lean_deg) = (&rotors[at].name, lean_deg(&rotors[at]));
            let odd = format!(
                "has a rotor \"{name}\" that leans by {lean_deg:.1} degrees, and the mixer {frame} counts on upright ones"
            );
            settings::warn_of_vehicle(context, vehicle, &odd, &format!("rotors.{at}.axis"));
        }
    }
}

/// The rotor of each motor, if each rotor stands in the place of one motor alone.
fn assigned(rotors: &[Rotor], motors: &[Motor]) -> Option<Vec<usize>> {
    if rotors.len() != motors.len() {
        return None;
    }
    let angle_max_deg = PLACE * 360.0 / motors.len() as f64;
    let near = |angle_deg: f64| {
        let (right, forward) = libm::sincos(angle_deg.to_radians());
        rotors.iter().position(|rotor| {
            let at = rotor.position_m;
            let angle_rad = libm::atan2(at.y * forward + at.x * right, at.x * forward - at.y * right);
            at.xy().norm() > 0.0 && angle_rad.to_degrees().abs() <= angle_max_deg
        })
    };
    let order: Vec<usize> = motors.iter().map(|(angle_deg, _)| near(*angle_deg)).collect::<Option<_>>()?;
    (0..rotors.len()).all(|rotor| order.contains(&rotor)).then_some(order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::betaflight::mixers::MIXERS;
    use vehicles::Vehicle;

    fn hummingbird() -> Vehicle {
        Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap()
    }

    #[test]
    fn rotors_are_found_in_any_order_and_turned_by_an_eighth() {
        let mut rotors = hummingbird().rotors;
        rotors.reverse();
        assert_eq!(Layout::of(&rotors, &MIXERS).unwrap().motors, [1, 2, 0, 3]);
        let turn = nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), 45_f64.to_radians());
        rotors.iter_mut().for_each(|rotor| rotor.position_m = turn * rotor.position_m);
        // What was in front is front left, and turns clockwise, as there.
        let layout = Layout::of(&rotors, &MIXERS).unwrap();
        assert_eq!((layout.frame, layout.is_reversed), ("QUADX", false));
        assert_eq!(
            layout.motors.iter().map(|rotor| &*rotors[*rotor].name).collect::<Vec<_>>(),
            ["rear", "right", "left", "front"]
        );
    }

    #[test]
    fn spins_may_all_be_reversed_but_not_one() {
        let mut rotors = hummingbird().rotors;
        rotors.iter_mut().for_each(|rotor| rotor.spin = -rotor.spin);
        assert!(Layout::of(&rotors, &MIXERS).unwrap().is_reversed);
        rotors[3].spin = -rotors[3].spin;
        let error = Layout::of(&rotors, &MIXERS).unwrap_err();
        assert!(error.contains("QUADP") && error.contains("`left`"), "{error}");
        rotors.pop();
        assert!(Layout::of(&rotors, &MIXERS).unwrap_err().contains("its 3 rotors"));
    }
}
