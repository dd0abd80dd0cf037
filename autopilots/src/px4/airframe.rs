//! PX4's parameters: the user's, and behind them those that follow from the vehicle, which count more.
//!
//! PX4 computes its mixer from the places, axes and moments of the rotors (module `control_allocator`), so that any vehicle can be
//! described; axes forward, right, down.

use crate::parameter_lines;
use diagnostics::ParameterError;
use std::fmt::Write as _;
use vehicles::Vehicle;

/// Function of an output that drives the first motor; those of the next motors follow.
const FIRST_MOTOR: usize = 101;
/// The geometry is that of the rotors alone (`CA_AIRFRAME`: multirotor).
const MULTIROTOR: usize = 0;

/// Parameters that the user's may replace: no log, whose folder goes with the run; one estimator, since there is one of each sensor.
const FIRST: [(&str, i32); 3] = [("SDLOG_MODE", -1), ("SENS_IMU_MODE", 1), ("EKF2_MULTI_IMU", 0)];

/// Commands of the start-up script that set the user's parameters of `configured` and those of `vehicle`.
///
/// # Errors
/// Lines are not a name and a number.
pub fn script(configured: &str, vehicle: &Vehicle) -> Result<String, ParameterError> {
    let mut text = String::new();
    let mut set = |name: &str, value: &dyn std::fmt::Display| {
        let _ = writeln!(text, "param set {name} {value}");
    };
    for (name, value) in FIRST {
        set(name, &value);
    }
    for (name, value) in parameter_lines::read(configured)? {
        set(name, &value);
    }
    set("CA_AIRFRAME", &MULTIROTOR);
    set("CA_ROTOR_COUNT", &vehicle.rotors.len());
    // Torque of a thrust, m. PX4 counts it as positive where the rotor turns counter-clockwise. `torque_scale` is left out on
    // purpose: the physics has it, and no controller knows it.
    let moment_m = vehicle.torque_coefficient / vehicle.thrust_coefficient;
    for (at, rotor) in vehicle.rotors.iter().enumerate() {
        let (position_m, axis) = (rotor.position_m, rotor.axis);
        let numbers = [
            ("PX", position_m.x),
            ("PY", -position_m.y),
            ("PZ", -position_m.z),
            ("AX", axis.x),
            ("AY", -axis.y),
            ("AZ", -axis.z),
            ("KM", rotor.spin * moment_m),
        ];
        for (name, value) in numbers {
            // No negative zero.
            set(&format!("CA_ROTOR{at}_{name}"), &format!("{:.6}", value + 0.0));
        }
        set(&format!("PWM_MAIN_FUNC{}", at + 1), &(FIRST_MOTOR + at));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotors_keep_their_order_and_the_vehicle_counts_last() {
        let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let text = script("# gains\nMC_ROLL_P 3.5\nCA_ROTOR_COUNT 6\n", &vehicle).unwrap();
        assert!(text.starts_with("param set SDLOG_MODE -1\n"), "{text}");
        assert!(text.contains("param set MC_ROLL_P 3.5\nparam set CA_ROTOR_COUNT 6\n"), "{text}");
        let last = |name: &str| -> f64 {
            let begin = format!("param set {name} ");
            text.lines().rev().find_map(|line| line.strip_prefix(&begin)).unwrap().parse().unwrap()
        };
        assert_eq!(last("CA_ROTOR_COUNT"), 4.0);
        // Front, right, rear, left; the right one turns counter-clockwise, and lies along the positive y.
        assert_eq!(
            [last("CA_ROTOR0_PX"), last("CA_ROTOR0_PY"), last("CA_ROTOR0_KM")],
            [0.17, 0.0, -0.035229]
        );
        assert_eq!([last("CA_ROTOR1_PX"), last("CA_ROTOR1_PY"), last("CA_ROTOR1_KM")], [0.0, 0.17, 0.035229]);
        assert_eq!([last("CA_ROTOR2_PX"), last("CA_ROTOR3_PY")], [-0.17, -0.17]);
        assert_eq!([last("CA_ROTOR3_AX"), last("CA_ROTOR3_AY"), last("CA_ROTOR3_AZ")], [0.0, 0.0, -1.0]);
        assert_eq!([last("PWM_MAIN_FUNC1"), last("PWM_MAIN_FUNC4")], [101.0, 104.0]);
        assert!(!text.contains("-0.000000"), "{text}");
    }

    /// Betaflight and ArduPilot have no frame for five rotors.
    #[test]
    fn five_rotors_are_described() {
        let mut vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let fifth = vehicle.rotors[0].clone();
        vehicle.rotors.push(fifth);
        let text = script("", &vehicle).unwrap();
        for line in ["CA_ROTOR_COUNT 5\n", "CA_ROTOR4_PX 0.170000\n", "PWM_MAIN_FUNC5 105\n"] {
            assert!(text.contains(&format!("param set {line}")), "{line}: {text}");
        }
    }

    #[test]
    fn lines_that_are_no_parameters_are_refused() {
        let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let error = script("MC_ROLL_P", &vehicle).unwrap_err().to_string();
        assert!(error.starts_with("line 1: expected a name"), "{error}");
    }
}
