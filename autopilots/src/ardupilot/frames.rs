//! Frames of ArduPilot with their motors in its order (`libraries/AP_Motors/AP_MotorsMatrix.cpp`), and their numbers
//! (`AP_Motors_Class.h`). Of several orders of one frame, one is here: the order of the outputs is ours to choose.

use crate::layout::{Frame, Layout};

const QUAD_PLUS: &str = "quad plus";
const QUAD_X: &str = "quad X";
const HEXA_PLUS: &str = "hexa plus";
const HEXA_X: &str = "hexa X";
const OCTA_PLUS: &str = "octa plus";
const OCTA_X: &str = "octa X";
/// Places of the octa X, with all spins reversed: in Copter since 4.1.
const OCTA_DJI_X: &str = "octa DJI X";
const OCTAQUAD_PLUS: &str = "octaquad plus";
const OCTAQUAD_X: &str = "octaquad X";
const Y6: &str = "Y6";
const DODECAHEXA_PLUS: &str = "dodecahexa plus";
const DODECAHEXA_X: &str = "dodecahexa X";

/// The frames.
pub const FRAMES: [Frame; 12] = [
    (QUAD_X, &[(45.0, false), (-135.0, false), (-45.0, true), (135.0, true)]),
    (QUAD_PLUS, &[(90.0, false), (-90.0, false), (0.0, true), (180.0, true)]),
    (HEXA_X, &[(90.0, true), (-90.0, false), (-30.0, true), (150.0, false), (30.0, false), (-150.0, true)]),
    (HEXA_PLUS, &[(0.0, true), (180.0, false), (-120.0, true), (60.0, false), (-60.0, false), (120.0, true)]),
    (
        OCTA_X,
        &[
            (22.5, true),
            (-157.5, true),
            (67.5, false),
            (157.5, false),
            (-22.5, false),
            (-112.5, false),
            (-67.5, true),
            (112.5, true),
        ],
    ),
    (
        OCTA_PLUS,
        &[
            (0.0, true),
            (180.0, true),
            (45.0, false),
            (135.0, false),
            (-45.0, false),
            (-135.0, false),
            (-90.0, true),
            (90.0, true),
        ],
    ),
    (
        OCTA_DJI_X,
        &[
            (22.5, false),
            (-22.5, true),
            (-67.5, false),
            (-112.5, true),
            (-157.5, false),
            (157.5, true),
            (112.5, false),
            (67.5, true),
        ],
    ),
    // Coaxial pairs.
    (
        OCTAQUAD_PLUS,
        &[
            (0.0, false),
            (-90.0, true),
            (180.0, false),
            (90.0, true),
            (-90.0, false),
            (0.0, true),
            (90.0, false),
            (180.0, true),
        ],
    ),
    (
        OCTAQUAD_X,
        &[
            (45.0, false),
            (-45.0, true),
            (-135.0, false),
            (135.0, true),
            (-45.0, false),
            (45.0, true),
            (135.0, false),
            (-135.0, true),
        ],
    ),
    (Y6, &[(60.0, false), (-60.0, true), (-60.0, false), (180.0, true), (60.0, true), (180.0, false)]),
    (
        DODECAHEXA_PLUS,
        &[
            (0.0, false),
            (0.0, true),
            (60.0, true),
            (60.0, false),
            (120.0, false),
            (120.0, true),
            (180.0, true),
            (180.0, false),
            (-120.0, false),
            (-120.0, true),
            (-60.0, true),
            (-60.0, false),
        ],
    ),
    (
        DODECAHEXA_X,
        &[
            (30.0, false),
            (30.0, true),
            (90.0, true),
            (90.0, false),
            (150.0, false),
            (150.0, true),
            (-150.0, true),
            (-150.0, false),
            (-90.0, false),
            (-90.0, true),
            (-30.0, true),
            (-30.0, false),
        ],
    ),
];

/// Values of `FRAME_CLASS` and `FRAME_TYPE`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameNumbers {
    /// Number of rotors.
    pub class: u8,
    /// Their places and spins.
    pub kind: u8,
}

impl FrameNumbers {
    /// The numbers of a layout among [`FRAMES`].
    ///
    /// # Errors
    /// Its rotors turn against the frame, and ArduPilot has no frame for that.
    pub fn of(layout: &Layout) -> Result<Self, String> {
        let (class, kind) = match (layout.frame, layout.is_reversed) {
            (QUAD_PLUS, false) => (1, 0),
            (QUAD_X, false) => (1, 1),
            // The H: places of the X, with all spins reversed.
            (QUAD_X, true) => (1, 3),
            // The plus with all spins reversed.
            (QUAD_PLUS, true) => (1, 6),
            (HEXA_PLUS, false) => (2, 0),
            (HEXA_X, false) => (2, 1),
            (OCTA_PLUS, false) => (3, 0),
            (OCTA_X, false) => (3, 1),
            (OCTA_DJI_X, false) => (3, 13),
            (OCTAQUAD_PLUS, false) => (4, 0),
            (OCTAQUAD_X, false) => (4, 1),
            (Y6, false) => (5, 1),
            (DODECAHEXA_PLUS, false) => (12, 0),
            (DODECAHEXA_X, false) => (12, 1),
            (frame, _) => {
                let reason =
                    format!("its rotors stand as those of {frame}, and each turns the other way than there");
                return Err(reason);
            }
        };
        Ok(Self { class, kind })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vehicles::{Rotor, Vehicle};

    fn vehicle(name: &str) -> Vehicle {
        let path = format!("{}/../vehicles/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        Vehicle::parse(&std::fs::read_to_string(path).unwrap(), name).unwrap()
    }

    fn reversed(mut rotors: Vec<Rotor>) -> Vec<Rotor> {
        rotors.iter_mut().for_each(|rotor| rotor.spin = -rotor.spin);
        rotors
    }

    fn numbers(rotors: &[Rotor]) -> Result<(u8, u8), String> {
        let numbers = FrameNumbers::of(&Layout::of(rotors, &FRAMES)?)?;
        Ok((numbers.class, numbers.kind))
    }

    #[test]
    fn vehicles_find_their_frames() {
        let hummingbird = vehicle("hummingbird");
        assert_eq!(numbers(&hummingbird.rotors), Ok((1, 0)));
        let layout = Layout::of(&hummingbird.rotors, &FRAMES).unwrap();
        let names: Vec<&str> = layout.motors.iter().map(|rotor| &*hummingbird.rotors[*rotor].name).collect();
        assert_eq!(names, ["right", "left", "front", "rear"]);
        assert_eq!(numbers(&reversed(hummingbird.rotors)), Ok((1, 6)));
        let octa = vehicle("tarot-t18").rotors;
        assert_eq!(numbers(&octa), Ok((3, 13)));
        let layout = Layout::of(&octa, &FRAMES).unwrap();
        let names: Vec<&str> = layout.motors.iter().map(|rotor| &*octa[*rotor].name).collect();
        let counter_clockwise_from_the_front_right = [
            "front right",
            "front left",
            "left front",
            "left rear",
            "rear left",
            "rear right",
            "right rear",
            "right front",
        ];
        assert_eq!(names, counter_clockwise_from_the_front_right);
        assert_eq!(numbers(&reversed(octa)), Ok((3, 1)));
        let hexa = vehicle("dji-f550").rotors;
        assert_eq!(numbers(&hexa), Ok((2, 1)));
        let layout = Layout::of(&hexa, &FRAMES).unwrap();
        assert_eq!(layout.motors, [0, 1, 2, 3, 4, 5], "motors of PX4 and ArduPilot have the same order");
        let error = numbers(&reversed(hexa)).unwrap_err();
        assert!(error.contains("hexa X") && error.contains("each turns the other way"), "{error}");
    }

    /// In each frame the roll, pitch and yaw of all motors at once are zero, and neighbours are equally far from each other;
    /// in a coaxial pair one motor turns each way.
    #[test]
    fn frames_are_symmetric() {
        for (name, motors) in FRAMES {
            let at = |is_clockwise: bool| motors.iter().filter(move |motor| motor.1 == is_clockwise);
            let mut angles: Vec<f64> = motors.iter().map(|(angle, _)| angle.rem_euclid(360.0)).collect();
            angles.sort_by(f64::total_cmp);
            angles.dedup();
            let places = angles.len();
            let step = 360.0 / places as f64;
            assert!(angles.windows(2).all(|pair| pair[1] - pair[0] == step), "{name}: {angles:?}");
            assert_eq!(2 * at(true).count(), motors.len(), "{name}");
            if places < motors.len() {
                let has_its_pair = |(angle, _): &(f64, bool)| at(false).any(|(other, _)| other == angle);
                assert!(2 * places == motors.len() && at(true).all(has_its_pair), "{name}");
            }
        }
    }

    /// Turned by half of the angle between two neighbours, a frame is the other one of its class.
    #[test]
    fn plus_and_x_are_told_apart_by_their_angles() {
        for (name, motors) in FRAMES {
            let rotors = vehicle("hummingbird").rotors;
            let placed = |turn_deg: f64| -> Vec<Rotor> {
                let rotor = |(angle_deg, is_clockwise): &(f64, bool)| {
                    let (right, forward) = libm::sincos((angle_deg + turn_deg).to_radians());
                    let mut rotor = rotors[0].clone();
                    rotor.position_m = nalgebra::Vector3::new(forward, -right, 0.0);
                    rotor.spin = if *is_clockwise { -1.0 } else { 1.0 };
                    rotor
                };
                motors.iter().map(rotor).collect()
            };
            let found = |turn_deg: f64| Layout::of(&placed(turn_deg), &FRAMES).map(|layout| layout.frame);
            assert_eq!(found(0.0), Ok(name));
            assert_eq!(found(5.0), Ok(name));
            let layout = Layout::of(&placed(0.0), &FRAMES).unwrap();
            assert!(
                layout.motors.iter().copied().eq(0..motors.len()) && !layout.is_reversed,
                "{name}: {layout:?}"
            );
            let mut angles: Vec<f64> = motors.iter().map(|(angle, _)| *angle).collect();
            angles.sort_by(f64::total_cmp);
            angles.dedup();
            assert_ne!(found(180.0 / angles.len() as f64), Ok(name));
        }
    }
}
