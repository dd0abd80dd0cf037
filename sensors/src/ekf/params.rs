//! The parameters of the extended Kalman filter.
#![allow(non_snake_case, reason = "a trailing _T names the tesla")]

use crate::earth_field::EarthField;
use diagnostics::parameter::{ParameterError, all, finite, not_negative, positive, require};
use nalgebra::Vector3;
use serde::Deserialize;

/// What the sensors are worth, and where the vehicle starts. The sensors' figures default to those of the
/// built-in kinds, whose rooms name their sources, with the rounding to the part's resolution included: a variance of
/// resolution² / 12. The barometer's are its pascals in metres at sea level, where the air weighs 12.01 N/m³.
/// What the start is worth is tuned, no source.
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
    pub mocap_position_noise_m: f64,
    /// Standard deviation of an attitude by motion capture, about each body axis, degrees.
    pub mocap_attitude_noise_deg: f64,
    /// Standard deviation of the white part of a GPS position, along each axis, m.
    pub gps_position_noise_m: [f64; 3],
    /// Standard deviation of the part that drifts, along each axis, m.
    pub gps_position_drift_m: [f64; 3],
    /// Time constant of that drift, s.
    pub gps_position_drift_time_s: f64,
    /// Standard deviation of a GPS velocity, along each axis, m/s.
    pub gps_velocity_noise_m_s: [f64; 3],
    /// Standard deviation of a barometer's altitude, m.
    pub barometer_noise_m: f64,
    /// Random walk of its bias, m/√s.
    pub barometer_bias_walk_m_sqrt_s: f64,
    /// Standard deviation of its bias at the start, m.
    pub barometer_initial_bias_sigma_m: f64,
    /// Standard deviation of each axis of a magnetometer, T.
    pub magnetometer_noise_T: f64,
    /// A magnetometer's constant error, body axes, which is taken off, T.
    pub magnetometer_hard_iron_T: [f64; 3],
    /// Magnetic flux density of the earth's field, T.
    pub field_T: f64,
    /// How far it points below the horizon, degrees.
    pub inclination_deg: f64,
    /// How far magnetic north lies east of the world's x axis, degrees.
    pub declination_deg: f64,
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
        let EarthField { field_T, inclination_deg, declination_deg } = EarthField::default();
        Self {
            accelerometer_noise_density_m_s2_sqrt_hz: 2.0e-3,
            accelerometer_bias_walk_m_s3_sqrt_hz: 3.0e-3,
            gyroscope_noise_density_rad_s_sqrt_hz: 1.6968e-4,
            gyroscope_bias_walk_rad_s2_sqrt_hz: 1.9393e-5,
            mocap_position_noise_m: 0.5e-3,
            mocap_attitude_noise_deg: 0.1,
            gps_position_noise_m: [0.3, 0.3, 0.45],
            gps_position_drift_m: [2.1, 2.1, 3.15],
            gps_position_drift_time_s: 300.0,
            gps_velocity_noise_m_s: [0.074, 0.074, 0.111],
            barometer_noise_m: 0.103,
            barometer_bias_walk_m_sqrt_s: 0.0167,
            barometer_initial_bias_sigma_m: 1.0,
            magnetometer_noise_T: 2.02e-7,
            magnetometer_hard_iron_T: [0.0; 3],
            field_T,
            inclination_deg,
            declination_deg,
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
        for axis in 0..3 {
            positive("gps_position_noise_m", self.gps_position_noise_m[axis])?;
            positive("gps_velocity_noise_m_s", self.gps_velocity_noise_m_s[axis])?;
        }
        all(not_negative, "gps_position_drift_m", &self.gps_position_drift_m)?;
        all(finite, "magnetometer_hard_iron_T", &self.magnetometer_hard_iron_T)?;
        all(finite, "initial_position_m", &self.initial_position_m.unwrap_or_default())?;
        finite("initial_yaw_deg", self.initial_yaw_deg.unwrap_or_default())?;
        finite("declination_deg", self.declination_deg)?;
        let inclination_is_good = self.inclination_deg.abs() < 90.0;
        require("inclination_deg", self.inclination_deg, inclination_is_good, "between -90 and 90")
    }

    /// A filter that took one of these for zero would believe a measurement blindly, or divide by it.
    fn positive(&self) -> [(&'static str, f64); 8] {
        [
            ("mocap_position_noise_m", self.mocap_position_noise_m),
            ("mocap_attitude_noise_deg", self.mocap_attitude_noise_deg),
            ("gps_position_drift_time_s", self.gps_position_drift_time_s),
            ("barometer_noise_m", self.barometer_noise_m),
            ("magnetometer_noise_T", self.magnetometer_noise_T),
            ("field_T", self.field_T),
            ("gate_sigma", self.gate_sigma),
            ("gravity_m_s2", self.gravity_m_s2),
        ]
    }

    fn not_negative(&self) -> [(&'static str, f64); 13] {
        [
            ("accelerometer_noise_density_m_s2_sqrt_hz", self.accelerometer_noise_density_m_s2_sqrt_hz),
            ("accelerometer_bias_walk_m_s3_sqrt_hz", self.accelerometer_bias_walk_m_s3_sqrt_hz),
            ("gyroscope_noise_density_rad_s_sqrt_hz", self.gyroscope_noise_density_rad_s_sqrt_hz),
            ("gyroscope_bias_walk_rad_s2_sqrt_hz", self.gyroscope_bias_walk_rad_s2_sqrt_hz),
            ("barometer_bias_walk_m_sqrt_s", self.barometer_bias_walk_m_sqrt_s),
            ("barometer_initial_bias_sigma_m", self.barometer_initial_bias_sigma_m),
            ("initial_position_sigma_m", self.initial_position_sigma_m),
            ("initial_velocity_sigma_m_s", self.initial_velocity_sigma_m_s),
            ("initial_tilt_sigma_deg", self.initial_tilt_sigma_deg),
            ("initial_yaw_sigma_deg", self.initial_yaw_sigma_deg),
            ("initial_gyroscope_bias_sigma_rad_s", self.initial_gyroscope_bias_sigma_rad_s),
            ("initial_accelerometer_bias_sigma_m_s2", self.initial_accelerometer_bias_sigma_m_s2),
            ("delay_max_ms", self.delay_max_ms),
        ]
    }

    /// The earth's magnetic field in the world, T.
    #[must_use]
    pub fn field_W_T(&self) -> Vector3<f64> {
        let Self { field_T, inclination_deg, declination_deg, .. } = *self;
        EarthField { field_T, inclination_deg, declination_deg }.vector_W_T()
    }
}
