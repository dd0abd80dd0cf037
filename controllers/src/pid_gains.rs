//! The gains of the `pid` controller: which signal each multiplies, ours beside the thesis's.
//!
//! Table 5.1 of the thesis gives three rows of bare numbers, without units or sample time. They are read
//! here as gains from an error to an acceleration, which mass and inertia then turn into force and
//! torque: so their units are powers of 1/s and they hold for any vehicle of like agility. The derivative
//! gain multiplies the measured rate, not the error's, so that a step of the set point gives no kick.
//!
//! | gain | thesis, Table 5.1 | here | why changed |
//! |---|---|---|---|
//! | altitude | 16, 1, 10 | 12, 3, 6 | see below |
//! | roll, pitch | 25, 0, 6 | 16, 0, 6 | see below |
//! | yaw | none | 2.25, 0, 3 | the thesis gives none; critically damped at 1.5 rad/s |
//!
//! The motors' lag (ω_n = 15.08 rad/s, ζ = 0.603, thesis §4.2) sits inside every one of these loops.
//! Linearised, a loop of gains Kp and Kd behind it has the polynomial
//! s⁴/ω_n² + 2ζ·s³/ω_n + s² + Kd·s + Kp, and on that model:
//!
//! | loop | phase margin | gain margin | reversal of the command from +10° to −10° |
//! |---|---|---|---|
//! | altitude 16, 1, 10 | 24° | 1.6 | |
//! | altitude 12, 3, 6 | 40° | 2.5 | |
//! | roll 25, 0, 6 | 23° | 2.0 | swings to −14.9° |
//! | roll 16, 0, 6 | 35° | 2.4 | swings to −10.1° |
//!
//! The altitude's integral gain is raised because 1 takes 12 s to make up for a mass that is 5 % off.
//! All of ours are tuned on that model, no source.

use serde::Deserialize;

/// The gains of one loop, from an error to an acceleration (linear: m/s², angular: rad/s²).
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoopGains {
    /// Acceleration for each unit of error, 1/s².
    pub proportional_1_s2: f64,
    /// Acceleration for each unit of error held for one second, 1/s³.
    pub integral_1_s3: f64,
    /// Acceleration against each unit of measured rate, 1/s.
    pub derivative_1_s: f64,
}

impl LoopGains {
    /// Proportional (1/s²), integral (1/s³) and derivative (1/s) gain, in the thesis's order.
    const fn pid(proportional_1_s2: f64, integral_1_s3: f64, derivative_1_s: f64) -> Self {
        Self { proportional_1_s2, integral_1_s3, derivative_1_s }
    }
}

/// Gains and limits of the four loops. A loop's table is given whole or left out.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PidGains {
    /// Altitude error (m) and rate of climb (m/s) to vertical acceleration (m/s²).
    pub altitude: LoopGains,
    /// Roll error (rad) and body rate p (rad/s) to angular acceleration about body x (rad/s²).
    pub roll: LoopGains,
    /// Pitch error (rad) and body rate q (rad/s) to angular acceleration about body y (rad/s²).
    pub pitch: LoopGains,
    /// Yaw error (rad) and body rate r (rad/s) to angular acceleration about body z (rad/s²).
    pub yaw: LoopGains,
    /// The altitude's integrator rests while the vehicle climbs or sinks faster than this, m/s. Default
    /// 0.1 (tuned, no source). Without it a step of 0.5 m leaves the integrator a surplus that takes
    /// Kp/Ki to decay; a limit on the error instead would lock it out when the weight is far off.
    pub altitude_integral_climb_max_m_s: f64,
    /// The most that the altitude's integrator may ask for, m/s². Default 2 (tuned, no source): a fifth
    /// of gravity, for a mass or battery that much off.
    pub altitude_integral_max_m_s2: f64,
    /// The most that an angle's integrator may ask for, rad/s². Default 2 (tuned, no source).
    pub attitude_integral_max_rad_s2: f64,
    /// Roll and pitch commands are cut to this, rad. Default 30° (thesis §5.3, the sticks' range).
    pub tilt_command_max_rad: f64,
}

impl Default for PidGains {
    fn default() -> Self {
        Self {
            altitude: LoopGains::pid(12.0, 3.0, 6.0),
            roll: LoopGains::pid(16.0, 0.0, 6.0),
            pitch: LoopGains::pid(16.0, 0.0, 6.0),
            yaw: LoopGains::pid(2.25, 0.0, 3.0),
            altitude_integral_climb_max_m_s: 0.1,
            altitude_integral_max_m_s2: 2.0,
            attitude_integral_max_rad_s2: 2.0,
            tilt_command_max_rad: 30.0_f64.to_radians(),
        }
    }
}

impl PidGains {
    /// The thesis's own numbers (Table 5.1), with our yaw loop and limits, which it does not give.
    #[must_use]
    pub fn thesis() -> Self {
        Self {
            altitude: LoopGains::pid(16.0, 1.0, 10.0),
            roll: LoopGains::pid(25.0, 0.0, 6.0),
            pitch: LoopGains::pid(25.0, 0.0, 6.0),
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_that_is_left_out_keeps_its_default() {
        let text = "[roll]\nproportional_1_s2 = 20\nintegral_1_s3 = 0\nderivative_1_s = 7";
        let gains: PidGains = toml::from_str(text).unwrap();
        assert_eq!(gains, PidGains { roll: LoopGains::pid(20.0, 0.0, 7.0), ..PidGains::default() });
    }

    #[test]
    fn unknown_and_missing_keys_are_named() {
        let error = toml::from_str::<PidGains>("rol = 1").unwrap_err().to_string();
        assert!(error.contains("rol"), "{error}");
        let error = toml::from_str::<PidGains>("[roll]\nproportional_1_s2 = 20").unwrap_err().to_string();
        assert!(error.contains("integral_1_s3"), "{error}");
    }
}
