//! The weights of the `lqr` controller: `controllers/gains/lqr.toml` and files like it.

use crate::disturbance::Observer;
use diagnostics::unit::{ANGLE, Dimension, LENGTH, SPEED, TORQUE, VELOCITY};

const FORCE: Dimension = Dimension::of("force", &[("N", 1.0)]);

gains! {
    /// Deviations that are worth one unit of cost each, and limits.
    pub struct LqrGains of file, built in "lqr.toml" {
        /// Of position, m.
        position_m: f64 = file.limit("states.position", LENGTH),
        /// Of velocity, m/s.
        velocity_m_s: f64 = file.limit("states.velocity", VELOCITY),
        /// Of roll and pitch, rad.
        tilt_rad: f64 = file.limit("states.tilt", ANGLE),
        /// Of yaw, rad.
        yaw_rad: f64 = file.limit("states.yaw", ANGLE),
        /// Of the rates of roll and pitch, rad/s.
        tilt_rate_rad_s: f64 = file.limit("states.tilt_rate", SPEED),
        /// Of the rate of yaw, rad/s.
        yaw_rate_rad_s: f64 = file.limit("states.yaw_rate", SPEED),
        /// Of the demanded thrust, N.
        thrust_N: f64 = file.limit("demands.thrust", FORCE),
        /// Of the demanded torque of roll and pitch, N·m.
        tilt_torque_N_m: f64 = file.limit("demands.tilt_torque", TORQUE),
        /// Of the demanded torque of yaw, N·m.
        yaw_torque_N_m: f64 = file.limit("demands.yaw_torque", TORQUE),
        /// The greatest error of position that is answered, m.
        position_max_m: f64 = file.limit("limits.position", LENGTH),
        /// The greatest error of velocity that is answered, m/s.
        velocity_max_m_s: f64 = file.limit("limits.velocity", VELOCITY),
        /// The observer of disturbances.
        observer: Observer = Observer::read(&file.table("disturbance")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gains_file::parse;

    #[test]
    fn the_built_in_file_is_read_in_si() {
        let gains = LqrGains::load(&inputs::InputFiles::default(), None).unwrap();
        assert_eq!((gains.position_m, gains.tilt_rad), (0.15, 10.0_f64.to_radians()));
    }

    #[test]
    fn what_is_wrong_with_a_file_is_named_with_its_place() {
        let cases = [
            ("value = 0.15, unit = \"m\"", "value = 0.0, unit = \"m\"", "`states.position`"),
            ("unit = \"N*m\"", "unit = \"N\"", "a unit of torque: \"N*m\""),
            ("bandwidth = { value = 4.0", "bandwidth = { value = 5000", "`disturbance.bandwidth`"),
            ("[limits]", "[limits]\ntilt = 1", "unknown key `limits.tilt`"),
        ];
        for (from, to, expected) in cases {
            let text = LqrGains::BUILT_IN.replacen(from, to, 1);
            let error = parse(&text, "l.toml", LqrGains::read).unwrap_err().to_string();
            assert!(error.starts_with("l.toml:") && error.contains(expected), "{error}");
        }
    }
}
