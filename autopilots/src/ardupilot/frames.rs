//! Frames of ArduPilot with their motors in its order (`libraries/AP_Motors/AP_MotorsMatrix.cpp`), and their numbers
//! (`AP_Motors_Class.h`).

use crate::layout::{Frame, Layout};

const QUAD_PLUS: &str = "quad plus";
const QUAD_X: &str = "quad X";
const HEXA_PLUS: &str = "hexa plus";
const HEXA_X: &str = "hexa X";
const OCTA_PLUS: &str = "octa plus";
const OCTA_X: &str = "octa X";

/// The frames.
pub const FRAMES: [Frame; 6] = [
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
        let error = numbers(&octa).unwrap_err();
        assert!(error.contains("octa X") && error.contains("each turns the other way"), "{error}");
        assert_eq!(numbers(&reversed(octa)), Ok((3, 1)));
    }

    /// In each frame the roll, pitch and yaw of all motors at once are zero, and neighbours are equally far from each other.
    #[test]
    fn frames_are_symmetric() {
        for (name, motors) in FRAMES {
            let mut angles: Vec<f64> = motors.iter().map(|(angle, _)| angle.rem_euclid(360.0)).collect();
            angles.sort_by(f64::total_cmp);
            let step = 360.0 / motors.len() as f64;
            assert!(angles.windows(2).all(|pair| pair[1] - pair[0] == step), "{name}: {angles:?}");
            let clockwise = motors.iter().filter(|(_, is_clockwise)| *is_clockwise).count();
            assert_eq!(2 * clockwise, motors.len(), "{name}");
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
            assert_ne!(found(180.0 / motors.len() as f64), Ok(name));
        }
    }
}
