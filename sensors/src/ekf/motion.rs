//! The motion that the filter believes in, and how an IMU's readings carry it on.

use super::history::Reading;
use super::transition::{
    ACCELEROMETER, ATTITUDE, BAROMETER, Errors, GPS, GYROSCOPE, POSITION, Transition, VELOCITY,
};
use crate::wire::{attitude, attitude_message, vector, vector_message};
use component::Message;
use component::messages::{Quaternion, Vector3 as Vector3Message};
use nalgebra::{UnitQuaternion, Vector3};

/// The motion, and what the sensors' errors are taken for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/EkfMotion")]
pub struct Motion {
    /// Position of the centre of mass.
    #[field(unit = "m", frame = "world")]
    pub position: Vector3Message,
    /// Velocity of the centre of mass.
    #[field(unit = "m/s", frame = "world")]
    pub velocity: Vector3Message,
    /// Attitude, body to world.
    #[field(frame = "world")]
    pub attitude: Quaternion,
    /// Bias of the gyroscope.
    #[field(unit = "rad/s", frame = "body")]
    pub gyroscope_bias: Vector3Message,
    /// Bias of the accelerometer.
    #[field(unit = "m/s^2", frame = "body")]
    pub accelerometer_bias: Vector3Message,
    /// Drift of GPS positions.
    #[field(unit = "m", frame = "world")]
    pub gps_drift: Vector3Message,
    /// Bias of the barometer.
    #[field(unit = "m", frame = "world")]
    pub barometer_bias: f64,
}

impl Motion {
    /// Goes on from the time of `from` to that of `to`, the readings taken for straight lines between; the growth of
    /// the errors meanwhile is added to `transition`.
    pub fn travel(&mut self, from: &Reading, to: &Reading, gravity_m_s2: f64, transition: &mut Transition) {
        let period_s = (to.time_ns - from.time_ns) as f64 * 1e-9;
        let rate_B = 0.5 * (vector(from.angular_velocity) + vector(to.angular_velocity));
        let turn_B = (rate_B - vector(self.gyroscope_bias)) * period_s;
        let before_WB = attitude(self.attitude);
        let half_turn = UnitQuaternion::from_scaled_axis(0.5 * turn_B);
        let middle_WB = before_WB * half_turn;
        let after_WB = middle_WB * half_turn;
        let bias_B = vector(self.accelerometer_bias);
        let first_W = before_WB * (vector(from.specific_force) - bias_B);
        let force_W = 0.5 * (first_W + after_WB * (vector(to.specific_force) - bias_B));
        self.push(&(force_W - Vector3::new(0.0, 0.0, gravity_m_s2)), period_s);
        // Rounding would let the norm wander over a long run.
        self.attitude = attitude_message(UnitQuaternion::new_normalize(after_WB.into_inner()));
        transition.extend(&middle_WB.to_rotation_matrix().into_inner(), &force_W, period_s);
    }

    fn push(&mut self, acceleration_W_m_s2: &Vector3<f64>, period_s: f64) {
        let velocity_W_m_s = vector(self.velocity);
        let moved_W_m = (velocity_W_m_s + 0.5 * period_s * acceleration_W_m_s2) * period_s;
        self.position = vector_message(vector(self.position) + moved_W_m);
        self.velocity = vector_message(velocity_W_m_s + acceleration_W_m_s2 * period_s);
    }

    /// Lets the GPS drift fade over `time_s`, as it does on average.
    pub fn fade_gps_drift(&mut self, time_s: f64, time_constant_s: f64) {
        self.gps_drift = vector_message(vector(self.gps_drift) * libm::exp(-time_s / time_constant_s));
    }

    /// Takes the estimated `errors` off.
    pub fn correct(&mut self, errors: &Errors) {
        let part = |from: usize| errors.fixed_rows::<3>(from).into_owned();
        let sum = |value: Vector3Message, from: usize| vector_message(vector(value) + part(from));
        self.position = sum(self.position, POSITION);
        self.velocity = sum(self.velocity, VELOCITY);
        let attitude_WB = UnitQuaternion::from_scaled_axis(part(ATTITUDE)) * attitude(self.attitude);
        self.attitude = attitude_message(UnitQuaternion::new_normalize(attitude_WB.into_inner()));
        self.gyroscope_bias = sum(self.gyroscope_bias, GYROSCOPE);
        self.accelerometer_bias = sum(self.accelerometer_bias, ACCELEROMETER);
        self.gps_drift = sum(self.gps_drift, GPS);
        self.barometer_bias += errors[BAROMETER];
    }
}
