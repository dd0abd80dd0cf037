//! The parameters of the extended Kalman filter.

use crate::parameter::{ParameterError, all_finite, check, finite, not_negative, positive};
use serde::Deserialize;

/// What the sensors are worth, and where the vehicle starts. The sensors' figures default to those of the
/// built-in kinds, whose models name their sources; what the start is worth is tuned, no source.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EkfParams {
    /// White noise of the accelerometer, m/s²/√Hz.
    pub accelerometer_noise_density_m_s2_sqrt_hz: f64,
    /// Random walk of its bias, m/s³/√Hz.
    pub accelerometer_bias_walk_m_s3_sqrt_hz: f64,
    /// White noise of the gyroscope, rad/s/√Hz.
    pub gyroscope_noise_density_rad_s_sqrt_hz: f64,
    /// Random walk of its bias, rad/s²/√Hz.
    pub gyroscope_bias_walk_rad_s2_sqrt_hz: f64,
    /// Standard deviation of a position by motion capture, each axis, m.
    pub mocap_position_sigma_m: f64,
    /// Standard deviation of an attitude by motion capture, about each axis, degrees.
    pub mocap_attitude_sigma_deg: f64,
    /// Standard deviation of the white part of a GPS position, x and y, m.
    pub gps_horizontal_sigma_m: f64,
    /// The same of z, m.
    pub gps_vertical_sigma_m: f64,
    /// Standard deviation of the part of a GPS position that wanders, x and y, m.
    pub gps_offset_horizontal_sigma_m: f64,
    /// The same of z, m.
    pub gps_offset_vertical_sigma_m: f64,
    /// Time constant with which that part wanders, s.
    pub gps_offset_time_constant_s: f64,
    /// Standard deviation of a GPS velocity, x and y, m/s.
    pub gps_velocity_horizontal_sigma_m_s: f64,
    /// The same of z, m/s.
    pub gps_velocity_vertical_sigma_m_s: f64,
    /// Standard deviation of a barometer's altitude, m.
    pub barometer_sigma_m: f64,
    /// Random walk of its offset, m/√s.
    pub barometer_offset_walk_m_sqrt_s: f64,
    /// Standard deviation of its offset at the start, m.
    pub barometer_initial_offset_sigma_m: f64,
    /// Standard deviation of each axis of a magnetometer, T.
    pub magnetometer_sigma_t: f64,
    /// A magnetometer's constant error, body axes, which is taken off, T.
    pub magnetometer_hard_iron_t: [f64; 3],
    /// Strength of the world's magnetic field, T.
    pub magnetic_field_t: f64,
    /// How far it points below level, degrees.
    pub magnetic_inclination_deg: f64,
    /// How far magnetic north is clockwise (from above) of true north, which is the world's y, degrees.
    pub magnetic_declination_deg: f64,
    /// The position at the start, m; where absent, the first one measured.
    pub initial_position_m: Option<[f64; 3]>,
    /// Its standard deviation, m, where it is given.
    pub initial_position_sigma_m: f64,
    /// Standard deviation of the velocity at the start, taken for zero unless GPS measures it, m/s.
    pub initial_velocity_sigma_m_s: f64,
    /// Standard deviation of roll and pitch at the start, from the accelerometer, degrees.
    pub initial_tilt_sigma_deg: f64,
    /// The yaw at the start, degrees; where absent that of motion capture or the magnetometer, else 0.
    pub initial_yaw_deg: Option<f64>,
    /// Its standard deviation, degrees, unless motion capture measures it.
    pub initial_yaw_sigma_deg: f64,
    /// Standard deviation of the gyroscope's bias at the start, rad/s.
    pub initial_gyroscope_bias_sigma_rad_s: f64,
    /// Standard deviation of the accelerometer's bias at the start, m/s².
    pub initial_accelerometer_bias_sigma_m_s2: f64,
    /// How late a measurement may arrive, ms.
    pub delay_max_ms: f64,
    /// A measurement less likely than one so many standard deviations off is refused.
    pub gate_sigma: f64,
    /// Gravity, m/s².
    pub gravity_m_s2: f64,
}

impl Default for EkfParams {
    fn default() -> Self {
        Self {
            accelerometer_noise_density_m_s2_sqrt_hz: 2.0e-3,
            accelerometer_bias_walk_m_s3_sqrt_hz: 3.0e-3,
            gyroscope_noise_density_rad_s_sqrt_hz: 1.6968e-4,
            gyroscope_bias_walk_rad_s2_sqrt_hz: 1.9393e-5,
            mocap_position_sigma_m: 0.5e-3,
            mocap_attitude_sigma_deg: 0.1,
            gps_horizontal_sigma_m: 0.3,
            gps_vertical_sigma_m: 0.6,
            gps_offset_horizontal_sigma_m: 1.5,
            gps_offset_vertical_sigma_m: 3.0,
            gps_offset_time_constant_s: 60.0,
            gps_velocity_horizontal_sigma_m_s: 0.05,
            gps_velocity_vertical_sigma_m_s: 0.1,
            barometer_sigma_m: 0.1,
            barometer_offset_walk_m_sqrt_s: 0.02,
            barometer_initial_offset_sigma_m: 1.0,
            magnetometer_sigma_t: 2.0e-7,
            magnetometer_hard_iron_t: [0.0; 3],
            magnetic_field_t: 4.8e-5,
            magnetic_inclination_deg: 58.0,
            magnetic_declination_deg: 5.5,
            initial_position_m: None,
            initial_position_sigma_m: 0.01,
            initial_velocity_sigma_m_s: 0.5,
            initial_tilt_sigma_deg: 1.0,
            initial_yaw_deg: None,
            initial_yaw_sigma_deg: 5.0,
            initial_gyroscope_bias_sigma_rad_s: 1.0e-3,
            initial_accelerometer_bias_sigma_m_s2: 0.02,
            delay_max_ms: 200.0,
            gate_sigma: 5.0,
            gravity_m_s2: 9.81,
        }
    }
}

impl EkfParams {
    /// Refuses what no flight can have.
    ///
    /// # Errors
    /// A parameter is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for (key, value) in self.positive() {
            positive(key, value)?;
        }
        for (key, value) in self.not_negative() {
            not_negative(key, value)?;
        }
        all_finite("magnetometer_hard_iron_t", &self.magnetometer_hard_iron_t)?;
        all_finite("initial_position_m", &self.initial_position_m.unwrap_or_default())?;
        finite("initial_yaw_deg", self.initial_yaw_deg.unwrap_or_default())?;
        finite("magnetic_declination_deg", self.magnetic_declination_deg)?;
        let inclination_deg = self.magnetic_inclination_deg;
        let is_good = inclination_deg.abs() < 90.0;
        check("magnetic_inclination_deg", inclination_deg, is_good, "between -90 and 90")
    }

    /// A filter that took one of these for zero would believe a measurement blindly, or divide by it.
    fn positive(&self) -> [(&'static str, f64); 12] {
        [
            ("mocap_position_sigma_m", self.mocap_position_sigma_m),
            ("mocap_attitude_sigma_deg", self.mocap_attitude_sigma_deg),
            ("gps_horizontal_sigma_m", self.gps_horizontal_sigma_m),
            ("gps_vertical_sigma_m", self.gps_vertical_sigma_m),
            ("gps_offset_time_constant_s", self.gps_offset_time_constant_s),
            ("gps_velocity_horizontal_sigma_m_s", self.gps_velocity_horizontal_sigma_m_s),
            ("gps_velocity_vertical_sigma_m_s", self.gps_velocity_vertical_sigma_m_s),
            ("barometer_sigma_m", self.barometer_sigma_m),
            ("magnetometer_sigma_t", self.magnetometer_sigma_t),
            ("magnetic_field_t", self.magnetic_field_t),
            ("gate_sigma", self.gate_sigma),
            ("gravity_m_s2", self.gravity_m_s2),
        ]
    }

    fn not_negative(&self) -> [(&'static str, f64); 15] {
        [
            ("accelerometer_noise_density_m_s2_sqrt_hz", self.accelerometer_noise_density_m_s2_sqrt_hz),
            ("accelerometer_bias_walk_m_s3_sqrt_hz", self.accelerometer_bias_walk_m_s3_sqrt_hz),
            ("gyroscope_noise_density_rad_s_sqrt_hz", self.gyroscope_noise_density_rad_s_sqrt_hz),
            ("gyroscope_bias_walk_rad_s2_sqrt_hz", self.gyroscope_bias_walk_rad_s2_sqrt_hz),
            ("gps_offset_horizontal_sigma_m", self.gps_offset_horizontal_sigma_m),
            ("gps_offset_vertical_sigma_m", self.gps_offset_vertical_sigma_m),
            ("barometer_offset_walk_m_sqrt_s", self.barometer_offset_walk_m_sqrt_s),
            ("barometer_initial_offset_sigma_m", self.barometer_initial_offset_sigma_m),
            ("initial_position_sigma_m", self.initial_position_sigma_m),
            ("initial_velocity_sigma_m_s", self.initial_velocity_sigma_m_s),
            ("initial_tilt_sigma_deg", self.initial_tilt_sigma_deg),
            ("initial_yaw_sigma_deg", self.initial_yaw_sigma_deg),
            ("initial_gyroscope_bias_sigma_rad_s", self.initial_gyroscope_bias_sigma_rad_s),
            ("initial_accelerometer_bias_sigma_m_s2", self.initial_accelerometer_bias_sigma_m_s2),
            ("delay_max_ms", self.delay_max_ms),
        ]
    }
}
