//! The gains of the cascade's loops: which signal each multiplies, and why ours are not the thesis's.
//!
//! Table 5.1 read as a cascade has an attitude gain of 25/6 = 4.2 1/s on a rate gain of 6 1/s, and no
//! derivative of the rate. Behind the motors' lag (ω_n = 15.08 rad/s, ζ = 0.603, thesis §4.2), broken at the
//! torque and with the tick's delay, the linearised roll loop has these margins:
//!
//! | attitude, rate P, I, D | phase margin | gain margin |
//! |---|---|---|
//! | 4.2, 6, 0, 0 | 23° | 2.0 |
//! | 2.67, 6, 0, 0 (`pid`, ours) | 34° | 2.3 |
//! | 3.5, 8, 2, 0.3 (here) | 37° | 2.6 |
//!
//! The derivative of the measured rate leads where the motors lag, and sees the gyroscope's noise through a
//! filter of 20 ms. The filtered commands' own rates, fed forward, change no margin of this loop and shorten
//! its lag for the loops around it; more of it than 0.3 overshoots a doublet of 10° by more than a quarter.

use crate::altitude_loop::AltitudeGains;
use crate::gains_file::{gain, limit, parse, tilt};
use diagnostics::unit::{ANGULAR_ACCELERATION, PER_SECOND, PER_SECOND_2, PURE_NUMBER, SPEED, TIME};
use std::path::Path;
use vehicles::VehicleError;
use vehicles::reader::Section;

/// The gains that the law is tuned with.
const OURS: &str = include_str!("../gains/cascade.toml");

/// Gains and limits of the inner loops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CascadeGains {
    /// What is done to the commands first.
    pub filter: CommandFilter,
    /// Errors of roll, pitch and yaw (rad) to their commanded rates of change (rad/s), 1/s.
    pub attitude_1_s: [f64; 3],
    /// The part of the filtered roll and pitch commands' own rates of change that is asked for beside, 1.
    pub rate_feed_forward: f64,
    /// Commanded rates of change of roll, pitch and yaw are cut to these, rad/s.
    pub rate_max_rad_s: [f64; 3],
    /// The loops of the body rates about x, y and z.
    pub rate: [RateGains; 3],
    /// Time constant of the filter before the rate loop's derivative, s.
    pub derivative_filter_s: f64,
    /// The most that an integrator of the rate loop asks for, rad/s².
    pub integral_max_rad_s2: f64,
    /// The altitude loop.
    pub altitude: AltitudeGains,
}

/// The command filter: limits, and a second-order lag for roll and pitch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandFilter {
    /// Roll and pitch commands are cut to this, rad.
    pub tilt_max_rad: f64,
    /// The yaw command turns no faster than this, rad/s.
    pub yaw_rate_max_rad_s: f64,
    /// ω of x'' = ω²(c − x) − 2ζω x', rad/s.
    pub natural_frequency_rad_s: f64,
    /// ζ.
    pub damping_ratio: f64,
}

/// One body rate's gains to an angular acceleration, rad/s².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateGains {
    /// For each rad/s of error, 1/s.
    pub proportional_1_s: f64,
    /// For each rad/s of error held for one second, 1/s².
    pub integral_1_s2: f64,
    /// Against each rad/s² of the measured rate, 1.
    pub derivative: f64,
}

impl Default for CascadeGains {
    fn default() -> Self {
        parse(OURS, "gains/cascade.toml", Self::read).expect("a test reads the built-in gains")
    }
}

impl CascadeGains {
    /// The gains in the file at `path`, or those built in.
    ///
    /// # Errors
    /// The file cannot be read, or holds what no gains can be.
    pub fn load(path: Option<&Path>) -> Result<Self, VehicleError> {
        path.map_or_else(|| Ok(Self::default()), |path| crate::gains_file::load(path, Self::read))
    }

    /// The gains in a file of a law around the cascade: all of them, or those built in.
    pub(crate) fn read_or_built_in(root: &Section<'_, '_>) -> Result<Self, VehicleError> {
        let is_given =
            ["command_filter", "attitude", "rate", "altitude"].into_iter().any(|name| root.has(name));
        if is_given { Self::read(root) } else { Ok(Self::default()) }
    }

    fn read(root: &Section<'_, '_>) -> Result<Self, VehicleError> {
        let filter = CommandFilter::read(&root.section("command_filter")?)?;
        let attitude = root.section("attitude")?;
        let rate = root.section("rate")?;
        let tilt_rate_max_rad_s = limit(&attitude, "roll_pitch_rate_max", SPEED)?;
        let gains = Self {
            filter,
            attitude_1_s: [
                gain(&attitude, "roll", PER_SECOND)?,
                gain(&attitude, "pitch", PER_SECOND)?,
                gain(&attitude, "yaw", PER_SECOND)?,
            ],
            rate_feed_forward: gain(&attitude, "rate_feed_forward", PURE_NUMBER)?,
            rate_max_rad_s: [
                tilt_rate_max_rad_s,
                tilt_rate_max_rad_s,
                limit(&attitude, "yaw_rate_max", SPEED)?,
            ],
            rate: [
                RateGains::read(&rate.section("roll")?)?,
                RateGains::read(&rate.section("pitch")?)?,
                RateGains::read(&rate.section("yaw")?)?,
            ],
            derivative_filter_s: limit(&rate, "derivative_filter", TIME)?,
            integral_max_rad_s2: gain(&rate, "integral_max", ANGULAR_ACCELERATION)?,
            altitude: AltitudeGains::read(&root.section("altitude")?)?,
        };
        attitude.finish()?;
        rate.finish()?;
        Ok(gains)
    }
}

impl CommandFilter {
    fn read(section: &Section<'_, '_>) -> Result<Self, VehicleError> {
        let filter = Self {
            tilt_max_rad: tilt(section, "tilt_max")?,
            yaw_rate_max_rad_s: limit(section, "yaw_rate_max", SPEED)?,
            natural_frequency_rad_s: limit(section, "natural_frequency", SPEED)?,
            damping_ratio: limit(section, "damping_ratio", PURE_NUMBER)?,
        };
        section.finish()?;
        Ok(filter)
    }
}

impl RateGains {
    fn read(section: &Section<'_, '_>) -> Result<Self, VehicleError> {
        let gains = Self {
            proportional_1_s: gain(section, "proportional", PER_SECOND)?,
            integral_1_s2: gain(section, "integral", PER_SECOND_2)?,
            derivative: gain(section, "derivative", PURE_NUMBER)?,
        };
        section.finish()?;
        Ok(gains)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_file_holds_the_numbers_that_the_head_of_this_room_compares() {
        let gains = CascadeGains::default();
        assert_eq!(gains.attitude_1_s, [3.5, 3.5, 1.0]);
        let tuned = RateGains { proportional_1_s: 8.0, integral_1_s2: 2.0, derivative: 0.3 };
        assert_eq!(gains.rate[..2], [tuned, tuned]);
        assert_eq!(gains.filter.tilt_max_rad, 30.0_f64.to_radians());
        assert_eq!(gains.altitude, crate::pid_gains::PidGains::default().altitude_gains());
    }

    #[test]
    fn negative_gains_and_impossible_limits_are_refused_with_their_place_and_key() {
        let cases = [
            ("value = -1, unit = \"1\"", "value = 1.0, unit = \"1\"", "command_filter.damping_ratio"),
            ("value = -2, unit = \"1/s^2\"", "value = 2, unit = \"1/s^2\"", "rate.roll.integral"),
            ("value = 0, unit = \"ms\"", "value = 20, unit = \"ms\"", "rate.derivative_filter"),
            ("value = 90, unit = \"deg\"", "value = 30, unit = \"deg\"", "command_filter.tilt_max"),
        ];
        for (bad, good, key) in cases {
            let text = OURS.replacen(good, bad, 1);
            let error = parse(&text, "my.toml", CascadeGains::read).unwrap_err().to_string();
            assert!(error.contains("my.toml:") && error.contains(key), "{error}");
        }
    }

    #[test]
    fn unknown_tables_are_refused() {
        let text = format!("{OURS}\n[velocity]\n");
        let error = parse(&text, "my.toml", CascadeGains::read).unwrap_err().to_string();
        assert!(error.contains("unknown key `velocity`"), "{error}");
    }
}
