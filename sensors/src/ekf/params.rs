//! The parameters of the extended Kalman filter.

use crate::earth_field;
use diagnostics::parameter::{ParameterError, finite, not_negative, positive, require};
use nalgebra::Vector3;

parameters! {
    /// Uncertainties of the sensors, and the start of the vehicle. The sensors' figures default to those of the
    /// built-in kinds, whose rooms name their sources, with the rounding to the part's resolution included: a variance of
    /// resolution² / 12. The barometer's are its pascals in metres at sea level, where the air weighs 12.01 N/m³.
    /// The uncertainties of the start are tuned, no source.
    #[derive(Copy)]
    pub struct EkfParams {
        /// White noise of the accelerometer, m/s²/√Hz.
        accelerometer_noise_density_m_s2_sqrt_hz: f64 = 2.0e-3 => not_negative,
        /// Random walk of its bias, m/s³/√Hz.
        accelerometer_bias_walk_m_s3_sqrt_hz: f64 = 3.0e-3 => not_negative,
        /// White noise of the gyroscope, rad/s/√Hz.
        gyroscope_noise_density_rad_s_sqrt_hz: f64 = 1.6968e-4 => not_negative,
        /// Random walk of its bias, rad/s²/√Hz.
        gyroscope_bias_walk_rad_s2_sqrt_hz: f64 = 1.9393e-5 => not_negative,
        /// Standard deviation of a position by motion capture, each axis, m.
        mocap_position_noise_m: f64 = 0.5e-3 => positive,
        /// Standard deviation of an attitude by motion capture, about each body axis, degrees.
        mocap_attitude_noise_deg: f64 = 0.1 => positive,
        /// Standard deviation of the white part of a GPS position, along each axis, m.
        gps_position_noise_m: [f64; 3] = [0.3, 0.3, 0.45] => positive,
        /// Standard deviation of the part that drifts, along each axis, m.
        gps_position_drift_m: [f64; 3] = [2.1, 2.1, 3.15] => not_negative,
        /// Time constant of that drift, s.
        gps_position_drift_time_s: f64 = 300.0 => positive,
        /// Standard deviation of a GPS velocity, along each axis, m/s.
        gps_velocity_noise_m_s: [f64; 3] = [0.074, 0.074, 0.111] => positive,
        /// Standard deviation of a barometer's altitude, m.
        barometer_noise_m: f64 = 0.103 => positive,
        /// Random walk of its bias, m/√s.
        barometer_bias_walk_m_sqrt_s: f64 = 0.0167 => not_negative,
        /// Standard deviation of its bias at the start, m.
        barometer_initial_bias_sigma_m: f64 = 1.0 => not_negative,
        /// Standard deviation of each axis of a magnetometer, T.
        magnetometer_noise_T: f64 = 2.02e-7 => positive,
        /// A magnetometer's constant error, body axes, which is taken off, T.
        magnetometer_hard_iron_T: [f64; 3] = [0.0; 3] => finite,
        /// Magnetic flux density of the earth's field, T.
        field_T: f64 = earth_field::FIELD_T => positive,
        /// Inclination of the field, below the horizon, degrees.
        inclination_deg: f64 = earth_field::INCLINATION_DEG => below_vertical,
        /// Declination: angle of magnetic north east of the world's x axis, degrees.
        declination_deg: f64 = earth_field::DECLINATION_DEG => finite,
        /// The position at the start, m; where absent, the first one measured.
        initial_position_m: Option<[f64; 3]> = None => finite,
        /// Its standard deviation, m, where it is given.
        initial_position_sigma_m: f64 = 0.01 => not_negative,
        /// Standard deviation of the velocity at the start, taken for zero unless GPS measures it, m/s.
        initial_velocity_sigma_m_s: f64 = 0.5 => not_negative,
        /// Standard deviation of roll and pitch at the start, from the accelerometer, degrees.
        initial_tilt_sigma_deg: f64 = 1.0 => not_negative,
        /// The yaw at the start, degrees; where absent that of motion capture or the magnetometer, else 0.
        initial_yaw_deg: Option<f64> = None => finite,
        /// Its standard deviation, degrees, unless motion capture measures it.
        initial_yaw_sigma_deg: f64 = 5.0 => not_negative,
        /// Standard deviation of the gyroscope's bias at the start, rad/s.
        initial_gyroscope_bias_sigma_rad_s: f64 = 1.0e-3 => not_negative,
        /// Standard deviation of the accelerometer's bias at the start, m/s².
        initial_accelerometer_bias_sigma_m_s2: f64 = 0.02 => not_negative,
        /// Greatest delay with which a measurement may arrive, ms.
        delay_max_ms: f64 = 200.0 => not_negative,
        /// A measurement less likely than one so many standard deviations off is refused.
        gate_sigma: f64 = 5.0 => positive,
        /// Gravity, m/s².
        gravity_m_s2: f64 = 9.81 => positive,
    }
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
