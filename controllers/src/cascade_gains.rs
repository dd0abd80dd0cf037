//! The gains of the cascade's loops: the signal that each multiplies, and the reason why ours are not the thesis's.
//!
//! Table 5.1 read as a cascade has an attitude gain of 25/6 = 4.2 1/s on a rate gain of 6 1/s, and no
//! derivative of the rate. The linearised roll loop has these margins behind the motors' lag
//! (ω_n = 15.08 rad/s, ζ = 0.603, thesis §4.2). The loop is broken at the torque and has the tick's delay:
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
use crate::gains_file::Table;
use diagnostics::unit::{ANGULAR_ACCELERATION, PER_SECOND, PER_SECOND_2, PURE_NUMBER, SPEED, TIME};

gains! {
    /// Gains and limits of the inner loops.
    pub struct CascadeGains of file, built in "cascade.toml" {
        /// Filter of the commands.
        filter: CommandFilter = CommandFilter::read(&file.table("command_filter")),
        /// Errors of roll, pitch and yaw (rad) to their commanded rates of change (rad/s), 1/s.
        attitude_1_s: [f64; 3] = ["attitude.roll", "attitude.pitch", "attitude.yaw"].map(|key| file.gain(key, PER_SECOND)),
        /// The part of the filtered roll and pitch commands' own rates of change that is asked for beside, 1.
        rate_feed_forward: f64 = file.gain("attitude.rate_feed_forward", PURE_NUMBER),
        /// Commanded rates of change of roll, pitch and yaw are cut to these, rad/s.
        rate_max_rad_s: [f64; 3] = ["roll_pitch_rate_max", "roll_pitch_rate_max", "yaw_rate_max"]
            .map(|key| file.table("attitude").limit(key, SPEED)),
        /// The loops of the body rates about x, y and z.
        rate: [RateGains; 3] = ["rate.roll", "rate.pitch", "rate.yaw"].map(|axis| RateGains::read(&file.table(axis))),
        /// Time constant of the filter before the rate loop's derivative, s.
        derivative_filter_s: f64 = file.limit("rate.derivative_filter", TIME),
        /// The most that an integrator of the rate loop asks for, rad/s².
        integral_max_rad_s2: f64 = file.gain("rate.integral_max", ANGULAR_ACCELERATION),
        /// The altitude loop.
        altitude: AltitudeGains = AltitudeGains::read(&file.table("altitude")),
    }
}

gains! {
    /// The command filter: limits, and a second-order lag for roll and pitch.
    pub struct CommandFilter of file {
        /// Roll and pitch commands are cut to this, rad; half a turn cuts none.
        tilt_max_rad: f64 = file.tilt_or_turn("tilt_max"),
        /// The yaw command turns no faster than this, rad/s.
        yaw_rate_max_rad_s: f64 = file.limit("yaw_rate_max", SPEED),
        /// ω of x'' = ω²(c − x) − 2ζω x', rad/s.
        natural_frequency_rad_s: f64 = file.limit("natural_frequency", SPEED),
        /// ζ.
        damping_ratio: f64 = file.limit("damping_ratio", PURE_NUMBER),
    }
}

gains! {
    /// One body rate's gains to an angular acceleration, rad/s².
    pub struct RateGains of file {
        /// For each rad/s of error, 1/s.
        proportional_1_s: f64 = file.gain("proportional", PER_SECOND),
        /// For each rad/s of error held for one second, 1/s².
        integral_1_s2: f64 = file.gain("integral", PER_SECOND_2),
        /// Against each rad/s² of the measured rate, 1.
        derivative: f64 = file.gain("derivative", PURE_NUMBER),
    }
}

impl CascadeGains {
    /// The gains in a file of a law around the cascade: all of them, or those built in.
    pub(crate) fn read_or_built_in(file: &Table<'_, '_>) -> Self {
        let is_given =
            ["command_filter", "attitude", "rate", "altitude"].into_iter().any(|name| file.has(name));
        if is_given { Self::read(file) } else { Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gains_file::parse;

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
            let text = CascadeGains::BUILT_IN.replacen(good, bad, 1);
            let error = parse(&text, "my.toml", CascadeGains::read).unwrap_err().to_string();
            assert!(error.contains("my.toml:") && error.contains(key), "{error}");
        }
    }

    #[test]
    fn unknown_tables_are_refused() {
        let text = format!("{}\n[velocity]\n", CascadeGains::BUILT_IN);
        let error = parse(&text, "my.toml", CascadeGains::read).unwrap_err().to_string();
        assert!(error.contains("unknown key `velocity`"), "{error}");
    }
}
