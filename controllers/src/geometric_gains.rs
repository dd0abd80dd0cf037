//! The gains of the `geometric` controller: `controllers/gains/geometric.toml` and files like it.
//!
//! Linearised about hover the law's loop is broken at the motors by
//! L(s) = [(s² + k_v·s + k_p)(s² + k_Ω·s + k_R) − s⁴]/s⁴ · G(s), where G is the hurried lag of the motors and 1.5 ms of
//! computing and holding. For the gains of the built-in file:
//!
//! | motors | phase margin | gain margin | greatest sensitivity |
//! |---|---|---|---|
//! | as in the vehicle file | 36° | 3.2 | 1.86 |
//! | 10 % slower | 27° | 3.7 | 2.22 |

use crate::disturbance::Observer;
use crate::gains_file::{self, bandwidth, gain, limit};
use crate::motor_lag::LagTarget;
use diagnostics::unit::{ACCELERATION, PER_SECOND, PER_SECOND_2, PURE_NUMBER};
use std::path::Path;
use vehicles::VehicleError;
use vehicles::reader::Section;

/// The gains that serve where the manifest names no file.
const BUILT_IN: &str = include_str!("../gains/geometric.toml");

/// Gains and limits of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeometricGains {
    /// k_p: error of position to acceleration, 1/s².
    pub position_proportional_1_s2: f64,
    /// k_v: error of velocity to acceleration, 1/s.
    pub position_derivative_1_s: f64,
    /// The most that all errors together ask for, m/s².
    pub acceleration_max_m_s2: f64,
    /// k_R: error of roll and pitch to angular acceleration, 1/s².
    pub attitude_proportional_1_s2: f64,
    /// k_Ω: error of their rates to angular acceleration, 1/s.
    pub attitude_derivative_1_s: f64,
    /// The same for yaw, 1/s².
    pub yaw_proportional_1_s2: f64,
    /// The same for its rate, 1/s.
    pub yaw_derivative_1_s: f64,
    /// The poles that the motors' lag is moved to.
    pub motor: LagTarget,
    /// The observer of disturbances.
    pub observer: Observer,
    /// Drag for each unit of speed and mass that is fed forward, 1/s.
    pub drag_1_s: f64,
}

impl GeometricGains {
    /// The gains in the file at `path`, or those built in.
    ///
    /// # Errors
    /// The file cannot be read, or lacks a number, or has one that cannot be meant.
    pub fn load(path: Option<&Path>) -> Result<Self, VehicleError> {
        match path {
            Some(path) => gains_file::load(path, read),
            None => Self::parse(BUILT_IN, "controllers/gains/geometric.toml"),
        }
    }

    /// The gains in `text`; `file_name` is for messages only.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(text: &str, file_name: &str) -> Result<Self, VehicleError> {
        gains_file::parse(text, file_name, read)
    }
}

fn read(root: &Section<'_, '_>) -> Result<GeometricGains, VehicleError> {
    let (position, attitude, yaw) =
        (root.section("position")?, root.section("attitude")?, root.section("yaw")?);
    let (motor, drag) = (root.section("motor")?, root.section("drag")?);
    let gains = GeometricGains {
        position_proportional_1_s2: gain(&position, "proportional", PER_SECOND_2)?,
        position_derivative_1_s: gain(&position, "derivative", PER_SECOND)?,
        acceleration_max_m_s2: limit(&position, "acceleration_max", ACCELERATION)?,
        attitude_proportional_1_s2: gain(&attitude, "proportional", PER_SECOND_2)?,
        attitude_derivative_1_s: gain(&attitude, "derivative", PER_SECOND)?,
        yaw_proportional_1_s2: gain(&yaw, "proportional", PER_SECOND_2)?,
        yaw_derivative_1_s: gain(&yaw, "derivative", PER_SECOND)?,
        motor: LagTarget {
            natural_frequency_rad_s: bandwidth(&motor, "natural_frequency")?,
            damping_ratio: limit(&motor, "damping_ratio", PURE_NUMBER)?,
        },
        observer: Observer::read(&root.section("disturbance")?)?,
        drag_1_s: gain(&drag, "linear", PER_SECOND)?,
    };
    [position, attitude, yaw, motor, drag].iter().try_for_each(Section::finish)?;
    Ok(gains)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_file_is_read_in_si() {
        let gains = GeometricGains::load(None).unwrap();
        assert_eq!(gains.position_proportional_1_s2, 9.0);
        assert_eq!(gains.motor.natural_frequency_rad_s, 50.0);
    }

    #[test]
    fn what_is_wrong_with_a_file_is_named_with_its_place() {
        let cases = [
            ("value = 9.0", "value = -9.0", "`position.proportional`: expected a number of 0 or above"),
            ("value = 50.0, unit = \"rad/s\"", "value = 0, unit = \"rad/s\"", "`motor.natural_frequency`"),
            ("value = 50.0, unit = \"rad/s\"", "value = 5000, unit = \"rad/s\"", "below 200 rad/s"),
            ("value = 6.0, unit = \"rad/s\"", "value = 5000, unit = \"rad/s\"", "`disturbance.bandwidth`"),
            ("linear = ", "quadratic = 1\nlinear = ", "unknown key `drag.quadratic`"),
        ];
        for (from, to, expected) in cases {
            let error = GeometricGains::parse(&BUILT_IN.replace(from, to), "g.toml").unwrap_err().to_string();
            assert!(error.starts_with("g.toml:") && error.contains(expected), "{error}");
        }
    }
}
