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
    /// The layout of `rotors` in one of `frames`. Of several with rotors in these places, that with the same spins counts, then
    /// that with all of them reversed.
    ///
    /// # Errors
    /// No frame has rotors in these places with these spins.
    pub fn of(rotors: &[Rotor], frames: &[Frame]) -> Result<Self, String> {
        let in_places = |&(frame, motors): &Frame| {
            let order = assigned(rotors, motors)?;
            Some(Placed::new(frame, order, rotors, motors))
        };
        let Some(placed) = frames.iter().filter_map(in_places).min_by_key(Placed::rank) else {
            let names: Vec<&str> = frames.iter().map(|(name, _)| *name).collect();
            return Err(format!(
                "its {} rotors match none of the frames {}; arrange them as one of these, or fly `kind = \"px4\"`, which takes rotors at any places",
                rotors.len(),
                names.join(", ")
            ));
        };
        let Placed { frame, motors, reversed } = placed;
        if let Some(wrong) = reversed.iter().position(|is| *is != reversed[0]) {
            let name = &rotors[motors[wrong]].name;
            return Err(format!(
                "its rotors stand as those of {frame}, and `{name}` turns the other way than there"
            ));
        }
        Ok(Self { frame, is_reversed: reversed[0], motors })
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

/// Rotors in the places of a frame, whatever their spins.
struct Placed {
    frame: &'static str,
    /// Rotor of each motor.
    motors: Vec<usize>,
    /// By motor, true if its rotor turns the other way.
    reversed: Vec<bool>,
}

impl Placed {
    fn new(frame: &'static str, order: Vec<usize>, rotors: &[Rotor], motors: &[Motor]) -> Self {
        let clockwise = order.iter().map(|rotor| rotors[*rotor].spin < 0.0);
        let reversed = clockwise.zip(motors).map(|(rotor, (_, motor))| rotor != *motor).collect();
        Self { frame, motors: order, reversed }
    }

    /// Order of preference: all spins as in the frame, all reversed, some reversed.
    fn rank(&self) -> u8 {
        match (self.reversed.contains(&true), self.reversed.contains(&false)) {
            (false, _) => 0,
            (true, false) => 1,
            (true, true) => 2,
        }
    }
}

/// The rotor of each motor, if each rotor stands in the place of one motor alone. Of a coaxial pair, which stands in one place, each motor gets
/// the rotor that turns as it does.
fn assigned(rotors: &[Rotor], motors: &[Motor]) -> Option<Vec<usize>> {
    if rotors.len() != motors.len() {
        return None;
    }
    let angle_max_deg = PLACE * 360.0 / motors.len() as f64;
    let is_near = |rotor: &Rotor, angle_deg: f64| {
        let (right, forward) = libm::sincos(angle_deg.to_radians());
        let at = rotor.position_m;
        let angle_rad = libm::atan2(at.y * forward + at.x * right, at.x * forward - at.y * right);
        at.xy().norm() > 0.0 && angle_rad.to_degrees().abs() <= angle_max_deg
    };
    let rotor_of = |(angle_deg, is_clockwise): &Motor| {
        let mut near = (0..rotors.len()).filter(|&rotor| is_near(&rotors[rotor], *angle_deg));
        let (first, second) = (near.next()?, near.next());
        let turns_alike = |rotor: &usize| (rotors[*rotor].spin < 0.0) == *is_clockwise;
        second.map_or(Some(first), |second| [first, second].into_iter().find(turns_alike))
    };
    let order: Vec<usize> = motors.iter().map(rotor_of).collect::<Option<_>>()?;
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

    /// Rotors at angles from the front, clockwise seen from above, each of which turns clockwise or not.
    fn rotors_at(motors: &[Motor]) -> Vec<Rotor> {
        let rotor = |(angle_deg, is_clockwise): &Motor| {
            let mut rotor = hummingbird().rotors[0].clone();
            let (right, forward) = libm::sincos(angle_deg.to_radians());
            rotor.position_m = nalgebra::Vector3::new(forward, -right, 0.0);
            rotor.spin = if *is_clockwise { -1.0 } else { 1.0 };
            rotor
        };
        motors.iter().map(rotor).collect()
    }

    #[test]
    fn every_mixer_is_found_for_its_own_rotors_in_any_order_and_balances_them() {
        for (mixer, motors) in MIXERS {
            let mut rotors = rotors_at(motors);
            assert_eq!(Layout::of(&rotors, &MIXERS).unwrap().frame, mixer);
            rotors.rotate_left(1);
            let layout = Layout::of(&rotors, &MIXERS).unwrap();
            let count = motors.len();
            let expected: Vec<usize> = (0..count).map(|motor| (motor + count - 1) % count).collect();
            assert_eq!((layout.frame, layout.motors), (mixer, expected));
            let sum = rotors.iter().map(|rotor| rotor.position_m).sum::<nalgebra::Vector3<f64>>();
            assert!(
                sum.norm() < 1e-12 && rotors.iter().map(|rotor| rotor.spin).sum::<f64>() == 0.0,
                "{mixer}"
            );
        }
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
        let error = Layout::of(&rotors, &MIXERS).unwrap_err();
        assert!(error.contains("its 3 rotors") && error.contains("fly `kind = \"px4\"`"), "{error}");
    }
}
