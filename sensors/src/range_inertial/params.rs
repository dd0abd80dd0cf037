//! The parameters of the range-inertial estimator.

use crate::parameters::within;
use diagnostics::parameter::{ParameterError, finite, not_negative, positive};

parameters! {
    /// Uncertainties of the range finders, the IMU and the attitude, and the start of the vehicle.
    #[derive(Copy)]
    pub struct RangeInertialParams {
        /// Standard deviation of a range, m. Default 0.0104: the noise of the kind `range`, 0.01 m, and rounding
        /// to its centimetre, 0.01 m / √12.
        range_sigma_m: f64 = 0.0104 => positive,
        /// Reading of a range finder that meets nothing, m. Default 7.65, the MB1300 (thesis §5.5).
        reach_m: f64 = 7.65 => positive,
        /// Reading of a range finder for anything nearer, m. Default 0.20 (MB1300 data sheet).
        nearest_m: f64 = 0.20 => not_negative,
        /// Half angle of the beams' cones, degrees: a wall that is turned by less is met at right angles.
        /// Default 5, as of the kind `range`.
        half_angle_deg: f64 = 5.0 => within(0.0..90.0, "zero or more and below 90"),
        /// A range is left out if its beam meets the wall further than this from the right angle, rad.
        /// Default 0.6 (tuned, no source).
        incidence_max_rad: f64 = 0.6 => positive,
        /// A range further than this many standard deviations from the expected one comes from a new
        /// object: a wall that is passed, or another vehicle. Default 4 (tuned, no source), one wall in 16 000
        /// echoes.
        gate_sigma: f64 = 4.0 => positive,
        /// Time that a wall stays in sight without an echo, s. Default 0.5, five of the MB1300's readings.
        sight_hold_s: f64 = 0.5 => positive,
        /// Time constant with which the attitude estimate follows the accelerometer, s: its effect on
        /// the level acceleration is removed. Default 30, as of the kind `attitude`.
        attitude_time_constant_s: f64 = 30.0 => positive,
        /// Standard deviation of the estimated attitude, rad, by which ranges at an angle are trusted less.
        /// Default 0.01 (tuned, no source).
        attitude_sigma_rad: f64 = 0.01 => not_negative,
        /// White noise of the accelerometer, m/s²/√Hz. Default 2.0e-3, as of the kind `imu`.
        accelerometer_noise_density_m_s2_sqrt_hz: f64 = 2.0e-3 => not_negative,
        /// Random walk of the acceleration's bias, m/s³/√Hz. Default 4.0e-3: the 3.0e-3 of the kind `imu`, and
        /// gravity times its gyroscope's 1.7e-4 rad/s/√Hz, since a wrong tilt shows as acceleration.
        acceleration_bias_walk_m_s3_sqrt_hz: f64 = 4.0e-3 => not_negative,
        /// Standard deviation of the level acceleration's bias at the start, m/s². Default 0.02, which is a
        /// tilt of 0.1° (tuned, no source).
        initial_acceleration_bias_sigma_m_s2: f64 = 0.02 => not_negative,
        /// Standard deviation of the velocity at the start, which is taken for zero, m/s. Default 0.01.
        initial_velocity_sigma_m_s: f64 = 0.01 => not_negative,
        /// Standard deviation of a level velocity of the input `gps` along each axis, m/s. Default 0.074, as of the kind
        /// `gps`.
        gps_velocity_sigma_m_s: f64 = 0.074 => positive,
        /// Place of the vehicle at the start, along the world's x and y, m: the estimate's position begins
        /// there. Default 0, 0.
        initial_level_position_m: [f64; 2] = [0.0; 2] => finite,
        /// Height at the start, m. Default 0.0.
        initial_height_m: f64 = 0.0 => not_negative,
        /// Size of the room along the world's x and y, m, where it is shared with other vehicles: an echo that is not
        /// that of a wall then does not correct the velocity. Without it every object in sight is taken to
        /// stand still.
        room_m: Option<[f64; 2]> = None,
        /// With it: where the vehicle starts, from the walls at -x and -y, m.
        start_in_room_m: Option<[f64; 2]> = None,
        /// Gravity, m/s². Default 9.81 (thesis §3.1).
        gravity_m_s2: f64 = 9.81 => positive,
    }
}

impl RangeInertialParams {
    /// A room has a size and a place within it, or is not known.
    pub(super) fn validate_room(&self) -> Result<(), ParameterError> {
        let missing = |key, expected| Err(ParameterError::value(key, expected, "nothing"));
        match (self.room_m, self.start_in_room_m) {
            (Some(_), None) => return missing("start_in_room_m", "given where `room_m` is"),
            (None, Some(_)) => return missing("room_m", "given where `start_in_room_m` is"),
            _ => {}
        }
        let (sizes, starts) = (self.room_m.into_iter().flatten(), self.start_in_room_m.into_iter().flatten());
        for (size_m, start_m) in sizes.zip(starts) {
            not_negative("start_in_room_m", start_m)?;
            positive("room_m", size_m - start_m)?;
        }
        Ok(())
    }
}
