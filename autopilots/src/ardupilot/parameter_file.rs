//! The firmware's parameters: the user's, and those that follow from the vehicle, which the user's cannot undo.

use super::frames::FrameNumbers;
use crate::parameter_lines;
use diagnostics::ParameterError;
use std::fmt::Write as _;

/// Pulse of a motor that is off, and the way to full thrust, us.
pub const PULSE_MIN_US: f64 = 1000.0;
pub const PULSE_RANGE_US: f64 = 1000.0;
/// Functions of the outputs that drive the first and the ninth motor (`SERVOn_FUNCTION`, `SRV_Channel.h`); those of the motors behind
/// each follow.
const FIRST_MOTOR: usize = 33;
const NINTH_MOTOR: usize = 82;
/// Values of this component where the user has none. A firmware that is not paced takes its attitude from the simulation (10), unless
/// it is told to estimate it (3: EKF3). Its log would go with its folder, and is written by a thread whose locks its main thread awaits.
const DEFAULTS: [(&str, &str); 2] = [("AHRS_EKF_TYPE", "3"), ("LOG_BACKEND_TYPE", "0")];

/// Text of the file with the user's parameters of `configured`, for a frame of `motors` motors.
///
/// # Errors
/// Lines are not a name and a number.
pub fn text(configured: &str, frame: &FrameNumbers, motors: usize) -> Result<String, ParameterError> {
    let follows = follows(frame, motors);
    let mut lines = parameter_lines::read(configured)?;
    // The firmware does not say which one of two values of a name counts.
    lines.retain(|(name, _)| !follows.iter().any(|(other, _)| other.eq_ignore_ascii_case(name)));
    let mut text = String::new();
    let absent = DEFAULTS
        .into_iter()
        .filter(|(name, _)| !lines.iter().any(|(other, _)| other.eq_ignore_ascii_case(name)));
    let absent: Vec<_> = absent.collect();
    lines.splice(0..0, absent);
    let follows = follows.iter().map(|(name, value)| (name.as_str(), value.as_str()));
    for (name, value) in lines.into_iter().chain(follows) {
        let _ = writeln!(text, "{name} {value}");
    }
    Ok(text)
}

/// Parameters that follow from the vehicle.
fn follows(frame: &FrameNumbers, motors: usize) -> Vec<(String, String)> {
    let frame = [
        ("FRAME_CLASS", frame.class.to_string()),
        ("FRAME_TYPE", frame.kind.to_string()),
        ("MOT_PWM_MIN", PULSE_MIN_US.to_string()),
        ("MOT_PWM_MAX", (PULSE_MIN_US + PULSE_RANGE_US).to_string()),
    ];
    let frame = frame.into_iter().map(|(name, value)| (name.to_owned(), value));
    let function = |motor: usize| if motor < 8 { FIRST_MOTOR + motor } else { NINTH_MOTOR + motor - 8 };
    let outputs =
        (0..motors).map(|motor| (format!("SERVO{}_FUNCTION", motor + 1), function(motor).to_string()));
    frame.chain(outputs).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLUS: FrameNumbers = FrameNumbers { class: 1, kind: 0 };

    #[test]
    fn the_users_parameters_are_kept_but_for_those_of_the_vehicle() {
        let user =
            "# Hummingbird\n\nRC5_OPTION 153\nFRAME_TYPE,1\nSERVO2_FUNCTION=0\r\nPSC_X\t-1.5e-1  # why\n";
        let expected = "AHRS_EKF_TYPE 3\nLOG_BACKEND_TYPE 0\nRC5_OPTION 153\nPSC_X -1.5e-1\nFRAME_CLASS 1\nFRAME_TYPE 0\nMOT_PWM_MIN 1000\n\
                        MOT_PWM_MAX 2000\nSERVO1_FUNCTION 33\nSERVO2_FUNCTION 34\nSERVO3_FUNCTION 35\nSERVO4_FUNCTION 36\n";
        assert_eq!(text(user, &PLUS, 4).unwrap(), expected);
        let other = text("AHRS_EKF_TYPE 10\nLOG_BACKEND_TYPE 1\n", &PLUS, 4).unwrap();
        assert!(other.starts_with("AHRS_EKF_TYPE 10\nLOG_BACKEND_TYPE 1\nFRAME_CLASS"), "{other}");
    }

    #[test]
    fn a_dodecahexa_has_functions_of_two_ranges() {
        let text = text("", &FrameNumbers { class: 12, kind: 1 }, 12).unwrap();
        let expected = ["SERVO8_FUNCTION 40\n", "SERVO9_FUNCTION 82\n", "SERVO12_FUNCTION 85\n"];
        assert!(expected.iter().all(|line| text.contains(line)), "{text}");
    }
}
