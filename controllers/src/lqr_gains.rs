//! The weights of the `lqr` controller: `controllers/gains/lqr.toml` and files like it.
#![allow(non_snake_case, reason = "_N names the newton")]

use crate::disturbance::Observer;
use crate::gains_file::{self, limit};
use diagnostics::unit::{ANGLE, Dimension, LENGTH, SPEED, TORQUE, VELOCITY};
use std::path::Path;
use vehicles::VehicleError;
use vehicles::reader::Section;

/// The weights that serve where the manifest names no file.
const BUILT_IN: &str = include_str!("../gains/lqr.toml");

const FORCE: Dimension = Dimension { name: "force", units: &[("N", 1.0)] };

/// Deviations that are worth one unit of cost each, and limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LqrGains {
    /// Of position, m.
    pub position_m: f64,
    /// Of velocity, m/s.
    pub velocity_m_s: f64,
    /// Of roll and pitch, rad.
    pub tilt_rad: f64,
    /// Of yaw, rad.
    pub yaw_rad: f64,
    /// Of the rates of roll and pitch, rad/s.
    pub tilt_rate_rad_s: f64,
    /// Of the rate of yaw, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Of the demanded thrust, N.
    pub thrust_N: f64,
    /// Of the demanded torque of roll and pitch, N·m.
    pub tilt_torque_N_m: f64,
    /// Of the demanded torque of yaw, N·m.
    pub yaw_torque_N_m: f64,
    /// The greatest error of position that is answered, m.
    pub position_max_m: f64,
    /// The greatest error of velocity that is answered, m/s.
    pub velocity_max_m_s: f64,
    /// The observer of disturbances.
    pub observer: Observer,
}

impl LqrGains {
    /// The weights in the file at `path`, or those built in.
    ///
    /// # Errors
    /// The file cannot be read, or lacks a number, or has one that cannot be meant.
    pub fn load(path: Option<&Path>) -> Result<Self, VehicleError> {
        match path {
            Some(path) => gains_file::load(path, read),
            None => gains_file::parse(BUILT_IN, "controllers/gains/lqr.toml", read),
        }
    }
}

fn read(root: &Section<'_, '_>) -> Result<LqrGains, VehicleError> {
    let (states, demands, limits) =
        (root.section("states")?, root.section("demands")?, root.section("limits")?);
    let gains = LqrGains {
        position_m: limit(&states, "position", LENGTH)?,
        velocity_m_s: limit(&states, "velocity", VELOCITY)?,
        tilt_rad: limit(&states, "tilt", ANGLE)?,
        yaw_rad: limit(&states, "yaw", ANGLE)?,
        tilt_rate_rad_s: limit(&states, "tilt_rate", SPEED)?,
        yaw_rate_rad_s: limit(&states, "yaw_rate", SPEED)?,
        thrust_N: limit(&demands, "thrust", FORCE)?,
        tilt_torque_N_m: limit(&demands, "tilt_torque", TORQUE)?,
        yaw_torque_N_m: limit(&demands, "yaw_torque", TORQUE)?,
        position_max_m: limit(&limits, "position", LENGTH)?,
        velocity_max_m_s: limit(&limits, "velocity", VELOCITY)?,
        observer: Observer::read(&root.section("disturbance")?)?,
    };
    [states, demands, limits].iter().try_for_each(Section::finish)?;
    Ok(gains)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_file_is_read_in_si() {
        let gains = LqrGains::load(None).unwrap();
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
            let text = BUILT_IN.replacen(from, to, 1);
            let error = gains_file::parse(&text, "l.toml", read).unwrap_err().to_string();
            assert!(error.starts_with("l.toml:") && error.contains(expected), "{error}");
        }
    }
}
