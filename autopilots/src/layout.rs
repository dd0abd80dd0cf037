//! Finds the motor output of each rotor from the rotors' places and spins, and the firmware's numbering.

use vehicles::Rotor;

/// A motor of a mixer: its direction from the centre (forward, left), and whether it turns clockwise seen from above.
type Motor = ([f64; 2], bool);

/// Mixers of Betaflight by the names of its command line, with their motors in its order (`src/main/flight/mixer_init.c`).
const MIXERS: [(&str, &[Motor]); 4] = [
    ("QUADX", &[([-1.0, -1.0], true), ([1.0, -1.0], false), ([-1.0, 1.0], false), ([1.0, 1.0], true)]),
    ("QUADP", &[([-1.0, 0.0], true), ([0.0, -1.0], false), ([0.0, 1.0], false), ([1.0, 0.0], true)]),
    (
        "HEX6X",
        &[
            ([-0.866, -0.5], false),
            ([0.866, -0.5], false),
            ([-0.866, 0.5], true),
            ([0.866, 0.5], true),
            ([0.0, -1.0], true),
            ([0.0, 1.0], false),
        ],
    ),
    (
        "HEX6",
        &[
            ([-0.5, -0.866], false),
            ([0.5, -0.866], true),
            ([-0.5, 0.866], false),
            ([0.5, 0.866], true),
            ([1.0, 0.0], false),
            ([-1.0, 0.0], true),
        ],
    ),
];

/// A rotor stands in a motor's place up to this angle, in degrees.
const ANGLE_MAX_DEG: f64 = 25.0;

/// A mixer, and the rotor of each of its motors.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Name in Betaflight's command line.
    pub mixer: &'static str,
    /// Rotor of each motor output, counted from 0.
    pub motors: Vec<usize>,
    /// True where every rotor turns against the mixer's convention.
    pub is_reversed: bool,
}

impl Layout {
    /// The layout of `rotors`.
    ///
    /// # Errors
    /// No mixer has rotors in these places with these spins.
    pub fn of(rotors: &[Rotor]) -> Result<Self, String> {
        let placed =
            MIXERS.iter().find_map(|(mixer, motors)| Some((*mixer, *motors, assigned(rotors, motors)?)));
        let Some((mixer, motors, order)) = placed else {
            let names: Vec<&str> = MIXERS.iter().map(|(name, _)| *name).collect();
            return Err(format!("its {} rotors match none of the mixers {}", rotors.len(), names.join(", ")));
        };
        let clockwise = order.iter().map(|rotor| rotors[*rotor].spin < 0.0);
        let reversed: Vec<bool> = clockwise.zip(motors).map(|(rotor, (_, mixer))| rotor != *mixer).collect();
        if reversed.iter().any(|is| *is != reversed[0]) {
            let wrong = reversed.iter().position(|is| *is != reversed[0]).unwrap_or(0);
            let name = &rotors[order[wrong]].name;
            return Err(format!(
                "its rotors stand as those of {mixer}, and `{name}` turns the other way than there"
            ));
        }
        Ok(Self { mixer, is_reversed: reversed[0], motors: order })
    }
}

/// The rotor of each motor, if each rotor stands in the place of one motor alone.
fn assigned(rotors: &[Rotor], motors: &[Motor]) -> Option<Vec<usize>> {
    if rotors.len() != motors.len() {
        return None;
    }
    let near = |[forward, left]: [f64; 2]| {
        rotors.iter().position(|rotor| {
            let at = rotor.position_m;
            let angle_rad = libm::atan2(at.y * forward - at.x * left, at.x * forward + at.y * left);
            at.xy().norm() > 0.0 && angle_rad.to_degrees().abs() <= ANGLE_MAX_DEG
        })
    };
    let order: Vec<usize> = motors.iter().map(|(place, _)| near(*place)).collect::<Option<_>>()?;
    (0..rotors.len()).all(|rotor| order.contains(&rotor)).then_some(order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vehicles::Vehicle;

    fn hummingbird() -> Vehicle {
        Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap()
    }

    #[test]
    fn rotors_are_found_in_any_order_and_turned_by_an_eighth() {
        let mut rotors = hummingbird().rotors;
        rotors.reverse();
        assert_eq!(Layout::of(&rotors).unwrap().motors, [1, 2, 0, 3]);
        let turn = nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), 45_f64.to_radians());
        rotors.iter_mut().for_each(|rotor| rotor.position_m = turn * rotor.position_m);
        // What was in front is front left, and turns clockwise, as there.
        let layout = Layout::of(&rotors).unwrap();
        assert_eq!((layout.mixer, layout.is_reversed), ("QUADX", false));
        assert_eq!(
            layout.motors.iter().map(|rotor| &*rotors[*rotor].name).collect::<Vec<_>>(),
            ["rear", "right", "left", "front"]
        );
    }

    #[test]
    fn spins_may_all_be_reversed_but_not_one() {
        let mut rotors = hummingbird().rotors;
        rotors.iter_mut().for_each(|rotor| rotor.spin = -rotor.spin);
        assert!(Layout::of(&rotors).unwrap().is_reversed);
        rotors[3].spin = -rotors[3].spin;
        let error = Layout::of(&rotors).unwrap_err();
        assert!(error.contains("QUADP") && error.contains("`left`"), "{error}");
        rotors.pop();
        assert!(Layout::of(&rotors).unwrap_err().contains("its 3 rotors"));
    }
}
