//! Start of the filter: at the first position that is known, with the attitude that gravity shows.
//!
//! A measurement is first taken for the motion with hardly any confidence. Used again as any other measurement,
//! it then gives the motion the confidence that it deserves.

use super::history::{Measurement, Newest, Reading, Readings, Source};
use super::motion::Motion;
use super::observation::measured_attitude_WB;
use super::params::EkfParams;
use super::transition::{ACCELEROMETER, ATTITUDE, BAROMETER, Covariance, GPS, GYROSCOPE, POSITION, VELOCITY};
use crate::complementary::tilt_rad;
use crate::wire::{attitude_message, vector};
use diagnostics::unit::STANDARD_GRAVITY_M_S2;
use nalgebra::{UnitQuaternion, Vector3};

/// Hardly any confidence: far above what any sensor leaves.
const POSITION_UNKNOWN_SIGMA_M: f64 = 100.0;
const VELOCITY_UNKNOWN_SIGMA_M_S: f64 = 10.0;
const ATTITUDE_UNKNOWN_SIGMA_RAD: f64 = 0.5;

/// A specific force that differs from gravity by more than this fraction does not show the tilt. As the complementary
/// filter's.
const GRAVITY_TOLERANCE: f64 = 0.2;

/// A motion to begin with, and its uncertainty.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// The motion.
    pub motion: Motion,
    position_sigma_m: f64,
    velocity_sigma_m_s: f64,
    tilt_sigma_rad: f64,
    yaw_sigma_rad: f64,
}

impl Start {
    /// At the position that is given, at rest.
    pub fn given(position_m: [f64; 3], reading: &Reading, params: &EkfParams) -> Self {
        let yaw_rad = params.initial_yaw_deg.unwrap_or_default().to_radians();
        let motion = Motion { position: position_m.into(), ..upright(reading, yaw_rad) };
        Self { position_sigma_m: params.initial_position_sigma_m, ..Self::at(motion, params) }
    }

    /// At the pose that motion capture has measured.
    pub fn at_pose(pose: &Measurement, params: &EkfParams) -> Self {
        let [x, y, z, ..] = pose.values;
        let attitude = attitude_message(measured_attitude_WB(pose));
        let motion = Motion { position: [x, y, z].into(), attitude, ..Motion::default() };
        let wide_rad = ATTITUDE_UNKNOWN_SIGMA_RAD;
        Self { tilt_sigma_rad: wide_rad, yaw_sigma_rad: wide_rad, ..Self::at(motion, params) }
    }

    /// At the position and with the velocity that GPS has measured; the yaw is the given one, that of the
    /// magnetic `field`, or zero.
    pub fn at_fix(
        fix: &Measurement,
        field: Option<&Measurement>,
        reading: &Reading,
        params: &EkfParams,
    ) -> Self {
        let [x, y, z, u, v, w, _] = fix.values;
        let given_rad = params.initial_yaw_deg.map(f64::to_radians);
        let seen_rad = field.map(|field| compass_yaw_rad(field, reading, params));
        let motion = upright(reading, given_rad.or(seen_rad).unwrap_or_default());
        let motion = Motion { position: [x, y, z].into(), velocity: [u, v, w].into(), ..motion };
        Self { velocity_sigma_m_s: VELOCITY_UNKNOWN_SIGMA_M_S, ..Self::at(motion, params) }
    }

    fn at(motion: Motion, params: &EkfParams) -> Self {
        Self {
            motion,
            position_sigma_m: POSITION_UNKNOWN_SIGMA_M,
            velocity_sigma_m_s: params.initial_velocity_sigma_m_s,
            tilt_sigma_rad: params.initial_tilt_sigma_deg.to_radians(),
            yaw_sigma_rad: params.initial_yaw_sigma_deg.to_radians(),
        }
    }

    /// The covariance of the errors to begin with.
    pub fn covariance(&self, params: &EkfParams) -> Covariance {
        let mut covariance = Covariance::zeros();
        let mut set = |from: usize, sigma: [f64; 3]| {
            (0..3).for_each(|axis| covariance[(from + axis, from + axis)] = sigma[axis].powi(2));
        };
        set(POSITION, [self.position_sigma_m; 3]);
        set(VELOCITY, [self.velocity_sigma_m_s; 3]);
        set(ATTITUDE, [self.tilt_sigma_rad, self.tilt_sigma_rad, self.yaw_sigma_rad]);
        set(GYROSCOPE, [params.initial_gyroscope_bias_sigma_rad_s; 3]);
        set(ACCELEROMETER, [params.initial_accelerometer_bias_sigma_m_s2; 3]);
        set(GPS, params.gps_position_drift_m);
        covariance[(BAROMETER, BAROMETER)] = params.barometer_initial_bias_sigma_m.powi(2);
        covariance
    }
}

/// The covariance of a filter that has lost its way: hardly any confidence in its motion.
pub fn lost_covariance(params: &EkfParams) -> Covariance {
    let lost = Start {
        motion: Motion::default(),
        position_sigma_m: POSITION_UNKNOWN_SIGMA_M,
        velocity_sigma_m_s: VELOCITY_UNKNOWN_SIGMA_M_S,
        tilt_sigma_rad: ATTITUDE_UNKNOWN_SIGMA_RAD,
        yaw_sigma_rad: ATTITUDE_UNKNOWN_SIGMA_RAD,
    };
    lost.covariance(params)
}

/// The reading and the motion to begin with, if a position is known.
pub fn start(newest: &Newest, readings: &Readings, params: &EkfParams) -> Option<(Reading, Start)> {
    let measured = |sensor: Source| newest[sensor.index()].flatten();
    if let Some(position_m) = params.initial_position_m {
        let reading = readings.newest()?;
        return Some((reading, Start::given(position_m, &reading, params)));
    }
    if let Some(pose) = measured(Source::Mocap) {
        return Some((readings.at(pose.measured_ns)?, Start::at_pose(&pose, params)));
    }
    let (fix, field) = (measured(Source::Gps)?, measured(Source::Magnetometer));
    let has_compass = newest[Source::Magnetometer.index()].is_some();
    if has_compass && field.is_none() && params.initial_yaw_deg.is_none() {
        // It will say where north is.
        return None;
    }
    let reading = readings.at(fix.measured_ns)?;
    Some((reading, Start::at_fix(&fix, field.as_ref(), &reading, params)))
}

/// At rest, with roll and pitch as gravity shows them; level, if the reading is not that of gravity.
fn upright(reading: &Reading, yaw_rad: f64) -> Motion {
    let felt_m_s2 = vector(reading.specific_force);
    let is_gravity = (felt_m_s2.norm() / STANDARD_GRAVITY_M_S2 - 1.0).abs() < GRAVITY_TOLERANCE;
    let (roll_rad, pitch_rad) = if is_gravity { tilt_rad(&felt_m_s2) } else { (0.0, 0.0) };
    let attitude_WB = UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, yaw_rad);
    Motion { attitude: attitude_message(attitude_WB), ..Motion::default() }
}

/// The yaw at which the world's magnetic field lies as it is seen from the body, roll and pitch taken off.
fn compass_yaw_rad(field: &Measurement, reading: &Reading, params: &EkfParams) -> f64 {
    let [x, y, z, ..] = field.values;
    let field_B_T = Vector3::new(x, y, z) - Vector3::from(params.magnetometer_hard_iron_T);
    let (roll_rad, pitch_rad) = tilt_rad(&vector(reading.specific_force));
    let seen_T = UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, 0.0) * field_B_T;
    let true_T = params.field_W_T();
    libm::atan2(true_T.y, true_T.x) - libm::atan2(seen_T.y, seen_T.x)
}
