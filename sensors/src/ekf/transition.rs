//! Growth of the filter's errors from one time to a later one.
//!
//! The attitude's error is a rotation about the *world's* axes, R_true = exp(θ×)·R. The errors of position,
//! velocity and attitude and of the biases of gyroscope and accelerometer follow
//!
//! dp/dt = v,  dv/dt = −f_W × θ − R·(b_a + n_a),  dθ/dt = −R·(b_g + n_g)
//!
//! (Solà, "Quaternion kinematics for the error-state Kalman filter", 2017, §7, global angular errors). The
//! matrix of this system is nilpotent: its transition from one time to another consists of a few integrals over
//! the flown attitude and specific force, for any number of samples between. So the integrals are summed up
//! at each sample, and the covariance is carried over only where it is needed.

use super::params::EkfParams;
use crate::wire::{vector, vector_message};
use component::Message;
use component::messages::Vector3 as Vector3Message;
use nalgebra::{Matrix3, SMatrix, SMatrixView, SVector, Vector3};

/// Number of errors.
pub const STATES: usize = 19;
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
/// Number of the errors that act on position and velocity through the attitude: of attitude, gyroscope and
/// accelerometer, one after the other.
const TILTS: usize = GPS - ATTITUDE;
/// A number for each of them.
type Tilts = SVector<f64, TILTS>;
/// The covariance where a state keeps it.
pub(super) type CovarianceView<'a> = SMatrixView<'a, f64, STATES, STATES>;

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
    pub fn carry(&self, covariance: &CovarianceView<'_>, params: &EkfParams) -> Covariance {
        if self.time == 0.0 {
            return covariance.into_owned();
        }
        let fade = libm::exp(-self.time / params.gps_position_drift_time_s);
        let half = self.apply(covariance, fade).transpose();
        let mut carried = self.apply(&half.as_view(), fade);
        self.add_noise(&mut carried, params);
        symmetric(&carried)
    }

    /// The variances of the errors at the end: of position and velocity along the world's axes, and of the attitude
    /// about the axes to which `turn_BW` turns. As by [`Self::carry`], for a fifth of the work: each error at the end is one of
    /// position, velocity or neither at the beginning, and a weighted sum of those of attitude and biases.
    pub(crate) fn motion_variances(
        &self,
        covariance: &CovarianceView<'_>,
        turn_BW: &Matrix3<f64>,
        params: &EkfParams,
    ) -> [Vector3<f64>; 3] {
        let (shift, push) = (vector(self.shift).cross_matrix(), vector(self.push).cross_matrix());
        let [turn, turn_twice, tilt, tilt_twice] =
            [&self.turn, &self.turn_twice, &self.tilt, &self.tilt_twice].map(matrix);
        // Columns that follow each other are multiplied twice as fast as those of the whole.
        let tilts = covariance.fixed_view::<TILTS, TILTS>(ATTITUDE, ATTITUDE).into_owned();
        // The variance of a first error, which varies by `first`, plus the weighted ones, with which it varies by `with_first`.
        let sum = |first: f64, with_first: &Tilts, weights: &Tilts| {
            first + 2.0 * weights.dot(with_first) + weights.dot(&(tilts * weights))
        };
        let with = |state: usize| covariance.fixed_view::<TILTS, 1>(ATTITUDE, state).into_owned();
        let position = |axis: usize| {
            let (p, v) = (POSITION + axis, VELOCITY + axis);
            let first =
                covariance[(p, p)] + self.time * (2.0 * covariance[(p, v)] + self.time * covariance[(v, v)]);
            sum(first, &(with(p) + self.time * with(v)), &weights([&-shift, &tilt_twice, &-turn_twice], axis))
        };
        let velocity = |axis: usize| {
            let v = VELOCITY + axis;
            sum(covariance[(v, v)], &with(v), &weights([&-push, &tilt, &-turn], axis))
        };
        let body_turn = -turn_BW * turn;
        let attitude =
            |axis: usize| sum(0.0, &Tilts::zeros(), &weights([turn_BW, &body_turn, &Matrix3::zeros()], axis));
        let noises = self.motion_noises(params);
        [
            Vector3::from_fn(|axis, _| position(axis) + noises.position),
            Vector3::from_fn(|axis, _| velocity(axis) + noises.velocity),
            Vector3::from_fn(|axis, _| attitude(axis) + noises.attitude),
        ]
    }

    /// The transition matrix times `columns`.
    fn apply(&self, columns: &CovarianceView<'_>, gps_fade: f64) -> Covariance {
        let (shift, push) = (vector(self.shift).cross_matrix(), vector(self.push).cross_matrix());
        let [turn, turn_twice, tilt, tilt_twice] =
            [&self.turn, &self.turn_twice, &self.tilt, &self.tilt_twice].map(matrix);
        let mut applied = columns.into_owned();
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
        applied.fixed_rows_mut::<3>(GPS).scale_mut(gps_fade);
        applied
    }

    /// Adds the covariance of the noises. Their way through the attitude within the span is left out: it is three
    /// orders below the rest in the 20 ms that the filter carries its covariance at most.
    fn add_noise(&self, covariance: &mut Covariance, params: &EkfParams) {
        let time_s = self.time;
        let noises = self.motion_noises(params);
        for axis in 0..3 {
            let (position, velocity) = (POSITION + axis, VELOCITY + axis);
            covariance[(position, velocity)] += noises.position_velocity;
            covariance[(velocity, position)] += noises.position_velocity;
        }
        let fade = libm::exp(-2.0 * time_s / params.gps_position_drift_time_s);
        let mut add = |from: usize, count: usize, variance: f64| {
            (from..from + count).for_each(|state| covariance[(state, state)] += variance);
        };
        add(POSITION, 3, noises.position);
        add(VELOCITY, 3, noises.velocity);
        add(ATTITUDE, 3, noises.attitude);
        add(GYROSCOPE, 3, params.gyroscope_bias_walk_rad_s2_sqrt_hz.powi(2) * time_s);
        add(ACCELEROMETER, 3, params.accelerometer_bias_walk_m_s3_sqrt_hz.powi(2) * time_s);
        add(BAROMETER, 1, params.barometer_bias_walk_m_sqrt_s.powi(2) * time_s);
        for (axis, drift_m) in params.gps_position_drift_m.iter().enumerate() {
            add(GPS + axis, 1, drift_m.powi(2) * (1.0 - fade));
        }
    }

    /// Growth of the covariance of position, velocity and attitude by the IMU's noise, the same along every axis.
    fn motion_noises(&self, params: &EkfParams) -> MotionNoises {
        let force = params.accelerometer_noise_density_m_s2_sqrt_hz.powi(2);
        MotionNoises {
            position: force * self.time.powi(3) / 3.0,
            position_velocity: force * self.time.powi(2) / 2.0,
            velocity: force * self.time,
            attitude: params.gyroscope_noise_density_rad_s_sqrt_hz.powi(2) * self.time,
        }
    }
}

/// Variances along each axis, and the covariance of position and velocity along the same.
struct MotionNoises {
    /// m².
    position: f64,
    /// m²/s.
    position_velocity: f64,
    /// m²/s².
    velocity: f64,
    /// rad².
    attitude: f64,
}

/// The weights in row `row` of the matrices of attitude, gyroscope bias and accelerometer bias.
fn weights(matrices: [&Matrix3<f64>; 3], row: usize) -> Tilts {
    Tilts::from_fn(|state, _| matrices[state / 3][(row, state % 3)])
}

/// The mean of a matrix and its transpose, which rounding has let drift apart.
fn symmetric(covariance: &Covariance) -> Covariance {
    0.5 * (covariance + covariance.transpose())
}

fn matrix(flat: &[f64; 9]) -> Matrix3<f64> {
    Matrix3::from_column_slice(flat)
}

fn add(flat: &mut [f64; 9], change: &Matrix3<f64>) {
    flat.iter_mut().zip(change).for_each(|(value, change)| *value += change);
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    #[test]
    fn the_variances_of_the_motion_are_those_of_the_whole_covariance() {
        let params = EkfParams::default();
        let mut transition = Transition::default();
        for sample in 0..40 {
            let turn_WB = Rotation3::from_euler_angles(0.01 * f64::from(sample), 0.3, -0.2);
            transition.extend(turn_WB.matrix(), &Vector3::new(1.0, -2.0, 9.0 + f64::from(sample)), 2e-3);
        }
        let root = Covariance::from_fn(|row, column| ((3 * row + 7 * column) % 11) as f64 - 4.0);
        let covariance = root * root.transpose();
        let carried = transition.carry(&covariance.as_view(), &params);
        let turn_BW = Rotation3::from_euler_angles(0.5, -0.4, 2.0).into_inner();
        let block = |from: usize| carried.fixed_view::<3, 3>(from, from).into_owned();
        let attitude = turn_BW * block(ATTITUDE) * turn_BW.transpose();
        let expected = [block(POSITION), block(VELOCITY), attitude].map(|block| block.diagonal());
        let variances = transition.motion_variances(&covariance.as_view(), &turn_BW, &params);
        for (found, expected) in variances.iter().zip(&expected) {
            assert!((found - expected).amax() < 1e-12 * expected.amax(), "{found} for {expected}");
        }
    }
}
