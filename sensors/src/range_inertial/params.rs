//! The parameters of the range-inertial estimator.

use diagnostics::parameter::{ParameterError, finite, not_negative, positive, require, within};

/// Uncertainties of the range finders, the IMU and the attitude, and the start of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, component::Parameters)]
#[parameters(default)]
pub struct RangeInertialParams {
    /// Standard deviation of a range.
    ///
    /// The noise of the kind `range`, 0.01 m, and rounding to its centimetre, 0.01 m / √12.
    #[parameter(default = 0.0104, check = positive)]
    pub range_sigma_m: f64,
    /// Reading of a range finder that meets nothing.
    ///
    /// The MB1300 (thesis §5.5).
    #[parameter(default = 7.65, check = positive)]
    pub reach_m: f64,
    /// Reading of a range finder for anything nearer.
    ///
    /// MB1300 data sheet.
    #[parameter(default = 0.20, check = not_negative)]
    pub nearest_m: f64,
    /// Half angle of the beams' cones: a wall that is turned by less is met at right angles.
    ///
    /// As of the kind `range`.
    #[parameter(default = 5.0, check = within(0.0..90.0, "zero or more and below 90"))]
    pub half_angle_deg: f64,
    /// A range is left out if its beam meets the wall further than this from the right angle.
    ///
    /// Tuned, no source.
    #[parameter(default = 0.6, check = positive)]
    pub incidence_max_rad: f64,
    /// A range further than this many standard deviations from the expected one comes from a new
    /// object: a wall that is passed, or another vehicle.
    ///
    /// Tuned, no source: one wall in 16 000 echoes.
    #[parameter(default = 4.0, check = positive)]
    pub gate_sigma: f64,
    /// Time that a wall stays in sight without an echo.
    ///
    /// Five of the MB1300's readings.
    #[parameter(default = 0.5, check = positive)]
    pub sight_hold_s: f64,
    /// Time constant with which the attitude estimate follows the accelerometer: its effect on the level acceleration is removed.
    ///
    /// As of the kind `attitude`.
    #[parameter(default = 30.0, check = positive)]
    pub attitude_time_constant_s: f64,
    /// Standard deviation of the estimated attitude, by which ranges at an angle are trusted less.
    ///
    /// Tuned, no source.
    #[parameter(default = 0.01, check = not_negative)]
    pub attitude_sigma_rad: f64,
    /// White noise of the accelerometer.
    ///
    /// As of the kind `imu`.
    #[parameter(default = 2.0e-3, check = not_negative)]
    pub accelerometer_noise_density_m_s2_sqrt_hz: f64,
    /// Random walk of the level acceleration's bias.
    ///
    /// The 3.0e-3 of the kind `imu`, and gravity times its gyroscope's 1.7e-4 rad/s/√Hz, since a wrong tilt shows as acceleration.
    #[parameter(default = 4.0e-3, check = not_negative)]
    pub acceleration_bias_walk_m_s3_sqrt_hz: f64,
    /// Standard deviation of the level acceleration's bias at the start.
    ///
    /// A tilt of 0.1°: tuned, no source.
    #[parameter(default = 0.02, check = not_negative, initial)]
    pub initial_acceleration_bias_sigma_m_s2: f64,
    /// Standard deviation of the velocity at the start, which is taken for zero.
    #[parameter(default = 0.01, check = not_negative, initial)]
    pub initial_velocity_sigma_m_s: f64,
    /// Standard deviation of a level velocity of the input `gps` along each axis.
    ///
    /// As of the kind `gps`.
    #[parameter(default = 0.074, check = positive)]
    pub gps_velocity_sigma_m_s: f64,
    /// Place of the vehicle at the start, along the world's x and y: the estimate's position begins there.
    #[parameter(default = [0.0; 2], check = finite)]
    pub initial_level_position_m: [f64; 2],
    /// Height at the start.
    #[parameter(default = 0.0, check = not_negative, initial)]
    pub initial_height_m: f64,
    /// Size of the room along the world's x and y, where it is shared with other vehicles: an echo that is not
    /// that of a wall then does not correct the velocity. Without it every object in sight is taken to
    /// stand still.
    #[parameter(shown = "everything in sight stands still")]
    pub room_m: Option<[f64; 2]>,
    /// With `room_m`: place at the start, from the walls at −x and −y.
    #[parameter(shown = "required with `room_m`", initial)]
    pub start_in_room_m: Option<[f64; 2]>,
    /// Gravity (thesis §3.1).
    #[parameter(default = 9.81, check = positive)]
    pub gravity_m_s2: f64,
}

impl RangeInertialParams {
    /// A room has a size and a place within it, or is not known.
    pub(super) fn validate_room(&self) -> Result<(), ParameterError> {
        let missing = |key, expected| Err(ParameterError::value(key, expected, "nothing"));
        let sides = match (self.room_m, self.start_in_room_m) {
            (Some(_), None) => return missing("start_in_room_m", "given where `room_m` is"),
            (None, Some(_)) => return missing("room_m", "given where `start_in_room_m` is"),
            (sizes_m, starts_m) => sizes_m.into_iter().flatten().zip(starts_m.into_iter().flatten()),
        };
        let check = |(axis, (size_m, start_m))| validate_side(axis, size_m, start_m);
        ParameterError::gather(sides.enumerate().map(check)).map(drop)
    }
}

/// Checks the size of a room along `axis`, and the place within it.
fn validate_side(axis: usize, size_m: f64, start_m: f64) -> Result<(), ParameterError> {
    let (room, start) = (format!("room_m.{axis}"), format!("start_in_room_m.{axis}"));
    let is_start_good = not_negative(&start, start_m);
    // A start that is refused does not limit the room.
    let least_m = if is_start_good.is_ok() { start_m } else { 0.0 };
    let expected = format!("a finite number above `{start}`, {least_m}");
    let is_room_good = require(&room, size_m, size_m.is_finite() && size_m > least_m, expected);
    ParameterError::both(is_start_good, is_room_good).map(drop)
}
