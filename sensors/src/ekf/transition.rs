//! Growth of the filter's errors from one time to a later one.
//!
//! With the attitude's error as a rotation about the *world's* axes, R_true = exp(θ×)·R, the errors of
//! position, velocity and attitude and of the biases of gyroscope and accelerometer follow
//!
//! dp/dt = v,  dv/dt = −f_W × θ − R·(b_a + n_a),  dθ/dt = −R·(b_g + n_g)
//!
//! (Solà, "Quaternion kinematics for the error-state Kalman filter", 2017, §7, global angular errors). The
//! matrix of this system is nilpotent: its transition from one time to another consists of a few integrals over
//! the flown attitude and specific force, for any number of samples between. So the integrals are summed up
//! at each sample, and the covariance is carried over only where it is needed.

use super::params::EkfParams;
use crate::wire::{vector, vector_message};
use bus::Message;
use bus::messages::Vector3 as Vector3Message;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Number of errors.
pub const STATES: usize = 19;
/// Number of the first of them: position, velocity and attitude.
pub(super) const MOTION: usize = 9;
/// Index of the first error of each quantity.
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
/// The covariance of the errors of position, velocity and attitude.
pub(crate) type MotionCovariance = SMatrix<f64, MOTION, MOTION>;

/// The integrals, each over the time from the filter's to a later one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/EkfTransition")]
pub struct Transition {
    /// Length of that time.
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

    /// Returns the time that it spans, s.
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

    /// The covariance of the errors of position, velocity and attitude alone: as [`Self::carry`], for less than half of the
    /// work.
    pub fn carry_motion(&self, covariance: &Covariance, params: &EkfParams) -> MotionCovariance {
        if self.time == 0.0 {
            return covariance.fixed_view::<MOTION, MOTION>(0, 0).into_owned();
        }
        let half = self.rows_of_motion(covariance).transpose();
        let mut carried = self.rows_of_motion(&half);
        self.add_noise_of_motion(&mut carried, params);
        0.5 * (carried + carried.transpose())
    }

    /// The transition matrix times `columns`.
    fn apply(&self, columns: &Covariance, gps_fade: f64) -> Covariance {
        let mut applied = *columns;
        applied.fixed_rows_mut::<MOTION>(0).copy_from(&self.rows_of_motion(columns));
        applied.fixed_rows_mut::<3>(GPS).scale_mut(gps_fade);
        applied
    }

    /// The first rows of the transition matrix, those of position, velocity and attitude, times `columns`.
    fn rows_of_motion<const N: usize>(&self, columns: &SMatrix<f64, STATES, N>) -> SMatrix<f64, MOTION, N> {
        let (shift, push) = (vector(self.shift).cross_matrix(), vector(self.push).cross_matrix());
        let [turn, turn_twice, tilt, tilt_twice] =
            [&self.turn, &self.turn_twice, &self.tilt, &self.tilt_twice].map(matrix);
        let mut applied = columns.fixed_rows::<MOTION>(0).into_owned();
        // Column by column: products of three by three stay in registers.
        for (column, mut applied) in columns.column_iter().zip(applied.column_iter_mut()) {
            let part = |from: usize| column.fixed_rows::<3>(from).into_owned();
            let (attitude, gyroscope, accelerometer) = (part(ATTITUDE), part(GYROSCOPE), part(ACCELEROMETER));
            let position = part(VELOCITY) * self.time - shift * attitude + tilt_twice * gyroscope
                - turn_twice * accelerometer;
            let velocity = tilt * gyroscope - push * attitude - turn * accelerometer;
            let mut add = |from: usize, change: &Vector3<f64>| {
                let mut rows = applied.fixed_rows_mut::<3>(from);
                rows += change;
            };
            add(POSITION, &position);
            add(VELOCITY, &velocity);
            add(ATTITUDE, &(-turn * gyroscope));
        }
        applied
    }

    /// Adds the covariance of the noises. Their way through the attitude within the span is left out: it is three
    /// orders below the rest in the 20 ms that the filter carries its covariance at most.
    fn add_noise(&self, covariance: &mut Covariance, params: &EkfParams) {
        let time_s = self.time;
        self.add_noise_of_motion(covariance, params);
        let fade = libm::exp(-2.0 * time_s / params.gps_position_drift_time_s);
        let mut add =
            |from: usize, count: usize, variance: f64| add_variance(covariance, from, count, variance);
        add(GYROSCOPE, 3, params.gyroscope_bias_walk_rad_s2_sqrt_hz.powi(2) * time_s);
        add(ACCELEROMETER, 3, params.accelerometer_bias_walk_m_s3_sqrt_hz.powi(2) * time_s);
        add(BAROMETER, 1, params.barometer_bias_walk_m_sqrt_s.powi(2) * time_s);
        for (axis, drift_m) in params.gps_position_drift_m.iter().enumerate() {
            add(GPS + axis, 1, drift_m.powi(2) * (1.0 - fade));
        }
    }

    /// The part of that in the errors of position, velocity and attitude.
    fn add_noise_of_motion<const N: usize>(&self, covariance: &mut SMatrix<f64, N, N>, params: &EkfParams) {
        let time_s = self.time;
        let force = params.accelerometer_noise_density_m_s2_sqrt_hz.powi(2);
        for axis in 0..3 {
            let (position, velocity) = (POSITION + axis, VELOCITY + axis);
            covariance[(position, position)] += force * time_s.powi(3) / 3.0;
            covariance[(position, velocity)] += force * time_s.powi(2) / 2.0;
            covariance[(velocity, position)] += force * time_s.powi(2) / 2.0;
        }
        add_variance(covariance, VELOCITY, 3, force * time_s);
        add_variance(covariance, ATTITUDE, 3, params.gyroscope_noise_density_rad_s_sqrt_hz.powi(2) * time_s);
    }
}

/// Adds `variance` to `count` errors from number `from` on.
fn add_variance<const N: usize>(
    covariance: &mut SMatrix<f64, N, N>,
    from: usize,
    count: usize,
    variance: f64,
) {
    (from..from + count).for_each(|state| covariance[(state, state)] += variance);
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
