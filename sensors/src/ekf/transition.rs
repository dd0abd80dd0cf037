//! How the filter's errors grow from one time to a later one.
//!
//! With the attitude's error as a rotation about the *world's* axes, R_true = exp(θ×)·R, the errors of
//! position, velocity and attitude and of the biases of gyroscope and accelerometer follow
//!
//! dp/dt = v,  dv/dt = −f_W × θ − R·(b_a + n_a),  dθ/dt = −R·(b_g + n_g)
//!
//! (Solà, "Quaternion kinematics for the error-state Kalman filter", 2017, §7, global angular errors). The
//! matrix of this system is nilpotent: its transition from one time to another is made of a few integrals over
//! the flown attitude and specific force, whatever the number of samples between. So the integrals are summed up
//! at each sample, and the covariance is carried over only where it is needed.

use super::params::EkfParams;
use crate::wire::{vector, vector_message};
use bus::Message;
use bus::messages::Vector3 as Vector3Message;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Number of errors.
pub const STATES: usize = 19;
/// Where the errors of each quantity begin.
pub(super) const POSITION: usize = 0;
pub(super) const VELOCITY: usize = 3;
pub(super) const ATTITUDE: usize = 6;
pub(super) const GYROSCOPE: usize = 9;
pub(super) const ACCELEROMETER: usize = 12;
pub(super) const GPS: usize = 15;
pub(super) const BAROMETER: usize = 18;

/// The errors: position, velocity, attitude, gyroscope bias, accelerometer bias, GPS drift, barometer bias.
pub type Errors = SVector<f64, STATES>;
/// Their covariance.
pub type Covariance = SMatrix<f64, STATES, STATES>;

/// The integrals, each over the time from the filter's to a later one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/EkfTransition")]
pub struct Transition {
    /// How long.
    #[field(unit = "s")]
    time: f64,
    /// Specific force, once and twice over time.
    #[field(unit = "m/s", frame = "world")]
    push: Vector3Message,
    #[field(unit = "m", frame = "world")]
    shift: Vector3Message,
    /// Rotation from the body to the world, once and twice over time.
    #[field(unit = "s")]
    turn: [f64; 9],
    #[field(unit = "s^2")]
    turn_twice: [f64; 9],
    /// The specific force across the first, once and twice over time: what a gyroscope bias does.
    #[field(unit = "m")]
    tilt: [f64; 9],
    #[field(unit = "m*s")]
    tilt_twice: [f64; 9],
}

impl Transition {
    /// Goes on for `period_s` with mean rotation `turn_WB` and mean specific force `force_W_m_s2`.
    pub fn extend(&mut self, turn_WB: &Matrix3<f64>, force_W_m_s2: &Vector3<f64>, period_s: f64) {
        let (turn, tilt) = (matrix(&self.turn), matrix(&self.tilt));
        let half_turn = 0.5 * period_s * turn_WB;
        let push = vector(self.push);
        add(&mut self.tilt_twice, &(tilt * period_s));
        add(&mut self.tilt, &(force_W_m_s2.cross_matrix() * (turn + half_turn) * period_s));
        add(&mut self.turn_twice, &((turn + half_turn) * period_s));
        add(&mut self.turn, &(turn_WB * period_s));
        let shift = vector(self.shift) + (push + 0.5 * period_s * force_W_m_s2) * period_s;
        self.shift = vector_message(shift);
        self.push = vector_message(push + force_W_m_s2 * period_s);
        self.time += period_s;
    }

    /// How long it spans, s.
    pub fn time_s(&self) -> f64 {
        self.time
    }

    /// The covariance at the end of what the integrals span, from that at its beginning.
    pub fn carry(&self, covariance: &Covariance, params: &EkfParams) -> Covariance {
        if self.time == 0.0 {
            return *covariance;
        }
        let fade = libm::exp(-self.time / params.gps_position_drift_time_s);
        let half = self.apply(covariance, fade).transpose();
        let mut carried = self.apply(&half, fade);
        self.add_noise(&mut carried, params);
        symmetric(&carried)
    }

    /// The transition matrix times `columns`.
    fn apply(&self, columns: &Covariance, gps_fade: f64) -> Covariance {
        let rows = |from: usize| columns.fixed_rows::<3>(from).into_owned();
        let (attitude, gyroscope, accelerometer) = (rows(ATTITUDE), rows(GYROSCOPE), rows(ACCELEROMETER));
        let position = rows(VELOCITY) * self.time - vector(self.shift).cross_matrix() * attitude
            + matrix(&self.tilt_twice) * gyroscope
            - matrix(&self.turn_twice) * accelerometer;
        let velocity = matrix(&self.tilt) * gyroscope
            - vector(self.push).cross_matrix() * attitude
            - matrix(&self.turn) * accelerometer;
        let mut applied = *columns;
        add_rows(&mut applied, POSITION, &position);
        add_rows(&mut applied, VELOCITY, &velocity);
        add_rows(&mut applied, ATTITUDE, &(-matrix(&self.turn) * gyroscope));
        applied.fixed_rows_mut::<3>(GPS).scale_mut(gps_fade);
        applied
    }

    /// What the noises have added. Their way through the attitude within the span is left out: it is three
    /// orders below the rest in the 20 ms that the filter carries its covariance at most.
    fn add_noise(&self, covariance: &mut Covariance, params: &EkfParams) {
        let time_s = self.time;
        let force = params.accelerometer_noise_density_m_s2_sqrt_hz.powi(2);
        for axis in 0..3 {
            let (position, velocity) = (POSITION + axis, VELOCITY + axis);
            covariance[(position, position)] += force * time_s.powi(3) / 3.0;
            covariance[(position, velocity)] += force * time_s.powi(2) / 2.0;
            covariance[(velocity, position)] += force * time_s.powi(2) / 2.0;
        }
        let fade = libm::exp(-2.0 * time_s / params.gps_position_drift_time_s);
        let mut add = |from: usize, count: usize, variance: f64| {
            (from..from + count).for_each(|state| covariance[(state, state)] += variance);
        };
        add(VELOCITY, 3, force * time_s);
        add(ATTITUDE, 3, params.gyroscope_noise_density_rad_s_sqrt_hz.powi(2) * time_s);
        add(GYROSCOPE, 3, params.gyroscope_bias_walk_rad_s2_sqrt_hz.powi(2) * time_s);
        add(ACCELEROMETER, 3, params.accelerometer_bias_walk_m_s3_sqrt_hz.powi(2) * time_s);
        add(BAROMETER, 1, params.barometer_bias_walk_m_sqrt_s.powi(2) * time_s);
        for (axis, drift_m) in params.gps_position_drift_m.iter().enumerate() {
            add(GPS + axis, 1, drift_m.powi(2) * (1.0 - fade));
        }
    }
}

/// The mean of a matrix and its transpose, which rounding has let drift apart.
pub(super) fn symmetric(covariance: &Covariance) -> Covariance {
    0.5 * (covariance + covariance.transpose())
}

fn matrix(flat: &[f64; 9]) -> Matrix3<f64> {
    Matrix3::from_column_slice(flat)
}

fn add(flat: &mut [f64; 9], change: &Matrix3<f64>) {
    flat.iter_mut().zip(change).for_each(|(value, change)| *value += change);
}

fn add_rows(covariance: &mut Covariance, from: usize, change: &SMatrix<f64, 3, STATES>) {
    let mut rows = covariance.fixed_rows_mut::<3>(from);
    rows += change;
}
