//! The parameters of the extended Kalman filter.

use crate::earth_field;
use diagnostics::parameter::{ParameterError, finite, not_negative, positive, require};
use nalgebra::Vector3;

/// Uncertainties of the sensors, and the start of the vehicle. The sensors' figures default to those of the
/// built-in kinds, whose rooms name their sources, with the rounding to the part's resolution included: a variance of
/// resolution² / 12. The barometer's are its pascals in metres at sea level, where the air weighs 12.01 N/m³.
/// The uncertainties of the start are tuned, no source.
#[derive(Debug, Clone, Copy, PartialEq, component::Parameters)]
#[parameters(default)]
pub struct EkfParams {
    /// White noise of the accelerometer.
    #[parameter(default = 2.0e-3, check = not_negative)]
    pub accelerometer_noise_density_m_s2_sqrt_hz: f64,
    /// Random walk of its bias.
    #[parameter(default = 3.0e-3, check = not_negative)]
    pub accelerometer_bias_walk_m_s3_sqrt_hz: f64,
    /// White noise of the gyroscope.
    #[parameter(default = 1.6968e-4, check = not_negative)]
    pub gyroscope_noise_density_rad_s_sqrt_hz: f64,
    /// Random walk of its bias.
    #[parameter(default = 1.9393e-5, check = not_negative)]
    pub gyroscope_bias_walk_rad_s2_sqrt_hz: f64,
    /// Standard deviation of a position by motion capture, each axis.
    #[parameter(default = 0.5e-3, check = positive)]
    pub mocap_position_noise_m: f64,
    /// Standard deviation of an attitude by motion capture, about each body axis.
    #[parameter(default = 0.1, check = positive)]
    pub mocap_attitude_noise_deg: f64,
    /// Standard deviation of the white part of a GPS position, along each axis.
    #[parameter(default = [0.3, 0.3, 0.45], check = positive)]
    pub gps_position_noise_m: [f64; 3],
    /// Standard deviation of the part that drifts, along each axis.
    #[parameter(default = [2.1, 2.1, 3.15], check = not_negative)]
    pub gps_position_drift_m: [f64; 3],
    /// Time constant of that drift.
    #[parameter(default = 300.0, check = positive)]
    pub gps_position_drift_time_s: f64,
    /// Standard deviation of a GPS velocity, along each axis.
    #[parameter(default = [0.074, 0.074, 0.111], check = positive)]
    pub gps_velocity_noise_m_s: [f64; 3],
    /// Standard deviation of a barometer's altitude.
    #[parameter(default = 0.103, check = positive)]
    pub barometer_noise_m: f64,
    /// Random walk of its bias.
    #[parameter(default = 0.0167, check = not_negative)]
    pub barometer_bias_walk_m_sqrt_s: f64,
    /// Standard deviation of its bias at the start.
    #[parameter(default = 1.0, check = not_negative, initial)]
    pub barometer_initial_bias_sigma_m: f64,
    /// Standard deviation of each axis of a magnetometer.
    #[parameter(default = 2.02e-7, check = positive)]
    pub magnetometer_noise_T: f64,
    /// A magnetometer's constant error, body axes, which is taken off.
    #[parameter(default = [0.0; 3], check = finite)]
    pub magnetometer_hard_iron_T: [f64; 3],
    /// Magnetic flux density of the earth's field.
    #[parameter(default = earth_field::FIELD_T, check = positive)]
    pub field_T: f64,
    /// Inclination of the field, below the horizon.
    #[parameter(default = earth_field::INCLINATION_DEG, check = below_vertical)]
    pub inclination_deg: f64,
    /// Declination: angle of magnetic north east of the world's x axis.
    #[parameter(default = earth_field::DECLINATION_DEG, check = finite)]
    pub declination_deg: f64,
    /// The position at the start.
    #[parameter(shown = "the first one measured", check = finite, initial)]
    pub initial_position_m: Option<[f64; 3]>,
    /// Its standard deviation, where it is given.
    #[parameter(default = 0.01, check = not_negative, initial)]
    pub initial_position_sigma_m: f64,
    /// Standard deviation of the velocity at the start, taken for zero unless GPS measures it.
    #[parameter(default = 0.5, check = not_negative, initial)]
    pub initial_velocity_sigma_m_s: f64,
    /// Standard deviation of roll and pitch at the start, without motion capture.
    #[parameter(default = 1.0, check = not_negative, initial)]
    pub initial_tilt_sigma_deg: f64,
    /// The yaw at the start.
    #[parameter(shown = "that of motion capture, else of the magnetometer, else 0", check = finite, initial)]
    pub initial_yaw_deg: Option<f64>,
    /// Its standard deviation, without motion capture.
    #[parameter(default = 5.0, check = not_negative, initial)]
    pub initial_yaw_sigma_deg: f64,
    /// Standard deviation of the gyroscope's bias at the start.
    #[parameter(default = 1.0e-3, check = not_negative, initial)]
    pub initial_gyroscope_bias_sigma_rad_s: f64,
    /// Standard deviation of the accelerometer's bias at the start.
    #[parameter(default = 0.02, check = not_negative, initial)]
    pub initial_accelerometer_bias_sigma_m_s2: f64,
    /// Greatest delay with which a measurement may arrive.
    #[parameter(default = 200.0, check = not_negative)]
    pub delay_max_ms: f64,
    /// A measurement less likely than one so many standard deviations off is refused.
    #[parameter(default = 5.0, check = positive)]
    pub gate_sigma: f64,
    /// Gravity.
    #[parameter(default = 9.81, check = positive)]
    pub gravity_m_s2: f64,
}

/// A field that points straight up or down shows no north.
fn below_vertical(key: &str, angle_deg: f64) -> Result<(), ParameterError> {
    require(key, angle_deg, angle_deg.abs() < 90.0, "between -90 and 90")
}

impl EkfParams {
    /// The earth's magnetic field in the world, T.
    #[must_use]
    pub fn field_W_T(&self) -> Vector3<f64> {
        earth_field::vector_W_T(self.field_T, self.inclination_deg, self.declination_deg)
    }
}
