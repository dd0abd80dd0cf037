//! Expected measurement of each sensor, and its dependence on the filter's errors.

use super::history::Measurement;
use super::motion::Motion;
use super::params::EkfParams;
use super::transition::{ATTITUDE, BAROMETER, CovarianceView, GPS, POSITION, STATES, VELOCITY};
use crate::wire::{attitude, vector};
use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

/// A measurement of `N` numbers against the expected one.
#[derive(Clone, Copy, Debug)]
pub struct Observation<const N: usize> {
    /// Measured less expected.
    pub innovation: SVector<f64, N>,
    /// Its derivatives with respect to the errors.
    pub jacobian: SMatrix<f64, N, STATES>,
    /// Variances of the measurement's own errors.
    pub variance: SVector<f64, N>,
}

impl<const N: usize> Observation<N> {
    fn new(innovation: SVector<f64, N>, sigma: SVector<f64, N>) -> Self {
        let variance = sigma.map(|sigma| sigma * sigma);
        Self { innovation, jacobian: SMatrix::zeros(), variance }
    }

    /// Makes the three rows from `row` on depend on the three errors from `state` on.
    fn with(mut self, row: usize, state: usize, block: &Matrix3<f64>) -> Self {
        self.jacobian.fixed_view_mut::<3, 3>(row, state).copy_from(block);
        self
    }
}

impl<const N: usize> Observation<N> {
    /// The covariance of the filter's errors with those of the expected measurement: `covariance` times the transposed
    /// derivatives, most of which are zero.
    pub fn cross_covariance(&self, covariance: &CovarianceView<'_>) -> SMatrix<f64, STATES, N> {
        let mut cross = SMatrix::<f64, STATES, N>::zeros();
        for (row, state, derivative) in self.derivatives() {
            cross.column_mut(row).axpy(derivative, &covariance.column(state), 1.0);
        }
        cross
    }

    /// The covariance of the innovation, from the covariance `cross` of the filter's errors with the expected measurement.
    pub fn spread(&self, cross: &SMatrix<f64, STATES, N>) -> SMatrix<f64, N, N> {
        let mut spread = SMatrix::<f64, N, N>::from_diagonal(&self.variance);
        for (row, state, derivative) in self.derivatives() {
            (0..N).for_each(|other| spread[(row, other)] += derivative * cross[(state, other)]);
        }
        spread
    }

    /// The derivatives that are not zero, each with its row and its error's number.
    fn derivatives(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        let all = self.jacobian.iter().enumerate();
        all.filter(|(_, derivative)| **derivative != 0.0)
            .map(|(place, derivative)| (place % N, place / N, *derivative))
    }
}

/// Position and velocity; the position drifts.
pub fn gps(motion: &Motion, measured: &Measurement, params: &EkfParams) -> Observation<6> {
    let [x, y, z, u, v, w, _] = measured.values;
    let position_W_m = Vector3::new(x, y, z) - vector(motion.position) - vector(motion.gps_drift);
    let velocity_W_m_s = Vector3::new(u, v, w) - vector(motion.velocity);
    let sigma = stack(&params.gps_position_noise_m.into(), &params.gps_velocity_noise_m_s.into());
    Observation::new(stack(&position_W_m, &velocity_W_m_s), sigma)
        .with(0, POSITION, &Matrix3::identity())
        .with(0, GPS, &Matrix3::identity())
        .with(3, VELOCITY, &Matrix3::identity())
}

/// Position and attitude.
pub fn mocap(motion: &Motion, measured: &Measurement, params: &EkfParams) -> Observation<6> {
    let [x, y, z, ..] = measured.values;
    let position_W_m = Vector3::new(x, y, z) - vector(motion.position);
    let turn_W = measured_attitude_WB(measured) * attitude(motion.attitude).inverse();
    let turn_rad = params.mocap_attitude_noise_deg.to_radians();
    let sigma = stack(&Vector3::repeat(params.mocap_position_noise_m), &Vector3::repeat(turn_rad));
    Observation::new(stack(&position_W_m, &turn_W.scaled_axis()), sigma)
        .with(0, POSITION, &Matrix3::identity())
        .with(3, ATTITUDE, &Matrix3::identity())
}

/// The attitude in a measurement of motion capture.
pub fn measured_attitude_WB(measured: &Measurement) -> UnitQuaternion<f64> {
    let [_, _, _, x, y, z, w] = measured.values;
    UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
}

/// Altitude, with a bias that walks.
pub fn barometer(motion: &Motion, measured: &Measurement, params: &EkfParams) -> Observation<1> {
    let innovation_m = measured.values[0] - motion.position.z - motion.barometer_bias;
    let mut observation =
        Observation::new(SVector::from([innovation_m]), SVector::from([params.barometer_noise_m]));
    observation.jacobian[(0, POSITION + 2)] = 1.0;
    observation.jacobian[(0, BAROMETER)] = 1.0;
    observation
}

/// The magnetic field in body axes: R_trueᵀ·m = Rᵀ·exp(−θ×)·m, nearly Rᵀ·(m + m × θ).
pub fn magnetometer(motion: &Motion, measured: &Measurement, params: &EkfParams) -> Observation<3> {
    let [x, y, z, ..] = measured.values;
    let to_body = attitude(motion.attitude).inverse();
    let field_W_T = params.field_W_T();
    let field_B_T = Vector3::new(x, y, z) - Vector3::from(params.magnetometer_hard_iron_T);
    let jacobian = to_body.to_rotation_matrix().into_inner() * field_W_T.cross_matrix();
    Observation::new(field_B_T - to_body * field_W_T, Vector3::repeat(params.magnetometer_noise_T))
        .with(0, ATTITUDE, &jacobian)
}

fn stack(upper: &Vector3<f64>, lower: &Vector3<f64>) -> SVector<f64, 6> {
    SVector::from([upper.x, upper.y, upper.z, lower.x, lower.y, lower.z])
}
