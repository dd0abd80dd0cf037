//! The gains of the `geometric` controller: `controllers/gains/geometric.toml` and files like it.
//!
//! Linearised about hover and broken at the motors, the law's loop is L(s) = [(s² + k_v·s + k_p)(s² + k_Ω·s +
//! k_R) − s⁴]/s⁴ · G(s). G is the hurried lag of the motors and 1.5 ms of computing and holding. For the
//! gains of the built-in file:
//!
//! | motors | phase margin | gain margin | greatest sensitivity |
//! |---|---|---|---|
//! | as in the vehicle file | 36° | 3.2 | 1.86 |
//! | 10 % slower | 27° | 3.7 | 2.22 |

use crate::disturbance::Observer;
use crate::motor_lag::LagTarget;
use diagnostics::unit::{ACCELERATION, PER_SECOND, PER_SECOND_2};

gains! {
    /// Gains and limits of the law.
    pub struct GeometricGains of file, built in "geometric.toml" {
        /// k_p: error of position to acceleration, 1/s².
        position_proportional_1_s2: f64 = file.gain("position.proportional", PER_SECOND_2),
        /// k_v: error of velocity to acceleration, 1/s.
        position_derivative_1_s: f64 = file.gain("position.derivative", PER_SECOND),
        /// The most that all errors together ask for, m/s².
        acceleration_max_m_s2: f64 = file.limit("position.acceleration_max", ACCELERATION),
        /// k_R: error of roll and pitch to angular acceleration, 1/s².
        attitude_proportional_1_s2: f64 = file.gain("attitude.proportional", PER_SECOND_2),
        /// k_Ω: error of their rates to angular acceleration, 1/s.
        attitude_derivative_1_s: f64 = file.gain("attitude.derivative", PER_SECOND),
        /// The same for yaw, 1/s².
        yaw_proportional_1_s2: f64 = file.gain("yaw.proportional", PER_SECOND_2),
        /// The same for its rate, 1/s.
        yaw_derivative_1_s: f64 = file.gain("yaw.derivative", PER_SECOND),
        /// The poles that the motors' lag is moved to.
        motor: LagTarget = LagTarget::read(&file.table("motor")),
        /// The observer of disturbances.
        observer: Observer = Observer::read(&file.table("disturbance")),
        /// Drag for each unit of speed and mass that is fed forward, 1/s.
        drag_1_s: f64 = file.gain("drag.linear", PER_SECOND),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gains_file::parse;

    #[test]
    fn the_built_in_file_is_read_in_si() {
        let gains = GeometricGains::load(&inputs::InputFiles::default(), None).unwrap();
        assert_eq!(gains.position_proportional_1_s2, 9.0);
        assert_eq!(gains.motor.natural_frequency_rad_s, 50.0);
    }

    #[test]
    fn what_is_wrong_with_a_file_is_named_with_its_place() {
        let cases = [
            ("value = 9.0", "value = -9.0", "`position.proportional` must be a finite number, 0 or more"),
            ("value = 50.0, unit = \"rad/s\"", "value = 0, unit = \"rad/s\"", "`motor.natural_frequency`"),
            ("value = 50.0, unit = \"rad/s\"", "value = 5000, unit = \"rad/s\"", "below 200 rad/s"),
            ("value = 6.0, unit = \"rad/s\"", "value = 5000, unit = \"rad/s\"", "`disturbance.bandwidth`"),
            ("linear = ", "quadratic = 1\nlinear = ", "unknown key `drag.quadratic`"),
        ];
        for (from, to, expected) in cases {
            let error = parse(&GeometricGains::BUILT_IN.replace(from, to), "g.toml", GeometricGains::read)
                .unwrap_err()
                .to_string();
            assert!(error.starts_with("g.toml:") && error.contains(expected), "{error}");
        }
    }
}
